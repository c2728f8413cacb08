//! Implicit midpoint: velocity and position advance with the forces in the middle of the step.
//!
//! With x' = (x(t) + x(t + dt))/2 and v' = (v(t) + v(t + dt))/2: v(t + dt) = v + dt a(t + dt/2, x', v'), x(t + dt) = x + dt v'. That
//! is implicit Euler over dt/2 followed by as much again without looking at the forces (Hairer, Lubich, Wanner, "Geometric
//! Numerical Integration", 2006, II.1.2). Order 2.
//!
//! It is symplectic, keeps angular momentum, and damps nothing by itself: choose it for free, lively motion at a dt above
//! the limit of explicit methods. Motions faster than dt do not die away: very stiff cloth rings, where implicit Euler or
//! BDF2 come to rest. A step costs what one of implicit Euler does.

use super::newton::{Accuracy, Newton};
use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::Real;
use crate::model::Particles;

crate::params! {
    /// Implicit midpoint.
    pub struct ImplicitMidpoint {
        /// Most Newton steps for each time step; with 1 the springs are linear during the step.
        newton_steps: u32 = 50, range 1.0..=1000.0, slider log 1.0..=50.0, effort [1.0, 50.0];
        /// Where solving ends: a correction in mean spring lengths, the residual of a linear system as a part of what it was.
        tolerance: f64 = 1e-6, range 1e-14..=0.1, slider log 1e-10..=1e-2;
        /// Most iterations of conjugate gradients for each Newton step.
        iterations: u32 = 1000, range 1.0..=1_000_000.0, slider log 10.0..=10_000.0;
    }
}

/// Scratch of [`ImplicitMidpoint`].
#[derive(Debug, Default)]
pub struct Buffers<T: Real> {
    newton: Newton<T>,
    positions: Vec<T::Vec3>,
    velocities: Vec<T::Vec3>,
}

impl Simulator for ImplicitMidpoint {
    const ID: &'static str = "implicit_midpoint";
    const SUMMARY: &'static str =
        "Implicit midpoint: order 2 at any dt without damping of its own; for lively motion of stiff cloth.";
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
        let Buffers { newton, positions, velocities } = scratch;
        positions.clone_from(&state.positions);
        velocities.clone_from(&state.velocities);
        let (beginning, half) = (state.time, dt * T::from_f64(0.5));
        state.time += half.to_f64();
        newton.step(problem, state, half, Accuracy { newton_steps, tolerance, iterations }, cost);
        state.time = beginning;
        let starts = positions.iter().zip(&*velocities);
        for ((x, v), (&from, &before)) in state.positions.iter_mut().zip(&mut state.velocities).zip(starts) {
            *x = from + *v * dt;
            *v += *v - before;
        }
    }

    /// Theory sets no limit.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}
