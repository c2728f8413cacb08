//! Explicit Euler (thesis 4.1): positions and velocities both advance with the derivatives at the start of the step.
//!
//! x(t + dt) = x + dt v, v(t + dt) = v + dt a(t, x, v). Order 1; one force evaluation a step.
//!
//! It adds energy to every oscillation: amplitudes grow by sqrt(1 + dt² ω²) a step unless damping takes away more, so
//! an undamped cloth has no stable dt at all. It is here to be seen bursting, and to be compared with.

use super::{Model, Simulator, region};
use crate::forces::{Ahead, Cost, Mode, Problem, Spectrum, Update};
use crate::math::Real;
use crate::math::lanes::Lanes;
use crate::model::Particles;

crate::params! {
    /// Explicit Euler has no parameters of its own.
    pub struct ExplicitEuler {}
}

impl Update for ExplicitEuler {
    #[expect(clippy::inline_always, reason = "a kernel's")]
    #[inline(always)]
    fn advance<L: Lanes>(x: L, v: L, a: L, dt: L) -> [L; 2] {
        [x + v * dt, v + a * dt]
    }
}

impl Simulator for ExplicitEuler {
    const ID: &'static str = "explicit_euler";
    const SUMMARY: &'static str = "Explicit Euler: the simplest method; gains energy and bursts on stiff cloth.";
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

    /// A motion x'' + g x' + ω² x = 0 stays bounded while dt ω² ≤ g (where it oscillates) and 2 dt g - dt² ω² ≤ 4 (where
    /// it creeps), by Jury's criterion on z² - (2 - dt g) z + 1 - dt g + dt² ω².
    fn dt_limit(&self, spectrum: &Spectrum) -> Option<f64> {
        region::dt_limit(spectrum, |Mode { omega_squared, damping }| {
            let creeping = damping * damping - 4.0 * omega_squared;
            if creeping >= 0.0 { 4.0 / (damping + creeping.sqrt()) } else { damping / omega_squared }
        })
    }
}
