//! Gravity: F = m g, along -y.

use crate::math::{Real, Vector};
use glam::DVec3;

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

/// Adds m g to the force on every particle.
pub fn add<T: Real>(acceleration: DVec3, mass: &[T], force: &mut [T::Vec3]) {
    let g = T::Vec3::from_f64(acceleration);
    for (f, &m) in force.iter_mut().zip(mass) {
        *f += g * m;
    }
}
