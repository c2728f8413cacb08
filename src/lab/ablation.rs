//! What a scene requires: every ingredient left out once, and what that changes and saves.
//!
//! A change is the RMS distance from the whole scene's run over the free particles and the compared times, over the RMS
//! displacement from the start, both by the scene's own method and dt. Left out ingredients whose change is below the
//! tolerance are proposed; all of them together are run once more, and given up one by one, the largest change first,
//! until the proposal itself keeps the tolerance. Nothing is proposed that was not itself run.

use super::timing::{self, Machine};
use super::trial::{self, Trial, Zone};
use super::{Case, Event, Journal, Progress, Stop, metrics, trade};
use crate::params;
use crate::scene::{Mass, Pin, Pins, Precision, Refusal, Scene, Target};
use crate::simulators::{self, Value};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// What is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Change that does not matter, relative to the motion.
    pub tolerance: f64,
    /// Whether time is measured besides counts.
    pub time: bool,
}

/// One ingredient left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// What was left out: the scene's path, `precision` (Single instead of Double), `resolution` (every other row and
    /// column, same total mass and continuous stiffness), `sweeps` (half of them).
    pub ingredient: String,
    /// What that changes, relative to the motion; none where the run burst or does not reach as far.
    pub change: Option<f64>,
    /// Part of the springs looked at that is saved; below 0 where it costs more.
    pub work_saved: f64,
    /// Part of the time that is saved; none where time was not measured.
    pub time_saved: Option<f64>,
    /// Whether the change is beyond the tolerance.
    pub needed: bool,
    /// Its zone.
    pub health: Zone,
}

/// What can be left out together, run and verified.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Proposal {
    /// The ingredients.
    pub leave_out: Vec<String>,
    /// What leaving all of them out changes.
    pub change: f64,
    /// Part of the springs looked at that is saved.
    pub work_saved: f64,
    /// Part of the time that is saved; none where time was not measured.
    pub time_saved: Option<f64>,
}

/// The whole study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ablation {
    /// Change that does not matter.
    pub tolerance: f64,
    /// Largest change first.
    pub rows: Vec<Row>,
    /// None where every ingredient is needed, or rows are missing.
    pub proposal: Option<Proposal>,
    /// Rows that other shards have or that were not reached.
    pub missing: usize,
    /// Where time was measured; none where it was not.
    pub machine: Option<Machine>,
}

/// The ingredients that a case's scene has. Half the resolution can be tried from the scene's beginning only.
pub fn ingredients(case: &Case) -> Vec<String> {
    let scene = case.scene();
    let springs = &scene.springs;
    let any = springs.kinds().iter().any(|kind| kind.enabled);
    let effort = simulators::find(&scene.simulator.id).ok().and_then(trade::effort);
    let sheet = matches!(&scene.target, Target::Grid(grid) if grid.columns.min(grid.rows) > 3);
    let halved = sheet && case.start().step() == 0;
    [
        ("springs.stretch", springs.stretch.enabled),
        ("springs.shear", springs.shear.enabled),
        ("springs.bend", springs.bend.enabled),
        ("springs.damping", springs.damping > 0.0 && any),
        ("air_damping", scene.air_damping > 0.0),
        ("gravity", scene.gravity.enabled),
        ("wind", scene.wind.enabled),
        ("tearing", scene.tearing.enabled),
        ("precision", scene.precision == Precision::Double),
        ("resolution", halved),
        ("sweeps", effort.is_some()),
    ]
    .into_iter()
    .filter(|(_, there)| *there)
    .map(|(name, _)| name.to_owned())
    .collect()
}

/// A scene of the case without an ingredient.
pub fn without(case: &Case, scene: &Scene, ingredient: &str) -> Scene {
    let mut scene = scene.clone();
    match ingredient {
        "springs.stretch" => scene.springs.stretch.enabled = false,
        "springs.shear" => scene.springs.shear.enabled = false,
        "springs.bend" => scene.springs.bend.enabled = false,
        "springs.damping" => scene.springs.damping = 0.0,
        "air_damping" => scene.air_damping = 0.0,
        "gravity" => scene.gravity.enabled = false,
        "wind" => scene.wind.enabled = false,
        "tearing" => scene.tearing.enabled = false,
        "precision" => scene.precision = Precision::Single,
        "resolution" => scene = coarser(&scene, case.start().pinned()),
        "sweeps" => {
            let entry = simulators::find(&scene.simulator.id).ok();
            if let Some(name) = entry.and_then(trade::effort) {
                let now = match scene.simulator.params.get(name) {
                    Some(Value::Count(n)) => *n,
                    _ => entry.map_or(1, |entry| default_count(entry, name)),
                };
                scene.simulator.params.insert(name.to_owned(), Value::Count(now.div_ceil(2)));
            }
        }
        _ => {}
    }
    scene
}

