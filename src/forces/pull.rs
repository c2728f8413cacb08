//! Pull: a spring from a hand to a particle, critically damped: F = κ (h - x) - 2 sqrt(κ m) v, h the hand's place.
//!
//! The gentle way to take hold: the particle stays free, feels the cloth, and follows the hand as far as the cloth lets it.

use crate::math::Real;

/// A hand that pulls at one particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull<T: Real> {
    /// Which.
    pub particle: u32,
    /// Where the hand is, m.
    pub to: T::Vec3,
    /// Stiffness κ, N/m.
    pub stiffness: T,
    /// Damping 2 sqrt(κ m), kg/s.
    pub damping: T,
}

impl<T: Real> Pull<T> {
    /// A critically damped pull at a particle of some mass (kg).
    pub fn new(particle: u32, to: T::Vec3, stiffness: f64, mass: T) -> Self {
        let damping = T::from_f64(2.0 * (stiffness * mass.to_f64()).sqrt());
        Self { particle, to, stiffness: T::from_f64(stiffness), damping }
    }

    /// The force (N) on the particle at a place (m) with a velocity (m/s).
    pub fn force(&self, position: T::Vec3, velocity: T::Vec3) -> T::Vec3 {
        (self.to - position) * self.stiffness - velocity * self.damping
    }
}

/// Adds the pulls to the force on their particles.
pub fn add<T: Real>(pulls: &[Pull<T>], positions: &[T::Vec3], velocities: &[T::Vec3], force: &mut [T::Vec3]) {
    for pull in pulls {
        let p = pull.particle as usize;
        force[p] += pull.force(positions[p], velocities[p]);
    }
}
