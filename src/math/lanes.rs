//! Eight numbers side by side, for kernels that work on eight springs at once where the processor has AVX2.
//!
//! Every operation is that of the scalar, correctly rounded, lane by lane: a kernel of lanes gives the bits of the plain
//! loop that it stands for. That rules out what processors round each in their own way or not twice where the loop does:
//! fused multiplication and addition, estimates of reciprocals and of reciprocal roots; and sums across lanes.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::Real;
use bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m256, __m256d, _CMP_GT_OQ};
use std::ops::{Add, Div, Mul, Sub};

/// How many numbers stand side by side.
pub const LANES: usize = 8;

/// The proof that this processor has the instructions.
pub type Instructions = V3;

/// Eight numbers.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// The number.
    type Scalar: Real;
    /// The same number eight times.
    fn splat(with: Instructions, value: Self::Scalar) -> Self;
    /// These numbers.
    fn of(with: Instructions, values: [Self::Scalar; LANES]) -> Self;
    /// The numbers.
    fn to_array(self) -> [Self::Scalar; LANES];
    /// Square roots.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Itself where `of` is above 0, else 0.
    #[must_use]
    fn where_positive(self, of: Self) -> Self;
    /// The x, the y and the z of the vectors at eight places.
    fn components(
        with: Instructions,
        vectors: &[<Self::Scalar as Real>::Vec3],
        at: &[u32; LANES],
    ) -> [Self; 3];

    /// The components of the quadruples at eight places.
    fn quads(with: Instructions, quads: &[[Self::Scalar; 4]], at: &[u32; LANES]) -> [Self; 4];
    /// Puts quadruples of these components to eight places.
    fn put_quads(components: [Self; 4], quads: &mut [[Self::Scalar; 4]], at: &[u32; LANES]);

    /// The first eight numbers of a slice.
    #[inline(always)]
    fn load(with: Instructions, from: &[Self::Scalar]) -> Self {
        let mut values = [Self::Scalar::ZERO; LANES];
        values.copy_from_slice(&from[..LANES]);
        Self::of(with, values)
    }
}

/// Eight `f32`: one register.
#[derive(Clone, Copy, Debug)]
pub struct Single(V3, __m256);

/// Eight `f64`: two registers.
#[derive(Clone, Copy, Debug)]
pub struct Double(V3, [__m256d; 2]);

macro_rules! operators {
    ($($operator:ident $method:ident $single:ident $double:ident;)*) => {$(
        impl $operator for Single {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0, self.0.avx.$single(self.1, other.1))
            }
        }
        impl $operator for Double {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let [a, b] = self.1;
                let [c, d] = other.1;
                Self(self.0, [self.0.avx.$double(a, c), self.0.avx.$double(b, d)])
            }
        }
    )*};
}

operators! {
    Add add _mm256_add_ps _mm256_add_pd;
    Sub sub _mm256_sub_ps _mm256_sub_pd;
    Mul mul _mm256_mul_ps _mm256_mul_pd;
    Div div _mm256_div_ps _mm256_div_pd;
}

impl Lanes for Single {
    type Scalar = f32;

    #[inline(always)]
    fn splat(with: V3, value: f32) -> Self {
        Self(with, with.avx._mm256_set1_ps(value))
    }

    #[inline(always)]
    fn of(with: V3, values: [f32; LANES]) -> Self {
        Self(with, cast(values))
    }

