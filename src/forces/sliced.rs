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
//! The force on a particle is ((outside - taken) + given) + loose springs, each sum in the order of the rows, whatever the threads:
//! each has particles of its own, and a row that leads across is computed on both sides. Nothing that rows read and write
//! stands further ahead than [`Slices::reach`]: a window of components goes along with the blocks, small enough for the
//! caches.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::springs::pull;
use super::{air_damping, gravity};
use crate::math::lanes::{self, Kernel, LANES, Lanes};
use crate::math::{Real, Vector};
use crate::model::{Incidence, Particles, Springs};
use rayon::prelude::*;

/// Springs that a row needs at least: with fewer, computing them twice among the loose ones costs less.
const ROW: usize = 3;
/// Particles in a block: a way's rows in it take longer than a store needs to reach the cache.
const BLOCK: usize = 16 * LANES;
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

/// What else acts on eight particles, before the springs.
pub trait Outside<T: Real>: Copy + Sync {
    /// The forces (N) on the particles from the index `own` on, with the velocities given; `force` begins with what was there
    /// before.
    fn of<L: Lanes<Scalar = T>>(
        &self,
        with: L::Proof,
        own: usize,
        velocity: [L; 3],
        force: &[T::Vec3],
    ) -> [L; 3];
}

/// What was there before.
#[derive(Clone, Copy, Debug)]
pub struct Before;

impl<T: Real> Outside<T> for Before {
    #[inline(always)]
    fn of<L: Lanes<Scalar = T>>(&self, with: L::Proof, _: usize, _: [L; 3], force: &[T::Vec3]) -> [L; 3] {
        eight(with, force, 0)
    }
}

/// Gravity, wind and air.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a, T: Real> {
    /// kg.
    pub mass: &'a [T],
    /// m/s².
    pub gravity: T::Vec3,
    /// N.
    pub wind: T::Vec3,
    /// kg/s.
    pub air_damping: T,
}

impl<T: Real> Outside<T> for Surroundings<'_, T> {
    #[inline(always)]
    fn of<L: Lanes<Scalar = T>>(
        &self,
        with: L::Proof,
        own: usize,
        velocity: [L; 3],
        _: &[T::Vec3],
    ) -> [L; 3] {
        let mass = masses(with, &self.mass[own..]);
        let (zero, air) = (L::splat(with, T::ZERO), L::splat(with, self.air_damping));
        let ([gx, gy, gz], [wx, wy, wz]) = (self.gravity.to_array(), self.wind.to_array());
        let [vx, vy, vz] = velocity;
        // From +0, so that no particle of no force has -0.
        [
            zero + gravity::force(L::splat(with, gx), mass)
                + L::splat(with, wx)
                + air_damping::force(air, vx),
            zero + gravity::force(L::splat(with, gy), mass)
                + L::splat(with, wy)
                + air_damping::force(air, vy),
            zero + gravity::force(L::splat(with, gz), mass)
                + L::splat(with, wz)
                + air_damping::force(air, vz),
        ]
    }
}

/// The first eight masses, the last ones 0 where there are no more.
#[inline(always)]
fn masses<T: Real, L: Lanes<Scalar = T>>(with: L::Proof, mass: &[T]) -> L {
    if mass.len() >= LANES {
        L::load(with, mass)
    } else {
        let mut eight = [T::ZERO; LANES];
        eight[..mass.len()].copy_from_slice(mass);
        L::of(with, eight)
    }
}

/// The eight vectors from an index on, the last ones 0 where there are no more.
#[inline(always)]
fn eight<T: Real, L: Lanes<Scalar = T>>(with: L::Proof, vectors: &[T::Vec3], at: usize) -> [L; 3] {
    let vectors = &vectors[at..];
    if let Some(eight) = vectors.first_chunk() {
        L::vectors(with, eight)
    } else {
        let mut eight = [T::Vec3::ZERO; LANES];
        eight[..vectors.len()].copy_from_slice(vectors);
        L::vectors(with, &eight)
    }
}

