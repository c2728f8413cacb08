//! One run: a scene from the case's start over its time, sampled at equally spaced times, with its work and its health.

use super::statistics::{Statistics, Watch};
use super::{Case, Event, Progress, Stop};
use crate::forces::Cost;
use crate::scene::Scene;
use crate::world::{Health, Measures};
use glam::DVec3;

/// What a run gave.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Positions (m) at the sampled times that were reached.
    pub samples: Vec<Vec<DVec3>>,
    /// What could be read off the last state.
    pub end: Measures,
    /// Largest strain at any sampled time.
    pub max_strain: f64,
    /// Largest error of the energy ledger E(t) - E(0) - work of the wind + dissipation, over the largest kinetic and
    /// elastic energy on the way; 0 where it was not kept.
    pub energy_drift: f64,
    /// Steps taken.
    pub steps: u64,
    /// Work.
    pub cost: Cost,
    /// What became of it.
    pub health: Health,
    /// Whether it was given up because it would have cost too much.
    pub given_up: bool,
    /// Its statistics, where they were kept.
    pub statistics: Option<Statistics>,
}

/// The three zones of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Zone {
    /// Nothing to tell.
    Quiet,
    /// Bounded, but shaking from step to step.
    Unsettled,
    /// Burst.
    Diverged,
}

impl From<Health> for Zone {
    fn from(health: Health) -> Self {
        match health {
            Health::Ok => Self::Quiet,
            Health::Unsettled { .. } => Self::Unsettled,
            Health::Diverged { .. } => Self::Diverged,
        }
    }
}

/// Steps between two questions whether to go on.
const ASK_EVERY: u64 = 16;
/// Steps after which the work of a whole run is foreseen.
const LOOK_AHEAD: u64 = 8;

/// Energies added up along a run, by the trapezoidal rule over its steps.
#[derive(Default)]
struct Ledger {
    start: f64,
    /// Work of the wind minus dissipation since the start, J.
    given: f64,
    power: f64,
    largest: f64,
    error: f64,
}

impl Ledger {
    fn book(&mut self, measures: &Measures, dt: f64) {
        let power = measures.wind_power - measures.dissipation;
        self.given += 0.5 * dt * (self.power + power);
        self.power = power;
        self.largest = self.largest.max(measures.energy.kinetic + measures.energy.elastic);
        self.error = self.error.max((measures.energy.total() - self.start - self.given).abs());
    }
}

/// What is kept of a run besides its samples, and how much it may cost.
#[derive(Clone, Copy, Debug, Default)]
pub struct Keep {
    /// An energy ledger: about two force evaluations a step more.
    pub ledger: bool,
    /// The statistics.
    pub statistics: bool,
    /// Most springs that may be looked at: a run that has passed it, or plainly will, is given up.
    pub most_visits: Option<u64>,
}

/// Runs a case with an edited scene.
///
/// # Errors
/// A scene that cannot be run, or a listener that stops it.
pub fn run_scene(case: &Case, scene: Scene, progress: Progress) -> Result<Trial, Stop> {
    run(case, scene, Keep::default(), progress)
}

/// The same, keeping more.
///
/// # Errors
/// Those of [`run_scene`].
pub fn run(case: &Case, scene: Scene, keep: Keep, progress: Progress) -> Result<Trial, Stop> {
    let count = case.steps(scene.dt);
    let mass = if keep.statistics { case.start().problem(&scene)?.0.mass } else { Vec::new() };
    let mut watch = keep.statistics.then(|| Watch::new(mass, count));
    let mut world = case.world(scene)?;
    let dt = world.scene().dt;
    let between = count / u64::from(case.samples.max(1));
    let mut samples = Vec::new();
    let mut max_strain = f64::NEG_INFINITY;
    let before = world.measures();
    let mut book = Ledger { start: before.energy.total(), ..Ledger::default() };
    book.book(&before, 0.0);
    let mut given_up = false;
    if let Some(watch) = &mut watch {
        watch.step(0, &world);
    }
    for step in 1..=count {
        world.step();
        if world.health().is_diverged() {
            break;
        }
        if keep.ledger {
            book.book(&world.measures(), dt);
        }
        if let Some(watch) = &mut watch {
            watch.step(step, &world);
        }
        if step % between == 0 {
            max_strain = max_strain.max(world.measures().max_strain);
            samples.push(world.positions());
            if let Some(watch) = &mut watch {
                watch.sample(&world);
            }
        }
        if let Some(most) = keep.most_visits {
            let visits = world.cost().spring_visits;
            // The first steps tell how long the rest will take: twice too long is plain enough.
            let plain =
                step == LOOK_AHEAD && visits as f64 * (count as f64 / step as f64) > 2.0 * most as f64;
            if step < count && (visits > most || plain) {
                given_up = true;
                break;
            }
        }
        if step % ASK_EVERY == 0 && !progress(Event::Alive) {
            return Err(Stop::Cancelled);
        }
    }
    let end = world.measures();
    Ok(Trial {
        samples,
        max_strain: max_strain.max(end.max_strain),
        end,
        energy_drift: if book.largest > 0.0 { book.error / book.largest } else { 0.0 },
        steps: world.steps(),
        cost: world.cost(),
        health: world.health(),
        given_up,
        statistics: watch.map(|watch| watch.statistics()),
    })
}
