//! Measured time: interleaved, warmed runs on one thread, with nothing else of ours going on.

use super::{Case, Event, Progress, Settings, Stop};
use crate::scene::Scene;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Seconds of computing for each simulated second.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// The median of the rounds.
    pub median: f64,
    /// The fastest and the slowest round.
    pub spread: [f64; 2],
}

/// What the time was measured on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// Name of the processor.
    pub processor: String,
    /// Threads that it runs at once.
    pub threads: usize,
    /// Operating system and architecture.
    pub system: String,
    /// Version of Tenter, and whether it was built with optimisation.
    pub tenter: String,
}

/// What was measured, and where: a line of a journal that other machines add to.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Measured<T> {
    /// The times.
    pub found: T,
    /// Where.
    pub machine: Machine,
}

impl<T> Measured<T> {
    /// Measured on this machine.
    pub fn here(found: T) -> Self {
        Self { found, machine: Machine::here() }
    }
}

impl Machine {
    /// Several as one: what differs stands beside each other, the threads are the most of them. None where there is none.
    pub fn together(machines: impl IntoIterator<Item = Self>) -> Option<Self> {
        let mut machines: Vec<Self> = machines.into_iter().collect();
        machines.sort_by(|a, b| (&a.processor, a.threads).cmp(&(&b.processor, b.threads)));
        machines.dedup();
        if machines.len() == 1 {
            return machines.pop();
        }
        let all = |of: &dyn Fn(&Self) -> String| {
            let mut words: Vec<String> = machines.iter().map(of).collect();
            words.dedup();
            words.join(" and ")
        };
        Some(Self {
            threads: machines.iter().map(|m| m.threads).max()?,
            processor: all(&|m| format!("{} ({} threads)", m.processor, m.threads)),
            system: all(&|m| m.system.clone()),
            tenter: all(&|m| m.tenter.clone()),
        })
    }

    /// This one.
    pub fn here() -> Self {
        let names = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let name = names.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
        let build = if cfg!(debug_assertions) { "development build" } else { "release build" };
        Self {
            processor: name
                .map_or_else(|| "unknown processor".to_owned(), |(_, name)| name.trim().to_owned()),
            threads: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            tenter: format!("{} ({build})", env!("CARGO_PKG_VERSION")),
        }
    }
}

/// The stage in which time is measured: nothing else should use the machine then.
pub const STAGE: &str = "time";
/// Rounds that count; one more before them warms caches and branch predictors.
pub const ROUNDS: usize = 5;
/// Computing that a round of one setting takes, s: long against the clock's resolution, short against a user's patience.
const ROUND: f64 = 0.01;

/// Measures some settings of a case, in rounds over all of them, so that a disturbance meets all alike. `None` where a run
/// diverged on the way.
///
/// # Errors
/// Settings that cannot be run; a listener that stops it.
pub fn measure(case: &Case, settings: &[Settings], progress: Progress) -> Result<Vec<Option<Time>>, Stop> {
    let scenes: Vec<Scene> = settings.iter().map(|own| own.apply(case.scene())).collect();
    measure_scenes(case, &scenes, progress)
}

/// The same for edited scenes.
///
/// # Errors
/// Those of [`measure`].
pub fn measure_scenes(case: &Case, scenes: &[Scene], progress: Progress) -> Result<Vec<Option<Time>>, Stop> {
    progress(Event::Stage(STAGE));
    let mut rounds: Vec<Vec<f64>> = vec![Vec::new(); scenes.len()];
    let mut burst = vec![false; scenes.len()];
    let mut counts = vec![0u64; scenes.len()];
    for round in 0..=ROUNDS {
        for (i, own) in scenes.iter().enumerate() {
            if !progress(Event::Alive) {
                return Err(Stop::Cancelled);
            }
            if burst[i] {
                continue;
            }
            let mut world = case.world(own.clone())?;
            let most = case.steps(own.dt);
            let start = Instant::now();
            if round == 0 {
                while world.steps() < most
                    && start.elapsed().as_secs_f64() < ROUND
                    && !world.health().is_diverged()
                {
                    world.step();
                }
                counts[i] = world.steps().max(1);
            } else {
                (0..counts[i]).for_each(|_| world.step());
                rounds[i].push(start.elapsed().as_secs_f64() / (counts[i] as f64 * own.dt));
            }
            burst[i] |= world.health().is_diverged();
        }
        progress(Event::Done(round + 1, ROUNDS + 1));
    }
    Ok(rounds
        .into_iter()
        .zip(burst)
        .map(|(times, burst)| if burst { None } else { summary(times) })
        .collect())
}

fn summary(mut times: Vec<f64>) -> Option<Time> {
    times.sort_by(f64::total_cmp);
    let (low, high) = (times.first()?, times.last()?);
    Some(Time { median: times[times.len() / 2], spread: [*low, *high] })
}
