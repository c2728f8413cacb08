//! Dormand-Prince 5(4): steps as short as a tolerance asks for (Dormand and Prince, "A family of embedded Runge-Kutta
//! formulae", 1980), chosen by a PI controller (Gustafsson, "Control theoretic techniques for stepsize selection in explicit
//! Runge-Kutta methods", 1991; constants of Hairer, Nørsett, Wanner, "Solving Ordinary Differential Equations I", 1993, II.4).
//!
//! Six force evaluations an inner step give a solution of order 5, a seventh (the first of the next step) one of order 4; their
//! difference is the error that the controller holds at the tolerance. Inner steps go on past the end of a dt, and the state
//! there is read off their dense output of order 4 (Hairer, Nørsett, Wanner, II.6), so that dt neither shortens them nor
//! matters much otherwise: the tolerance stands in its place. The last inner step, the controller's next one and its last error
//! are its memory. Where hands move or pull, inner steps end with the dt, since what hands do next is not known.
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

/// Longest inner step, in dt: what acts from outside should not change unseen in one.
const FARTHEST: f64 = 10.0;

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

/// What of each stage makes up the highest term of the dense output.
const DENSE: [f64; STAGES] = [
    -12_715_105_075.0 / 11_282_082_432.0,
    0.0,
    87_487_479_700.0 / 32_700_410_799.0,
    -10_690_763_975.0 / 1_880_347_072.0,
    701_980_252_875.0 / 199_316_789_632.0,
    -1_453_857_185.0 / 822_651_844.0,
    69_997_945.0 / 29_380_423.0,
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

/// The numbers in the memory; its vectors are those of [`Dense`].
struct Controller {
    /// Length of the next inner step, s.
    wanted: f64,
    /// Error of the last one, in units of the tolerance.
    last_error: f64,
    /// Where the last inner step began, and its length, s.
    begin: f64,
    length: f64,
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
        let (beginning, end) = (state.time, state.time + dt.to_f64());
        let mut controller = match state.memory.numbers[..] {
            [wanted, last_error, begin, length] => Controller { wanted, last_error, begin, length },
            _ => Controller { wanted: dt.to_f64(), last_error: 1.0, begin: beginning, length: 0.0 },
        };
        let handled = problem.is_handled(state);
        if handled {
            state.memory.vectors.clear();
        }
        let dense = !state.memory.vectors.is_empty();
        if dense {
            // Goes on from the end of the last inner step.
            scratch.recall(state);
        } else {
            (controller.begin, controller.length) = (beginning, 0.0);
        }
        let mut now = controller.begin + controller.length;
        if now < end && !dense {
            scratch.rates_of(problem, state, 0, cost);
        }
        let (mut steps, mut forced, mut worst) = (0, false, 0);
        while now < end {
            if problem.is_stopped() {
                return;
            }
            steps += 1;
            forced |= steps > self.most_steps;
            let left = end - now;
            let h = match controller.wanted {
                _ if forced => left,
                wanted if !handled => wanted.min(FARTHEST * dt.to_f64()),
                wanted if wanted >= left => left,
                // The last two share what is left, so that none is much shorter than the others.
                wanted => wanted.min(0.5 * left),
            };
            let cut = h < controller.wanted;
            scratch.begin(state);
            let (error, particle) = scratch.attempt(problem, state, h, now, self.tolerance, cost);
            worst = particle;
            let sound = error <= 1.0;
            if sound || forced {
                scratch.remember(state, h);
                (controller.begin, controller.length) = (now, h);
                now = if forced || (cut && h >= left) { end } else { now + h };
                // The last stage is the first of the next step.
                scratch.rates.swap(0, STAGES - 1);
            } else {
                scratch.take_back(state);
            }
            let factor = if sound {
                // Hairer's β = 0.04: exponents 0.2 - 0.75 β and β.
                let proposed = libm::pow(error.max(1e-10), -0.17) * libm::pow(controller.last_error, 0.04);
                controller.last_error = error.max(1e-4);
                (0.9 * proposed).clamp(0.2, 10.0)
            } else if error.is_finite() {
                (0.9 * libm::pow(error, -0.2)).clamp(0.1, 0.9)
            } else {
                0.1
            };
            // A step that was cut to fit does not say that longer ones are too long.
            controller.wanted = if sound && cut { controller.wanted.max(h * factor) } else { h * factor };
        }
        if !handled && !forced {
            Dense(&state.memory.vectors).at(
                (end - controller.begin) / controller.length,
                controller.length,
                &mut state.positions,
                &mut state.velocities,
            );
        } else {
            state.memory.vectors.clear();
        }
        state.time = beginning;
        state.memory.numbers.clear();
        let Controller { wanted, last_error, begin, length } = controller;
        state.memory.numbers.extend([wanted, last_error, begin, length]);
        if forced {
            cost.solved(f64::INFINITY, worst);
        }
    }

    /// The inner steps keep within the limit by themselves.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}

/// Vectors for each particle that dense output is made of: positions, velocities and accelerations at the start and at the end of
/// the inner step, and the highest terms of positions and velocities.
const PARTS: usize = 8;

/// Dense output of an inner step: the parts one behind the other.
struct Dense<'a, V>(&'a [V]);

