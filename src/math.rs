//! The scalar of a simulation, `f32` or `f64`, and its three-vector: the only place that knows both precisions.

pub mod lanes;
pub mod parts;
pub mod random;
pub mod rows;

use glam::{DVec3, Vec3};
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A scalar in which a whole simulation is computed.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Send
    + Sync
    + serde::Serialize
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + 'static
{
    /// Three of these, from glam.
    type Vec3: Vector<Scalar = Self>;
    /// Eight of these side by side in this architecture's registers.
    #[cfg(target_arch = "x86_64")]
    type Lanes: lanes::Lanes<Scalar = Self, Proof = pulp::x86::V3>;
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Distance from 1 to the next number.
    const EPSILON: Self;
    /// Where, among sixteen numbers, the first eight of a [`comb`](lanes::Lanes::comb) of way 1 and of way 2 stand, lane by lane: in
    /// the order in which registers are filled with them soonest.
    const TEETH: [[usize; lanes::LANES]; 2];
    /// Square root, correctly rounded: the same bits on every machine.
    #[must_use]
    fn sqrt(self) -> Self;
    /// The nearest value of this precision.
    fn from_f64(value: f64) -> Self;
    /// The same value in double precision.
    fn to_f64(self) -> f64;
}

/// A vector of three scalars.
pub trait Vector:
    Copy
    + Debug
    + Default
    + PartialEq
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + Mul<Self::Scalar, Output = Self>
    + 'static
{
    /// The type of a component.
    type Scalar: Real<Vec3 = Self>;
    /// (0, 0, 0).
    const ZERO: Self;
    /// Euclidean length, correctly rounded square root: the same bits on every machine.
    fn length(self) -> Self::Scalar;
    /// Scalar product.
    fn dot(self, other: Self) -> Self::Scalar;
    /// The vector of three components.
    fn from_array(components: [Self::Scalar; 3]) -> Self;
    /// The components.
    fn to_array(self) -> [Self::Scalar; 3];
    /// The nearest vector of this precision.
    fn from_f64(value: DVec3) -> Self;
    /// The same vector in double precision.
    fn to_f64(self) -> DVec3;
    /// The components of vectors, one behind the other.
    fn flat(vectors: &[Self]) -> &[Self::Scalar];
    /// The same, to be written.
    fn flat_mut(vectors: &mut [Self]) -> &mut [Self::Scalar];
}

macro_rules! precision {
    ($real:ty, $vec:ty, $lanes:ident, $teeth:expr, $to_double:expr, $from_double:expr) => {
        impl Real for $real {
            type Vec3 = $vec;
            #[cfg(target_arch = "x86_64")]
            type Lanes = lanes::avx2::$lanes;
            const TEETH: [[usize; lanes::LANES]; 2] = $teeth;
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const EPSILON: Self = <$real>::EPSILON;
            #[inline]
            fn sqrt(self) -> Self {
                <$real>::sqrt(self)
            }
            #[inline]
            fn from_f64(value: f64) -> Self {
                value as $real
            }
            #[inline]
            fn to_f64(self) -> f64 {
                self as f64
            }
        }

        impl Vector for $vec {
            type Scalar = $real;
            const ZERO: Self = <$vec>::ZERO;
            #[inline]
            fn length(self) -> $real {
                <$vec>::dot(self, self).sqrt()
            }
            #[inline]
            fn dot(self, other: Self) -> $real {
                <$vec>::dot(self, other)
            }
            #[inline]
            fn from_array(components: [$real; 3]) -> Self {
                <$vec>::from_array(components)
            }
            #[inline]
            fn to_array(self) -> [$real; 3] {
                <$vec>::to_array(&self)
            }
            #[inline]
            fn from_f64(value: DVec3) -> Self {
                $from_double(value)
            }
            #[inline]
            fn to_f64(self) -> DVec3 {
                $to_double(self)
            }
            #[inline]
            fn flat(vectors: &[Self]) -> &[$real] {
                bytemuck::cast_slice(vectors)
            }
            #[inline]
            fn flat_mut(vectors: &mut [Self]) -> &mut [$real] {
                bytemuck::cast_slice_mut(vectors)
            }
        }
    };
}

precision!(
    f32,
    Vec3,
    Single,
    [[0, 2, 8, 10, 4, 6, 12, 14], [0, 1, 8, 9, 4, 5, 12, 13]],
    |v: Vec3| v.as_dvec3(),
    |v: DVec3| v.as_vec3()
);
precision!(
    f64,
    DVec3,
    Double,
    [[0, 8, 2, 10, 4, 12, 6, 14], [0, 1, 4, 5, 8, 9, 12, 13]],
    |v: DVec3| v,
    |v: DVec3| v
);
