//! Whether a simulation can be trusted: run-away states are caught in the step where they happen, jitter is told.
//!
//! Gravity, wind, hands and the energy at the start bound the kinetic energy that a cloth can have, since springs only
//! exchange energy and damping takes it away. A [`Ledger`] keeps that bound; kinetic energy far beyond it can only come
//! from the method. It takes one pass over the velocities a step, none where the method has seen how fast they are, and none over
//! the springs.

use super::cloth::Cloth;
use super::hand::{Grip, Hand};
use super::measure::Measures;
use crate::math::lanes::{self, Kernel, LANES, Lanes};
use crate::math::{Real, Vector};
use glam::DVec3;

/// The state of a simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[serde(tag = "state", rename_all = "lowercase")]
pub enum Health {
    /// Nothing to tell.
    #[default]
    Ok,
    /// Bounded, but not to be trusted.
    Unsettled {
        /// Step at which it was first seen.
        step: u64,
        /// Simulated time of that step, s.
        time: f64,
        /// A particle that shakes, or the one at which the equations are furthest from being solved.
        particle: u32,
        /// Why.
        cause: Cause,
    },
    /// Not finite, or with an energy that no force has given it. The state shown is the last good one, one step before.
    Diverged {
        /// Step that burst.
        step: u64,
        /// Simulated time at the end of that step, s.
        time: f64,
        /// The first particle that is not finite, else the fastest.
        particle: u32,
    },
}

/// Why a simulation that stays bounded is not to be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Cause {
    /// Particles shake from step to step: dt is beyond the limit of the current shape.
    Shaking,
    /// The method did not solve the equations of its step to its tolerance.
    Unsolved,
}

impl Health {
    /// Whether the simulation has diverged.
    pub fn is_diverged(&self) -> bool {
        matches!(self, Self::Diverged { .. })
    }
}

/// How much more kinetic energy than the forces can have given is taken as divergence: thirty times the speed. Stable methods
/// overshoot by a few per cent, unstable ones pass any factor within a few steps.
const EXCESS: f64 = 1e3;

/// The energy that the forces can have given to a cloth.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Ledger {
    /// Kinetic and elastic energy when the ledger was opened, with the work done by wind and hands since, J.
    given: f64,
    /// Σ m x when the ledger was opened, kg m.
    weighted: DVec3,
}

/// Kinetic energy (J) and Σ m x (kg m) of the particles that can move.
fn kinetic_and_weighted<T: Real>(cloth: &Cloth<T>) -> (f64, DVec3) {
    let masses = cloth.problem.mass.iter().zip(&cloth.problem.inverse_mass);
    let states = cloth.state.positions.iter().zip(&cloth.state.velocities);
    let free = masses.zip(states).filter(|((_, w), _)| **w > T::ZERO);
    free.fold((0.0, DVec3::ZERO), |(kinetic, weighted), ((m, _), (x, v))| {
        let m = m.to_f64();
        (kinetic + 0.5 * m * v.to_f64().length_squared(), weighted + x.to_f64() * m)
    })
}

/// Numbers or eights of them that are added up in the precision of the simulation: so few that rounding counts for nothing.
const BLOCK: usize = 64;

/// Σ |v|² (m²/s²) of all particles: in every step, so as fast as they can be read.
struct Squares<'a, T: Real>(&'a [T::Vec3]);

impl<T: Real> Kernel<T> for Squares<'_, T> {
    type Output = f64;

    #[expect(clippy::inline_always, reason = "a kernel")]
    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) -> f64 {
        let zero = L::splat(with, T::ZERO);
        let (eights, last) = T::Vec3::flat(self.0).as_chunks::<LANES>();
        let mut squares: f64 = last.iter().map(|c| c.to_f64() * c.to_f64()).sum();
        for block in eights.chunks(BLOCK) {
            // Four chains, or each sum would wait for the one before it.
            let [mut a, mut b, mut c, mut d] = [zero; 4];
            let (fours, rest) = block.as_chunks::<4>();
            for [p, q, r, s] in fours {
                let [p, q, r, s] = [L::of(with, *p), L::of(with, *q), L::of(with, *r), L::of(with, *s)];
                (a, b, c, d) = (a + p * p, b + q * q, c + r * r, d + s * s);
            }
            for eight in rest {
                let v = L::of(with, *eight);
                a = a + v * v;
            }
            squares += ((a + b) + (c + d)).to_array().into_iter().map(T::to_f64).sum::<f64>();
        }
        squares
    }
}

