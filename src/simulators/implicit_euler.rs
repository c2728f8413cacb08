//! Implicit Euler, thesis 4.5 and 4.6 (Baraff and Witkin, "Large steps in cloth simulation", 1998): velocity and position
//! advance with the forces at the end of the step.
//!
//! v(t + dt) = v + dt a(t + dt, x(t + dt), v(t + dt)), x(t + dt) = x + dt v(t + dt). Order 1. The equations are solved by Newton's
//! method with conjugate gradients; with one Newton step the springs are linear during the step, as in the paper.
//!
//! No dt is too long: fast motions are damped away, by 1/(1 + dt² ω²) of their energy a step, and with them liveliness. A step costs
//! one assembly of the matrix (about four force evaluations) and some ten to some hundred products with it (one to two
//! each) for every Newton step. Choose it for very stiff cloth that should come to rest; for motion take a shorter dt or
//! a method of order 2.

use super::newton::{Accuracy, Newton};
use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::Real;
use crate::model::Particles;

crate::params! {
    /// Implicit Euler.
    pub struct ImplicitEuler {
        /// Most Newton steps for each time step; with 1 the springs are linear during the step.
        newton_steps: u32 = 50, range 1.0..=1000.0, slider log 1.0..=50.0, effort [1.0, 50.0];
        /// Where solving ends: a correction in mean spring lengths, the residual of a linear system as a part of what it was.
        tolerance: f64 = 1e-6, range 1e-14..=0.1, slider log 1e-10..=1e-2;
        /// Most iterations of conjugate gradients for each Newton step.
        iterations: u32 = 1000, range 1.0..=1_000_000.0, slider log 10.0..=10_000.0;
    }
}

impl Simulator for ImplicitEuler {
    const ID: &'static str = "implicit_euler";
    const SUMMARY: &'static str = "Implicit Euler: any dt, any stiffness, but it damps; for stiff cloth that comes to rest.";
    const ORDER: u32 = 1;
    const MODEL: Model = Model::Springs;
    type Scratch<T: Real> = Newton<T>;

    fn step<T: Real>(
        &self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        dt: T,
        scratch: &mut Newton<T>,
        cost: &mut Cost,
    ) {
        let Self { newton_steps, tolerance, iterations } = *self;
        let beginning = state.time;
        state.time += dt.to_f64();
        scratch.step(problem, state, dt, Accuracy { newton_steps, tolerance, iterations }, cost);
        state.time = beginning;
    }

    /// Theory sets no limit.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}
