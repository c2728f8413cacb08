//! The trade of speed for accuracy: every method at several steps, sweeps and precisions, its errors against its work.

use super::metrics::{self, Errors};
use super::reference::{MARGIN, Reference, References};
use super::statistics::Statistics;
use super::timing::{self, Machine, Measured, Time};
use super::trial::{self, Keep, Trial, Zone};
use super::{Case, Effort, Event, Journal, Progress, Settings, Stop, equilibrium};
use crate::forces::Spectrum;
use crate::scene::{Precision, Refusal};
use crate::simulators::{self, Build, Entry, Model, SimulatorSettings, Value};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Names of the methods; all where empty.
    pub simulators: Vec<String>,
    /// Whether time is measured besides counts.
    pub time: bool,
}

/// One run of the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "each is a column of the table")]
pub struct Row {
    /// Method, precision, dt and parameters.
    #[serde(flatten)]
    pub settings: Settings,
    /// RMS position error over the free particles and the compared times, m; none where the run burst before.
    pub rms_error: Option<f64>,
    /// Largest position error, m.
    pub max_error: Option<f64>,
    /// `rms_error` over the RMS displacement from the start.
    pub relative_error: Option<f64>,
    /// Whether the error is too small to be told: under ten times the reference's uncertainty.
    pub below_reference: bool,
    /// RMS distance after the same time from Newton's equilibrium, started there, m; none where there is no such shape.
    pub equilibrium_error: Option<f64>,
    /// Of a method that solves another model: the relative error against its own limit, far more sweeps and steps.
    pub limit_error: Option<f64>,
    /// Largest error of the energy ledger over the largest kinetic and elastic energy.
    pub energy_drift: Option<f64>,
    /// Largest strain at the sampled times.
    pub max_strain: Option<f64>,
    /// Force evaluations for each simulated second.
    pub force_evaluations: f64,
    /// Springs looked at for each simulated second.
    pub spring_visits: f64,
    /// Seconds of computing for each simulated second, one thread: the median of five rounds.
    pub seconds_per_simulated_second: Option<f64>,
    /// The fastest and the slowest of these rounds.
    pub seconds_spread: Option<[f64; 2]>,
    /// Whether the method solves the springs of the scene.
    pub same_model: bool,
    /// Its zone.
    pub health: Zone,
    /// Whether the run was given up because its work passed the cap; it has no errors then.
    pub capped: bool,
    /// What is compared after trajectories have parted; none where the run burst or was given up.
    pub statistics: Option<Statistics>,
    /// Whether no row of the same model has both less error and less work in springs looked at.
    pub pareto: bool,
}

/// How the error of a method falls with dt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Order {
    /// Method.
    pub simulator: String,
    /// Its parameters.
    pub params: BTreeMap<String, Value>,
    /// The order that it declares.
    pub declared: u32,
    /// Mean slope over the last halvings of dt that can be told, three at most; in Double.
    pub observed: Option<f64>,
    /// How many halvings these are.
    pub halvings: usize,
    /// Whether these are three halvings whose slopes agree within 0.2 of their mean: only then does the leading term of the
    /// error rule, and the slope is an order.
    pub asymptotic: bool,
    /// Whether an order was observed that differs from the declared one by more than 0.2.
    pub flagged: bool,
}

/// Halvings that are averaged.
const HALVINGS: usize = 3;

impl Order {
    /// What was observed, in words.
    pub fn told(&self) -> String {
        match self.observed {
            None => "not to be told".to_owned(),
            Some(observed) if self.asymptotic => format!("{observed:.2}"),
            Some(observed) if self.halvings < HALVINGS => {
                format!("{observed:.2} over {} of the {HALVINGS} halvings that it takes", self.halvings)
            }
            Some(observed) => format!("not asymptotic (mean slope {observed:.2})"),
        }
    }
}