impl<T: Real> Slices<T> {
    /// The springs of so many particles; those of a group sorted by their pairs, as [`Springs`] keeps them.
    pub fn new(particles: usize, springs: &Springs<T>) -> Self {
        let mut slices = Self {
            row_ends: Vec::with_capacity(particles.div_ceil(BLOCK) * springs.groups.len()),
            rows: Vec::with_capacity(springs.len() / LANES),
            row_rest: Vec::with_capacity(springs.len() / LANES),
            list_ends: Vec::new(),
            lists: Vec::new(),
            list_rest: Vec::new(),
            reach: BLOCK,
        };
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
                    let (mut lanes, mut rest) = (0, [T::ONE; LANES]);
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
        for slice in 0..particles.div_ceil(LANES) {
            let own = |lane: usize| (slice * LANES + lane).min(particles - 1);
            // What is left around each particle: the springs of the first groups stand first.
            let mut around: [&[[u32; 2]]; LANES] = std::array::from_fn(|lane| {
                if slice * LANES + lane < particles { incidence.around(own(lane)) } else { &[] }
            });
            for group in &springs.groups {
                loop {
                    let mut to = std::array::from_fn(|lane| own(lane) as u32);
                    let (mut rest, mut some) = ([T::ONE; LANES], false);
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

    /// Writes what acts on the particles from `outside` and from all springs over `force` (N), on so many threads of the
    /// current pool.
    #[expect(clippy::too_many_arguments, reason = "all that one pass reads and writes")]
    pub fn forces(
        &self,
        springs: &Springs<T>,
        damping: T,
        state: &Particles<T>,
        windows: &mut Vec<Window<T>>,
        force: &mut [T::Vec3],
        threads: usize,
        outside: impl Outside<T>,
    ) {
        let task = force.len().div_ceil(threads.max(1)).next_multiple_of(BLOCK);
        if windows.len() < threads {
            windows.resize_with(threads, Window::default);
        }
        let pass = |number: usize, window, force| {
            let first = number * task;
            lanes::run(Pass { slices: self, springs, damping, state, window, first, force, outside });
        };
        if threads > 1 {
            let tasks = force.par_chunks_mut(task).zip(windows).enumerate();
            tasks.for_each(|(number, (force, window))| pass(number, window, force));
        } else if let [window, ..] = &mut windows[..] {
            pass(0, window, force);
        }
    }
}

/// Positions, velocities, and what rows have given and taken, by component, of the particles about those that are worked on:
/// scratch of [`Slices::forces`].
#[derive(Debug)]
pub struct Window<T>(Box<[[[T; SPAN + APART]; 3]; 4]>);

/// What stands in a window, in this order.
const PLACES: usize = 0;
const SPEEDS: usize = 1;
const GIVEN: usize = 2;
const TAKEN: usize = 3;

impl<T: Real> Default for Window<T> {
    fn default() -> Self {
        let components = vec![[[T::ZERO; SPAN + APART]; 3]; 4].into_boxed_slice();
        Self(components.try_into().unwrap_or_else(|_| unreachable!("four of them")))
    }
}

/// The forces on the particles of some slices.
struct Pass<'a, T: Real, O> {
    slices: &'a Slices<T>,
    springs: &'a Springs<T>,
    damping: T,
    state: &'a Particles<T>,
    window: &'a mut Window<T>,
    /// The particle that `force` begins with, of a block the first.
    first: usize,
    force: &'a mut [T::Vec3],
    outside: O,
}

impl<T: Real, O: Outside<T>> Kernel<T> for Pass<'_, T, O> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        if self.damping > T::ZERO {
            self.go::<L, true>(with);
        } else {
            self.go::<L, false>(with);
        }
    }
}

