//! The cheapest settings that keep an error, or the most accurate ones within a budget of time a frame.
//!
//! For each method (and number of sweeps) the longest step that keeps the error is bracketed: from the longest that is
//! stable with a margin, by the method's order, then closer from both sides, until the two differ by less than 8 %. The
//! cheapest in springs looked at is then run for sixty simulated seconds; where it does not stay quiet its step is
//! shortened, and where that does not help the next one is taken. Single precision is taken where it keeps the error too.

use super::reference::{MARGIN, Reference, References};
use super::timing::{self, Machine};
use super::trial::{self, Zone};
use super::{Case, Event, Journal, Progress, Settings, Stop, metrics, stability, trade};
use crate::forces::Spectrum;
use crate::scene::{Precision, Refusal};
use crate::simulators;
use serde::{Deserialize, Serialize};

/// What is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Goal {
    /// The least work with an RMS position error up to this, m.
    MaxError(f64),
    /// The least error within this many milliseconds a frame of 1/60 s.
    BudgetMs(f64),
}

/// What is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Names of the methods; all where empty.
    pub simulators: Vec<String>,
    /// What is wanted.
    pub goal: Goal,
    /// Whether time is measured besides counts; a budget of time needs it.
    pub time: bool,
}

/// The best of a method and its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Method, precision, dt and parameters.
    #[serde(flatten)]
    pub settings: Settings,
    /// Whether it meets the goal.
    pub met: bool,
    /// RMS position error, m; none where every run burst or shook.
    pub error: Option<f64>,
    /// Springs looked at for each simulated second.
    pub spring_visits: f64,
    /// Measured time for a frame of 1/60 s, ms; none where it was not measured.
    pub ms_per_frame: Option<f64>,
    /// Longest stable dt in theory over dt; none where theory sets no limit.
    pub stability_margin: Option<f64>,
    /// Runs that it took.
    pub trials: u64,
}

/// The advice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Advice {
    /// Whether the goal is met; where not, what follows is the closest.
    pub met: bool,
    /// Method, precision, dt and parameters.
    #[serde(flatten)]
    pub settings: Settings,
    /// RMS position error, m.
    pub error: Option<f64>,
    /// Measured time for a frame of 1/60 s, ms; none where it was not measured.
    pub ms_per_frame: Option<f64>,
    /// Longest stable dt in theory over dt; none where theory sets no limit.
    pub stability_margin: Option<f64>,
    /// Springs looked at for each simulated second.
    pub spring_visits: f64,
    /// Simulated time over which the pick was seen to stay quiet, s; 0 where nothing was.
    pub quiet_seconds: f64,
    /// Runs in all.
    pub trials: u64,
    /// What was wanted.
    pub goal: Goal,
    /// The best of every method: the evidence.
    pub candidates: Vec<Candidate>,
    /// Methods that other shards have or that were not reached.
    pub missing: usize,
    /// Where time was measured; none where it was not.
    pub machine: Option<Machine>,
}

/// Part of the stable step in theory that is used at most.
const MARGIN_TO_LIMIT: f64 = 0.9;
/// How close the longest step that keeps the error and the shortest that does not come.
const CLOSE: f64 = 1.08;
/// Longest step of methods without a limit, s.
const LONGEST: f64 = 1.0 / 24.0;
/// Most springs looked at in a run: a second or two of computing.
const MOST_VISITS: f64 = 3e8;
/// Most steps of a run.
const MOST_STEPS: f64 = 2e6;
/// Simulated time over which a pick must stay quiet, s, and the most steps spent on that.
const QUIET: f64 = 60.0;
const QUIET_STEPS: f64 = 4e5;

/// Runs of one method with one set of parameters.
struct Search<'a> {
    case: &'a Case,
    reference: &'a Reference,
    free: &'a [bool],
    own: Settings,
    limit: Option<f64>,
    /// Springs looked at for each simulated second by the cheapest that is known to meet the goal.
    bound: f64,
    trials: u64,
    progress: Progress<'a>,
}

/// One run: its steps, and its error where it stayed quiet.
#[derive(Clone, Copy)]
struct Point {
    steps: u64,
    error: Option<f64>,
    visits: f64,
}

