//! Springs in an order that the processor can take eight at a time, and threads apart.
//!
//! A sweep is a chain: what a spring does waits for the one before it where they share a particle. Two things break it, and
//! both are part of the order, so that a sweep gives the same bits on any machine and number of threads:
//!
//! - Particles are cut into tiles in the order in which they are stored. First come the springs inside of the tiles, then those
//!   across the border of two neighbours, then the few that lead farther. Tiles share no particle, nor do the strips along
//!   borders: threads may take a tile or a strip each.
//! - Inside of these, eight springs in a row share no particle and are worked on at once ([`wide`](super::wide)). On a mesh that
//!   is numbered along its rows most of them are neighbours that are read as they stand, from eight particles in a row to eight
//!   others, or between sixteen in a row. The rest are put together as they fit.

use super::components::{self, Components};
use super::order::Source;
use super::wide::{Comply, Relax};
use super::{Compliance, Sweep, Turn};
use crate::forces::Problem;
use crate::math::lanes::LANES;
use crate::math::{Real, lanes};
use crate::model::Particles;
use rayon::prelude::*;
use std::ops::Range;

/// Least number of particles in a tile: few enough for the first cache, many beside those at the borders.
const TILE: usize = 1024;

/// The particles that a sweep moves, and the springs in its order.
#[derive(Debug, Default)]
pub struct Tiles<T: Real> {
    /// The problem's revision that the springs were taken from.
    taken: u64,
    /// Particles in a tile.
    tile: usize,
    /// The springs inside of each tile.
    inside: Vec<Part<T>>,
    /// Those across its border to the next.
    across: Vec<Part<T>>,
    /// Those that lead farther.
    far: Part<T>,
    /// Where each particle was at the start of the step, m.
    starts: Components<T>,
    /// Where each particle is, m.
    places: Components<T>,
}

/// How the ends of eight springs stand among the particles of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// From eight in a row to eight in a row: the first of each.
    Row,
    /// Between sixteen in a row: from every other one to the next. The first of them.
    Comb1,
    /// From every other two to the next two. The first of them.
    Comb2,
    /// Anywhere: a number in the list of the part.
    Apart,
}

/// Two particles for each of eight lanes.
pub(super) type Pairs = [[u32; LANES]; 2];

/// Eight springs, lane by lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eight {
    /// See [`Shape`].
    pub at: [u32; 2],
    /// A bit for each lane that has a spring.
    pub lanes: u32,
}

/// Springs in eights, in the order in which they are worked on; particles are counted from the first one of the part.
#[derive(Debug, Default)]
pub(super) struct Part<T: Real> {
    /// Where eights of one shape end, again and again.
    pub runs: Vec<(Shape, u32)>,
    pub eights: Vec<Eight>,
    /// A lane for which there is no spring has the particles of the first.
    pub apart: Vec<Pairs>,
    /// Rest lengths, m.
    pub rest: Vec<[T; LANES]>,
    /// Stiffnesses, N/m.
    pub stiffness: Vec<[T; LANES]>,
    /// Impulse that each compliant spring has exerted along itself, N s · s.
    pub tension: Vec<[T; LANES]>,
    /// The same of its damping, by component.
    pub friction: Vec<[[T; LANES]; 3]>,
}

impl<T: Real> Part<T> {
    /// A run and its eights.
    pub fn run(&self, number: usize) -> (Shape, Range<usize>) {
        let begin = number.checked_sub(1).map_or(0, |before| self.runs[before].1);
        let (shape, end) = self.runs[number];
        (shape, begin as usize..end as usize)
    }

    /// All of them.
    pub fn runs(&self) -> impl Iterator<Item = (Shape, Range<usize>)> + use<'_, T> {
        (0..self.runs.len()).map(|number| self.run(number))
    }

    /// Adds eight springs, by lane; there may be fewer.
    pub fn push(&mut self, shape: Shape, at: [u32; 2], springs: [Option<u32>; LANES], of: &Source<T>) {
        let bit = |lane: usize| if springs[lane].is_some() { 1 << lane } else { 0 };
        let value = |from: &[T]| springs.map(|s| s.map_or(T::ZERO, |s| from[s as usize]));
        self.eights.push(Eight { at, lanes: (0..LANES).map(bit).sum() });
        self.rest.push(value(&of.springs.rest));
        self.stiffness.push(value(&of.stiffness));
        let end = self.eights.len() as u32;
        match self.runs.last_mut() {
            Some((last, before)) if *last == shape => *before = end,
            _ => self.runs.push((shape, end)),
        }
    }
}

