//! The order of the springs of a part, in eights that share no particle.
//!
//! Springs of a kind that lead equally far ahead alternate: of a chain every other one is put right, then those between. That is
//! red and black order (Young, "Iterative methods for solving partial difference equations of elliptic type", 1954); from one
//! end of the chain to the other, a damped sheet shook itself apart at a dt of 1 s, where this order holds it.

use super::tiles::{Part, Shape};
use crate::math::Real;
use crate::math::lanes::LANES;
use crate::model::Springs;

/// Springs that a row needs at least: with fewer, those that are put together as they fit are sooner done.
const ROW: usize = 3;

/// What parts are made of.
pub(super) struct Source<'a, T: Real> {
    pub springs: &'a Springs<T>,
    /// By spring, N/m.
    pub stiffness: Vec<T>,
}

impl<'a, T: Real> Source<'a, T> {
    pub fn new(springs: &'a Springs<T>) -> Self {
        Self { springs, stiffness: springs.stiffness_of_each() }
    }

    /// The chosen springs, all of them between so many particles from `first` on.
    pub fn part(&self, chosen: &[u32], first: usize, particles: usize) -> Part<T> {
        let (mut part, mut rest) = (Part::default(), Vec::new());
        // Way, first particle and number.
        let mut ways: Vec<(u32, u32, u32)> = Vec::new();
        let mut alternate = Vec::new();
        for group in &self.springs.groups {
            let begin = chosen.partition_point(|s| (*s as usize) < group.range.start);
            let end = chosen.partition_point(|s| (*s as usize) < group.range.end);
            ways.clear();
            ways.extend(chosen[begin..end].iter().map(|s| {
                let [i, j] = self.springs.pairs[*s as usize];
                (j - i, i - first as u32, *s)
            }));
            ways.sort_unstable();
            for springs in ways.chunk_by(|a, b| a.0 == b.0) {
                let way = springs[0].0;
                for between in [0, 1] {
                    alternate.clear();
                    let chosen = springs.iter().filter(|(_, i, _)| i / way % 2 == between);
                    alternate.extend(chosen.map(|(_, i, spring)| (*i, *spring)));
                    self.neighbours(way, &alternate, particles as u32, &mut part, &mut rest);
                }
            }
        }
        rest.sort_unstable();
        self.fit(&rest, first, particles, &mut part);
        part
    }

    /// Springs of one way that share no particle, each with its first one, among so many particles: those of which too few
    /// stand side by side go to the `rest`.
    fn neighbours(
        &self,
        way: u32,
        springs: &[(u32, u32)],
        particles: u32,
        part: &mut Part<T>,
        rest: &mut Vec<u32>,
    ) {
        let row: [usize; LANES] = std::array::from_fn(|lane| lane);
        // Where in each eight springs begin, by lane, how many particles it reaches over, and what it may be moved by.
        let (shape, lanes, reach, apart) = match way {
            1 => (Shape::Comb1, T::TEETH[0], 2 * LANES as u32, 2),
            2 => (Shape::Comb2, T::TEETH[1], 2 * LANES as u32, 4),
            _ => (Shape::Row, row, way + LANES as u32, 1),
        };
        let length = if shape == Shape::Row { LANES as u32 } else { reach };
        let mut left = springs;
        while let [(i, _), ..] = left {
            let mut from = if shape == Shape::Row { *i } else { i - i % way };
            // At the end of the part eights begin sooner, so that they stay inside.
            let beyond = (from + reach).saturating_sub(particles).next_multiple_of(apart);
            if beyond <= from && i + beyond < from + length {
                from -= beyond;
            }
            let (eight, others) = left.split_at(left.partition_point(|(i, _)| *i < from + length));
            left = others;
            let is_between = shape == Shape::Row && way < LANES as u32;
            if eight.len() < ROW || from + reach > particles || is_between {
                rest.extend(eight.iter().map(|(_, spring)| *spring));
                continue;
            }
            let spring = |at: usize| eight.iter().find(|(i, _)| i - from == at as u32);
            let to = if shape == Shape::Row { from + way } else { from };
            part.push(shape, [from, to], lanes.map(|at| spring(at).map(|(_, spring)| *spring)), self);
        }
    }

    /// Springs in eights as they fit, all of them between so many particles from `first` on.
    pub fn fit(&self, chosen: &[u32], first: usize, particles: usize, part: &mut Part<T>) {
        let ends = |spring: u32| self.springs.pairs[spring as usize].map(|p| p - first as u32);
        for eight in eights(&ends, chosen, particles) {
            let end = |end: usize| eight.map(|s| ends(s)[end]);
            let number = part.apart.len() as u32;
            part.apart.push([end(0), end(1)]);
            part.push(Shape::Apart, [number; 2], eight.map(Some), self);
        }
    }
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
/// by a bit which open groups hold it.
fn eights(ends: &impl Fn(u32) -> [u32; 2], chosen: &[u32], particles: usize) -> Vec<[u32; LANES]> {
    if chosen.is_empty() {
        return Vec::new();
    }
    let mut holds = vec![0_u32; particles];
    let mut open: [Vec<u32>; OPEN] = std::array::from_fn(|_| Vec::with_capacity(GROUP));
    let mut eights = Vec::with_capacity(chosen.len().div_ceil(LANES) + OPEN);
    let ends = |spring: u32| ends(spring).map(|p| p as usize);
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
            close(number, &mut open[number], &mut holds);
        }
        open[number].push(spring);
        holds[i] |= 1 << number;
        holds[j] |= 1 << number;
        if open[number].len() == GROUP {
            close(number, &mut open[number], &mut holds);
        }
    }
    for (number, group) in open.iter_mut().enumerate() {
        close(number, group, &mut holds);
    }
    eights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Topology;
    use crate::simulators::colouring::tests::star_and_ring;

    #[test]
    fn eight_springs_that_fit_share_no_particle() {
        let sheet = Topology::of(&crate::target::grid(100, 41, 0.1, false));
        let stars = [3, 40, 200].map(star_and_ring);
        for pairs in stars.into_iter().chain([sheet.pairs.concat()]) {
            let chosen: Vec<u32> = (0..pairs.len() as u32).collect();
            let mut all = Vec::new();
            for eight in eights(&|spring| pairs[spring as usize], &chosen, 4100) {
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
        }
    }
}