impl<T: Real, O: Outside<T>> Pass<'_, T, O> {
    #[inline(always)]
    fn go<L: Lanes<Scalar = T>, const DAMPED: bool>(self, with: L::Proof) {
        let Self { slices, springs, damping, state, window, first, force, outside } = self;
        let damping = L::splat(with, damping);
        let groups = &springs.groups[..];
        let particles = state.len();
        // What leads into the first block begins no farther in front of it.
        let begin = first - slices.reach.next_multiple_of(BLOCK).min(first);
        let mut row = end_before(&slices.row_ends, begin / BLOCK * groups.len());
        let mut list = end_before(&slices.list_ends, first / LANES * groups.len());
        // The particle that the window begins with, and the first that is not in it yet.
        let (mut base, mut next) = (begin, begin);
        for block in (begin..first + force.len()).step_by(BLOCK) {
            if block + slices.reach > base + SPAN.min(2 * slices.reach + SLACK) {
                for component in window.0.as_flattened_mut() {
                    component.copy_within(block - base..next - base, 0);
                }
                base = block;
            }
            while next < (block + slices.reach).min(particles) {
                enter::<T, L>(with, window, next - base, state, next);
                next += LANES;
            }
            for (number, group) in groups.iter().enumerate() {
                let stiffness = L::splat(with, group.stiffness);
                let end = slices.row_ends[block / BLOCK * groups.len() + number] as usize;
                let rows = slices.rows[row..end].iter().zip(&slices.row_rest[row..end]);
                row = end;
                for (&Row { from, to, lanes }, rest) in rows {
                    let (from, to) = (from as usize - base, to as usize - base);
                    if block < first && to + LANES <= first - base {
                        continue;
                    }
                    let x = load::<T, L>(with, window, PLACES, from);
                    let there = load::<T, L>(with, window, PLACES, to);
                    let v = if DAMPED { load::<T, L>(with, window, SPEEDS, from) } else { x };
                    let speed = if DAMPED { load::<T, L>(with, window, SPEEDS, to) } else { x };
                    let rest = L::of(with, *rest);
                    let mut pulls = pull::<L, DAMPED>([x, there], [v, speed], stiffness, rest, damping);
                    if lanes != ALL {
                        pulls = [pulls[0].only(lanes), pulls[1].only(lanes), pulls[2].only(lanes)];
                    }
                    add::<T, L>(with, window, GIVEN, from, pulls);
                    add::<T, L>(with, window, TAKEN, to, pulls);
                }
            }
            if block < first {
                continue;
            }
            for own in (block..(block + BLOCK).min(particles)).step_by(LANES) {
                let x = load::<T, L>(with, window, PLACES, own - base);
                let v = load::<T, L>(with, window, SPEEDS, own - base);
                let given = load::<T, L>(with, window, GIVEN, own - base);
                let taken = load::<T, L>(with, window, TAKEN, own - base);
                let [ox, oy, oz] = outside.of::<L>(with, own, v, &force[own - first..]);
                let [mut fx, mut fy, mut fz] =
                    [ox - taken[0] + given[0], oy - taken[1] + given[1], oz - taken[2] + given[2]];
                if !slices.list_ends.is_empty() {
                    for (number, group) in groups.iter().enumerate() {
                        let stiffness = L::splat(with, group.stiffness);
                        let end = slices.list_ends[own / LANES * groups.len() + number] as usize;
                        for (to, rest) in slices.lists[list..end].iter().zip(&slices.list_rest[list..end]) {
                            let there = L::components(with, &state.positions, to);
                            let speed = if DAMPED { L::components(with, &state.velocities, to) } else { v };
                            let rest = L::of(with, *rest);
                            let [px, py, pz] =
                                pull::<L, DAMPED>([x, there], [v, speed], stiffness, rest, damping);
                            (fx, fy, fz) = (fx + px, fy + py, fz + pz);
                        }
                        list = end;
                    }
                }
                put::<T, L>([fx, fy, fz], &mut force[own - first..]);
            }
        }
    }
}

/// Where the one before ends, which is where this one begins.
fn end_before(ends: &[u32], number: usize) -> usize {
    number.checked_sub(1).and_then(|last| ends.get(last)).map_or(0, |end| *end as usize)
}

