//! The classical Runge-Kutta method (Kutta, "Beitrag zur näherungsweisen Integration totaler Differentialgleichungen",
//! 1901): four looks at the slope, at the start, twice in the middle, and at the end of the step.
//!
//! With y = (x, v) and y' = f(t, y): k1 = f(t, y), k2 = f(t + dt/2, y + dt/2 k1), k3 = f(t + dt/2, y + dt/2 k2),
//! k4 = f(t + dt, y + dt k3), y(t + dt) = y + dt/6 (k1 + 2 k2 + 2 k3 + k4). Order 4; four force evaluations a step.
//!
//! Choose it where small errors count: halving dt divides the error by 16. Per force evaluation its stable step is the
//! shortest of all methods here, and it loses energy slowly, so it is a poor choice near its limit.

use super::{Model, Simulator, region};
use crate::forces::{Cost, Mode, Problem, Spectrum};
use crate::math::Real;
use crate::math::parts::each_particle;
use crate::model::Particles;

crate::params! {
    /// The classical Runge-Kutta method has no parameters of its own.
    pub struct Rk4 {}
}

/// Scratch of [`Rk4`].
#[derive(Debug)]
pub struct Buffers<T: Real> {
    /// The state in which the next slope is taken.
    stage: Particles<T>,
    /// Forces, N.
    force: Vec<T::Vec3>,
    /// Weighted sums of the slopes so far: of positions, m/s, and of velocities, m/s².
    sums: Vec<[T::Vec3; 2]>,
}

impl<T: Real> Default for Buffers<T> {
    fn default() -> Self {
        Self { stage: Particles::at_rest(Vec::new()), force: Vec::new(), sums: Vec::new() }
    }
}

impl Simulator for Rk4 {
    const ID: &'static str = "rk4";
    const SUMMARY: &'static str =
        "Runge-Kutta 4: four force evaluations a step; the choice for small errors, and the lab's reference.";
    const ORDER: u32 = 4;
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
        let Buffers { stage, force, sums } = scratch;
        let (two, half, sixth) = (T::from_f64(2.0), T::from_f64(0.5) * dt, dt / T::from_f64(6.0));
        let threads = problem.useful_threads();
        force.resize(state.len(), T::Vec3::default());
        stage.positions.clone_from(&state.positions);
        stage.velocities.clone_from(&state.velocities);
        stage.time = state.time;
        sums.clear();
        sums.resize(state.len(), [T::Vec3::default(); 2]);

        // Of each slope: its weight, and how far along it the next one is taken.
        for (weight, ahead) in [(T::ONE, half), (two, half), (two, dt)] {
            problem.forces(stage, force, cost);
            let starts = (&state.positions[..], &state.velocities[..]);
            let stages = (&mut stage.positions[..], &mut stage.velocities[..]);
            let slopes = (&force[..], &problem.inverse_mass[..], &mut sums[..]);
            each_particle((starts, stages, slopes), threads, |(starts, stages, (force, inverse_mass, sums))| {
                let starts = starts.0.iter().zip(starts.1);
                let stages = stages.0.iter_mut().zip(stages.1);
                let slopes = force.iter().zip(inverse_mass).zip(sums);
                for (((x0, v0), (x, v)), ((&f, &w), sum)) in starts.zip(stages).zip(slopes) {
                    let (velocity, acceleration) = (*v, f * w);
                    sum[0] += velocity * weight;
                    sum[1] += acceleration * weight;
                    *x = *x0 + velocity * ahead;
                    *v = *v0 + acceleration * ahead;
                }
            });
            stage.time = state.time + ahead.to_f64();
        }
        problem.forces(stage, force, cost);
        let particles = (&mut state.positions[..], &mut state.velocities[..]);
        let slopes = (&stage.velocities[..], &force[..], &problem.inverse_mass[..], &sums[..]);
        each_particle((particles, slopes), threads, |(particles, (stage, force, inverse_mass, sums))| {
            let particles = particles.0.iter_mut().zip(particles.1);
            let slopes = stage.iter().zip(force).zip(inverse_mass).zip(sums);
            for ((x, v), (((&velocity, &f), &w), sum)) in particles.zip(slopes) {
                // One that no force moves goes by dt v exactly, not by a sum of sixths.
                *x += if w > T::ZERO { (sum[0] + velocity) * sixth } else { *v * dt };
                *v += (sum[1] + f * w) * sixth;
            }
        });
    }

    /// A motion with the roots z/dt of z² + dt g z + dt² ω² = 0 stays bounded while |1 + z + z²/2 + z³/6 + z⁴/24| ≤ 1:
    /// dt ω ≤ 2.828 without damping, dt g ≤ 2.785 where damping rules (Hairer, Wanner, "Solving Ordinary Differential
    /// Equations II", 1996, IV.2).
    fn dt_limit(&self, spectrum: &Spectrum) -> Option<f64> {
        let multiplier = |Mode { omega_squared, damping }: Mode, dt: f64| {
            let (middle, square) = (-0.5 * dt * damping, dt * dt * (0.25 * damping * damping - omega_squared));
            let root = square.abs().sqrt();
            if square > 0.0 { growth(middle - root, 0.0) } else { growth(middle, root) }
        };
        region::dt_limit(spectrum, |mode| region::longest_stable(mode, multiplier))
    }
}

/// |1 + z + z²/2 + z³/6 + z⁴/24| at z = re + i im, by Horner's rule.
fn growth(re: f64, im: f64) -> f64 {
    let (mut a, mut b) = (1.0, 0.0);
    for n in [4.0, 3.0, 2.0, 1.0] {
        (a, b) = (1.0 + (a * re - b * im) / n, (a * im + b * re) / n);
    }
    a.hypot(b)
}
