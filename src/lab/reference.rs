//! The converged solution of a scene's springs that errors are measured against, with its own uncertainty.
//!
//! Runge-Kutta 4 in double precision at dt ω ≤ 0.15, where ω bounds the fastest motion in any shape; repeated at half the
//! step, and the difference of the two is the uncertainty. A second method, velocity Verlet extrapolated to dt = 0 from
//! two steps (Richardson, "The deferred approach to the limit", 1927), confirms it. Started 1e-8 m apart, two solutions
//! tell up to when trajectories can be compared at all: while their distance grows less than a hundredfold.

use super::statistics::Statistics;
use super::trial::{self, Keep};
use super::{Case, Event, Progress, Settings, Stop, metrics};
use crate::forces::Spectrum;
use crate::math::random::Xorshift;
use crate::scene::Refusal;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// Largest dt ω of the reference.
const STEP: f64 = 0.15;
/// Distance of the two starts, m, RMS.
const APART: f64 = 1e-8;
/// Growth of that distance up to which trajectories are compared.
const GROWTH: f64 = 100.0;
/// An error counts where it is this many times the uncertainty.
pub const MARGIN: f64 = 10.0;

/// A converged solution.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Reference {
    /// How it was made.
    pub method: String,
    /// Its step, s.
    pub dt: f64,
    /// Its distance from the same at twice the step, m, RMS over the compared times.
    pub uncertainty: f64,
    /// The method that checked it.
    pub second_method: String,
    /// The distance of that one's solution, m.
    pub second_distance: f64,
    /// Time up to which trajectories are compared, s from the start; after it only statistics are.
    pub valid_until: f64,
    /// How much two starts 1e-8 m apart had grown apart at most over the compared times.
    pub growth: f64,
    /// RMS displacement of the free particles from the start over the compared times, m.
    pub displacement: f64,
    /// Largest strain at the sampled times.
    pub max_strain: f64,
    /// Mean strain at the end.
    pub mean_strain: f64,
    /// Kinetic, gravitational and elastic energy at the end, J.
    pub energy: [f64; 3],
    /// Springs looked at by it for each simulated second.
    pub work: f64,
    /// What is compared where trajectories are not.
    pub statistics: Statistics,
    /// Positions at every sampled time, m.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub samples: Vec<Vec<DVec3>>,
    /// Time between two samples, s.
    pub interval: f64,
}

impl Reference {
    /// The samples that trajectories are compared at.
    pub fn comparable(&self) -> &[Vec<DVec3>] {
        let count = (self.valid_until / self.interval).round() as usize;
        &self.samples[..count.min(self.samples.len())]
    }

    /// Whether an error (m) is too small to be told by this reference.
    pub fn hides(&self, error: f64) -> bool {
        error < MARGIN * self.uncertainty
    }

    /// An error (m) for ranking: those too small to be told are alike, none is the largest.
    pub fn told(&self, error: Option<f64>) -> f64 {
        error.map_or(f64::INFINITY, |error| error.max(MARGIN * self.uncertainty))
    }

    /// The same without its positions, as reports have it.
    #[must_use]
    pub fn summary(&self) -> Self {
        Self { samples: Vec::new(), ..self.clone() }
    }
}

/// The references found so far, by what they depend on; with a folder they outlive the process.
#[derive(Default)]
pub struct References {
    known: Mutex<BTreeMap<u64, Arc<Reference>>>,
    folder: Option<PathBuf>,
}

impl References {
    /// References that are kept in a folder too.
    pub fn in_folder(folder: impl Into<PathBuf>) -> Self {
        Self { folder: Some(folder.into()), ..Self::default() }
    }

    /// The reference of a case, computed where it is not known.
    ///
    /// # Errors
    /// A case whose converged solution itself bursts; a listener that stops it.
    pub fn of(&self, case: &Case, progress: Progress) -> Result<Arc<Reference>, Stop> {
        let key = case.key();
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = known().get(&key) {
            return Ok(Arc::clone(found));
        }
        let file = self.folder.as_ref().map(|folder| folder.join(format!("reference-{key:016x}.json")));
        let stored = file.as_ref().and_then(|file| std::fs::read_to_string(file).ok());
        let stored: Option<Reference> = stored.and_then(|text| serde_json::from_str(&text).ok());
        let reference = if let Some(reference) = stored {
            reference
        } else {
            let fresh = solve(case, progress)?;
            if let Some(file) = &file {
                let text = serde_json::to_vec(&fresh).map_err(|e| Refusal::new(e.to_string()))?;
                super::journal::write_whole(file, &text)?;
            }
            fresh
        };
        let reference = Arc::new(reference);
        known().insert(key, Arc::clone(&reference));
        Ok(reference)
    }
}

