//! Symmetric 3x3 blocks: the stiffness of a spring, and the equations of one particle.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use crate::math::lanes::Lanes;
use crate::math::{Real, Vector};

/// A symmetric 3x3 matrix.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Block<T> {
    diagonal: [T; 3],
    /// xy, xz, yz.
    off: [T; 3],
}

impl<T: Real> Block<T> {
    /// s times the identity.
    pub fn scaled_identity(s: T) -> Self {
        Self { diagonal: [s; 3], off: [T::ZERO; 3] }
    }

    /// The stiffness of a spring of direction d (|d| = length) and rest length L: k n nᵀ + k max(0, 1 - L/|d|) (I - n nᵀ). A
    /// compressed spring pushes its ends sideways; leaving that out keeps the block positive semidefinite (Choi and Ko, "Stable
    /// but responsive cloth", 2002). Without a direction there is no force, and no stiffness unless L is 0.
    pub fn of_spring(d: T::Vec3, rest: T, k: T) -> Self {
        let length = d.length();
        if rest <= T::ZERO {
            return Self::scaled_identity(k);
        }
        if length <= T::ZERO {
            return Self::default();
        }
        let n = d * (T::ONE / length);
        let across = if length > rest { k * ((length - rest) / length) } else { T::ZERO };
        let [x, y, z] = n.to_array();
        let along = k - across;
        Self {
            diagonal: [x * x * along + across, y * y * along + across, z * z * along + across],
            off: [x * y * along, x * z * along, y * z * along],
        }
    }

    /// Times a factor, plus a multiple of the identity.
    pub fn scaled(self, factor: T, identity: T) -> Self {
        Self { diagonal: self.diagonal.map(|c| c * factor + identity), off: self.off.map(|c| c * factor) }
    }

    /// Adds another.
    pub fn add(&mut self, other: &Self) {
        for (own, more) in self.diagonal.iter_mut().zip(other.diagonal) {
            *own += more;
        }
        for (own, more) in self.off.iter_mut().zip(other.off) {
            *own += more;
        }
    }

    /// The product with a vector.
    #[inline]
    pub fn times(&self, v: T::Vec3) -> T::Vec3 {
        let [x, y, z] = v.to_array();
        let [xx, yy, zz] = self.diagonal;
        let [xy, xz, yz] = self.off;
        T::Vec3::from_array([xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z])
    }

    /// The inverse of a positive semidefinite block by L D Lᵀ. Pivots that rounding has eaten are lifted to its size, so
    /// that the answer is positive definite and finite whatever was put in, as long as that was finite.
    pub fn inverse(&self) -> Self {
        let [xx, yy, zz] = self.diagonal;
        let size = xx + yy + zz;
        if size <= T::ZERO {
            return Self::default();
        }
        let scale = T::ONE / size;
        let lifted = |pivot: T| if pivot > T::EPSILON { pivot } else { T::EPSILON };
        let [a, b, c] = [xx * scale, yy * scale, zz * scale];
        let [ab, ac, bc] = self.off.map(|o| o * scale);
        let d1 = lifted(a);
        let (l21, l31) = (ab / d1, ac / d1);
        let d2 = lifted(b - l21 * ab);
        let l32 = (bc - l31 * ab) / d2;
        let d3 = lifted(c - l31 * ac - l32 * l32 * d2);
        // The inverse of L is lower triangular too: -l21, -l32 and m31.
        let m31 = l21 * l32 - l31;
        let [i1, i2, i3] = [d1, d2, d3].map(|d| scale / d);
        Self {
            diagonal: [i1 + l21 * l21 * i2 + m31 * m31 * i3, i2 + l32 * l32 * i3, i3],
            off: [-(l21 * i2) - m31 * l32 * i3, m31 * i3, -(l32 * i3)],
        }
    }
}

/// Products of eight blocks, given as xx, yy, zz and xy, xz, yz, with vectors.
#[inline(always)]
pub(super) fn times<L: Lanes>([xx, yy, zz]: [L; 3], [xy, xz, yz]: [L; 3], [x, y, z]: [L; 3]) -> [L; 3] {
    [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z]
}