/// Writes eight vectors over the first ones of a slice, or over all where those are fewer.
#[inline(always)]
fn put<T: Real, L: Lanes<Scalar = T>>(values: [L; 3], to: &mut [T::Vec3]) {
    if let Some(to) = to.first_chunk_mut() {
        L::put_vectors(values, to);
    } else {
        let mut all = [T::Vec3::ZERO; LANES];
        L::put_vectors(values, &mut all);
        to.copy_from_slice(&all[..to.len()]);
    }
}

/// Eight vectors of a window from an index on.
#[inline(always)]
fn load<T: Real, L: Lanes<Scalar = T>>(with: L::Proof, window: &Window<T>, what: usize, at: usize) -> [L; 3] {
    let ([x, y, z], at) = (&window.0[what], at % SPAN);
    [L::load(with, &x[at..]), L::load(with, &y[at..]), L::load(with, &z[at..])]
}

/// Adds to eight vectors of a window.
#[inline(always)]
fn add<T: Real, L: Lanes<Scalar = T>>(
    with: L::Proof,
    window: &mut Window<T>,
    what: usize,
    at: usize,
    [x, y, z]: [L; 3],
) {
    let ([to_x, to_y, to_z], at) = (&mut window.0[what], at % SPAN);
    (L::load(with, &to_x[at..]) + x).store(&mut to_x[at..]);
    (L::load(with, &to_y[at..]) + y).store(&mut to_y[at..]);
    (L::load(with, &to_z[at..]) + z).store(&mut to_z[at..]);
}

