//! `tenter [SCENE…]`: the workbench, or the first scene headless where no window can be opened.

use super::run::{Record, Results, execute, steps_in};
use super::{Common, Ending, output};
use crate::scene::{Opened, Place, Refusal, builtin};
use crate::world::{Recording, World};
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub struct Options {
    /// Scenes to open: .ron files, meshes, or names of built-in scenes.
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// Writes a recording of the first scene when the window is closed; `tenter replay` runs it again.
    #[arg(long, value_name = "FILE.ron")]
    record: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

/// What became of the window.
enum Window {
    /// It was closed; with what was done to the first scene, if that was asked for.
    #[cfg_attr(not(feature = "app"), expect(dead_code))]
    Closed(Option<Box<(Recording, Place)>>),
    /// It failed, and why; with what was done to the first scene until then, where that can be replayed.
    #[cfg_attr(not(feature = "app"), expect(dead_code))]
    Failed(String, Option<Box<(Recording, Place)>>),
    /// It could not be opened, and why.
    None(String),
}

pub fn workbench(options: &Options) -> Result<Ending, Refusal> {
    let common = &options.common;
    let default = [builtin::ALL[0].name.to_owned()];
    let names = if options.scenes.is_empty() { &default[..] } else { &options.scenes };
    let opened = names.iter().map(|name| common.open(name)).collect::<Result<Vec<_>, _>>();
    // What begins with a word that is no scene may have been meant as a command.
    let opened = opened.map_err(|e| match &names[0] {
        word if word.chars().all(char::is_alphabetic) => {
            Refusal::new(format!("{e}; for the commands see tenter --help"))
        }
        _ => e,
    })?;
    let record = options.record.as_deref().map(Record::new).transpose()?;
    match window(&opened, common, record.is_some())? {
        Window::Closed(done) => {
            if let (Some(record), Some(done)) = (record, done) {
                let (recording, place) = *done;
                record.finish(recording, &place)?;
            }
            Ok(Ending::Done)
        }
        Window::Failed(why, done) => {
            let Some(done) = done else { return Err(Refusal::new(why)) };
            let (recording, place) = *done;
            let path = options.record.clone().unwrap_or_else(|| beside(&opened[0].title, "ron"));
            record.map_or_else(|| Record::new(&path), Ok)?.finish(recording, &place)?;
            let path = path.display();
            Err(Refusal::new(format!("{why}; what was done until then is in {path}, for tenter replay")))
        }
        Window::None(why) => headless(&opened[0], &why, record, common),
    }
}

#[cfg(feature = "app")]
fn window(scenes: &[Opened], common: &Common, record: bool) -> Result<Window, Refusal> {
    let closer = crate::app::Closer::default();
    let close = closer.clone();
    super::run::on_interrupt(move || close.close());
    match crate::app::run(scenes.to_vec(), common.threads.map(|threads| threads as usize), &closer) {
        // The recording waits for the step under way, if it does not take long: nobody else has to.
        Ok(closed) => Ok(match closed.failure.clone() {
            Some(why) => Window::Failed(why, closed.recording().map(Box::new)),
            None => Window::Closed(if record { closed.recording().map(Box::new) } else { None }),
        }),
        Err(e) if e.is_no_window() => Ok(Window::None(e.to_string())),
        Err(e) => Err(Refusal::new(e.to_string())),
    }
}

// As with a window, where opening one may fail.
#[allow(clippy::unnecessary_wraps)]
#[cfg(not(feature = "app"))]
fn window(_: &[Opened], _: &Common, _: bool) -> Result<Window, Refusal> {
    Ok(Window::None("this build has no window; build it with the feature app for one".to_owned()))
}

/// Ten seconds of a scene, with the result and a picture; and why there is no window.
fn headless(opened: &Opened, why: &str, record: Option<Record>, common: &Common) -> Result<Ending, Refusal> {
    /// Simulated time, s.
    const SECONDS: f64 = 10.0;
    let steps = steps_in(SECONDS, &opened.scene)?;
    let world = common.world(opened)?;
    output::complain_of("note", why);
    let (world, ending) = execute(world, &Results::default(), common, &opened.title, steps)?;
    if let Some(record) = record {
        record.finish(Recording::of(opened.scene.clone(), &world), &opened.place)?;
    }
    picture(&world, &opened.title, common);
    Ok(ending)
}

/// The result is there already: a picture that cannot be drawn or written is no failure.
#[cfg(feature = "app")]
fn picture(world: &World, title: &str, common: &Common) {
    use super::render::Painter;
    let path = beside(title, "png");
    match Painter::new(&path, super::render::SIZE).and_then(|painter| painter.draw(world, title)) {
        Ok(drawn) => common.say(&drawn.summary()),
        Err(e) => common.warn(&[format!("no picture: {e}")]),
    }
}

#[cfg(not(feature = "app"))]
fn picture(_: &World, _: &str, _: &Common) {}

/// A name in the current folder for what belongs to a scene.
fn beside(title: &str, extension: &str) -> PathBuf {
    let stem = std::path::Path::new(title).file_stem().unwrap_or_default().to_string_lossy();
    let plain = |c: char| if c.is_alphanumeric() || c == '_' { c } else { '-' };
    PathBuf::from(format!("tenter-{}.{extension}", stem.chars().map(plain).collect::<String>()))
}