/// The whole table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trade {
    /// What errors are measured against.
    pub reference: Option<ReferenceSummary>,
    /// One row a run: those that burst or shake as well.
    pub rows: Vec<Row>,
    /// Observed orders of the methods that solve the springs.
    pub orders: Vec<Order>,
    /// Rows that other shards have or that were not reached.
    pub missing: usize,
    /// Where time was measured; none where it was not.
    pub machine: Option<Machine>,
}

/// A reference without its positions.
pub type ReferenceSummary = Box<Reference>;

impl PartialEq for Reference {
    fn eq(&self, other: &Self) -> bool {
        self.method == other.method && self.dt == other.dt && self.uncertainty == other.uncertainty
    }
}

/// Most springs looked at in a run of the table: about half a second of computing.
const MOST_VISITS: f64 = 3e7;
/// But at least so many times the work of the cheapest explicit run, symplectic Euler at its limit, so that its halvings
/// and those of its neighbours stay in the table however large the cloth is.
const TIMES_CHEAPEST: f64 = 16.0;
/// Steps below a method's limit that are tried, a factor of two apart; one above the limit stays in the table as burst.
const BELOW_LIMIT: usize = 5;
/// Longest step of methods without a limit, s: about a frame of film.
const LONGEST: f64 = 1.0 / 24.0;

/// The methods that are asked for.
///
/// # Errors
/// An unknown name.
pub fn chosen(names: &[String]) -> Result<Vec<&'static Entry>, Refusal> {
    if names.is_empty() {
        return Ok(simulators::ALL.iter().collect());
    }
    names.iter().map(|name| simulators::find(name).map_err(Refusal::from)).collect()
}

/// The largest stable dt in theory of a method in a shape, s; none where theory sets no limit.
///
/// # Errors
/// Parameters that the method refuses.
pub fn theory(settings: &Settings, spectrum: &Spectrum) -> Result<Option<f64>, Refusal> {
    let own = SimulatorSettings { id: settings.simulator.clone(), params: settings.params.clone() };
    Ok(<f64 as Build>::build(&own)?.dt_limit(spectrum))
}

/// The steps (s) that a method is tried with: all methods share one ladder of halvings of the time between samples, so
/// that rows at equal dt can be compared.
fn ladder(case: &Case, limit: Option<f64>, fallback: f64) -> Vec<f64> {
    let top = case.seconds / f64::from(case.samples.max(1));
    // A method that is hardly ever stable is shown near its neighbours: shorter steps cost more than they tell.
    let limit = limit.map(|limit| limit.max(fallback / 16.0));
    let halvings = |longest: f64| (top / longest).log2().max(0.0);
    let first = match limit {
        Some(limit) => (halvings(limit).ceil() - 1.0).max(0.0),
        None => halvings(LONGEST).ceil(),
    };
    let steps = if limit.is_some() { BELOW_LIMIT + 1 } else { BELOW_LIMIT };
    (0..steps).map(|i| top / 2f64.powf(first + i as f64)).collect()
}

/// Springs that a run may look at before it is given up. Counted, so that it cuts the same rows on every machine.
fn most_visits(case: &Case) -> Result<u64, Refusal> {
    let (problem, state) = case.start().problem(case.scene())?;
    let limit = theory(&Settings::double("symplectic_euler", 0.0), &Spectrum::of(&problem, &state))?;
    let cheapest = limit.map_or(0.0, |dt| case.seconds / dt * problem.springs.len() as f64);
    Ok(MOST_VISITS.max(TIMES_CHEAPEST * cheapest) as u64)
}

/// All settings that are tried.
///
/// # Errors
/// An unknown method.
pub fn plan(case: &Case, names: &[String]) -> Result<Vec<Settings>, Refusal> {
    let (problem, state) = case.start().problem(case.scene())?;
    let spectrum = Spectrum::of(&problem, &state);
    let fallback = theory(&Settings::double("symplectic_euler", 0.0), &spectrum)?.unwrap_or(LONGEST);
    let mut plan = Vec::new();
    for entry in chosen(names)? {
        for params in super::variants(entry) {
            let own = Settings { params, ..Settings::double(entry.id, 0.0) };
            for dt in ladder(case, theory(&own, &spectrum)?, fallback) {
                for precision in [Precision::Double, Precision::Single] {
                    plan.push(Settings { precision, dt, ..own.clone() });
                }
            }
        }
    }
    Ok(plan)
}