impl Search<'_> {
    fn look(&mut self, steps: u64, precision: Precision) -> Result<Point, Stop> {
        self.trials += 1;
        let settings = Settings { precision, dt: self.case.dt(steps), ..self.own.clone() };
        let trial = trial::run_scene(self.case, settings.apply(self.case.scene()), self.progress)?;
        let quiet = Zone::from(trial.health) == Zone::Quiet;
        let errors = metrics::errors(self.free, self.reference, &trial.samples).filter(|_| quiet);
        let visits = trial.cost.spring_visits as f64 / (trial.steps.max(1) as f64 * settings.dt);
        Ok(Point { steps, error: errors.map(|e| e.rms), visits })
    }

    /// The fewest steps that are stable with a margin, a multiple of the samples.
    fn fewest(&self) -> u64 {
        let samples = u64::from(self.case.samples.max(1));
        let longest = self.limit.map_or(LONGEST, |limit| limit * MARGIN_TO_LIMIT);
        let steps = (self.case.seconds / longest.max(self.case.seconds / MOST_STEPS)).ceil() as u64;
        steps.div_ceil(samples) * samples
    }

    /// The longest step that keeps an error, or the one with the least error where none does.
    fn longest_step(&mut self, wanted: f64) -> Result<Point, Stop> {
        let order = simulators::find(&self.own.simulator).map_or(1, |entry| entry.order.max(1));
        let samples = u64::from(self.case.samples.max(1));
        let whole = |steps: f64| (steps / samples as f64).ceil() as u64 * samples;
        let keeps = |point: &Point| point.error.is_some_and(|error| error <= wanted);
        let mut coarse = self.look(self.fewest(), Precision::Double)?;
        let visits_a_step = coarse.visits * self.case.seconds / coarse.steps as f64;
        let most = (MOST_VISITS / visits_a_step).min(self.bound * self.case.seconds / visits_a_step);
        if keeps(&coarse) {
            return Ok(coarse);
        }
        let mut best = coarse;
        // Towards shorter steps by the order, until one keeps the error or shorter ones no longer help.
        let mut stuck = 0;
        let mut fine = loop {
            let factor = match coarse.error {
                Some(error) => (1.05 * (error / wanted).powf(1.0 / f64::from(order))).clamp(1.2, 16.0),
                None => 2.0,
            };
            let next = whole(coarse.steps as f64 * factor);
            if next as f64 > MOST_STEPS.min(most) {
                return Ok(best);
            }
            let point = self.look(next, Precision::Double)?;
            if keeps(&point) {
                break point;
            }
            let better = point.error.unwrap_or(f64::INFINITY) < 0.9 * best.error.unwrap_or(f64::INFINITY);
            stuck = if better { 0 } else { stuck + 1 };
            if point.error.is_some() && point.error < best.error.or(Some(f64::INFINITY)) {
                best = point;
            }
            if stuck >= 3 {
                return Ok(best);
            }
            coarse = point;
        };
        while fine.steps as f64 > CLOSE * coarse.steps as f64 && fine.steps - coarse.steps > samples {
            let (low, high) = (coarse.steps as f64, fine.steps as f64);
            // Where both errors are known, by the slope between them, kept off the ends; else the middle.
            let part = match (coarse.error, fine.error) {
                (Some(a), Some(b)) if a > b && b > 0.0 => ((a / wanted).ln() / (a / b).ln()).clamp(0.2, 0.8),
                _ => 0.5,
            };
            let middle =
                whole(low * (high / low).powf(part)).clamp(coarse.steps + samples, fine.steps - samples);
            if middle <= coarse.steps || middle >= fine.steps {
                break;
            }
            let point = self.look(middle, Precision::Double)?;
            if keeps(&point) {
                fine = point;
            } else {
                coarse = point;
            }
        }
        Ok(fine)
    }

    fn candidate(&self, point: Point, precision: Precision, met: bool) -> Candidate {
        let dt = self.case.dt(point.steps);
        Candidate {
            settings: Settings { precision, dt, ..self.own.clone() },
            met,
            error: point.error,
            spring_visits: point.visits,
            ms_per_frame: None,
            stability_margin: self.limit.map(|limit| limit / dt),
            trials: self.trials,
        }
    }

    /// The cheapest that keeps an error, in single precision where that keeps it too.
    fn for_error(&mut self, wanted: f64) -> Result<Candidate, Stop> {
        let point = self.longest_step(wanted)?;
        let met = point.error.is_some_and(|error| error <= wanted);
        if met {
            let single = self.look(point.steps, Precision::Single)?;
            if single.error.is_some_and(|error| error <= wanted) {
                return Ok(self.candidate(single, Precision::Single, true));
            }
        }
        Ok(self.candidate(point, Precision::Double, met))
    }

    /// The most accurate within a budget, given what a step takes, s.
    fn for_budget(&mut self, budget_ms: f64, step: f64) -> Result<Candidate, Stop> {
        let samples = u64::from(self.case.samples.max(1));
        // ms a frame = 1000/60 · step/dt.
        let affordable = self.case.seconds / (step * 1000.0 / 60.0 / budget_ms);
        let steps = (affordable.min(MOST_STEPS) as u64 / samples * samples).max(samples);
        let stable = steps >= self.fewest();
        let point = self.look(if stable { steps } else { self.fewest() }, Precision::Double)?;
        let mut candidate = self.candidate(point, Precision::Double, stable && point.error.is_some());
        candidate.ms_per_frame = Some(1000.0 / 60.0 * step / candidate.settings.dt);
        Ok(candidate)
    }
}

