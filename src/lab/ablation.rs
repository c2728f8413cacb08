//! What a scene requires: every ingredient left out once, and what that changes and saves.
//!
//! A change is the RMS distance from the whole scene's run over the free particles and the compared times, over the RMS
//! displacement from the start, both by the scene's own method and dt. Left out ingredients whose change is below the
//! tolerance are proposed; all of them together are run once more, and given up one by one, the largest change first,
//! until the proposal itself keeps the tolerance. Nothing is proposed that was not itself run.

use super::timing::{self, Machine, Measured, Time};
use super::trial::{self, Trial, Zone};
use super::{Case, Effort, Event, Journal, Progress, Stop, metrics};
use crate::scene::{Mass, Pin, Pins, Precision, Refusal, Scene, Target};
use crate::simulators::{self, Value};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

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
    /// What was left out: the scene's path, `precision` (Single instead of Double), `resolution/2` (every other row and
    /// column, same total mass and continuous stiffness; so on), `sweeps/2` (half of them, so on).
    pub ingredient: String,
    /// What that changes, relative to the motion; none where the run burst or does not reach as far.
    pub change: Option<f64>,
    /// Part of the springs looked at that is saved; below 0 where it costs more.
    pub work_saved: f64,
    /// Part of the time that is saved; none where time was not measured.
    pub time_saved: Option<f64>,
    /// Whether the change is beyond the tolerance.
    pub needed: bool,
    /// Whether the scene does without it already: then it was put in.
    pub absent: bool,
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
    /// Whether lower resolutions could be tried.
    pub resolution_tried: bool,
    /// Where time was measured; none where it was not.
    pub machine: Option<Machine>,
}

/// Halvings that are tried of the resolution and of each count of sweeps, at most.
const HALVINGS: u32 = 3;

/// The ingredients that a case's scene has; and double precision of one that does without it, to be told what that
/// costs in accuracy. Lower resolutions can be tried of a grid from its beginning: a mesh would need one made coarser.
pub fn ingredients(case: &Case) -> Vec<String> {
    let scene = case.scene();
    let springs = &scene.springs;
    let any = springs.kinds().iter().any(|kind| kind.enabled);
    let mut names: Vec<String> = [
        ("springs.stretch", springs.stretch.enabled),
        ("springs.shear", springs.shear.enabled),
        ("springs.bend", springs.bend.enabled),
        ("springs.damping", springs.damping > 0.0 && any),
        ("air_damping", scene.air_damping > 0.0),
        ("gravity", scene.gravity.enabled),
        ("wind", scene.wind.enabled),
        ("tearing", scene.tearing.enabled),
        ("precision", true),
    ]
    .into_iter()
    .filter(|(_, there)| *there)
    .map(|(name, _)| name.to_owned())
    .collect();
    if let (Target::Grid(grid), 0) = (&scene.target, case.start().step()) {
        let mut points = grid.columns.min(grid.rows);
        for halving in 1..=HALVINGS {
            if points > 3 {
                names.push(format!("resolution/{}", 1 << halving));
            }
            points = coarse(points);
        }
    }
    for (effort, count) in counts(scene) {
        let divisors = (1..=HALVINGS).map(|halving| 1u64 << halving).take_while(|d| count / d >= 1);
        names.extend(divisors.map(|d| format!("{effort}/{d}")));
    }
    names
}

/// What a scene's method does so many times a step.
fn counts(scene: &Scene) -> Vec<(&'static str, u64)> {
    let entry = simulators::find(&scene.simulator.id).ok();
    let efforts = entry.map(|entry| Effort::of(entry, &scene.simulator.params)).unwrap_or_default();
    efforts.into_iter().filter_map(|effort| Some((effort.name, effort.count()?))).collect()
}

/// An ingredient's name, and by how much it is divided: 1 where it is left out as a whole.
fn divided(ingredient: &str) -> (&str, u64) {
    let parts = ingredient.split_once('/').and_then(|(name, by)| Some((name, by.parse().ok()?)));
    parts.unwrap_or((ingredient, 1))
}

/// Whether a scene does without an ingredient already.
fn absent(scene: &Scene, ingredient: &str) -> bool {
    ingredient == "precision" && scene.precision == Precision::Single
}

