//! The command line: one file a command. Exit codes: 0 done, 1 input refused, 2 wrong usage, 3 diverged.

mod ablate;
mod advise;
mod export;
mod info;
mod lab;
mod listing;
mod output;
mod render;
mod replay;
mod report;
mod run;
mod stability;
mod study;
mod trade;
mod workbench;

use crate::scene::{Opened, Place, Refusal, Scene, Target, open, read_limited};
use crate::world::{Recording, World};
use clap::{Args, Parser, Subcommand};
use std::path::Path;
use std::process::ExitCode;

#[derive(Parser)]
#[command(
    name = "tenter",
    version,
    about = "A workbench for cloth simulation that measures error, cost and stability."
)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
struct CommandLine {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    workbench: workbench::Options,
}

#[derive(Subcommand)]
enum Command {
    /// Runs a scene headless and says what became of it.
    Run(run::Options),
    /// Says what a scene or mesh holds: particles, springs, pins, mass, faces, dt limits.
    Info(info::Options),
    /// Measures the trade of speed for accuracy of a scene, every method.
    Trade(trade::Options),
    /// Finds where each method stops being stable, against theory.
    Stability(stability::Options),
    /// Says what each ingredient of a scene costs, and what leaving it out changes.
    Ablate(ablate::Options),
    /// Finds the cheapest method and step that keep an error, or the most accurate within a budget.
    Advise(advise::Options),
    /// Writes all studies of a scene as one page, with the data beside it.
    Report(report::Options),
    /// Works on the results of studies.
    #[command(subcommand)]
    Lab(lab::Command),
    /// Lists the built-in scenes.
    Scenes(listing::Options),
    /// Lists the methods with their parameters, ranges and units.
    Simulators(listing::Options),
    /// Runs a recording again, to the same state bit for bit.
    Replay(replay::Options),
    /// Draws a picture of a scene without a window.
    Render(render::Options),
    /// Writes a scene's motion for other programs: meshes, point caches, pictures, a table.
    Export(export::Options),
}

/// Options that every command takes.
#[derive(Args, Clone, Debug)]
struct Common {
    /// Sets a value of the scene by its path, as in springs.stretch.stiffness=500.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    set: Vec<(String, String)>,
    /// Writes the result to standard output as JSON.
    #[arg(long)]
    json: bool,
    /// Says nothing but errors.
    #[arg(long)]
    quiet: bool,
    /// Threads to work on: one for a single run, all for the lab's trials where nothing is said. No result depends on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    threads: Option<u32>,
}

fn key_value(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("it has no '='; accepted: KEY=VALUE")?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

/// How a command that did its work ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    Done,
    Diverged,
}

impl Ending {
    /// How a command ends that ran this world.
    fn of(world: &World) -> Self {
        if world.health().is_diverged() { Self::Diverged } else { Self::Done }
    }
}

/// Runs the command that the process was started with.
pub fn main() -> ExitCode {
    // A panic is a defect of ours: whoever meets one gets a line to report, not a backtrace.
    std::panic::set_hook(Box::new(|info| {
        let place = info.location().map_or(String::new(), |l| format!(" at {}:{}", l.file(), l.line()));
        let what = info.payload_as_str().unwrap_or("unknown");
        output::complain(&format!("internal error{place}: {what}; please report it"));
    }));
    #[cfg(feature = "app")]
    crate::app::gpu::quiet_drivers();
    let line = match CommandLine::try_parse() {
        Ok(line) => line,
        Err(e) => e.exit(),
    };
    match std::panic::catch_unwind(|| dispatch(line)) {
        Ok(Ok(Ending::Done)) => ExitCode::SUCCESS,
        Ok(Ok(Ending::Diverged)) => ExitCode::from(3),
        Ok(Err(refusal)) => {
            output::complain(&refusal.to_string());
            ExitCode::from(1)
        }
        Err(_) => ExitCode::from(1),
    }
}

fn dispatch(line: CommandLine) -> Result<Ending, Refusal> {
    match line.command {
        Some(Command::Run(options)) => run::run(&options),
        Some(Command::Info(options)) => info::info(&options),
        Some(Command::Trade(options)) => trade::trade(&options),
        Some(Command::Stability(options)) => stability::stability(&options),
        Some(Command::Ablate(options)) => ablate::ablate(&options),
        Some(Command::Advise(options)) => advise::advise(&options),
        Some(Command::Report(options)) => report::report(&options),
        Some(Command::Lab(lab::Command::Merge(options))) => lab::merge(&options),
        Some(Command::Scenes(options)) => listing::scenes(&options),
        Some(Command::Simulators(options)) => listing::simulators(&options),
        Some(Command::Replay(options)) => replay::replay(&options),
        Some(Command::Render(options)) => render::render(&options),
        Some(Command::Export(options)) => export::export(&options),
        None => workbench::workbench(&line.workbench),
    }
}

impl Common {
    /// Threads that one run steps on.
    fn threads(&self) -> u32 {
        self.threads.unwrap_or(1)
    }

    /// Opens a scene with the settings of the command line.
    fn open(&self, name: &str) -> Result<Opened, Refusal> {
        let mut opened = open(name).map_err(|refusal| {
            // What is no file may not be there a second time.
            let file = Path::new(name);
            let is_recording = || read_limited(file).is_ok_and(|text| Recording::from_ron(&text).is_ok());
            if file.is_file() && is_recording() {
                return Refusal::new(format!(
                    "{name}: is a recording, which tenter replay takes; accepted: a scene"
                ));
            }
            refusal
        })?;
        self.change(&mut opened.scene, &mut opened.place)?;
        Ok(opened)
    }

    /// Makes the settings of the command line; a mesh that they name may be opened.
    fn change(&self, scene: &mut Scene, place: &mut Place) -> Result<(), Refusal> {
        for (key, value) in &self.set {
            scene.set_key(key, value).map_err(|e| e.at("--set"))?;
            if let Target::Mesh(mesh) = &scene.target
                && key.starts_with("target")
            {
                place.allow(&mesh.path);
            }
        }
        Ok(())
    }

    /// A world at the start of an opened scene.
    fn world(&self, opened: &Opened) -> Result<World, Refusal> {
        let mut world =
            World::new(opened.scene.clone(), opened.place.clone()).map_err(|e| e.at(&opened.title))?;
        self.prepare(&mut world)?;
        Ok(world)
    }

    /// Threads for a world, and Ctrl-C.
    fn prepare(&self, world: &mut World) -> Result<(), Refusal> {
        world.heed(Some(run::interrupt()));
        world.set_threads(self.threads() as usize)
    }

    /// Prints for people, unless told to be quiet or to speak JSON.
    fn say(&self, text: &str) {
        if !self.quiet && !self.json {
            output::print(text);
        }
    }

    fn warn(&self, warnings: &[String]) {
        if !self.quiet {
            for warning in warnings {
                output::complain_of("warning", warning);
            }
        }
    }
}
