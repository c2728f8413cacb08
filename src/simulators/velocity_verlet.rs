//! Velocity Verlet (Swope, Andersen, Berens, Wilson, "A computer simulation method for the calculation of equilibrium
//! constants", 1982): positions by the acceleration at the start, velocities by the mean of both ends.
//!
//! a0 = a(t, x, v), x(t + dt) = x + dt v + dt²/2 a0, a1 = a(t + dt, x(t + dt), v + dt a0), v(t + dt) = v + dt/2 (a0 + a1).
//! Order 2; two force evaluations a step, since no force is remembered from the step before.
//!
//! The velocity is predicted for the second force: damping with the velocity of half the step, as leapfrog does, would
//! lower the order to 1. Undamped it is symplectic and keeps energy for ever. Choose it for accuracy just above the
//! stability limit, which is that of symplectic Euler: there it errs a hundred times less for twice the work.

use super::{Model, Simulator, region};
use crate::forces::{Cost, Mode, Problem, Spectrum};
use crate::math::Real;
use crate::model::Particles;

crate::params! {
    /// Velocity Verlet has no parameters of its own.
    pub struct VelocityVerlet {}
}

/// Scratch of [`VelocityVerlet`].
#[derive(Debug, Default)]
pub struct Buffers<T: Real> {
    /// Forces, N.
    force: Vec<T::Vec3>,
    /// Velocities advanced by half the step, m/s.
    halfway: Vec<T::Vec3>,
}

impl Simulator for VelocityVerlet {
    const ID: &'static str = "velocity_verlet";
    const SUMMARY: &'static str =
        "Velocity Verlet: second order at two force evaluations; accurate just above the stability limit.";
    const ORDER: u32 = 2;
    const MODEL: Model = Model::Springs;
    type Scratch<T: Real> = Buffers<T>;

    fn step<T: Real>(
        &self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        dt: T,
        scratch: &mut Buffers<T>,
        cost: &mut Cost,
    ) {
        let Buffers { force, halfway } = scratch;
        let (half, start) = (T::from_f64(0.5) * dt, state.time);
        force.resize(state.len(), T::Vec3::default());
        halfway.resize(state.len(), T::Vec3::default());
        problem.forces(state, force, cost);
        let particles = state.positions.iter_mut().zip(&mut state.velocities);
        for ((((x, v), h), &f), &w) in particles.zip(&mut *halfway).zip(&*force).zip(&problem.inverse_mass) {
            let acceleration = f * w;
            *h = *v + acceleration * half;
            *x += *h * dt;
            *v += acceleration * dt;
        }
        state.time = start + dt.to_f64();
        problem.forces(state, force, cost);
        state.time = start;
        for (((v, h), &f), &w) in state.velocities.iter_mut().zip(&*halfway).zip(&*force).zip(&problem.inverse_mass) {
            *v = *h + f * (w * half);
        }
    }

    /// Jury's criterion on the step's matrix: with q = dt² ω² and s = dt g its trace is 2 - q - s + s²/2 + q s/4. Undamped
    /// dt ω ≤ 2; damping lowers the limit.
    fn dt_limit(&self, spectrum: &Spectrum) -> Option<f64> {
        region::dt_limit(spectrum, |Mode { omega_squared, damping }, dt| {
            let (q, s) = (dt * dt * omega_squared, dt * damping);
            let [xx, xv] = [1.0 - q / 2.0, 1.0 - s / 2.0];
            let [vx, vv] = [-q + q * q / 4.0 + s * q / 2.0, 1.0 - s + s * s / 2.0 - q / 2.0 + q * s / 4.0];
            let (trace, determinant) = (xx + vv, xx * vv - xv * vx);
            // Both roots lie in the unit circle where this is at most 1.
            determinant.abs().max(trace.abs() - determinant)
        })
    }
}
