//! Air damping: F = -c v on every particle.

use crate::math::Real;

/// Adds -c v to the force on every particle; `coefficient` is c, kg/s.
pub fn add<T: Real>(coefficient: T, velocities: &[T::Vec3], force: &mut [T::Vec3]) {
    for (f, &v) in force.iter_mut().zip(velocities) {
        *f -= v * coefficient;
    }
}