/// The particles of a part.
pub(super) struct Here<'a, T> {
    /// Where they are, m.
    pub places: [&'a mut [T]; 3],
    pub weights: &'a [T],
    /// Where they were at the start of the step, m.
    pub starts: [&'a [T]; 3],
}

impl<T> Here<'_, T> {
    /// Places, weights and starts: rows of one length, so that an index that is inside of one of them is inside of all.
    pub fn rows(&mut self) -> ([&mut [T]; 3], &[T], [&[T]; 3]) {
        let Self { places: [x, y, z], weights, starts: [sx, sy, sz] } = self;
        let count = x.len();
        ([x, &mut y[..count], &mut z[..count]], &weights[..count], [&sx[..count], &sy[..count], &sz[..count]])
    }
}

/// A part, and the places of its particles, by component.
type WithRows<'a, T> = (&'a mut Part<T>, &'a mut [T], &'a mut [T], &'a mut [T]);

impl<T: Real> Tiles<T> {
    /// Gets ready for a step of compliant springs.
    pub fn begin(&mut self, compliance: &Compliance<T>) {
        let is_damped = compliance.all > T::ZERO;
        for part in self.inside.iter_mut().chain(&mut self.across).chain([&mut self.far]) {
            let eights = part.eights.len();
            part.tension.resize(eights, [T::ZERO; LANES]);
            part.friction.resize(if is_damped { eights } else { 0 }, [[T::ZERO; LANES]; 3]);
        }
    }

    /// Lets every spring exert what its compliance and its damping still want.
    pub fn comply(&mut self, weights: &[T], compliance: &Compliance<T>, turn: Turn, parallel: bool) {
        let compliance = *compliance;
        self.each(weights, parallel, |part, here| lanes::run(Comply { part, here, compliance, turn }));
    }

    /// Works on every part, with its particles, in the order of the sweep.
    fn each(&mut self, weights: &[T], parallel: bool, work: impl Fn(&mut Part<T>, Here<T>) + Sync) {
        let Self { tile, inside, across, far, places, starts, .. } = self;
        let starts = starts.rows();
        for (parts, behind) in [(inside, 0), (across, *tile / 2)] {
            let behind = behind.min(places.len());
            let [x, y, z] = places.rows_mut().map(|row| &mut row[behind..]);
            let one = |(number, (part, x, y, z)): (usize, WithRows<T>)| {
                let first = behind + number * *tile;
                let (starts, weights) = (starts.map(|row| &row[first..]), &weights[first..]);
                work(part, Here { places: [x, y, z], weights, starts });
            };
            if parallel {
                let rows = (x.par_chunks_mut(*tile), y.par_chunks_mut(*tile), z.par_chunks_mut(*tile));
                (parts.par_iter_mut(), rows.0, rows.1, rows.2).into_par_iter().enumerate().for_each(one);
            } else {
                let rows = x.chunks_mut(*tile).zip(y.chunks_mut(*tile)).zip(z.chunks_mut(*tile));
                let parts = parts.iter_mut().zip(rows).map(|(part, ((x, y), z))| (part, x, y, z));
                parts.enumerate().for_each(one);
            }
        }
        work(far, Here { places: places.rows_mut(), weights, starts });
    }
}

