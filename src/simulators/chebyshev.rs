//! Chebyshev acceleration of iterations that converge linearly (Wang, "A Chebyshev semi-iterative approach for accelerating
//! projective and position-based dynamics", 2015).
//!
//! After each iteration x goes on to x(n-1) + ω (x - x(n-1)), ω1 = 1, ω2 = 2/(2 - ρ²), ω(n+1) = 4/(4 - ρ² ω(n)), where ρ is the part of
//! its error that an iteration leaves. Where ρ is taken too small less is gained; too large, iterations overshoot.

use crate::math::Real;

/// The last two iterates.
#[derive(Clone, Debug, Default)]
pub(super) struct Chebyshev<T: Real> {
    last: Vec<T::Vec3>,
    before: Vec<T::Vec3>,
    omega: f64,
}

impl<T: Real> Chebyshev<T> {
    /// Starts from a first guess.
    pub fn begin(&mut self, rho: f64, guess: &[T::Vec3]) {
        self.omega = 0.0;
        if rho > 0.0 {
            self.last.clear();
            self.last.extend_from_slice(guess);
        }
    }

    /// Takes what an iteration made of the last iterate further.
    pub fn accelerate(&mut self, rho: f64, x: &mut [T::Vec3]) {
        if rho <= 0.0 {
            return;
        }
        let (first, square) = (self.omega == 0.0, rho * rho);
        self.omega = match self.omega {
            0.0 => 1.0,
            1.0 => 2.0 / (2.0 - square),
            omega => 4.0 / (4.0 - square * omega),
        };
        if !first {
            let omega = T::from_f64(self.omega);
            x.iter_mut().zip(&self.before).for_each(|(x, &before)| *x = before + (*x - before) * omega);
        }
        std::mem::swap(&mut self.last, &mut self.before);
        self.last.clear();
        self.last.extend_from_slice(x);
    }
}
