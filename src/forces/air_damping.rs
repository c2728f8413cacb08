//! Air damping: F = -c v on every particle.

use crate::math::Real;

/// -c v; `coefficient` is c, kg/s.
#[inline]
pub fn force<T: Real>(coefficient: T, velocity: T::Vec3) -> T::Vec3 {
    -(velocity * coefficient)
}