impl<T: Real> Sweep<T> for Tiles<T> {
    fn take(&mut self, problem: &Problem<T>) {
        if self.taken == problem.revision() {
            return;
        }
        let (springs, particles) = (&problem.springs, problem.particles());
        // Springs of a sheet lead on by two of its rows at most, which half a tile holds.
        self.tile = TILE.max((4.0 * (particles as f64).sqrt()) as usize).next_multiple_of(2);
        let (tile, half) = (self.tile, self.tile / 2);
        let tiles = particles.div_ceil(tile);
        let (mut inside, mut across) = (vec![Vec::new(); tiles], vec![Vec::new(); tiles.saturating_sub(1)]);
        let mut far = Vec::new();
        for (spring, pair) in (0..).zip(&springs.pairs) {
            let [i, j] = pair.map(|p| p as usize);
            if i / tile == j / tile {
                inside[i / tile].push(spring);
            } else if i >= half && (i - half) / tile == (j - half) / tile {
                across[(i - half) / tile].push(spring);
            } else {
                far.push(spring);
            }
        }
        let source = Source::new(springs);
        let part = |chosen: &[u32], first: usize| source.part(chosen, first, tile.min(particles - first));
        let parts = |chosen: &[Vec<u32>], behind: usize| {
            let one = |(number, chosen): (usize, &Vec<u32>)| part(chosen, behind + number * tile);
            if problem.parallel() {
                chosen.par_iter().enumerate().map(one).collect()
            } else {
                chosen.iter().enumerate().map(one).collect()
            }
        };
        (self.inside, self.across) = (parts(&inside, 0), parts(&across, half));
        self.far = Part::default();
        source.fit(&far, 0, particles, &mut self.far);
        self.taken = problem.revision();
    }

    fn set_out(&mut self, positions: &[T::Vec3], velocities: &[T::Vec3], _: &[T], h: T, threads: usize) {
        components::set_out([&mut self.starts, &mut self.places], positions, velocities, h, threads);
    }

    fn relax(&mut self, weights: &[T], parallel: bool) {
        self.each(weights, parallel, |part, here| lanes::run(Relax { part, here }));
    }

    fn arrive(&self, state: &mut Particles<T>, velocities: &[T::Vec3], weights: &[T], h: T, threads: usize) {
        components::arrive([&self.starts, &self.places], state, velocities, weights, h, threads);
    }
}

#[cfg(test)]
mod tests {
    use super::super::chain::{point, quad, relax_one};
    use super::*;
    use crate::forces::{SpringSet, springs::SpringParams};
    use crate::math::Vector;
    use crate::math::lanes::{Kernel, Plain};
    use crate::model::Topology;
    use glam::DVec3;

    const PARTICLES: usize = 100 * 41;

    fn sheet() -> Topology {
        Topology::of(&crate::target::grid(100, 41, 0.1, false))
    }

    /// Springs with two that have no length, and a hundred particles that do not move.
    fn place<T: Real>(i: usize, scale: f64) -> T::Vec3 {
        let t = if i % 97 == 96 { i as f64 - 1.0 } else { i as f64 };
        T::Vec3::from_f64(DVec3::new((t * 0.7).sin(), (t * 1.3).cos(), (t * 2.1).sin()) * scale)
    }

    fn row<T: Real>(scale: f64) -> Vec<T::Vec3> {
        (0..PARTICLES).map(|i| place::<T>(i, scale)).collect()
    }

    fn weights<T: Real>() -> Vec<T> {
        let weight = |i: usize| if i < 100 { 0.0 } else { (i as f64 * 0.37).cos().abs() * 0.8 };
        (0..PARTICLES).map(|i| T::from_f64(weight(i))).collect()
    }

    /// A sheet in tiles, with holes, and with some springs that lead far.
    fn tiles<T: Real>() -> (Problem<T>, Tiles<T>) {
        let mut topology = sheet();
        for pairs in &mut topology.pairs {
            pairs.retain(|[i, j]| (i + j) % 11 > 0);
        }
        topology.pairs[2].extend([[7, 3000], [8, 2500], [9, 4000], [50, 2000]]);
        topology.pairs[2].sort_unstable();
        let params = SpringParams::default();
        let rest = row::<T>(0.7);
        let set = SpringSet { topology: &topology, rest_positions: &rest, params: &params, broken: &[] };
        let problem = Problem::new(vec![T::ONE; PARTICLES], &set);
        let mut tiles = Tiles::default();
        tiles.take(&problem);
        (problem, tiles)
    }