/// The default of a method's whole-numbered parameter.
fn default_count(entry: &simulators::Entry, name: &str) -> u64 {
    struct Find<'a>(&'a str, u64);
    impl params::Visitor for Find<'_> {
        fn number(&mut self, _: &'static params::Info, _: &mut f64, _: f64) {}
        fn count(&mut self, info: &'static params::Info, _: &mut u32, default: u32) {
            if info.name == self.0 {
                self.1 = u64::from(default);
            }
        }
        fn switch(&mut self, _: &'static params::Info, _: &mut bool, _: bool) {}
        fn choice(&mut self, _: &'static params::Info, _: &'static [&'static str], _: &mut usize, _: usize) {}
        fn vector(&mut self, _: &'static params::Info, _: &mut DVec3, _: DVec3) {}
        fn group(&mut self, _: &'static params::Info, _: &mut dyn FnMut(&mut dyn params::Visitor)) {}
    }
    let mut find = Find(name, 1);
    entry.visit(&BTreeMap::new(), &mut find);
    find.1
}

/// Every other row and column, springs twice as long: the total mass and the air damping of all particles together stay,
/// and so does the continuous stiffness, since each k then stands for twice the width. A particle is pinned where one of
/// those it stands for is.
fn coarser(scene: &Scene, pinned: &[bool]) -> Scene {
    let mut scene = scene.clone();
    let Target::Grid(grid) = &mut scene.target else { return scene };
    let (fine_columns, fine_rows) = (grid.columns, grid.rows);
    (grid.columns, grid.rows) = (coarse(fine_columns), coarse(fine_rows));
    grid.spacing *= 2.0;
    let columns = grid.columns;
    let ratio = f64::from(fine_columns) * f64::from(fine_rows) / (f64::from(columns) * f64::from(grid.rows));
    let pins: BTreeSet<u32> = (0u32..)
        .zip(pinned)
        .filter(|(_, pinned)| **pinned)
        .map(|(i, _)| i / fine_columns / 2 * columns + i % fine_columns / 2)
        .collect();
    scene.pins = Pins::of(pins.into_iter().map(Pin::Particle).collect::<Vec<_>>());
    if let Mass::PerParticle(mass) = &mut scene.mass {
        *mass *= ratio;
    }
    scene.air_damping *= ratio;
    scene.wind.strength *= ratio;
    scene
}

/// Points along a side when every other one is left out, both ends of an odd number kept.
fn coarse(points: u32) -> u32 {
    points.div_ceil(2).max(1)
}

/// What the rows are compared with.
struct Whole<'a> {
    case: &'a Case,
    trial: Trial,
    free: Vec<bool>,
    displacement: f64,
}

impl Whole<'_> {
    /// What leaving out some ingredients changes.
    fn try_without(&self, out: &[String], progress: Progress) -> Result<(Option<f64>, f64, Zone), Stop> {
        let scene =
            out.iter().fold(self.case.scene().clone(), |scene, name| without(self.case, &scene, name));
        let halved = scene.target != self.case.scene().target;
        let trial = match trial::run_scene(self.case, scene, progress) {
            Ok(trial) => trial,
            // What cannot even be built (a pin that the coarser grid lacks) is needed as it is.
            Err(Stop::Refused(_)) => return Ok((None, 0.0, Zone::Diverged)),
            Err(stop) => return Err(stop),
        };
        let samples = if halved { self.refined(&trial.samples) } else { trial.samples.clone() };
        let change = metrics::rms(&self.free, &self.trial.samples, &samples) / self.displacement;
        let health = Zone::from(trial.health);
        let change = Some(change).filter(|c| c.is_finite() && health != Zone::Diverged);
        let work = |cost: crate::forces::Cost| cost.spring_visits.max(cost.force_evaluations) as f64;
        let saved = 1.0 - work(trial.cost) / work(self.trial.cost).max(1.0);
        Ok((change, saved, health))
    }

    /// A coarser grid's positions at the particles of the fine one, between its own by bilinear interpolation.
    fn refined(&self, samples: &[Vec<DVec3>]) -> Vec<Vec<DVec3>> {
        let Target::Grid(fine) = &self.case.scene().target else { return Vec::new() };
        let (columns, rows) = (coarse(fine.columns) as usize, coarse(fine.rows) as usize);
        // The coarser grid is centred, so that with an even number of points its ends stand off those of the fine one.
        let along = |i: u32, fine: u32, count: usize| {
            let offset = (f64::from(fine) - 1.0) / 2.0 - (count as f64 - 1.0);
            let at = ((f64::from(i) - offset) / 2.0).clamp(0.0, count as f64 - 1.0);
            let low = (at.floor() as usize).min(count.saturating_sub(2));
            (low, (low + 1).min(count - 1), at - low as f64)
        };
        let one = |x: &Vec<DVec3>| {
            let mut refined = Vec::with_capacity((fine.rows * fine.columns) as usize);
            for r in 0..fine.rows {
                let (r0, r1, down) = along(r, fine.rows, rows);
                for c in 0..fine.columns {
                    let (c0, c1, right) = along(c, fine.columns, columns);
                    let row = |r: usize| x[r * columns + c0].lerp(x[r * columns + c1], right);
                    refined.push(row(r0).lerp(row(r1), down));
                }
            }
            refined
        };
        samples.iter().map(one).collect()
    }
}

/// Prices every ingredient of a case.
///
/// # Errors
/// A case that bursts as it stands; a journal that cannot be written.
pub fn run(
    case: &Case,
    options: &Options,
    journal: &Journal,
    progress: Progress,
) -> Result<Ablation, Refusal> {
    progress(Event::Stage("the whole scene"));
    let names = ingredients(case);
    let own = case.scene();
    let trial = trial::run_scene(case, Scene { dt: case.dt(case.steps(own.dt)), ..own.clone() }, progress)
        .map_err(Stop::into_refusal)?;
    if trial.health.is_diverged() {
        return Err(Refusal::new(format!(
            "the scene itself bursts ({:?}); accepted: one whose method holds it, see tenter stability",
            trial.health
        )));
    }
    let free = case.free();
    let start = vec![case.start().motion().0; trial.samples.len()];
    let displacement = metrics::rms(&free, &start, &trial.samples).max(f64::MIN_POSITIVE);
    let whole = Whole { case, trial, free, displacement };

    let tried = journal
        .each("ablation", &names, progress, |name| whole.try_without(std::slice::from_ref(name), progress))?;
    let mut rows: Vec<Row> = names
        .iter()
        .zip(tried)
        .filter_map(|(name, tried)| {
            let (change, work_saved, health) = tried?;
            let needed = change.is_none_or(|change| change > options.tolerance);
            Some(Row { ingredient: name.clone(), change, work_saved, time_saved: None, needed, health })
        })
        .collect();
    rows.sort_by(|a, b| b.change.unwrap_or(f64::INFINITY).total_cmp(&a.change.unwrap_or(f64::INFINITY)));
    let missing = names.len() - rows.len();
    let mut proposal = if missing == 0 { propose(&whole, &rows, options, journal, progress)? } else { None };
    if options.time && missing == 0 {
        time(case, &mut rows, proposal.as_mut(), journal, progress)?;
    }
    let machine = options.time.then(Machine::here);
    Ok(Ablation { tolerance: options.tolerance, rows, proposal, missing, machine })
}

/// Everything that is not needed left out together; given up again one by one until that keeps the tolerance.
fn propose(
    whole: &Whole,
    rows: &[Row],
    options: &Options,
    journal: &Journal,
    progress: Progress,
) -> Result<Option<Proposal>, Refusal> {
    // Largest change first, as the rows stand.
    let mut out: Vec<String> = rows.iter().filter(|r| !r.needed).map(|r| r.ingredient.clone()).collect();
    while !out.is_empty() {
        let tried = journal.each("together", &[&out], progress, |out| whole.try_without(out, progress))?;
        let Some(Some((change, work_saved, health))) = tried.into_iter().next() else { return Ok(None) };
        if let Some(change) = change.filter(|c| *c <= options.tolerance && health == Zone::Quiet) {
            return Ok(Some(Proposal { leave_out: out, change, work_saved, time_saved: None }));
        }
        out.remove(0);
    }
    Ok(None)
}

/// Measures what is saved in time.
fn time(
    case: &Case,
    rows: &mut [Row],
    proposal: Option<&mut Proposal>,
    journal: &Journal,
    progress: Progress,
) -> Result<(), Refusal> {
    let mut variants: Vec<Vec<String>> = vec![Vec::new()];
    variants.extend(rows.iter().map(|row| vec![row.ingredient.clone()]));
    variants.extend(proposal.as_ref().map(|p| p.leave_out.clone()));
    let scenes: Vec<Scene> = variants
        .iter()
        .map(|out| out.iter().fold(case.scene().clone(), |scene, name| without(case, &scene, name)))
        .collect();
    let told = journal
        .each("time saved", &[variants], progress, |_| timing::measure_scenes(case, &scenes, progress))?;
    let Some(Some(times)) = told.into_iter().next() else { return Ok(()) };
    let Some(Some(whole)) = times.first() else { return Ok(()) };
    let saved = |i: usize| times.get(i).copied().flatten().map(|time| 1.0 - time.median / whole.median);
    for (i, row) in rows.iter_mut().enumerate() {
        row.time_saved = saved(i + 1);
    }
    if let Some(proposal) = proposal {
        proposal.time_saved = saved(rows.len() + 1);
    }
    Ok(())
}

impl Row {
    /// What leaving it out changes, in words.
    pub fn verdict(&self) -> &'static str {
        match (self.health, self.needed) {
            (Zone::Diverged, _) => "needed: bursts without it",
            (_, true) => "needed",
            (_, false) => "not needed",
        }
    }
}
