//! Where particles would go without springs: inertia, air, gravity, wind and hands of one implicit step.
//!
//! Backward Euler over h, M (v - v0) = h (F_springs(x, v) + F_outside(x, v)) with x = x0 + h v, has an outside that is linear in x
//! and v: air -c v, pulls κ (to - x) - d v, and forces that are the same everywhere. All of it goes into an effective mass
//! m + h (c + d) + h² κ and a velocity v̂, so that what is left to solve is M̂ (v - v̂) = h F_springs(x, v). Every implicit
//! method and every solver of springs as constraints starts from these two.

use crate::forces::Problem;
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
        let air = h * problem.air_damping;
        self.mass.clear();
        self.mass.extend(problem.mass.iter().map(|&m| m + air));
        for pull in &problem.pulls {
            self.mass[pull.particle as usize] += h * pull.damping + h * h * pull.stiffness;
        }
        self.inverse.clear();
        let free = |w: T| w > T::ZERO;
        let inverses = self.mass.iter().zip(&problem.inverse_mass);
        self.inverse.extend(inverses.map(|(&m, &w)| if free(w) { T::ONE / m } else { T::ZERO }));

        self.velocity.resize(state.len(), T::Vec3::ZERO);
        problem.external_forces(state, &mut self.velocity);
        for pull in &problem.pulls {
            let i = pull.particle as usize;
            self.velocity[i] -= state.velocities[i] * (h * pull.stiffness);
        }
        for ((f, &v), &w) in self.velocity.iter_mut().zip(&state.velocities).zip(&self.inverse) {
            *f = v + (*f - v * problem.air_damping) * (h * w);
        }
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

/// v = (x - start) / h, for methods that find positions; a particle that is pinned or held keeps its velocity.
pub(super) fn velocities_of_the_way<T: Real>(
    start: &[T::Vec3],
    state: &mut Particles<T>,
    h: T,
    inverse_mass: &[T],
) {
    let ways = state.positions.iter().zip(start).zip(inverse_mass);
    for (v, ((&x, &start), &w)) in state.velocities.iter_mut().zip(ways) {
        if w > T::ZERO {
            *v = (x - start) * (T::ONE / h);
        }
    }
}