/// Σ v (m/s) of the particles that can move: wherever wind blows.
struct Motion<'a, T: Real> {
    velocities: &'a [T::Vec3],
    inverse_mass: &'a [T],
}

impl<T: Real> Kernel<T> for Motion<'_, T> {
    type Output = DVec3;

    #[expect(clippy::inline_always, reason = "a kernel")]
    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) -> DVec3 {
        let (velocities, last_velocities) = self.velocities.as_chunks::<LANES>();
        let (inverse_mass, last_inverse_mass) = self.inverse_mass.as_chunks::<LANES>();
        let mut sum = DVec3::ZERO;
        for (velocities, inverse_mass) in velocities.chunks(BLOCK).zip(inverse_mass.chunks(BLOCK)) {
            let [mut x, mut y, mut z] = [L::splat(with, T::ZERO); 3];
            for (velocities, w) in velocities.iter().zip(inverse_mass) {
                let (free, [u, v, w]) = (L::of(with, *w), L::vectors(with, velocities));
                (x, y, z) =
                    (x + u.where_positive(free), y + v.where_positive(free), z + w.where_positive(free));
            }
            let all = |lanes: L| lanes.to_array().into_iter().map(T::to_f64).sum::<f64>();
            sum += DVec3::new(all(x), all(y), all(z));
        }
        for (v, _) in last_velocities.iter().zip(last_inverse_mass).filter(|(_, w)| **w > T::ZERO) {
            sum += v.to_f64();
        }
        sum
    }
}

impl Ledger {
    /// Opens a ledger on the state given.
    pub fn open<T: Real>(cloth: &Cloth<T>) -> Self {
        let energy = Measures::of(&cloth.problem, &cloth.state).energy;
        Self { given: energy.kinetic + energy.elastic, weighted: kinetic_and_weighted(cloth).1 }
    }

    /// Books the work that hands do in their next step of `dt` (s): what it adds to the energy of the springs around a held
    /// particle, or to that of the spring that pulls; and the speed of the fastest hand for the whole cloth, which stiff
    /// cloth takes on at once.
    pub fn hands<T: Real>(&mut self, cloth: &Cloth<T>, hands: &[Hand], dt: f64) {
        let (springs, state) = (&cloth.problem.springs, &cloth.state);
        let farthest = hands.iter().map(|h| h.next().distance(h.at())).fold(0.0, f64::max);
        if farthest > 0.0 {
            let mass: f64 = cloth.problem.mass.iter().map(|m| m.to_f64()).sum();
            self.given += 0.5 * mass * (farthest / dt).powi(2);
        }
        for hand in hands.iter().filter(|h| h.next() != h.at()) {
            let energy = |k: f64, a: DVec3, b: DVec3, rest: f64| 0.5 * k * ((a - b).length() - rest).powi(2);
            let (from, to, index) = (hand.at(), hand.next(), cloth.index(hand.particle));
            let mut work = 0.0;
            if let Grip::Pull(k) = hand.grip {
                let x = state.positions[index].to_f64();
                work = energy(k, to, x, 0.0) - energy(k, from, x, 0.0);
            } else {
                for &[other, spring] in cloth.problem.incidence().around(index) {
                    let spring = spring as usize;
                    let (anchor, rest) =
                        (state.positions[other as usize].to_f64(), springs.rest[spring].to_f64());
                    let group = springs.groups.iter().find(|g| g.range.contains(&spring));
                    let k = group.map_or(0.0, |g| g.stiffness.to_f64());
                    work += energy(k, to, anchor, rest) - energy(k, from, anchor, rest);
                }
            }
            self.given += work.max(0.0);
        }
    }

