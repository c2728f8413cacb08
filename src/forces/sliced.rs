//! The springs in slices of eight particles, and the force pass over them: eight springs at once, each computed once.
//!
//! On a mesh that is numbered along its rows the springs of a kind from eight particles that stand in a row lead to eight
//! others in a row nearly always. Such a *row* of springs is read as it stands, eight pulls are computed side by side, given
//! to the ones and taken from the others. A bit for each lane tells where the row has a spring: it may have holes, as where
//! the rows of a sheet end. Springs that share their way with too few others are *loose*: each of their particles computes
//! them for itself, first springs side by side, then second ones (sliced ELLPACK: Monakov, Lokhmotov, Avetisyan, "Automatically
//! tuning sparse matrix-vector multiplication for GPU architectures", 2010).
//!
//! Rows stand in blocks of [`BLOCK`] particles, way by way: two rows of one way never write to the same place, and those of
//! another way come so much later that what they read has left the processor's store buffer. What is given and what is
//! taken are summed apart for the same reason.
//!
//! What the springs do stands in [`pulls`] (forces) and [`linear`] (products with the matrix of an implicit step); how they are
//! gone over, in [`pass`]; and how particles take a step on the way, in [`advance`].

mod advance;
mod linear;
mod loads;
mod pass;
mod pulls;

pub use advance::{Ahead, Update};
pub use linear::{Linear, Step};
pub use loads::Loads;
pub use pass::Window;
pub use pulls::Stretched;

use crate::math::Real;
use crate::math::lanes::LANES;
use crate::model::{Incidence, Springs};

/// Springs that a row needs at least: with fewer, computing them twice among the loose ones costs less.
const ROW: usize = 3;
/// Particles in a block: a way's rows in it take longer than a store needs to reach the cache.
pub const BLOCK: usize = 16 * LANES;
/// Particles in a window. A power of two, so that masking an index shows that it is inside.
const SPAN: usize = 8192;
/// So much longer is a component, which also leaves room for the last row: at distances near a multiple of 4 KiB processors take
/// what is read for what was just written, and keep only few such lines in the first cache.
const APART: usize = 216;
/// All lanes of a row.
const ALL: u32 = (1 << LANES) - 1;
/// How many particles a window moves on at a time beside its reach: as few as make moving it cheap.
const SLACK: usize = 64;
/// How far ahead rows may lead: longer ways are loose.
const FARTHEST: u32 = SPAN as u32 / 2;

/// Springs from eight particles in a row to eight in a row.
#[derive(Clone, Copy, Debug)]
struct Row {
    /// The first of the ones.
    from: u32,
    /// The first of the others, further on.
    to: u32,
    /// A bit for each lane that has a spring.
    lanes: u32,
}

/// Springs in slices.
#[derive(Clone, Debug)]
pub struct Slices<T: Real> {
    /// Kinds of springs.
    groups: usize,
    /// End of the rows of each block, group by group.
    row_ends: Vec<u32>,
    rows: Vec<Row>,
    /// Rest lengths by row, m.
    row_rest: Vec<[T; LANES]>,
    /// End of the lists of loose springs of each slice, group by group; empty where none is loose.
    list_ends: Vec<u32>,
    /// Where they lead to: a lane without a spring to the particle itself, so without length and speed.
    lists: Vec<[u32; LANES]>,
    list_rest: Vec<[T; LANES]>,
    /// How far behind the first particle of a block anything ends that its rows lead to.
    reach: usize,
}