/// A scene of the case without an ingredient; with it where the scene does without it already.
pub fn without(case: &Case, scene: &Scene, ingredient: &str) -> Scene {
    let mut scene = scene.clone();
    match divided(ingredient) {
        ("springs.stretch", _) => scene.springs.stretch.enabled = false,
        ("springs.shear", _) => scene.springs.shear.enabled = false,
        ("springs.bend", _) => scene.springs.bend.enabled = false,
        ("springs.damping", _) => scene.springs.damping = 0.0,
        ("air_damping", _) => scene.air_damping = 0.0,
        ("gravity", _) => scene.gravity.enabled = false,
        ("wind", _) => scene.wind.enabled = false,
        ("tearing", _) => scene.tearing.enabled = false,
        ("precision", _) => {
            let single = absent(&scene, ingredient);
            scene.precision = if single { Precision::Double } else { Precision::Single };
        }
        ("resolution", by) => {
            let mut pinned = case.start().pinned().to_vec();
            for _ in 0..by.ilog2() {
                (scene, pinned) = coarser(&scene, &pinned);
            }
        }
        (name, by) => {
            if let Some((name, count)) = counts(&scene).into_iter().find(|(effort, _)| *effort == name) {
                scene.simulator.params.insert(name.to_owned(), Value::Count((count / by).max(1)));
            }
        }
    }
    scene
}

/// Every other row and column, springs twice as long, and which particles are pinned then: the total mass and the air
/// damping of all particles together stay, and so does the continuous stiffness, since each k then stands for twice the
/// width. A particle is pinned where one of those it stands for is.
fn coarser(scene: &Scene, pinned: &[bool]) -> (Scene, Vec<bool>) {
    let mut scene = scene.clone();
    let Target::Grid(grid) = &mut scene.target else { return (scene, pinned.to_vec()) };
    let (fine_columns, fine_rows) = (grid.columns, grid.rows);
    (grid.columns, grid.rows) = (coarse(fine_columns), coarse(fine_rows));
    grid.spacing *= 2.0;
    let (columns, rows) = (grid.columns, grid.rows);
    let ratio = f64::from(fine_columns) * f64::from(fine_rows) / (f64::from(columns) * f64::from(rows));
    let pins: BTreeSet<u32> = (0u32..)
        .zip(pinned)
        .filter(|(_, pinned)| **pinned)
        .map(|(i, _)| i / fine_columns / 2 * columns + i % fine_columns / 2)
        .collect();
    let pinned = (0..columns * rows).map(|i| pins.contains(&i)).collect();
    scene.pins = Pins::of(pins.into_iter().map(Pin::Particle).collect::<Vec<_>>());
    if let Mass::PerParticle(mass) = &mut scene.mass {
        *mass *= ratio;
    }
    scene.air_damping *= ratio;
    scene.wind.strength *= ratio;
    (scene, pinned)
}

/// Points along a side when every other one is left out, both ends of an odd number kept.
fn coarse(points: u32) -> u32 {
    points.div_ceil(2).max(1)
}