/// Measures the trade of a case.
///
/// # Errors
/// An unknown method, a case that cannot be run, a journal that cannot be written.
pub fn run(
    case: &Case,
    options: &Options,
    references: &References,
    journal: &Journal,
    progress: Progress,
) -> Result<Trade, Refusal> {
    let plan = plan(case, &options.simulators)?;
    let wanted = plan.iter().any(|settings| journal.wants("trade", settings));
    let reference = match wanted.then(|| references.of(case, progress)) {
        None => None,
        Some(Ok(found)) => Some(found),
        Some(Err(stop)) => return Err(stop.into_refusal()),
    };
    // Told by the journal, so that joined shards have it too.
    let told = journal.each("reference", &[case.seconds], progress, |_| {
        reference.as_ref().map(|found| found.summary()).ok_or(Stop::Cancelled)
    })?;
    let told = told.into_iter().flatten().next().or_else(|| reference.as_ref().map(|r| r.summary()));

    let mut rows = match &reference {
        None => journal.each("trade", &plan, progress, |_: &Settings| Err::<Row, _>(Stop::Cancelled))?,
        Some(reference) => {
            let bench = match Bench::new(case, reference, &plan, journal, progress) {
                Ok(bench) => bench,
                Err(stop) => return Err(stop.into_refusal()),
            };
            journal.each("trade", &plan, progress, |settings| bench.row(settings, progress))?
        }
    };
    let machine = if options.time { time(case, &mut rows, journal, progress)? } else { None };
    let rows: Vec<Row> = rows.into_iter().flatten().collect();
    let missing = plan.len() - rows.len();
    Ok(table(rows, told, missing, machine))
}

/// Puts rows together: which of them nothing beats, and what orders they show. `missing` more are to come.
pub fn table(
    mut rows: Vec<Row>,
    reference: Option<Reference>,
    missing: usize,
    machine: Option<Machine>,
) -> Trade {
    let floor = reference.as_ref().map_or(0.0, |r| MARGIN * r.uncertainty);
    flag_pareto(&mut rows, floor);
    Trade { orders: orders(&rows), missing, rows, reference: reference.map(Box::new), machine }
}

/// What every row is compared with.
struct Bench<'a> {
    case: &'a Case,
    reference: &'a Reference,
    free: Vec<bool>,
    equilibrium: Option<Case>,
    /// Sampled positions of the limits of methods that solve another model.
    limits: BTreeMap<String, Vec<Vec<DVec3>>>,
    most_visits: u64,
}

impl<'a> Bench<'a> {
    fn new(
        case: &'a Case,
        reference: &'a Reference,
        plan: &[Settings],
        journal: &Journal,
        progress: Progress,
    ) -> Result<Self, Stop> {
        let mut limits = BTreeMap::new();
        for settings in plan {
            let wanted = !settings.same_model() && journal.wants("trade", settings);
            if wanted && !limits.contains_key(&settings.simulator) {
                progress(Event::Stage("limit of another model"));
                let limit = own_limit(settings, plan)?;
                let trial = trial::run_scene(case, limit.apply(case.scene()), progress)?;
                limits.insert(settings.simulator.clone(), trial.samples);
            }
        }
        progress(Event::Stage("equilibrium"));
        let rest = equilibrium::find(case, case.scene(), progress)?;
        let equilibrium = rest.filter(|rest| rest.smallest_eigenvalue >= 0.0).map(|rest| {
            let still = vec![DVec3::ZERO; rest.positions.len()];
            case.from(case.start().moved(&rest.positions, &still))
        });
        Ok(Self { case, reference, free: case.free(), equilibrium, limits, most_visits: most_visits(case)? })
    }

