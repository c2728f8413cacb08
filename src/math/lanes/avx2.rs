//! Eight numbers side by side in the registers of AVX2.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::{LANES, Lanes};
use bytemuck::{cast, cast_mut, cast_ref};
use pulp::x86::V3;
use std::arch::x86_64::{__m256, __m256d, __m256i, _CMP_GT_OQ};
use std::ops::{Add, Div, Mul, Neg, Sub};

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

impl Neg for Single {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::splat(self.0, -0.0) - self
    }
}

impl Neg for Double {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::splat(self.0, -0.0) - self
    }
}

impl Lanes for Single {
    type Scalar = f32;
    type Proof = V3;

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
    fn max(self, other: Self) -> Self {
        Self(self.0, self.0.avx._mm256_max_ps(self.1, other.1))
    }

    #[inline(always)]
    fn where_positive(self, of: Self) -> Self {
        let avx = self.0.avx;
        let positive = avx._mm256_cmp_ps::<_CMP_GT_OQ>(of.1, avx._mm256_setzero_ps());
        Self(self.0, avx._mm256_and_ps(self.1, positive))
    }

    #[inline(always)]
    fn only(self, lanes: u32) -> Self {
        let (with, avx2) = (self.0, self.0.avx2);
        let bits: __m256i = cast([1_u32, 2, 4, 8, 16, 32, 64, 128]);
        let set = avx2._mm256_and_si256(with.avx._mm256_set1_epi32(lanes.cast_signed()), bits);
        Self(with, with.avx._mm256_and_ps(self.1, cast(avx2._mm256_cmpeq_epi32(set, bits))))
    }

    #[inline(always)]
    fn vectors(with: V3, vectors: &[glam::Vec3; LANES]) -> [Self; 3] {
        let avx = with.avx;
        // Four numbers at a time: x0 y0 z0 x1, y1 z1 x2 y2, z2 x3 y3 z3, and so on.
        let numbers: &[[f32; 4]; 6] = cast_ref(vectors);
        let a = quad_pair(with, numbers, 0, 3);
        let b = quad_pair(with, numbers, 1, 4);
        let c = quad_pair(with, numbers, 2, 5);
        let xy = avx._mm256_shuffle_ps::<0b10_01_11_10>(b, c);
        let yz = avx._mm256_shuffle_ps::<0b01_00_10_01>(a, b);
        [
            Self(with, avx._mm256_shuffle_ps::<0b10_00_11_00>(a, xy)),
            Self(with, avx._mm256_shuffle_ps::<0b11_01_10_00>(yz, xy)),
            Self(with, avx._mm256_shuffle_ps::<0b11_00_11_01>(yz, c)),
        ]
    }

