//! Eight springs of a sweep at once.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::tiles::{Here, Pairs, Part, Shape};
use super::{Compliance, Turn};
use crate::math::Real;
use crate::math::lanes::{Kernel, LANES, Lanes};
use std::ops::Range;

/// Reads and writes the ends of eight springs in a row of numbers, one for each particle.
trait Ends<T: Real> {
    fn read<L: Lanes<Scalar = T>>(with: L::Proof, row: &[T], at: [u32; 2], apart: &[Pairs]) -> [L; 2];
    fn put<L: Lanes<Scalar = T>>(ends: [L; 2], row: &mut [T], at: [u32; 2], apart: &[Pairs]);
}

/// See [`Shape::Row`].
struct Row;

impl<T: Real> Ends<T> for Row {
    #[inline(always)]
    fn read<L: Lanes<Scalar = T>>(with: L::Proof, row: &[T], [from, to]: [u32; 2], _: &[Pairs]) -> [L; 2] {
        [L::load(with, &row[from as usize..]), L::load(with, &row[to as usize..])]
    }

    #[inline(always)]
    fn put<L: Lanes<Scalar = T>>([a, b]: [L; 2], row: &mut [T], [from, to]: [u32; 2], _: &[Pairs]) {
        a.store(&mut row[from as usize..]);
        b.store(&mut row[to as usize..]);
    }
}

/// See [`Shape::Comb1`].
struct Comb<const WAY: usize>;

impl<T: Real, const WAY: usize> Ends<T> for Comb<WAY> {
    #[inline(always)]
    fn read<L: Lanes<Scalar = T>>(with: L::Proof, row: &[T], [from, _]: [u32; 2], _: &[Pairs]) -> [L; 2] {
        let mut sixteen = [T::ZERO; 2 * LANES];
        sixteen.copy_from_slice(&row[from as usize..][..2 * LANES]);
        L::comb::<WAY>(with, &sixteen)
    }

    #[inline(always)]
    fn put<L: Lanes<Scalar = T>>(ends: [L; 2], row: &mut [T], [from, _]: [u32; 2], _: &[Pairs]) {
        let mut sixteen = [T::ZERO; 2 * LANES];
        L::put_comb::<WAY>(ends, &mut sixteen);
        row[from as usize..][..2 * LANES].copy_from_slice(&sixteen);
    }
}

/// See [`Shape::Apart`].
struct Apart;

impl<T: Real> Ends<T> for Apart {
    #[inline(always)]
    fn read<L: Lanes<Scalar = T>>(with: L::Proof, row: &[T], [at, _]: [u32; 2], apart: &[Pairs]) -> [L; 2] {
        let [i, j] = &apart[at as usize];
        [L::gather(with, row, i), L::gather(with, row, j)]
    }

    #[inline(always)]
    fn put<L: Lanes<Scalar = T>>([a, b]: [L; 2], row: &mut [T], [at, _]: [u32; 2], apart: &[Pairs]) {
        let [i, j] = &apart[at as usize];
        a.scatter(row, i);
        b.scatter(row, j);
    }
}

/// Puts every spring of a part to its rest length.
pub(super) struct Relax<'a, T: Real> {
    pub part: &'a Part<T>,
    pub here: Here<'a, T>,
}

impl<T: Real> Kernel<T> for Relax<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(mut self, with: L::Proof) {
        for (shape, eights) in self.part.runs() {
            match shape {
                Shape::Row => self.go::<L, Row>(with, eights),
                Shape::Comb1 => self.go::<L, Comb<1>>(with, eights),
                Shape::Comb2 => self.go::<L, Comb<2>>(with, eights),
                Shape::Apart => self.go::<L, Apart>(with, eights),
            }
        }
    }
}

impl<T: Real> Relax<'_, T> {
    #[inline(always)]
    fn go<L: Lanes<Scalar = T>, E: Ends<T>>(&mut self, with: L::Proof, eights: Range<usize>) {
        let Part { eights: all, apart, rest, .. } = self.part;
        let ([x, y, z], weights, _) = self.here.rows();
        for (eight, rest) in all[eights.clone()].iter().zip(&rest[eights]) {
            let [ax, bx] = E::read::<L>(with, x, eight.at, apart);
            let [ay, by] = E::read::<L>(with, y, eight.at, apart);
            let [az, bz] = E::read::<L>(with, z, eight.at, apart);
            let [aw, bw] = E::read::<L>(with, weights, eight.at, apart);
            let [dx, dy, dz] = [bx - ax, by - ay, bz - az];
            let length = (dx * dx + dy * dy + dz * dz).sqrt();
            let w = (aw + bw).only(eight.lanes);
            let factor = (length - L::of(with, *rest)) / (length * w);
            // Where the ends are at one place, neither moves or there is no spring it is 0/0.
            let factor = factor.where_positive(length).where_positive(w);
            let [cx, cy, cz] = [dx * factor, dy * factor, dz * factor];
            E::put([ax + cx * aw, bx - cx * bw], x, eight.at, apart);
            E::put([ay + cy * aw, by - cy * bw], y, eight.at, apart);
            E::put([az + cz * aw, bz - cz * bw], z, eight.at, apart);
        }
    }
}

