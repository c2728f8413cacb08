//! XPBD, extended position-based dynamics (Macklin, Müller, Chentanez, "XPBD: position-based simulation of compliant
//! constrained dynamics", 2016), with small steps (Macklin et al., "Small steps in physics simulation", 2019).
//!
//! Backward Euler over h = dt / substeps, its springs solved one after the other. A spring is a constraint C = |d| - L of
//! compliance 1/k with a multiplier λ, the impulse length that it has exerted in this step:
//! Δλ = (-C - λ/(h² k)) / (w_i + w_j + 1/(h² k)), Δx = ± w n Δλ, n = d/|d|. Written with numerator and denominator times
//! h² k, so that k = 0 is no spring at all and 1/k is never formed. Since λ is carried over the iterations, the springs
//! keep their stiffness whatever the number of iterations: more of them come nearer to backward Euler, of order 1.
//!
//! Damping has a multiplier of its own: k_d (v_j - v_i) is a constraint on d - d(start of step) of stiffness k_d / h. AllDirections
//! is the thesis' law, which all other methods have; Along is that of the paper, which damps only changes of length and
//! so leaves rigid rotation alone.
//!
//! Springs are taken tile by tile, in eights that share no particle. Any h stays bounded. An iteration costs somewhat less
//! than a force evaluation, damped in all directions half as much again. Many substeps of one iteration beat one step of many
//! iterations: choose it for stiff cloth within a fixed budget, where an explicit method would need a smaller dt than the
//! budget allows.

use super::inertia::Inertia;
use super::sweep::{Compliance, Sweep, Tiles, Turn};
use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::Real;
use crate::model::Particles;

crate::choice! {
    /// Which relative motion spring damping brakes.
    pub enum DampingDirection {
        /// All of it: the thesis' law, as in every other method.
        AllDirections,
        /// That along the spring: the law of the XPBD paper.
        Along,
    }
}

crate::params! {
    /// Extended position-based dynamics.
    pub struct Xpbd {
        /// Substeps of each dt: the error falls in proportion.
        substeps: u32 = 10, range 1.0..=100_000.0, slider log 1.0..=100.0, effort [1.0, 10.0, 100.0];
        /// Sweeps over the springs in each substep: towards backward Euler, not beyond.
        iterations: u32 = 1, range 0.0..=100_000.0, slider log 1.0..=100.0, effort [1.0, 10.0, 100.0];
        /// AllDirections: spring damping as everywhere else. Along: only changes of length, as in the paper.
        damping: DampingDirection = DampingDirection::AllDirections;
    }
}

/// Scratch of [`Xpbd`].
#[derive(Debug, Default)]
pub struct Buffers<T: Real> {
    inertia: Inertia<T>,
    tiles: Tiles<T>,
}

impl Simulator for Xpbd {
    const ID: &'static str = "xpbd";
    const SUMMARY: &'static str =
        "XPBD: springs of true stiffness as compliant constraints, bounded at any dt; best with many small substeps.";
    const ORDER: u32 = 1;
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
        scratch.tiles.take(problem);
        let beginning = state.time;
        let substep = dt.to_f64() / f64::from(self.substeps);
        for n in 0..self.substeps {
            if problem.is_stopped() {
                return;
            }
            state.time = beginning + f64::from(n) * substep;
            self.substep(problem, state, T::from_f64(substep), scratch, cost);
        }
        state.time = beginning;
    }

    /// Backward Euler sets no limit.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}

impl Xpbd {
    fn substep<T: Real>(
        &self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        h: T,
        scratch: &mut Buffers<T>,
        cost: &mut Cost,
    ) {
        let Buffers { inertia, tiles } = scratch;
        let threads = problem.useful_threads();
        inertia.begin(problem, state, h);
        cost.force_evaluations += 1;
        let damping = h * problem.spring_damping;
        let (along, all) = match self.damping {
            DampingDirection::AllDirections => (T::ZERO, damping),
            DampingDirection::Along => (damping, T::ZERO),
        };
        let compliance = Compliance { square: h * h, along, all };
        tiles.set_out(&state.positions, &inertia.velocity, &inertia.inverse, h, threads);
        tiles.begin(&compliance);
        for iteration in 1..=self.iterations {
            if problem.is_stopped() {
                return;
            }
            let turn = Turn { is_first: iteration == 1, is_last: iteration == self.iterations };
            tiles.comply(&inertia.inverse, &compliance, turn, problem.parallel());
        }
        tiles.arrive(state, &inertia.velocity, &inertia.inverse, h, threads);
        cost.solver_iterations += u64::from(self.iterations);
        cost.spring_visits += u64::from(self.iterations) * problem.springs.len() as u64;
        // Dividing positions by a short h enlarges their rounding, which would let momentum drift.
        inertia.keep_momentum(&mut state.velocities);
    }
}
