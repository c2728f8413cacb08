//! `tenter export`: runs a scene headless and writes its motion for other programs.

use super::run::{catch_interrupt, interrupted, progress, seconds};
use super::{Common, Ending, output, render};
use crate::export::{self, Format, Sink, Span};
use crate::scene::{Opened, Refusal};
use crate::world::{Health, World};
use clap::Args;
use clap::builder::PossibleValuesParser;
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub struct Options {
    /// A .ron file, a mesh, a built-in scene, or - for standard input.
    scene: String,
    /// Simulated time to write, s.
    #[arg(long, value_name = "T", value_parser = seconds)]
    seconds: f64,
    /// Frames a simulated second.
    #[arg(long, value_name = "F", default_value_t = 25.0)]
    fps: f64,
    /// Where it goes; the extension tells the format. OBJ and PNG are folders of files, called as PATH without extension.
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
    /// The format, where the extension does not tell it.
    #[arg(long, value_parser = PossibleValuesParser::new(Format::ALL.map(|(name, _)| name)))]
    format: Option<String>,
    /// Width and height of pictures, pixels: 1280x800 unless given, 640x400 for GIF.
    #[arg(long, value_name = "WxH", value_parser = render::size)]
    size: Option<[u32; 2]>,
    #[command(flatten)]
    common: Common,
}

/// What was written, as JSON has it.
#[derive(Serialize)]
struct Written<'a> {
    out: &'a Path,
    format: &'a str,
    frames: u64,
    fps: f64,
    steps: u64,
    time: f64,
    health: Health,
}

pub fn export(options: &Options) -> Result<Ending, Refusal> {
    let Options { out, common, .. } = options;
    let named = options.format.as_deref().and_then(Format::named);
    let format = named.map_or_else(|| Format::of(out), Ok)?;
    let span = Span::new(options.seconds, options.fps)?;
    let opened = common.open(&options.scene)?;
    let mut world = common.world(&opened)?;
    catch_interrupt();
    let frames = if format.is_drawn() {
        pictures(format, options, &mut world, span)?
    } else {
        let mut sink = sink(format, options, &opened, &world, span)?;
        common.warn(&world.warnings());
        let frames = watched(common, &mut world, span, &mut *sink)?;
        sink.finish()?;
        frames
    };
    let (steps, time, health) = (world.steps(), world.time(), world.health());
    if common.json {
        let written = Written { out, format: format.name(), frames, fps: span.fps, steps, time, health };
        output::print(&output::json(&written)?);
    }
    tell(options, &world, span, frames, format);
    Ok(Ending::of(&world))
}

/// Runs a world with a progress bar and Ctrl-C.
fn watched(common: &Common, world: &mut World, span: Span, sink: &mut dyn Sink) -> Result<u64, Refusal> {
    let bar = progress(common, span.frames());
    let frames = export::run(world, span, sink, &mut |frames| {
        bar.set_position(frames);
        !interrupted()
    });
    bar.finish_and_clear();
    frames
}

fn tell(options: &Options, world: &World, span: Span, frames: u64, format: Format) {
    let Options { out, common, .. } = options;
    let mut warnings = Vec::new();
    if interrupted() && frames < span.frames() {
        warnings.push(format!("interrupted after {frames} of {} frames", span.frames()));
    }
    warnings.extend(export::closed_tears(format, world));
    common.warn(&warnings);
    let last = span.time(frames.saturating_sub(1));
    common.say(&format!("{}: {}, {frames} frames from 0 to {last} s", out.display(), format.name()));
    if let Health::Diverged { step, time, particle } = world.health() {
        common.say(&format!(
            "health: diverged in step {step} ({time:.4} s) at particle {particle}; the frames before that are written"
        ));
    }
}

/// The writer of a format that is not drawn.
fn sink(
    format: Format,
    options: &Options,
    opened: &Opened,
    world: &World,
    span: Span,
) -> Result<Box<dyn Sink>, Refusal> {
    let surface = opened.scene.target.surface(&opened.place)?;
    if surface.particles() > world.pinned().len() {
        return Err(Refusal::new(format!("{}: the mesh changed while it was read; try again", opened.title)));
    }
    export::sink(format, &options.out, surface, span)
}

#[cfg(not(feature = "app"))]
fn pictures(_: Format, options: &Options, _: &mut World, _: Span) -> Result<u64, Refusal> {
    let out = options.out.display();
    Err(Refusal::new(format!(
        "{out}: is not drawn: this build has no renderer; build it with the feature app"
    )))
}

/// Draws a motion; the number of pictures.
#[cfg(feature = "app")]
fn pictures(format: Format, options: &Options, world: &mut World, span: Span) -> Result<u64, Refusal> {
    use crate::app::{exporting::size_of, film::Film};
    let Options { out, common, .. } = options;
    let size = options.size.unwrap_or_else(|| size_of(format));
    let mut is_framed = false;
    let run = &mut |world: &mut World, sink: &mut dyn Sink| {
        if !is_framed {
            common.warn(&world.warnings());
        }
        let frames = watched(common, world, span, sink)?;
        if interrupted() && !std::mem::replace(&mut is_framed, true) {
            return Err(Refusal::new(format!(
                "{}: interrupted before the first picture; nothing is written",
                out.display()
            )));
        }
        is_framed = true;
        Ok(frames)
    };
    let bar = progress(common, span.frames());
    let frames = Film::make(world, format, out, size, span, run, &mut |drawn| {
        bar.set_position(drawn);
        Ok(drawn == 0 || !interrupted())
    });
    bar.finish_and_clear();
    frames
}
