//! Experiments on a state: worlds that start from a snapshot, with other settings or from another place.

use super::cloth::{Cloth, Shape};
use super::{AnyState, Health, Jitter, Ledger, Snapshot, World, build_cloth};
use crate::forces::{Cost, Problem};
use crate::math::{Real, Vector};
use crate::model::{Memory, Numbering, Particles, Topology};
use crate::scene::{Place, Refusal, Scene};
use crate::target::QuadMesh;
use glam::DVec3;
use std::sync::Arc;

impl Snapshot {
    /// A world that goes on from here with an edited scene of the same target: its steps and work are counted from 0, its
    /// time goes on, and nobody holds a particle.
    ///
    /// # Errors
    /// Pins, mass or a method that do not fit the target; another target.
    pub fn branch(&self, scene: Scene) -> Result<World, Refusal> {
        if scene.target != self.scene.target {
            return Err(Refusal::new("target: a branch goes on with the same one"));
        }
        let pinned = if scene.pins == self.scene.pins {
            self.pinned.clone()
        } else {
            scene.pins.select(&scene.target, &self.shape.mesh)?
        };
        let mut cloth = build_cloth(&scene, &self.shape, Some(self.state.clone()))?;
        if scene != self.scene {
            match &mut cloth {
                super::AnyCloth::Single(c) => c.state.memory.forget(),
                super::AnyCloth::Double(c) => c.state.memory.forget(),
            }
        }
        let mut world = World {
            cloth,
            scene,
            place: Place::default(),
            shape: self.shape.clone(),
            report: self.report.clone(),
            pinned,
            hands: Vec::new(),
            step: 0,
            anchor: (0, self.time()),
            cost: Cost::default(),
            ledger: Ledger::default(),
            jitter: Jitter::default(),
            health: Health::default(),
            log: super::Log::default(),
            checkpoint: None,
            threads: None,
            stop: None,
        };
        world.prepare();
        world.open_ledger();
        Ok(world)
    }

    /// The same with the particles elsewhere (m) at other velocities (m/s), kept in double precision until a branch in
    /// single rounds them.
    #[must_use]
    pub fn moved(&self, positions: &[DVec3], velocities: &[DVec3]) -> Self {
        let broken = match &self.state {
            AnyState::Single(s) => s.broken.clone(),
            AnyState::Double(s) => s.broken.clone(),
        };
        let state = Particles {
            time: self.time(),
            positions: self.shape.numbering.to_inner(positions),
            velocities: self.shape.numbering.to_inner(velocities),
            broken,
            memory: Memory::default(),
            seen: None,
        };
        Self { state: AnyState::Double(state), ..self.clone() }
    }

    /// What a method solves here with an edited scene of the same target, in double precision, and the state; both in the
    /// order of the target's particles.
    ///
    /// # Errors
    /// Those of [`branch`](Self::branch).
    pub fn problem(&self, scene: &Scene) -> Result<(Problem<f64>, Particles<f64>), Refusal> {
        let scene = Scene { precision: crate::scene::Precision::Double, ..scene.clone() };
        match self.in_order_of_the_target().branch(scene)?.cloth {
            super::AnyCloth::Double(Cloth { problem, state, .. }) => Ok((problem, state)),
            super::AnyCloth::Single(_) => Err(Refusal::new("precision: Double was asked for")),
        }
    }

    /// The same state, stored as the target's particles stand.
    fn in_order_of_the_target(&self) -> Self {
        let Shape { mesh, topology, numbering } = &*self.shape;
        let mut same = self.clone();
        if !numbering.is_identity() {
            let own = Arc::new(Numbering::default());
            same.state.renumber(numbering, &own);
            same.shape = Arc::new(Shape { mesh: mesh.clone(), topology: topology.clone(), numbering: own });
        }
        same
    }

    /// Simulated time, s.
    pub fn time(&self) -> f64 {
        self.anchor.1 + (self.step - self.anchor.0) as f64 * self.scene.dt
    }

    /// For each particle, whether it is pinned.
    pub fn pinned(&self) -> &[bool] {
        &self.pinned
    }

    /// The mesh in its rest shape.
    pub fn mesh(&self) -> &QuadMesh {
        &self.shape.mesh
    }

    /// All springs, those that do not act included.
    pub fn topology(&self) -> &Topology {
        &self.shape.topology
    }

    /// Positions, m, and velocities, m/s.
    pub fn motion(&self) -> (Vec<DVec3>, Vec<DVec3>) {
        fn double<T: Real>(state: &Particles<T>, numbering: &Numbering) -> (Vec<DVec3>, Vec<DVec3>) {
            let all = |from: &[T::Vec3]| numbering.in_source_order(from).map(Vector::to_f64).collect();
            (all(&state.positions), all(&state.velocities))
        }
        match &self.state {
            AnyState::Single(s) => double(s, &self.shape.numbering),
            AnyState::Double(s) => double(s, &self.shape.numbering),
        }
    }
}