    fn row(&self, settings: &Settings, progress: Progress) -> Result<Row, Stop> {
        let keep = Keep { ledger: true, statistics: true, most_visits: Some(self.most_visits) };
        let trial = trial::run(self.case, settings.apply(self.case.scene()), keep, progress)?;
        let health = Zone::from(trial.health);
        let burst = health == Zone::Diverged || trial.given_up;
        let errors = metrics::errors(&self.free, self.reference, &trial.samples).filter(|_| !trial.given_up);
        let equilibrium_error = match &self.equilibrium {
            Some(rest) if !burst => self.distance_from_rest(rest, settings, progress)?,
            _ => None,
        };
        let against_limit = self.limits.get(&settings.simulator).filter(|_| !burst).map(|limit| {
            let start = vec![self.case.start().motion().0; limit.len()];
            let displacement = metrics::rms(&self.free, &start, limit);
            metrics::rms(&self.free, limit, &trial.samples) / displacement.max(f64::MIN_POSITIVE)
        });
        let Trial { steps, cost, max_strain, energy_drift, given_up, statistics, .. } = trial;
        let per_second = 1.0 / (steps.max(1) as f64 * settings.dt);
        Ok(Row {
            settings: settings.clone(),
            rms_error: errors.map(|e: Errors| e.rms),
            max_error: errors.map(|e| e.max),
            relative_error: errors.map(|e| e.relative),
            below_reference: errors.is_some_and(|e| self.reference.hides(e.rms)),
            equilibrium_error,
            limit_error: against_limit.filter(|e| e.is_finite()),
            energy_drift: (!burst).then_some(energy_drift).filter(|e| e.is_finite()),
            max_strain: (!burst).then_some(max_strain).filter(|e| e.is_finite()),
            force_evaluations: cost.force_evaluations as f64 * per_second,
            spring_visits: cost.spring_visits as f64 * per_second,
            seconds_per_simulated_second: None,
            seconds_spread: None,
            same_model: settings.same_model(),
            health,
            capped: given_up,
            statistics: statistics.filter(|_| !burst),
            pareto: false,
        })
    }

    fn distance_from_rest(
        &self,
        rest: &Case,
        settings: &Settings,
        progress: Progress,
    ) -> Result<Option<f64>, Stop> {
        let keep = Keep { most_visits: Some(self.most_visits), ..Keep::default() };
        let trial = trial::run(rest, settings.apply(rest.scene()), keep, progress)?;
        let start = rest.start().motion().0;
        let end = trial.samples.last().filter(|_| !trial.health.is_diverged() && !trial.given_up);
        Ok(end.map(|end| metrics::mean_square(&self.free, &start, end).sqrt()))
    }
}

/// What a method that solves another model tends to: half the finest step of the plan, twice the most sweeps.
fn own_limit(settings: &Settings, plan: &[Settings]) -> Result<Settings, Refusal> {
    let finest = plan.iter().filter(|s| s.simulator == settings.simulator).map(|s| s.dt);
    let dt = finest.fold(f64::INFINITY, f64::min) / 2.0;
    let entry = simulators::find(&settings.simulator)?;
    let params = Effort::of(entry, &BTreeMap::new()).into_iter().filter_map(|effort| {
        let most = effort
            .ladder
            .iter()
            .filter_map(|value| if let Value::Count(n) = value { Some(2 * n) } else { None });
        Some((effort.name.to_owned(), Value::Count(most.max()?)))
    });
    Ok(Settings { params: params.collect(), ..Settings::double(&settings.simulator, dt) })
}

