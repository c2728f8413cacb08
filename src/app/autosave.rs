//! What is written down while somebody works: should the process end without warning, the next one goes on from there.
//!
//! Every second the simulation's thread hands a copy of its state over, and goes on; a thread of its own packs it and writes it beside
//! its place before it is renamed. It holds scenes, commands and the state itself, so that nothing has to be computed again.

mod slot;

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use serde::{Deserialize, Serialize};

pub use slot::Slot;

use super::{
    order::{LaneSetup, Origin},
    preferences::Preferences,
};
use crate::{
    params,
    scene::{Pending, Place, Refusal, Scene, to_ron},
    world::{Packed, Snapshot, Stored, World},
};

/// Time between two copies: with the time that writing takes, less than two seconds are lost.
const EVERY: Duration = Duration::from_secs(1);
/// The form that is written and read.
const FORMAT: u32 = 1;

/// The state of all lanes, to be written.
pub struct Draft {
    /// The first lane's file.
    pub file: Option<PathBuf>,
    /// The lanes.
    pub lanes: Vec<DraftLane>,
}

/// The state of a lane.
pub struct DraftLane {
    /// What it is called.
    pub title: String,
    /// The scene that its commands begin with.
    pub start: Scene,
    /// Where its meshes are.
    pub place: Place,
    /// Its state.
    pub snapshot: Snapshot,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Saved {
    format: u32,
    /// Time of writing since 1970, s.
    at: u64,
    file: Option<PathBuf>,
    lanes: Vec<SavedLane>,
}

/// A lane that was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedLane {
    title: String,
    start: Scene,
    place: Place,
    state: Stored,
}

impl Draft {
    /// Writes it.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Refusal> {
        let lanes = self.lanes.iter().map(|lane| SavedLane {
            title: lane.title.clone(),
            start: lane.start.clone(),
            place: lane.place.clone(),
            state: Packed::new(&lane.snapshot).into(),
        });
        let saved = Saved { format: FORMAT, at: now(), file: self.file.clone(), lanes: lanes.collect() };
        Pending::new(path)?.finish(to_ron(&saved)?.as_bytes())
    }
}

impl Saved {
    /// Reads what was written.
    ///
    /// # Errors
    /// It is not there, not readable, or was written by another version.
    pub fn read(path: &Path) -> Result<Self, Refusal> {
        let refused = |e: &dyn std::fmt::Display| Refusal::new(format!("{}: {e}", path.display()));
        let text = std::fs::read_to_string(path).map_err(|e| refused(&e))?;
        let saved: Self = params::ron_options().from_str(&text).map_err(|e| refused(&e))?;
        if saved.format == FORMAT && !saved.lanes.is_empty() {
            Ok(saved)
        } else {
            Err(refused(&"it was written by another version"))
        }
    }

    /// What was open.
    pub fn title(&self) -> &str {
        self.lanes.first().map_or("", |lane| &lane.title)
    }

    /// When it was written: the time of day, and how long ago.
    pub fn when(&self) -> String {
        let (day, ago) = (self.at % 86_400, now().saturating_sub(self.at));
        let ago = match ago {
            0..120 => format!("{ago} s"),
            120..7200 => format!("{} min", ago / 60),
            7200..172_800 => format!("{} h", ago / 3600),
            _ => format!("{} days", ago / 86_400),
        };
        format!("{:02}:{:02}:{:02} UTC, {ago} ago", day / 3600, day / 60 % 60, day % 60)
    }

    /// Lanes that go on from there.
    pub fn setups(self) -> Vec<LaneSetup> {
        let mut file = self.file;
        let setup = |lane: SavedLane| LaneSetup {
            title: lane.title.clone(),
            scene: lane.state.scene().clone(),
            place: lane.place.clone(),
            file: file.take(),
            origin: Origin::Saved(Box::new(lane)),
        };
        self.lanes.into_iter().map(setup).collect()
    }
}

impl SavedLane {
    /// The scene that its commands begin with, and the world in the state that it was in.
    ///
    /// # Errors
    /// A mesh that is no longer there or another one; a file that was damaged.
    pub fn resume(self) -> Result<(Scene, World), Refusal> {
        let snapshot = self.state.snapshot(&self.place)?;
        Ok((self.start, World::resume(&snapshot, self.place)?))
    }
}

