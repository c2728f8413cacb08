//! VBD, vertex block descent (Chen, Liu, Yang, Yuksel, "Vertex block descent", 2024): backward Euler, solved particle by
//! particle.
//!
//! Implicit Euler's step is the lowest point of G(x) = |x - x̂|²_M̂ / (2 h²) + elastic energy + damping, x̂ where particles would go
//! without springs. A sweep takes each particle in turn, all others at rest, and moves it by one Newton step in its three
//! coordinates: (M̂ + h k_d n + h² Σ K) δ = M̂ (x̂ - x) + h² F, n the number of its springs. Particles of a colour share
//! no spring, so their order does not matter and threads change no bit. Order 1, that of backward Euler; what sweeps are left
//! out is an error besides, in which momentum has no part: its sum is put right at the end.
//!
//! Warm start as in the paper: gravity and wind are put in at the start only so far as the last step followed them, so
//! that cloth at rest begins at rest. The velocity before the last step is its memory; where there is none they count in
//! full.
//!
//! No dt is too long, and no sweep makes G larger by much. A sweep costs about two force evaluations. Choose it where few
//! sweeps must do at a long dt: it gives smooth, soft errors where XPBD's are stiff; far below its dt, XPBD with small steps
//! is more accurate.

use super::blocks::Block;
use super::chebyshev::Chebyshev;
use super::colouring::Colours;
use super::inertia::{Inertia, velocities_of_the_way};
use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::{Real, Vector};
use crate::model::Particles;
use rayon::prelude::*;

crate::params! {
    /// Vertex block descent.
    pub struct Vbd {
        /// Sweeps over the particles in each step: towards implicit Euler, not beyond.
        iterations: u32 = 20, range 1.0..=100_000.0, slider log 1.0..=200.0, effort [1.0, 5.0, 20.0, 80.0];
        /// Chebyshev acceleration: the part of its error that an iteration is taken to leave. 0 is none; too much makes the
        /// iterations burst.
        acceleration: f64 = 0.0, range 0.0..=0.9999, slider linear 0.0..=0.99;
    }
}

/// Scratch of [`Vbd`].
#[derive(Debug, Default)]
pub struct Buffers<T: Real> {
    inertia: Inertia<T>,
    /// Positions at the start of the step, m.
    start: Vec<T::Vec3>,
    /// New positions of a colour, m.
    moved: Vec<T::Vec3>,
    chebyshev: Chebyshev<T>,
    colours: Colours,
    /// Stiffness of each spring, N/m.
    stiffness: Vec<T>,
    /// The revision of the problem that colours and stiffnesses were taken from.
    revision: u64,
}

impl<T: Real> Buffers<T> {
    fn prepare(&mut self, problem: &Problem<T>) {
        if self.revision != problem.revision() {
            self.revision = problem.revision();
            self.colours = Colours::of_particles(problem.particles(), problem.incidence());
            self.stiffness = problem.springs.stiffness_of_each();
        }
    }

    /// Where one particle goes while all others stay, m.
    fn descend(&self, problem: &Problem<T>, positions: &[T::Vec3], h: T, i: usize) -> T::Vec3 {
        let x = positions[i];
        if self.inertia.inverse[i] <= T::ZERO {
            return x;
        }
        let mass = self.inertia.mass[i];
        let damping = h * problem.spring_damping;
        let free = self.start[i] + self.inertia.velocity[i] * h;
        let mut right = (free - x) * mass;
        let mut left = Block::scaled_identity(mass);
        for &[other, spring] in problem.incidence().around(i) {
            let (other, spring) = (other as usize, spring as usize);
            let d = positions[other] - x;
            let (length, rest) = (d.length(), problem.springs.rest[spring]);
            let k = self.stiffness[spring] * h * h;
            if length > T::ZERO {
                right += d * (k * ((length - rest) / length));
            }
            right += (d - (self.start[other] - self.start[i])) * damping;
            left.add(&Block::of_spring(d, rest, k).scaled(T::ONE, damping));
        }
        x + left.inverse().times(right)
    }
}

impl Simulator for Vbd {
    const ID: &'static str = "vbd";
    const SUMMARY: &'static str =
        "Vertex block descent: implicit Euler particle by particle; bounded at any dt with few sweeps.";
    const ORDER: u32 = 1;
    const MODEL: Model = Model::Springs;
    type Scratch<T: Real> = Buffers<T>;

    fn step<T: Real>(
        &self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        dt: T,
        scratch: &mut Buffers<T>,
        cost: &mut Cost,
    ) {
        scratch.prepare(problem);
        let beginning = state.time;
        state.time += dt.to_f64();
        scratch.inertia.begin(problem, state, dt);
        state.time = beginning;
        cost.force_evaluations += 1;
        scratch.start.clone_from(&state.positions);
        warm_start(&scratch.inertia, state, dt);
        scratch.chebyshev.begin(self.acceleration, &state.positions);
        for _ in 0..self.iterations {
            if problem.is_stopped() {
                return;
            }
            sweep(problem, &mut state.positions, dt, scratch);
            scratch.chebyshev.accelerate(self.acceleration, &mut state.positions);
        }
        cost.solver_iterations += u64::from(self.iterations);
        cost.spring_visits += 2 * u64::from(self.iterations) * problem.springs.len() as u64;
        state.memory.vectors.clone_from(&state.velocities);
        velocities_of_the_way(&scratch.start, state, dt, &scratch.inertia.inverse);
        let shift = scratch.inertia.keep_momentum(&mut state.velocities);
        state.positions.iter_mut().for_each(|x| *x += shift * dt);
    }

    /// Backward Euler sets no limit.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}

/// Moves particles on by their velocity and so much of what acts from outside as the last step followed.
fn warm_start<T: Real>(inertia: &Inertia<T>, state: &mut Particles<T>, dt: T) {
    let before = &state.memory.vectors;
    for (i, (x, &v)) in state.positions.iter_mut().zip(&state.velocities).enumerate() {
        let outside = inertia.velocity[i] - v;
        let size = outside.dot(outside);
        let followed = match before.get(i) {
            Some(&before) if size > T::ZERO => (v - before).dot(outside) / size,
            _ => T::ONE,
        };
        let part = if followed > T::ONE {
            T::ONE
        } else if followed > T::ZERO {
            followed
        } else {
            T::ZERO
        };
        *x += (v + outside * part) * dt;
    }
}

/// Moves each particle once, colour by colour.
fn sweep<T: Real>(problem: &Problem<T>, positions: &mut [T::Vec3], h: T, scratch: &mut Buffers<T>) {
    let mut moved = std::mem::take(&mut scratch.moved);
    for colour in scratch.colours.groups() {
        if problem.parallel() {
            let seen = &*positions;
            let each = colour.par_iter().with_min_len(512);
            each.map(|&i| scratch.descend(problem, seen, h, i as usize)).collect_into_vec(&mut moved);
            for (&i, &x) in colour.iter().zip(&moved) {
                positions[i as usize] = x;
            }
        } else {
            for &i in colour {
                positions[i as usize] = scratch.descend(problem, positions, h, i as usize);
            }
        }
    }
    scratch.moved = moved;
}
