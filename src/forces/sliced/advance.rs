//! Particles that take their step in the pass over the springs, as soon as it has summed up what acts on them.
//!
//! They are read once and written once, and what else is asked of a step (how fast, how far, how near to tearing) is seen
//! while they are at hand.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::loads::Loads;
use super::pass::{Fields, Sums};
use super::pulls::{PLACES, SPEEDS};
use super::{BLOCK, Means, Slices, Stretched};
use crate::math::lanes::{LANES, Lanes, put_vectors_of};
use crate::math::parts::Parts;
use crate::math::{Real, Vector};
use crate::model::{Particles, Seen};
use std::marker::PhantomData;

/// The update of a method that asks for the forces at the start of a step and for nothing else.
pub trait Update: Send + Sync {
    /// A component of position (m) and velocity (m/s) after a step of `dt` (s), from those before it and the acceleration `a`
    /// (m/s²). For eight particles at once: it must be marked `#[inline(always)]`.
    fn advance<L: Lanes>(x: L, v: L, a: L, dt: L) -> [L; 2];
}

/// The state that a step leads to: scratch.
#[derive(Clone, Debug)]
pub struct Ahead<T: Real> {
    /// m.
    positions: Vec<T::Vec3>,
    /// m/s.
    velocities: Vec<T::Vec3>,
    /// By block.
    motion: Vec<Motion<T>>,
}

impl<T: Real> Default for Ahead<T> {
    fn default() -> Self {
        Self { positions: Vec::new(), velocities: Vec::new(), motion: Vec::new() }
    }
}

/// What is seen of a block of particles, lane by lane.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Motion<T> {
    /// Σ |v|², m²/s².
    squares: [T; LANES],
    /// The square of the longest way, m².
    way: [T; LANES],
    /// By how much a spring was longest beyond its limit, m.
    excess: [T; LANES],
}

impl<T: Real> Ahead<T> {
    /// Becomes the state. Where a method does so several times in a step, ways add up to what is left at first.
    fn replace(&mut self, state: &mut Particles<T>) {
        std::mem::swap(&mut state.positions, &mut self.positions);
        std::mem::swap(&mut state.velocities, &mut self.velocities);
        let largest = |of: fn(&Motion<T>) -> &[T; LANES], least: f64| {
            self.motion.iter().flat_map(of).map(|value| value.to_f64()).fold(least, f64::max)
        };
        let sums = self.motion.iter().map(|m| m.squares.into_iter().map(T::to_f64).sum::<f64>());
        let (way, left) = (largest(|m| &m.way, 0.0).sqrt(), -largest(|m| &m.excess, f64::NEG_INFINITY));
        let (way, left) = state.seen.map_or((way, left), |before| (before.way + way, before.left));
        state.seen = Some(Seen { squares: sums.sum(), way, left });
    }
}

/// The particles from `first` on.
struct Advance<'a, T: Real, U> {
    loads: Loads<'a, T>,
    dt: T,
    first: usize,
    positions: &'a mut [T::Vec3],
    velocities: &'a mut [T::Vec3],
    motion: &'a mut [Motion<T>],
    update: PhantomData<U>,
}

impl<T: Real, U: Update> Parts for Advance<'_, T, U> {
    fn count(&self) -> usize {
        self.positions.len()
    }

    fn split_at(self, particle: usize) -> (Self, Self) {
        let Self { loads, dt, first, positions, velocities, motion, update } = self;
        let middle = first + particle;
        let (loads, other_loads) = loads.split_at(middle);
        let (positions, more_positions) = positions.split_at_mut(particle);
        let (velocities, more_velocities) = velocities.split_at_mut(particle);
        let (motion, more_motion) = motion.split_at_mut(particle / BLOCK);
        (
            Self { loads, dt, first, positions, velocities, motion, update },
            Self {
                loads: other_loads,
                dt,
                first: middle,
                positions: more_positions,
                velocities: more_velocities,
                motion: more_motion,
                update,
            },
        )
    }
}

