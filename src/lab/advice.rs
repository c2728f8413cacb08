//! The cheapest settings that keep an error, or the most accurate ones within a budget of time a frame.
//!
//! For each method (and number of sweeps) the longest step that keeps the error is bracketed: from the longest that is
//! stable with a margin, by the method's order, then closer from both sides, until the two differ by less than 8 %. The
//! cheapest in springs looked at is then run for sixty simulated seconds; where it does not stay quiet its step is
//! shortened, and where that does not help the next one is taken. Single precision is taken where it keeps the error too.

use super::reference::{MARGIN, Reference, References};
use super::timing::{self, Machine, Measured, Time};
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
    /// Errors below this cannot be told, m.
    pub told_from: f64,
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
/// Methods whose search is cheap: what they cost bounds how long the others are looked at.
const YARDSTICKS: [&str; 3] = ["rk4", "velocity_verlet", "symplectic_euler"];
/// Most steps of a run.
const MOST_STEPS: f64 = 2e6;
/// Simulated time over which a pick must stay quiet, s, and the most springs looked at for that: minutes of computing.
const QUIET: f64 = 60.0;
const QUIET_VISITS: f64 = 2e10;

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
            // What overshoots may still meet it at the most that it may cost.
            let last = whole(MOST_STEPS.min(most));
            if coarse.steps >= last {
                return Ok(best);
            }
            let next = whole(coarse.steps as f64 * factor).min(last);
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

    /// The most accurate within a budget of time: as many steps as it pays for, in the precision that errs less.
    fn for_budget(&mut self, budget_ms: f64) -> Result<Candidate, Stop> {
        /// A step's time hangs on dt itself where equations are solved: so often is it measured anew.
        const ROUNDS: usize = 3;
        let samples = u64::from(self.case.samples.max(1));
        let mut best: Option<Candidate> = None;
        for precision in [Precision::Double, Precision::Single] {
            let mut steps = self.fewest();
            let mut affordable: Option<(u64, f64)> = None;
            for _ in 0..ROUNDS {
                let dt = self.case.dt(steps);
                let settings = Settings { precision, dt, ..self.own.clone() };
                self.trials += 1;
                let measured = timing::measure(self.case, &[settings], self.progress)?;
                let Some(time) = measured.into_iter().next().flatten() else { break };
                let ms = 1000.0 / 60.0 * time.median;
                if ms <= budget_ms && affordable.is_none_or(|(most, _)| steps > most) {
                    affordable = Some((steps, ms));
                }
                let paid = (steps as f64 * 0.97 * budget_ms / ms).min(MOST_STEPS) as u64 / samples * samples;
                let next = paid.max(self.fewest());
                if next == steps {
                    break;
                }
                steps = next;
            }
            let (steps, ms) = affordable.map_or((self.fewest(), None), |(steps, ms)| (steps, Some(ms)));
            let point = self.look(steps, precision)?;
            let mut candidate = self.candidate(point, precision, ms.is_some() && point.error.is_some());
            candidate.ms_per_frame = ms;
            let error = |c: &Candidate| self.reference.told(c.error);
            if best.as_ref().is_none_or(|b| (!candidate.met, error(&candidate)) < (!b.met, error(b))) {
                best = Some(candidate);
            }
        }
        let trials = self.trials;
        best.map(|best| Candidate { trials, ..best }).ok_or(Stop::Cancelled)
    }
}

