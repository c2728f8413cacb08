//! Where each method stops being stable: in theory, guaranteed, measured; and a map of its zones over dt and stiffness.
//!
//! The limits belong to the case's state as it stands. *Theory*: the method's own region of stability on the extreme
//! motions of the current shape. *Guaranteed*: the same with every spring taken as k in all directions, which no shape
//! exceeds. *Measured*: the method's own steps, around that state held fast, applied again and again to a small
//! disturbance (power iteration on the step's derivative); the limit is where it starts to grow. A shape in motion is held fast
//! too: what is told is the limit there and then. Where it buckles, that growth is the cloth's own and in no method's limit.
//!
//! The map tells what becomes of the scene itself: quiet, unsettled (bounded, but shaking from step to step), or diverged,
//! as the world's own health says. Its boundaries are found by bisection.

mod growth;
mod limits;

pub use limits::limit;

use super::trial::Zone;
use super::{Case, Event, Journal, Progress, Settings, Stop, trade};
use crate::forces::Spectrum;
use crate::scene::{Refusal, Scene};
use serde::{Deserialize, Serialize};

/// What dt is mapped against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Stiffness of the stretch springs, N/m.
    Stiffness,
    /// Damping of all springs, kg/s.
    Damping,
}

/// What is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Names of the methods; all where empty.
    pub simulators: Vec<String>,
    /// What dt is mapped against; none for the limits alone.
    pub map: Option<Axis>,
}

/// The limits of a method, s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limit {
    /// Method.
    pub simulator: String,
    /// In theory, in the current shape; none where theory sets no limit.
    pub dt_theory: Option<f64>,
    /// Measured in the current shape; none where there is no limit up to 10 s.
    pub dt_measured: Option<f64>,
    /// Below this it is stable in any shape; none where theory sets no limit.
    pub dt_guaranteed: Option<f64>,
}

/// One run of the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Method.
    pub simulator: String,
    /// Time step, s.
    pub dt: f64,
    /// Stiffness of the stretch springs, N/m.
    pub stiffness: f64,
    /// Damping of the springs, kg/s.
    pub damping: f64,
    /// What became of it.
    pub zone: Zone,
}

/// Where the zones of a method meet along one line of the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Boundary {
    /// Method.
    pub simulator: String,
    /// What changes along the line: `dt`, `stiffness` or `damping`.
    pub along: String,
    /// The value of the other one: of the map's axis along dt, of dt along the axis.
    pub at: f64,
    /// Largest value that stayed quiet; none where none did.
    pub quiet_until: Option<f64>,
    /// Smallest value that burst; none where none did.
    pub diverged_from: Option<f64>,
    /// Along dt: the theoretical limit in the case's shape, s.
    pub theory: Option<f64>,
    /// Along dt: below this it is stable in any shape, s.
    pub guaranteed: Option<f64>,
}

/// The whole study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stability {
    /// Largest natural frequency of the current shape, rad/s.
    pub omega_max: f64,
    /// A bound on it in any shape, rad/s.
    pub omega_bound: f64,
    /// The limits of each method.
    pub limits: Vec<Limit>,
    /// Every run of the map.
    pub map: Vec<Cell>,
    /// Its boundaries.
    pub boundaries: Vec<Boundary>,
    /// Parts that other shards have or that were not reached.
    pub missing: usize,
}

/// Measures the stability of a case.
///
/// # Errors
/// An unknown method, a case that cannot be run, a journal that cannot be written.
pub fn run(
    case: &Case,
    options: &Options,
    journal: &Journal,
    progress: Progress,
) -> Result<Stability, Refusal> {
    let names: Vec<String> = trade::chosen(&options.simulators)?
        .iter()
        .map(|entry| settings_of(case, entry.id).simulator)
        .collect();
    let (problem, state) = case.start().problem(case.scene())?;
    let limits = journal.each("limits", &names, progress, |name| {
        limit(&problem, &state, &settings_of(case, name), progress)
    })?;
    let mut lines = Vec::new();
    for name in options.map.iter().flat_map(|_| &names) {
        for factor in [0.1, 0.3, 1.0, 3.0, 10.0] {
            lines.push(Line {
                simulator: name.clone(),
                axis: options.map.unwrap_or(Axis::Stiffness),
                factor: Some(factor),
            });
        }
        lines.push(Line {
            simulator: name.clone(),
            axis: options.map.unwrap_or(Axis::Stiffness),
            factor: None,
        });
    }
    let walked = journal.each("map", &lines, progress, |line| walk(case, line, progress))?;
    let missing =
        limits.iter().filter(|l| l.is_none()).count() + walked.iter().filter(|w| w.is_none()).count();
    let mut map = Vec::new();
    let mut boundaries = Vec::new();
    for (cells, boundary) in walked.into_iter().flatten() {
        map.extend(cells);
        boundaries.push(boundary);
    }
    Ok(Stability {
        omega_max: Spectrum::of(&problem, &state).omega_max(),
        omega_bound: Spectrum::stiffest(&problem).omega_max(),
        limits: limits.into_iter().flatten().collect(),
        map,
        boundaries,
        missing,
    })
}

/// A method with the scene's own parameters where it is the scene's.
fn settings_of(case: &Case, name: &str) -> Settings {
    let own = Settings::of(case.scene());
    if own.simulator == name {
        own
    } else {
        Settings { precision: own.precision, ..Settings::double(name, own.dt) }
    }
}

