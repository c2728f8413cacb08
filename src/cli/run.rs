//! `tenter run`: steps a scene headless, with a progress bar, and tells what became of it.

use super::output::{self, Pending};
use super::{Common, Ending};
use crate::forces::Cost;
use crate::scene::{Place, Precision, Refusal, Scene};
use crate::world::{Cause, Energy, Health, Recording, World};
use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::Instant;

#[derive(Args)]
pub struct Options {
    /// A .ron file, a mesh, a built-in scene, or - for standard input.
    scene: String,
    #[command(flatten)]
    length: Length,
    #[command(flatten)]
    results: Results,
    /// Writes a recording that `tenter replay` runs again.
    #[arg(long, value_name = "FILE.ron")]
    record: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

/// How long a run is.
#[derive(Args)]
#[group(id = "length", required = true, multiple = false)]
pub struct Length {
    /// Simulated time to run for, s.
    #[arg(long, value_name = "T", value_parser = seconds)]
    seconds: Option<f64>,
    /// Steps to run for.
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
}

impl Length {
    /// Steps of a scene that it comes to.
    pub fn steps(&self, scene: &Scene) -> Result<u64, Refusal> {
        self.steps.map_or_else(|| steps_in(self.seconds.unwrap_or_default(), scene), Ok)
    }
}

/// Where a run's result goes.
#[derive(Args, Clone, Debug, Default)]
pub struct Results {
    /// Writes the result as JSON.
    #[arg(long, value_name = "FILE.json")]
    out: Option<PathBuf>,
    /// Adds every particle's position and velocity to the result.
    #[arg(long)]
    positions: bool,
}

pub fn seconds(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "it is not a number; accepted: seconds, 0 or more")?;
    if value >= 0.0 && value.is_finite() { Ok(value) } else { Err("accepted: seconds, 0 or more".to_owned()) }
}

/// Set by Ctrl-C: long work stops and gives what it has, to the last whole step.
static INTERRUPTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Lets Ctrl-C stop long work.
pub fn catch_interrupt() {
    on_interrupt(|| {});
}

/// The same, and does something besides.
pub fn on_interrupt(act: impl Fn() + Send + 'static) {
    // Only the first handler of a process can be set; any later call finds the same one.
    let _ = ctrlc::set_handler(move || {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            // Asked twice: nobody waits for what there is. Files are whole or not there.
            std::process::exit(130);
        }
        act();
    });
}

/// What Ctrl-C sets, for a world to heed.
pub fn interrupt() -> Arc<AtomicBool> {
    Arc::clone(&INTERRUPTED)
}

/// Whether Ctrl-C was pressed.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

pub fn run(options: &Options) -> Result<Ending, Refusal> {
    let opened = options.common.open(&options.scene)?;
    let steps = options.length.steps(&opened.scene)?;
    let record = options.record.as_deref().map(Record::new).transpose()?;
    let world = options.common.world(&opened)?;
    let (world, ending) = execute(world, &options.results, &options.common, &opened.title, steps)?;
    if let Some(record) = record {
        record.finish(Recording::of(opened.scene, &world), &opened.place)?;
    }
    Ok(ending)
}

/// A recording to be written.
pub struct Record {
    file: Pending,
    folder: PathBuf,
}

impl Record {
    /// Prepares its file.
    pub fn new(path: &Path) -> Result<Self, Refusal> {
        Ok(Self { file: Pending::new(path)?, folder: path.parent().unwrap_or(Path::new(".")).to_owned() })
    }

    /// Writes a recording whose scene was opened at `place`.
    pub fn finish(self, mut recording: Recording, place: &Place) -> Result<(), Refusal> {
        recording.scene = place.moved(&recording.scene, &self.folder);
        self.file.finish(recording.to_ron()?.as_bytes())
    }
}

/// Steps that fill a time.
pub fn steps_in(seconds: f64, scene: &Scene) -> Result<u64, Refusal> {
    let steps = (seconds / scene.dt).round();
    if steps.is_finite() && steps < 1e18 {
        Ok(steps as u64)
    } else {
        Err(Refusal::new(format!("dt is {} s, so {seconds} s never pass; accepted: --steps N", scene.dt)))
    }
}

/// Runs a world as [`advance`] does, then writes the result wherever it was asked for.
pub fn execute(
    world: World,
    results: &Results,
    common: &Common,
    title: &str,
    steps: u64,
) -> Result<(World, Ending), Refusal> {
    execute_as(world, results, common, title, steps, |_| Ok(true), |_| Ok(None))
}

