//! The pass over sliced springs: what each of them gives to one of its particles and takes from the other, summed up.
//!
//! The sum of a particle is ((what it begins with - taken) + given) + loose springs, each in the order of the rows, whatever the
//! threads: each has particles of its own, and a row that leads across is computed on both sides. Nothing that rows read and
//! write stands further ahead than [`Slices::reach`]: a window of components goes along with the blocks, small enough for the
//! caches.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::{ALL, APART, BLOCK, Row, SLACK, SPAN, Slices, end_before};
use crate::math::Real;
use crate::math::lanes::{self, Kernel, LANES, Lanes};
use crate::math::parts::Parts;

/// Eight springs: their kind, and their number among the rows or among the lists of loose ones.
#[derive(Clone, Copy, Debug)]
pub enum Eight {
    Row { group: usize, number: usize },
    Loose { group: usize, number: usize },
}

/// What springs do.
pub trait Law<T: Real>: Copy + Send + Sync {
    /// What is taken from the others has the same sign as what the ones are given.
    const ALIKE: bool = false;

    /// What eight springs give to the ones, by component, from the fields of the ones and of the others; what is noticed of
    /// them raises `most`.
    fn give<L: Lanes<Scalar = T>>(
        self,
        with: L::Proof,
        springs: Eight,
        here: impl Fields<T>,
        there: impl Fields<T>,
        most: &mut L,
    ) -> [L; 3];
}

/// The fields of eight particles.
pub trait Fields<T: Real>: Copy {
    /// One of them.
    fn field<L: Lanes<Scalar = T>>(self, with: L::Proof, number: usize) -> [L; 3];
}

/// Eight in a row in a window.
#[derive(Clone, Copy)]
struct InRow<'a, T, const F: usize> {
    fields: &'a [Components<T>; F],
    at: usize,
}

impl<T: Real, const F: usize> Fields<T> for InRow<'_, T, F> {
    #[inline(always)]
    fn field<L: Lanes<Scalar = T>>(self, with: L::Proof, number: usize) -> [L; 3] {
        load(with, &self.fields[number], self.at)
    }
}

/// Eight anywhere.
#[derive(Clone, Copy)]
struct Anywhere<'a, V, const F: usize> {
    sources: &'a [V; F],
    at: &'a [u32; LANES],
}

impl<T: Real, V: Field<T>, const F: usize> Fields<T> for Anywhere<'_, V, F> {
    #[inline(always)]
    fn field<L: Lanes<Scalar = T>>(self, with: L::Proof, number: usize) -> [L; 3] {
        self.sources[number].each(with, self.at)
    }
}

/// Where the sums of some particles go. Particles are counted from the first of these.
pub trait Sums<T: Real>: Parts {
    /// What eight particles begin with.
    fn begin<L: Lanes<Scalar = T>>(&self, with: L::Proof, at: usize, here: impl Fields<T>) -> [L; 3];
    /// What came of it.
    fn end<L: Lanes<Scalar = T>>(&mut self, with: L::Proof, at: usize, here: impl Fields<T>, sum: [L; 3]);

    /// The most that was noticed of the springs of a block, whose first particle this is.
    #[inline(always)]
    fn notice<L: Lanes<Scalar = T>>(&mut self, _: usize, _: L) {}
}

/// A vector of each particle.
pub trait Field<T: Real>: Copy + Send + Sync {
    /// The eight from an index on that is divisible by eight, the last ones 0 where there are no more.
    fn eight<L: Lanes<Scalar = T>>(self, with: L::Proof, at: usize) -> [L; 3];
    /// Those of eight particles.
    fn each<L: Lanes<Scalar = T>>(self, with: L::Proof, at: &[u32; LANES]) -> [L; 3];
}

/// One behind the other.
#[derive(Clone, Copy, Debug)]
pub struct Vectors<'a, T: Real>(pub &'a [T::Vec3]);

impl<T: Real> Field<T> for Vectors<'_, T> {
    #[inline(always)]
    fn eight<L: Lanes<Scalar = T>>(self, with: L::Proof, at: usize) -> [L; 3] {
        lanes::vectors_of(with, &self.0[at..])
    }

    #[inline(always)]
    fn each<L: Lanes<Scalar = T>>(self, with: L::Proof, at: &[u32; LANES]) -> [L; 3] {
        L::components(with, self.0, at)
    }
}

