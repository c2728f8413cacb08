//! Exports from the workbench: the scene runs again from its start on a thread of its own, which tells how far it is and can
//! be stopped.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::JoinHandle,
};

use super::film::Film;
use crate::{
    export::{self, Format, Sink, Span},
    scene::{Place, Refusal, Scene},
    world::{Health, World},
};

/// Pixels of pictures.
const SIZE: [u32; 2] = [1280, 800];
/// Pixels of an animated picture, which grows fast.
const GIF_SIZE: [u32; 2] = [640, 400];

/// What is to be exported.
#[derive(Clone, Debug, PartialEq)]
pub struct Wish {
    /// The scene.
    pub scene: Scene,
    /// Where its meshes are.
    pub place: Place,
    /// Where it goes; the extension tells the format.
    pub path: PathBuf,
    /// Simulated time, s.
    pub seconds: f64,
    /// Frames a second.
    pub fps: f64,
    /// Width and height of pictures, pixels; none for what [`size_of`] says.
    pub size: Option<[u32; 2]>,
}

/// Width and height of the pictures of a format unless something else is asked for, pixels.
pub fn size_of(format: Format) -> [u32; 2] {
    if format == Format::Gif { GIF_SIZE } else { SIZE }
}

/// An export that is under way. Dropped, it stops and leaves nothing.
pub struct Exporting {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<Result<String, Refusal>>>,
    total: u64,
}

#[derive(Default)]
struct Shared {
    frames: AtomicU64,
    stop: Arc<AtomicBool>,
}

impl Exporting {
    /// Starts; `wake` is called when it has ended.
    ///
    /// # Errors
    /// An extension, a time or a rate that are refused; a system that gives no thread.
    pub fn start(wish: Wish, wake: impl FnOnce() + Send + 'static) -> Result<Self, Refusal> {
        let format = Format::of(&wish.path)?;
        let span = Span::new(wish.seconds, wish.fps)?;
        let shared = Arc::new(Shared::default());
        let theirs = Arc::clone(&shared);
        let work = move || {
            let ended = theirs.export(&wish, format, span);
            wake();
            ended
        };
        let thread = std::thread::Builder::new().name("export".to_owned()).spawn(work);
        let thread =
            thread.map_err(|e| Refusal::new(format!("the export's thread cannot be started: {e}")))?;
        // Pictures take a run to find where to look from, and are drawn then.
        let total = if format.is_drawn() { 2 * span.frames() } else { span.frames() };
        Ok(Self { shared, thread: Some(thread), total })
    }

    /// How much is done, 0 to 1.
    pub fn progress(&self) -> f32 {
        self.shared.frames.load(Ordering::Relaxed) as f32 / self.total as f32
    }

    /// Asks it to stop; what was written is then taken away.
    pub fn stop(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
    }

    /// What became of it, once it has ended.
    pub fn ended(&mut self) -> Option<String> {
        let thread = self.thread.take_if(|thread| thread.is_finished())?;
        Some(match thread.join() {
            Ok(Ok(told)) => told,
            Ok(Err(refusal)) => refusal.to_string(),
            Err(_) => "internal error in the export; please report it".to_owned(),
        })
    }
}

impl Drop for Exporting {
    fn drop(&mut self) {
        self.stop();
        if let Some(thread) = self.thread.take() {
            // It leaves nothing beside its place only if it ends before the process does.
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn export(&self, wish: &Wish, format: Format, span: Span) -> Result<String, Refusal> {
        let Wish { scene, place, path, .. } = wish;
        let mut world = World::new(scene.clone(), place.clone())?;
        world.heed(Some(Arc::clone(&self.stop)));
        if format.is_drawn() {
            let size = wish.size.unwrap_or_else(|| size_of(format));
            let run = &mut |world: &mut World, sink: &mut dyn Sink| self.run(world, span, sink);
            let go_on = &mut |_| {
                self.frames.fetch_add(1, Ordering::Relaxed);
                self.check().map(|()| true)
            };
            Film::make(&mut world, format, path, size, span, run, go_on)?;
        } else {
            let mut sink = export::sink(format, path, scene.target.surface(place)?, span)?;
            self.run(&mut world, span, &mut *sink)?;
            sink.finish()?;
        }
        Ok(told(path, format, &world))
    }

    fn run(&self, world: &mut World, span: Span, sink: &mut dyn Sink) -> Result<u64, Refusal> {
        let before = self.frames.load(Ordering::Relaxed);
        let frames = export::run(world, span, sink, &mut |frames| {
            self.frames.store(before + frames, Ordering::Relaxed);
            self.check().is_ok()
        })?;
        self.frames.store(before + frames, Ordering::Relaxed);
        self.check().map(|()| frames)
    }

    /// Whether it is to go on.
    fn check(&self) -> Result<(), Refusal> {
        let is_stopped = self.stop.load(Ordering::Relaxed);
        if is_stopped { Err(Refusal::new("export stopped; nothing is written")) } else { Ok(()) }
    }
}

/// What was done, and what to know of it.
fn told(path: &Path, format: Format, world: &World) -> String {
    let path = path.display();
    let mut told = match world.health() {
        Health::Diverged { step, time, .. } => {
            format!("exported until it diverged in step {step} ({time:.4} s): {path}")
        }
        _ => format!("exported: {path}"),
    };
    for warning in world.warnings().into_iter().chain(export::closed_tears(format, world)) {
        told += &format!("; {warning}");
    }
    told
}
