//! Implicit midpoint: velocity and position advance with the forces in the middle of the step.
//!
//! With x' = (x(t) + x(t + dt))/2 and v' = (v(t) + v(t + dt))/2: v(t + dt) = v + dt a(t + dt/2, x', v'), x(t + dt) = x + dt v'. That
//! is implicit Euler over dt/2 followed by as much again without looking at the forces (Hairer, Lubich, Wanner, "Geometric
//! Numerical Integration", 2006, II.1.2). Order 2.
//!
//! It is symplectic, keeps angular momentum, and damps nothing by itself: choose it for free, lively motion at a dt above
//! the limit of explicit methods. Motions faster than dt do not die away: very stiff cloth rings, where implicit Euler or
//! BDF2 come to rest. A step costs what one of implicit Euler does.
//!
//! Bounded it is only where forces are linear: springs that turn far in a step are longer at its ends than in its middle, and the
//! stiffer they are the more energy comes of that (Gonzalez, Simo, "On the stability of symplectic and energy-momentum
//! algorithms for non-linear Hamiltonian systems with symmetry", 1996). How much it is stands in a closed form, and the method
//! keeps account of it in its memory: S, what was created so far less what damping took, never below 0, and the largest kinetic
//! and elastic energy E on the way. All else in a step's balance (gravity, wind, air, hands) is exact in its middle, so energy is at
//! most what the start and the forces from outside gave, plus S. A step that would bring S above E/4 or whose equations were
//! not solved takes its second half as its first, by implicit Euler, which gives of S what it takes of kinetic energy; it is told as
//! unsolved: dt is then too long for this method. So energy stays below 4/3 of what was given. A quarter is what a motion
//! that dt follows can need: the energy that a symmetric method of order 2 keeps is off by (dt ω)²/4 of its own at most, and beyond
//! dt ω = 1 a turning spring is no longer followed.

use super::newton::{Newton, solved_by_newton};
use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::{Real, Vector};
use crate::model::Particles;

solved_by_newton! {
    /// Implicit midpoint.
    pub struct ImplicitMidpoint;
}

/// The most energy that may have been created, as a part of the largest kinetic and elastic energy.
const MOST_CREATED: f64 = 0.25;

/// Scratch of [`ImplicitMidpoint`].
#[derive(Debug, Default)]
pub struct Buffers<T: Real> {
    newton: Newton<T>,
    positions: Vec<T::Vec3>,
    velocities: Vec<T::Vec3>,
}

impl Simulator for ImplicitMidpoint {
    const ID: &'static str = "implicit_midpoint";
    const SUMMARY: &'static str =
        "Implicit midpoint: order 2 at any dt without damping of its own; for lively motion of stiff cloth.";
    const ORDER: u32 = 2;
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
        let Buffers { newton, positions, velocities } = scratch;
        positions.clone_from(&state.positions);
        velocities.clone_from(&state.velocities);
        let (beginning, half) = (state.time, dt * T::from_f64(0.5));
        state.time += half.to_f64();
        let unsolved = cost.unsolved_steps;
        let solved = newton.step(problem, state, half, self.accuracy(), cost);
        let [sum, largest] = match state.memory.numbers[..] {
            [sum, largest] => [sum, largest],
            _ => [0.0, 0.0],
        };
        let Balance { created, taken, energy, particle } = balance(problem, state, positions, dt.to_f64(), cost);
        let (created, largest) = ((sum + created - taken).max(0.0), energy.max(largest));
        let account = if solved && created <= MOST_CREATED * largest {
            let starts = positions.iter().zip(&*velocities);
            for ((x, v), (&from, &before)) in state.positions.iter_mut().zip(&mut state.velocities).zip(starts) {
                *x = from + *v * dt;
                *v += *v - before;
            }
            [created, largest]
        } else {
            if solved {
                cost.solved(created / (MOST_CREATED * largest), particle);
            }
            let first = kinetic_of_the_way(problem, velocities, &state.velocities);
            velocities.clone_from(&state.velocities);
            state.time = beginning + dt.to_f64();
            newton.step(problem, state, half, self.accuracy(), cost);
            cost.unsolved_steps = unsolved + 1; // and not 2
            let taken = first + kinetic_of_the_way(problem, velocities, &state.velocities);
            // What is not finite gives nothing back.
            [if taken > 0.0 { (sum - taken).max(0.0) } else { sum }, if largest.is_finite() { largest } else { 0.0 }]
        };
        state.memory.numbers.clear();
        state.memory.numbers.extend(account);
        state.time = beginning;
    }

    /// Theory sets no limit.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}

/// What implicit Euler takes of kinetic energy on the way from some velocities to others, J.
fn kinetic_of_the_way<T: Real>(problem: &Problem<T>, from: &[T::Vec3], to: &[T::Vec3]) -> f64 {
    let ways = problem.mass.iter().zip(from.iter().zip(to));
    ways.map(|(m, (&from, &to))| 0.5 * m.to_f64() * (to - from).dot(to - from).to_f64()).sum()
}

/// Energies of a step, J, and the particle at which most is created.
struct Balance {
    created: f64,
    /// By damping.
    taken: f64,
    /// Kinetic and elastic, in the middle.
    energy: f64,
    particle: usize,
}

/// The balance of a step of `dt` (s) from `start` (m) with its middle in `middle`.
///
/// The work of a spring over the step is that of the force in its middle, its energy that of its ends. With lengths l0, l', l1 at
/// start, middle and end they differ by k L (l1 - l0) ((l0 + l1) / 2l' - 1): nothing while the spring keeps its direction.
fn balance<T: Real>(
    problem: &Problem<T>,
    middle: &Particles<T>,
    start: &[T::Vec3],
    dt: f64,
    cost: &mut Cost,
) -> Balance {
    let (mut created, mut power, mut energy, mut most) = (0.0, 0.0, 0.0, (0.0, 0));
    let springs = &problem.springs;
    let spring_damping = problem.spring_damping.to_f64();
    for group in &springs.groups {
        let k = group.stiffness.to_f64();
        for s in group.range.clone() {
            let [i, j] = springs.pairs[s].map(|p| p as usize);
            let before = start[j] - start[i];
            let now = middle.positions[j] - middle.positions[i];
            let lengths = [before, now, now + (now - before)].map(|d| d.length().to_f64());
            let [l0, l, l1]: [f64; 3] = lengths;
            let rest = springs.rest[s].to_f64();
            energy += 0.5 * k * (l - rest) * (l - rest);
            let apart = middle.velocities[j] - middle.velocities[i];
            power += spring_damping * apart.dot(apart).to_f64();
            if l > 0.0 {
                let new = k * rest * (l1 - l0) * (0.5 * (l0 + l1) / l - 1.0);
                created += new;
                if new > most.0 {
                    most = (new, i);
                }
            }
        }
    }
    cost.spring_visits += springs.len() as u64;
    for (m, v) in problem.mass.iter().zip(&middle.velocities) {
        let square = v.dot(*v).to_f64();
        energy += 0.5 * m.to_f64() * square;
        power += problem.air_damping.to_f64() * square;
    }
    for pull in problem.pulls() {
        let v = middle.velocities[pull.particle as usize];
        power += pull.damping.to_f64() * v.dot(v).to_f64();
    }
    Balance { created, taken: dt * power, energy, particle: most.1 }
}