impl<T: Real> Slices<T> {
    /// The springs of so many particles; those of a group sorted by their pairs, as [`Springs`] keeps them.
    pub fn new(particles: usize, springs: &Springs<T>) -> Self {
        let mut slices = Self {
            groups: springs.groups.len(),
            row_ends: Vec::with_capacity(particles.div_ceil(BLOCK) * springs.groups.len()),
            rows: Vec::with_capacity(springs.len() / LANES),
            row_rest: Vec::with_capacity(springs.len() / LANES),
            list_ends: Vec::new(),
            lists: Vec::new(),
            list_rest: Vec::new(),
            reach: BLOCK,
        };
        // What is not there is never found too long.
        let none = T::from_f64(f64::INFINITY);
        let mut loose = Vec::new();
        let mut next: Vec<usize> = springs.groups.iter().map(|group| group.range.start).collect();
        // Way, first particle and number of each spring of a block.
        let mut block: Vec<(u32, u32, u32)> = Vec::with_capacity(8 * BLOCK);
        for end in (0..particles).step_by(BLOCK).map(|own| (own + BLOCK) as u32) {
            for (group, next) in springs.groups.iter().zip(&mut next) {
                let left = &springs.pairs[*next..group.range.end];
                let here = left.iter().take_while(|pair| pair[0] < end);
                block.clear();
                block.extend((*next as u32..).zip(here).map(|(spring, [i, j])| (j - i, *i, spring)));
                *next += block.len();
                block.sort_unstable();
                for row in block.chunk_by(|a, b| a.0 == b.0 && a.1 / LANES as u32 == b.1 / LANES as u32) {
                    let (way, i, _) = row[0];
                    if row.len() < ROW || way > FARTHEST {
                        loose.extend(row.iter().map(|(_, _, spring)| *spring));
                        continue;
                    }
                    let from = i - i % LANES as u32;
                    let (mut lanes, mut rest) = (0, [none; LANES]);
                    for (_, i, spring) in row {
                        lanes |= 1 << (i - from);
                        rest[(i - from) as usize] = springs.rest[*spring as usize];
                    }
                    slices.rows.push(Row { from, to: from + way, lanes });
                    slices.row_rest.push(rest);
                    slices.reach = slices.reach.max(BLOCK + way as usize);
                }
                slices.row_ends.push(slices.rows.len() as u32);
            }
        }
        if !loose.is_empty() {
            loose.sort_unstable();
            slices.list(particles, springs, &loose);
        }
        slices
    }

    /// Lists the loose springs around each particle.
    fn list(&mut self, particles: usize, springs: &Springs<T>, loose: &[u32]) {
        let pairs: Vec<[u32; 2]> = loose.iter().map(|s| springs.pairs[*s as usize]).collect();
        let incidence = Incidence::new(particles, &pairs);
        let none = T::from_f64(f64::INFINITY);
        for slice in 0..particles.div_ceil(LANES) {
            let own = |lane: usize| (slice * LANES + lane).min(particles - 1);
            // What is left around each particle: the springs of the first groups stand first.
            let mut around: [&[[u32; 2]]; LANES] = std::array::from_fn(|lane| {
                if slice * LANES + lane < particles { incidence.around(own(lane)) } else { &[] }
            });
            for group in &springs.groups {
                loop {
                    let mut to = std::array::from_fn(|lane| own(lane) as u32);
                    let (mut rest, mut some) = ([none; LANES], false);
                    for (lane, around) in around.iter_mut().enumerate() {
                        if let [[other, spring], left @ ..] = *around
                            && let spring = loose[*spring as usize] as usize
                            && group.range.contains(&spring)
                        {
                            (to[lane], rest[lane], some) = (*other, springs.rest[spring], true);
                            *around = left;
                        }
                    }
                    if !some {
                        break;
                    }
                    self.lists.push(to);
                    self.list_rest.push(rest);
                }
                self.list_ends.push(self.lists.len() as u32);
            }
        }
    }
}

/// Scratch and threads of a pass.
pub struct Means<'a, T> {
    pub windows: &'a mut Vec<Window<T>>,
    pub threads: usize,
}

/// Where the one before ends, which is where this one begins.
fn end_before(ends: &[u32], number: usize) -> usize {
    number.checked_sub(1).and_then(|last| ends.get(last)).map_or(0, |end| *end as usize)
}

#[cfg(test)]
mod tests;
