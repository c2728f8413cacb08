//! Rows of vectors, one for each particle: linear combinations, and the longest vector.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::lanes::{self, Kernel, LANES, Lanes};
use super::parts::Parts;
use super::{Real, Vector};

/// Numbers that a thread has at least: so many that no two write to the same lines of a cache.
pub const UNIT: usize = 1024;

/// to += Σ factor row, in the order of the terms, on so many threads of the current pool.
pub fn add<T: Real>(to: &mut [T::Vec3], terms: &[(T, &[T::Vec3])], threads: usize) {
    assert!(terms.iter().all(|(_, row)| row.len() == to.len()));
    lanes::share(Sum { to: T::Vec3::flat_mut(to), terms, first: 0 }, UNIT, threads);
}

/// What is added of a row to positions and to velocities, and the row; one of which nothing is added is not looked at.
pub type Push<'a, T> = ([T; 2], &'a [<T as Real>::Vec3]);

/// Where positions and velocities begin.
#[derive(Clone, Copy, Debug)]
pub enum Start<'a, T: Real> {
    /// As they are.
    Here,
    /// As these.
    At([&'a [T::Vec3]; 2]),
    /// At nothing.
    Zero,
}

/// Positions x = x0 + `ahead` v0 + Σ factor row and velocities v = v0 + Σ factor row, in the order of the terms, on so many threads
/// of the current pool: a step or a stage of a method whose rows are accelerations.
pub fn advance<T: Real>(
    to: [&mut [T::Vec3]; 2],
    start: Start<T>,
    ahead: T,
    terms: &[Push<T>],
    threads: usize,
) {
    let [positions, velocities] = to;
    let count = positions.len();
    let of_terms = terms.iter().filter(|(factors, _)| is_looked_at(factors)).map(|(_, row)| row.len());
    let of_start = if let Start::At([x, v]) = start { [x.len(), v.len()] } else { [count; 2] };
    assert!(of_terms.chain(of_start).chain([velocities.len()]).all(|length| length == count));
    let to = [T::Vec3::flat_mut(positions), T::Vec3::flat_mut(velocities)];
    lanes::share(Advance { to, start, ahead, terms, first: 0 }, UNIT, threads);
}

fn is_looked_at<T: Real>(factors: &[T; 2]) -> bool {
    factors[0] != T::ZERO || factors[1] != T::ZERO
}

/// The numbers from `first` on.
struct Sum<'a, T: Real> {
    to: &'a mut [T],
    terms: &'a [(T, &'a [T::Vec3])],
    first: usize,
}

impl<T: Real> Parts for Sum<'_, T> {
    fn count(&self) -> usize {
        self.to.len()
    }

    fn split_at(self, at: usize) -> (Self, Self) {
        let (first, (to, rest)) = (self.first + at, self.to.split_at_mut(at));
        (Self { to, ..self }, Self { to: rest, first, ..self })
    }
}

/// Eights at a time, as many as stand in registers.
const ABREAST: usize = 4;

impl<T: Real> Kernel<T> for Sum<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let Self { to, terms, first } = self;
        let mut at = 0;
        while at + ABREAST * LANES <= to.len() {
            let mut sums = eights::<T, L>(with, &to[at..]);
            for (factor, row) in terms {
                push(with, &mut sums, *factor, eights(with, &T::Vec3::flat(row)[first + at..]));
            }
            put(sums, &mut to[at..]);
            at += ABREAST * LANES;
        }
        for (i, to) in to.iter_mut().enumerate().skip(at) {
            for (factor, row) in terms {
                *to += T::Vec3::flat(row)[first + i] * *factor;
            }
        }
    }
}

/// The numbers from `first` on.
struct Advance<'a, T: Real> {
    to: [&'a mut [T]; 2],
    start: Start<'a, T>,
    ahead: T,
    terms: &'a [Push<'a, T>],
    first: usize,
}

impl<T: Real> Parts for Advance<'_, T> {
    fn count(&self) -> usize {
        self.to[0].len()
    }

    fn split_at(self, at: usize) -> (Self, Self) {
        let Self { to: [positions, velocities], start, ahead, terms, first } = self;
        let (positions, other_positions) = positions.split_at_mut(at);
        let (velocities, other_velocities) = velocities.split_at_mut(at);
        (
            Self { to: [positions, velocities], start, ahead, terms, first },
            Self { to: [other_positions, other_velocities], start, ahead, terms, first: first + at },
        )
    }
}

impl<T: Real> Kernel<T> for Advance<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let Self { to: [positions, velocities], start, ahead, terms, first } = self;
        let zero = [L::splat(with, T::ZERO); ABREAST];
        let mut at = 0;
        while at + ABREAST * LANES <= positions.len() {
            let (mut x, mut v) = match start {
                Start::Here => (eights(with, &positions[at..]), eights(with, &velocities[at..])),
                Start::At([x, v]) => (
                    eights(with, &T::Vec3::flat(x)[first + at..]),
                    eights(with, &T::Vec3::flat(v)[first + at..]),
                ),
                Start::Zero => (zero, zero),
            };
            push(with, &mut x, ahead, v);
            for ([to_x, to_v], row) in terms.iter().filter(|(factors, _)| is_looked_at(factors)) {
                let row = eights::<T, L>(with, &T::Vec3::flat(row)[first + at..]);
                push(with, &mut x, *to_x, row);
                push(with, &mut v, *to_v, row);
            }
            put(x, &mut positions[at..]);
            put(v, &mut velocities[at..]);
            at += ABREAST * LANES;
        }
        for i in at..positions.len() {
            let (mut x, mut v) = match start {
                Start::Here => (positions[i], velocities[i]),
                Start::At([x, v]) => (T::Vec3::flat(x)[first + i], T::Vec3::flat(v)[first + i]),
                Start::Zero => (T::ZERO, T::ZERO),
            };
            x += v * ahead;
            for ([to_x, to_v], row) in terms.iter().filter(|(factors, _)| is_looked_at(factors)) {
                let a = T::Vec3::flat(row)[first + i];
                x += a * *to_x;
                v += a * *to_v;
            }
            (positions[i], velocities[i]) = (x, v);
        }
    }
}