impl<T: Real, U: Update> Sums<T> for Advance<'_, T, U> {
    #[inline(always)]
    fn begin<L: Lanes<Scalar = T>>(&self, with: L::Proof, at: usize, here: impl Fields<T>) -> [L; 3] {
        self.loads.begin(with, self.first + at, here)
    }

    #[inline(always)]
    fn end<L: Lanes<Scalar = T>>(&mut self, with: L::Proof, at: usize, here: impl Fields<T>, sum: [L; 3]) {
        let (x, v): ([L; 3], [L; 3]) = (here.field(with, PLACES), here.field(with, SPEEDS));
        let (a, dt) = (self.loads.accelerations(with, self.first + at, here, sum), L::splat(with, self.dt));
        let [[x0, v0], [x1, v1], [x2, v2]] = [
            U::advance(x[0], v[0], a[0], dt),
            U::advance(x[1], v[1], a[1], dt),
            U::advance(x[2], v[2], a[2], dt),
        ];
        put_vectors_of::<T, L>([x0, x1, x2], &mut self.positions[at..]);
        put_vectors_of::<T, L>([v0, v1, v2], &mut self.velocities[at..]);
        let motion = &mut self.motion[at / BLOCK];
        let [mut squares, mut way] = [L::splat(with, T::ZERO); 2];
        if !at.is_multiple_of(BLOCK) {
            (squares, way) = (L::load(with, &motion.squares), L::load(with, &motion.way));
        }
        (squares + square([v0, v1, v2])).store(&mut motion.squares);
        square([x0 - x[0], x1 - x[1], x2 - x[2]]).max(way).store(&mut motion.way);
    }

    #[inline(always)]
    fn notice<L: Lanes<Scalar = T>>(&mut self, at: usize, most: L) {
        self.motion[at / BLOCK].excess = most.to_array();
    }
}

/// Square of the length.
#[inline(always)]
fn square<L: Lanes>([x, y, z]: [L; 3]) -> L {
    x * x + y * y + z * z
}

impl<T: Real> Slices<T> {
    /// Takes a step of `dt` (s) from the state by its forces, and tells in it what was seen.
    pub fn advance<U: Update>(
        &self,
        springs: Stretched<T>,
        state: &mut Particles<T>,
        loads: Loads<T>,
        dt: T,
        ahead: &mut Ahead<T>,
        means: Means<T>,
    ) {
        let particles = state.len();
        ahead.positions.resize(particles, T::Vec3::ZERO);
        ahead.velocities.resize(particles, T::Vec3::ZERO);
        let none = [T::ZERO; LANES];
        ahead.motion.resize(particles.div_ceil(BLOCK), Motion { squares: none, way: none, excess: none });
        let Ahead { positions, velocities, motion } = ahead;
        let update = PhantomData::<U>;
        let sums = Advance { loads, dt, first: 0, positions, velocities, motion, update };
        self.pull(springs, state, sums, means);
        ahead.replace(state);
    }
}

#[cfg(test)]
mod tests {
    use super::super::pass::{Pass, Vectors, Window};
    use super::super::tests::{cloths, crumpled, place};
    use super::*;
    use crate::forces::pull::Pull;
    use crate::math::lanes::{Kernel, Plain};
    use crate::model::{Springs, Topology};

    struct KickThenDrift;

    impl Update for KickThenDrift {
        #[inline(always)]
        fn advance<L: Lanes>(x: L, v: L, a: L, dt: L) -> [L; 2] {
            let v = v + a * dt;
            [x + v * dt, v]
        }
    }

    /// The same, looked at one by one.
    fn seen<T: Real>(springs: &Springs<T>, before: &Particles<T>, after: &Particles<T>, limit: f64) -> Seen {
        let ways =
            after.positions.iter().zip(&before.positions).map(|(to, from)| (*to - *from).to_f64().length());
        let left = springs.pairs.iter().zip(&springs.rest).map(|([i, j], rest)| {
            let [i, j] = [i, j].map(|p| before.positions[*p as usize].to_f64());
            rest.to_f64() * (1.0 + limit) - i.distance(j)
        });
        Seen {
            squares: after.velocities.iter().map(|v| v.to_f64().length_squared()).sum(),
            way: ways.fold(0.0, f64::max),
            left: left.fold(f64::INFINITY, f64::min),
        }
    }

