//! The classical Runge-Kutta method (Kutta, "Beitrag zur näherungsweisen Integration totaler Differentialgleichungen",
//! 1901): four looks at the slope, at the start, twice in the middle, and at the end of the step.
//!
//! With y = (x, v) and y' = f(t, y): k1 = f(t, y), k2 = f(t + dt/2, y + dt/2 k1), k3 = f(t + dt/2, y + dt/2 k2),
//! k4 = f(t + dt, y + dt k3), y(t + dt) = y + dt/6 (k1 + 2 k2 + 2 k3 + k4). Order 4; four force evaluations a step.
//!
//! Since x' = v, the velocities of the stages are sums of accelerations, and so all that is kept are these (Nyström, "Über die
//! numerische Integration von Differentialgleichungen", 1925): x(t + dt) = x + dt v + dt²/6 (a1 + a2 + a3).
//!
//! Choose it where small errors count: halving dt divides the error by 16. Per force evaluation its stable step is the
//! shortest of all methods here, and it loses energy slowly, so it is a poor choice near its limit.

use super::{Model, Simulator, region};
use crate::forces::{Cost, Mode, Problem, Spectrum};
use crate::math::rows::{self, Push, Start};
use crate::math::{Real, Vector};
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
    /// Accelerations in all stages, m/s².
    accelerations: [Vec<T::Vec3>; 4],
}

impl<T: Real> Default for Buffers<T> {
    fn default() -> Self {
        Self { stage: Particles::at_rest(Vec::new()), accelerations: Default::default() }
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
        let Buffers { stage, accelerations: [a1, a2, a3, a4] } = scratch;
        let zero = T::ZERO;
        let [half, third, sixth] = [2.0, 3.0, 6.0].map(|part| dt / T::from_f64(part));
        let threads = problem.useful_threads();
        stage.positions.resize(state.len(), T::Vec3::ZERO);
        stage.velocities.resize(state.len(), T::Vec3::ZERO);
        problem.accelerations(state, a1, cost);
        let mut go = |ahead: T, slopes: &[Push<T>], to: &mut Vec<T::Vec3>| {
            let start = Start::At([&state.positions, &state.velocities]);
            rows::advance([&mut stage.positions, &mut stage.velocities], start, ahead, slopes, threads);
            stage.time = state.time + ahead.to_f64();
            problem.accelerations(stage, to, cost);
        };
        go(half, &[([zero, half], a1)], a2);
        go(half, &[([half * half, zero], a1), ([zero, half], a2)], a3);
        go(dt, &[([half * dt, zero], a2), ([zero, dt], a3)], a4);
        let x = dt * sixth;
        let slopes = [([x, sixth], &a1[..]), ([x, third], a2), ([x, third], a3), ([zero, sixth], a4)];
        rows::advance([&mut state.positions, &mut state.velocities], Start::Here, dt, &slopes, threads);
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