/// Searches for the best settings.
///
/// # Errors
/// An unknown method; an error that the reference cannot tell; a case that cannot be run.
pub fn run(
    case: &Case,
    options: &Options,
    references: &References,
    journal: &Journal,
    progress: Progress,
) -> Result<Advice, Refusal> {
    let reference = references.of(case, progress).map_err(Stop::into_refusal)?;
    if reference.comparable().is_empty() {
        return Err(Refusal::new(format!(
            "trajectories of this scene part before {} s, so no error can be told; accepted: a shorter time, --seconds",
            reference.interval
        )));
    }
    if let Goal::MaxError(wanted) = options.goal
        && reference.hides(wanted)
    {
        return Err(Refusal::new(format!(
            "an error of {wanted:e} m is below what can be told here; accepted: at least {:.1e} m",
            MARGIN * reference.uncertainty
        )));
    }
    let (problem, state) = case.start().problem(case.scene())?;
    let spectrum = Spectrum::of(&problem, &state);
    let free = case.free();
    let mut plan = Vec::new();
    for entry in trade::chosen(&options.simulators)? {
        plan.extend(
            trade::variants(entry)
                .into_iter()
                .map(|params| Settings { params, ..Settings::double(entry.id, LONGEST) }),
        );
    }
    // Methods of high order first: they bound what the others may cost. Those of another model last.
    plan.sort_by_key(|own| {
        let order = simulators::find(&own.simulator).map_or(0, |entry| entry.order);
        (!own.same_model(), std::cmp::Reverse(order))
    });
    let limits: Vec<Option<f64>> =
        plan.iter().map(|own| trade::theory(own, &spectrum)).collect::<Result<_, _>>()?;
    let steps = match options.goal {
        Goal::BudgetMs(_) => seconds_a_step(case, &plan, &limits, journal, progress)?,
        Goal::MaxError(_) => vec![None; plan.len()],
    };
    let parts: Vec<(Settings, Goal, Option<f64>)> =
        plan.iter().zip(&steps).map(|(own, step)| (own.clone(), options.goal, *step)).collect();
    let mut found = Vec::new();
    let mut bound = f64::INFINITY;
    for (part, limit) in parts.iter().zip(&limits) {
        // One after the other: what one costs limits how long the next is looked at, the same way every time.
        let told = journal.each("advice", std::slice::from_ref(part), progress, |(own, goal, step)| {
            let own = own.clone();
            let (reference, free, limit) = (&*reference, &free[..], *limit);
            let mut search = Search { case, reference, free, own, limit, bound, trials: 0, progress };
            match (goal, step) {
                (Goal::MaxError(wanted), _) => search.for_error(*wanted),
                (Goal::BudgetMs(budget), Some(step)) => search.for_budget(*budget, *step),
                (Goal::BudgetMs(_), None) => Err(Stop::Cancelled),
            }
        })?;
        let candidate: Option<Candidate> = told.into_iter().next().flatten();
        let cost = candidate.as_ref().filter(|c| c.met).map(|c| c.spring_visits);
        bound = bound.min(cost.unwrap_or(f64::INFINITY));
        found.push(candidate);
    }
    let missing = found.iter().filter(|c| c.is_none()).count();
    let mut candidates: Vec<Candidate> = found.into_iter().flatten().collect();
    rank(&mut candidates, options.goal);
    let mut trials = candidates.iter().map(|c| c.trials).sum();
    let (pick, quiet_seconds) = settle(case, &mut candidates, options.goal, journal, &mut trials, progress)?;
    let Some(mut pick) = pick else { return Err(Stop::Cancelled.into_refusal()) };
    if options.time && pick.ms_per_frame.is_none() {
        let told = journal.each("time", &[&pick.settings], progress, |settings| {
            timing::measure(case, &[(*settings).clone()], progress)
        })?;
        let time = told.into_iter().flatten().flatten().flatten().next();
        pick.ms_per_frame = time.map(|time| 1000.0 / 60.0 * time.median);
    }
    Ok(Advice {
        met: pick.met,
        settings: pick.settings,
        error: pick.error,
        ms_per_frame: pick.ms_per_frame,
        stability_margin: pick.stability_margin,
        spring_visits: pick.spring_visits,
        quiet_seconds,
        trials,
        goal: options.goal,
        candidates,
        missing,
        machine: options.time.then(Machine::here),
    })
}