/// Takes eight more particles into the window, to whom nothing was given yet.
#[inline(always)]
fn enter<T: Real, L: Lanes<Scalar = T>>(
    with: L::Proof,
    window: &mut Window<T>,
    at: usize,
    state: &Particles<T>,
    from: usize,
) {
    let positions = eight::<T, L>(with, &state.positions, from);
    let velocities = eight::<T, L>(with, &state.velocities, from);
    let nothing = L::splat(with, T::ZERO);
    let all = [positions, velocities, [nothing; 3], [nothing; 3]];
    for (components, values) in window.0.iter_mut().zip(all) {
        for (component, values) in components.iter_mut().zip(values) {
            values.store(&mut component[at % SPAN..]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{KindSettings, Topology};
    use glam::DVec3;

    /// The springs one by one, and for each particle the sum of the magnitudes with their number.
    fn scatter<T: Real>(
        springs: &Springs<T>,
        damping: T,
        state: &Particles<T>,
        force: &mut [T::Vec3],
    ) -> Vec<(f64, f64)> {
        let mut sums: Vec<(f64, f64)> = force.iter().map(|f| (f.to_f64().abs().max_element(), 1.0)).collect();
        for group in &springs.groups {
            for s in group.range.clone() {
                let [i, j] = springs.pairs[s].map(|p| p as usize);
                let d = state.positions[j] - state.positions[i];
                let length = d.length();
                let some = length > T::ZERO;
                let tension =
                    if some { group.stiffness * (length - springs.rest[s]) / length } else { T::ZERO };
                let f = d * tension + (state.velocities[j] - state.velocities[i]) * damping;
                force[i] += f;
                force[j] -= f;
                for end in [i, j] {
                    sums[end].0 += f.to_f64().abs().max_element();
                    sums[end].1 += 1.0;
                }
            }
        }
        sums
    }

    /// Pairs without rows: rings through all particles with strides of their own, so that degrees and distances differ.
    fn irregular(particles: u32) -> Topology {
        let ring = |stride: u32, every: u32| -> Vec<[u32; 2]> {
            let ends = (0..particles).step_by(every as usize).map(|i| [i, (i * stride + 1) % particles]);
            let mut pairs: Vec<_> = ends.filter(|[i, j]| i != j).map(|[i, j]| [i.min(j), i.max(j)]).collect();
            pairs.sort_unstable();
            pairs.dedup();
            pairs
        };
        Topology { pairs: [ring(7, 1), ring(13, 3), ring(1, 2)] }
    }

    fn agree<T: Real>(topology: &Topology, particles: usize, damping: f64) {
        let place = |i: usize, scale: f64| {
            let t = i as f64;
            // Every ninth particle stands where the one before it stands: springs without length.
            let t = if i % 9 == 8 { t - 1.0 } else { t };
            T::Vec3::from_f64(DVec3::new((t * 0.7).sin(), (t * 1.3).cos(), (t * 2.1).sin()) * scale)
        };
        let rest: Vec<T::Vec3> = (0..particles).map(|i| place(i, 1.0)).collect();
        let kinds = [1000.0, 300.0, 100.0].map(|stiffness| KindSettings {
            enabled: true,
            stiffness,
            rest_scale: 0.9,
        });
        let springs = Springs::<T>::new(topology, &rest, &kinds, &[3, 5]);
        let mut state = Particles::<T>::at_rest((0..particles).map(|i| place(i, 1.1)).collect());
        state.velocities = (0..particles).map(|i| place(i + 5, 2.0)).collect();
        let damping = T::from_f64(damping);
        let started = vec![place(3, 1.0); particles];
        let mut plain = started.clone();
        let sums = scatter(&springs, damping, &state, &mut plain);
        let slices = Slices::new(particles, &springs);
        let on = |threads| {
            let mut force = started.clone();
            slices.forces(&springs, damping, &state, &mut Vec::new(), &mut force, threads, Before);
            force
        };
        let force = on(1);
        // A sum of n terms in any order is within (n - 1) ε Σ|term| of the true one (Higham, "Accuracy and Stability of
        // Numerical Algorithms", 2002, 4.2), to first order in ε, here half the distance of two numbers.
        let epsilon = T::EPSILON.to_f64() / 2.0;
        for ((f, plain), (sum, terms)) in force.iter().zip(&plain).zip(sums) {
            let off = (f.to_f64() - plain.to_f64()).abs().max_element();
            assert!(off <= 2.0 * terms * epsilon * sum, "{off:e} of {sum}");
        }
        for threads in [2, 3, 8] {
            assert_eq!(on(threads), force, "{threads} threads");
        }
        let (mut without, mut window) = (started.clone(), Window::default());
        let pass = Pass {
            slices: &slices,
            springs: &springs,
            damping,
            state: &state,
            window: &mut window,
            first: 0,
            force: &mut without,
            outside: Before,
        };
        pass.run::<lanes::Plain<T>>(());
        assert_eq!(without, force, "in plain arrays");
    }

    #[test]
    fn the_pass_gives_the_sums_of_the_springs_on_any_machine_and_number_of_threads() {
        let sheet = Topology::of(&crate::target::grid(70, 41, 0.1, false));
        // So wide that the window has to move on.
        let long = Topology::of(&crate::target::grid(2500, 9, 0.1, false));
        for damping in [0.0, 2.0] {
            for particles in [2, 7, 8, 9, 1025, 9001] {
                agree::<f32>(&irregular(particles), particles as usize, damping);
                agree::<f64>(&irregular(particles), particles as usize, damping);
            }
            for (topology, particles) in [(&sheet, 70 * 41), (&long, 2500 * 9)] {
                agree::<f32>(topology, particles, damping);
                agree::<f64>(topology, particles, damping);
            }
        }
    }

    #[test]
    fn the_springs_of_a_sheet_stand_in_rows() {
        let mesh = crate::target::grid(70, 41, 0.1, false);
        let kinds = [KindSettings { enabled: true, stiffness: 1.0, rest_scale: 1.0 }; 3];
        let topology = Topology::of(&mesh);
        let springs = Springs::<f64>::new(&topology, &mesh.positions, &kinds, &[]);
        let slices = Slices::new(mesh.positions.len(), &springs);
        let in_rows: u32 = slices.rows.iter().map(|row| row.lanes.count_ones()).sum();
        // A loose spring is one of a way that at most two particles of a slice share: at the ends of the sheet's rows and in
        // the last slice.
        assert!(springs.len() - in_rows as usize <= 41 * 6 * 2, "{in_rows} of {}", springs.len());
    }
}