/// Seconds since 1970.
fn now() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs())
}

/// Where all sessions write, unless the system names no such place.
pub fn folder() -> Option<PathBuf> {
    Some(Preferences::file()?.parent()?.join("autosave"))
}

/// Writes drafts on a thread of its own.
pub struct Autosave {
    shared: Arc<Shared>,
    due: Instant,
}

/// What became of the drafts, for those who wait for it.
#[derive(Clone)]
pub struct Written(Arc<Shared>);

struct Shared {
    slot: Slot,
    inbox: Mutex<Inbox>,
    /// Held while the file is written.
    writing: Mutex<()>,
    news: Condvar,
    written: AtomicU64,
}

#[derive(Default)]
struct Inbox {
    draft: Option<Draft>,
    is_closed: bool,
    /// Why nothing is written any more, until somebody has been told.
    failure: Option<String>,
}

impl Shared {
    fn inbox(&self) -> MutexGuard<'_, Inbox> {
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self) {
        let mut inbox = self.inbox();
        let mut is_failing = false;
        while !inbox.is_closed {
            let Some(draft) = inbox.draft.take() else {
                inbox = self.news.wait(inbox).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            drop(inbox);
            let writing = self.writing();
            inbox = self.inbox();
            if inbox.is_closed {
                break;
            }
            drop(inbox);
            let written = draft.write(self.slot.file());
            drop(writing);
            inbox = self.inbox();
            let was_failing = std::mem::replace(&mut is_failing, written.is_err());
            match written {
                Ok(()) => {
                    self.written.fetch_add(1, Ordering::Relaxed);
                }
                Err(why) => {
                    // A disk that is full now may not be in a second.
                    inbox.draft.get_or_insert(draft);
                    if !was_failing {
                        inbox.failure = Some(why.to_string());
                    }
                    let waited = self.news.wait_timeout(inbox, EVERY);
                    inbox = waited.unwrap_or_else(PoisonError::into_inner).0;
                }
            }
        }
    }

    fn writing(&self) -> MutexGuard<'_, ()> {
        self.writing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Autosave {
    /// Starts in a folder; none where nothing can be written there.
    pub fn start(folder: &Path) -> Option<Self> {
        let slot = Slot::take(folder)?;
        let (inbox, writing) = (Mutex::default(), Mutex::default());
        let shared =
            Arc::new(Shared { slot, inbox, writing, news: Condvar::new(), written: AtomicU64::new(0) });
        let theirs = Arc::clone(&shared);
        std::thread::Builder::new().name("autosave".to_owned()).spawn(move || theirs.work()).ok()?;
        Some(Self { shared, due: Instant::now() + EVERY })
    }

    /// Time until the next draft is wanted.
    pub fn wait(&self) -> Duration {
        self.due.saturating_duration_since(Instant::now())
    }

    /// Takes a draft, if there is one; an older one that waits is not needed any more.
    pub fn put(&mut self, draft: Option<Draft>) {
        self.due = Instant::now() + EVERY;
        if draft.is_some() {
            self.shared.inbox().draft = draft;
            self.shared.news.notify_one();
        }
    }

    /// Why nothing is written any more, once.
    pub fn failure(&self) -> Option<String> {
        self.shared.inbox().failure.take()
    }

    /// What becomes of the drafts.
    pub fn written(&self) -> Written {
        Written(Arc::clone(&self.shared))
    }
}

impl Drop for Autosave {
    /// The file stays: whoever ends as he should says so by [`Written::end`].
    fn drop(&mut self) {
        self.shared.inbox().is_closed = true;
        self.shared.news.notify_one();
    }
}

impl Written {
    /// How many have been written.
    pub fn count(&self) -> u64 {
        self.0.written.load(Ordering::Relaxed)
    }

    /// The session has ended as it should: nothing is left to be restored.
    pub fn end(&self) {
        let mut inbox = self.0.inbox();
        inbox.is_closed = true;
        inbox.draft = None;
        drop(inbox);
        self.0.news.notify_one();
        let _writing = self.0.writing();
        self.0.slot.clear();
    }
}

#[cfg(test)]
mod tests;
