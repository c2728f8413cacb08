//! The equations of an implicit step, solved by Newton's method: M̂ (v - v̂) = h F_springs(x, v) with x = x0 + h v.
//!
//! Backward Euler over h from (x0, v0); implicit midpoint and BDF2 are made of it. Each Newton step solves
//! (M̂ + h D + h² K) δv = M̂ (v̂ - v) + h F by conjugate gradients (Baraff and Witkin, "Large steps in cloth simulation", 1998),
//! D and K the damping and the stiffness of the springs, four numbers each (see [`Linear`]); particles that are pinned or held
//! have no unknown. K leaves out what compressed springs push sideways, so that the matrix is positive
//! definite and δv always leads downhill in the energy of the step; where it leads too far, it is shortened.
//!
//! Far from the solution a system is solved no better than its step is worth (Eisenstat and Walker, "Choosing the forcing terms in
//! an inexact Newton method", 1996); to the tolerance only where the correction is below it, which makes that step the last.

use super::conjugate_gradients::{ConjugateGradients, Enough};
use super::inertia::Inertia;
use crate::forces::{Cost, Linear, Problem};
use crate::math::parts::each_particle;
use crate::math::{Real, Vector};
use crate::model::Particles;

/// How far a linear system is solved at least, as a part of its right-hand side.
const LOOSE: f64 = 0.1;

/// How well the equations are to be solved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accuracy {
    /// Most Newton steps. A single one is a method of its own: the springs made linear where the step begins.
    pub newton_steps: u32,
    /// Newton's method ends with a correction of this part of the springs' mean rest length, a linear system with a residual
    /// of this part of its right-hand side.
    pub tolerance: f64,
    /// Most iterations of conjugate gradients for a linear system.
    pub iterations: u32,
}

