//! Tearing: a spring longer than so many times its rest length breaks, for good, between two steps.
//!
//! All springs are judged on the same positions, so which of them break does not depend on an order. Looking at every spring
//! once more after every step would cost a good part of it. Where the step has seen how much the spring nearest to breaking had
//! left before it, and the longest way of a particle, none is looked at as long as no two of them can have used that up. Where
//! not, what was left is remembered with the positions at which that was so.

use crate::forces::Problem;
use crate::math::lanes::{self, Kernel, LANES, Lanes};
use crate::math::{Real, Vector};
use crate::model::{Seen, Springs};

/// When springs have to be looked at again.
#[derive(Debug)]
pub(super) struct Watch<T: Real> {
    /// The springs, by the problem's revision, and the ratio that they were judged by.
    judged: (u64, f64),
    /// Where the particles were, m.
    positions: Vec<T::Vec3>,
    /// How much longer any spring could at least become then without breaking, m.
    left: f64,
}

impl<T: Real> Default for Watch<T> {
    fn default() -> Self {
        Self { judged: (0, 0.0), positions: Vec::new(), left: 0.0 }
    }
}

/// More than what rounding can do to a length, a limit or a way, in units of the distance of 1 to the next number: each is
/// some ten operations.
const ROUNDING: f64 = 32.0;

/// The elongation, in rest lengths, of springs that are `max_ratio` x as long; less by what rounding can do, on the side of looking
/// once too often.
pub(super) fn limit<T: Real>(max_ratio: f64) -> T {
    T::from_f64(max_ratio * (1.0 - ROUNDING * T::EPSILON.to_f64()) - 1.0)
}

impl<T: Real> Watch<T> {
    /// The acting springs longer than `max_ratio` x their rest length at these positions, by index, in order.
    pub fn torn(
        &mut self,
        problem: &Problem<T>,
        positions: &[T::Vec3],
        seen: Option<Seen>,
        max_ratio: f64,
    ) -> Vec<usize> {
        let rounding = ROUNDING * T::EPSILON.to_f64();
        let spared = |way: f64, left: f64| 2.0 * way * (1.0 + rounding) < left;
        if let Some(seen) = seen {
            if spared(seen.way, seen.left) {
                return Vec::new();
            }
        } else if self.judged == (problem.revision(), max_ratio) {
            let spared = |square: f64| spared(square.sqrt(), self.left);
            // No way is longer than the diagonal of a cube on its largest component, which is found in half the time.
            let component = lanes::run(Component::<T> { from: &self.positions, to: positions });
            if spared(3.0 * component.to_f64())
                || spared(lanes::run(Way::<T> { from: &self.positions, to: positions }).to_f64())
            {
                return Vec::new();
            }
        }
        let (springs, ratio) = (&problem.springs, T::from_f64(max_ratio));
        let left = -lanes::run(Excess::<T> { springs, positions, limit: limit(max_ratio) }).to_f64();
        if seen.is_none() {
            self.judged = (problem.revision(), max_ratio);
            self.left = left;
            self.positions.clear();
            self.positions.extend_from_slice(positions);
        }
        if left > 0.0 {
            return Vec::new();
        }
        let is_torn = |s: &usize| length(springs, positions, *s) > springs.rest[*s] * ratio;
        (0..springs.len()).filter(is_torn).collect()
    }
}

fn length<T: Real>(springs: &Springs<T>, positions: &[T::Vec3], spring: usize) -> T {
    let [i, j] = springs.pairs[spring].map(|p| positions[p as usize]);
    (j - i).length()
}

fn larger<T: Real>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

fn largest<T: Real, L: Lanes<Scalar = T>>(lanes: L, other: T) -> T {
    lanes.to_array().into_iter().fold(other, |most, value| larger(value, most))
}

/// The square of the largest component of any particle's way, m².
struct Component<'a, T: Real> {
    from: &'a [T::Vec3],
    to: &'a [T::Vec3],
}