/// By component in eights, the last ones filled up.
#[derive(Clone, Copy, Debug)]
pub struct Eights<'a, T>(pub &'a [[[T; LANES]; 3]]);

impl<T: Real> Field<T> for Eights<'_, T> {
    #[inline(always)]
    fn eight<L: Lanes<Scalar = T>>(self, with: L::Proof, at: usize) -> [L; 3] {
        let [x, y, z] = self.0[at / LANES];
        [L::of(with, x), L::of(with, y), L::of(with, z)]
    }

    #[inline(always)]
    fn each<L: Lanes<Scalar = T>>(self, with: L::Proof, at: &[u32; LANES]) -> [L; 3] {
        let component = |c: usize| at.map(|i| self.0[i as usize / LANES][c][i as usize % LANES]);
        [L::of(with, component(0)), L::of(with, component(1)), L::of(with, component(2))]
    }
}

/// By component, one behind the other, with room for the last row.
type Components<T> = [[T; SPAN + APART]; 3];

/// What rows have given and taken, and the fields that they read, of the particles about those that are worked on: scratch of
/// [`Slices::go_over`].
#[derive(Debug)]
pub struct Window<T>(Vec<Components<T>>);

impl<T> Default for Window<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Real> Window<T> {
    /// Has room for so many fields.
    pub(super) fn hold(&mut self, fields: usize) {
        if self.0.len() < 2 + fields {
            self.0.resize(2 + fields, [[T::ZERO; SPAN + APART]; 3]);
        }
    }
}

impl<T: Real> Slices<T> {
    /// Sums up what the springs do with these fields of `particles` particles, on so many threads of the current pool.
    pub(super) fn go_over<const F: usize>(
        &self,
        fields: [impl Field<T>; F],
        law: impl Law<T>,
        sums: impl Sums<T>,
        windows: &mut Vec<Window<T>>,
        threads: usize,
    ) {
        let threads = threads.max(1);
        if windows.len() < threads {
            windows.resize_with(threads, Window::default);
        }
        let windows = &mut windows[..threads];
        windows.iter_mut().for_each(|window| window.hold(F));
        let particles = sums.count();
        let pass = Pass { slices: self, particles, fields, law, first: 0, sums, windows };
        lanes::share(pass, BLOCK, threads);
    }
}

/// The sums of some particles.
pub(super) struct Pass<'a, T: Real, V, W, S, const F: usize> {
    pub slices: &'a Slices<T>,
    /// Of all the cloth.
    pub particles: usize,
    pub fields: [V; F],
    pub law: W,
    /// The particle that `sums` begins with, of a block the first.
    pub first: usize,
    pub sums: S,
    /// One for each thread.
    pub windows: &'a mut [Window<T>],
}

impl<T: Real, V: Field<T>, W: Law<T>, S: Sums<T>, const F: usize> Parts for Pass<'_, T, V, W, S, F> {
    fn count(&self) -> usize {
        self.sums.count()
    }

    fn split_at(self, particle: usize) -> (Self, Self) {
        let Self { slices, particles, fields, law, first, sums, windows } = self;
        let (few, more) = windows.split_at_mut(windows.len() / 2);
        let (before, behind) = sums.split_at(particle);
        (
            Self { slices, particles, fields, law, first, sums: before, windows: few },
            Self { slices, particles, fields, law, first: first + particle, sums: behind, windows: more },
        )
    }
}

