//! Springs with isotropic damping: F = k (|d| - L) d/|d| + k_d (v_j - v_i) on i from j, d = x_j - x_i.
//!
//! The damping is the thesis' law (eq. 2.4): along all directions, not only along the spring, so that it brakes rigid
//! rotation too. Where |d| = 0 the spring has no direction and exerts no force.

use crate::math::{Real, Vector};
use crate::model::{Incidence, KindSettings, Particles, Springs};
use rayon::prelude::*;

crate::params! {
    /// One kind of springs.
    pub struct Kind {
        /// Whether springs of this kind act.
        enabled: bool = true;
        /// Stiffness k: force per elongation.
        stiffness: f64 = 1000.0, unit "N/m", range 0.0..=1e12, slider log 0.01..=1e6;
        /// Rest length = length in the imported or generated shape x this.
        rest_scale: f64 = 1.0, range 0.0..=1000.0, slider linear 0.0..=2.0;
    }
}

crate::params! {
    /// The springs of the cloth, by kind (Provot, "Deformation constraints in a mass-spring model to describe rigid
    /// cloth behavior", 1995).
    pub struct SpringParams {
        /// Along the edges of the faces.
        stretch: Kind = Kind::default();
        /// Along both diagonals of every quad.
        shear: Kind = Kind { stiffness: 300.0, ..Kind::default() };
        /// Straight across every regular vertex.
        bend: Kind = Kind { stiffness: 100.0, ..Kind::default() };
        /// Damping k_d of every spring: F = k_d (v_j - v_i) on i.
        damping: f64 = 2.0, unit "kg/s", range 0.0..=1e9, slider log 0.0..=100.0;
    }
}

impl SpringParams {
    /// The kinds in the order in which springs are stored.
    pub fn kinds(&self) -> [KindSettings; 3] {
        [&self.stretch, &self.shear, &self.bend].map(|kind| KindSettings {
            enabled: kind.enabled,
            stiffness: kind.stiffness,
            rest_scale: kind.rest_scale,
        })
    }
}

/// The force on the first of two particles. Exactly antisymmetric: exchanging the two changes only its sign, which is
/// what makes [`scatter`] and [`gather`] agree to the last bit.
#[inline]
fn pull<T: Real, const DAMPED: bool>(
    [xi, xj]: [T::Vec3; 2],
    velocities: impl FnOnce() -> [T::Vec3; 2],
    rest: T,
    stiffness: T,
    damping: T,
) -> T::Vec3 {
    let d = xj - xi;
    let length = d.length();
    let tension = if length > T::ZERO { stiffness * (length - rest) / length } else { T::ZERO };
    if DAMPED {
        let [vi, vj] = velocities();
        d * tension + (vj - vi) * damping
    } else {
        d * tension
    }
}

/// Adds all spring forces, spring by spring: the specification of the pass, and the way on one thread.
pub fn scatter<T: Real>(springs: &Springs<T>, damping: T, state: &Particles<T>, force: &mut [T::Vec3]) {
    if damping > T::ZERO {
        scatter_pass::<T, true>(springs, damping, state, force);
    } else {
        scatter_pass::<T, false>(springs, damping, state, force);
    }
}

fn scatter_pass<T: Real, const DAMPED: bool>(
    springs: &Springs<T>,
    damping: T,
    state: &Particles<T>,
    force: &mut [T::Vec3],
) {
    let (x, v) = (&state.positions[..], &state.velocities[..]);
    for group in &springs.groups {
        let range = group.range.clone();
        for (pair, &rest) in springs.pairs[range.clone()].iter().zip(&springs.rest[range]) {
            let [i, j] = pair.map(|p| p as usize);
            let f = pull::<T, DAMPED>([x[i], x[j]], || [v[i], v[j]], rest, group.stiffness, damping);
            force[i] += f;
            force[j] -= f;
        }
    }
}

/// Adds all spring forces, particle by particle, on the threads of the current pool. Every particle adds up its springs
/// in the order of [`scatter`], so the result is the same to the last bit, whatever the number of threads.
pub fn gather<T: Real>(
    springs: &Springs<T>,
    incidence: &Incidence,
    damping: T,
    state: &Particles<T>,
    force: &mut [T::Vec3],
) {
    if damping > T::ZERO {
        gather_pass::<T, true>(springs, incidence, damping, state, force);
    } else {
        gather_pass::<T, false>(springs, incidence, damping, state, force);
    }
}

fn gather_pass<T: Real, const DAMPED: bool>(
    springs: &Springs<T>,
    incidence: &Incidence,
    damping: T,
    state: &Particles<T>,
    force: &mut [T::Vec3],
) {
    /// Particles a task: large enough that handing it to a thread costs little beside it.
    const TASK: usize = 1024;
    let (x, v) = (&state.positions[..], &state.velocities[..]);
    force.par_chunks_mut(TASK).enumerate().for_each(|(task, chunk)| {
        for (i, f) in (task * TASK..).zip(chunk) {
            let mut groups = springs.groups.iter();
            let mut group = groups.next();
            for &[j, spring] in incidence.around(i) {
                let spring = spring as usize;
                while group.is_some_and(|g| spring >= g.range.end) {
                    group = groups.next();
                }
                let Some(g) = group else { break };
                let j = j as usize;
                *f += pull::<T, DAMPED>(
                    [x[i], x[j]],
                    || [v[i], v[j]],
                    springs.rest[spring],
                    g.stiffness,
                    damping,
                );
            }
        }
    });
}