    fn agree<T: Real>(topology: &Topology, particles: usize) {
        let (springs, state) = crumpled::<T>(topology, particles);
        let slices = Slices::new(particles, &springs);
        let mass: Vec<T> = (0..particles).map(|i| T::from_f64(1.0 + (i % 3) as f64)).collect();
        let inverse = |(i, m): (usize, &T)| if i % 7 == 0 { T::ZERO } else { T::ONE / *m };
        let inverse_mass: Vec<T> = mass.iter().enumerate().map(inverse).collect();
        let hand = |i: usize| Pull::new(i as u32, place::<T>(i + 2, 1.3), 10.0, mass[i]);
        let pulls: Vec<Pull<T>> = (0..particles).filter(|i| i % 50 < 3).map(hand).collect();
        let loads = Loads {
            mass: &mass,
            inverse_mass: &inverse_mass,
            gravity: place::<T>(1, 9.8),
            wind: place::<T>(2, 0.1),
            air_damping: T::from_f64(0.1),
            pulls: &pulls,
        };
        // Below the rest lengths: some springs have none, which are never longer by a ratio of that.
        let limit = -0.5;
        let stretched =
            Stretched { springs: &springs, damping: T::from_f64(2.0), limit: Some(T::from_f64(limit)) };
        let dt = T::from_f64(0.001);

        // The springs alone are tested elsewhere.
        let mut forces = vec![T::Vec3::ZERO; particles];
        for (i, f) in forces.iter_mut().enumerate() {
            *f = *f + loads.gravity * mass[i] + loads.wind - state.velocities[i] * loads.air_damping;
        }
        slices.add_forces(stretched, &state, &mut forces, Means { windows: &mut Vec::new(), threads: 1 });
        crate::forces::pull::add(&pulls, &state.positions, &state.velocities, &mut forces);
        let of = |(f, w): (&T::Vec3, &T)| if *w > T::ZERO { *f * *w } else { T::Vec3::ZERO };
        let accelerations: Vec<T::Vec3> = forces.iter().zip(&inverse_mass).map(of).collect();
        let mut expected = state.clone();
        for (i, a) in accelerations.iter().enumerate() {
            expected.velocities[i] += *a * dt;
            expected.positions[i] += expected.velocities[i] * dt;
        }
        for threads in [1, 2, 3, 8] {
            let mut told = vec![T::Vec3::ZERO; particles];
            let means = Means { windows: &mut Vec::new(), threads };
            slices.accelerations(stretched, &state, loads, &mut told, means);
            assert_eq!(told, accelerations, "{threads} threads");
        }

        let on = |threads| {
            let (mut state, mut ahead, mut windows) = (state.clone(), Ahead::default(), Vec::new());
            let means = Means { windows: &mut windows, threads };
            slices.advance::<KickThenDrift>(stretched, &mut state, loads, dt, &mut ahead, means);
            let seen = state.seen.take().unwrap();
            assert!(state == expected, "{threads} threads");
            (seen, ahead)
        };
        let (told, mut ahead) = on(1);
        for threads in [2, 3, 8] {
            assert_eq!(on(threads).0, told, "{threads} threads");
        }
        // A lane adds up a block, and doubles the rest; a length, and what is left of it, are some ten operations.
        let truth = seen(&springs, &state, &expected, limit);
        let epsilon = T::EPSILON.to_f64();
        let sums = (BLOCK / LANES) as f64 * epsilon + particles as f64 * f64::EPSILON;
        assert!((told.squares - truth.squares).abs() <= sums * truth.squares);
        assert!((told.way - truth.way).abs() <= 5.0 * epsilon * truth.way);
        let longest = springs.rest.iter().fold(0.0, |most, rest| rest.to_f64().max(most));
        assert!((told.left - truth.left).abs() <= 5.0 * epsilon * (4.0 + 1.5 * longest));

        let mut windows = [Window::default()];
        windows[0].hold(2);
        let motion = ahead.motion.clone();
        let Ahead { positions, velocities, motion: again } = &mut ahead;
        let update = PhantomData::<KickThenDrift>;
        let sums = Advance { loads, dt, first: 0, positions, velocities, motion: again, update };
        let fields = [Vectors(&state.positions), Vectors(&state.velocities)];
        let law = super::super::pulls::Pull::<T, true> { slices: &slices, springs: stretched };
        let windows = &mut windows;
        Pass { slices: &slices, particles, fields, law, first: 0, sums, windows }.run::<Plain<T>>(());
        assert!((&ahead.positions, &ahead.velocities) == (&expected.positions, &expected.velocities));
        assert!(ahead.motion == motion, "in plain arrays");
    }

    #[test]
    fn a_step_on_the_way_is_that_of_all_forces_on_any_machine_and_number_of_threads() {
        for (topology, particles) in cloths() {
            agree::<f32>(&topology, particles);
            agree::<f64>(&topology, particles);
        }
    }
}
