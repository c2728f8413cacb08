//! Symmetric 3x3 blocks, eight side by side: what the equations of one particle are made of. A block is given as xx, yy, zz and
//! xy, xz, yz.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use crate::math::Real;
use crate::math::lanes::Lanes;

/// Products with vectors.
#[inline(always)]
pub(super) fn times<L: Lanes>([xx, yy, zz]: [L; 3], [xy, xz, yz]: [L; 3], [x, y, z]: [L; 3]) -> [L; 3] {
    [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z]
}

/// The inverses of positive semidefinite blocks by L D Lᵀ. Pivots that rounding has eaten are lifted to its size, so that the
/// answer is positive definite and finite whatever was put in, as long as that was finite; of a block of trace 0 it is 0.
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
    use crate::forces::springs::resistance;
    use crate::math::lanes::{LANES, Plain};
    use glam::DVec3;

    type Eight<T> = [Plain<T>; 3];

    fn splat<T: Real>(v: [T; 3]) -> Eight<T> {
        v.map(|number| Plain::splat((), number))
    }

    /// The sum of springs of these ways, rest lengths and stiffnesses, and a multiple of the identity, in every lane.
    fn sum<T: Real>(springs: &[([T; 3], T, T)], identity: T) -> (Eight<T>, Eight<T>) {
        let (mut diagonal, mut off) = (splat([identity; 3]), splat([T::ZERO; 3]));
        for &(way, rest, stiffness) in springs {
            let [stiffness, rest] = [stiffness, rest].map(|number| Plain::splat((), number));
            let [a, x, y, z] = resistance((), [splat([T::ZERO; 3]), splat(way)], stiffness, rest);
            let (more, more_off) = ([a + x * x, a + y * y, a + z * z], [x * y, x * z, y * z]);
            diagonal = [0, 1, 2].map(|c| diagonal[c] + more[c]);
            off = [0, 1, 2].map(|c| off[c] + more_off[c]);
        }
        (diagonal, off)
    }

    #[test]
    fn the_inverse_undoes_the_product() {
        let springs = [([1.0, 2.0, -0.5], 1.0, 300.0), ([-1.0, 0.1, 0.7], 3.0, 50.0)];
        let (diagonal, off) = sum::<f64>(&springs, 0.5);
        let v = DVec3::new(0.3, -1.0, 2.0);
        let product = times(diagonal, off, splat(v.to_array()));
        let (inverse, inverse_off) = inverse((), diagonal, off);
        for lane in 0..LANES {
            let back = times(inverse, inverse_off, product).map(|number| number.to_array()[lane]);
            assert!(DVec3::from_array(back).distance(v) < 1e-12);
        }
    }

    #[test]
    fn a_block_that_rounding_made_singular_has_a_finite_inverse() {
        let (diagonal, off) = sum::<f32>(&[([1.0; 3], 1.0e9, 1e12)], 1e-3);
        let (inverse, inverse_off) = inverse((), diagonal, off);
        let answer = times(inverse, inverse_off, splat([1.0, -2.0, 3.0]));
        assert!(answer.iter().all(|number| number.to_array().iter().all(|n| n.is_finite())));
        let nothing = splat([0.0_f32; 3]);
        let (inverse, _) = super::inverse((), nothing, nothing);
        assert!(inverse.iter().all(|number| number.to_array() == [0.0; LANES]), "of trace 0");
    }
}
