//! What a user can do to a running simulation, as values: so that it can be logged, replayed and sent to several worlds.

use crate::params::vector;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// One act of the user, applied between two steps. Particles are named by index.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Command {
    /// Takes hold of particles: they stay where the hand is until released. A pinned one may be held too.
    Grab {
        /// Which.
        particles: Vec<u32>,
    },
    /// Takes hold of particles by a critically damped spring each: they stay free and follow as far as the cloth lets
    /// them. A pinned one does not move.
    Pull {
        /// Which.
        particles: Vec<u32>,
        /// Stiffness of the spring, N/m, 0 to 1e9.
        stiffness: f64,
    },
    /// Moves the hand that holds or pulls a particle to a point, straight and evenly over the next steps. Giving as many steps
    /// as pass until the next such command makes a hand's path independent of the frame rate.
    Drag {
        /// Which; it must be held.
        particle: u32,
        /// Where to, m.
        #[serde(with = "vector")]
        to: DVec3,
        /// Steps that it takes, at least 1.
        steps: u32,
    },
    /// Lets go: a held particle keeps the velocity that the hand had over the last tenth of a second of simulated time, a
    /// pinned one stays where it was put, a pulled one flies on as it is.
    Release {
        /// Which.
        particles: Vec<u32>,
    },
    /// Pins particles where they are.
    Pin {
        /// Which.
        particles: Vec<u32>,
    },
    /// Frees pinned particles.
    Free {
        /// Which.
        particles: Vec<u32>,
    },
    /// Sets what a path in the scene names from RON text, as in `springs.stretch.stiffness`.
    Set {
        /// The path.
        key: String,
        /// The value.
        value: String,
    },
    /// Puts the cloth back to the start of its scene: shape, time, torn springs.
    Reset,
}

/// Stiffest pull, N/m.
pub const STIFFEST_PULL: f64 = 1e9;

/// Farthest that a hand may reach from the origin along an axis, m: squares of distances stay finite in single precision.
pub const REACH: f64 = 1e12;