impl<V: Vector> Dense<'_, V> {
    /// The state at a part `theta` of a step of `h` (s).
    fn at(&self, theta: f64, h: f64, positions: &mut [V], velocities: &mut [V]) {
        let n = self.0.len() / PARTS;
        let part = |p: usize, i: usize| self.0[p * n + i];
        let [theta, rest, h] = [theta, 1.0 - theta, h].map(V::Scalar::from_f64);
        let value = |[y0, y1, f0, f1, highest]: [V; 5]| {
            let way = y1 - y0;
            let first = f0 * h - way;
            let second = way - f1 * h - first;
            y0 + (way + (first + (second + highest * rest) * theta) * rest) * theta
        };
        for (i, (x, v)) in positions.iter_mut().zip(velocities).enumerate() {
            *x = value([part(0, i), part(3, i), part(1, i), part(4, i), part(6, i)]);
            *v = value([part(1, i), part(4, i), part(2, i), part(5, i), part(7, i)]);
        }
    }
}

impl<T: Real> Buffers<T> {
    /// Puts the state to the end of the inner step that is remembered, whose rates there are those of the first stage.
    fn recall(&mut self, state: &mut Particles<T>) {
        let Particles { positions, velocities, memory, .. } = state;
        let n = positions.len();
        let part = |p: usize| &memory.vectors[p * n..(p + 1) * n];
        positions.copy_from_slice(part(3));
        velocities.copy_from_slice(part(4));
        let Rates { velocities, accelerations } = &mut self.rates[0];
        velocities.clear();
        velocities.extend_from_slice(part(4));
        accelerations.clear();
        accelerations.extend_from_slice(part(5));
    }

    /// Remembers the inner step of `h` (s) that was just taken.
    fn remember(&self, state: &mut Particles<T>, h: f64) {
        let Particles { positions, velocities, memory, .. } = state;
        let ends = [&self.rates[0], &self.rates[STAGES - 1]].map(|rates| &rates.accelerations);
        memory.vectors.clear();
        for part in [&self.start, &self.start_velocities, ends[0], positions, velocities, ends[1]] {
            memory.vectors.extend_from_slice(part);
        }
        let weights = DENSE.map(|weight| T::from_f64(h * weight));
        let sum = |rate: &dyn Fn(&Rates<T>) -> T::Vec3| {
            let mut sum = T::Vec3::ZERO;
            self.rates.iter().zip(weights).for_each(|(rates, weight)| sum += rate(rates) * weight);
            sum
        };
        let n = positions.len();
        memory.vectors.extend((0..n).map(|i| sum(&|rates| rates.velocities[i])));
        memory.vectors.extend((0..n).map(|i| sum(&|rates| rates.accelerations[i])));
    }

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
    /// units of the tolerance, and where it is largest.
    fn attempt(
        &mut self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        h: f64,
        time: f64,
        tolerance: f64,
        cost: &mut Cost,
    ) -> (f64, usize) {
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
        let (mut worst, mut particle) = (0.0, 0);
        for i in 0..state.len() {
            let (mut x, mut v) = (T::Vec3::ZERO, T::Vec3::ZERO);
            for (Rates { velocities, accelerations }, weight) in self.rates.iter().zip(ERROR) {
                let part = T::from_f64(h * weight);
                x += velocities[i] * part;
                v += accelerations[i] * part;
            }
            let error = x.length().to_f64().max(v.length().to_f64() * h);
            let error = if error.is_nan() { f64::INFINITY } else { error };
            if error > worst {
                (worst, particle) = (error, i);
            }
        }
        // No tolerance is finer than rounding.
        let far = state.positions.iter().map(|x| x.dot(*x).to_f64()).fold(0.0, f64::max).sqrt();
        (worst / tolerance.max(4.0 * T::EPSILON.to_f64() * far), particle)
    }
}

/// a += b s.
fn add<T: Real>(a: &mut [T::Vec3], b: &[T::Vec3], s: T) {
    a.iter_mut().zip(b).for_each(|(a, &b)| *a += b * s);
}
