//! Rows of vectors, one for each particle: linear combinations, and the longest vector.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::lanes::{self, Kernel, LANES, Lanes};
use super::parts::Parts;
use super::{Real, Vector};

/// What a row is multiplied by, and the row; with 0 it is not looked at.
pub type Term<'a, T> = (T, &'a [<T as Real>::Vec3]);

/// to = from + Σ factor row, in the order of the terms, on so many threads of the current pool.
pub fn combine<T: Real>(to: &mut [T::Vec3], from: &[T::Vec3], terms: &[Term<T>], threads: usize) {
    work(to, Some(from), terms, threads);
}

/// to += Σ factor row, in the order of the terms, on so many threads of the current pool.
pub fn add<T: Real>(to: &mut [T::Vec3], terms: &[Term<T>], threads: usize) {
    work(to, None, terms, threads);
}

/// Numbers that a thread has at least: so many that no two write to the same lines of a cache.
pub const UNIT: usize = 1024;

fn work<T: Real>(to: &mut [T::Vec3], from: Option<&[T::Vec3]>, terms: &[Term<T>], threads: usize) {
    let of_terms = terms.iter().filter(|(factor, _)| *factor != T::ZERO).map(|(_, row)| *row);
    assert!(from.into_iter().chain(of_terms).all(|row| row.len() == to.len()));
    let (to, from) = (T::Vec3::flat_mut(to), from.map(T::Vec3::flat));
    lanes::share(Combination { to, from, terms, first: 0 }, UNIT, threads);
}

/// The numbers from `first` on.
struct Combination<'a, T: Real> {
    to: &'a mut [T],
    from: Option<&'a [T]>,
    terms: &'a [Term<'a, T>],
    first: usize,
}

impl<T: Real> Parts for Combination<'_, T> {
    fn count(&self) -> usize {
        self.to.len()
    }

    fn split_at(self, at: usize) -> (Self, Self) {
        let Self { to, from, terms, first } = self;
        let (to, rest) = to.split_at_mut(at);
        (Self { to, from, terms, first }, Self { to: rest, from, terms, first: first + at })
    }
}

impl<T: Real> Kernel<T> for Combination<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        /// Eights at a time, as many as stand in registers.
        const ABREAST: usize = 4;
        let Self { to, from, terms, first } = self;
        let mut at = 0;
        while at + ABREAST * LANES <= to.len() {
            let mut sums = match from {
                Some(from) => eights::<T, L, ABREAST>(with, &from[first + at..]),
                None => eights::<T, L, ABREAST>(with, &to[at..]),
            };
            for (factor, row) in terms.iter().filter(|(factor, _)| *factor != T::ZERO) {
                let row = &T::Vec3::flat(row)[first + at..];
                let (factor, row) = (L::splat(with, *factor), eights::<T, L, ABREAST>(with, row));
                for i in 0..ABREAST {
                    sums[i] = sums[i] + row[i] * factor;
                }
            }
            for (i, sum) in sums.into_iter().enumerate() {
                sum.store(&mut to[at + i * LANES..]);
            }
            at += ABREAST * LANES;
        }
        for (i, to) in to.iter_mut().enumerate().skip(at) {
            let mut sum = from.map_or(*to, |from| from[first + i]);
            for (factor, row) in terms.iter().filter(|(factor, _)| *factor != T::ZERO) {
                sum += T::Vec3::flat(row)[first + i] * *factor;
            }
            *to = sum;
        }
    }
}

#[inline(always)]
fn eights<T: Real, L: Lanes<Scalar = T>, const N: usize>(with: L::Proof, from: &[T]) -> [L; N] {
    let mut eights = [L::splat(with, T::ZERO); N];
    for (i, eight) in eights.iter_mut().enumerate() {
        *eight = L::load(with, &from[i * LANES..]);
    }
    eights
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
        let [from, one, other] = [0.1, 0.2, 0.3].map(|phase| row::<T>(count, phase));
        let [half, third] = [0.5, 1.0 / 3.0].map(T::from_f64);
        let plain = |i: usize| from[i] + one[i] * half + other[i] * third;
        let plain: Vec<T::Vec3> = (0..count).map(plain).collect();
        let terms = [(half, &one[..]), (T::ZERO, &[]), (third, &other[..])];
        let mut to = row::<T>(count, 7.0);
        combine(&mut to, &from, &terms, threads);
        assert_eq!(to, plain);
        to.clone_from(&from);
        add(&mut to, &terms, threads);
        assert_eq!(to, plain);
        let lengths = plain.iter().map(|v| v.dot(*v).to_f64());
        assert_eq!(longest::<T>(&plain), lengths.fold(0.0, f64::max).sqrt());
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
