//! The workbench: a window in which cloth is seen, taken hold of, and changed while it runs.

pub mod autosave;
pub mod camera;
mod changes;
pub mod display;
pub mod engine;
pub mod exporting;
pub mod files;
pub mod film;
pub mod gallery;
pub mod geometry;
pub mod gpu;
mod graphics;
pub mod hands;
pub mod heap;
mod history;
mod lane;
pub mod order;
pub mod panels;
pub mod picking;
pub mod picture;
pub mod preferences;
pub mod render;
pub mod restoring;
pub mod session;
pub mod shell;
pub mod simulation;
pub mod study;
mod swapchain;
pub mod theme;
pub mod trace;
pub mod viewport;
pub mod workbench;

use std::{
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use crate::{
    scene::{Opened, Place},
    world::Recording,
};
use autosave::Autosave;
use engine::{Engine, LaneSetup};
use preferences::Preferences;
use session::{Link, Session};
use simulation::Simulation;
use workbench::Workbench;

/// Why the workbench did not open.
#[derive(Debug, thiserror::Error)]
pub enum AppError {
    /// The window.
    #[error(transparent)]
    Shell(#[from] shell::ShellError),
    /// The scenes.
    #[error(transparent)]
    Scene(#[from] crate::scene::Refusal),
    /// The system gives no thread.
    #[error("the simulation's thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
}

impl AppError {
    /// Whether this machine gives no window at all: what needs none can still be done.
    pub fn is_no_window(&self) -> bool {
        use gpu::GpuError;
        use shell::ShellError;
        match self {
            Self::Shell(ShellError::Gpu(error)) => !matches!(error, GpuError::Failed(_)),
            Self::Shell(_) => true,
            Self::Scene(_) | Self::Thread(_) => false,
        }
    }
}

/// What is left once the window is closed.
#[derive(Debug)]
pub struct Closed {
    /// Why it closed by itself, in one line, where that was not asked for.
    pub failure: Option<String>,
    simulation: Option<JoinHandle<Engine>>,
    stop: Arc<AtomicBool>,
}

impl Closed {
    /// What was done to the first lane, and where its scene's meshes are. Waits for the step that is under way, but not long.
    pub fn recording(self) -> Option<(Recording, Place)> {
        let (simulation, start) = (self.simulation?, Instant::now());
        while !simulation.is_finished() {
            if start.elapsed() > Duration::from_secs(1) {
                self.stop.store(true, Ordering::Relaxed);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        simulation.join().ok()?.recording(0)
    }
}

/// Closes the window from elsewhere, without a question: whoever presses Ctrl-C in the terminal is not at the window.
#[derive(Clone, Debug, Default)]
pub struct Closer(Arc<Closing>);

#[derive(Debug, Default)]
struct Closing {
    is_asked: AtomicBool,
    window: OnceLock<egui::Context>,
    refused: OnceLock<String>,
}

impl Closer {
    /// Closes the window, or keeps it from staying open.
    pub fn close(&self) {
        self.0.is_asked.store(true, Ordering::Relaxed);
        if let Some(window) = self.0.window.get() {
            window.request_repaint();
        }
    }

    /// Whether it was asked for.
    pub fn is_asked(&self) -> bool {
        self.0.is_asked.load(Ordering::Relaxed)
    }

    /// The window closes because what it was opened for was refused.
    fn refuse(&self, why: &str) {
        // It closes for one reason.
        let _ = self.0.refused.set(why.to_owned());
    }
}

/// What can be read within this time is refused before there is a window.
const SOON: Duration = Duration::from_millis(250);

/// Opens scenes as lanes in a window, each stepping on so many threads if that is said, and returns when it is closed. The
/// window does not wait for them. The simulation outlives a window that fails.
///
/// # Errors
/// [`AppError`] if no window can be opened or a scene is refused.
pub fn run(scenes: Vec<Opened>, threads: Option<usize>, closer: &Closer) -> Result<Closed, AppError> {
    heap::share();
    let setups: Vec<LaneSetup> = scenes.into_iter().map(LaneSetup::from).collect();
    let setups = if setups.is_empty() { vec![crate::scene::open("sheet")?.into()] } else { setups };
    let title = setups.first().map_or_else(String::new, |setup| format!("{} - Tenter", setup.title));
    let mut engine = Engine::empty(threads);
    let (state, stop) = (engine.state(), engine.stop());
    // The thread is there before the window: until that opens, nobody needs to be woken.
    let window = Arc::new(OnceLock::<egui::Context>::new());
    let wake = Arc::clone(&window);
    let autosave = autosave::folder().and_then(|folder| Autosave::start(&folder));
    let written = autosave.as_ref().map(Autosave::written);
    let ending = written.clone();
    let mut simulation = Simulation::start(engine, autosave, move || {
        if let Some(context) = wake.get() {
            context.request_repaint();
        }
    })?;
    let mut closed = Closed { failure: None, simulation: simulation.thread(), stop };
    let end = || {
        if let Some(written) = ending {
            written.end();
        }
    };
    let mut session = Session::opening_first(Link::Thread(simulation), state, setups);
    // Without a display there is nothing else to wait for.
    let patience = if display::probe().is_ok() { SOON } else { Duration::MAX };
    let asked = Instant::now();
    while session.opening().is_some() && asked.elapsed() < patience && !closer.is_asked() {
        std::thread::sleep(Duration::from_millis(1));
        session.refresh();
    }
    if let Some(why) = session.take_refused() {
        end();
        return Err(crate::scene::Refusal::new(why).into());
    }
    let file = Preferences::file();
    let preferences = file.as_deref().map(Preferences::load).unwrap_or_default();
    let opening =
        shell::Opening { title, size: preferences.size, maximized: preferences.maximized, samples: None };
    let opened = Arc::clone(&window);
    let ended = shell::run(opening, |stage| {
        // Before the first frame nobody else sets them.
        let _ = window.set(stage.egui.clone());
        let _ = closer.0.window.set(stage.egui.clone());
        let mut workbench = Workbench::with(session, preferences, file);
        workbench.attach(stage);
        workbench.closer = closer.clone();
        workbench.restore.look(autosave::folder(), written, stage.egui);
        workbench
    });
    closed.failure = closer.0.refused.get().cloned();
    match ended {
        Ok(()) => end(),
        Err(error) if opened.get().is_none() => {
            end();
            return Err(error.into());
        }
        // The next window offers to go on.
        Err(error) => closed.failure = Some(error.to_string()),
    }
    Ok(closed)
}
