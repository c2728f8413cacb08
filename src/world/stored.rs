//! Snapshots as text: a running simulation that can be written down, and go on from there in another process.

use super::packed::{Counts, Packed};
use super::{AnyState, Entry, Hand, Ledger, Log, Snapshot, World, build_cloth, build_shape};
use crate::forces::Cost;
use crate::model::{Memory, Particles};
use crate::scene::{Place, Precision, Refusal, Scene};
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A snapshot to be written down. It holds the whole scene and every command, but no mesh: that is read again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stored {
    scene: Scene,
    step: u64,
    anchor: (u64, f64),
    time: f64,
    particles: usize,
    hands: Vec<Hand>,
    torn: Vec<u32>,
    /// What the method remembers: numbers, and how many vectors.
    numbers: Vec<f64>,
    vectors: usize,
    cost: Cost,
    ledger: Ledger,
    commands: Vec<Entry>,
    /// The bits of the particles, packed, in base64.
    state: String,
}

/// Most that a method remembers: several states of all particles, and a few numbers.
const MOST_VECTORS: usize = 16;
const MOST_NUMBERS: usize = 1 << 16;

impl From<Packed> for Stored {
    fn from(Packed { rest, counts, bytes }: Packed) -> Self {
        let (time, torn, numbers) = match rest.state {
            AnyState::Single(s) => (s.time, s.broken, s.memory.numbers),
            AnyState::Double(s) => (s.time, s.broken, s.memory.numbers),
        };
        Self {
            scene: rest.scene,
            step: rest.step,
            anchor: rest.anchor,
            time,
            particles: counts.particles,
            hands: rest.hands,
            torn,
            numbers,
            vectors: counts.vectors,
            cost: rest.cost,
            ledger: rest.ledger,
            commands: rest.log.to_vec(),
            state: BASE64_STANDARD.encode(bytes),
        }
    }
}

impl Stored {
    /// The scene as it was then.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The snapshot again; its mesh is looked for in `place`.
    ///
    /// # Errors
    /// A target that cannot be read or is no longer the one that was simulated; a file that was damaged.
    pub fn snapshot(self, place: &Place) -> Result<Snapshot, Refusal> {
        let (shape, report) = build_shape(&self.scene, place)?;
        let (particles, springs) =
            (shape.mesh.positions.len(), shape.topology.pairs.iter().map(Vec::len).sum::<usize>());
        if particles != self.particles {
            return Err(Refusal::new(format!(
                "the target has {particles} particles, but had {} when it was simulated",
                self.particles
            )));
        }
        let rises = |list: &[u32], end: usize| {
            list.is_sorted_by(|a, b| a < b) && list.last().is_none_or(|p| (*p as usize) < end)
        };
        let held: Vec<u32> = self.hands.iter().map(|hand| hand.particle).collect();
        let is_sound = self.step >= self.anchor.0
            && rises(&held, particles)
            && rises(&self.torn, springs)
            && self.vectors <= MOST_VECTORS * particles
            && self.numbers.len() <= MOST_NUMBERS;
        let bytes = BASE64_STANDARD.decode(&self.state).ok().filter(|_| is_sound);
        let bytes = bytes.ok_or_else(|| Refusal::new("the state is damaged"))?;
        let state = match self.scene.precision {
            Precision::Single => AnyState::Single(empty(self.time, self.torn, self.numbers)),
            Precision::Double => AnyState::Double(empty(self.time, self.torn, self.numbers)),
        };
        let rest = Snapshot {
            scene: self.scene,
            shape,
            report,
            pinned: Vec::new(),
            hands: self.hands,
            state,
            step: self.step,
            anchor: self.anchor,
            cost: self.cost,
            ledger: self.ledger,
            log: self.commands.into_iter().collect::<Log>(),
        };
        let counts = Counts { particles, vectors: self.vectors };
        Packed { rest, counts, bytes }.unpack()
    }
}

fn empty<T: crate::math::Real>(time: f64, broken: Vec<u32>, numbers: Vec<f64>) -> Particles<T> {
    let memory = Memory { vectors: Vec::new(), numbers };
    Particles { time, positions: Vec::new(), velocities: Vec::new(), broken, memory, seen: None }
}

impl World {
    /// A world that goes on from a snapshot, with its commands; meshes that are set later are looked for in `place`.
    ///
    /// # Errors
    /// A snapshot that was read from a damaged file: mass or a method that do not fit the target.
    pub fn resume(snapshot: &Snapshot, place: Place) -> Result<Self, Refusal> {
        let cloth = build_cloth(&snapshot.scene, &snapshot.shape, Some(snapshot.state.clone()))?;
        let built = (Arc::clone(&snapshot.shape), Arc::clone(&snapshot.report));
        let mut world = Self::of(snapshot.scene.clone(), place, built, cloth);
        world.restore(snapshot);
        Ok(world)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::to_ron;
    use crate::world::Command;
    use glam::DVec3;

    /// In the middle of a drag, torn, with a method that remembers.
    fn world() -> World {
        let scene = "(simulator: (id: \"bdf2\"), dt: 0.01, tearing: (enabled: true, max_ratio: 1.05))";
        let mut world = World::new(Scene::from_ron(scene).unwrap(), Place::default()).unwrap();
        world.apply(Command::Grab { particles: vec![300, 312] }).unwrap();
        world
            .apply(Command::Drag { particle: 312, to: DVec3::new(1.0, 1.0 / 3.0, 0.1), steps: 200 })
            .unwrap();
        (0..100).for_each(|_| world.step());
        world
    }

    #[test]
    fn a_simulation_goes_on_from_text_as_if_nothing_had_been() {
        let mut world = world();
        assert!(!world.broken().is_empty());
        let text = to_ron(&Stored::from(Packed::new(&world.snapshot()))).unwrap();
        let read: Stored = ron::from_str(&text).unwrap();
        let mut again = World::resume(&read.snapshot(&Place::default()).unwrap(), Place::default()).unwrap();
        assert_eq!((again.digest(), again.log()), (world.digest(), world.log()));
        for world in [&mut world, &mut again] {
            (0..50).for_each(|_| world.step());
            world.apply(Command::Release { particles: vec![312] }).unwrap();
            (0..100).for_each(|_| world.step());
        }
        assert_eq!(
            (again.digest(), again.cost(), again.time()),
            (world.digest(), world.cost(), world.time())
        );
    }

    #[test]
    fn what_is_damaged_is_refused_in_a_line() {
        let good = Stored::from(Packed::new(&world().snapshot()));
        assert!(good.clone().snapshot(&Place::default()).is_ok());
        let state = good.state.clone();
        let spoilt: [fn(&mut Stored); 9] = [
            |s| s.state.truncate(1000),
            |s| s.state = "no base64!".to_owned(),
            |s| s.particles = 7,
            |s| s.step = 0,
            |s| s.anchor.0 = u64::MAX,
            |s| s.vectors = usize::MAX,
            |s| s.torn.push(u32::MAX),
            |s| s.hands[1].particle = u32::MAX,
            |s| s.scene.precision = Precision::Single,
        ];
        for (i, spoil) in spoilt.iter().enumerate() {
            let mut bad = Stored { state: state.clone(), ..good.clone() };
            bad.anchor = (1, 0.01);
            spoil(&mut bad);
            assert!(bad.snapshot(&Place::default()).is_err(), "{i}");
        }
    }
}