    /// Every spring of a sweep, in its order, with its particles, rest length and stiffness.
    fn in_order<T: Real>(tiles: &Tiles<T>) -> Vec<([u32; 2], T, T)> {
        let (tile, half) = (tiles.tile as u32, tiles.tile as u32 / 2);
        let inside = (0..).zip(&tiles.inside).map(|(number, part)| (number * tile, part));
        let across = (0..).zip(&tiles.across).map(|(number, part)| (number * tile + half, part));
        let mut springs = Vec::new();
        for (first, part) in inside.chain(across).chain([(0, &tiles.far)]) {
            for (shape, eights) in part.runs() {
                for number in eights {
                    let Eight { at: [from, to], lanes } = part.eights[number];
                    let mut before = Vec::new();
                    for lane in (0..LANES).filter(|lane| lanes >> lane & 1 == 1) {
                        let comb = |way: usize| {
                            [
                                from + T::TEETH[way - 1][lane] as u32,
                                from + (T::TEETH[way - 1][lane] + way) as u32,
                            ]
                        };
                        let pair = match shape {
                            Shape::Row => [from + lane as u32, to + lane as u32],
                            Shape::Comb1 => comb(1),
                            Shape::Comb2 => comb(2),
                            Shape::Apart => part.apart[from as usize].map(|end| end[lane]),
                        };
                        if !before.contains(&pair) {
                            before.push(pair);
                            let pair = pair.map(|p| p + first);
                            springs.push((pair, part.rest[number][lane], part.stiffness[number][lane]));
                        }
                    }
                    let mut ends = before.concat();
                    ends.sort_unstable();
                    ends.dedup();
                    assert_eq!(ends.len(), 2 * before.len(), "eight springs share no particle");
                }
            }
        }
        springs
    }

    #[test]
    fn every_spring_has_its_place_in_the_order() {
        let (problem, tiles) = tiles::<f64>();
        let mut springs: Vec<_> =
            in_order(&tiles).into_iter().map(|(pair, rest, _)| (pair, rest.to_bits())).collect();
        springs.sort_unstable();
        let all = problem.springs.pairs.iter().zip(&problem.springs.rest);
        let mut all: Vec<_> = all.map(|(pair, rest)| (*pair, rest.to_bits())).collect();
        all.sort_unstable();
        assert_eq!(springs, all);
        let shapes =
            |part: &Part<f64>| part.runs().map(|(shape, eights)| (shape, eights.len())).collect::<Vec<_>>();
        let inside = shapes(&tiles.inside[1]);
        for shape in [Shape::Row, Shape::Comb1, Shape::Comb2] {
            assert!(inside.iter().any(|(other, count)| *other == shape && *count > 20), "{inside:?}");
        }
        assert!(tiles.inside.len() > 3 && !tiles.across[0].eights.is_empty() && !tiles.far.eights.is_empty());
    }

    /// What a compliant spring does, one by one and in scalars, given what it has exerted.
    fn comply_one<T: Real>(
        places: &mut [[T; 4]],
        was: T::Vec3,
        ([i, j], rest, stiffness): ([u32; 2], T, T),
        compliance: &Compliance<T>,
        (tension, friction): &mut (T, T::Vec3),
    ) {
        let Compliance { square, along, all } = *compliance;
        let (i, j) = (i as usize, j as usize);
        let (a, b) = (places[i], places[j]);
        let w = a[3] + b[3];
        if w <= T::ZERO {
            return;
        }
        let d = point::<T>(&b) - point::<T>(&a);
        let length = d.length();
        let mut impulse = T::Vec3::ZERO;
        if length > T::ZERO {
            let k = square * stiffness;
            let stiff = (k + along) * w + T::ONE;
            let share = T::ONE / (stiff * length);
            let mut wanted = -(k * (length - rest)) - *tension;
            if along > T::ZERO {
                wanted = wanted - along * (d.dot(d - was) * (share * stiff));
            }
            let change = wanted * share;
            *tension += change * length;
            impulse = d * change;
        }
        if all > T::ZERO {
            let left = (d + impulse * w - was) * all;
            let change = (-left - *friction) * (T::ONE / (all * w + T::ONE));
            *friction += change;
            impulse += change;
        }
        places[i] = quad(point::<T>(&a) - impulse * a[3], a[3]);
        places[j] = quad(point::<T>(&b) + impulse * b[3], b[3]);
    }

