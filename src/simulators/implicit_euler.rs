//! Implicit Euler, thesis 4.5 and 4.6 (Baraff and Witkin, "Large steps in cloth simulation", 1998): velocity and position
//! advance with the forces at the end of the step.
//!
//! v(t + dt) = v + dt a(t + dt, x(t + dt), v(t + dt)), x(t + dt) = x + dt v(t + dt). Order 1. The equations are solved by Newton's
//! method with conjugate gradients; with one Newton step the springs are linear during the step, as in the paper.
//!
//! No dt is too long: fast motions are damped away, by 1/(1 + dt² ω²) of their energy a step, and with them liveliness. A step costs
//! one assembly of the matrix (about six force evaluations) and some ten to some hundred iterations (one each) for every
//! Newton step. Choose it for very stiff cloth that should come to rest; for motion take a shorter dt or
//! a method of order 2.

use super::newton::{Newton, solved_by_newton};
use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::Real;
use crate::model::Particles;

solved_by_newton! {
    /// Implicit Euler.
    pub struct ImplicitEuler;
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
        let beginning = state.time;
        state.time += dt.to_f64();
        scratch.step(problem, state, dt, self.accuracy(), cost);
        state.time = beginning;
    }

    /// Theory sets no limit.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}
