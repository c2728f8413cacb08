//! Velocity Verlet (Swope, Andersen, Berens, Wilson, "A computer simulation method for the calculation of equilibrium
//! constants", 1982): positions by the acceleration at the start, velocities by the mean of both ends.
//!
//! x(t + dt) = x + dt v + dt²/2 a, a' = a(t + dt, x(t + dt), v + dt a), v(t + dt) = v + dt/2 (a + a'); a' is a of the next step.
//! Order 2 at one force evaluation a step.
//!
//! The velocity is predicted for the force: damping with the velocity of half the step, as leapfrog does, would lower the
//! order to 1. The prediction is off by dt²/2 of the jerk, so that the acceleration may be kept for the next step, at whose
//! start time and positions are the same. It is the method's memory: where there is none (at the start, and after any change of
//! method, dt, springs, pins, hands or surroundings) the first one is computed, two in that step. So it is in every step in which
//! a hand moves or pulls: the velocity of a particle that is held and the point that a hand pulls towards jump from one step
//! to the next, and a kept acceleration would know those of the step before, half a step late on average.
//!
//! Undamped it is symplectic and keeps energy for ever. Choose it for accuracy at steps just below the stability limit: undamped that is
//! the limit of symplectic Euler, at whose cost it errs a hundred times less. Strong damping halves its limit beside that.

use super::{Model, Simulator};
use crate::forces::{Cost, Mode, Problem, Spectrum};
use crate::math::Real;
use crate::math::rows::{self, Start};
use crate::model::Particles;

crate::params! {
    /// Velocity Verlet has no parameters of its own.
    pub struct VelocityVerlet {}
}

/// Scratch of [`VelocityVerlet`]: accelerations at both ends of the step, m/s².
#[derive(Debug, Default)]
pub struct Ends<T: Real> {
    before: Vec<T::Vec3>,
    after: Vec<T::Vec3>,
}

impl Simulator for VelocityVerlet {
    const ID: &'static str = "velocity_verlet";
    const SUMMARY: &'static str =
        "Velocity Verlet: second order at one force evaluation; accurate up to its stability limit.";
    const ORDER: u32 = 2;
    const MODEL: Model = Model::Springs;
    type Scratch<T: Real> = Ends<T>;

    fn step<T: Real>(
        &self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        dt: T,
        ends: &mut Ends<T>,
        cost: &mut Cost,
    ) {
        let Ends { before, after } = ends;
        let (half, start) = (T::from_f64(0.5) * dt, state.time);
        let handled = problem.is_handled(state);
        if !handled && state.memory.vectors.len() == state.len() {
            std::mem::swap(before, &mut state.memory.vectors);
        } else {
            problem.accelerations(state, before, cost);
        }
        let threads = problem.useful_threads();
        let to = [&mut state.positions[..], &mut state.velocities];
        rows::advance(to, Start::Here, dt, &[([half * dt, dt], before)], threads);
        state.time = start + dt.to_f64();
        problem.accelerations(state, after, cost);
        state.time = start;
        // From the velocity that was predicted to that by the mean of both.
        rows::add(&mut state.velocities, &[(half, after), (-half, before)], threads);
        state.memory.vectors.clear();
        if !handled {
            std::mem::swap(after, &mut state.memory.vectors);
        }
    }

    /// With q = dt² ω² and s = dt g the step multiplies (x, dt v, dt² a) by a matrix of the characteristic polynomial
    /// z³ - (2 - q - 3s/2) z² + (1 - 2s) z + s/2. Jury's criteria on it come down to q + 4s ≤ 4, a root at -1, so
    /// dt = 2 (-g + sqrt(g² + ω²)) / ω², here written so that ω = 0 (1/g) and g = 0 (2/ω) need no cases. The motion that asks
    /// most is the one for which dt² ω² + 4 dt g is largest at the dt that is right for it, also where damping and
    /// stiffness do not share their motions.
    fn dt_limit(&self, spectrum: &Spectrum) -> Option<f64> {
        let limit = |Mode { omega_squared, damping }: Mode| {
            2.0 / (damping + (damping * damping + omega_squared.max(0.0)).sqrt())
        };
        let mut dt = limit(spectrum.extreme(1.0, 0.0));
        for _ in 0..4 {
            let next = dt.min(limit(spectrum.extreme(dt * dt, 4.0 * dt)));
            if dt - next <= 1e-6 * dt {
                break;
            }
            dt = next;
        }
        Some(dt).filter(|dt| dt.is_finite())
    }
}
