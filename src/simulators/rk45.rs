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
use crate::math::lanes::{self, Kernel, LANES, Lanes};
use crate::math::parts::Parts;
use crate::math::rows::{self, Push, Start};
use crate::math::{Real, Vector};
use crate::model::Particles;
use std::ops::{Add, Mul, Sub};

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

/// What each stage counts.
type Weights = [f64; STAGES];

/// Coefficients: at which part of the step each stage stands, and how it is made of those before it. The last row is the
/// solution of order 5.
const NODES: Weights = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
const WEIGHTS: [Weights; STAGES] = [
    [0.0; STAGES],
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0, 0.0],
];
/// Order 5 minus order 4.
const ERROR: Weights = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339_200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// What of each stage makes up the highest term of the dense output.
const DENSE: Weights = [
    -12_715_105_075.0 / 11_282_082_432.0,
    0.0,
    87_487_479_700.0 / 32_700_410_799.0,
    -10_690_763_975.0 / 1_880_347_072.0,
    701_980_252_875.0 / 199_316_789_632.0,
    -1_453_857_185.0 / 822_651_844.0,
    69_997_945.0 / 29_380_423.0,
];

/// The same for positions. Their rates, the velocities of the stages, are that at the start and sums of accelerations, so that all
/// that is kept are accelerations (Nyström, "Über die numerische Integration von Differentialgleichungen", 1925).
const WEIGHTS_OF_WAYS: [Weights; STAGES] = {
    let mut all = [[0.0; STAGES]; STAGES];
    let mut stage = 0;
    while stage < STAGES {
        all[stage] = of_ways(&WEIGHTS[stage]);
        stage += 1;
    }
    all
};
const ERROR_OF_WAYS: Weights = of_ways(&ERROR);
const DENSE_OF_WAYS: Weights = of_ways(&DENSE);

/// What each acceleration counts in a sum of the velocities of the stages that has these weights.
const fn of_ways(weights: &Weights) -> Weights {
    let mut sums = [0.0; STAGES];
    let mut stage = 0;
    while stage < STAGES {
        let mut before = 0;
        while before < stage {
            sums[before] += weights[stage] * WEIGHTS[stage][before];
            before += 1;
        }
        stage += 1;
    }
    sums
}

/// Scratch of [`Rk45`].
#[derive(Debug, Default)]
pub struct Buffers<T: Real> {
    start: Vec<T::Vec3>,
    start_velocities: Vec<T::Vec3>,
    /// Accelerations in all stages, m/s².
    accelerations: [Vec<T::Vec3>; STAGES],
    /// Errors of positions (m) and of velocities (m/s) in the last inner step that was tried.
    errors: [Vec<T::Vec3>; 2],
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
        if !dense {
            (controller.begin, controller.length) = (beginning, 0.0);
        }
        let mut now = controller.begin + controller.length;
        if now < end {
            // Goes on from the end of the last inner step.
            if dense {
                scratch.recall(state);
            } else {
                problem.accelerations(state, &mut scratch.accelerations[0], cost);
            }
        }
        let (mut steps, mut forced) = (0, false);
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
            scratch.swap(state);
            let error = scratch.attempt(problem, state, h, now, self.tolerance, cost);
            let sound = error <= 1.0;
            if sound || forced {
                (controller.begin, controller.length) = (now, h);
                now = if forced || (cut && h >= left) { end } else { now + h };
                if now >= end && !handled && !forced {
                    scratch.remember(state, h, problem.useful_threads());
                }
                // The last stage is the first of the next step.
                scratch.accelerations.swap(0, STAGES - 1);
            } else {
                scratch.swap(state);
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
                problem.useful_threads(),
            );
        } else {
            state.memory.vectors.clear();
        }
        state.time = beginning;
        state.memory.numbers.clear();
        let Controller { wanted, last_error, begin, length } = controller;
        state.memory.numbers.extend([wanted, last_error, begin, length]);
        if forced {
            cost.solved(f64::INFINITY, scratch.worst(controller.length));
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
    fn at(&self, theta: f64, h: f64, positions: &mut [V], velocities: &mut [V], threads: usize) {
        let n = self.0.len() / PARTS;
        let [theta, h] = [theta, h].map(V::Scalar::from_f64);
        for (to, parts) in [(positions, [0, 3, 1, 4, 6]), (velocities, [1, 4, 2, 5, 7])] {
            let from = parts.map(|p| V::flat(&self.0[p * n..(p + 1) * n]));
            let between = Between { to: V::flat_mut(to), from, first: 0, theta, h };
            lanes::share(between, rows::UNIT, threads);
        }
    }
}

/// The numbers from `first` on between the ends of a step: of these the values, their rates, and the highest terms.
struct Between<'a, T> {
    to: &'a mut [T],
    from: [&'a [T]; 5],
    first: usize,
    theta: T,
    h: T,
}

impl<T: Real> Parts for Between<'_, T> {
    fn count(&self) -> usize {
        self.to.len()
    }

    fn split_at(self, at: usize) -> (Self, Self) {
        let (first, (to, rest)) = (self.first + at, self.to.split_at_mut(at));
        (Self { to, ..self }, Self { to: rest, first, ..self })
    }
}