/// The same with acts between the steps, and what is to be said of the end beside the result.
pub fn execute_as(
    mut world: World,
    results: &Results,
    common: &Common,
    title: &str,
    steps: u64,
    between: impl FnMut(&mut World) -> Result<bool, Refusal> + Send,
    compare: impl FnOnce(&World) -> Result<Option<Difference>, Refusal>,
) -> Result<(World, Ending), Refusal> {
    let pending = results.out.as_deref().map(Pending::new).transpose()?;
    let warnings = world.warnings();
    common.warn(&warnings);
    let start = Instant::now();
    advance(&mut world, common, steps, between)?;
    let wall_seconds = start.elapsed().as_secs_f64();
    let difference = compare(&world)?;
    let mut result = RunResult::of(&world, wall_seconds, common.threads(), results.positions, warnings);
    result.difference = difference;
    let text = if pending.is_some() || common.json { output::json(&result)? } else { String::new() };
    if let Some(file) = pending {
        file.finish(format!("{text}\n").as_bytes())?;
    }
    if common.json {
        output::print(&text);
    }
    common.say(&result.summary(title));
    let ending = Ending::of(&world);
    Ok((world, ending))
}

/// Steps a world to a number of steps, calling `between` before the first and after each, until that says no, it diverges or
/// Ctrl-C is pressed.
pub fn advance(
    world: &mut World,
    common: &Common,
    steps: u64,
    mut between: impl FnMut(&mut World) -> Result<bool, Refusal> + Send,
) -> Result<(), Refusal> {
    catch_interrupt();
    let bar = progress(common, steps);
    let mut shown = Instant::now();
    let mut goes_on = between(world)?;
    world.threads().run(|| {
        while goes_on && world.steps() < steps && !interrupted() {
            world.step();
            if world.health().is_diverged() || interrupted() {
                break;
            }
            goes_on = between(world)?;
            if shown.elapsed().as_millis() > 100 {
                shown = Instant::now();
                bar.set_message(format!("{:.2} s simulated", world.time()));
                bar.set_position(world.steps());
            }
        }
        Ok::<(), Refusal>(())
    })?;
    bar.finish_and_clear();
    if goes_on && world.steps() < steps && !world.health().is_diverged() {
        common.warn(&[format!("interrupted after {} of {steps} steps", world.steps())]);
    }
    Ok(())
}