    fn agree<T: Real>() {
        let (_, mut sweep) = tiles::<T>();
        let (springs, weights) = (in_order(&sweep), weights::<T>());
        let quads = |row: &[T::Vec3]| -> Vec<[T; 4]> {
            row.iter().zip(&weights).map(|(x, w)| quad(*x, *w)).collect()
        };
        let set_out = |sweep: &mut Tiles<T>, starts: &[T::Vec3]| {
            let still = vec![T::Vec3::ZERO; PARTICLES];
            sweep.set_out(starts, &still, &weights, T::ONE, 1);
            let rows = sweep.places.rows_mut();
            for (c, row) in rows.into_iter().enumerate() {
                row.iter_mut().enumerate().for_each(|(i, x)| *x = place::<T>(i, 1.0).to_array()[c]);
            }
        };
        let places = |sweep: &Tiles<T>| -> Vec<[T; 4]> {
            let [x, y, z] = sweep.places.rows();
            (0..PARTICLES).map(|i| [x[i], y[i], z[i], weights[i]]).collect()
        };
        let start = quads(&row::<T>(1.0));
        let mut one_by_one = start.clone();
        for _ in 0..2 {
            springs.iter().for_each(|(pair, rest, _)| relax_one(&mut one_by_one, *pair, *rest));
        }
        for parallel in [false, true] {
            set_out(&mut sweep, &row::<T>(0.9));
            sweep.relax(&weights, parallel);
            sweep.relax(&weights, parallel);
            assert_eq!(places(&sweep), one_by_one, "parallel: {parallel}");
        }
        let starts = row::<T>(0.9);
        for (along, all) in [(0.0, 0.0), (0.3, 0.0), (0.0, 0.2)] {
            let compliance =
                Compliance { square: T::from_f64(1e-3), along: T::from_f64(along), all: T::from_f64(all) };
            let mut one_by_one = start.clone();
            let mut exerted = vec![(T::ZERO, T::Vec3::ZERO); springs.len()];
            for _ in 0..3 {
                for (spring, exerted) in springs.iter().zip(&mut exerted) {
                    let [i, j] = spring.0.map(|p| starts[p as usize]);
                    comply_one(&mut one_by_one, j - i, *spring, &compliance, exerted);
                }
            }
            assert!(one_by_one.iter().flatten().all(|x| x.to_f64().is_finite()));
            for parallel in [false, true] {
                set_out(&mut sweep, &starts);
                sweep.begin(&compliance);
                for number in 0..3 {
                    let turn = Turn { is_first: number == 0, is_last: number == 2 };
                    sweep.comply(&weights, &compliance, turn, parallel);
                }
                assert_eq!(places(&sweep), one_by_one, "damping {along} along, {all} in all directions");
            }
        }
    }

    #[test]
    fn tiles_eights_and_threads_give_the_bits_of_one_by_one() {
        agree::<f32>();
        agree::<f64>();
    }

    /// The first tile, with its rows of places.
    fn here<'a, T: Real>(places: &'a mut [Vec<T>; 3], weights: &'a [T]) -> Here<'a, T> {
        let places = places.each_mut().map(|row| &mut row[..]);
        Here { places, weights, starts: [weights; 3] }
    }

    fn plain<T: Real>() {
        let (_, mut sweep) = tiles::<T>();
        let weights = weights::<T>();
        let component =
            |c: usize| -> Vec<T> { (0..sweep.tile).map(|i| place::<T>(i, 1.0).to_array()[c]).collect() };
        let start = [component(0), component(1), component(2)];
        let (mut one, mut other) = (start.clone(), start.clone());
        let part = &sweep.inside[0];
        Relax { part, here: here(&mut one, &weights) }.run::<Plain<T>>(());
        lanes::run(Relax { part, here: here(&mut other, &weights) });
        assert_eq!(one, other);
        let compliance = Compliance { square: T::ONE, along: T::ZERO, all: T::ONE };
        sweep.begin(&compliance);
        let (part, turn) = (&mut sweep.inside[0], Turn { is_first: true, is_last: false });
        Comply { part, here: here(&mut one, &weights), compliance, turn }.run::<Plain<T>>(());
        let exerted = (part.tension.clone(), part.friction.clone());
        lanes::run(Comply { part, here: here(&mut other, &weights), compliance, turn });
        assert_eq!(one, other);
        assert_eq!((&part.tension, &part.friction), (&exerted.0, &exerted.1));
        assert!(one != start);
    }

    #[test]
    fn a_sweep_in_plain_arrays_gives_the_same_bits() {
        plain::<f32>();
        plain::<f64>();
    }
}
