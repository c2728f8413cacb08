//! One cloth in one precision: its problem, its state, and the method that steps it.
//!
//! Problem and state are numbered for locality. Everybody outside names particles as the target does: what takes or gives
//! a particle here translates.

use super::hand::{Grip, Hand};
use super::tearing::{self, Watch};
use crate::forces::springs::SpringParams;
use crate::forces::{Cost, Problem, SpringSet};
use crate::math::{Real, Vector};
use crate::model::{Numbering, Particles, Seen, Topology};
use crate::scene::{Refusal, Scene};
use crate::simulators::{Build, Stepper};
use crate::target::QuadMesh;
use glam::DVec3;
use std::sync::Arc;

/// What a scene's target amounts to.
#[derive(Debug)]
pub(super) struct Shape {
    pub mesh: QuadMesh,
    pub topology: Topology,
    pub numbering: Arc<Numbering>,
}

impl Shape {
    pub fn of(mesh: QuadMesh) -> Self {
        let topology = Topology::of(&mesh);
        let numbering = Arc::new(Numbering::of(mesh.positions.len(), &topology));
        Self { mesh, topology, numbering }
    }
}

pub(super) struct Cloth<T: Real> {
    pub problem: Problem<T>,
    pub state: Particles<T>,
    numbering: Arc<Numbering>,
    stepper: Box<dyn Stepper<T>>,
    /// The shape that rest lengths are measured on, in the order of the target, m.
    rest_positions: Vec<T::Vec3>,
    /// Mean rest length of the springs that act, m; 0 without springs.
    pub mean_rest: f64,
    /// The particles that can move.
    pub free: Free,
    watch: Watch<T>,
    /// What the last step has seen.
    pub seen: Option<Seen>,
}

/// The particles that can move.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Free {
    pub count: usize,
    /// Of all, kg.
    pub mass: f64,
    /// Of the heaviest, kg.
    pub heaviest: f64,
}

impl<T: Real> Cloth<T> {
    /// Where a particle stands in problem and state.
    pub fn index(&self, particle: u32) -> usize {
        self.numbering.inner(particle) as usize
    }

    /// The particle that stands somewhere in problem and state.
    pub fn particle(&self, index: u32) -> u32 {
        self.numbering.source(index)
    }

    /// What stands in the order of problem and state, in that of the target.
    pub fn by_particle<V: Copy>(&self, values: &[V]) -> impl Iterator<Item = V> {
        self.numbering.in_source_order(values)
    }
}

impl<T: Build> Cloth<T> {
    /// The cloth of a scene, in the state given or at the start of the scene.
    pub fn new(
        scene: &Scene,
        shape: &Shape,
        mass: &[f64],
        state: Option<Particles<T>>,
    ) -> Result<Self, Refusal> {
        let rest_positions: Vec<T::Vec3> =
            shape.mesh.positions.iter().map(|p| T::Vec3::from_f64(*p)).collect();
        let numbering = Arc::clone(&shape.numbering);
        let state = state.unwrap_or_else(|| Particles::at_rest(numbering.to_inner(&rest_positions)));
        let set = SpringSet {
            topology: &shape.topology,
            rest_positions: &rest_positions,
            params: &scene.springs,
            broken: &state.broken,
        };
        let mass: Vec<T> = mass.iter().map(|m| T::from_f64(*m)).collect();
        let mut problem = Problem::new(numbering.to_inner(&mass), &set);
        problem.renumber_springs(&numbering);
        let stepper = T::build(&scene.simulator)?;
        let mut cloth = Self {
            problem,
            state,
            numbering,
            stepper,
            rest_positions,
            mean_rest: 0.0,
            free: Free::default(),
            watch: Watch::default(),
            seen: None,
        };
        cloth.measure_rest();
        cloth.set_environment(scene);
        Ok(cloth)
    }

    /// Takes over what a scene says besides target, mass and springs.
    pub fn set_environment(&mut self, scene: &Scene) {
        self.problem.air_damping = T::from_f64(scene.air_damping);
        self.problem.tearing = scene.tearing.enabled.then(|| tearing::limit(scene.tearing.max_ratio));
        self.problem.gravity = scene.gravity.acceleration();
        self.problem.wind = scene.wind.enabled.then(|| scene.wind.clone());
    }

