//! `tenter run`: steps a scene headless, with a progress bar, and tells what became of it.

use super::output::{self, Pending};
use super::{Common, Ending};
use crate::forces::Cost;
use crate::scene::{Precision, Refusal, Scene, builtin};
use crate::world::{Energy, Health, Recording, World};
use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

#[derive(Args)]
#[command(group = clap::ArgGroup::new("length").required(true))]
pub struct Options {
    /// A .ron file, a mesh, a built-in scene, or - for standard input.
    scene: String,
    /// Simulated time to run for, s.
    #[arg(long, group = "length", value_name = "T", value_parser = seconds)]
    seconds: Option<f64>,
    /// Steps to run for.
    #[arg(long, group = "length", value_name = "N")]
    steps: Option<u64>,
    #[command(flatten)]
    results: Results,
    /// Writes a recording that `tenter replay` runs again.
    #[arg(long, value_name = "FILE.ron")]
    record: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
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

/// Set by Ctrl-C: long work stops at the next step and gives what it has.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Lets Ctrl-C stop long work.
pub fn catch_interrupt() {
    // Only the first handler of a process can be set; any later call finds the same one.
    let _ = ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed));
}

/// Whether Ctrl-C was pressed.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

pub fn run(options: &Options) -> Result<Ending, Refusal> {
    let opened = options.common.open(&options.scene)?;
    let steps = match (options.steps, options.seconds) {
        (Some(steps), _) => steps,
        (None, seconds) => steps_in(seconds.unwrap_or_default(), &opened.scene)?,
    };
    let record = options.record.as_deref().map(Pending::new).transpose()?;
    let world = options.common.world(&opened)?;
    let (world, ending) =
        execute(world, &options.results, &options.common, &opened.title, steps, |_| Ok(()))?;
    if let (Some(file), Some(path)) = (record, &options.record) {
        let scene = opened.place.moved(&opened.scene, path.parent().unwrap_or(Path::new(".")));
        file.finish(Recording::of(scene, &world).to_ron()?.as_bytes())?;
    }
    Ok(ending)
}

/// Steps that fill a time.
fn steps_in(seconds: f64, scene: &Scene) -> Result<u64, Refusal> {
    let steps = (seconds / scene.dt).round();
    if steps.is_finite() && steps < 1e18 {
        Ok(steps as u64)
    } else {
        Err(Refusal::new(format!("dt is {} s, so {seconds} s never pass; accepted: --steps N", scene.dt)))
    }
}

/// `tenter SCENE…` where no window can be opened: ten seconds of the first scene, headless.
pub fn without_window(scenes: &[String], common: &Common) -> Result<Ending, Refusal> {
    /// Simulated time, s.
    const SECONDS: f64 = 10.0;
    let name = scenes.first().map_or(builtin::ALL[0].name, String::as_str);
    let opened = common.open(name)?;
    let steps = steps_in(SECONDS, &opened.scene)?;
    let world = common.world(&opened)?;
    let (_, ending) = execute(world, &Results::default(), common, &opened.title, steps, |_| Ok(()))?;
    Ok(ending)
}

/// Runs a world to a number of steps, calling `between` before the first and after each, until it diverges or Ctrl-C is
/// pressed; then writes the result wherever it was asked for.
pub fn execute(
    mut world: World,
    results: &Results,
    common: &Common,
    title: &str,
    steps: u64,
    mut between: impl FnMut(&mut World) -> Result<(), Refusal>,
) -> Result<(World, Ending), Refusal> {
    let pending = results.out.as_deref().map(Pending::new).transpose()?;
    let warnings = world.warnings();
    common.warn(&warnings);
    catch_interrupt();
    let bar = progress(common);
    let start = Instant::now();
    let mut shown = Instant::now();
    between(&mut world)?;
    while world.steps() < steps && !INTERRUPTED.load(Ordering::Relaxed) {
        world.step();
        if world.health().is_diverged() {
            break;
        }
        between(&mut world)?;
        if shown.elapsed().as_millis() > 100 {
            shown = Instant::now();
            bar.set_message(format!("{:.2} s simulated", world.time()));
            bar.tick();
        }
    }
    let wall_seconds = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    if world.steps() < steps && !world.health().is_diverged() {
        common.warn(&[format!("interrupted after {} of {steps} steps", world.steps())]);
    }
    let result = RunResult::of(&world, wall_seconds, common.threads(), results.positions, warnings);
    let text = if pending.is_some() || common.json { output::json(&result)? } else { String::new() };
    if let Some(file) = pending {
        file.finish(format!("{text}\n").as_bytes())?;
    }
    if common.json {
        output::print(&text);
    }
    common.say(&result.summary(title));
    let ending = if world.health().is_diverged() { Ending::Diverged } else { Ending::Done };
    Ok((world, ending))
}

pub fn progress(common: &Common) -> ProgressBar {
    let visible = std::io::stderr().is_terminal() && !common.quiet;
    let target = if visible { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let style = ProgressStyle::with_template("{spinner} {elapsed} {msg}");
    ProgressBar::with_draw_target(None, target)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()))
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
    positions: Option<Vec<[f64; 3]>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    velocities: Option<Vec<[f64; 3]>>,
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
            Health::Unsettled { step, time, particle } => {
                format!(
                    "unsettled: particle {particle} shakes since step {step} ({time:.4} s); dt is too long for this stiffness"
                )
            }
            Health::Diverged { step, time, particle } => format!(
                "diverged in step {step} ({time:.4} s) at particle {particle}; what is shown is the last good state"
            ),
        };
        format!(
            "{title}: {} particles ({} pinned), springs {stretch} stretch, {shear} shear, {bend} bend{torn}\n\
             {} in {:?} precision, dt {} s: {} steps, {:.4} s simulated in {:.3} s ({speed:.1} x real time)\n\
             energy: kinetic {:.6} J, gravitational {:.6} J, elastic {:.6} J\n\
             strain: largest {:.4}, mean {:.4}\n\
             cost: {} force evaluations, {} spring visits\n\
             health: {health}",
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
        )
    }
}
