//! Explicit Euler (thesis 4.1): positions and velocities both advance with the derivatives at the start of the step.
//!
//! x(t + dt) = x + dt v, v(t + dt) = v + dt a(t, x, v). Order 1; one force evaluation a step.
//!
//! It adds energy to every oscillation: amplitudes grow by sqrt(1 + dt² ω²) a step unless damping takes away more, so
//! an undamped cloth has no stable dt at all. It is here to be seen bursting, and to be compared with.

use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::Real;
use crate::model::Particles;

crate::params! {
    /// Explicit Euler has no parameters of its own.
    pub struct ExplicitEuler {}
}

impl Simulator for ExplicitEuler {
    const ID: &'static str = "explicit_euler";
    const SUMMARY: &'static str = "Explicit Euler: the simplest method; gains energy and bursts on stiff cloth.";
    const ORDER: u32 = 1;
    const MODEL: Model = Model::Springs;
    /// Forces, N.
    type Scratch<T: Real> = Vec<T::Vec3>;

    fn step<T: Real>(
        &self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        dt: T,
        force: &mut Vec<T::Vec3>,
        cost: &mut Cost,
    ) {
        force.resize(state.len(), T::Vec3::default());
        problem.forces(state, force, cost);
        let particles = state.positions.iter_mut().zip(&mut state.velocities);
        for (((x, v), &f), &w) in particles.zip(&*force).zip(&problem.inverse_mass) {
            *x += *v * dt;
            *v += f * (w * dt);
        }
    }

    /// A motion x'' + g x' + ω² x = 0 has λ = (-g ± sqrt(g² - 4ω²)) / 2 and stays bounded while |1 + dt λ| ≤ 1:
    /// dt ≤ g / ω² where it oscillates, dt ≤ 2 / |λ| where it creeps. The fastest and the most damped motion decide.
    fn dt_limit(&self, spectrum: &Spectrum) -> Option<f64> {
        let limit = |g: f64, omega: f64| {
            let discriminant = g * g - 4.0 * omega * omega;
            if discriminant < 0.0 { g / (omega * omega) } else { 4.0 / (g + discriminant.sqrt()) }
        };
        let fastest = limit(spectrum.damping_at_omega_max, spectrum.omega_max);
        let most_damped = limit(spectrum.damping_max, 0.0);
        Some(fastest.min(most_damped)).filter(|dt| dt.is_finite())
    }
}
