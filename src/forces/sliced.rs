//! The springs in slices of eight particles, and the force pass on them: eight springs at once, bit for bit the same as
//! [`scatter`](super::springs::scatter).
//!
//! Every particle adds up the springs around itself, in their order: each spring is computed twice, but nothing is
//! written that another particle writes, so neither lanes nor threads change the order of a sum. Eight neighbouring
//! particles make up a slice, their first springs of a kind its first slot, their second ones the next (sliced ELLPACK:
//! Monakov, Lokhmotov, Avetisyan, "Automatically tuning sparse matrix-vector multiplication for GPU architectures", 2010).
//! Where a particle has no more springs its lane leads to itself: no length and no speed, so a force of 0.
//!
//! On a mesh that is numbered along its rows nearly all slots lead to eight neighbours in a row. Those are read as they
//! stand from an array for each component; the others are gathered one by one.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use crate::math::lanes::{Instructions, LANES, Lanes};
use crate::math::{Real, Vector};
use crate::model::{Incidence, Particles, Springs};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// Particles a task of a thread: whole slices.
const TASK: usize = 128 * LANES;

/// Where the eight springs of a slot lead to.
#[derive(Clone, Copy, Debug)]
enum Slot {
    /// To eight neighbours from this one on.
    Row(u32),
    /// To a list.
    List(u32),
}

/// Springs in slices.
#[derive(Clone, Debug)]
pub struct Slices<T: Real> {
    with: Instructions,
    /// End of the slots of each slice, group by group.
    ends: Vec<u32>,
    slots: Vec<Slot>,
    lists: Vec<[u32; LANES]>,
    /// Rest lengths by slot, m.
    rest: Vec<[T; LANES]>,
}

/// Positions and velocities by component, with room for whole slices: scratch of [`Slices::add`].
#[derive(Clone, Debug, Default)]
pub struct Components<T> {
    position: [Vec<T>; 3],
    velocity: [Vec<T>; 3],
}

impl<T: Real> Slices<T> {
    /// The springs of so many particles; none where the processor lacks the instructions.
    pub fn new(particles: usize, springs: &Springs<T>) -> Option<Self> {
        let with = Instructions::try_new()?;
        let incidence = Incidence::new(particles, &springs.pairs);
        let count = particles.div_ceil(LANES);
        let mut slices = Self {
            with,
            ends: Vec::with_capacity(count * springs.groups.len()),
            slots: Vec::new(),
            lists: Vec::new(),
            rest: Vec::new(),
        };
        for slice in 0..count {
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
                            && group.range.contains(&(*spring as usize))
                        {
                            (to[lane], rest[lane], some) = (*other, springs.rest[*spring as usize], true);
                            *around = left;
                        }
                    }
                    if !some {
                        break;
                    }
                    slices.push(to, rest);
                }
                slices.ends.push(slices.slots.len() as u32);
            }
        }
        Some(slices)
    }

    fn push(&mut self, to: [u32; LANES], rest: [T; LANES]) {
        let in_a_row = to.iter().zip(to[0]..).all(|(to, next)| *to == next);
        self.slots.push(if in_a_row {
            Slot::Row(to[0])
        } else {
            self.lists.push(to);
            Slot::List(self.lists.len() as u32 - 1)
        });
        self.rest.push(rest);
    }

    /// Lets `begin` write what else acts on the particles from some index on (N), and adds the forces of all springs to it;
    /// task by task, on the threads of the current pool where `parallel` says so.
    #[expect(clippy::too_many_arguments, reason = "all that one pass reads and writes")]
    pub fn add(
        &self,
        springs: &Springs<T>,
        damping: T,
        state: &Particles<T>,
        components: &mut Components<T>,
        force: &mut [T::Vec3],
        parallel: bool,
        begin: impl Fn(usize, &mut [T::Vec3]) + Sync,
    ) {
        components.split(state, damping > T::ZERO, parallel);
        let components = &*components;
        let task = |(task, force): (usize, &mut [T::Vec3])| {
            let first = task * TASK;
            begin(first, force);
            let pass =
                Pass { slices: self, springs, damping, state, components, first: first / LANES, force };
            Simd::vectorize(self.with, pass);
        };
        if parallel {
            force.par_chunks_mut(TASK).enumerate().for_each(task);
        } else {
            force.chunks_mut(TASK).enumerate().for_each(task);
        }
    }
}

impl<T: Real> Components<T> {
    fn split(&mut self, state: &Particles<T>, damped: bool, parallel: bool) {
        split(&mut self.position, &state.positions, parallel);
        if damped {
            split(&mut self.velocity, &state.velocities, parallel);
        }
    }
}

fn split<T: Real>([x, y, z]: &mut [Vec<T>; 3], vectors: &[T::Vec3], parallel: bool) {
    for component in [&mut *x, &mut *y, &mut *z] {
        component.resize(vectors.len().next_multiple_of(LANES), T::ZERO);
    }
    let one = |(((x, y), z), v): (((&mut T, &mut T), &mut T), &T::Vec3)| [*x, *y, *z] = v.to_array();
    if parallel {
        let tasks = x.par_chunks_mut(TASK).zip(y.par_chunks_mut(TASK)).zip(z.par_chunks_mut(TASK));
        tasks.zip(vectors.par_chunks(TASK)).for_each(|(((x, y), z), v)| {
            x.iter_mut().zip(y).zip(z).zip(v).for_each(one);
        });
    } else {
        x.iter_mut().zip(y).zip(z).zip(vectors).for_each(one);
    }
}

