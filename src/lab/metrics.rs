//! How far two trajectories are apart.

use super::reference::Reference;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Distance of a trajectory from the reference, over the free particles and the sampled times that are compared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Root of the mean squared distance, m.
    pub rms: f64,
    /// Largest distance, m.
    pub max: f64,
    /// `rms` over the RMS displacement from the start; 0 where nothing moves.
    pub relative: f64,
}

/// Mean squared distance over the particles that count, m².
pub fn mean_square(free: &[bool], a: &[DVec3], b: &[DVec3]) -> f64 {
    let distances = free.iter().zip(a.iter().zip(b)).filter(|(free, _)| **free);
    let (sum, count) =
        distances.fold((0.0, 0u64), |(sum, n), (_, (a, b))| (sum + a.distance_squared(*b), n + 1));
    if count > 0 { sum / count as f64 } else { 0.0 }
}

/// RMS distance over particles and times, m; infinite where the second has fewer times.
pub fn rms(free: &[bool], a: &[Vec<DVec3>], b: &[Vec<DVec3>]) -> f64 {
    if b.len() < a.len() {
        return f64::INFINITY;
    }
    let sum: f64 = a.iter().zip(b).map(|(a, b)| mean_square(free, a, b)).sum();
    if a.is_empty() { 0.0 } else { (sum / a.len() as f64).sqrt() }
}

/// Largest distance over particles and times, m.
pub fn largest(free: &[bool], a: &[Vec<DVec3>], b: &[Vec<DVec3>]) -> f64 {
    let pairs = a.iter().zip(b).flat_map(|(a, b)| free.iter().zip(a.iter().zip(b)));
    pairs.filter(|(free, _)| **free).map(|(_, (a, b))| a.distance(*b)).fold(0.0, f64::max)
}

/// The errors of some sampled positions, over the times up to which a comparison holds; none where no time is left, or
/// the trajectory does not reach that far.
pub fn errors(free: &[bool], reference: &Reference, samples: &[Vec<DVec3>]) -> Option<Errors> {
    let truth = reference.comparable();
    if truth.is_empty() || samples.len() < truth.len() {
        return None;
    }
    let rms = rms(free, truth, samples);
    let relative = if reference.displacement > 0.0 { rms / reference.displacement } else { 0.0 };
    rms.is_finite().then(|| Errors { rms, max: largest(free, truth, samples), relative })
}
