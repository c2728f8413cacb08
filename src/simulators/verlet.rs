//! Position Verlet with relaxation (thesis 4.3): particles move freely, then sweeps over the springs, taken as rigid
//! constraints, put their lengths right.
//!
//! x* = x + (1 - α) dt v + dt² F(t)/m with gravity, wind and hands in F; then `sweeps` times, for each spring, the two ends move
//! along it until it has its rest length: half of the correction each, all of it where the other end is fixed; at last
//! v = (x(t + dt) - x(t)) / dt, which is the displacement that position Verlet keeps (Jakobsen, "Advanced character
//! physics", 2001). Halves let momentum drift where masses differ; shares in proportion to 1/m keep it (Müller, Heidelberger,
//! Hennix, Ratcliff, "Position based dynamics", 2007).
//!
//! The order of constraints is part of the method, since each sees what those before it did. Creation: stretch, then
//! shear, then bend springs; within a kind by lower, then higher particle index. Coloured: groups of springs that do not
//! touch, so that what a spring sees hangs less on where in the list it stands.
//!
//! It solves another model than the springs: stiffness and spring damping are ignored, and how stiff the cloth looks is
//! a matter of dt and sweeps. Any dt stays bounded. A sweep costs about one force evaluation.

use super::colouring::OrderedSprings;
use super::inertia::velocities_of_the_way;
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

crate::choice! {
    /// How a correction is shared between the two ends of a spring.
    pub enum Correction {
        /// Half each, whatever their masses, as in the thesis.
        HalfHalf,
        /// In proportion to 1/m, which keeps momentum.
        MassWeighted,
    }
}

crate::choice! {
    /// The order in which springs are put right.
    pub enum Order {
        /// As they were made.
        Creation,
        /// Groups of springs that do not touch, one after the other.
        Coloured,
    }
}

crate::params! {
    /// Position Verlet with relaxation.
    pub struct Verlet {
        /// Sweeps of relaxation a step: more make the cloth stiffer and cost in proportion.
        sweeps: u32 = 10, range 0.0..=100_000.0, slider log 1.0..=200.0, effort [1.0, 4.0, 16.0, 64.0];
        /// Air: α = 1 - exp(-c dt / m) from the scene's air damping, the same decay whatever dt is. PerStep: the ratio
        /// below each step, as in the thesis.
        damping_law: DampingLaw = DampingLaw::Air;
        /// Part α of the velocity that is lost each step under PerStep.
        damping_ratio: f64 = 0.01, range 0.0..=1.0, slider linear 0.0..=0.1, when damping_law PerStep;
        /// HalfHalf: both ends of a spring move alike, as in the thesis. MassWeighted: in proportion to 1/m, which keeps
        /// momentum where masses differ.
        correction: Correction = Correction::HalfHalf;
        /// Creation: springs in the order in which they were made. Coloured: groups of springs that do not touch.
        order: Order = Order::Creation;
    }
}

/// Scratch of [`Verlet`].
#[derive(Debug, Default)]
pub struct Buffers<T: Real> {
    force: Vec<T::Vec3>,
    start: Vec<T::Vec3>,
    /// Empty where the springs of the problem stand in the order asked for.
    ordered: OrderedSprings<T>,
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
        let Buffers { force, start, ordered } = scratch;
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
        let as_they_stand = self.order == Order::Creation && problem.springs.in_order_of_creation();
        let (pairs, rest) = if as_they_stand {
            (&problem.springs.pairs, &problem.springs.rest)
        } else {
            match self.order {
                Order::Creation => ordered.by_creation(problem),
                Order::Coloured => ordered.by_colour(problem),
            }
            (&ordered.pairs, &ordered.rest)
        };
        for _ in 0..self.sweeps {
            match self.correction {
                Correction::HalfHalf => {
                    relax(pairs, rest, &mut state.positions, |i, j| half_half(&problem.inverse_mass, i, j));
                }
                Correction::MassWeighted => {
                    relax(pairs, rest, &mut state.positions, |i, j| weighted(&problem.inverse_mass, i, j));
                }
            }
            cost.spring_visits += problem.springs.len() as u64;
        }
        velocities_of_the_way(start, state, dt, &problem.inverse_mass);
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

/// The part of a correction that each end makes: half, or all of it where the other cannot move.
fn half_half<T: Real>(inverse_mass: &[T], i: usize, j: usize) -> Option<(T, T)> {
    let half = T::from_f64(0.5);
    match [i, j].map(|p| inverse_mass[p] > T::ZERO) {
        [true, true] => Some((half, half)),
        [true, false] => Some((T::ONE, T::ZERO)),
        [false, true] => Some((T::ZERO, T::ONE)),
        [false, false] => None,
    }
}

/// The part of a correction that each end makes, in proportion to 1/m.
fn weighted<T: Real>(inverse_mass: &[T], i: usize, j: usize) -> Option<(T, T)> {
    let (wi, wj) = (inverse_mass[i], inverse_mass[j]);
    let w = wi + wj;
    (w > T::ZERO).then(|| (wi / w, wj / w))
}

/// One sweep over all springs; `shares` answers with none where neither end can move.
fn relax<T: Real>(
    pairs: &[[u32; 2]],
    rest: &[T],
    positions: &mut [T::Vec3],
    shares: impl Fn(usize, usize) -> Option<(T, T)>,
) {
    for (pair, &rest) in pairs.iter().zip(rest) {
        let [i, j] = pair.map(|p| p as usize);
        let Some((share_i, share_j)) = shares(i, j) else { continue };
        let d = positions[j] - positions[i];
        let length = d.length();
        if length > T::ZERO {
            let correction = d * ((length - rest) / length);
            positions[i] += correction * share_i;
            positions[j] -= correction * share_j;
        }
    }
}