/// A line of the map: along dt at a multiple of the scene's own value of the axis, or along the axis at the scene's dt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Line {
    simulator: String,
    axis: Axis,
    factor: Option<f64>,
}

impl Axis {
    fn name(self) -> &'static str {
        match self {
            Self::Stiffness => "stiffness",
            Self::Damping => "damping",
        }
    }

    fn of(self, scene: &Scene) -> f64 {
        match self {
            Self::Stiffness => scene.springs.stretch.stiffness,
            Self::Damping => scene.springs.damping,
        }
    }

    fn with(self, scene: &Scene, value: f64) -> Scene {
        let mut scene = scene.clone();
        match self {
            Self::Stiffness => scene.springs.stretch.stiffness = value,
            Self::Damping => scene.springs.damping = value,
        }
        scene
    }
}

/// What becomes of a scene over the case's time.
///
/// # Errors
/// A scene that cannot be run; a listener that stops it.
pub fn zone(case: &Case, scene: Scene, progress: Progress) -> Result<Zone, Stop> {
    let mut world = case.world(scene)?;
    let steps = (case.seconds / world.scene().dt).round().max(1.0) as u64;
    for step in 0..steps {
        world.step();
        if world.health().is_diverged() {
            break;
        }
        if step % 64 == 0 && !progress(Event::Alive) {
            return Err(Stop::Cancelled);
        }
    }
    Ok(world.health().into())
}

fn walk(case: &Case, line: &Line, progress: Progress) -> Result<(Vec<Cell>, Boundary), Stop> {
    let settings = settings_of(case, &line.simulator);
    let own = settings.apply(case.scene());
    let own_value = line.axis.of(&own).max(f64::MIN_POSITIVE);
    let scene_at = |value: f64| match line.factor {
        Some(factor) => Scene { dt: value, ..line.axis.with(&own, own_value * factor) },
        None => line.axis.with(&own, value),
    };
    let limits = |scene: &Scene| -> Result<[Option<f64>; 2], Stop> {
        let (problem, state) = case.start().problem(scene)?;
        let theory = trade::theory(&settings, &Spectrum::of(&problem, &state))?;
        Ok([theory, trade::theory(&settings, &Spectrum::stiffest(&problem))?])
    };
    // Where to look: around the limit in theory, or the scene's own value.
    let [theory, guaranteed] = match line.factor {
        Some(_) => limits(&scene_at(own.dt))?,
        None => [None, None],
    };
    let centre = match line.factor {
        Some(_) => theory.filter(|dt| *dt > 0.0).unwrap_or(own.dt.max(1e-6)),
        None => own_value,
    };
    let mut seen: Vec<(f64, Zone)> = Vec::new();
    let mut look = |value: f64| -> Result<Zone, Stop> {
        let zone = zone(case, scene_at(value), progress)?;
        seen.push((value, zone));
        Ok(zone)
    };
    let grid: Vec<(f64, Zone)> = (-2..=2)
        .map(|i| {
            let value = centre * 2f64.powf(0.5 * f64::from(i));
            look(value).map(|zone| (value, zone))
        })
        .collect::<Result<_, _>>()?;
    let quiet_until = boundary(&grid, Zone::Quiet, &mut look)?.0;
    let diverged_from = boundary(&grid, Zone::Unsettled, &mut look)?.1;
    seen.sort_by(|a, b| a.0.total_cmp(&b.0));
    let cells = seen.into_iter().map(|(value, zone)| {
        let scene = scene_at(value);
        let (stiffness, damping) = (scene.springs.stretch.stiffness, scene.springs.damping);
        Cell { simulator: line.simulator.clone(), dt: scene.dt, stiffness, damping, zone }
    });
    let along = if line.factor.is_some() { "dt" } else { line.axis.name() };
    let at = line.factor.map_or(own.dt, |factor| own_value * factor);
    let boundary = Boundary {
        simulator: line.simulator.clone(),
        along: along.to_owned(),
        at,
        quiet_until,
        diverged_from,
        theory,
        guaranteed,
    };
    Ok((cells.collect(), boundary))
}

/// The largest value whose zone is at most `calm`, and the smallest beyond it, 1 % apart; the grid says where to look, and
/// is gone beyond in both directions.
fn boundary(
    grid: &[(f64, Zone)],
    calm: Zone,
    look: &mut dyn FnMut(f64) -> Result<Zone, Stop>,
) -> Result<(Option<f64>, Option<f64>), Stop> {
    /// How close the two sides come.
    const CLOSE: f64 = 1.01;
    let first_beyond = grid.iter().position(|(_, zone)| *zone > calm);
    let (mut low, mut high) = match first_beyond {
        Some(0) => (grid[0].0 / 4.0, grid[0].0),
        Some(i) => (grid[i - 1].0, grid[i].0),
        None => (grid[grid.len() - 1].0, grid[grid.len() - 1].0 * 4.0),
    };
    if first_beyond == Some(0) && look(low)? > calm {
        return Ok((None, Some(low)));
    }
    if first_beyond.is_none() && look(high)? <= calm {
        return Ok((Some(high), None));
    }
    while high / low > CLOSE {
        let middle = (low * high).sqrt();
        if look(middle)? > calm {
            high = middle;
        } else {
            low = middle;
        }
    }
    Ok((Some(low), Some(high)))
}