impl<T: Real, V: Field<T>, W: Law<T>, S: Sums<T>, const F: usize> Kernel<T> for Pass<'_, T, V, W, S, F> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let Self { slices, particles, fields: sources, law, first, mut sums, windows } = self;
        let Some([given, taken, fields @ ..]) = windows.first_mut().map(|window| &mut window.0[..]) else {
            return;
        };
        let Some(fields) = fields.first_chunk_mut::<F>() else { return };
        // What leads into the first block begins no farther in front of it.
        let begin = first - slices.reach.next_multiple_of(BLOCK).min(first);
        let mut row = end_before(&slices.row_ends, begin / BLOCK * slices.groups);
        let mut list = end_before(&slices.list_ends, first / LANES * slices.groups);
        // The particle that the window begins with, and the first that is not in it yet.
        let (mut base, mut next) = (begin, begin);
        let end = first + sums.count();
        for block in (begin..end).step_by(BLOCK) {
            let mut most = L::splat(with, T::from_f64(f64::NEG_INFINITY));
            if block + slices.reach > base + SPAN.min(2 * slices.reach + SLACK) {
                for components in [&mut *given, &mut *taken].into_iter().chain(&mut *fields) {
                    for component in components {
                        component.copy_within(block - base..next - base, 0);
                    }
                }
                base = block;
            }
            while next < (block + slices.reach).min(particles) {
                for (field, source) in fields.iter_mut().zip(sources) {
                    put(source.eight::<L>(with, next), field, next - base);
                }
                let nothing = [L::splat(with, T::ZERO); 3];
                put(nothing, given, next - base);
                put(nothing, taken, next - base);
                next += LANES;
            }
            for group in 0..slices.groups {
                let end = slices.row_ends[block / BLOCK * slices.groups + group] as usize;
                for (number, &Row { from, to, lanes }) in (row..).zip(&slices.rows[row..end]) {
                    let (from, to) = (from as usize - base, to as usize - base);
                    if block < first && to + LANES <= first - base {
                        continue;
                    }
                    let springs = Eight::Row { group, number };
                    let (here, there) = (InRow { fields, at: from }, InRow { fields, at: to });
                    let mut gives = law.give::<L>(with, springs, here, there, &mut most);
                    if lanes != ALL {
                        gives = [gives[0].only(lanes), gives[1].only(lanes), gives[2].only(lanes)];
                    }
                    add(with, given, from, gives);
                    add(with, taken, to, if W::ALIKE { [-gives[0], -gives[1], -gives[2]] } else { gives });
                }
                row = end;
            }
            if block < first {
                continue;
            }
            for own in (block..(block + BLOCK).min(particles)).step_by(LANES) {
                let here = InRow { fields, at: own - base };
                let begin = sums.begin::<L>(with, own - first, here);
                let (given, taken) =
                    (load::<T, L>(with, given, own - base), load::<T, L>(with, taken, own - base));
                let mut sum = [
                    begin[0] - taken[0] + given[0],
                    begin[1] - taken[1] + given[1],
                    begin[2] - taken[2] + given[2],
                ];
                if !slices.list_ends.is_empty() {
                    for group in 0..slices.groups {
                        let end = slices.list_ends[own / LANES * slices.groups + group] as usize;
                        for (number, to) in (list..).zip(&slices.lists[list..end]) {
                            let springs = Eight::Loose { group, number };
                            let there = Anywhere { sources: &sources, at: to };
                            let [x, y, z] = law.give::<L>(with, springs, here, there, &mut most);
                            sum = [sum[0] + x, sum[1] + y, sum[2] + z];
                        }
                        list = end;
                    }
                }
                sums.end::<L>(with, own - first, here, sum);
            }
            sums.notice(block - first, most);
        }
    }
}

/// Eight vectors from an index on.
#[inline(always)]
fn load<T: Real, L: Lanes<Scalar = T>>(with: L::Proof, [x, y, z]: &Components<T>, at: usize) -> [L; 3] {
    let at = at % SPAN;
    [L::load(with, &x[at..]), L::load(with, &y[at..]), L::load(with, &z[at..])]
}

/// Puts eight vectors there.
#[inline(always)]
fn put<T: Real, L: Lanes<Scalar = T>>([x, y, z]: [L; 3], to: &mut Components<T>, at: usize) {
    let at = at % SPAN;
    x.store(&mut to[0][at..]);
    y.store(&mut to[1][at..]);
    z.store(&mut to[2][at..]);
}

/// Adds to eight vectors.
#[inline(always)]
fn add<T: Real, L: Lanes<Scalar = T>>(with: L::Proof, to: &mut Components<T>, at: usize, [x, y, z]: [L; 3]) {
    let there = load::<T, L>(with, to, at);
    put([there[0] + x, there[1] + y, there[2] + z], to, at);
}
