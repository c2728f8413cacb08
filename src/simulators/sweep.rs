//! Sweeps: springs that are put right one after the other, each seeing what those before it did, as rigid or as compliant
//! constraints.
//!
//! A sweep is a chain: what a spring does waits for the one before it where they share a particle. Two things break it, and
//! both are part of the order, so that a sweep gives the same bits on any machine and number of threads:
//!
//! - Particles are cut into tiles in the order in which they are stored. First come the springs inside of the tiles, then those
//!   across the border of two neighbours, then the few that lead farther. Tiles share no particle, nor do the strips along
//!   borders: threads may take a tile or a strip each.
//! - Inside of these, eight springs in a row share no particle and are worked on at once ([`wide`]), and neither do a few such
//!   eights one after the other, so that none waits for what the one before it is still computing.

mod wide;

use crate::forces::Problem;
use crate::math::lanes::LANES;
use crate::math::parts::each_particle;
use crate::math::{Real, Vector, lanes};
use crate::model::Particles;
use rayon::prelude::*;

/// Least number of particles in a tile: few enough for the first cache, many beside those at the borders.
const TILE: usize = 1024;

/// The particles that a sweep moves, and the springs in its order.
#[derive(Debug, Default)]
pub(super) struct Sweep<T: Real> {
    /// The problem's revision that the springs were taken from, and in which order.
    taken: (u64, Order),
    /// Particles in a tile.
    tile: usize,
    /// The springs inside of each tile.
    tiles: Vec<Part<T>>,
    /// Those across its border to the next.
    strips: Vec<Part<T>>,
    /// Those that lead farther.
    far: Part<T>,
    /// All springs in a chain, where that is the order.
    chain: Vec<([u32; 2], T)>,
    /// Where each particle is, m, and the weight by which it gives way: 0 does not move.
    places: Vec<[T; 4]>,
    /// Where each particle was at the start of the step, m.
    starts: Vec<[T; 4]>,
}

/// The order of a sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Order {
    #[default]
    Unknown,
    Creation,
    Tiles,
}

/// Springs in eights, lane by lane. A lane for which there is no spring does what the first one does.
#[derive(Debug, Default)]
struct Part<T: Real> {
    /// Their two particles, counted from the first one of the part.
    pairs: Vec<[[u32; LANES]; 2]>,
    /// Rest lengths, m.
    rest: Vec<[T; LANES]>,
    /// Stiffnesses, N/m.
    stiffness: Vec<[T; LANES]>,
    /// Impulse that each compliant spring has exerted along itself, N s · s.
    tension: Vec<[T; LANES]>,
    /// The same of its damping, by component.
    friction: Vec<[[T; LANES]; 3]>,
}

/// What compliant springs are in a step of h.
#[derive(Clone, Copy, Debug)]
pub(super) struct Compliance<T> {
    /// h², s².
    pub square: T,
    /// h k_d of damping along the spring, kg.
    pub along: T,
    /// h k_d of damping in all directions, kg.
    pub all: T,
}

/// Which of the sweeps of a step it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    /// No spring has exerted anything yet.
    pub is_first: bool,
    /// Nobody asks any more what springs have exerted.
    pub is_last: bool,
}