#[inline(always)]
fn push<L: Lanes>(with: L::Proof, sums: &mut [L; ABREAST], factor: L::Scalar, row: [L; ABREAST]) {
    let factor = L::splat(with, factor);
    for i in 0..ABREAST {
        sums[i] = sums[i] + row[i] * factor;
    }
}

#[inline(always)]
fn eights<T: Real, L: Lanes<Scalar = T>>(with: L::Proof, from: &[T]) -> [L; ABREAST] {
    let mut eights = [L::splat(with, T::ZERO); ABREAST];
    for (i, eight) in eights.iter_mut().enumerate() {
        *eight = L::load(with, &from[i * LANES..]);
    }
    eights
}

#[inline(always)]
fn put<T: Real, L: Lanes<Scalar = T>>(eights: [L; ABREAST], to: &mut [T]) {
    for (i, eight) in eights.into_iter().enumerate() {
        eight.store(&mut to[i * LANES..]);
    }
}

/// The length of the longest vector; infinite if one is not a number.
pub fn longest<T: Real>(row: &[T::Vec3]) -> f64 {
    let (most, sum) = lanes::run(Longest::<T>(row));
    if sum.to_f64().is_nan() { f64::INFINITY } else { most.to_f64().sqrt() }
}

/// The largest square of a length, and the sum of all: the larger of a number and what is none is the number.
struct Longest<'a, T: Real>(&'a [T::Vec3]);

impl<T: Real> Kernel<T> for Longest<'_, T> {
    type Output = (T, T);

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) -> (T, T) {
        let (eights, last) = self.0.as_chunks();
        let [mut most, mut sum] = [L::splat(with, T::ZERO); 2];
        for eight in eights {
            let [x, y, z] = L::vectors(with, eight);
            let square = x * x + y * y + z * z;
            (most, sum) = (square.max(most), sum + square);
        }
        let squares = most.to_array().into_iter().chain(last.iter().map(|v| v.dot(*v)));
        let most = squares.fold(T::ZERO, |most, square| if square > most { square } else { most });
        let sums = sum.to_array().into_iter().chain(last.iter().map(|v| v.dot(*v)));
        (most, sums.fold(T::ZERO, |sum, square| sum + square))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn row<T: Real>(count: usize, phase: f64) -> Vec<T::Vec3> {
        let at = |i: usize| T::Vec3::from_f64(DVec3::new(1.0, 2.0, 3.0) * (i as f64 + phase).sin());
        (0..count).map(at).collect()
    }

    /// Number by number, to the bit.
    fn agree<T: Real>(count: usize, threads: usize) {
        let [x, v, one, other] = [0.1, 0.2, 0.3, 0.4].map(|phase| row::<T>(count, phase));
        let [half, third] = [0.5, 1.0 / 3.0].map(T::from_f64);
        let plain = |from: &[T::Vec3]| -> Vec<T::Vec3> {
            (0..count).map(|i| from[i] + one[i] * half + other[i] * third).collect()
        };
        let mut to = x.clone();
        add(&mut to, &[(half, &one), (third, &other)], threads);
        assert_eq!(to, plain(&x));
        let lengths = to.iter().map(|v| v.dot(*v).to_f64());
        assert_eq!(longest::<T>(&to), lengths.fold(0.0, f64::max).sqrt());

        let zero = vec![T::Vec3::ZERO; count];
        for (start, from) in
            [(Start::Here, [&x, &v]), (Start::At([&x, &v]), [&x, &v]), (Start::Zero, [&zero; 2])]
        {
            let mut to =
                if let Start::Here = start { [x.clone(), v.clone()] } else { [one.clone(), other.clone()] };
            let [positions, velocities] = &mut to;
            let terms = [([half; 2], &one[..]), ([T::ZERO; 2], &[]), ([third; 2], &other)];
            advance([positions, velocities], start, third, &terms, threads);
            let moved: Vec<T::Vec3> = (0..count).map(|i| from[0][i] + from[1][i] * third).collect();
            assert_eq!(to, [plain(&moved), plain(from[1])], "{start:?}");
        }
    }

    #[test]
    fn combinations_are_those_of_the_numbers_one_by_one() {
        for count in [0, 1, 10, 11, 100, 1500] {
            for threads in [1, 2, 3] {
                agree::<f32>(count, threads);
                agree::<f64>(count, threads);
            }
        }
    }

    #[test]
    fn what_is_no_number_is_longest() {
        for at in [0, 3, 8, 17] {
            let mut row = row::<f64>(18, 0.0);
            row[at].y = f64::NAN;
            assert_eq!(longest::<f64>(&row), f64::INFINITY);
        }
    }
}