/// Positions of a grid of so many columns and rows from those of the next coarser one, by bilinear interpolation.
fn finer(x: &[DVec3], [fine_columns, fine_rows]: [u32; 2]) -> Vec<DVec3> {
    let (columns, rows) = (coarse(fine_columns) as usize, coarse(fine_rows) as usize);
    // The coarser grid is centred, so that with an even number of points its ends stand off those of the fine one.
    let along = |i: u32, fine: u32, count: usize| {
        let offset = (f64::from(fine) - 1.0) / 2.0 - (count as f64 - 1.0);
        let at = ((f64::from(i) - offset) / 2.0).clamp(0.0, count as f64 - 1.0);
        let low = (at.floor() as usize).min(count.saturating_sub(2));
        (low, (low + 1).min(count - 1), at - low as f64)
    };
    let mut refined = Vec::with_capacity((fine_rows * fine_columns) as usize);
    for r in 0..fine_rows {
        let (r0, r1, down) = along(r, fine_rows, rows);
        for c in 0..fine_columns {
            let (c0, c1, right) = along(c, fine_columns, columns);
            let row = |r: usize| x[r * columns + c0].lerp(x[r * columns + c1], right);
            refined.push(row(r0).lerp(row(r1), down));
        }
    }
    refined
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
        let halvings = out
            .iter()
            .map(|name| divided(name))
            .find(|(name, _)| *name == "resolution")
            .map(|(_, by)| by.ilog2());
        let trial = match trial::run_scene(self.case, scene, progress) {
            Ok(trial) => trial,
            // What cannot even be built (a pin that the coarser grid lacks) is needed as it is.
            Err(Stop::Refused(_)) => return Ok((None, 0.0, Zone::Diverged)),
            Err(stop) => return Err(stop),
        };
        let samples = halvings.map_or_else(|| trial.samples.clone(), |n| self.refined(&trial.samples, n));
        let change = metrics::rms(&self.free, &self.trial.samples, &samples) / self.displacement;
        let health = Zone::from(trial.health);
        let change = Some(change).filter(|c| c.is_finite() && health != Zone::Diverged);
        let work = |cost: crate::forces::Cost| cost.spring_visits.max(cost.force_evaluations) as f64;
        let saved = 1.0 - work(trial.cost) / work(self.trial.cost).max(1.0);
        Ok((change, saved, health))
    }

    /// A coarser grid's positions at the particles of the fine one.
    fn refined(&self, samples: &[Vec<DVec3>], halvings: u32) -> Vec<Vec<DVec3>> {
        let Target::Grid(grid) = &self.case.scene().target else { return Vec::new() };
        let mut sizes = vec![[grid.columns, grid.rows]];
        (1..halvings).for_each(|i| sizes.push(sizes[i as usize - 1].map(coarse)));
        let one = |x: &Vec<DVec3>| sizes.iter().rev().fold(x.clone(), |x, size| finer(&x, *size));
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
            let absent = absent(own, name);
            Some(Row {
                ingredient: name.clone(),
                change,
                work_saved,
                time_saved: None,
                needed,
                absent,
                health,
            })
        })
        .collect();
    rows.sort_by(|a, b| b.change.unwrap_or(f64::INFINITY).total_cmp(&a.change.unwrap_or(f64::INFINITY)));
    let missing = names.len() - rows.len();
    let mut proposal = if missing == 0 { propose(&whole, &rows, options, journal, progress)? } else { None };
    let machine = if options.time && missing == 0 {
        time(case, &mut rows, proposal.as_mut(), journal, progress)?
    } else {
        None
    };
    let resolution_tried = names.iter().any(|name| divided(name).0 == "resolution");
    Ok(Ablation { tolerance: options.tolerance, rows, proposal, missing, resolution_tried, machine })
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
    let free: Vec<&str> = rows.iter().filter(|r| !r.needed && !r.absent).map(|r| &r.ingredient[..]).collect();
    // Of several halvings of one thing the one that goes furthest.
    let further = |name: &str| {
        let (own, by) = divided(name);
        free.iter().any(|other| divided(other).0 == own && divided(other).1 > by)
    };
    let mut out: Vec<String> =
        free.iter().filter(|name| !further(name)).map(|name| (*name).to_owned()).collect();
    while !out.is_empty() {
        let tried = journal.each("together", &[&out], progress, |out| whole.try_without(out, progress))?;
        let Some(Some((change, work_saved, health))) = tried.into_iter().next() else { return Ok(None) };
        if let Some(change) = change.filter(|c| *c <= options.tolerance && health == Zone::Quiet) {
            return Ok(Some(Proposal { leave_out: out, change, work_saved, time_saved: None }));
        }
        let given_up = out.remove(0);
        // Where a quarter is too little, half may do.
        let (own, by) = divided(&given_up);
        let less = free.iter().filter(|name| divided(name).0 == own && divided(name).1 < by);
        out.extend(less.max_by_key(|name| divided(name).1).map(|name| (*name).to_owned()));
    }
    Ok(None)
}

/// Measures what is saved in time, and answers where.
fn time(
    case: &Case,
    rows: &mut [Row],
    proposal: Option<&mut Proposal>,
    journal: &Journal,
    progress: Progress,
) -> Result<Option<Machine>, Refusal> {
    let mut variants: Vec<Vec<String>> = vec![Vec::new()];
    variants.extend(rows.iter().map(|row| vec![row.ingredient.clone()]));
    variants.extend(proposal.as_ref().map(|p| p.leave_out.clone()));
    let scenes: Vec<Scene> = variants
        .iter()
        .map(|out| out.iter().fold(case.scene().clone(), |scene, name| without(case, &scene, name)))
        .collect();
    let told: Vec<Option<Measured<Vec<Option<Time>>>>> =
        journal.each("time saved", &[variants], progress, |_| {
            timing::measure_scenes(case, &scenes, progress).map(Measured::here)
        })?;
    let Some(Some(Measured { found: times, machine })) = told.into_iter().next() else { return Ok(None) };
    let Some(Some(whole)) = times.first() else { return Ok(None) };
    let saved = |i: usize| times.get(i).copied().flatten().map(|time| 1.0 - time.median / whole.median);
    for (i, row) in rows.iter_mut().enumerate() {
        row.time_saved = saved(i + 1);
    }
    if let Some(proposal) = proposal {
        proposal.time_saved = saved(rows.len() + 1);
    }
    Ok(Some(machine))
}

impl Row {
    /// What leaving it out changes, in words.
    pub fn verdict(&self) -> &'static str {
        match (self.health, self.needed, self.absent) {
            (Zone::Diverged, _, false) => "needed: bursts without it",
            (_, true, false) => "needed",
            (_, false, false) if self.ingredient == "tearing" && self.change == Some(0.0) => {
                "not needed: nothing tears within the time compared"
            }
            (_, false, false) => "not needed",
            (_, true, true) => "needed, and the scene does without it",
            (_, false, true) => "not needed: the scene does without it already",
        }
    }
}
