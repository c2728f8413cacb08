//! Eight numbers side by side, for kernels that work on eight springs or particles at once.
//!
//! Every operation is that of the scalar, correctly rounded, lane by lane: a kernel gives the same bits on every machine,
//! whatever registers its lanes stand in, and they are those of a loop over eight numbers. That rules out what processors
//! round each in their own way or not twice where the loop does: fused multiplication and addition, estimates of
//! reciprocals and of reciprocal roots.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

#[cfg(target_arch = "x86_64")]
pub(super) mod avx2;

use super::parts::{self, Parts};
use super::{Real, Vector};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// How many numbers stand side by side.
pub const LANES: usize = 8;

/// Eight numbers.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// The number.
    type Scalar: Real;
    /// The proof that this processor has the instructions.
    type Proof: Copy + Send + Sync;
    /// The same number eight times.
    fn splat(with: Self::Proof, value: Self::Scalar) -> Self;
    /// These numbers.
    fn of(with: Self::Proof, values: [Self::Scalar; LANES]) -> Self;
    /// The numbers.
    fn to_array(self) -> [Self::Scalar; LANES];
    /// Square roots.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Itself where it is larger than `other`, else that.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// Itself where `of` is above 0, else 0.
    #[must_use]
    fn where_positive(self, of: Self) -> Self;
    /// Itself in the lanes whose bit is set, from the lowest on, else 0.
    #[must_use]
    fn only(self, lanes: u32) -> Self;
    /// The x, the y and the z of eight vectors.
    fn vectors(with: Self::Proof, vectors: &[<Self::Scalar as Real>::Vec3; LANES]) -> [Self; 3];
    /// The other way round.
    fn put_vectors(components: [Self; 3], vectors: &mut [<Self::Scalar as Real>::Vec3; LANES]);
    /// The x, the y and the z of the vectors at eight places.
    fn components(
        with: Self::Proof,
        vectors: &[<Self::Scalar as Real>::Vec3],
        at: &[u32; LANES],
    ) -> [Self; 3];
    /// Of sixteen numbers every other one from the first on, and from the second; or, with a `WAY` of 2, every other two: in lanes
    /// as [`Real::TEETH`] tells.
    fn comb<const WAY: usize>(with: Self::Proof, numbers: &[Self::Scalar; 2 * LANES]) -> [Self; 2];
    /// The other way round.
    fn put_comb<const WAY: usize>(comb: [Self; 2], numbers: &mut [Self::Scalar; 2 * LANES]);

    /// The first eight numbers of a slice.
    #[inline(always)]
    fn load(with: Self::Proof, from: &[Self::Scalar]) -> Self {
        let mut values = [Self::Scalar::ZERO; LANES];
        values.copy_from_slice(&from[..LANES]);
        Self::of(with, values)
    }

    /// Puts them over the first eight numbers of a slice.
    #[inline(always)]
    fn store(self, to: &mut [Self::Scalar]) {
        to[..LANES].copy_from_slice(&self.to_array());
    }

    /// The numbers at eight places.
    #[inline(always)]
    fn gather(with: Self::Proof, from: &[Self::Scalar], at: &[u32; LANES]) -> Self {
        let mut values = [Self::Scalar::ZERO; LANES];
        for (value, i) in values.iter_mut().zip(at) {
            *value = from[*i as usize];
        }
        Self::of(with, values)
    }

    /// Puts them to eight places.
    #[inline(always)]
    fn scatter(self, to: &mut [Self::Scalar], at: &[u32; LANES]) {
        for (value, i) in self.to_array().into_iter().zip(at) {
            to[*i as usize] = value;
        }
    }
}

/// The first eight numbers of a slice, 0 where there are no more.
#[inline(always)]
pub fn eight_of<T: Real, L: Lanes<Scalar = T>>(with: L::Proof, numbers: &[T]) -> L {
    if numbers.len() >= LANES {
        L::load(with, numbers)
    } else {
        let mut eight = [T::ZERO; LANES];
        eight[..numbers.len()].copy_from_slice(numbers);
        L::of(with, eight)
    }
}

/// Puts numbers over the first eight of a slice, or over as many as there are.
#[inline(always)]
pub fn put_eight_of<T: Real, L: Lanes<Scalar = T>>(eight: L, to: &mut [T]) {
    if to.len() >= LANES {
        eight.store(to);
    } else {
        to.copy_from_slice(&eight.to_array()[..to.len()]);
    }
}

/// The first eight vectors of a slice, 0 where there are no more.
#[inline(always)]
pub fn vectors_of<T: Real, L: Lanes<Scalar = T>>(with: L::Proof, vectors: &[T::Vec3]) -> [L; 3] {
    if let Some(eight) = vectors.first_chunk() {
        L::vectors(with, eight)
    } else {
        let mut eight = [T::Vec3::ZERO; LANES];
        eight[..vectors.len()].copy_from_slice(vectors);
        L::vectors(with, &eight)
    }
}

