//! Dormand-Prince 5(4): steps as short as a tolerance asks for (Dormand and Prince, "A family of embedded Runge-Kutta
//! formulae", 1980), chosen by a PI controller (Gustafsson, "Control theoretic techniques for stepsize selection in explicit
//! Runge-Kutta methods", 1991; constants of Hairer, Nørsett, Wanner, "Solving Ordinary Differential Equations I", 1993, II.4).
//!
//! Six force evaluations an inner step give a solution of order 5, a seventh (the first of the next step) one of order 4; their
//! difference is the error that the controller holds at the tolerance. Inner steps fill each dt exactly, so that its
//! length matters little: the tolerance stands in its place. The controller's step and last error are its memory.
//!
//! The one to choose to be just accurate, and as a reference for all others. Inner steps are limited as those of any
//! explicit method, to about 3.3/ω undamped: stiff cloth makes them many. Where more than `most_steps` would be needed in
//! one dt, the rest of it is taken in one, and told as unsolved.

use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::{Real, Vector};
use crate::model::Particles;

crate::params! {
    /// Adaptive Dormand-Prince.
    pub struct Rk45 {
        /// Error allowed in an inner step: of a position, m; of a velocity over the fastest change of it, the same.
        tolerance: f64 = 1e-8, unit "m", range 1e-14..=1.0, slider log 1e-12..=1e-3, effort [1e-4, 1e-6, 1e-8];
        /// Most inner steps in one dt.
        most_steps: u32 = 1000, range 1.0..=100_000_000.0, slider log 100.0..=1e6;
    }
}

/// Stages that are combined.
const STAGES: usize = 7;

/// Coefficients: at which part of the step each stage stands, and how it is made of those before it. The last row is the
/// solution of order 5.
const NODES: [f64; STAGES] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
const WEIGHTS: [[f64; 6]; STAGES] = [
    [0.0; 6],
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
/// Order 5 minus order 4.
const ERROR: [f64; STAGES] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339_200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// Scratch of [`Rk45`].
#[derive(Debug, Default)]
pub struct Buffers<T: Real> {
    start: Vec<T::Vec3>,
    start_velocities: Vec<T::Vec3>,
    rates: [Rates<T>; STAGES],
}

/// How fast the state of a stage changes.
#[derive(Debug, Default)]
struct Rates<T: Real> {
    velocities: Vec<T::Vec3>,
    accelerations: Vec<T::Vec3>,
}

impl Simulator for Rk45 {
    const ID: &'static str = "rk45";
    const SUMMARY: &'static str =
        "Dormand-Prince 5(4): as accurate as its tolerance asks, whatever dt is; for just being right.";
    const ORDER: u32 = 5;
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
        let (beginning, whole) = (state.time, dt.to_f64());
        let (mut wanted, mut last_error) = match state.memory.numbers[..] {
            [wanted, last_error] => (wanted, last_error),
            _ => (whole, 1.0),
        };
        let mut done = 0.0;
        let mut steps = 0;
        let mut forced = false;
        scratch.begin(state);
        scratch.rates_of(problem, state, 0, cost);
        while done < whole {
            steps += 1;
            forced |= steps > self.most_steps;
            let left = whole - done;
            // The last two share what is left, so that none is much shorter than the others.
            let h = if forced || wanted >= left { left } else { wanted.min(0.5 * left) };
            let last = h >= left;
            let error = scratch.attempt(problem, state, h, beginning + done, self.tolerance, cost);
            let sound = error <= 1.0;
            if sound || forced {
                done = if last { whole } else { done + h };
                scratch.begin(state);
                // The last stage is the first of the next step.
                scratch.rates.swap(0, STAGES - 1);
            } else {
                scratch.take_back(state);
            }
            let factor = if sound {
                // Hairer's β = 0.04: exponents 0.2 - 0.75 β and β.
                (0.9 * libm::pow(error.max(1e-10), -0.17) * libm::pow(last_error, 0.04)).clamp(0.2, 10.0)
            } else if error.is_finite() {
                (0.9 * libm::pow(error, -0.2)).clamp(0.1, 0.9)
            } else {
                0.1
            };
            if sound {
                last_error = error.max(1e-4);
            }
            // A step that was cut to fit does not say that longer ones are too long.
            wanted = if sound && h < wanted { wanted.max(h * factor) } else { h * factor };
        }
        state.time = beginning;
        state.memory.numbers.clear();
        state.memory.numbers.extend([wanted, last_error]);
        if forced {
            cost.solved(f64::INFINITY);
        }
    }

    /// The inner steps keep within the limit by themselves.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}

impl<T: Real> Buffers<T> {
    /// Takes the state as the start of an inner step.
    fn begin(&mut self, state: &Particles<T>) {
        self.start.clone_from(&state.positions);
        self.start_velocities.clone_from(&state.velocities);
    }

    /// Puts the state back to the start of the inner step.
    fn take_back(&self, state: &mut Particles<T>) {
        state.positions.clone_from(&self.start);
        state.velocities.clone_from(&self.start_velocities);
    }

    /// Velocities and accelerations in the state, as those of a stage.
    fn rates_of(&mut self, problem: &Problem<T>, state: &Particles<T>, stage: usize, cost: &mut Cost) {
        let Rates { velocities, accelerations } = &mut self.rates[stage];
        velocities.clone_from(&state.velocities);
        accelerations.resize(state.len(), T::Vec3::ZERO);
        problem.forces(state, accelerations, cost);
        accelerations.iter_mut().zip(&problem.inverse_mass).for_each(|(a, &w)| *a = *a * w);
    }

    /// Takes an inner step of `h` (s) that starts at `time` (s), the rates of its first stage known; answers with its error in
    /// units of the tolerance.
    fn attempt(
        &mut self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        h: f64,
        time: f64,
        tolerance: f64,
        cost: &mut Cost,
    ) -> f64 {
        for stage in 1..STAGES {
            self.take_back(state);
            for (before, weight) in WEIGHTS[stage][..stage].iter().enumerate() {
                if *weight != 0.0 {
                    let part = T::from_f64(h * weight);
                    let Rates { velocities, accelerations } = &self.rates[before];
                    add(&mut state.positions, velocities, part);
                    add(&mut state.velocities, accelerations, part);
                }
            }
            state.time = time + NODES[stage] * h;
            self.rates_of(problem, state, stage, cost);
        }
        // An error of velocity moves a particle as far within this step.
        let (mut worst, h) = (0.0f64, h.abs());
        for i in 0..state.len() {
            let (mut x, mut v) = (T::Vec3::ZERO, T::Vec3::ZERO);
            for (Rates { velocities, accelerations }, weight) in self.rates.iter().zip(ERROR) {
                let part = T::from_f64(h * weight);
                x += velocities[i] * part;
                v += accelerations[i] * part;
            }
            let error = x.length().to_f64().max(v.length().to_f64() * h);
            worst = if error.is_nan() { f64::INFINITY } else { worst.max(error) };
        }
        // No tolerance is finer than rounding.
        let far = state.positions.iter().map(|x| x.dot(*x).to_f64()).fold(0.0, f64::max).sqrt();
        worst / tolerance.max(4.0 * T::EPSILON.to_f64() * far)
    }
}

/// a += b s.
fn add<T: Real>(a: &mut [T::Vec3], b: &[T::Vec3], s: T) {
    a.iter_mut().zip(b).for_each(|(a, &b)| *a += b * s);
}