/// Declares a method that is solved here: its parameters are how well it is to be solved.
macro_rules! solved_by_newton {
    ($(#[$meta:meta])* $vis:vis struct $name:ident;) => {
        $crate::params! {
            $(#[$meta])*
            $vis struct $name {
                /// Most Newton steps for each time step; with 1 the springs are linear during the step.
                newton_steps: u32 = 50, range 1.0..=1000.0, slider log 1.0..=50.0, effort [1.0, 50.0];
                /// Where solving ends: a correction in mean spring lengths, the residual of a linear system as a part of what it was.
                tolerance: f64 = 1e-6, range 1e-14..=0.1, slider log 1e-10..=1e-2;
                /// Most iterations of conjugate gradients for each Newton step.
                iterations: u32 = 1000, range 1.0..=1_000_000.0, slider log 10.0..=10_000.0;
            }
        }

        impl $name {
            fn accuracy(&self) -> $crate::simulators::newton::Accuracy {
                let Self { newton_steps, tolerance, iterations } = *self;
                $crate::simulators::newton::Accuracy { newton_steps, tolerance, iterations }
            }
        }
    };
}
pub(super) use solved_by_newton;

/// Scratch of the solver.
#[derive(Clone, Debug, Default)]
pub struct Newton<T: Real> {
    inertia: Inertia<T>,
    gradients: ConjugateGradients<T>,
    /// x0, m.
    start: Vec<T::Vec3>,
    /// Right-hand side, N s.
    residual: Vec<T::Vec3>,
    /// δv, m/s.
    change: Vec<T::Vec3>,
    /// h D + h² K of each spring.
    springs: Linear<T>,
    /// Mean rest length, m, of the problem of a revision.
    mean_rest: f64,
    revision: u64,
}

impl<T: Real> Newton<T> {
    /// Takes x0 and v0 in `state` on to x0 + h v and v, with forces from outside at the state's time. A particle that is
    /// pinned or held keeps v0. Answers whether the equations were solved; what is left of them is told in `cost`.
    pub(super) fn step(
        &mut self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        h: T,
        accuracy: Accuracy,
        cost: &mut Cost,
    ) -> bool {
        self.inertia.begin(problem, state, h);
        self.start.clone_from(&state.positions);
        let smallest = self.smallest_correction(problem, accuracy.tolerance);
        self.place(state, h, problem.useful_threads());
        self.inertia.residual(problem, state, h, &mut self.residual, cost);
        let single = accuracy.newton_steps == 1;
        let (mut left, mut worst) = (f64::INFINITY, 0);
        let (mut loose, mut size) = (LOOSE, dot::<T>(&self.residual, &self.residual));
        for _ in 0..accuracy.newton_steps {
            if problem.is_stopped() {
                return false;
            }
            self.assemble(problem, state, h);
            let Self { gradients, residual, change, springs, inertia, .. } = self;
            let correction = |square: f64| square.sqrt() * h.to_f64() / smallest;
            let enough = Enough {
                residual: accuracy.tolerance,
                iterations: accuracy.iterations,
                loose: if single { 0.0 } else { loose },
                far_off: |square| correction(square) > 1.0,
                stopped: || problem.is_stopped(),
            };
            let multiply = |from: &[_], to: &mut [_], products: &mut [_]| {
                problem.multiply(springs, &inertia.mass, from, to, products);
            };
            let solved = gradients.solve(residual, change, &enough, multiply, problem.useful_threads());
            cost.solver_iterations += u64::from(solved.iterations);
            // The matrix is built from all springs, and every iteration goes over them again.
            cost.spring_visits += (1 + u64::from(solved.iterations)) * problem.springs.len() as u64;
            let linear = if solved.loosely { 0.0 } else { solved.residual / accuracy.tolerance };
            let (farthest, square) = longest::<T>(change);
            (left, worst) = (if single { linear } else { linear.max(correction(square)) }, farthest);
            if left <= 1.0 || single {
                self.go(state, h, T::ONE, problem.useful_threads());
                break;
            }
            self.go_downhill(problem, state, h, cost);
            let before = std::mem::replace(&mut size, dot::<T>(&self.residual, &self.residual));
            // Choice 2 of Eisenstat and Walker: as much as the step is worth.
            loose = (0.9 * size / before).clamp(accuracy.tolerance, LOOSE);
        }
        let shift = self.inertia.keep_momentum(&mut state.velocities);
        state.positions.iter_mut().for_each(|x| *x += shift * h);
        cost.solved(left, worst);
        left <= 1.0
    }

    /// The correction at which Newton's method ends, m; no smaller than rounding allows.
    fn smallest_correction(&mut self, problem: &Problem<T>, tolerance: f64) -> f64 {
        if self.revision != problem.revision() {
            let rest = &problem.springs.rest;
            let sum: f64 = rest.iter().map(|r| r.to_f64()).sum();
            // Springs without length give no scale: then it is a part of a metre.
            self.mean_rest = if sum > 0.0 { sum / rest.len() as f64 } else { 1.0 };
            self.revision = problem.revision();
        }
        let far = self.start.iter().map(|x| x.dot(*x).to_f64()).fold(0.0, f64::max).sqrt();
        (tolerance * self.mean_rest).max(8.0 * T::EPSILON.to_f64() * far)
    }

    /// x = x0 + h v.
    fn place(&self, state: &mut Particles<T>, h: T, threads: usize) {
        let ways = (&mut state.positions[..], &self.start[..], &state.velocities[..]);
        each_particle(ways, threads, |(positions, start, velocities)| {
            for ((x, &start), &v) in positions.iter_mut().zip(start).zip(velocities) {
                *x = start + v * h;
            }
        });
    }

    /// Adds a part of the change found.
    fn go(&self, state: &mut Particles<T>, h: T, part: T, threads: usize) {
        let changes = (&mut state.velocities[..], &self.change[..]);
        each_particle(changes, threads, |(velocities, changes)| {
            velocities.iter_mut().zip(changes).for_each(|(v, &change)| *v += change * part);
        });
        self.place(state, h, threads);
    }

    /// Adds as much of the change as does not lead past the lowest energy on its way by more than half of the slope that it
    /// began with, by the rule of false position on that slope. Leaves the residual of where it ends.
    fn go_downhill(&mut self, problem: &Problem<T>, state: &mut Particles<T>, h: T, cost: &mut Cost) {
        /// Each shortens the way at least to nine tenths, most to a half and less.
        const SHORTENED: u32 = 20;
        let slope = dot::<T>(&self.residual, &self.change);
        let mut part = 1.0;
        self.go(state, h, T::ONE, problem.useful_threads());
        self.inertia.residual(problem, state, h, &mut self.residual, cost);
        for _ in 0..SHORTENED {
            let here = dot::<T>(&self.residual, &self.change);
            if here >= -0.5 * slope {
                break;
            }
            let shorter = part * (slope / (slope - here)).clamp(0.1, 0.9);
            self.go(state, h, T::from_f64(shorter - part), problem.useful_threads());
            part = shorter;
            self.inertia.residual(problem, state, h, &mut self.residual, cost);
        }
    }

    /// The matrix in the current shape.
    fn assemble(&mut self, problem: &Problem<T>, state: &Particles<T>, h: T) {
        let Self { gradients, springs, inertia, .. } = self;
        problem.linearise(&state.positions, h, springs);
        gradients.hold(state.len());
        let [diagonal, off] = &mut gradients.blocks;
        problem.own_blocks(springs, &inertia.mass, [diagonal, off]);
        gradients.precondition(&inertia.inverse, problem.useful_threads());
    }
}

/// The longest of some vectors: which, and the square of its length.
fn longest<T: Real>(vectors: &[T::Vec3]) -> (usize, f64) {
    let squares = vectors.iter().map(|v| v.dot(*v).to_f64()).enumerate();
    squares.fold((0, 0.0), |most, next| if next.1 <= most.1 { most } else { next })
}

/// Scalar product.
fn dot<T: Real>(a: &[T::Vec3], b: &[T::Vec3]) -> f64 {
    a.iter().zip(b).map(|(a, &b)| a.dot(b).to_f64()).sum()
}
