//! Eight springs of a sweep at once, bit for bit as the plain loops do them one by one.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::{Compliance, EIGHT, Sweep};
use crate::math::Real;
use crate::math::lanes::{Instructions, Lanes};
use pulp::{Simd, WithSimd};

impl<T: Real> Sweep<T> {
    /// [`relax`](Self::relax) for the springs that stand in eights; answers with their number, 0 where the processor cannot.
    pub(super) fn relax_wide(&mut self) -> usize {
        let Some(with) = Instructions::try_new() else { return 0 };
        Simd::vectorize(with, Relax { with, sweep: self });
        self.wide
    }

    /// [`comply`](Self::comply) for the springs that stand in eights; answers with their number, 0 where the processor cannot.
    pub(super) fn comply_wide(&mut self, compliance: &Compliance<T>) -> usize {
        let Some(with) = Instructions::try_new() else { return 0 };
        Simd::vectorize(with, Comply { with, sweep: self, compliance: *compliance });
        self.wide
    }
}

/// The ends of eight springs.
#[inline(always)]
fn ends(pairs: &[[u32; 2]]) -> [[u32; EIGHT]; 2] {
    [std::array::from_fn(|lane| pairs[lane][0]), std::array::from_fn(|lane| pairs[lane][1])]
}

struct Relax<'a, T: Real> {
    with: Instructions,
    sweep: &'a mut Sweep<T>,
}

impl<T: Real> WithSimd for Relax<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { with, sweep } = self;
        let Sweep { pairs, rest, wide, places, .. } = sweep;
        for (pairs, rest) in pairs[..*wide].chunks_exact(EIGHT).zip(rest.chunks_exact(EIGHT)) {
            let [i, j] = ends(pairs);
            let [ax, ay, az, aw] = T::Lanes::quads(with, places, &i);
            let [bx, by, bz, bw] = T::Lanes::quads(with, places, &j);
            let [dx, dy, dz] = [bx - ax, by - ay, bz - az];
            let length = (dx * dx + dy * dy + dz * dz).sqrt();
            let w = aw + bw;
            let factor = (length - T::Lanes::load(with, rest)) / length;
            let factor = factor.where_positive(length);
            // Where neither end moves the shares are 0/0.
            let (first, second) = ((aw / w).where_positive(w), (bw / w).where_positive(w));
            let [cx, cy, cz] = [dx * factor, dy * factor, dz * factor];
            T::Lanes::put_quads([ax + cx * first, ay + cy * first, az + cz * first, aw], places, &i);
            T::Lanes::put_quads([bx - cx * second, by - cy * second, bz - cz * second, bw], places, &j);
        }
    }
}

struct Comply<'a, T: Real> {
    with: Instructions,
    sweep: &'a mut Sweep<T>,
    compliance: Compliance<T>,
}

impl<T: Real> WithSimd for Comply<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (along, all) = (self.compliance.along > T::ZERO, self.compliance.all > T::ZERO);
        match (along, all) {
            (false, false) => self.run::<false, false>(),
            (true, false) => self.run::<true, false>(),
            (false, true) => self.run::<false, true>(),
            (true, true) => self.run::<true, true>(),
        }
    }
}

impl<T: Real> Comply<'_, T> {
    #[inline(always)]
    fn run<const ALONG: bool, const ALL: bool>(self) {
        let Self { with, sweep, compliance } = self;
        let Sweep { pairs, rest, stiffness, wide, places, starts, tension, friction, .. } = sweep;
        let square = T::Lanes::splat(with, compliance.square);
        let along = T::Lanes::splat(with, compliance.along);
        let all = T::Lanes::splat(with, compliance.all);
        let (one, zero) = (T::Lanes::splat(with, T::ONE), T::Lanes::splat(with, T::ZERO));
        for (eight, pairs) in pairs[..*wide].chunks_exact(EIGHT).enumerate() {
            let at = eight * EIGHT;
            let [i, j] = ends(pairs);
            let [ax, ay, az, aw] = T::Lanes::quads(with, places, &i);
            let [bx, by, bz, bw] = T::Lanes::quads(with, places, &j);
            let w = aw + bw;
            let [dx, dy, dz] = [bx - ax, by - ay, bz - az];
            let was = if ALONG || ALL {
                let [ax, ay, az, _] = T::Lanes::quads(with, starts, &i);
                let [bx, by, bz, _] = T::Lanes::quads(with, starts, &j);
                [bx - ax, by - ay, bz - az]
            } else {
                [zero; 3]
            };
            let length = (dx * dx + dy * dy + dz * dz).sqrt();
            let inverse = (one / length).where_positive(length);
            let [nx, ny, nz] = [dx * inverse, dy * inverse, dz * inverse];
            let k = square * T::Lanes::load(with, &stiffness[at..]);
            let exerted = T::Lanes::load(with, &tension[at..]);
            let mut wanted = zero - k * (length - T::Lanes::load(with, &rest[at..])) - exerted;
            if ALONG {
                let [ux, uy, uz] = [dx - was[0], dy - was[1], dz - was[2]];
                wanted = wanted - along * (nx * ux + ny * uy + nz * uz);
            }
            let stiff = if ALONG { k + along } else { k };
            let change = (wanted / (stiff * w + one)).where_positive(length).where_positive(w);
            tension[at..at + EIGHT].copy_from_slice(&(exerted + change).to_array());
            let [mut px, mut py, mut pz] = [nx * change, ny * change, nz * change];
            if ALL {
                let part = one / (all * w + one);
                let [x, y, z] = friction;
                px = px + brake::<T>(with, dx + px * w - was[0], [all, part, w], &mut x[at..]);
                py = py + brake::<T>(with, dy + py * w - was[1], [all, part, w], &mut y[at..]);
                pz = pz + brake::<T>(with, dz + pz * w - was[2], [all, part, w], &mut z[at..]);
            }
            T::Lanes::put_quads([ax - px * aw, ay - py * aw, az - pz * aw, aw], places, &i);
            T::Lanes::put_quads([bx + px * bw, by + py * bw, bz + pz * bw, bw], places, &j);
        }
    }
}

/// The impulse of damping along one component of a way, which is added to what it was before.
#[inline(always)]
fn brake<T: Real>(
    with: Instructions,
    way: T::Lanes,
    [all, part, w]: [T::Lanes; 3],
    friction: &mut [T],
) -> T::Lanes {
    let before = T::Lanes::load(with, friction);
    let wanted = T::Lanes::splat(with, T::ZERO) - way * all - before;
    let change = (wanted * part).where_positive(w);
    friction[..EIGHT].copy_from_slice(&(before + change).to_array());
    change
}