    /// Books a step of `dt` (s) that ended in `cloth`; answers with the particle to blame where it has diverged.
    pub fn step<T: Real>(&mut self, cloth: &Cloth<T>, dt: f64) -> Option<u32> {
        let free = cloth.free;
        if free.count == 0 {
            // Nothing can move, so nothing can diverge.
            return None;
        }
        let (velocities, inverse_mass) = (&cloth.state.velocities[..], &cloth.problem.inverse_mass[..]);
        let gravity = cloth.problem.gravity.unwrap_or_default();
        let mut wind = DVec3::ZERO;
        if let Some(blowing) = &cloth.problem.wind {
            wind = blowing.force(cloth.state.time);
            self.given += (wind.dot(lanes::run(Motion { velocities, inverse_mass })) * dt).max(0.0);
        }
        // One spring length and one step of free acceleration a step are no sign of anything.
        let stride = cloth.mean_rest / dt;
        let push = wind * (free.count as f64 / free.mass) + gravity;
        let freely = 0.5 * free.mass * (stride * stride + (push * dt).length_squared());
        // All is well where not even a cloth as heavy as its heaviest particle had too much, if also what is held counted and
        // nothing had fallen. Not so where the sum is not finite.
        let squares = cloth.seen.map_or_else(|| lanes::run(Squares::<T>(velocities)), |seen| seen.squares);
        if 0.5 * free.heaviest * squares <= EXCESS * (self.given + freely) && squares.is_finite() {
            return None;
        }
        let (kinetic, weighted) = kinetic_and_weighted(cloth);
        let fallen = gravity.dot(weighted - self.weighted).max(0.0);
        // What is allowed is itself infinite where dt is so short that its square is 0.
        let finite = kinetic.is_finite() && weighted.is_finite();
        let sound = finite && kinetic <= EXCESS * (self.given + fallen + freely);
        (!sound).then(|| worst(cloth))
    }
}

/// The first particle that is not finite, else the fastest.
fn worst<T: Real>(cloth: &Cloth<T>) -> u32 {
    let positions = cloth.by_particle(&cloth.state.positions);
    let velocities = || cloth.by_particle(&cloth.state.velocities);
    let finite = |(x, v): (T::Vec3, T::Vec3)| x.to_f64().is_finite() && v.to_f64().is_finite();
    let broken = positions.zip(velocities()).position(|state| !finite(state));
    let fastest = || {
        let speeds = velocities().map(|v| v.to_f64().length_squared()).enumerate();
        speeds.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(i, _)| i)
    };
    broken.unwrap_or_else(fastest) as u32
}

/// Watches for particles that shake from step to step: beyond the limit of stability the fastest motion turns round every
/// step, and where the cloth is not linear it may stay bounded. Looks closely at a few steps out of many.
#[derive(Clone, Debug, Default)]
pub(super) struct Jitter {
    /// Where particles stand that have turned round in every step of this look, with their last velocity, m/s.
    shaking: Vec<(u32, DVec3)>,
    /// Steps of this look so far.
    looked: u64,
}

/// Steps from one look to the next.
const LOOK_EVERY: u64 = 64;
/// Steps in a row in which a particle must turn round: no smooth motion does so twice, chance hardly so often.
const TURNS: u64 = 8;
/// Cosine of the least angle that counts as turning round: 120 degrees, less than three steps a period.
const TURN: f64 = -0.5;
/// Least distance moved in a step, in spring lengths: far above rounding in single precision, below what the eye sees.
const VISIBLE: f64 = 1e-4;

impl Jitter {
    /// Sees the step of `dt` (s) that ended in `cloth`; answers with a particle that shakes.
    pub fn step<T: Real>(&mut self, cloth: &Cloth<T>, step: u64, dt: f64) -> Option<u32> {
        let velocity = |p: u32| cloth.state.velocities[p as usize].to_f64();
        if step.is_multiple_of(LOOK_EVERY) && cloth.mean_rest > 0.0 {
            self.looked = 0;
            self.shaking.clear();
            self.shaking.extend((0..cloth.state.len() as u32).map(|p| (p, velocity(p))));
            return None;
        }
        let least = VISIBLE * cloth.mean_rest / dt;
        self.shaking.retain_mut(|(p, before)| {
            let now = velocity(*p);
            let cosine = now.dot(*before);
            // Most go on, which is seen without their speed.
            let turned = cosine < 0.0 && cosine < TURN * now.length() * before.length();
            *before = now;
            turned && now.length() > least
        });
        self.looked += 1;
        let found = self.shaking.first().filter(|_| self.looked >= TURNS).map(|(p, _)| cloth.particle(*p));
        if self.looked >= TURNS {
            self.shaking.clear();
        }
        found
    }
}