/// A bar on a terminal, for so many parts of work.
pub fn progress(common: &Common, parts: u64) -> ProgressBar {
    let visible = std::io::stderr().is_terminal() && !common.quiet;
    let target = if visible { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let style = ProgressStyle::with_template("{bar:40} {percent:>3} %, {msg}, {eta} left");
    ProgressBar::with_draw_target(Some(parts), target)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// The result of a run, as the files that users rely on have it.
#[derive(Serialize)]
pub struct RunResult<'a> {
    scene: &'a Scene,
    simulator: &'a str,
    precision: Precision,
    dt: f64,
    steps: u64,
    time: f64,
    particles: usize,
    pinned: usize,
    springs: SpringCounts,
    broken: usize,
    health: Health,
    energy: Energy,
    momentum: [f64; 3],
    angular_momentum: [f64; 3],
    max_strain: f64,
    mean_strain: f64,
    cost: Cost,
    wall_seconds: f64,
    threads: u32,
    warnings: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    difference: Option<Difference>,
    #[serde(skip_serializing_if = "Option::is_none")]
    positions: Option<Vec<[f64; 3]>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    velocities: Option<Vec<[f64; 3]>>,
}

/// How far the end is from that of another run with as many particles.
#[derive(Clone, Copy, Serialize)]
pub struct Difference {
    /// Root mean square and largest distance of the particles, m, and the particle that is farthest.
    pub rms: f64,
    pub max: f64,
    pub particle: usize,
    /// The other's energies, J, and largest strain.
    pub energy: Energy,
    pub max_strain: f64,
}

impl Difference {
    /// None where the particles are not as many.
    pub fn of(world: &World, other: &World) -> Option<Self> {
        let (own, others) = (world.positions(), other.positions());
        if own.len() != others.len() {
            return None;
        }
        let apart: Vec<f64> = own.iter().zip(&others).map(|(a, b)| a.distance(*b)).collect();
        let rms = (apart.iter().map(|d| d * d).sum::<f64>() / apart.len().max(1) as f64).sqrt();
        let farthest = apart.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        let (particle, max) = farthest.unwrap_or_default();
        let measures = other.measures();
        Some(Self { rms, max, particle, energy: measures.energy, max_strain: measures.max_strain })
    }
}

/// Springs by kind, those that do not act included.
#[derive(Clone, Copy, Serialize)]
pub struct SpringCounts {
    pub stretch: usize,
    pub shear: usize,
    pub bend: usize,
}

impl SpringCounts {
    pub fn of(topology: &crate::model::Topology) -> Self {
        let [stretch, shear, bend] = [0, 1, 2].map(|kind| topology.pairs[kind].len());
        Self { stretch, shear, bend }
    }
}

impl<'a> RunResult<'a> {
    fn of(world: &'a World, wall_seconds: f64, threads: u32, positions: bool, warnings: Vec<String>) -> Self {
        let scene = world.scene();
        let measures = world.measures();
        let arrays = |vectors: Vec<glam::DVec3>| vectors.into_iter().map(|v| v.to_array()).collect();
        Self {
            scene,
            simulator: &scene.simulator.id,
            precision: scene.precision,
            dt: scene.dt,
            steps: world.steps(),
            time: world.time(),
            particles: world.pinned().len(),
            pinned: world.pinned().iter().filter(|p| **p).count(),
            springs: SpringCounts::of(world.topology()),
            broken: world.broken().len(),
            health: world.health(),
            energy: measures.energy,
            momentum: measures.momentum.to_array(),
            angular_momentum: measures.angular_momentum.to_array(),
            max_strain: measures.max_strain,
            mean_strain: measures.mean_strain,
            cost: world.cost(),
            wall_seconds,
            threads,
            warnings,
            difference: None,
            positions: positions.then(|| arrays(world.positions())),
            velocities: positions.then(|| arrays(world.velocities())),
        }
    }

    /// For people.
    fn summary(&self, title: &str) -> String {
        let SpringCounts { stretch, shear, bend } = self.springs;
        let speed = if self.wall_seconds > 0.0 { self.time / self.wall_seconds } else { f64::INFINITY };
        let torn = if self.broken > 0 { format!(", {} torn", self.broken) } else { String::new() };
        let health = match self.health {
            Health::Ok => "ok".to_owned(),
            Health::Unsettled { step, time, particle, cause: Cause::Shaking } => {
                format!(
                    "unsettled: particle {particle} shakes since step {step} ({time:.4} s); dt is too long for this stiffness"
                )
            }
            Health::Unsettled { step, time, cause: Cause::Unsolved, .. } => format!(
                "unsettled: the equations of {} steps were not solved to tolerance, the first in step {step} ({time:.4} s); {:.1e} times the tolerance was left at most",
                self.cost.unsolved_steps, self.cost.residual
            ),
            Health::Diverged { step, time, particle } => format!(
                "diverged in step {step} ({time:.4} s) at particle {particle}; what is shown is the last good state"
            ),
        };
        let difference = self.difference.map_or(String::new(), |d| {
            format!(
                "\nagainst the recording: {:.6} m apart (root mean square), {:.6} m at particle {}; its energy {:.6} J, largest strain {:.4}",
                d.rms, d.max, d.particle, d.energy.total(), d.max_strain
            )
        });
        format!(
            "{title}: {} particles ({} pinned), springs {stretch} stretch, {shear} shear, {bend} bend{torn}\n\
             {} in {:?} precision, dt {} s: {} steps, {:.4} s simulated in {:.3} s ({speed:.1} x real time)\n\
             energy: kinetic {:.6} J, gravitational {:.6} J, elastic {:.6} J\n\
             strain: largest {:.4}, mean {:.4}\n\
             cost: {} force evaluations, {} spring visits, {} solver iterations\n\
             health: {health}{difference}",
            self.particles,
            self.pinned,
            self.simulator,
            self.precision,
            self.dt,
            self.steps,
            self.time,
            self.wall_seconds,
            self.energy.kinetic,
            self.energy.gravitational,
            self.energy.elastic,
            self.max_strain,
            self.mean_strain,
            self.cost.force_evaluations,
            self.cost.spring_visits,
            self.cost.solver_iterations,
        )
    }
}
