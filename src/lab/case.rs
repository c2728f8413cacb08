//! What is studied: a scene in a state and the time that is compared; and the settings in which trials of it differ.

use crate::scene::{Place, Precision, Refusal, Scene};
use crate::simulators::{self, Model, SimulatorSettings, Value};
use crate::world::{Snapshot, World};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A scene in a state, and how long it is looked at.
#[derive(Clone)]
pub struct Case {
    start: Arc<Snapshot>,
    place: Place,
    /// Simulated time that is compared, s.
    pub seconds: f64,
    /// Equally spaced times up to `seconds` at which positions are compared.
    pub samples: u32,
}

/// Times at which positions are compared, where nothing else is asked for.
pub const SAMPLES: u32 = 5;

/// The settings in which trials differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Name of the method.
    pub simulator: String,
    /// Arithmetic.
    pub precision: Precision,
    /// Time step, s.
    pub dt: f64,
    /// The method's parameters that differ from their defaults.
    pub params: BTreeMap<String, Value>,
}

impl Settings {
    /// Those of a scene.
    pub fn of(scene: &Scene) -> Self {
        Self {
            simulator: scene.simulator.id.clone(),
            precision: scene.precision,
            dt: scene.dt,
            params: scene.simulator.params.clone(),
        }
    }

    /// A method in double precision, its parameters at their defaults.
    pub fn double(simulator: &str, dt: f64) -> Self {
        Self { simulator: simulator.to_owned(), precision: Precision::Double, dt, params: BTreeMap::new() }
    }

    /// The scene with these settings.
    pub fn apply(&self, scene: &Scene) -> Scene {
        let simulator = SimulatorSettings { id: self.simulator.clone(), params: self.params.clone() };
        Scene { simulator, precision: self.precision, dt: self.dt, ..scene.clone() }
    }

    /// Whether the method solves the springs of the scene.
    pub fn same_model(&self) -> bool {
        simulators::find(&self.simulator).is_ok_and(|entry| entry.model == Model::Springs)
    }

    /// The method in words: `verlet sweeps=10 Double`.
    pub fn label(&self) -> String {
        let mut words = vec![self.simulator.clone()];
        words.extend(self.params.iter().map(|(name, value)| format!("{name}={value}")));
        words.push(format!("{:?}", self.precision));
        words.join(" ")
    }
}

impl Case {
    /// A scene from its start.
    ///
    /// # Errors
    /// Those of [`World::new`].
    pub fn new(scene: Scene, place: Place, seconds: f64) -> Result<Self, Refusal> {
        let start = World::new(scene, place.clone())?.snapshot();
        Ok(Self::at(start, place, seconds))
    }

    /// A scene from the state that a world is in.
    pub fn at(start: Snapshot, place: Place, seconds: f64) -> Self {
        Self { start: Arc::new(start), place, seconds, samples: SAMPLES }
    }

    /// The same from another state.
    #[must_use]
    pub fn from(&self, start: Snapshot) -> Self {
        Self { start: Arc::new(start), ..self.clone() }
    }

    /// The same over another time (s).
    #[must_use]
    pub fn lasting(&self, seconds: f64) -> Self {
        Self { seconds, ..self.clone() }
    }

    /// The scene as it stands.
    pub fn scene(&self) -> &Scene {
        self.start.scene()
    }

    /// The state that every trial starts from.
    pub fn start(&self) -> &Snapshot {
        &self.start
    }

    /// A world in that state with an edited scene. One of another target starts from its own beginning.
    ///
    /// # Errors
    /// A scene that cannot be built.
    pub fn world(&self, scene: Scene) -> Result<World, Refusal> {
        if scene.target == self.scene().target {
            self.start.branch(scene)
        } else {
            World::new(scene, self.place.clone())
        }
    }

    /// For each particle, whether it can move.
    pub fn free(&self) -> Vec<bool> {
        self.start.pinned().iter().map(|pinned| !pinned).collect()
    }

    /// Steps of about `dt` (s) that fill the compared time, as many between any two samples.
    pub fn steps(&self, dt: f64) -> u64 {
        let samples = f64::from(self.samples.max(1));
        let between = (self.seconds / samples / dt).round();
        (between.clamp(1.0, 1e15) * samples) as u64
    }

    /// The step (s) of which `steps` fill the compared time.
    pub fn dt(&self, steps: u64) -> f64 {
        self.seconds / steps as f64
    }

    /// A number for what the trajectory depends on, and no more: not the method, nor its dt and precision.
    pub fn key(&self) -> u64 {
        let scene = Scene {
            simulator: SimulatorSettings::default(),
            precision: Precision::Double,
            dt: 0.0,
            ..self.scene().clone()
        };
        let (positions, velocities) = self.start.motion();
        let numbers = [self.seconds, f64::from(self.samples), self.start.time()];
        let moving = positions.iter().chain(&velocities).chain(&self.start.mesh().positions);
        let numbers = moving.flat_map(glam::DVec3::to_array).chain(numbers);
        let bits: Vec<u64> = numbers.map(f64::to_bits).collect();
        hash(&format!("{}\n{:?}\n{scene:?}\n{bits:?}", env!("CARGO_PKG_VERSION"), self.start.pinned()))
    }
}

/// FNV-1a (Fowler, Noll, Vo) of a text.
pub fn hash(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}
