//! What acts on the particles besides springs, and the accelerations that come of all forces.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::pass::{Fields, Sums};
use super::pulls::{PLACES, SPEEDS};
use super::{Means, Slices, Stretched};
use crate::forces::pull::Pull;
use crate::forces::{air_damping, gravity};
use crate::math::lanes::{LANES, Lanes, eight_of, put_vectors_of};
use crate::math::parts::Parts;
use crate::math::{Real, Vector};
use crate::model::Particles;

/// Gravity, wind, air and hands, and what they act on.
#[derive(Clone, Copy, Debug)]
pub struct Loads<'a, T: Real> {
    /// kg.
    pub mass: &'a [T],
    /// 1/kg; 0 where a particle is pinned or held.
    pub inverse_mass: &'a [T],
    /// m/s².
    pub gravity: T::Vec3,
    /// N.
    pub wind: T::Vec3,
    /// kg/s.
    pub air_damping: T,
    /// By particle.
    pub pulls: &'a [Pull<T>],
}

impl<T: Real> Loads<'_, T> {
    /// Those of the particles before one of them, and of the rest: hands are taken as they come.
    pub fn split_at(self, particle: usize) -> (Self, Self) {
        let (pulls, rest) =
            self.pulls.split_at(self.pulls.partition_point(|p| (p.particle as usize) < particle));
        (Self { pulls, ..self }, Self { pulls: rest, ..self })
    }

    /// The forces (N) on the eight particles from `own` on before those of springs and hands.
    #[inline(always)]
    pub fn begin<L: Lanes<Scalar = T>>(&self, with: L::Proof, own: usize, here: impl Fields<T>) -> [L; 3] {
        let mass = eight_of(with, &self.mass[own..]);
        let (zero, air) = (L::splat(with, T::ZERO), L::splat(with, self.air_damping));
        let ([gx, gy, gz], [wx, wy, wz]) = (self.gravity.to_array(), self.wind.to_array());
        let [vx, vy, vz]: [L; 3] = here.field(with, SPEEDS);
        // From +0, so that no particle of no force has -0.
        [
            zero + gravity::force(L::splat(with, gx), mass)
                + L::splat(with, wx)
                + air_damping::force(air, vx),
            zero + gravity::force(L::splat(with, gy), mass)
                + L::splat(with, wy)
                + air_damping::force(air, vy),
            zero + gravity::force(L::splat(with, gz), mass)
                + L::splat(with, wz)
                + air_damping::force(air, vz),
        ]
    }

    /// The accelerations (m/s²) of the eight particles from `own` on by the forces (N) before those of the hands, which are the
    /// next ones.
    #[inline(always)]
    pub fn accelerations<L: Lanes<Scalar = T>>(
        &mut self,
        with: L::Proof,
        own: usize,
        here: impl Fields<T>,
        sum: [L; 3],
    ) -> [L; 3] {
        let [x, y, z] = if self.pulls.is_empty() { sum } else { self.pulled(with, own, here, sum) };
        let w = eight_of::<T, L>(with, &self.inverse_mass[own..]);
        // Where no particle is, any force may have come out.
        [(x * w).where_positive(w), (y * w).where_positive(w), (z * w).where_positive(w)]
    }

    /// The forces on eight particles with those of the hands that pull at them.
    #[inline(always)]
    fn pulled<L: Lanes<Scalar = T>>(
        &mut self,
        with: L::Proof,
        own: usize,
        here: impl Fields<T>,
        force: [L; 3],
    ) -> [L; 3] {
        let arrays = |lanes: [L; 3]| [lanes[0].to_array(), lanes[1].to_array(), lanes[2].to_array()];
        let (x, v) = (arrays(here.field(with, PLACES)), arrays(here.field(with, SPEEDS)));
        let mut sum = arrays(force);
        while let [pull, left @ ..] = self.pulls
            && let lane = pull.particle as usize - own
            && lane < LANES
        {
            let of = |arrays: &[[T; LANES]; 3]| T::Vec3::from_array(arrays.map(|component| component[lane]));
            let pulled = of(&sum) + pull.force(of(&x), of(&v));
            sum.iter_mut().zip(pulled.to_array()).for_each(|(component, f)| component[lane] = f);
            self.pulls = left;
        }
        [L::of(with, sum[0]), L::of(with, sum[1]), L::of(with, sum[2])]
    }
}

/// Accelerations of the particles from `first` on, m/s².
struct Accelerations<'a, T: Real> {
    loads: Loads<'a, T>,
    first: usize,
    to: &'a mut [T::Vec3],
}

impl<T: Real> Parts for Accelerations<'_, T> {
    fn count(&self) -> usize {
        self.to.len()
    }

    fn split_at(self, particle: usize) -> (Self, Self) {
        let Self { loads, first, to } = self;
        let middle = first + particle;
        let ((loads, others), (to, rest)) = (loads.split_at(middle), to.split_at_mut(particle));
        (Self { loads, first, to }, Self { loads: others, first: middle, to: rest })
    }
}

impl<T: Real> Sums<T> for Accelerations<'_, T> {
    #[inline(always)]
    fn begin<L: Lanes<Scalar = T>>(&self, with: L::Proof, at: usize, here: impl Fields<T>) -> [L; 3] {
        self.loads.begin(with, self.first + at, here)
    }

    #[inline(always)]
    fn end<L: Lanes<Scalar = T>>(&mut self, with: L::Proof, at: usize, here: impl Fields<T>, sum: [L; 3]) {
        put_vectors_of::<T, L>(
            self.loads.accelerations(with, self.first + at, here, sum),
            &mut self.to[at..],
        );
    }
}

impl<T: Real> Slices<T> {
    /// Writes the accelerations by the loads and all springs over `to` (m/s²).
    pub fn accelerations(
        &self,
        springs: Stretched<T>,
        state: &Particles<T>,
        loads: Loads<T>,
        to: &mut [T::Vec3],
        means: Means<T>,
    ) {
        self.pull(springs, state, Accelerations { loads, first: 0, to }, means);
    }
}
