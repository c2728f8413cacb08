//! Springs one by one, in the order in which they were made.

use super::Sweep;
use crate::forces::Problem;
use crate::math::parts::each_particle;
use crate::math::{Real, Vector};
use crate::model::Particles;

/// All springs in a chain.
#[derive(Debug, Default)]
pub struct Chain<T: Real> {
    /// The problem's revision that the springs were taken from.
    taken: u64,
    /// Pairs and rest lengths (m).
    springs: Vec<([u32; 2], T)>,
    /// Where each particle is, m, and the weight by which it gives way: one after the other, as springs may lead anywhere.
    places: Vec<[T; 4]>,
}

impl<T: Real> Sweep<T> for Chain<T> {
    fn take(&mut self, problem: &Problem<T>) {
        if self.taken == problem.revision() {
            return;
        }
        let springs = &problem.springs;
        let mut order: Vec<usize> = (0..springs.len()).collect();
        order.sort_unstable_by_key(|s| springs.ids[*s]);
        self.springs.clear();
        self.springs.extend(order.into_iter().map(|s| (springs.pairs[s], springs.rest[s])));
        self.taken = problem.revision();
    }

    fn set_out(
        &mut self,
        positions: &[T::Vec3],
        velocities: &[T::Vec3],
        weights: &[T],
        h: T,
        threads: usize,
    ) {
        self.places.resize(positions.len(), [T::ZERO; 4]);
        let particles = (&mut self.places[..], positions, velocities, weights);
        each_particle(particles, threads, |(places, positions, velocities, weights)| {
            let free = positions.iter().zip(velocities).zip(weights);
            for (place, ((&x, &v), &w)) in places.iter_mut().zip(free) {
                *place = quad(x + v * h, w);
            }
        });
    }

    fn relax(&mut self, _: &[T], _: bool) {
        for &(pair, rest) in &self.springs {
            relax_one(&mut self.places, pair, rest);
        }
    }

    fn arrive(&self, state: &mut Particles<T>, velocities: &[T::Vec3], _: &[T], h: T, threads: usize) {
        let moved = (&mut state.positions[..], &mut state.velocities[..], &self.places[..], velocities);
        each_particle(moved, threads, |(positions, moved, places, velocities)| {
            let places = places.iter().zip(velocities);
            for ((x, v), (place, free)) in positions.iter_mut().zip(moved).zip(places) {
                let start = std::mem::replace(x, point(place));
                *v = if place[3] > T::ZERO { (*x - start) * (T::ONE / h) } else { *free };
            }
        });
    }
}

/// Puts one spring to its rest length.
pub(super) fn relax_one<T: Real>(places: &mut [[T; 4]], pair: [u32; 2], rest: T) {
    let [i, j] = pair.map(|p| p as usize);
    let (a, b) = (places[i], places[j]);
    let w = a[3] + b[3];
    let d = point::<T>(&b) - point::<T>(&a);
    let length = d.length();
    if w > T::ZERO && length > T::ZERO {
        let correction = d * ((length - rest) / (length * w));
        places[i] = quad(point::<T>(&a) + correction * a[3], a[3]);
        places[j] = quad(point::<T>(&b) - correction * b[3], b[3]);
    }
}

/// A place, and a weight.
pub(super) fn quad<T: Real>(x: T::Vec3, w: T) -> [T; 4] {
    let [x, y, z] = x.to_array();
    [x, y, z, w]
}

pub(super) fn point<T: Real>(&[x, y, z, _]: &[T; 4]) -> T::Vec3 {
    T::Vec3::from_array([x, y, z])
}
