//! Motion for other programs: runs a world and hands its frames to a writer, one file a format.
//!
//! Frame n shows the time n / fps. Where that is not the time of a step, positions are blended linearly between the steps
//! around it, which is off by at most dt² / 8 times the largest acceleration between them.

mod csv;
mod folder;
mod gltf;
mod obj;
mod pc2;

pub use folder::PendingFolder;

use crate::scene::Refusal;
use crate::target::Surface;
use crate::world::World;
use glam::DVec3;
use std::path::Path;

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A folder of Wavefront OBJ files, one a frame.
    Obj,
    /// glTF 2.0 as JSON, its data inside; the motion as morph targets.
    Gltf,
    /// The same as a binary file.
    Glb,
    /// PC2 point cache.
    Pc2,
    /// Energies and strain.
    Csv,
    /// A folder of PNG pictures, one a frame.
    Png,
    /// One animated GIF.
    Gif,
}

impl Format {
    /// All formats with their names, which are the extensions of their files.
    pub const ALL: [(&'static str, Self); 7] = [
        ("obj", Self::Obj),
        ("gltf", Self::Gltf),
        ("glb", Self::Glb),
        ("pc2", Self::Pc2),
        ("csv", Self::Csv),
        ("png", Self::Png),
        ("gif", Self::Gif),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, format)| *format == self).map_or("", |(name, _)| name)
    }

    /// The format of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, format)| *format)
    }

    /// The format that a path's extension tells.
    ///
    /// # Errors
    /// An extension that is not known, or none.
    pub fn of(path: &Path) -> Result<Self, Refusal> {
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        Self::named(&extension).ok_or_else(|| {
            let names: Vec<_> = Self::ALL.iter().map(|(name, _)| format!(".{name}")).collect();
            Refusal::new(format!(
                "{}: the extension '{extension}' is not known; accepted: {}, or --format",
                path.display(),
                names.join(", ")
            ))
        })
    }

    /// Whether it is drawn, which takes the renderer.
    pub fn is_drawn(self) -> bool {
        matches!(self, Self::Png | Self::Gif)
    }
}

/// The frames of an export: 0 to `last`, `fps` of them a simulated second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Frames a second, > 0.
    pub fps: f64,
    /// Number of the last frame.
    pub last: u64,
}

/// Most frames of an export.
const MOST_FRAMES: f64 = 1e6;

impl Span {
    /// The frames within the first `seconds` of simulated time.
    ///
    /// # Errors
    /// Numbers that are no time and no rate, or come to over a million frames.
    pub fn new(seconds: f64, fps: f64) -> Result<Self, Refusal> {
        if !(fps > 0.0 && fps.is_finite()) {
            return Err(Refusal::new(format!("{fps} frames a second; accepted: a number above 0")));
        }
        // The last frame is there although seconds * fps may be rounded down.
        let last = (seconds * fps * (1.0 + 1e-12)).floor();
        if (0.0..MOST_FRAMES).contains(&last) {
            Ok(Self { fps, last: last as u64 })
        } else {
            Err(Refusal::new(format!(
                "{seconds} s at {fps} frames a second; accepted: up to {MOST_FRAMES} frames"
            )))
        }
    }

    /// Number of frames.
    pub fn frames(&self) -> u64 {
        self.last + 1
    }

    /// Time of a frame, s.
    pub fn time(&self, frame: u64) -> f64 {
        frame as f64 / self.fps
    }
}

/// One frame.
pub struct Frame<'a> {
    /// Its number, from 0.
    pub number: u64,
    /// The time that it shows, s.
    pub time: f64,
    /// The particles at that time, m.
    pub positions: &'a [DVec3],
    /// The world in the first step at or after that time.
    pub world: &'a World,
}

/// A writer of frames. Dropped before it has finished, it leaves nothing.
pub trait Sink {
    /// Takes the next frame.
    ///
    /// # Errors
    /// It cannot be written: a full disk, numbers that the format cannot hold.
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), Refusal>;

    /// Puts the frames that were taken, at least one, into their place.
    ///
    /// # Errors
    /// They cannot be written.
    fn finish(self: Box<Self>) -> Result<(), Refusal>;
}

/// A writer of a format that is not drawn. Its place is tried at once, before long work.
///
/// # Errors
/// A place that cannot be written, more frames than the format can hold, a format that is drawn.
pub fn sink(format: Format, path: &Path, surface: Surface, span: Span) -> Result<Box<dyn Sink>, Refusal> {
    Ok(match format {
        Format::Obj => Box::new(obj::ObjSequence::new(path, surface, span)?),
        Format::Gltf => Box::new(gltf::Gltf::new(path, surface, span, false)?),
        Format::Glb => Box::new(gltf::Gltf::new(path, surface, span, true)?),
        Format::Pc2 => Box::new(pc2::PointCache::new(path, surface)?),
        Format::Csv => Box::new(csv::Csv::new(path)?),
        Format::Png | Format::Gif => {
            return Err(Refusal::new(format!("{}: takes the renderer to draw", path.display())));
        }
    })
}

/// Runs a world from its start and hands over its frames, until all are taken, it diverges, or `go_on` says no; that is
/// asked before every step, with the number of frames taken. Answers with that number.
///
/// # Errors
/// What the writer refuses; a scene whose time stands still.
pub fn run(
    world: &mut World,
    span: Span,
    sink: &mut dyn Sink,
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<u64, Refusal> {
    let dt = world.scene().dt;
    if dt == 0.0 && span.last > 0 {
        return Err(Refusal::new("dt is 0 s, so no time passes; accepted: a longer one"));
    }
    // Times of steps and frames are rounded; what is nearer than this is the same time.
    let slack = 1e-9 * dt;
    let mut before = (world.time(), Vec::new());
    for number in 0..=span.last {
        let time = span.time(number);
        while world.time() < time - slack {
            if !go_on(number) {
                return Ok(number);
            }
            if world.time() + dt > time - slack {
                before = (world.time(), world.positions());
            }
            world.step();
            if world.health().is_diverged() {
                return Ok(number);
            }
        }
        let mut positions = world.positions();
        let now = world.time();
        if now > time + slack {
            let part = (time - before.0) / (now - before.0);
            positions.iter_mut().zip(&before.1).for_each(|(x, from)| *x = from.lerp(*x, part));
        }
        sink.frame(&Frame { number, time, positions: &positions, world })?;
    }
    Ok(span.frames())
}

/// What a format cannot show of a world.
pub fn closed_tears(format: Format, world: &World) -> Option<String> {
    let torn = world.broken().len();
    let is_mesh = !format.is_drawn() && format != Format::Csv;
    (torn > 0 && is_mesh).then(|| format!("{torn} springs are torn; the exported faces stay closed"))
}

/// A position in single precision, as point caches and glTF have it.
fn single(p: DVec3) -> [u8; 12] {
    bytemuck::cast(p.as_vec3().to_array().map(f32::to_le_bytes))
}

/// Whether single precision can hold these positions.
fn check_single(positions: &[DVec3]) -> Result<(), String> {
    match positions.iter().position(|p| !p.as_vec3().is_finite()) {
        None => Ok(()),
        Some(bad) => Err(format!("vertex {bad} is beyond single precision; accepted: an OBJ sequence")),
    }
}
