//! Symplectic Euler (thesis 4.2): the velocity advances first, and the position with the new velocity.
//!
//! v(t + dt) = v + dt a(t, x, v), x(t + dt) = x + dt v(t + dt). Order 1; one force evaluation a step. The same positions
//! as position Verlet with spring forces, started with x(-dt) = x - dt v.
//!
//! Costs what explicit Euler costs, but keeps the energy of an undamped cloth near its true value for ever (Hairer,
//! Lubich, Wanner, "Geometric Numerical Integration", 2006, I.1) while dt < 2/ω of the fastest motion.

use super::{Model, Simulator};
use crate::forces::{Ahead, Cost, Problem, Spectrum, Update};
use crate::math::Real;
use crate::math::lanes::Lanes;
use crate::model::Particles;

crate::params! {
    /// Symplectic Euler has no parameters of its own.
    pub struct SymplecticEuler {}
}

impl Update for SymplecticEuler {
    #[expect(clippy::inline_always, reason = "a kernel's")]
    #[inline(always)]
    fn advance<L: Lanes>(x: L, v: L, a: L, dt: L) -> [L; 2] {
        let v = v + a * dt;
        [x + v * dt, v]
    }
}

impl Simulator for SymplecticEuler {
    const ID: &'static str = "symplectic_euler";
    const SUMMARY: &'static str = "Symplectic Euler: cheap and sturdy up to its stability limit; the one to start with.";
    const ORDER: u32 = 1;
    const MODEL: Model = Model::Springs;
    type Scratch<T: Real> = Ahead<T>;

    fn step<T: Real>(
        &self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        dt: T,
        ahead: &mut Ahead<T>,
        cost: &mut Cost,
    ) {
        problem.advance::<Self>(state, dt, ahead, cost);
    }

    /// With damping taken at the old velocity a motion x'' + g x' + ω² x = 0 stays bounded while dt² ω² + 2 dt g ≤ 4, so
    /// dt = (-g + sqrt(g² + 4ω²)) / ω², here written so that ω = 0 (2/g) and g = 0 (2/ω) need no cases. The motion that
    /// asks most is found by taking the most critical one for a dt, and the dt that is right for that one, in turn.
    fn dt_limit(&self, spectrum: &Spectrum) -> Option<f64> {
        let limit = |mode: crate::forces::Mode| {
            let (g, omega_squared) = (mode.damping, mode.omega_squared.max(0.0));
            4.0 / (g + (g * g + 4.0 * omega_squared).sqrt())
        };
        let mut dt = limit(spectrum.extreme(1.0, 0.0));
        for _ in 0..4 {
            let next = dt.min(limit(spectrum.extreme(dt * dt, 2.0 * dt)));
            if dt - next <= 1e-6 * dt {
                break;
            }
            dt = next;
        }
        Some(dt).filter(|dt| dt.is_finite())
    }
}
