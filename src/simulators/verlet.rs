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
//! touch, eight at a time, which the processor works on at once: the faster order.
//!
//! It solves another model than the springs: stiffness and spring damping are ignored, and how stiff the cloth looks is
//! a matter of dt and sweeps. Any dt stays bounded. A coloured sweep costs less than a force evaluation.

use super::sweep::{Chain, Sweep, Tiles};
use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::Real;
use crate::math::parts::each_particle;
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
    free: Free<T>,
    chain: Chain<T>,
    tiles: Tiles<T>,
}

/// How particles move before springs are put right.
#[derive(Debug, Default)]
struct Free<T: Real> {
    /// m/s.
    velocities: Vec<T::Vec3>,
    /// By which they give way.
    weights: Vec<T>,
}

impl Simulator for Verlet {
    const ID: &'static str = "verlet";
    const SUMMARY: &'static str =
        "Verlet with relaxation: rigid springs, to whose length a stretched cloth snaps back; bounded at any dt.";
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
        let Buffers { free, chain, tiles } = scratch;
        self.set_free(problem, state, dt, free);
        cost.force_evaluations += 1;
        match self.order {
            Order::Creation => self.sweep(problem, state, dt, free, chain, cost),
            Order::Coloured => self.sweep(problem, state, dt, free, tiles, cost),
        }
    }

    /// Relaxation only ever shortens errors of length, so theory sets no limit.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}

impl Verlet {
    fn set_free<T: Real>(&self, problem: &Problem<T>, state: &Particles<T>, dt: T, free: &mut Free<T>) {
        let Free { velocities, weights } = free;
        velocities.resize(state.len(), T::Vec3::default());
        weights.resize(state.len(), T::ZERO);
        problem.external_forces(state, velocities);
        let to = (&mut velocities[..], &mut weights[..]);
        let particles = (to, &state.velocities[..], (&problem.mass[..], &problem.inverse_mass[..]));
        each_particle(particles, problem.useful_threads(), |((forces, weights), velocities, masses)| {
            let mut kept = KeptVelocity { method: self, problem, dt, mass: T::ZERO, ratio: T::ONE };
            let masses = masses.0.iter().zip(masses.1);
            let free = forces.iter_mut().zip(weights);
            for (((f, weight), &v), (&m, &w)) in free.zip(velocities).zip(masses) {
                *weight = match self.correction {
                    Correction::HalfHalf if w > T::ZERO => T::ONE,
                    Correction::HalfHalf | Correction::MassWeighted => w,
                };
                *f = if w > T::ZERO { v * kept.ratio(m) + *f * (w * dt) } else { v };
            }
        });
    }

    fn sweep<T: Real>(
        &self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        dt: T,
        free: &Free<T>,
        sweep: &mut impl Sweep<T>,
        cost: &mut Cost,
    ) {
        let (Free { velocities, weights }, threads) = (free, problem.useful_threads());
        sweep.take(problem);
        sweep.set_out(&state.positions, velocities, weights, dt, threads);
        for _ in 0..self.sweeps {
            if problem.is_stopped() {
                return;
            }
            sweep.relax(weights, problem.parallel());
            cost.spring_visits += problem.springs.len() as u64;
        }
        sweep.arrive(state, velocities, weights, dt, threads);
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
