//! Wind: an oscillating force that is the same for every particle, in simulated time.

use glam::DVec3;

crate::params! {
    /// Oscillating wind, thesis eq. 2.8: F(t) = A (1 - cos²(π f t)) along a unit direction, N per particle,
    /// t = simulated time.
    pub struct Wind {
        /// Whether wind blows.
        enabled: bool = false;
        /// Largest force A on a particle.
        strength: f64 = 10.0, unit "N", range 0.0..=1e9, slider log 0.0..=100.0;
        /// Gusts per second f.
        frequency: f64 = 0.2, unit "Hz", range 0.0..=1e6, slider linear 0.0..=5.0;
        /// Where the wind blows to; its length does not matter, but must not be zero.
        #[serde(with = "crate::params::vector")]
        direction: DVec3 = DVec3::new(-0.2, 0.15, 0.85), range -1e6..=1e6, slider linear -1.0..=1.0;
    }
}

impl Wind {
    /// The force on every particle at `time` (s), N. 1 - cos² is computed as sin², which is exact near its zeros, with
    /// a sine that gives the same bits on every machine.
    pub fn force(&self, time: f64) -> DVec3 {
        let gust = libm::sin(std::f64::consts::PI * self.frequency * time);
        // Scaled first: the square of a very short direction's length would be 0.
        let direction = self.direction / self.direction.abs().max_element();
        direction.normalize_or_zero() * (self.strength * gust * gust)
    }
}