    pub fn set_simulator(&mut self, scene: &Scene) -> Result<(), Refusal> {
        self.stepper = T::build(&scene.simulator)?;
        Ok(())
    }

    /// Builds the springs anew: kinds switched, rest lengths scaled, springs torn or whole again.
    pub fn set_springs(&mut self, params: &SpringParams, topology: &Topology) {
        self.problem.set_springs(&SpringSet {
            topology,
            rest_positions: &self.rest_positions,
            params,
            broken: &self.state.broken,
        });
        self.problem.renumber_springs(&self.numbering);
        self.measure_rest();
    }

    fn measure_rest(&mut self) {
        let rest = &self.problem.springs.rest;
        let sum: f64 = rest.iter().map(|r| r.to_f64()).sum();
        self.mean_rest = if rest.is_empty() { 0.0 } else { sum / rest.len() as f64 };
    }

    pub fn step(&mut self, dt: f64, cost: &mut Cost) {
        self.stepper.step(&self.problem, &mut self.state, T::from_f64(dt), cost);
        self.seen = self.state.seen.take();
    }

    /// Returns to a state of the same problem.
    pub fn put_back(&mut self, state: Particles<T>, params: &SpringParams, topology: &Topology) {
        let torn_differ = state.broken != self.state.broken;
        self.state = state;
        if torn_differ {
            self.set_springs(params, topology);
        }
    }

    pub fn stepper(&self) -> &dyn Stepper<T> {
        &*self.stepper
    }

    /// Makes particles immovable, known by their own numbers, and all others free.
    pub fn set_fixed(&mut self, fixed: impl Iterator<Item = u32>) {
        (0..self.problem.particles()).for_each(|index| self.problem.set_fixed(index, false));
        for particle in fixed {
            self.problem.set_fixed(self.index(particle), true);
        }
        let masses = self.problem.mass.iter().zip(&self.problem.inverse_mass);
        let free = masses.filter(|(_, w)| **w > T::ZERO).map(|(m, _)| m.to_f64());
        self.free = free.fold(Free::default(), |free, m| Free {
            count: free.count + 1,
            mass: free.mass + m,
            heaviest: free.heaviest.max(m),
        });
    }

    /// Takes over where hands that pull will be at the end of the next step.
    pub fn set_pulls(&mut self, hands: &[Hand]) {
        let Self { problem, numbering, .. } = self;
        problem.set_pulls(hands.iter().filter_map(|hand| match hand.grip {
            Grip::Pull(stiffness) => {
                Some((numbering.inner(hand.particle), T::Vec3::from_f64(hand.next()), stiffness))
            }
            Grip::Hold => None,
        }));
    }

    pub fn position(&self, particle: u32) -> DVec3 {
        self.state.positions[self.index(particle)].to_f64()
    }

    /// Moves a particle after a step.
    pub fn set_position(&mut self, particle: u32, to: DVec3) {
        let index = self.index(particle);
        let position = &mut self.state.positions[index];
        let from = std::mem::replace(position, T::Vec3::from_f64(to)).to_f64();
        if let Some(seen) = &mut self.seen {
            seen.way += from.distance(position.to_f64());
        }
    }

    /// Zero is taken as +0, so that x + dt v leaves every bit of x alone.
    pub fn set_velocity(&mut self, particle: u32, velocity: DVec3) {
        let index = self.index(particle);
        self.state.velocities[index] = T::Vec3::from_f64(velocity + DVec3::ZERO);
    }

    /// Breaks every acting spring longer than `max_ratio` x its rest length, all judged on the same positions; answers
    /// with how many.
    pub fn tear(&mut self, max_ratio: f64) -> usize {
        let torn = self.watch.torn(&self.problem, &self.state.positions, self.seen, max_ratio);
        if torn.is_empty() {
            return 0;
        }
        let springs = &self.problem.springs;
        self.state.broken.extend(torn.iter().map(|s| springs.ids[*s]));
        self.state.broken.sort_unstable();
        self.problem.remove_springs(&torn);
        self.state.memory.forget();
        self.measure_rest();
        torn.len()
    }
}
