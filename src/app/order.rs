//! What the interface asks of the engine, and what it sees of it.

use std::{
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant},
};

use glam::DVec3;

use super::{autosave::SavedLane, camera::Bounds, geometry::Geometry};
use crate::{
    scene::{Opened, Place, Scene},
    target::ImportReport,
    world::{Command, Health, Measures, Script, Snapshot},
};

/// What the interface can ask for.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Replaces everything by these lanes.
    Open(Vec<LaneSetup>),
    /// Adds a lane that goes on from the present state of another, with settings of its own.
    AddLane {
        /// The lane that it starts from.
        from: usize,
        /// Its number; later ones move up.
        at: usize,
        /// What to call it.
        title: String,
        /// Keys and values in which it differs.
        settings: Vec<(String, String)>,
        /// A lane that was removed under this number comes back, and all lanes go to the state that they were in. Where that
        /// is no longer remembered, the lane starts as a new one does.
        back: Option<u64>,
    },
    /// Removes a lane; the last one stays.
    RemoveLane {
        /// Which.
        lane: usize,
        /// The number under which it may come back.
        number: u64,
    },
    /// Applies a command to one lane, or to all.
    Apply(Option<usize>, Command),
    /// Moves what is held to these points over the time of one frame, m.
    Drag(Vec<(u32, DVec3)>),
    /// Runs or pauses.
    Run(bool),
    /// Takes this many beats now; while running it pauses first.
    Step(u32),
    /// Simulated seconds for each second; 1 is real time.
    Speed(f64),
    /// Goes back by this simulated time, s, as far as is remembered, and forgets what came after. What was set since stays set.
    GoBack(f64),
    /// Shows the moment of this place on the timeline, s, and pauses. What came after is forgotten only once time passes again,
    /// or something is done.
    Scrub(f64),
    /// Memory that the timeline may take, bytes.
    Remember(usize),
    /// Plays all lanes again from their starts: what was done is done again at its time.
    Again,
    /// The first lane's scene has another name and file.
    Rename(String, PathBuf),
    /// Remembers the present state of all lanes under a number.
    Keep(u64),
    /// Goes to a state that was kept, and keeps the present one in its place. Where commands would do, because nothing has torn
    /// since and the target is the same, they do: time then does not jump.
    Exchange {
        /// Its number.
        number: u64,
        /// Commands to one lane, or to all, that lead there too, but for what has torn.
        otherwise: Vec<(Option<usize>, Command)>,
    },
    /// What the surface is to be coloured by.
    Values(Values),
    /// The lane that the others are compared with.
    Reference(usize),
    /// Writes a recording of the first lane, from its start until now.
    Record(PathBuf),
    /// Hands out the present state of a lane, to be studied.
    Study(usize),
}

/// What the surface can be coloured by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Values {
    /// Nothing.
    #[default]
    None,
    /// Mean strain of the springs around each particle.
    Strain,
    /// Distance from the reference lane, m.
    Distance,
}

/// Where a lane starts.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Origin {
    /// At the start of its scene.
    #[default]
    Start,
    /// There too, and what was done to another lane is done to it at the same times.
    Script(Arc<Script>),
    /// Where an earlier session was.
    Saved(Box<SavedLane>),
}

/// A lane to be opened.
#[derive(Clone, Debug, PartialEq)]
pub struct LaneSetup {
    /// What to call it.
    pub title: String,
    /// What it simulates.
    pub scene: Scene,
    /// Where its meshes are.
    pub place: Place,
    /// The scene's file, which saving writes.
    pub file: Option<PathBuf>,
    /// Where it starts.
    pub origin: Origin,
}

impl From<Opened> for LaneSetup {
    fn from(Opened { scene, place, title, file }: Opened) -> Self {
        Self { title, scene, place, file, origin: Origin::Start }
    }
}

/// Largest stable dt in theory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Limit {
    /// It has not been found yet.
    #[default]
    Unknown,
    /// The method has none.
    None,
    /// s; 0 where no dt is stable.
    At(f64),
}

impl Limit {
    /// A dt that is finite and above 0, if there is one, s.
    pub fn dt(self) -> Option<f64> {
        match self {
            Self::At(dt) if dt > 0.0 && dt.is_finite() => Some(dt),
            _ => None,
        }
    }
}

