//! Gravity: F = m g, along -y.

use glam::DVec3;
use std::ops::Mul;

crate::params! {
    /// The weight of the particles: F = m g along -y, N.
    pub struct Gravity {
        /// Whether gravity acts.
        enabled: bool = true;
        /// Acceleration g along -y.
        magnitude: f64 = 10.0, unit "m/s²", range 0.0..=1e6, slider linear 0.0..=30.0;
    }
}

impl Gravity {
    /// The acceleration g as a vector, m/s²; `None` where it is switched off.
    pub fn acceleration(&self) -> Option<DVec3> {
        self.enabled.then(|| DVec3::new(0.0, -self.magnitude, 0.0))
    }
}

/// m g, of a vector or of components.
#[expect(clippy::inline_always, reason = "kernels call it")]
#[inline(always)]
pub fn force<A: Mul<M, Output = A>, M>(acceleration: A, mass: M) -> A {
    acceleration * mass
}
