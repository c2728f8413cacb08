//! Positions by component, where a sweep moves them.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use crate::math::Real;
use crate::math::lanes::{self, Kernel, LANES, Lanes, eight_of, put_eight_of, put_vectors_of, vectors_of};
use crate::math::parts::each_particle;
use crate::model::Particles;

/// A row of x, one of y, and one of z, so that eight neighbours are read as they stand.
#[derive(Debug)]
pub struct Components<T> {
    numbers: Vec<T>,
    count: usize,
    /// From the beginning of a row to that of the next.
    stride: usize,
}

impl<T> Default for Components<T> {
    fn default() -> Self {
        Self { numbers: Vec::new(), count: 0, stride: 1 }
    }
}

impl<T: Real> Components<T> {
    /// Makes room for so many vectors.
    pub fn resize(&mut self, count: usize) {
        /// What rows are longer than whole pages: at distances near a multiple of 4 KiB processors take what is read for what was
        /// just written.
        const APART: usize = 216;
        const PAGE: usize = 1024;
        (self.count, self.stride) = (count, count.next_multiple_of(PAGE) + APART);
        self.numbers.resize(3 * self.stride, T::ZERO);
    }

    /// How many vectors.
    pub fn len(&self) -> usize {
        self.count
    }

    /// x, y and z.
    pub fn rows(&self) -> [&[T]; 3] {
        [0, 1, 2].map(|row| &self.numbers[row * self.stride..][..self.count])
    }

    /// The same, to be written.
    pub fn rows_mut(&mut self) -> [&mut [T]; 3] {
        let mut rows = self.numbers.chunks_mut(self.stride);
        [(); 3].map(|()| rows.next().map_or(&mut [][..], |row| &mut row[..self.count]))
    }
}

/// Three rows that threads can share.
type Rows<R> = (R, (R, R));

fn shared<R>([x, y, z]: [R; 3]) -> Rows<R> {
    (x, (y, z))
}

/// Sets particles out: where they start (m), and where they get to on their own within `h` (s) at the velocities given (m/s).
pub fn set_out<T: Real>(
    [starts, places]: [&mut Components<T>; 2],
    positions: &[T::Vec3],
    velocities: &[T::Vec3],
    h: T,
    threads: usize,
) {
    starts.resize(positions.len());
    places.resize(positions.len());
    let rows = (shared(starts.rows_mut()), shared(places.rows_mut()));
    each_particle((rows, (positions, velocities)), threads, |(rows, (positions, velocities))| {
        lanes::run(SetOut::<T> { rows, positions, velocities, h });
    });
}

struct SetOut<'a, T: Real> {
    rows: (Rows<&'a mut [T]>, Rows<&'a mut [T]>),
    positions: &'a [T::Vec3],
    velocities: &'a [T::Vec3],
    h: T,
}

impl<T: Real> Kernel<T> for SetOut<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let Self { rows: ((sx, (sy, sz)), (px, (py, pz))), positions, velocities, h } = self;
        let h = L::splat(with, h);
        for at in (0..positions.len()).step_by(LANES) {
            let [x, y, z] = vectors_of::<T, L>(with, &positions[at..]);
            let [vx, vy, vz] = vectors_of::<T, L>(with, &velocities[at..]);
            put_eight_of(x, &mut sx[at..]);
            put_eight_of(y, &mut sy[at..]);
            put_eight_of(z, &mut sz[at..]);
            put_eight_of(x + vx * h, &mut px[at..]);
            put_eight_of(y + vy * h, &mut py[at..]);
            put_eight_of(z + vz * h, &mut pz[at..]);
        }
    }
}

/// Takes the particles of a step of `h` (s) from their starts to their places: v = (place - start) / h, or the velocity that they
/// set out with where their weight is 0.
pub fn arrive<T: Real>(
    [starts, places]: [&Components<T>; 2],
    state: &mut Particles<T>,
    velocities: &[T::Vec3],
    weights: &[T],
    h: T,
    threads: usize,
) {
    let rows = (shared(starts.rows()), shared(places.rows()));
    let to = (&mut state.positions[..], &mut state.velocities[..]);
    each_particle((rows, to, velocities, weights), threads, |(rows, to, velocities, weights)| {
        lanes::run(Arrive::<T> { rows, to, velocities, weights, rate: T::ONE / h });
    });
}

struct Arrive<'a, T: Real> {
    rows: (Rows<&'a [T]>, Rows<&'a [T]>),
    to: (&'a mut [T::Vec3], &'a mut [T::Vec3]),
    velocities: &'a [T::Vec3],
    weights: &'a [T],
    rate: T,
}

impl<T: Real> Kernel<T> for Arrive<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let Self { rows: ((sx, (sy, sz)), (px, (py, pz))), to, velocities, weights, rate } = self;
        let (positions, moved) = to;
        let rate = L::splat(with, rate);
        for at in (0..weights.len()).step_by(LANES) {
            let x = eight_of::<T, L>(with, &px[at..]);
            let y = eight_of::<T, L>(with, &py[at..]);
            let z = eight_of::<T, L>(with, &pz[at..]);
            let ways =
                [x - eight_of(with, &sx[at..]), y - eight_of(with, &sy[at..]), z - eight_of(with, &sz[at..])];
            put_vectors_of::<T, L>([x, y, z], &mut positions[at..]);
            let mut v = vectors_of::<T, L>(with, &velocities[at..]);
            let w = eight_of::<T, L>(with, &weights[at..]);
            for c in 0..3 {
                let kept = v[c] - v[c].where_positive(w);
                v[c] = (ways[c] * rate).where_positive(w) + kept;
            }
            put_vectors_of::<T, L>(v, &mut moved[at..]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vector;
    use glam::DVec3;

    fn agree<T: Real>(count: usize, threads: usize) {
        let row = |phase: f64| -> Vec<T::Vec3> {
            (0..count)
                .map(|i| T::Vec3::from_f64(DVec3::new(1.0, 2.0, 3.0) * (i as f64 + phase).sin()))
                .collect()
        };
        let (positions, velocities, h) = (row(0.1), row(0.2), T::from_f64(0.01));
        let weights: Vec<T> = (0..count).map(|i| T::from_f64((i % 3) as f64)).collect();
        let (mut starts, mut places) = (Components::default(), Components::default());
        set_out([&mut starts, &mut places], &positions, &velocities, h, threads);
        let mut state = Particles::at_rest(positions.clone());
        arrive([&starts, &places], &mut state, &velocities, &weights, h, threads);
        for i in 0..count {
            let to = positions[i] + velocities[i] * h;
            let v = if i % 3 == 0 { velocities[i] } else { (to - positions[i]) * (T::ONE / h) };
            assert_eq!((state.positions[i], state.velocities[i]), (to, v));
        }
    }

    #[test]
    fn particles_get_where_they_would_one_by_one_and_keep_velocities_where_they_have_no_weight() {
        for count in [0, 1, 7, 8, 100, 1500] {
            for threads in [1, 2, 3] {
                agree::<f32>(count, threads);
                agree::<f64>(count, threads);
            }
        }
    }
}
