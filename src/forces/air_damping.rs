//! Air damping: F = -c v on every particle.

use std::ops::{Mul, Neg};

/// -c v, of a vector or of components; `coefficient` is c, kg/s.
#[expect(clippy::inline_always, reason = "kernels call it")]
#[inline(always)]
pub fn force<V: Mul<C, Output = V> + Neg<Output = V>, C>(coefficient: C, velocity: V) -> V {
    -(velocity * coefficient)
}
