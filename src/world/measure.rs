//! What can be read off a cloth: energies, momentum, strain.

use crate::forces::Problem;
use crate::math::{Real, Vector};
use crate::model::Particles;
use glam::DVec3;

/// Mechanical energy by kind, J.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Energy {
    /// Σ m v² / 2.
    pub kinetic: f64,
    /// Σ m g y; 0 where gravity is off.
    pub gravitational: f64,
    /// Σ k (|d| - L)² / 2 over the springs that act.
    pub elastic: f64,
}

impl Energy {
    /// The sum.
    pub fn total(&self) -> f64 {
        self.kinetic + self.gravitational + self.elastic
    }
}

/// What can be read off a state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measures {
    /// Energies, J.
    pub energy: Energy,
    /// Σ m v, kg m/s.
    pub momentum: DVec3,
    /// Σ m x × v about the origin, kg m²/s.
    pub angular_momentum: DVec3,
    /// Largest |d|/L - 1 over the springs that act; 0 where there are none.
    pub max_strain: f64,
    /// Mean |d|/L - 1 over the springs that act.
    pub mean_strain: f64,
    /// Power that damping takes out: Σ c |v|² over the particles and Σ k_d |Δv|² over the springs that act, W.
    pub dissipation: f64,
    /// Power of the wind on the particles that can move, W.
    pub wind_power: f64,
}

impl Measures {
    /// Measures a state, in double precision. Springs of rest length 0 have no strain.
    pub fn of<T: Real>(problem: &Problem<T>, state: &Particles<T>) -> Self {
        let mut measures = Self::default();
        let gravity = problem.gravity.unwrap_or_default();
        let wind = problem.wind.as_ref().map_or(DVec3::ZERO, |w| w.force(state.time));
        for ((m, x), v) in problem.mass.iter().zip(&state.positions).zip(&state.velocities) {
            let (m, x, v) = (m.to_f64(), x.to_f64(), v.to_f64());
            measures.energy.kinetic += 0.5 * m * v.length_squared();
            measures.energy.gravitational -= m * gravity.dot(x);
            measures.momentum += v * m;
            measures.angular_momentum += x.cross(v) * m;
            measures.dissipation += problem.air_damping.to_f64() * v.length_squared();
            measures.wind_power += wind.dot(v);
        }
        if problem.spring_damping > T::ZERO {
            let k_d = problem.spring_damping.to_f64();
            for pair in &problem.springs.pairs {
                let [i, j] = pair.map(|p| state.velocities[p as usize].to_f64());
                measures.dissipation += k_d * (j - i).length_squared();
            }
        }
        let (mut sum, mut counted) = (0.0, 0u64);
        let mut largest = f64::NEG_INFINITY;
        for group in &problem.springs.groups {
            let k = group.stiffness.to_f64();
            for s in group.range.clone() {
                let [i, j] = problem.springs.pairs[s].map(|p| state.positions[p as usize].to_f64());
                let (length, rest) = ((j - i).length(), problem.springs.rest[s].to_f64());
                measures.energy.elastic += 0.5 * k * (length - rest) * (length - rest);
                if rest > 0.0 {
                    let strain = length / rest - 1.0;
                    largest = largest.max(strain);
                    sum += strain;
                    counted += 1;
                }
            }
        }
        if counted > 0 {
            measures.max_strain = largest;
            measures.mean_strain = sum / counted as f64;
        }
        measures
    }
}
