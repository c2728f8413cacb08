//! The forces of sliced springs.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::pass::{Eight, Field, Fields, Law, Sums, Vectors};
use super::{Means, Slices};
use crate::forces::springs::pull;
use crate::math::Real;
use crate::math::lanes::{Lanes, put_vectors_of};
use crate::math::parts::Parts;
use crate::model::{Particles, Springs};

/// The fields that the springs read.
pub(super) const PLACES: usize = 0;
pub(super) const SPEEDS: usize = 1;

/// Springs that pull.
#[derive(Clone, Copy, Debug)]
pub struct Stretched<'a, T: Real> {
    pub springs: &'a Springs<T>,
    /// kg/s.
    pub damping: T,
    /// Elongation, in rest lengths, beyond which it is noticed; none where nobody asks.
    pub limit: Option<T>,
}

/// Their force.
#[derive(Clone, Copy)]
pub(super) struct Pull<'a, T: Real, const DAMPED: bool> {
    pub slices: &'a Slices<T>,
    pub springs: Stretched<'a, T>,
}

impl<T: Real, const DAMPED: bool> Law<T> for Pull<'_, T, DAMPED> {
    #[inline(always)]
    fn give<L: Lanes<Scalar = T>>(
        self,
        with: L::Proof,
        eight: Eight,
        here: impl Fields<T>,
        there: impl Fields<T>,
        most: &mut L,
    ) -> [L; 3] {
        let (group, rest) = match eight {
            Eight::Row { group, number } => (group, self.slices.row_rest[number]),
            Eight::Loose { group, number } => (group, self.slices.list_rest[number]),
        };
        let Stretched { springs, damping, limit } = self.springs;
        let stiffness = L::splat(with, springs.groups[group].stiffness);
        let places = [here.field(with, PLACES), there.field(with, PLACES)];
        let speeds = if DAMPED { [here.field(with, SPEEDS), there.field(with, SPEEDS)] } else { places };
        let damping = L::splat(with, damping);
        let rest = L::of(with, rest);
        let (force, elongation) = pull::<L, DAMPED>(places, speeds, stiffness, rest, damping);
        if let Some(limit) = limit {
            *most = (elongation - rest * L::splat(with, limit)).max(*most);
        }
        force
    }
}

/// Forces on particles, N, to which those of the springs are added.
struct Forces<'a, T: Real>(&'a mut [T::Vec3]);

impl<T: Real> Parts for Forces<'_, T> {
    fn count(&self) -> usize {
        self.0.len()
    }

    fn split_at(self, particle: usize) -> (Self, Self) {
        let (force, rest) = self.0.split_at_mut(particle);
        (Self(force), Self(rest))
    }
}

impl<T: Real> Sums<T> for Forces<'_, T> {
    #[inline(always)]
    fn begin<L: Lanes<Scalar = T>>(&self, with: L::Proof, at: usize, _: impl Fields<T>) -> [L; 3] {
        Vectors(&*self.0).eight(with, at)
    }

    #[inline(always)]
    fn end<L: Lanes<Scalar = T>>(&mut self, _: L::Proof, at: usize, _: impl Fields<T>, sum: [L; 3]) {
        put_vectors_of::<T, L>(sum, &mut self.0[at..]);
    }
}

impl<T: Real> Slices<T> {
    /// Adds the forces of all springs to `force` (N).
    pub fn add_forces(
        &self,
        springs: Stretched<T>,
        state: &Particles<T>,
        force: &mut [T::Vec3],
        means: Means<T>,
    ) {
        self.pull(springs, state, Forces(force), means);
    }

    /// Sums up the forces of the springs.
    pub(super) fn pull(
        &self,
        springs: Stretched<T>,
        state: &Particles<T>,
        sums: impl Sums<T>,
        Means { windows, threads }: Means<T>,
    ) {
        let fields = [Vectors(&state.positions), Vectors(&state.velocities)];
        if springs.damping > T::ZERO {
            self.go_over(fields, Pull::<T, true> { slices: self, springs }, sums, windows, threads);
        } else {
            self.go_over(fields, Pull::<T, false> { slices: self, springs }, sums, windows, threads);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::pass::{Pass, Window};
    use super::super::tests::{cloths, crumpled, place};
    use super::*;
    use crate::math::Vector;
    use crate::math::lanes::{Kernel, Plain};
    use crate::model::Topology;

    /// The springs one by one, and for each particle the sum of the magnitudes with their number.
    fn scatter<T: Real>(
        springs: &Springs<T>,
        damping: T,
        state: &Particles<T>,
        force: &mut [T::Vec3],
    ) -> Vec<(f64, f64)> {
        let mut sums: Vec<(f64, f64)> = force.iter().map(|f| (f.to_f64().abs().max_element(), 1.0)).collect();
        for group in &springs.groups {
            for s in group.range.clone() {
                let [i, j] = springs.pairs[s].map(|p| p as usize);
                let d = state.positions[j] - state.positions[i];
                let length = d.length();
                let some = length > T::ZERO;
                let tension =
                    if some { group.stiffness * (length - springs.rest[s]) / length } else { T::ZERO };
                let f = d * tension + (state.velocities[j] - state.velocities[i]) * damping;
                force[i] += f;
                force[j] -= f;
                for end in [i, j] {
                    sums[end].0 += f.to_f64().abs().max_element();
                    sums[end].1 += 1.0;
                }
            }
        }
        sums
    }

    fn agree<T: Real>(topology: &Topology, particles: usize, damping: f64) {
        let (springs, state) = crumpled::<T>(topology, particles);
        let damping = T::from_f64(damping);
        let started = vec![place::<T>(3, 1.0); particles];
        let mut plain = started.clone();
        let sums = scatter(&springs, damping, &state, &mut plain);
        let slices = Slices::new(particles, &springs);
        let stretched = Stretched { springs: &springs, damping, limit: None };
        let on = |threads| {
            let mut force = started.clone();
            let means = Means { windows: &mut Vec::new(), threads };
            slices.add_forces(stretched, &state, &mut force, means);
            force
        };
        let force = on(1);
        // A sum of n terms in any order is within (n - 1) ε Σ|term| of the true one (Higham, "Accuracy and Stability of
        // Numerical Algorithms", 2002, 4.2), to first order in ε, here half the distance of two numbers.
        let epsilon = T::EPSILON.to_f64() / 2.0;
        for ((f, plain), (sum, terms)) in force.iter().zip(&plain).zip(sums) {
            let off = (f.to_f64() - plain.to_f64()).abs().max_element();
            assert!(off <= 2.0 * terms * epsilon * sum, "{off:e} of {sum}");
        }
        for threads in [2, 3, 8] {
            assert_eq!(on(threads), force, "{threads} threads");
        }
        let mut without = started;
        let mut window = Window::default();
        window.hold(2);
        let pass = Pass {
            slices: &slices,
            particles,
            fields: [Vectors(&state.positions), Vectors(&state.velocities)],
            law: Pull::<T, true> { slices: &slices, springs: stretched },
            first: 0,
            sums: Forces(&mut without),
            windows: &mut [window],
        };
        // Springs with a damping of 0 are damped by 0.
        pass.run::<Plain<T>>(());
        assert_eq!(without, force, "in plain arrays");
    }

    #[test]
    fn the_pass_gives_the_sums_of_the_springs_on_any_machine_and_number_of_threads() {
        for (topology, particles) in cloths() {
            for damping in [0.0, 2.0] {
                agree::<f32>(&topology, particles, damping);
                agree::<f64>(&topology, particles, damping);
            }
        }
    }
}