    #[inline(always)]
    fn to_array(self) -> [f32; LANES] {
        cast(self.1)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0, self.0.avx._mm256_sqrt_ps(self.1))
    }

    #[inline(always)]
    fn where_positive(self, of: Self) -> Self {
        let avx = self.0.avx;
        let positive = avx._mm256_cmp_ps::<_CMP_GT_OQ>(of.1, avx._mm256_setzero_ps());
        Self(self.0, avx._mm256_and_ps(self.1, positive))
    }

    #[inline(always)]
    fn components(with: V3, vectors: &[glam::Vec3], at: &[u32; LANES]) -> [Self; 3] {
        let avx = with.avx;
        let [a, b, c, d] = [
            pair(with, vectors, at[0], at[4]),
            pair(with, vectors, at[1], at[5]),
            pair(with, vectors, at[2], at[6]),
            pair(with, vectors, at[3], at[7]),
        ];
        let (xy, z) = (avx._mm256_unpacklo_ps(a, b), avx._mm256_unpackhi_ps(a, b));
        let (xy_next, z_next) = (avx._mm256_unpacklo_ps(c, d), avx._mm256_unpackhi_ps(c, d));
        [
            Self(with, avx._mm256_shuffle_ps::<0x44>(xy, xy_next)),
            Self(with, avx._mm256_shuffle_ps::<0xee>(xy, xy_next)),
            Self(with, avx._mm256_shuffle_ps::<0x44>(z, z_next)),
        ]
    }

    #[inline(always)]
    fn quads(with: V3, quads: &[[f32; 4]], at: &[u32; LANES]) -> [Self; 4] {
        let avx = with.avx;
        let [a, b, c, d] = [
            quad_pair(with, quads, at[0], at[4]),
            quad_pair(with, quads, at[1], at[5]),
            quad_pair(with, quads, at[2], at[6]),
            quad_pair(with, quads, at[3], at[7]),
        ];
        let (xy, zw) = (avx._mm256_unpacklo_ps(a, b), avx._mm256_unpackhi_ps(a, b));
        let (xy_next, zw_next) = (avx._mm256_unpacklo_ps(c, d), avx._mm256_unpackhi_ps(c, d));
        [
            Self(with, avx._mm256_shuffle_ps::<0x44>(xy, xy_next)),
            Self(with, avx._mm256_shuffle_ps::<0xee>(xy, xy_next)),
            Self(with, avx._mm256_shuffle_ps::<0x44>(zw, zw_next)),
            Self(with, avx._mm256_shuffle_ps::<0xee>(zw, zw_next)),
        ]
    }

    #[inline(always)]
    fn put_quads([x, y, z, w]: [Self; 4], quads: &mut [[f32; 4]], at: &[u32; LANES]) {
        let avx = x.0.avx;
        let (xy, xy_next) = (avx._mm256_unpacklo_ps(x.1, y.1), avx._mm256_unpackhi_ps(x.1, y.1));
        let (zw, zw_next) = (avx._mm256_unpacklo_ps(z.1, w.1), avx._mm256_unpackhi_ps(z.1, w.1));
        let pairs = [
            avx._mm256_shuffle_ps::<0x44>(xy, zw),
            avx._mm256_shuffle_ps::<0xee>(xy, zw),
            avx._mm256_shuffle_ps::<0x44>(xy_next, zw_next),
            avx._mm256_shuffle_ps::<0xee>(xy_next, zw_next),
        ];
        for (lane, pair) in pairs.into_iter().enumerate() {
            let [low, high]: [[f32; 4]; 2] = cast(pair);
            quads[at[lane] as usize] = low;
            quads[at[lane + 4] as usize] = high;
        }
    }
}

/// Two quadruples, each in one half.
#[inline(always)]
fn quad_pair(with: V3, quads: &[[f32; 4]], low: u32, high: u32) -> __m256 {
    let (low, high) = (cast(quads[low as usize]), cast(quads[high as usize]));
    with.avx._mm256_insertf128_ps::<1>(with.avx._mm256_castps128_ps256(low), high)
}

/// The components of four quadruples; and, the other way round, the quadruples of four components.
#[inline(always)]
fn turn(with: V3, [a, b, c, d]: [__m256d; 4]) -> [__m256d; 4] {
    let avx = with.avx;
    let (xz, yw) = (avx._mm256_unpacklo_pd(a, b), avx._mm256_unpackhi_pd(a, b));
    let (xz_next, yw_next) = (avx._mm256_unpacklo_pd(c, d), avx._mm256_unpackhi_pd(c, d));
    [
        avx._mm256_permute2f128_pd::<0x20>(xz, xz_next),
        avx._mm256_permute2f128_pd::<0x20>(yw, yw_next),
        avx._mm256_permute2f128_pd::<0x31>(xz, xz_next),
        avx._mm256_permute2f128_pd::<0x31>(yw, yw_next),
    ]
}