/// Where the particles of a lane were.
#[derive(Clone, Debug)]
pub struct Moment {
    /// Differs for any two moments of any lanes.
    pub version: u64,
    /// m.
    pub positions: Arc<Vec<[f32; 3]>>,
    /// The box around them.
    pub bounds: Option<Bounds>,
}

/// What a lane looks like now.
#[derive(Clone, Debug)]
pub struct LaneState {
    /// What to call it.
    pub title: String,
    /// The scene as it is now, edits included.
    pub scene: Scene,
    /// What is drawn of it.
    pub geometry: Arc<Geometry>,
    /// Differs whenever `positions` do.
    pub version: u64,
    /// Positions after the last step, m.
    pub positions: Arc<Vec<[f32; 3]>>,
    /// The box around them.
    pub bounds: Option<Bounds>,
    /// Where they were one beat before, where a beat takes longer than a picture.
    pub previous: Option<Moment>,
    /// Pinned and grabbed bits by particle.
    pub flags: Arc<Vec<u32>>,
    /// Values by particle, if wanted.
    pub values: Option<Arc<Vec<f32>>>,
    /// Simulated time, s.
    pub time: f64,
    /// Steps taken.
    pub steps: u64,
    /// Whether it can be trusted.
    pub health: Health,
    /// Energies and strain.
    pub measures: Measures,
    /// Largest stable dt in theory for the shape now.
    pub limit: Limit,
    /// Seconds of computing for each simulated second.
    pub cost: f64,
    /// Root mean square and largest distance from the reference lane, m.
    pub distance: Option<[f64; 2]>,
    /// Torn springs.
    pub broken: usize,
    /// Pinned particles.
    pub pinned: usize,
    /// Mass of all particles, kg.
    pub mass: f64,
    /// What the import found.
    pub report: Arc<ImportReport>,
    /// What the user should know.
    pub warnings: Arc<Vec<String>>,
}

/// What the interface sees of the engine.
#[derive(Clone, Debug)]
pub struct State {
    /// Number of orders taken so far.
    pub orders: u64,
    /// Differs for any two states.
    pub version: u64,
    /// Whether time passes.
    pub running: bool,
    /// Simulated seconds for each second that are asked for.
    pub speed: f64,
    /// Simulated seconds for each second that are reached; `None` while paused.
    pub pace: Option<f64>,
    /// Wall-clock time of a beat at the speed asked for.
    pub beat: Duration,
    /// When the last beat was due.
    pub at: Instant,
    /// The lane that the others are compared with.
    pub reference: usize,
    /// The lanes.
    pub lanes: Vec<Arc<LaneState>>,
    /// The last order that was refused, with its number and why.
    pub refusal: Option<(u64, String)>,
    /// No particle has moved so far since the state before that it could be seen.
    pub is_still: bool,
    /// The state that was asked for last, to be studied, with the order's number.
    pub studied: Option<Studied>,
    /// What is remembered.
    pub timeline: Remembered,
    /// How far a recording has been played, and how long it is, s; none while none is.
    pub replay: Option<[f64; 2]>,
    /// The last thing that happened by itself, with its number.
    pub news: Option<(u64, String)>,
}

/// What is remembered: places on the timeline are simulated time that has passed in this session, s. A reset does not turn it back.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Remembered {
    /// The oldest moment.
    pub from: f64,
    /// The moment that is shown; the last one unless the past is.
    pub at: f64,
    /// The last moment.
    pub to: f64,
    /// Memory in use, and allowed, bytes.
    pub bytes: [usize; 2],
}

impl Remembered {
    /// Whether a moment of the past is shown.
    pub fn is_past(&self) -> bool {
        self.at < self.to
    }
}

/// A state that was handed out, with the number of the order that asked for it.
#[derive(Clone)]
pub struct Studied {
    /// The order's number.
    pub order: u64,
    /// The state.
    pub snapshot: Arc<Snapshot>,
}

impl std::fmt::Debug for Studied {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Studied({} at {} s)", self.order, self.snapshot.time())
    }
}