impl<T: Real> Kernel<T> for Component<'_, T> {
    type Output = T;

    #[expect(clippy::inline_always, reason = "a kernel")]
    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) -> T {
        let (from, last_from) = T::Vec3::flat(self.from).as_chunks::<LANES>();
        let (to, last_to) = T::Vec3::flat(self.to).as_chunks::<LANES>();
        let [mut one, mut other] = [L::splat(with, T::ZERO); 2];
        for (from, to) in from.chunks(2).zip(to.chunks(2)) {
            let way = L::of(with, to[0]) - L::of(with, from[0]);
            one = (way * way).max(one);
            if let ([_, from], [_, to]) = (from, to) {
                let way = L::of(with, *to) - L::of(with, *from);
                other = (way * way).max(other);
            }
        }
        let ways = last_from.iter().zip(last_to).map(|(&from, &to)| (to - from) * (to - from));
        ways.fold(largest(one.max(other), T::ZERO), |most, way| larger(way, most))
    }
}

/// The square of the longest way of a particle, m².
struct Way<'a, T: Real> {
    from: &'a [T::Vec3],
    to: &'a [T::Vec3],
}

impl<T: Real> Kernel<T> for Way<'_, T> {
    type Output = T;

    #[expect(clippy::inline_always, reason = "a kernel")]
    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) -> T {
        let (from, last_from) = self.from.as_chunks::<LANES>();
        let (to, last_to) = self.to.as_chunks::<LANES>();
        let mut most = L::splat(with, T::ZERO);
        for (from, to) in from.iter().zip(to) {
            let (a, b) = (L::vectors(with, from), L::vectors(with, to));
            let [x, y, z] = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
            most = (x * x + y * y + z * z).max(most);
        }
        let ways = last_from.iter().zip(last_to).map(|(&from, &to)| (to - from).dot(to - from));
        ways.fold(largest(most, T::ZERO), |most, way| larger(way, most))
    }
}

/// How much a spring is longest beyond `limit` x its rest length of elongation, m.
struct Excess<'a, T: Real> {
    springs: &'a Springs<T>,
    positions: &'a [T::Vec3],
    limit: T,
}

