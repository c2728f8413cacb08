//! Where particles would go without springs: inertia, air, gravity, wind and hands of one implicit step.
//!
//! Backward Euler over h, M (v - v0) = h (F_springs(x, v) + F_outside(x, v)) with x = x0 + h v, has an outside that is linear in x
//! and v: air -c v, pulls κ (to - x) - d v, and forces that are the same everywhere. All of it goes into an effective mass
//! m + h (c + d) + h² κ and a velocity v̂, so that what is left to solve is M̂ (v - v̂) = h F_springs(x, v). Every implicit
//! method and every solver of springs as constraints starts from these two.

use crate::forces::{Cost, Problem};
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
        let (particles, threads) = (state.len(), problem.useful_threads());
        let air = h * problem.air_damping;
        self.mass.resize(particles, T::ZERO);
        let masses = (&mut self.mass[..], &problem.mass[..]);
        each_particle(masses, threads, |(mass, own)| {
            mass.iter_mut().zip(own).for_each(|(mass, &m)| *mass = m + air);
        });
        self.velocity.resize(particles, T::Vec3::ZERO);
        problem.external_forces(state, &mut self.velocity);
        for pull in problem.pulls() {
            let i = pull.particle as usize;
            self.mass[i] += h * pull.damping + h * h * pull.stiffness;
            self.velocity[i] -= state.velocities[i] * (h * pull.stiffness);
        }
        self.inverse.resize(particles, T::ZERO);
        let inverses = (&mut self.inverse[..], &problem.inverse_mass[..], &self.mass[..]);
        let forces = (&mut self.velocity[..], &state.velocities[..]);
        each_particle((inverses, forces), threads, |((inverse, own, mass), (force, velocity))| {
            let masses = inverse.iter_mut().zip(own).zip(mass);
            for (((inverse, &w), &m), (f, &v)) in masses.zip(force.iter_mut().zip(velocity)) {
                *inverse = if w > T::ZERO { T::ONE / m } else { T::ZERO };
                *f = v + (*f - v * problem.air_damping) * (h * *inverse);
            }
        });
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