/// Computes the reference of a case.
///
/// # Errors
/// A case whose converged solution itself bursts; a listener that stops it.
pub fn solve(case: &Case, progress: Progress) -> Result<Reference, Stop> {
    progress(Event::Stage("reference"));
    let (problem, _) = case.start().problem(case.scene())?;
    let stiffest = Spectrum::stiffest(&problem);
    let rate = stiffest.omega_max().max(stiffest.extreme(0.0, 1.0).damping);
    let longest = case.seconds / f64::from(case.samples.max(1)) / 8.0;
    // Rounded up, so that dt ω stays below the bound.
    let coarse = case.steps(longest.min(STEP / rate.max(f64::MIN_POSITIVE))) + u64::from(case.samples);

    let nudged = nudged(case);
    let runs = [
        (case, "rk4", coarse, false),
        (case, "rk4", 2 * coarse, true),
        (&nudged, "rk4", coarse, false),
        (case, "velocity_verlet", coarse, false),
        (case, "velocity_verlet", 2 * coarse, false),
    ];
    let runs: Vec<_> = runs
        .par_iter()
        .map(|(case, simulator, steps, statistics)| {
            let settings = Settings::double(simulator, case.dt(*steps));
            let keep = Keep { statistics: *statistics, ..Keep::default() };
            trial::run(case, settings.apply(case.scene()), keep, progress)
        })
        .collect::<Result<_, _>>()?;
    if let Some(burst) = runs.iter().find(|run| run.health.is_diverged()) {
        return Err(Refusal::new(format!(
            "the converged solution itself bursts ({:?}); accepted: a shorter time, --seconds",
            burst.health
        ))
        .into());
    }
    let [half, fine, apart, verlet, verlet_fine] = &runs[..] else { return Err(Stop::Cancelled) };

    let free = case.free();
    let interval = case.seconds / f64::from(case.samples.max(1));
    let between = |a: &[Vec<DVec3>], b: &[Vec<DVec3>]| -> Vec<f64> {
        a.iter().zip(b).map(|(a, b)| metrics::mean_square(&free, a, b).sqrt()).collect()
    };
    let growth: Vec<f64> = between(&half.samples, &apart.samples).iter().map(|d| d / APART).collect();
    let valid = growth.iter().take_while(|g| **g < GROWTH).count();
    let over = |distances: &[f64]| {
        let sum: f64 = distances.iter().take(valid).map(|d| d * d).sum();
        (sum / valid.max(1) as f64).sqrt()
    };
    let extrapolated: Vec<Vec<DVec3>> = verlet_fine
        .samples
        .iter()
        .zip(&verlet.samples)
        .map(|(fine, coarse)| fine.iter().zip(coarse).map(|(f, c)| (*f * 4.0 - *c) / 3.0).collect())
        .collect();
    let start = vec![case.start().motion().0; fine.samples.len()];
    let energy = fine.end.energy;
    Ok(Reference {
        method: "rk4, Double".to_owned(),
        dt: case.dt(2 * coarse),
        uncertainty: over(&between(&half.samples, &fine.samples)),
        second_method: "velocity_verlet, extrapolated to dt = 0".to_owned(),
        second_distance: over(&between(&extrapolated, &fine.samples)),
        valid_until: interval * valid as f64,
        growth: growth.iter().take(valid.max(1)).copied().fold(0.0, f64::max),
        displacement: over(&between(&start, &fine.samples)),
        max_strain: fine.max_strain,
        mean_strain: fine.end.mean_strain,
        energy: [energy.kinetic, energy.gravitational, energy.elastic],
        work: fine.cost.spring_visits as f64 / case.seconds,
        statistics: fine.statistics.clone().unwrap_or_default(),
        samples: fine.samples.clone(),
        interval,
    })
}

/// The case with every free particle moved by a fixed pseudo-random vector, 1e-8 m in RMS.
fn nudged(case: &Case) -> Case {
    let (mut positions, velocities) = case.start().motion();
    let mut numbers = Xorshift::new(0x2545_f491_4f6c_dd1d);
    let mut random = || numbers.centred();
    for (x, free) in positions.iter_mut().zip(case.free()) {
        if free {
            // Three components, each even over one unit: RMS 1/2.
            *x += DVec3::new(random(), random(), random()) * (2.0 * APART);
        }
    }
    case.from(case.start().moved(&positions, &velocities))
}
