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
//! No dt is too long, and no sweep makes G larger by much. A sweep costs about six force evaluations. Choose it where few
//! sweeps must do at a long dt: it gives smooth, soft errors where XPBD's are stiff; far below its dt, XPBD with small steps
//! is more accurate.

mod descent;

use super::chebyshev::Chebyshev;
use super::inertia::Inertia;
use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::{Real, Vector};
use crate::model::Particles;
use descent::{Descent, Step};

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
    /// x̂, m.
    free: Vec<T::Vec3>,
    chebyshev: Chebyshev<T>,
    descent: Descent<T>,
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
        scratch.descent.prepare(problem);
        let beginning = state.time;
        state.time += dt.to_f64();
        scratch.inertia.begin(problem, state, dt);
        state.time = beginning;
        cost.force_evaluations += 1;
        scratch.start.clone_from(&state.positions);
        scratch.free.clear();
        let starts = state.positions.iter().zip(&scratch.inertia.velocity);
        scratch.free.extend(starts.map(|(&x, &v)| x + v * dt));
        warm_start(&scratch.inertia, state, dt);
        scratch.chebyshev.begin(self.acceleration, &state.positions);
        for _ in 0..self.iterations {
            if problem.is_stopped() {
                return;
            }
            let Buffers { inertia, start, free, descent, .. } = scratch;
            descent.sweep(problem, &mut state.positions, Step { inertia, start, free, h: dt });
            scratch.chebyshev.accelerate(self.acceleration, &mut state.positions);
        }
        cost.solver_iterations += u64::from(self.iterations);
        cost.spring_visits += 2 * u64::from(self.iterations) * problem.springs.len() as u64;
        state.memory.vectors.clone_from(&state.velocities);
        let Particles { positions, velocities, .. } = &mut *state;
        let ways = positions.iter().zip(&scratch.start).zip(&scratch.inertia.inverse);
        for (v, ((&x, &start), _)) in velocities.iter_mut().zip(ways).filter(|(_, (_, w))| **w > T::ZERO) {
            *v = (x - start) * (T::ONE / dt);
        }
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
