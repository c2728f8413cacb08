//! The state that changes while the cloth moves.

use crate::math::Real;

/// Everything that a step reads and writes. A clone is a snapshot.
#[derive(Clone, Debug, PartialEq)]
pub struct Particles<T: Real> {
    /// Simulated time, s.
    pub time: f64,
    /// Positions, m.
    pub positions: Vec<T::Vec3>,
    /// Velocities, m/s. Zero where a particle is pinned, the hand's where it is held.
    pub velocities: Vec<T::Vec3>,
    /// Springs that have torn, by index among all springs of the topology, sorted.
    pub broken: Vec<u32>,
    /// What the method carries from step to step besides positions and velocities.
    pub memory: Memory<T>,
    /// What the step under way has seen, if its method tells; none before it. A method that moves particles besides says none.
    pub seen: Option<Seen>,
}

/// What a step sees while it has particles and springs at hand, which saves looking at them once more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Σ |v|² of all particles after it, m²/s².
    pub squares: f64,
    /// The longest way of a particle, m.
    pub way: f64,
    /// How much longer any spring could at least have been before it without tearing, m; infinite where none tears.
    pub left: f64,
}

/// What a method carries from step to step: the last state of a multistep method, a force, the step size of a controller.
/// Empty for most methods and at every fresh start: of the scene, and after a change of method, dt, masses, springs, pins,
/// forces or which particles hands are on, after which a method takes the step that it would take at the very beginning.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Memory<T: Real> {
    /// Vectors, as many as the method likes.
    pub vectors: Vec<T::Vec3>,
    /// Numbers.
    pub numbers: Vec<f64>,
}

impl<T: Real> Memory<T> {
    /// Starts afresh.
    pub fn forget(&mut self) {
        self.vectors.clear();
        self.numbers.clear();
    }
}

impl<T: Real> Particles<T> {
    /// Particles at rest at time 0.
    pub fn at_rest(positions: Vec<T::Vec3>) -> Self {
        let velocities = vec![T::Vec3::default(); positions.len()];
        Self { time: 0.0, positions, velocities, broken: Vec::new(), memory: Memory::default(), seen: None }
    }

    /// Number of particles.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
}