impl<T: Real> Sweep<T> {
    /// Takes the springs of a problem tile by tile, unless they are here already.
    pub fn in_tiles(&mut self, problem: &Problem<T>) {
        if self.taken == (problem.revision(), Order::Tiles) {
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
        let stiffness = springs.stiffness_of_each();
        let mut holds = vec![0; particles];
        let mut part = |chosen: &[u32], first: usize| {
            let mut part = Part::default();
            for eight in eights(&springs.pairs, chosen, &mut holds) {
                let end = |end: usize| eight.map(|s| springs.pairs[s as usize][end] - first as u32);
                part.pairs.push([end(0), end(1)]);
                part.rest.push(eight.map(|s| springs.rest[s as usize]));
                part.stiffness.push(eight.map(|s| stiffness[s as usize]));
            }
            part
        };
        self.tiles = (0..).zip(&inside).map(|(number, chosen)| part(chosen, number * tile)).collect();
        self.strips = (0..).zip(&across).map(|(number, chosen)| part(chosen, number * tile + half)).collect();
        self.far = part(&far, 0);
        self.chain.clear();
        self.taken = (problem.revision(), Order::Tiles);
    }

    /// Takes the springs of a problem in the order in which they were made, unless they are here already.
    pub fn by_creation(&mut self, problem: &Problem<T>) {
        if self.taken == (problem.revision(), Order::Creation) {
            return;
        }
        let springs = &problem.springs;
        let mut order: Vec<usize> = (0..springs.len()).collect();
        order.sort_unstable_by_key(|s| springs.ids[*s]);
        self.chain.clear();
        self.chain.extend(order.into_iter().map(|s| (springs.pairs[s], springs.rest[s])));
        (self.tiles, self.strips, self.far) = (Vec::new(), Vec::new(), Part::default());
        self.taken = (problem.revision(), Order::Creation);
    }

    /// The places of so many particles, to be filled in.
    pub fn places(&mut self, particles: usize) -> &mut [[T; 4]] {
        self.places.resize(particles, [T::ZERO; 4]);
        &mut self.places
    }

    /// Takes the particles of a step of `h` (s) to their places; v = (x - start) / h where they can move.
    pub fn leave(&self, state: &mut Particles<T>, h: T, inverse_mass: &[T], threads: usize) {
        let moved = (&mut state.positions[..], &mut state.velocities[..], &self.places[..], inverse_mass);
        each_particle(moved, threads, |(positions, velocities, places, inverse_mass)| {
            let places = places.iter().zip(inverse_mass);
            for ((x, v), (place, &w)) in positions.iter_mut().zip(velocities).zip(places) {
                let start = std::mem::replace(x, point(place));
                if w > T::ZERO {
                    *v = (*x - start) * (T::ONE / h);
                }
            }
        });
    }

    /// Puts every spring to its rest length; of the correction each end makes the share w_i / (w_i + w_j).
    pub fn relax(&mut self, parallel: bool) {
        self.each(parallel, |part, places, _| lanes::run(wide::Relax { part, places }));
        for &(pair, rest) in &self.chain {
            relax_one(&mut self.places, pair, rest);
        }
    }

    /// Begins the step of compliant springs from these positions.
    pub fn begin(&mut self, start: &[T::Vec3], compliance: &Compliance<T>, threads: usize) {
        let is_damped = compliance.all > T::ZERO;
        for part in self.tiles.iter_mut().chain(&mut self.strips).chain([&mut self.far]) {
            let eights = part.pairs.len();
            part.tension.resize(eights, [T::ZERO; LANES]);
            part.friction.resize(if is_damped { eights } else { 0 }, [[T::ZERO; LANES]; 3]);
        }
        if is_damped || compliance.along > T::ZERO {
            self.starts.resize(start.len(), [T::ZERO; 4]);
            each_particle((&mut self.starts[..], start), threads, |(starts, from)| {
                starts.iter_mut().zip(from).for_each(|(start, x)| *start = quad(*x, T::ZERO));
            });
        } else {
            self.starts.clear();
        }
    }

    /// Lets every spring exert what its compliance and its damping still want.
    pub fn comply(&mut self, compliance: &Compliance<T>, turn: Turn, parallel: bool) {
        let compliance = *compliance;
        self.each(parallel, |part, places, starts| {
            lanes::run(wide::Comply { part, places, starts, compliance, turn });
        });
    }

    /// Works on every part, with the places of its particles and where those were, in the order of the sweep.
    fn each(&mut self, parallel: bool, work: impl Fn(&mut Part<T>, &mut [[T; 4]], &[[T; 4]]) + Sync) {
        let Self { tile, tiles, strips, far, places, starts, .. } = self;
        let (tile, half) = (*tile, *tile / 2);
        if tiles.is_empty() {
            return;
        }
        let from = |first: usize| starts.get(first..).unwrap_or_default();
        let of_tile = |(number, (part, places)): (usize, (&mut Part<T>, &mut [[T; 4]]))| {
            work(part, places, from(number * tile));
        };
        let of_strip = |(number, (part, places)): (usize, (&mut Part<T>, &mut [[T; 4]]))| {
            work(part, places, from(number * tile + half));
        };
        let behind = half.min(places.len());
        if parallel {
            tiles.par_iter_mut().zip(places.par_chunks_mut(tile)).enumerate().for_each(of_tile);
            strips.par_iter_mut().zip(places[behind..].par_chunks_mut(tile)).enumerate().for_each(of_strip);
        } else {
            tiles.iter_mut().zip(places.chunks_mut(tile)).enumerate().for_each(of_tile);
            strips.iter_mut().zip(places[behind..].chunks_mut(tile)).enumerate().for_each(of_strip);
        }
        work(far, places, starts);
    }
}

/// Puts one spring to its rest length.
fn relax_one<T: Real>(places: &mut [[T; 4]], pair: [u32; 2], rest: T) {
    let [i, j] = pair.map(|p| p as usize);
    let (a, b) = (places[i], places[j]);
    let w = a[3] + b[3];
    let d = point::<T>(&b) - point::<T>(&a);
    let length = d.length();
    if w > T::ZERO && length > T::ZERO {
        let correction = d * ((length - rest) / (length * w));
        places[i] = quad(point::<T>(&a) + correction * a[3], a[3]);
        places[j] = quad(point::<T>(&b) - correction * b[3], b[3]);
    }
}

/// A place, and a weight.
pub(super) fn quad<T: Real>(x: T::Vec3, w: T) -> [T; 4] {
    let [x, y, z] = x.to_array();
    [x, y, z, w]
}

fn point<T: Real>(&[x, y, z, _]: &[T; 4]) -> T::Vec3 {
    T::Vec3::from_array([x, y, z])
}

/// Springs of a group that share no particle: a few eights, one after the other.
const GROUP: usize = 4 * LANES;
/// Groups that are open at a time: with more a spring sooner finds one, with fewer those that are next to each other in the
/// mesh stay so.
const OPEN: usize = 24;

/// The chosen springs in eights that share no particle, nor do neighbouring ones mostly; where one has fewer than eight, its
/// first spring stands in all other lanes.
///
/// First fit (as in graph colouring: Welsh and Powell, "An upper bound for the chromatic number of a graph and its application
/// to timetabling problems", 1967) into groups that are open, in time linear in the springs. `holds` tells for each particle
/// by a bit which open groups hold it: none at the beginning and at the end.
fn eights(pairs: &[[u32; 2]], chosen: &[u32], holds: &mut [u32]) -> Vec<[u32; LANES]> {
    let mut open: [Vec<u32>; OPEN] = std::array::from_fn(|_| Vec::with_capacity(GROUP));
    let mut eights = Vec::with_capacity(chosen.len().div_ceil(LANES) + OPEN);
    let ends = |spring: u32| pairs[spring as usize].map(|p| p as usize);
    let mut close = |number: usize, group: &mut Vec<u32>, holds: &mut [u32]| {
        for springs in group.chunks(LANES) {
            eights.push(std::array::from_fn(|lane| springs.get(lane).copied().unwrap_or(springs[0])));
        }
        for end in group.drain(..).flat_map(ends) {
            holds[end] &= !(1 << number);
        }
    };
    for &spring in chosen {
        let [i, j] = ends(spring);
        let mut number = (!(holds[i] | holds[j])).trailing_zeros() as usize;
        if number >= OPEN {
            number = (0..OPEN).max_by_key(|number| open[*number].len()).unwrap_or(0);
            close(number, &mut open[number], holds);
        }
        open[number].push(spring);
        holds[i] |= 1 << number;
        holds[j] |= 1 << number;
        if open[number].len() == GROUP {
            close(number, &mut open[number], holds);
        }
    }
    for (number, group) in open.iter_mut().enumerate() {
        close(number, group, holds);
    }
    eights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forces::{SpringSet, springs::SpringParams};
    use crate::math::lanes::{Kernel, Plain};
    use crate::model::Topology;
    use glam::DVec3;

    fn star_and_ring(spokes: u32) -> Vec<[u32; 2]> {
        let spokes_of_hub = (1..=spokes).map(|i| [0, i]);
        spokes_of_hub.chain((1..spokes).map(|i| [i, i + 1])).collect()
    }

    const PARTICLES: usize = 100 * 41;

    fn sheet() -> Topology {
        Topology::of(&crate::target::grid(100, 41, 0.1, false))
    }

    #[test]
    fn eight_springs_in_a_row_share_no_particle() {
        let stars = [3, 40, 200].map(star_and_ring);
        for pairs in stars.into_iter().chain([sheet().pairs.concat()]) {
            let chosen: Vec<u32> = (0..pairs.len() as u32).collect();
            let mut holds = vec![0; PARTICLES];
            let mut all = Vec::new();
            for eight in eights(&pairs, &chosen, &mut holds) {
                let others = eight[1..].iter().filter(|s| **s != eight[0]);
                let springs: Vec<u32> = eight[..1].iter().chain(others).copied().collect();
                let mut ends: Vec<u32> = springs.iter().flat_map(|s| pairs[*s as usize]).collect();
                ends.sort_unstable();
                ends.dedup();
                assert_eq!(ends.len(), 2 * springs.len());
                all.extend(springs);
            }
            all.sort_unstable();
            assert_eq!(all, chosen);
            assert!(holds.iter().all(|groups| *groups == 0));
        }
    }

    /// Springs with two that have no length, and a hundred particles that do not move.
    fn place<T: Real>(i: usize, scale: f64) -> T::Vec3 {
        let t = if i % 97 == 96 { i as f64 - 1.0 } else { i as f64 };
        T::Vec3::from_f64(DVec3::new((t * 0.7).sin(), (t * 1.3).cos(), (t * 2.1).sin()) * scale)
    }

    /// A sheet in tiles, with some springs that lead far.
    fn tiles<T: Real>() -> (Problem<T>, Sweep<T>) {
        let mut topology = sheet();
        topology.pairs[2].extend([[7, 3000], [8, 2500], [9, 4000], [50, 2000]]);
        topology.pairs[2].sort_unstable();
        let rest: Vec<T::Vec3> = (0..PARTICLES).map(|i| place::<T>(i, 0.7)).collect();
        let params = SpringParams::default();
        let set = SpringSet { topology: &topology, rest_positions: &rest, params: &params, broken: &[] };
        let problem = Problem::new(vec![T::ONE; PARTICLES], &set);
        let mut sweep = Sweep::default();
        sweep.in_tiles(&problem);
        let positions: Vec<T::Vec3> = (0..PARTICLES).map(|i| place::<T>(i, 1.0)).collect();
        let weight = |i: usize| T::from_f64(if i < 100 { 0.0 } else { (i as f64 * 0.37).cos().abs() * 0.8 });
        let places = sweep.places(PARTICLES).iter_mut().enumerate();
        places.for_each(|(i, place)| *place = quad(positions[i], weight(i)));
        (problem, sweep)
    }

    /// Every spring of a sweep, in its order, with its particles, rest length and stiffness.
    fn in_order<T: Real>(sweep: &Sweep<T>) -> Vec<([u32; 2], T, T)> {
        let (tile, half) = (sweep.tile as u32, sweep.tile as u32 / 2);
        let tiles = (0..).zip(&sweep.tiles).map(|(number, part)| (number * tile, part));
        let strips = (0..).zip(&sweep.strips).map(|(number, part)| (number * tile + half, part));
        let mut springs = Vec::new();
        for (first, part) in tiles.chain(strips).chain([(0, &sweep.far)]) {
            for (([i, j], rest), stiffness) in part.pairs.iter().zip(&part.rest).zip(&part.stiffness) {
                for lane in 0..LANES {
                    let pair = [i[lane] + first, j[lane] + first];
                    if lane == 0 || pair != [i[0] + first, j[0] + first] {
                        springs.push((pair, rest[lane], stiffness[lane]));
                    }
                }
            }
        }
        springs
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
            let n = d * (T::ONE / length);
            let k = square * stiffness;
            let mut wanted = -(k * (length - rest)) - *tension;
            if along > T::ZERO {
                wanted = wanted - along * n.dot(d - was);
            }
            let change = wanted / ((k + along) * w + T::ONE);
            *tension += change;
            impulse = n * change;
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
        let (problem, mut sweep) = tiles::<T>();
        let springs = in_order(&sweep);
        assert_eq!(springs.len(), problem.springs.len());
        assert!(sweep.tiles.len() > 3 && !sweep.strips[0].pairs.is_empty() && !sweep.far.pairs.is_empty());
        let mut one_by_one = sweep.places.clone();
        for _ in 0..2 {
            springs.iter().for_each(|(pair, rest, _)| relax_one(&mut one_by_one, *pair, *rest));
        }
        let start = sweep.places.clone();
        for parallel in [false, true] {
            sweep.places.clone_from(&start);
            sweep.relax(parallel);
            sweep.relax(parallel);
            assert_eq!(sweep.places, one_by_one, "parallel: {parallel}");
        }
        let starts: Vec<T::Vec3> = (0..PARTICLES).map(|i| place::<T>(i, 0.9)).collect();
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
                sweep.places.clone_from(&start);
                sweep.begin(&starts, &compliance, 1);
                for number in 0..3 {
                    let turn = Turn { is_first: number == 0, is_last: number == 2 };
                    sweep.comply(&compliance, turn, parallel);
                }
                assert_eq!(sweep.places, one_by_one, "damping {along} along, {all} in all directions");
            }
        }
    }

    #[test]
    fn tiles_eights_and_threads_give_the_bits_of_one_by_one() {
        agree::<f32>();
        agree::<f64>();
    }

    #[test]
    fn a_sweep_in_plain_arrays_gives_the_same_bits() {
        let (_, mut sweep) = tiles::<f32>();
        let mut plain = sweep.places.clone();
        let part = &sweep.tiles[0];
        wide::Relax { part, places: &mut plain }.run::<Plain<f32>>(());
        lanes::run(wide::Relax { part, places: &mut sweep.places });
        assert_eq!(plain, sweep.places);
    }
}