/// Puts vectors over the first eight of a slice, or over as many as there are.
#[inline(always)]
pub fn put_vectors_of<T: Real, L: Lanes<Scalar = T>>(vectors: [L; 3], to: &mut [T::Vec3]) {
    if let Some(to) = to.first_chunk_mut() {
        L::put_vectors(vectors, to);
    } else {
        let mut all = [T::Vec3::ZERO; LANES];
        L::put_vectors(vectors, &mut all);
        to.copy_from_slice(&all[..to.len()]);
    }
}

/// Work that is written once for lanes of any kind. Everything that it calls must be inlined into it.
pub trait Kernel<T: Real> {
    /// What comes of it.
    type Output;
    /// Does it.
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) -> Self::Output;
}

/// Runs a kernel, compiled for the widest registers that this processor has.
pub fn run<T: Real, K: Kernel<T>>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(with) = pulp::x86::V3::try_new() {
        struct Call<T, K>(pulp::x86::V3, K, std::marker::PhantomData<T>);
        impl<T: Real, K: Kernel<T>> pulp::WithSimd for Call<T, K> {
            type Output = K::Output;
            #[inline(always)]
            fn with_simd<S: pulp::Simd>(self, _: S) -> K::Output {
                self.1.run::<T::Lanes>(self.0)
            }
        }
        return pulp::Simd::vectorize(with, Call(with, kernel, std::marker::PhantomData));
    }
    kernel.run::<Plain<T>>(())
}

/// Runs a kernel on so many threads of the current pool, each with as many whole `unit`s of things as any other.
pub fn share<T: Real, K: Kernel<T, Output = ()> + Parts>(kernel: K, unit: usize, threads: usize) {
    parts::share(kernel, unit, threads, &run);
}

/// Eight numbers in an array: what lanes mean, and what they are where the processor has nothing better.
#[derive(Clone, Copy, Debug)]
pub struct Plain<T>([T; LANES]);

macro_rules! operators {
    ($($operator:ident $method:ident;)*) => {$(
        impl<T: Real> $operator for Plain<T> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(std::array::from_fn(|lane| self.0[lane].$method(other.0[lane])))
            }
        }
    )*};
}

operators! {
    Add add;
    Sub sub;
    Mul mul;
    Div div;
}

impl<T: Real> Neg for Plain<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(T::neg))
    }
}

impl<T: Real> Lanes for Plain<T> {
    type Scalar = T;
    type Proof = ();

    #[inline(always)]
    fn splat((): (), value: T) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn of((): (), values: [T; LANES]) -> Self {
        Self(values)
    }

    #[inline(always)]
    fn to_array(self) -> [T; LANES] {
        self.0
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(T::sqrt))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        let larger = |lane: usize| if self.0[lane] > other.0[lane] { self.0[lane] } else { other.0[lane] };
        Self(std::array::from_fn(larger))
    }

    #[inline(always)]
    fn where_positive(self, of: Self) -> Self {
        Self(std::array::from_fn(|lane| if of.0[lane] > T::ZERO { self.0[lane] } else { T::ZERO }))
    }

    #[inline(always)]
    fn only(self, lanes: u32) -> Self {
        Self(std::array::from_fn(|lane| if lanes >> lane & 1 == 1 { self.0[lane] } else { T::ZERO }))
    }

    #[inline(always)]
    fn vectors((): (), vectors: &[T::Vec3; LANES]) -> [Self; 3] {
        [0, 1, 2].map(|c| Self(vectors.map(|v| v.to_array()[c])))
    }

    #[inline(always)]
    fn put_vectors(components: [Self; 3], vectors: &mut [T::Vec3; LANES]) {
        for (lane, v) in vectors.iter_mut().enumerate() {
            *v = T::Vec3::from_array(components.map(|c| c.0[lane]));
        }
    }

    #[inline(always)]
    fn components((): (), vectors: &[T::Vec3], at: &[u32; LANES]) -> [Self; 3] {
        [0, 1, 2].map(|c| Self(at.map(|i| vectors[i as usize].to_array()[c])))
    }

    #[inline(always)]
    fn comb<const WAY: usize>((): (), numbers: &[T; 2 * LANES]) -> [Self; 2] {
        let teeth = T::TEETH[WAY - 1];
        [Self(teeth.map(|at| numbers[at])), Self(teeth.map(|at| numbers[at + WAY]))]
    }

    #[inline(always)]
    fn put_comb<const WAY: usize>([a, b]: [Self; 2], numbers: &mut [T; 2 * LANES]) {
        for (lane, at) in T::TEETH[WAY - 1].into_iter().enumerate() {
            (numbers[at], numbers[at + WAY]) = (a.0[lane], b.0[lane]);
        }
    }
}