/// Best first: those that meet the goal by the other quantity, then those that do not by how close they come.
fn rank(candidates: &mut [Candidate], goal: Goal) {
    let error = |c: &Candidate| c.error.unwrap_or(f64::INFINITY);
    let key = |c: &Candidate| match (goal, c.met) {
        (Goal::MaxError(_), true) => c.spring_visits,
        (Goal::MaxError(_), false) | (Goal::BudgetMs(_), true) => error(c),
        (Goal::BudgetMs(_), false) => c.ms_per_frame.unwrap_or(f64::INFINITY),
    };
    candidates.sort_by(|a, b| b.met.cmp(&a.met).then(key(a).total_cmp(&key(b))));
}

/// The first candidate that stays quiet for long, its step shortened where need be; and for how long it was seen to.
fn settle(
    case: &Case,
    candidates: &mut [Candidate],
    goal: Goal,
    journal: &Journal,
    trials: &mut u64,
    progress: Progress,
) -> Result<(Option<Candidate>, f64), Refusal> {
    /// How often a step is shortened, and to which part.
    const SHORTER: (usize, f64) = (4, 0.93);
    progress(Event::Stage("sixty seconds"));
    for candidate in candidates.iter().filter(|c| c.error.is_some()) {
        let mut settings = candidate.settings.clone();
        let may_shorten = matches!(goal, Goal::MaxError(_));
        for _ in 0..=if may_shorten { SHORTER.0 } else { 0 } {
            let seconds = QUIET.min(QUIET_STEPS * settings.dt);
            let long = case.lasting(seconds);
            *trials += 1;
            let zone = journal.each("quiet", &[&settings], progress, |settings| {
                stability::zone(&long, settings.apply(case.scene()), progress)
            })?;
            match zone.into_iter().next().flatten() {
                None => return Ok((Some(candidate.clone()), 0.0)),
                Some(Zone::Quiet) => {
                    let shortened = candidate.settings.dt / settings.dt;
                    let pick = Candidate {
                        spring_visits: candidate.spring_visits * shortened,
                        stability_margin: candidate.stability_margin.map(|margin| margin * shortened),
                        settings,
                        ..candidate.clone()
                    };
                    return Ok((Some(pick), seconds));
                }
                Some(_) => settings.dt *= SHORTER.1,
            }
        }
    }
    Ok((candidates.first().map(|closest| Candidate { met: false, ..closest.clone() }), 0.0))
}

/// Measured time of one step of each method, s.
fn seconds_a_step(
    case: &Case,
    plan: &[Settings],
    limits: &[Option<f64>],
    journal: &Journal,
    progress: Progress,
) -> Result<Vec<Option<f64>>, Refusal> {
    let settings: Vec<Settings> = plan
        .iter()
        .zip(limits)
        .map(|(own, limit)| {
            let dt = limit.map_or(LONGEST, |limit| (limit * MARGIN_TO_LIMIT).max(1e-5));
            Settings { dt, ..own.clone() }
        })
        .collect();
    let told =
        journal.each("time", &[&settings], progress, |settings| timing::measure(case, settings, progress))?;
    let times = told.into_iter().flatten().next().unwrap_or_else(|| vec![None; plan.len()]);
    Ok(settings.iter().zip(times).map(|(own, time)| time.map(|t| t.median * own.dt)).collect())
}