impl<T: Real> Kernel<T> for Excess<'_, T> {
    type Output = T;

    #[expect(clippy::inline_always, reason = "a kernel")]
    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) -> T {
        let Self { springs, positions, limit } = self;
        let limits = L::splat(with, limit);
        let none = T::from_f64(f64::NEG_INFINITY);
        let mut most = L::splat(with, none);
        let (pairs, _) = springs.pairs.as_chunks::<LANES>();
        let (rest, last) = springs.rest.as_chunks::<LANES>();
        for (pairs, rest) in pairs.iter().zip(rest) {
            let a = L::components(with, positions, &pairs.map(|[i, _]| i));
            let b = L::components(with, positions, &pairs.map(|[_, j]| j));
            let [x, y, z] = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
            let length = (x * x + y * y + z * z).sqrt();
            let rest = L::of(with, *rest);
            most = (length - rest - rest * limits).max(most);
        }
        let spring = springs.len() - last.len()..springs.len();
        let excess =
            spring.map(|s| length(springs, positions, s) - springs.rest[s] - springs.rest[s] * limit);
        excess.fold(largest(most, none), |most, excess| larger(excess, most))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forces::{Cost, SpringSet, springs::SpringParams};
    use crate::model::{Particles, Topology};
    use crate::simulators::{Build, SimulatorSettings};
    use glam::DVec3;

    /// Moves the particles of a sheet to so many times their distance from the middle, step by step, with and without memory: the
    /// same springs are found in every step. Answers with how many those were, and in how many steps springs were looked at.
    fn agree<T: Real>(side: u32, steps: u32, times: impl Fn(u32, &DVec3) -> f64) -> (usize, usize) {
        let mesh = crate::target::grid(side, side, 1.0, false);
        let rest: Vec<T::Vec3> = mesh.positions.iter().map(|p| T::Vec3::from_f64(*p)).collect();
        let topology = Topology::of(&mesh);
        let params = SpringParams::default();
        let set = SpringSet { topology: &topology, rest_positions: &rest, params: &params, broken: &[] };
        let mut problem = Problem::new(vec![T::ONE; rest.len()], &set);
        let mut watch = Watch::default();
        let (mut looks, mut found) = (0, 0);
        for step in 0..steps {
            let moved = |p: &DVec3| T::Vec3::from_f64(*p * times(step, p));
            let positions: Vec<T::Vec3> = mesh.positions.iter().map(moved).collect();
            let before = watch.positions.clone();
            let torn = watch.torn(&problem, &positions, None, 1.5);
            looks += usize::from(watch.positions != before);
            let springs = &problem.springs;
            let too_long = |s: &usize| length(springs, &positions, *s) > springs.rest[*s] * T::from_f64(1.5);
            let all: Vec<usize> = (0..springs.len()).filter(too_long).collect();
            assert_eq!(torn, all, "step {step}");
            found += torn.len();
            if !torn.is_empty() {
                problem.remove_springs(&torn);
            }
        }
        assert!(found < topology.pairs.concat().len());
        (found, looks)
    }

    #[test]
    fn springs_are_found_in_the_step_in_which_they_are_too_long() {
        let more_and_more =
            |step: u32, p: &DVec3| 1.0 + 0.002 * f64::from(step) * (1.0 + (p.x * 0.9 + p.z * 1.7).sin());
        for side in [5, 9, 20] {
            assert!(agree::<f32>(side, 400, more_and_more).0 > 10);
            assert!(agree::<f64>(side, 400, more_and_more).0 > 10);
        }
    }

    /// No particle of five by five goes farther than a twentieth of 2 sqrt(2) m, two of them not as far as the half metre that the
    /// shortest springs have left.
    /// A sheet on its first row is pulled down until it tears: in every step, of two of the method's, the springs are found that are
    /// too long, by what it has seen.
    fn agree_with_steps<T: Build>() {
        let mesh = crate::target::grid(13, 11, 1.0, false);
        let rest: Vec<T::Vec3> = mesh.positions.iter().map(|p| T::Vec3::from_f64(*p)).collect();
        let topology = Topology::of(&mesh);
        let params = SpringParams::default();
        let set = SpringSet { topology: &topology, rest_positions: &rest, params: &params, broken: &[] };
        let mut problem = Problem::new(vec![T::ONE; rest.len()], &set);
        problem.gravity = Some(DVec3::new(1.0, -30.0, 60.0));
        problem.tearing = Some(limit(1.5));
        (0..13).for_each(|particle| problem.set_fixed(particle, true));
        let mut state = Particles::at_rest(rest);
        let mut stepper = T::build(&SimulatorSettings::new("symplectic_euler")).unwrap();
        let (mut watch, mut spared, mut found) = (Watch::default(), 0, 0);
        for step in 0..1000 {
            for _ in 0..2 {
                stepper.step(&problem, &mut state, T::from_f64(0.001), &mut Cost::default());
            }
            let seen = state.seen.take().unwrap();
            spared += usize::from(2.0 * seen.way < seen.left);
            let springs = &problem.springs;
            let too_long =
                |s: &usize| length(springs, &state.positions, *s) > springs.rest[*s] * T::from_f64(1.5);
            let all: Vec<usize> = (0..springs.len()).filter(too_long).collect();
            let torn = watch.torn(&problem, &state.positions, Some(seen), 1.5);
            assert_eq!(torn, all, "step {step}");
            found += torn.len();
            problem.remove_springs(&torn);
        }
        assert!(spared > 100 && found > 10, "{spared} steps spared, {found} springs torn");
    }

    #[test]
    fn springs_are_found_by_what_steps_have_seen() {
        agree_with_steps::<f32>();
        agree_with_steps::<f64>();
    }

    #[test]
    fn springs_that_cannot_have_become_too_long_are_not_looked_at_again() {
        let swing = |step: u32, _: &DVec3| 1.0 + 0.05 * (0.1 * f64::from(step)).sin();
        assert_eq!(agree::<f32>(5, 400, swing), (0, 1));
        assert_eq!(agree::<f64>(5, 400, swing), (0, 1));
    }
}