/// Every method with every effort that it declares, those of high order first, those of another model last.
fn plan(options: &Options) -> Result<Vec<Settings>, Refusal> {
    let mut plan = Vec::new();
    for entry in trade::chosen(&options.simulators)? {
        plan.extend(
            super::variants(entry)
                .into_iter()
                .map(|params| Settings { params, ..Settings::double(entry.id, LONGEST) }),
        );
    }
    plan.sort_by_key(|own| {
        let order = simulators::find(&own.simulator).map_or(0, |entry| entry.order);
        (!own.same_model(), std::cmp::Reverse(order))
    });
    Ok(plan)
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
    let plan = plan(options)?;
    let timed = options.time || matches!(options.goal, Goal::BudgetMs(_));
    let parts: Vec<(Settings, Goal)> = plan.into_iter().map(|own| (own, options.goal)).collect();
    let search = |own: &Settings, bound: f64| -> Result<Search, Stop> {
        let (own, limit) = (own.clone(), trade::theory(own, &spectrum)?);
        Ok(Search { case, reference: &reference, free: &free, own, limit, bound, trials: 0, progress })
    };
    // What explicit methods cost, which is soon found, bounds what all others may: the same in every shard.
    let mut bound = f64::INFINITY;
    if let Goal::MaxError(wanted) = options.goal
        && parts.iter().any(|part| journal.wants("advice", part))
    {
        for (own, _) in parts.iter().filter(|(own, _)| YARDSTICKS.contains(&own.simulator.as_str())) {
            let point =
                search(own, bound).and_then(|mut s| s.longest_step(wanted)).map_err(Stop::into_refusal)?;
            if point.error.is_some_and(|error| error <= wanted) {
                bound = bound.min(point.visits);
            }
        }
    }
    let one = |(own, goal): &(Settings, Goal)| {
        let candidate = match goal {
            Goal::MaxError(wanted) => search(own, bound)?.for_error(*wanted),
            Goal::BudgetMs(budget) => search(own, bound)?.for_budget(*budget),
        };
        candidate.map(Measured::here)
    };
    let told: Vec<Option<Measured<Candidate>>> = match options.goal {
        Goal::MaxError(_) => journal.each("advice", &parts, progress, one)?,
        // One after the other, so that nothing disturbs what is timed.
        Goal::BudgetMs(_) => {
            let told =
                parts.iter().map(|part| journal.each("advice", std::slice::from_ref(part), progress, one));
            told.collect::<Result<Vec<_>, _>>()?.concat()
        }
    };
    let mut machines: Vec<Machine> = told
        .iter()
        .flatten()
        .filter(|_| matches!(options.goal, Goal::BudgetMs(_)))
        .map(|m| m.machine.clone())
        .collect();
    let found: Vec<Option<Candidate>> = told.into_iter().map(|told| Some(told?.found)).collect();
    let missing = found.iter().filter(|c| c.is_none()).count();
    let mut candidates: Vec<Candidate> = found.into_iter().flatten().collect();
    rank(&mut candidates, options.goal, &reference);
    let mut trials = candidates.iter().map(|c| c.trials).sum();
    let (pick, quiet_seconds) = if missing > 0 {
        // The best of all is not known yet.
        (candidates.first().cloned(), 0.0)
    } else {
        settle(case, &mut candidates, options.goal, journal, &mut trials, progress)?
    };
    let Some(mut pick) = pick.or_else(|| journal.is_shard().then(|| nothing(case))) else {
        return Err(Stop::Cancelled.into_refusal());
    };
    if timed && missing == 0 && pick.ms_per_frame.is_none() {
        let told = journal.each(timing::STAGE, &[&pick.settings], progress, |settings| {
            timing::measure(case, &[(*settings).clone()], progress).map(Measured::here)
        })?;
        let told: Option<Measured<Vec<Option<Time>>>> = told.into_iter().next().flatten();
        if let Some(Measured { found, machine }) = told {
            pick.ms_per_frame = found.into_iter().flatten().next().map(|time| 1000.0 / 60.0 * time.median);
            machines.push(machine);
        }
    }
    Ok(Advice {
        met: pick.met,
        settings: pick.settings,
        error: pick.error,
        ms_per_frame: pick.ms_per_frame,
        stability_margin: pick.stability_margin,
        spring_visits: pick.spring_visits,
        quiet_seconds,
        told_from: MARGIN * reference.uncertainty,
        trials,
        goal: options.goal,
        candidates,
        missing,
        machine: Machine::together(machines),
    })
}

/// What a shard tells to which no method fell: the scene as it stands, of which nothing is known.
fn nothing(case: &Case) -> Candidate {
    Candidate {
        settings: Settings::of(case.scene()),
        met: false,
        error: None,
        spring_visits: 0.0,
        ms_per_frame: None,
        stability_margin: None,
        trials: 0,
    }
}

/// Best first: those that meet the goal by the other quantity, then those that do not by how close they come.
fn rank(candidates: &mut [Candidate], goal: Goal, reference: &Reference) {
    let error = |c: &Candidate| reference.told(c.error);
    let time = |c: &Candidate| c.ms_per_frame.unwrap_or(f64::INFINITY);
    let key = |c: &Candidate| match goal {
        Goal::MaxError(_) if c.met => (c.spring_visits, error(c)),
        Goal::MaxError(_) => (error(c), c.spring_visits),
        Goal::BudgetMs(_) => (error(c), time(c)),
    };
    candidates.sort_by(|a, b| {
        let (x, y) = (key(a), key(b));
        b.met.cmp(&a.met).then(x.0.total_cmp(&y.0)).then(x.1.total_cmp(&y.1))
    });
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
            let visits = candidate.spring_visits * candidate.settings.dt / settings.dt;
            let seconds = QUIET.min(QUIET_VISITS / visits.max(1.0));
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