/// The forces on the particles of some slices.
struct Pass<'a, T: Real> {
    slices: &'a Slices<T>,
    springs: &'a Springs<T>,
    damping: T,
    state: &'a Particles<T>,
    components: &'a Components<T>,
    /// The slice that `force` begins with.
    first: usize,
    force: &'a mut [T::Vec3],
}

impl<T: Real> WithSimd for Pass<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        if self.damping > T::ZERO {
            self.run::<true>();
        } else {
            self.run::<false>();
        }
    }
}

impl<T: Real> Pass<'_, T> {
    #[inline(always)]
    fn run<const DAMPED: bool>(self) {
        let Self { slices, springs, damping, state, components, first, force } = self;
        let with = slices.with;
        let damping = T::Lanes::splat(with, damping);
        let groups = &springs.groups[..];
        let ends = &slices.ends[first * groups.len()..];
        let mut slot =
            first.checked_mul(groups.len()).and_then(|i| i.checked_sub(1)).map_or(0, |i| slices.ends[i]);
        for (slice, force) in force.chunks_mut(LANES).enumerate() {
            let own = (first + slice) * LANES;
            let x = row(with, &components.position, own);
            let v = if DAMPED { row(with, &components.velocity, own) } else { x };
            let mut sum = [[T::ZERO; LANES]; 3];
            for (lane, f) in force.iter().enumerate() {
                [sum[0][lane], sum[1][lane], sum[2][lane]] = f.to_array();
            }
            let mut fx = T::Lanes::of(with, sum[0]);
            let mut fy = T::Lanes::of(with, sum[1]);
            let mut fz = T::Lanes::of(with, sum[2]);
            for (group, end) in groups.iter().zip(&ends[slice * groups.len()..]) {
                let stiffness = T::Lanes::splat(with, group.stiffness);
                for slot in std::mem::replace(&mut slot, *end)..*end {
                    let slot = slot as usize;
                    let (there, speed) = match slices.slots[slot] {
                        Slot::Row(at) => {
                            let there = row(with, &components.position, at as usize);
                            (there, if DAMPED { row(with, &components.velocity, at as usize) } else { there })
                        }
                        Slot::List(list) => {
                            let list = &slices.lists[list as usize];
                            let there = T::Lanes::components(with, &state.positions, list);
                            let speed = if DAMPED {
                                T::Lanes::components(with, &state.velocities, list)
                            } else {
                                there
                            };
                            (there, speed)
                        }
                    };
                    let [dx, dy, dz] = [there[0] - x[0], there[1] - x[1], there[2] - x[2]];
                    let length = (dx * dx + dy * dy + dz * dz).sqrt();
                    let rest = T::Lanes::of(with, slices.rest[slot]);
                    let tension = (stiffness * (length - rest) / length).where_positive(length);
                    if DAMPED {
                        fx = fx + (dx * tension + (speed[0] - v[0]) * damping);
                        fy = fy + (dy * tension + (speed[1] - v[1]) * damping);
                        fz = fz + (dz * tension + (speed[2] - v[2]) * damping);
                    } else {
                        (fx, fy, fz) = (fx + dx * tension, fy + dy * tension, fz + dz * tension);
                    }
                }
            }
            let [fx, fy, fz] = [fx.to_array(), fy.to_array(), fz.to_array()];
            for (lane, f) in force.iter_mut().enumerate() {
                *f = T::Vec3::from_array([fx[lane], fy[lane], fz[lane]]);
            }
        }
    }
}

/// Eight vectors that stand in a row, by component.
#[inline(always)]
fn row<T: Real>(with: Instructions, [x, y, z]: &[Vec<T>; 3], at: usize) -> [T::Lanes; 3] {
    [T::Lanes::load(with, &x[at..]), T::Lanes::load(with, &y[at..]), T::Lanes::load(with, &z[at..])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forces::springs::scatter;
    use crate::model::{KindSettings, Topology};
    use glam::DVec3;

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
        scatter(&springs, damping, &state, &mut plain);
        let Some(slices) = Slices::new(particles, &springs) else {
            println!("this processor lacks the instructions");
            return;
        };
        for parallel in [false, true] {
            let mut force = vec![T::Vec3::ZERO; particles];
            let mut scratch = Components::default();
            slices.add(&springs, damping, &state, &mut scratch, &mut force, parallel, |first, force| {
                force.copy_from_slice(&started[first..first + force.len()]);
            });
            assert_eq!(force, plain);
        }
    }

    #[test]
    fn slices_give_the_bits_of_the_plain_loop() {
        let sheet = Topology::of(&crate::target::grid(70, 41, 0.1, false));
        for damping in [0.0, 2.0] {
            for particles in [2, 7, 8, 9, 1025] {
                agree::<f32>(&irregular(particles), particles as usize, damping);
                agree::<f64>(&irregular(particles), particles as usize, damping);
            }
            agree::<f32>(&sheet, 70 * 41, damping);
            agree::<f64>(&sheet, 70 * 41, damping);
        }
    }
}
