//! BDF2, the backward differentiation formula over two steps (Choi and Ko, "Stable but responsive cloth", 2002).
//!
//! x(t + dt) = 4/3 x - 1/3 x(t - dt) + 2/3 dt v(t + dt), and v(t + dt) likewise with a(t + dt): implicit Euler over 2/3 dt
//! from a point extrapolated from two states. Order 2. The state before the last is its memory; where there is none (at the
//! start, and after any change of method, dt, springs, pins or hands) it takes one step of implicit Euler, whose error is
//! once that of order 1 and so leaves the order of the whole.
//!
//! No dt is too long. It damps slow motions far less than implicit Euler and still lets the fastest die away: choose it
//! for stiff cloth that should move. A step costs what one of implicit Euler does.

use super::newton::{Accuracy, Newton};
use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::Real;
use crate::model::Particles;

crate::params! {
    /// BDF2.
    pub struct Bdf2 {
        /// Most Newton steps for each time step; with 1 the springs are linear during the step.
        newton_steps: u32 = 50, range 1.0..=1000.0, slider log 1.0..=50.0, effort [1.0, 50.0];
        /// Where solving ends: a correction in mean spring lengths, the residual of a linear system as a part of what it was.
        tolerance: f64 = 1e-6, range 1e-14..=0.1, slider log 1e-10..=1e-2;
        /// Most iterations of conjugate gradients for each Newton step.
        iterations: u32 = 1000, range 1.0..=1_000_000.0, slider log 10.0..=10_000.0;
    }
}

/// Scratch of [`Bdf2`].
#[derive(Debug, Default)]
pub struct Buffers<T: Real> {
    newton: Newton<T>,
    /// Positions, then velocities of the state that a step starts from.
    now: Vec<T::Vec3>,
}

impl Simulator for Bdf2 {
    const ID: &'static str = "bdf2";
    const SUMMARY: &'static str = "BDF2: order 2 at any dt, damps only what is faster than dt; for stiff cloth in motion.";
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
        let Self { newton_steps, tolerance, iterations } = *self;
        let Buffers { newton, now } = scratch;
        let n = state.len();
        now.clear();
        now.extend_from_slice(&state.positions);
        now.extend_from_slice(&state.velocities);
        let mut h = dt;
        if state.memory.vectors.len() == 2 * n {
            h = dt * T::from_f64(2.0 / 3.0);
            // 4/3 a - 1/3 b = a + (a - b)/3, which is a to the last bit where nothing moves.
            let third = T::from_f64(1.0 / 3.0);
            let (positions, velocities) = state.memory.vectors.split_at(n);
            let before = positions.iter().zip(velocities).zip(&problem.inverse_mass);
            for ((x, v), ((&x0, &v0), &w)) in
                state.positions.iter_mut().zip(&mut state.velocities).zip(before)
            {
                if w > T::ZERO {
                    *x += (*x - x0) * third;
                    *v += (*v - v0) * third;
                } else {
                    // Ends where its velocity takes it in the whole step.
                    *x += *v * (dt - h);
                }
            }
        }
        let beginning = state.time;
        // Forces are those of the end of the step.
        state.time += dt.to_f64();
        newton.step(problem, state, h, Accuracy { newton_steps, tolerance, iterations }, cost);
        state.time = beginning;
        for ((x, &from), (&v, &w)) in
            state.positions.iter_mut().zip(&*now).zip(state.velocities.iter().zip(&problem.inverse_mass))
        {
            if w <= T::ZERO {
                *x = from + v * dt;
            }
        }
        state.memory.vectors.clone_from(now);
    }

    /// Theory sets no limit.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}