/// Two vectors, each in one half. A function, as what follows: a closure would not be compiled for these instructions.
#[inline(always)]
fn pair(with: V3, vectors: &[glam::Vec3], low: u32, high: u32) -> __m256 {
    let ([x, y, z], [u, v, w]) = (vectors[low as usize].to_array(), vectors[high as usize].to_array());
    let (low, high) = (with.sse._mm_set_ps(0.0, z, y, x), with.sse._mm_set_ps(0.0, w, v, u));
    with.avx._mm256_insertf128_ps::<1>(with.avx._mm256_castps128_ps256(low), high)
}

#[inline(always)]
fn vector(with: V3, vectors: &[glam::DVec3], at: u32) -> __m256d {
    let [x, y, z] = vectors[at as usize].to_array();
    with.avx._mm256_set_pd(0.0, z, y, x)
}

/// The components of four vectors.
#[inline(always)]
fn four(with: V3, vectors: &[glam::DVec3], [a, b, c, d]: [u32; 4]) -> [__m256d; 3] {
    let avx = with.avx;
    let (a, b) = (vector(with, vectors, a), vector(with, vectors, b));
    let (c, d) = (vector(with, vectors, c), vector(with, vectors, d));
    let (xz, y) = (avx._mm256_unpacklo_pd(a, b), avx._mm256_unpackhi_pd(a, b));
    let (xz_next, y_next) = (avx._mm256_unpacklo_pd(c, d), avx._mm256_unpackhi_pd(c, d));
    [
        avx._mm256_permute2f128_pd::<0x20>(xz, xz_next),
        avx._mm256_permute2f128_pd::<0x20>(y, y_next),
        avx._mm256_permute2f128_pd::<0x31>(xz, xz_next),
    ]
}

#[inline(always)]
fn positive_part(with: V3, value: __m256d, of: __m256d) -> __m256d {
    let avx = with.avx;
    avx._mm256_and_pd(value, avx._mm256_cmp_pd::<_CMP_GT_OQ>(of, avx._mm256_setzero_pd()))
}

impl Lanes for Double {
    type Scalar = f64;

    #[inline(always)]
    fn splat(with: V3, value: f64) -> Self {
        Self(with, [with.avx._mm256_set1_pd(value); 2])
    }

    #[inline(always)]
    fn of(with: V3, values: [f64; LANES]) -> Self {
        Self(with, cast(values))
    }

    #[inline(always)]
    fn to_array(self) -> [f64; LANES] {
        cast(self.1)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let [a, b] = self.1;
        Self(self.0, [self.0.avx._mm256_sqrt_pd(a), self.0.avx._mm256_sqrt_pd(b)])
    }

    #[inline(always)]
    fn where_positive(self, of: Self) -> Self {
        let ([a, b], [c, d]) = (self.1, of.1);
        Self(self.0, [positive_part(self.0, a, c), positive_part(self.0, b, d)])
    }

    #[inline(always)]
    fn components(with: V3, vectors: &[glam::DVec3], at: &[u32; LANES]) -> [Self; 3] {
        let [a, b, c, d, e, f, g, h] = *at;
        let ([x, y, z], [x_next, y_next, z_next]) =
            (four(with, vectors, [a, b, c, d]), four(with, vectors, [e, f, g, h]));
        [Self(with, [x, x_next]), Self(with, [y, y_next]), Self(with, [z, z_next])]
    }

    #[inline(always)]
    fn quads(with: V3, quads: &[[f64; 4]], at: &[u32; LANES]) -> [Self; 4] {
        let [a, b, c, d, e, f, g, h] = *at;
        let low = turn(with, [a, b, c, d].map(|at| cast(quads[at as usize])));
        let high = turn(with, [e, f, g, h].map(|at| cast(quads[at as usize])));
        let [x, y, z, w] = low;
        let [x_next, y_next, z_next, w_next] = high;
        [Self(with, [x, x_next]), Self(with, [y, y_next]), Self(with, [z, z_next]), Self(with, [w, w_next])]
    }

    #[inline(always)]
    fn put_quads(components: [Self; 4], quads: &mut [[f64; 4]], at: &[u32; LANES]) {
        let [x, y, z, w] = components;
        for half in 0..2 {
            let turned = turn(x.0, [x.1[half], y.1[half], z.1[half], w.1[half]]);
            for (lane, quad) in turned.into_iter().enumerate() {
                quads[at[4 * half + lane] as usize] = cast(quad);
            }
        }
    }
}
