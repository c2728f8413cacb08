//! Position Verlet with relaxation (thesis 4.3): particles move freely, then sweeps over the springs, taken as rigid
//! constraints, put their lengths right.
//!
//! x* = x + (1 - α) dt v + dt² F(t)/m with gravity, wind and hands in F; then `sweeps` times, for each spring, the two ends move
//! along it until it has its rest length: half of the correction each, all of it where the other end is fixed; at last
//! v = (x(t + dt) - x(t)) / dt, which is the displacement that position Verlet keeps (Jakobsen, "Advanced character
//! physics", 2001).
//!
//! The order of constraints is part of the method, since each sees what those before it did: stretch, then shear, then
//! bend springs; within a kind by lower, then higher particle index.
//!
//! It solves another model than the springs: stiffness and spring damping are ignored, and how stiff the cloth looks is
//! a matter of dt and sweeps. Any dt stays bounded. A sweep costs about one force evaluation.

use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::{Real, Vector};
use crate::model::Particles;

crate::choice! {
    /// How velocity is damped.
    pub enum DampingLaw {
        /// α = 1 - exp(-c dt / m) with the scene's air damping c: the same decay whatever dt is.
        Air,
        /// α = `damping_ratio` each step, as in the thesis: a smaller dt damps more.
        PerStep,
    }
}

crate::params! {
    /// Position Verlet with relaxation.
    pub struct Verlet {
        /// Sweeps of relaxation a step: more make the cloth stiffer and cost in proportion.
        sweeps: u32 = 10, range 0.0..=100_000.0, slider log 1.0..=200.0;
        /// Air: α = 1 - exp(-c dt / m) from the scene's air damping, the same decay whatever dt is. PerStep: the ratio
        /// below each step, as in the thesis.
        damping_law: DampingLaw = DampingLaw::Air;
        /// Part α of the velocity that is lost each step under PerStep.
        damping_ratio: f64 = 0.01, range 0.0..=1.0, slider linear 0.0..=0.1;
    }
}

/// Scratch of [`Verlet`].
#[derive(Debug, Default)]
pub struct Buffers<T: Real> {
    force: Vec<T::Vec3>,
    start: Vec<T::Vec3>,
}

impl Simulator for Verlet {
    const ID: &'static str = "verlet";
    const SUMMARY: &'static str =
        "Verlet with relaxation: rigid springs, bounded at any dt; stiffness is a matter of dt and sweeps.";
    const ORDER: u32 = 1;
    const MODEL: Model = Model::RigidConstraints;
    type Scratch<T: Real> = Buffers<T>;

    fn step<T: Real>(
        &self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        dt: T,
        scratch: &mut Buffers<T>,
        cost: &mut Cost,
    ) {
        let Buffers { force, start } = scratch;
        force.resize(state.len(), T::Vec3::default());
        problem.external_forces(state, force);
        cost.force_evaluations += 1;
        start.clone_from(&state.positions);

        let mut kept = KeptVelocity { method: self, problem, dt, mass: T::ZERO, ratio: T::ONE };
        for (i, (x, v)) in state.positions.iter_mut().zip(&state.velocities).enumerate() {
            let w = problem.inverse_mass[i];
            let ratio = if w > T::ZERO { kept.ratio(problem.mass[i]) } else { T::ONE };
            *x += (*v * ratio + force[i] * (w * dt)) * dt;
        }
        for _ in 0..self.sweeps {
            relax(problem, &mut state.positions);
            cost.spring_visits += problem.springs.len() as u64;
        }
        for ((v, x), start) in state.velocities.iter_mut().zip(&state.positions).zip(&*start) {
            *v = (*x - *start) * (T::ONE / dt);
        }
    }

    /// Relaxation only ever shortens errors of length, so theory sets no limit.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}

/// The part 1 - α of its velocity that a particle keeps, computed anew only where the mass differs from the last one.
struct KeptVelocity<'a, T: Real> {
    method: &'a Verlet,
    problem: &'a Problem<T>,
    dt: T,
    mass: T,
    ratio: T,
}

impl<T: Real> KeptVelocity<'_, T> {
    fn ratio(&mut self, mass: T) -> T {
        if mass != self.mass {
            self.mass = mass;
            self.ratio = T::from_f64(match self.method.damping_law {
                DampingLaw::Air => {
                    libm::exp(-self.problem.air_damping.to_f64() * self.dt.to_f64() / mass.to_f64())
                }
                DampingLaw::PerStep => 1.0 - self.method.damping_ratio,
            });
        }
        self.ratio
    }
}

/// One sweep over all springs.
fn relax<T: Real>(problem: &Problem<T>, positions: &mut [T::Vec3]) {
    let half = T::from_f64(0.5);
    for (pair, &rest) in problem.springs.pairs.iter().zip(&problem.springs.rest) {
        let [i, j] = pair.map(|p| p as usize);
        let d = positions[j] - positions[i];
        let length = d.length();
        let free = [i, j].map(|p| problem.inverse_mass[p] > T::ZERO);
        let (share_i, share_j) = match free {
            [true, true] => (half, half),
            [true, false] => (T::ONE, T::ZERO),
            [false, true] => (T::ZERO, T::ONE),
            [false, false] => continue,
        };
        if length > T::ZERO {
            let correction = d * ((length - rest) / length);
            positions[i] += correction * share_i;
            positions[j] -= correction * share_j;
        }
    }
}