    #[inline(always)]
    fn put_vectors([x, y, z]: [Self; 3], vectors: &mut [glam::Vec3; LANES]) {
        let avx = x.0.avx;
        let xy = avx._mm256_shuffle_ps::<0b10_00_10_00>(x.1, y.1);
        let yz = avx._mm256_shuffle_ps::<0b11_01_11_01>(y.1, z.1);
        let zx = avx._mm256_shuffle_ps::<0b11_01_10_00>(z.1, x.1);
        let thirds = [
            avx._mm256_shuffle_ps::<0b10_00_10_00>(xy, zx),
            avx._mm256_shuffle_ps::<0b11_01_10_00>(yz, xy),
            avx._mm256_shuffle_ps::<0b11_01_11_01>(zx, yz),
        ];
        let numbers: &mut [[f32; 4]; 6] = cast_mut(vectors);
        for (i, third) in thirds.into_iter().enumerate() {
            [numbers[i], numbers[i + 3]] = cast(third);
        }
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
    fn comb<const WAY: usize>(with: V3, numbers: &[f32; 2 * LANES]) -> [Self; 2] {
        let avx = with.avx;
        let [low, high]: [__m256; 2] = cast(*numbers);
        if WAY == 1 {
            let [one, other] =
                [avx._mm256_shuffle_ps::<0x88>(low, high), avx._mm256_shuffle_ps::<0xdd>(low, high)];
            [Self(with, one), Self(with, other)]
        } else {
            let [one, other] =
                [avx._mm256_shuffle_ps::<0x44>(low, high), avx._mm256_shuffle_ps::<0xee>(low, high)];
            [Self(with, one), Self(with, other)]
        }
    }

    #[inline(always)]
    fn put_comb<const WAY: usize>([a, b]: [Self; 2], numbers: &mut [f32; 2 * LANES]) {
        let avx = a.0.avx;
        let halves = if WAY == 1 {
            [avx._mm256_unpacklo_ps(a.1, b.1), avx._mm256_unpackhi_ps(a.1, b.1)]
        } else {
            [avx._mm256_shuffle_ps::<0x44>(a.1, b.1), avx._mm256_shuffle_ps::<0xee>(a.1, b.1)]
        };
        *numbers = cast(halves);
    }
}

/// Two of these quadruples, each in one half.
#[inline(always)]
fn quad_pair(with: V3, quads: &[[f32; 4]; 6], low: usize, high: usize) -> __m256 {
    let (low, high) = (cast(quads[low]), cast(quads[high]));
    with.avx._mm256_insertf128_ps::<1>(with.avx._mm256_castps128_ps256(low), high)
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

/// The components of four vectors that stand in a row: x0 y0 z0 x1, y1 z1 x2 y2, z2 x3 y3 z3.
#[inline(always)]
fn four_in_a_row(with: V3, numbers: &[[f64; 4]; 3]) -> [__m256d; 3] {
    let avx = with.avx;
    let [a, b, c] = numbers.map(cast::<_, __m256d>);
    let p = avx._mm256_blend_pd::<0b1100>(a, b);
    let q = avx._mm256_permute2f128_pd::<0x21>(a, c);
    let r = avx._mm256_blend_pd::<0b1100>(b, c);
    [
        avx._mm256_shuffle_pd::<0b1010>(p, q),
        avx._mm256_shuffle_pd::<0b0101>(p, r),
        avx._mm256_shuffle_pd::<0b1010>(q, r),
    ]
}

/// The other way round.
#[inline(always)]
fn put_four_in_a_row(with: V3, [x, y, z]: [__m256d; 3]) -> [[f64; 4]; 3] {
    let avx = with.avx;
    let p = avx._mm256_shuffle_pd::<0b0000>(x, y);
    let q = avx._mm256_shuffle_pd::<0b1010>(z, x);
    let r = avx._mm256_shuffle_pd::<0b1111>(y, z);
    [
        cast(avx._mm256_permute2f128_pd::<0x20>(p, q)),
        cast(avx._mm256_blend_pd::<0b1100>(r, p)),
        cast(avx._mm256_permute2f128_pd::<0x31>(q, r)),
    ]
}

#[inline(always)]
fn only_four(with: V3, values: __m256d, lanes: u32) -> __m256d {
    let bits: __m256i = cast([1_u64, 2, 4, 8]);
    let set = with.avx2._mm256_and_si256(with.avx._mm256_set1_epi64x(i64::from(lanes)), bits);
    with.avx._mm256_and_pd(values, cast(with.avx2._mm256_cmpeq_epi64(set, bits)))
}

#[inline(always)]
fn positive_part(with: V3, value: __m256d, of: __m256d) -> __m256d {
    let avx = with.avx;
    avx._mm256_and_pd(value, avx._mm256_cmp_pd::<_CMP_GT_OQ>(of, avx._mm256_setzero_pd()))
}

impl Lanes for Double {
    type Scalar = f64;
    type Proof = V3;

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
    fn max(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.1, other.1);
        Self(self.0, [self.0.avx._mm256_max_pd(a, c), self.0.avx._mm256_max_pd(b, d)])
    }

    #[inline(always)]
    fn where_positive(self, of: Self) -> Self {
        let ([a, b], [c, d]) = (self.1, of.1);
        Self(self.0, [positive_part(self.0, a, c), positive_part(self.0, b, d)])
    }

    #[inline(always)]
    fn only(self, lanes: u32) -> Self {
        let [low, high] = self.1;
        Self(self.0, [only_four(self.0, low, lanes), only_four(self.0, high, lanes >> 4)])
    }

    #[inline(always)]
    fn vectors(with: V3, vectors: &[glam::DVec3; LANES]) -> [Self; 3] {
        let numbers: &[[[f64; 4]; 3]; 2] = cast_ref(vectors);
        let ([x, y, z], [x_next, y_next, z_next]) =
            (four_in_a_row(with, &numbers[0]), four_in_a_row(with, &numbers[1]));
        [Self(with, [x, x_next]), Self(with, [y, y_next]), Self(with, [z, z_next])]
    }

    #[inline(always)]
    fn put_vectors([x, y, z]: [Self; 3], vectors: &mut [glam::DVec3; LANES]) {
        let numbers: &mut [[[f64; 4]; 3]; 2] = cast_mut(vectors);
        for (half, to) in numbers.iter_mut().enumerate() {
            *to = put_four_in_a_row(x.0, [x.1[half], y.1[half], z.1[half]]);
        }
    }

    #[inline(always)]
    fn components(with: V3, vectors: &[glam::DVec3], at: &[u32; LANES]) -> [Self; 3] {
        let [a, b, c, d, e, f, g, h] = *at;
        let ([x, y, z], [x_next, y_next, z_next]) =
            (four(with, vectors, [a, b, c, d]), four(with, vectors, [e, f, g, h]));
        [Self(with, [x, x_next]), Self(with, [y, y_next]), Self(with, [z, z_next])]
    }

    #[inline(always)]
    fn comb<const WAY: usize>(with: V3, numbers: &[f64; 2 * LANES]) -> [Self; 2] {
        let avx = with.avx;
        let [a, b, c, d]: [__m256d; 4] = cast(*numbers);
        if WAY == 1 {
            let one = [avx._mm256_unpacklo_pd(a, c), avx._mm256_unpacklo_pd(b, d)];
            [Self(with, one), Self(with, [avx._mm256_unpackhi_pd(a, c), avx._mm256_unpackhi_pd(b, d)])]
        } else {
            let one = [avx._mm256_permute2f128_pd::<0x20>(a, b), avx._mm256_permute2f128_pd::<0x20>(c, d)];
            let other = [avx._mm256_permute2f128_pd::<0x31>(a, b), avx._mm256_permute2f128_pd::<0x31>(c, d)];
            [Self(with, one), Self(with, other)]
        }
    }

    #[inline(always)]
    fn put_comb<const WAY: usize>([one, other]: [Self; 2], numbers: &mut [f64; 2 * LANES]) {
        let avx = one.0.avx;
        let ([a, b], [c, d]) = (one.1, other.1);
        *numbers = cast(if WAY == 1 {
            [
                avx._mm256_unpacklo_pd(a, c),
                avx._mm256_unpacklo_pd(b, d),
                avx._mm256_unpackhi_pd(a, c),
                avx._mm256_unpackhi_pd(b, d),
            ]
        } else {
            [
                avx._mm256_permute2f128_pd::<0x20>(a, c),
                avx._mm256_permute2f128_pd::<0x31>(a, c),
                avx._mm256_permute2f128_pd::<0x20>(b, d),
                avx._mm256_permute2f128_pd::<0x31>(b, d),
            ]
        });
    }
}