#[expect(clippy::inline_always, reason = "a kernel")]
impl<T: Real> Kernel<T> for Between<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let Self { to, from: [y0, y1, f0, f1, highest], first, theta, h } = self;
        let rest = T::ONE - theta;
        let lanes = [L::splat(with, theta), L::splat(with, rest), L::splat(with, h)];
        let (eights, last) = to.as_chunks_mut::<LANES>();
        let mut at = first;
        for eight in eights {
            let [y0, y1] = [L::load(with, &y0[at..]), L::load(with, &y1[at..])];
            let [f0, f1] = [L::load(with, &f0[at..]), L::load(with, &f1[at..])];
            *eight = between([y0, y1, f0, f1, L::load(with, &highest[at..])], lanes).to_array();
            at += LANES;
        }
        for (i, to) in (at..).zip(last) {
            *to = between([y0[i], y1[i], f0[i], f1[i], highest[i]], [theta, rest, h]);
        }
    }
}

#[expect(clippy::inline_always, reason = "a kernel's")]
#[inline(always)]
fn between<N>([y0, y1, f0, f1, highest]: [N; 5], [theta, rest, h]: [N; 3]) -> N
where
    N: Copy + Add<Output = N> + Sub<Output = N> + Mul<Output = N>,
{
    let way = y1 - y0;
    let first = f0 * h - way;
    let second = way - f1 * h - first;
    y0 + (way + (first + (second + highest * rest) * theta) * rest) * theta
}

impl<T: Real> Buffers<T> {
    /// Puts the state to the end of the inner step that is remembered, whose accelerations there are those of the first stage.
    fn recall(&mut self, state: &mut Particles<T>) {
        let Particles { positions, velocities, memory, .. } = state;
        let n = positions.len();
        let part = |p: usize| &memory.vectors[p * n..(p + 1) * n];
        positions.copy_from_slice(part(3));
        velocities.copy_from_slice(part(4));
        self.accelerations[0].resize(n, T::Vec3::ZERO);
        self.accelerations[0].copy_from_slice(part(5));
    }

    /// Remembers the inner step of `h` (s) that was just taken.
    fn remember(&self, state: &mut Particles<T>, h: f64, threads: usize) {
        let Particles { positions, velocities, memory, .. } = state;
        let n = positions.len();
        memory.vectors.resize(PARTS * n, T::Vec3::ZERO);
        let (ends, highest) = memory.vectors.split_at_mut((PARTS - 2) * n);
        let [first, .., last] = &self.accelerations;
        let parts = [&self.start, &self.start_velocities, first, positions, velocities, last];
        for (place, part) in parts.into_iter().enumerate() {
            ends[place * n..(place + 1) * n].copy_from_slice(part);
        }
        let (of_positions, of_velocities) = highest.split_at_mut(n);
        // The weights have no sum, so the velocity at the start has no part in it.
        let terms = self.terms(h, &DENSE, &DENSE_OF_WAYS);
        rows::advance([of_positions, of_velocities], Start::Zero, T::ZERO, &terms, threads);
    }

    /// Takes the state as the start of an inner step, or puts it back to there.
    fn swap(&mut self, state: &mut Particles<T>) {
        let n = state.len();
        for (start, now) in
            [(&mut self.start, &mut state.positions), (&mut self.start_velocities, &mut state.velocities)]
        {
            start.resize(n, T::Vec3::ZERO);
            std::mem::swap(start, now);
        }
    }

    /// The accelerations, each with what it adds to positions and velocities in a step of `h` (s).
    fn terms(&self, h: f64, weights: &Weights, of_ways: &Weights) -> [Push<'_, T>; STAGES] {
        std::array::from_fn(|stage| {
            let factors = [h * h * of_ways[stage], h * weights[stage]].map(T::from_f64);
            (factors, &self.accelerations[stage][..])
        })
    }

    /// Takes an inner step of `h` (s) that starts at `time` (s), the accelerations of its first stage known; answers with its error in
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
        let threads = problem.useful_threads();
        for stage in 1..STAGES {
            let start = Start::At([&self.start, &self.start_velocities]);
            let terms = self.terms(h, &WEIGHTS[stage], &WEIGHTS_OF_WAYS[stage]);
            let ahead = T::from_f64(NODES[stage] * h);
            rows::advance([&mut state.positions, &mut state.velocities], start, ahead, &terms, threads);
            state.time = time + NODES[stage] * h;
            problem.accelerations(state, &mut self.accelerations[stage], cost);
        }
        let mut errors = std::mem::take(&mut self.errors);
        errors.iter_mut().for_each(|errors| errors.resize(state.len(), T::Vec3::ZERO));
        let [of_positions, of_velocities] = &mut errors;
        let terms = self.terms(h, &ERROR, &ERROR_OF_WAYS);
        rows::advance([of_positions, of_velocities], Start::Zero, T::ZERO, &terms, threads);
        self.errors = errors;
        // An error of velocity moves a particle as far within this step.
        let [of_positions, of_velocities] = self.errors.each_ref().map(|errors| rows::longest::<T>(errors));
        // No tolerance is finer than rounding.
        let far = rows::longest::<T>(&state.positions);
        of_positions.max(of_velocities * h) / tolerance.max(4.0 * T::EPSILON.to_f64() * far)
    }

    /// The particle whose error was largest in the last inner step, of `h` (s).
    fn worst(&self, h: f64) -> usize {
        let [of_positions, of_velocities] = &self.errors;
        let error = |(x, v): (&T::Vec3, &T::Vec3)| {
            let error = x.length().to_f64().max(v.length().to_f64() * h);
            if error.is_nan() { f64::INFINITY } else { error }
        };
        let errors = of_positions.iter().zip(of_velocities).map(error).enumerate();
        errors.fold((0, 0.0), |worst, one| if one.1 > worst.1 { one } else { worst }).0
    }
}
