//! Eight springs of a sweep at once.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::{Compliance, Part, Turn};
use crate::math::Real;
use crate::math::lanes::{Kernel, LANES, Lanes};

/// Puts every spring of a part to its rest length.
pub(super) struct Relax<'a, T: Real> {
    pub part: &'a Part<T>,
    pub places: &'a mut [[T; 4]],
}

impl<T: Real> Kernel<T> for Relax<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let Self { part, places } = self;
        for ([i, j], rest) in part.pairs.iter().zip(&part.rest) {
            let [ax, ay, az, aw] = L::quads(with, places, i);
            let [bx, by, bz, bw] = L::quads(with, places, j);
            let [dx, dy, dz] = [bx - ax, by - ay, bz - az];
            let length = (dx * dx + dy * dy + dz * dz).sqrt();
            let w = aw + bw;
            let factor = (length - L::of(with, *rest)) / (length * w);
            // Where the ends are at one place or neither moves it is 0/0.
            let factor = factor.where_positive(length).where_positive(w);
            let [cx, cy, cz] = [dx * factor, dy * factor, dz * factor];
            L::put_quads([ax + cx * aw, ay + cy * aw, az + cz * aw, aw], places, i);
            L::put_quads([bx - cx * bw, by - cy * bw, bz - cz * bw, bw], places, j);
        }
    }
}

/// Lets every spring of a part exert what its compliance and its damping still want.
pub(super) struct Comply<'a, T: Real> {
    pub part: &'a mut Part<T>,
    pub places: &'a mut [[T; 4]],
    pub starts: &'a [[T; 4]],
    pub compliance: Compliance<T>,
    pub turn: Turn,
}

impl<T: Real> Kernel<T> for Comply<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let (along, all) = (self.compliance.along > T::ZERO, self.compliance.all > T::ZERO);
        match (along, all) {
            (false, false) => self.go::<L, false, false>(with),
            (true, false) => self.go::<L, true, false>(with),
            (false, true) => self.go::<L, false, true>(with),
            (true, true) => self.go::<L, true, true>(with),
        }
    }
}

impl<T: Real> Comply<'_, T> {
    #[inline(always)]
    fn go<L: Lanes<Scalar = T>, const ALONG: bool, const ALL: bool>(self, with: L::Proof) {
        let Self { part, places, starts, compliance, turn } = self;
        let Part { pairs, rest, stiffness, tension, friction } = part;
        let square = L::splat(with, compliance.square);
        let along = L::splat(with, compliance.along);
        let all = L::splat(with, compliance.all);
        let (one, zero) = (L::splat(with, T::ONE), L::splat(with, T::ZERO));
        let springs = pairs.iter().zip(rest).zip(stiffness).zip(tension).enumerate();
        for (eight, ((([i, j], rest), stiffness), tension)) in springs {
            let [ax, ay, az, aw] = L::quads(with, places, i);
            let [bx, by, bz, bw] = L::quads(with, places, j);
            let w = aw + bw;
            let [dx, dy, dz] = [bx - ax, by - ay, bz - az];
            let was = if ALONG || ALL {
                let [ax, ay, az, _] = L::quads(with, starts, i);
                let [bx, by, bz, _] = L::quads(with, starts, j);
                [bx - ax, by - ay, bz - az]
            } else {
                [zero; 3]
            };
            let length = (dx * dx + dy * dy + dz * dz).sqrt();
            let inverse = (one / length).where_positive(length);
            let [nx, ny, nz] = [dx * inverse, dy * inverse, dz * inverse];
            let k = square * L::of(with, *stiffness);
            let exerted = if turn.is_first { zero } else { L::of(with, *tension) };
            let mut wanted = zero - k * (length - L::of(with, *rest)) - exerted;
            if ALONG {
                let [ux, uy, uz] = [dx - was[0], dy - was[1], dz - was[2]];
                wanted = wanted - along * (nx * ux + ny * uy + nz * uz);
            }
            let stiff = if ALONG { k + along } else { k };
            let change = (wanted / (stiff * w + one)).where_positive(length).where_positive(w);
            if !turn.is_last {
                *tension = (exerted + change).to_array();
            }
            let [mut px, mut py, mut pz] = [nx * change, ny * change, nz * change];
            if ALL {
                let part = one / (all * w + one);
                let [x, y, z] = &mut friction[eight];
                px = px + brake::<T, L>(with, dx + px * w - was[0], [all, part, w], x, turn);
                py = py + brake::<T, L>(with, dy + py * w - was[1], [all, part, w], y, turn);
                pz = pz + brake::<T, L>(with, dz + pz * w - was[2], [all, part, w], z, turn);
            }
            L::put_quads([ax - px * aw, ay - py * aw, az - pz * aw, aw], places, i);
            L::put_quads([bx + px * bw, by + py * bw, bz + pz * bw, bw], places, j);
        }
    }
}

/// The impulse of damping along one component of a way, which is added to what it was before.
#[inline(always)]
fn brake<T: Real, L: Lanes<Scalar = T>>(
    with: L::Proof,
    way: L,
    [all, part, w]: [L; 3],
    friction: &mut [T; LANES],
    turn: Turn,
) -> L {
    let before = if turn.is_first { L::splat(with, T::ZERO) } else { L::of(with, *friction) };
    let wanted = L::splat(with, T::ZERO) - way * all - before;
    let change = (wanted * part).where_positive(w);
    if !turn.is_last {
        *friction = (before + change).to_array();
    }
    change
}