/// Adds measured time to the rows that are whole, and answers where it was measured.
fn time(
    case: &Case,
    rows: &mut [Option<Row>],
    journal: &Journal,
    progress: Progress,
) -> Result<Option<Machine>, Refusal> {
    let sound: Vec<Settings> = rows
        .iter()
        .flatten()
        .filter(|row| row.health != Zone::Diverged && !row.capped)
        .map(|row| row.settings.clone())
        .collect();
    let unknown: Vec<Settings> = sound.iter().filter(|s| journal.wants(timing::STAGE, s)).cloned().collect();
    let times = match timing::measure(case, &unknown, progress) {
        Ok(times) => times,
        Err(Stop::Cancelled) => return Ok(None),
        Err(Stop::Refused(refusal)) => return Err(refusal),
    };
    let told = journal.each(timing::STAGE, &sound, progress, |settings| {
        let measured = unknown.iter().zip(&times).find(|(known, _)| *known == settings);
        measured.map(|(_, time)| Measured::here(*time)).ok_or(Stop::Cancelled)
    })?;
    let told: Vec<(Settings, Option<Measured<Option<Time>>>)> = sound.into_iter().zip(told).collect();
    for row in rows.iter_mut().flatten() {
        let measured = told.iter().find(|(settings, _)| *settings == row.settings);
        let time = measured.and_then(|(_, measured)| measured.as_ref()?.found);
        row.seconds_per_simulated_second = time.map(|t| t.median);
        row.seconds_spread = time.map(|t| t.spread);
    }
    Ok(Machine::together(told.into_iter().filter_map(|(_, measured)| Some(measured?.machine))))
}

/// Marks the rows that no other of the same model beats in both error and work. Errors under `floor` (m) count as equal.
fn flag_pareto(rows: &mut [Row], floor: f64) {
    let worth = |row: &Row| {
        let sound = row.same_model && row.health == Zone::Quiet && !row.capped;
        row.rms_error.filter(|_| sound).map(|error| (error.max(floor), row.spring_visits))
    };
    let points: Vec<_> = rows.iter().filter_map(worth).collect();
    for row in rows.iter_mut() {
        row.pareto = worth(row).is_some_and(|(error, work)| {
            !points.iter().any(|(e, w)| *e <= error && *w <= work && (*e < error || *w < work))
        });
    }
}

/// The observed order of every method that solves the springs.
fn orders(rows: &[Row]) -> Vec<Order> {
    /// How far slopes may be from each other's mean, and an order from the declared one.
    const OFF: f64 = 0.2;
    let mut orders: Vec<Order> = Vec::new();
    let told = |row: &&Row| row.settings.precision == Precision::Double && row.same_model;
    for row in rows.iter().filter(told) {
        let Settings { simulator, params, .. } = &row.settings;
        if orders.iter().any(|order| order.simulator == *simulator && order.params == *params) {
            continue;
        }
        let same = |other: &&Row| other.settings.simulator == *simulator && other.settings.params == *params;
        let usable = |row: &&Row| row.health == Zone::Quiet && !row.below_reference;
        let points = rows.iter().filter(told).filter(same).filter(usable);
        let mut points: Vec<(f64, f64)> = points
            .filter_map(|row| Some((row.settings.dt.ln(), row.rms_error.filter(|e| *e > 0.0)?.ln())))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.truncate(HALVINGS + 1);
        let slopes: Vec<f64> =
            points.windows(2).map(|pair| (pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0)).collect();
        let observed = (!slopes.is_empty()).then(|| slopes.iter().sum::<f64>() / slopes.len() as f64);
        let agree = |mean: f64| slopes.iter().all(|slope| (slope - mean).abs() <= OFF);
        let entry = simulators::find(simulator);
        let declared = entry.as_ref().map_or(0, |entry| entry.order);
        let springs = entry.as_ref().is_ok_and(|entry| entry.model == Model::Springs);
        // One that chooses its own steps errs by its tolerance, not by dt.
        let observed = observed.filter(|_| !entry.is_ok_and(super::adaptive));
        let asymptotic = slopes.len() == HALVINGS && observed.is_some_and(agree);
        orders.push(Order {
            simulator: simulator.clone(),
            params: params.clone(),
            declared,
            observed,
            halvings: slopes.len(),
            asymptotic,
            flagged: springs && asymptotic && observed.is_some_and(|o| (o - f64::from(declared)).abs() > OFF),
        });
    }
    orders
}