/// The inverses of eight positive semidefinite blocks, given as xx, yy, zz and xy, xz, yz, by L D Lᵀ. Pivots that rounding has
/// eaten are lifted to its size, so that the answer is positive definite and finite whatever was put in, as long as that was
/// finite; of a block of trace 0 it is 0.
#[inline(always)]
pub(super) fn inverse<T: Real, L: Lanes<Scalar = T>>(
    with: L::Proof,
    [xx, yy, zz]: [L; 3],
    off: [L; 3],
) -> ([L; 3], [L; 3]) {
    let (one, least) = (L::splat(with, T::ONE), L::splat(with, T::EPSILON));
    let size = xx + yy + zz;
    let scale = (one / size).where_positive(size);
    let [a, b, c] = [xx * scale, yy * scale, zz * scale];
    let [ab, ac, bc] = [off[0] * scale, off[1] * scale, off[2] * scale];
    let d1 = a.max(least);
    let (l21, l31) = (ab / d1, ac / d1);
    let d2 = (b - l21 * ab).max(least);
    let l32 = (bc - l31 * ab) / d2;
    let d3 = (c - l31 * ac - l32 * l32 * d2).max(least);
    // The inverse of L is lower triangular too: -l21, -l32 and m31.
    let m31 = l21 * l32 - l31;
    let [i1, i2, i3] = [scale / d1, scale / d2, scale / d3];
    (
        [i1 + l21 * l21 * i2 + m31 * m31 * i3, i2 + l32 * l32 * i3, i3],
        [-(l21 * i2) - m31 * l32 * i3, m31 * i3, -(l32 * i3)],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn the_inverse_undoes_the_product() {
        let mut block = Block::<f64>::of_spring(DVec3::new(1.0, 2.0, -0.5), 1.0, 300.0);
        block.add(&Block::of_spring(DVec3::new(-1.0, 0.1, 0.7), 3.0, 50.0));
        block.add(&Block::scaled_identity(0.5));
        let v = DVec3::new(0.3, -1.0, 2.0);
        assert!(block.inverse().times(block.times(v)).distance(v) < 1e-12);
    }

    #[test]
    fn a_block_that_rounding_made_singular_has_a_finite_inverse() {
        let block = Block::<f32>::of_spring(glam::Vec3::new(1.0, 1.0, 1.0), 1.0e9, 1e12).scaled(1.0, 1e-3);
        let answer = block.inverse().times(glam::Vec3::new(1.0, -2.0, 3.0));
        assert!(answer.is_finite());
    }

    #[test]
    fn eight_side_by_side_are_what_each_is_alone() {
        use crate::math::lanes::{LANES, Plain};
        let block = |lane: usize| {
            let d = DVec3::new(lane as f64 - 3.0, 0.3, 1.0);
            let mut block = Block::<f64>::of_spring(d, 0.5, 300.0);
            block.add(&Block::scaled_identity(if lane == 4 { -300.0 } else { 0.5 }));
            block
        };
        let lanes = |number: &dyn Fn(Block<f64>) -> f64| {
            Plain::of((), std::array::from_fn::<_, LANES, _>(|lane| number(block(lane))))
        };
        let diagonal = [0, 1, 2].map(|c| lanes(&|block| block.diagonal[c]));
        let off = [0, 1, 2].map(|c| lanes(&|block| block.off[c]));
        let (inverse, inverse_off) = inverse::<f64, Plain<f64>>((), diagonal, off);
        let product = times(diagonal, off, inverse);
        for lane in 0..LANES {
            let alone = block(lane).inverse();
            assert_eq!(inverse.map(|number| number.to_array()[lane]), alone.diagonal);
            assert_eq!(inverse_off.map(|number| number.to_array()[lane]), alone.off);
            let vector = block(lane).times(DVec3::from_array(alone.diagonal));
            assert_eq!(product.map(|number| number.to_array()[lane]), vector.to_array());
        }
    }
}
