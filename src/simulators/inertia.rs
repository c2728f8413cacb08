//! Where particles would go without springs: inertia, air, gravity, wind and hands of one implicit step.
//!
//! Backward Euler over h, M (v - v0) = h (F_springs(x, v) + F_outside(x, v)) with x = x0 + h v, has an outside that is linear in x
//! and v: air -c v, pulls κ (to - x) - d v, and forces that are the same everywhere. All of it goes into an effective mass
//! m + h (c + d) + h² κ and a velocity v̂, so that what is left to solve is M̂ (v - v̂) = h F_springs(x, v). Every implicit
//! method and every solver of springs as constraints starts from these two.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use crate::forces::{Cost, Loads, Problem};
use crate::math::lanes::{self, Kernel, LANES, Lanes, eight_of, put_eight_of, put_vectors_of, vectors_of};
use crate::math::parts::each_particle;
use crate::math::{Real, Vector};
use crate::model::Particles;

/// Effective masses and free velocities of a step.
#[derive(Clone, Debug, Default)]
pub(super) struct Inertia<T: Real> {
    /// M̂, kg.
    pub mass: Vec<T>,
    /// Its inverse, 1/kg; 0 where a particle is pinned or held.
    pub inverse: Vec<T>,
    /// v̂, m/s; where a particle is pinned or held, the velocity that it keeps.
    pub velocity: Vec<T::Vec3>,
}

impl<T: Real> Inertia<T> {
    /// Prepares a step of `h` (s) from the positions and velocities given, with forces of the time given.
    pub fn begin(&mut self, problem: &Problem<T>, state: &Particles<T>, h: T) {
        self.mass.resize(state.len(), T::ZERO);
        self.inverse.resize(state.len(), T::ZERO);
        self.velocity.resize(state.len(), T::Vec3::ZERO);
        let Loads { mass, inverse_mass, gravity, wind, air_damping, pulls } = problem.loads(state);
        let to = (&mut self.mass[..], &mut self.inverse[..], &mut self.velocity[..]);
        let from = (mass, inverse_mass, &state.velocities[..]);
        each_particle((to, from), problem.useful_threads(), |(to, from)| {
            lanes::run(Begin::<T> { to, from, gravity, wind, air_damping, h });
        });
        for pulls in pulls.chunk_by(|one, other| one.particle == other.particle) {
            let i = pulls[0].particle as usize;
            let (x, v) = (state.positions[i], state.velocities[i]);
            let mut force = gravity * mass[i] + wind;
            for pull in pulls {
                self.mass[i] += h * pull.damping + h * h * pull.stiffness;
                force += pull.force(x, v) - v * (h * pull.stiffness);
            }
            if inverse_mass[i] > T::ZERO {
                self.inverse[i] = T::ONE / self.mass[i];
                self.velocity[i] = v + (force - v * air_damping) * (h * self.inverse[i]);
            }
        }
    }

    /// What is left of the equations of a step of `h` (s): M̂ (v̂ - v) + h F_springs, N s; zero where a particle is pinned or held.
    pub fn residual(
        &self,
        problem: &Problem<T>,
        state: &Particles<T>,
        h: T,
        residual: &mut Vec<T::Vec3>,
        cost: &mut Cost,
    ) {
        residual.clear();
        residual.resize(state.len(), T::Vec3::ZERO);
        problem.add_spring_forces(state, residual, cost);
        let inertia = (&self.mass[..], &self.inverse[..], &self.velocity[..]);
        let particles = (&mut residual[..], inertia, &state.velocities[..]);
        each_particle(particles, problem.useful_threads(), |(residual, (mass, inverse, free), velocity)| {
            let particles = mass.iter().zip(inverse).zip(free).zip(velocity);
            for (r, (((&m, &w), &free), &v)) in residual.iter_mut().zip(particles) {
                *r = if w > T::ZERO { (free - v) * m + *r * h } else { T::Vec3::ZERO };
            }
        });
    }

    /// Puts right what a solver that stopped short left of the total momentum, which springs cannot change, and answers
    /// with the velocity that every particle was given, m/s. Only where nothing is pinned or held: pins take up momentum.
    pub fn keep_momentum(&self, velocities: &mut [T::Vec3]) -> T::Vec3 {
        if self.inverse.iter().any(|w| *w <= T::ZERO) {
            return T::Vec3::ZERO;
        }
        let (mut missing, mut mass) = (T::Vec3::ZERO, T::ZERO);
        for ((&m, &free), &v) in self.mass.iter().zip(&self.velocity).zip(&*velocities) {
            missing += (free - v) * m;
            mass += m;
        }
        let shift = if mass > T::ZERO { missing * (T::ONE / mass) } else { T::Vec3::ZERO };
        velocities.iter_mut().for_each(|v| *v += shift);
        shift
    }
}

/// What stands in [`Inertia`] where no hand pulls.
struct Begin<'a, T: Real> {
    to: (&'a mut [T], &'a mut [T], &'a mut [T::Vec3]),
    /// Masses, their inverses, and velocities.
    from: (&'a [T], &'a [T], &'a [T::Vec3]),
    gravity: T::Vec3,
    wind: T::Vec3,
    air_damping: T,
    h: T,
}

impl<T: Real> Kernel<T> for Begin<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let Self { to, from: (mass, inverse_mass, velocities), gravity, wind, air_damping, h } = self;
        let (one, air, h) = (L::splat(with, T::ONE), L::splat(with, air_damping), L::splat(with, h));
        let (gravity, wind) = (gravity.to_array(), wind.to_array());
        for at in (0..mass.len()).step_by(LANES) {
            let own = eight_of::<T, L>(with, &mass[at..]);
            let m = own + h * air;
            let inverse = (one / m).where_positive(eight_of(with, &inverse_mass[at..]));
            let mut v = vectors_of::<T, L>(with, &velocities[at..]);
            for c in 0..3 {
                let force = L::splat(with, gravity[c]) * own + L::splat(with, wind[c]);
                v[c] = v[c] + (force - v[c] * air) * (h * inverse);
            }
            put_eight_of(m, &mut to.0[at..]);
            put_eight_of(inverse, &mut to.1[at..]);
            put_vectors_of::<T, L>(v, &mut to.2[at..]);
        }
    }
}
