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
//! algorithms for non-linear Hamiltonian systems with symmetry", 1996). How much it is stands in a closed form. A step that would
//! create more than a tenth of what there is, or whose equations were not solved, takes its second half as its first, by
//! implicit Euler, and is told as unsolved: dt is then too long for this method.

use super::newton::{Newton, solved_by_newton};
use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::{Real, Vector};
use crate::model::Particles;

solved_by_newton! {
    /// Implicit midpoint.
    pub struct ImplicitMidpoint;
}

/// The most energy that a step may create, as a part of the kinetic and elastic energy in its middle. Steps that follow the
/// motion stay an order of magnitude below.
const MOST_CREATED: f64 = 0.1;

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
        let (share, particle) = created(problem, state, positions, cost);
        if solved && share <= MOST_CREATED {
            let starts = positions.iter().zip(&*velocities);
            for ((x, v), (&from, &before)) in state.positions.iter_mut().zip(&mut state.velocities).zip(starts) {
                *x = from + *v * dt;
                *v += *v - before;
            }
        } else {
            if solved {
                cost.solved(share / MOST_CREATED, particle);
            }
            state.time = beginning + dt.to_f64();
            newton.step(problem, state, half, self.accuracy(), cost);
            cost.unsolved_steps = unsolved + 1; // and not 2
        }
        state.time = beginning;
    }

    /// Theory sets no limit.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}

/// The energy that a step from `start` (m) with its middle in `middle` creates, as a part of what there is, and the particle
/// at which most of it is created.
///
/// The work of a spring over the step is that of the force in its middle, its energy that of its ends. With lengths l0, l', l1 at
/// start, middle and end they differ by k L (l1 - l0) ((l0 + l1) / 2l' - 1): nothing while the spring keeps its direction.
fn created<T: Real>(problem: &Problem<T>, middle: &Particles<T>, start: &[T::Vec3], cost: &mut Cost) -> (f64, usize) {
    let (mut sum, mut energy, mut most) = (0.0, 0.0, (0.0, 0));
    let springs = &problem.springs;
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
            if l > 0.0 {
                let new = k * rest * (l1 - l0) * (0.5 * (l0 + l1) / l - 1.0);
                sum += new;
                if new > most.0 {
                    most = (new, i);
                }
            }
        }
    }
    cost.spring_visits += springs.len() as u64;
    let moving = problem.mass.iter().zip(&middle.velocities);
    energy += moving.map(|(m, v)| 0.5 * m.to_f64() * v.dot(*v).to_f64()).sum::<f64>();
    (if sum > 0.0 { sum / energy } else { 0.0 }, most.1)
}