/// Lets every spring of a part exert what its compliance and its damping still want.
pub(super) struct Comply<'a, T: Real> {
    pub part: &'a mut Part<T>,
    pub here: Here<'a, T>,
    pub compliance: Compliance<T>,
    pub turn: Turn,
}

impl<T: Real> Kernel<T> for Comply<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(mut self, with: L::Proof) {
        let (along, all) = (self.compliance.along > T::ZERO, self.compliance.all > T::ZERO);
        match (along, all) {
            (false, false) => self.each::<L, false, false>(with),
            (true, false) => self.each::<L, true, false>(with),
            (false, true) => self.each::<L, false, true>(with),
            (true, true) => self.each::<L, true, true>(with),
        }
    }
}

impl<T: Real> Comply<'_, T> {
    #[inline(always)]
    fn each<L: Lanes<Scalar = T>, const ALONG: bool, const ALL: bool>(&mut self, with: L::Proof) {
        for run in 0..self.part.runs.len() {
            let (shape, eights) = self.part.run(run);
            match shape {
                Shape::Row => self.go::<L, Row, ALONG, ALL>(with, eights),
                Shape::Comb1 => self.go::<L, Comb<1>, ALONG, ALL>(with, eights),
                Shape::Comb2 => self.go::<L, Comb<2>, ALONG, ALL>(with, eights),
                Shape::Apart => self.go::<L, Apart, ALONG, ALL>(with, eights),
            }
        }
    }

    #[inline(always)]
    fn go<L: Lanes<Scalar = T>, E: Ends<T>, const ALONG: bool, const ALL: bool>(
        &mut self,
        with: L::Proof,
        eights: Range<usize>,
    ) {
        let Self { part, here, compliance, turn } = self;
        let Part { eights: all_eights, apart, rest, stiffness, tension, friction, .. } = &mut **part;
        let ([x, y, z], weights, starts) = here.rows();
        let square = L::splat(with, compliance.square);
        let along = L::splat(with, compliance.along);
        let all = L::splat(with, compliance.all);
        let (one, zero) = (L::splat(with, T::ONE), L::splat(with, T::ZERO));
        let springs = all_eights[eights.clone()].iter().zip(&rest[eights.clone()]);
        let springs = springs.zip(&stiffness[eights.clone()]).zip(&mut tension[eights.clone()]);
        for (number, (((eight, rest), stiffness), tension)) in eights.zip(springs) {
            let [ax, bx] = E::read::<L>(with, x, eight.at, apart);
            let [ay, by] = E::read::<L>(with, y, eight.at, apart);
            let [az, bz] = E::read::<L>(with, z, eight.at, apart);
            let [aw, bw] = E::read::<L>(with, weights, eight.at, apart);
            let w = (aw + bw).only(eight.lanes);
            let [dx, dy, dz] = [bx - ax, by - ay, bz - az];
            let mut was = [zero; 3];
            if ALONG || ALL {
                for c in 0..3 {
                    let [a, b] = E::read::<L>(with, starts[c], eight.at, apart);
                    was[c] = b - a;
                }
            }
            let length = (dx * dx + dy * dy + dz * dz).sqrt();
            let k = square * L::of(with, *stiffness);
            let stiff = (if ALONG { k + along } else { k }) * w + one;
            // One division for both 1 / stiff and 1 / length.
            let share = (one / (stiff * length)).where_positive(length).where_positive(w);
            let exerted = if turn.is_first { zero } else { L::of(with, *tension) };
            let mut wanted = zero - k * (length - L::of(with, *rest)) - exerted;
            if ALONG {
                let [ux, uy, uz] = [dx - was[0], dy - was[1], dz - was[2]];
                wanted = wanted - along * ((dx * ux + dy * uy + dz * uz) * (share * stiff));
            }
            let change = wanted * share;
            if !turn.is_last {
                *tension = (exerted + change * length).to_array();
            }
            let [mut px, mut py, mut pz] = [dx * change, dy * change, dz * change];
            if ALL {
                let part = (one / (all * w + one)).where_positive(w);
                let [x, y, z] = &mut friction[number];
                px = px + brake::<T, L>(with, dx + px * w - was[0], [all, part], x, *turn);
                py = py + brake::<T, L>(with, dy + py * w - was[1], [all, part], y, *turn);
                pz = pz + brake::<T, L>(with, dz + pz * w - was[2], [all, part], z, *turn);
            }
            E::put([ax - px * aw, bx + px * bw], x, eight.at, apart);
            E::put([ay - py * aw, by + py * bw], y, eight.at, apart);
            E::put([az - pz * aw, bz + pz * bw], z, eight.at, apart);
        }
    }
}

/// The impulse of damping along one component of a way, which is added to what it was before.
#[inline(always)]
fn brake<T: Real, L: Lanes<Scalar = T>>(
    with: L::Proof,
    way: L,
    [all, part]: [L; 2],
    friction: &mut [T; LANES],
    turn: Turn,
) -> L {
    let before = if turn.is_first { L::splat(with, T::ZERO) } else { L::of(with, *friction) };
    let change = (L::splat(with, T::ZERO) - way * all - before) * part;
    if !turn.is_last {
        *friction = (before + change).to_array();
    }
    change
}
