//! What an earlier session left, because it ended without warning: found when the window opens, and offered once.

use std::path::PathBuf;

use super::{
    autosave::{Saved, Slot, Written},
    files::{Job, take},
    session::Session,
};
use crate::scene::Refusal;

/// What was left behind, with the files that hold it.
type Found = Vec<(Slot, Result<Saved, Refusal>)>;

/// What was taken, until the session itself has written it down.
struct Restored {
    slot: Slot,
    /// How often the session had opened and written something before.
    opened: u64,
    written: u64,
}

/// What is left, and what was taken.
#[derive(Default)]
pub struct Restore {
    looking: Option<Job<Found>>,
    found: Found,
    restored: Option<Restored>,
    written: Option<Written>,
}

impl Restore {
    /// Looks into a folder on a thread of its own; `written` tells what this session writes.
    pub fn look(&mut self, folder: Option<PathBuf>, written: Option<Written>, window: &egui::Context) {
        self.written = written;
        self.looking = folder.map(|folder| Job::start(Some(window), move || find(&folder)));
    }

    /// The same at once, without a window.
    pub fn look_now(&mut self, folder: &std::path::Path) {
        self.found = find(folder);
    }

    /// Takes what the thread has found; once a frame.
    pub fn poll(&mut self, session: &mut Session) {
        if let Some(found) = take(&mut self.looking) {
            self.found = found;
        }
        // What cannot be read stays where it is: another version may know it.
        self.found.retain(|(_, saved)| match saved {
            Ok(_) => true,
            Err(refusal) => {
                session.message = Some(refusal.to_string());
                false
            }
        });
        if self
            .restored
            .as_ref()
            .is_some_and(|it| session.opening().is_none() && session.opened() == it.opened)
        {
            // It could not be opened: perhaps the next session can.
            self.restored = None;
        }
        let written = self.count();
        // The first after it may have been under way already.
        if let Some(restored) = self.restored.take_if(|restored| written > restored.written + 1) {
            restored.slot.clear();
        }
    }

    fn count(&self) -> u64 {
        self.written.as_ref().map_or(0, Written::count)
    }

    /// The session ends as it should: what it has restored is not needed any more.
    pub fn end(&mut self) {
        if let Some(restored) = self.restored.take() {
            restored.slot.clear();
        }
    }

    /// What is offered.
    pub fn offer(&self) -> Option<&Saved> {
        self.found.first().and_then(|(_, saved)| saved.as_ref().ok())
    }

    /// Goes on from what is offered. Its file goes only once this session has written its own.
    pub fn restore(&mut self, session: &mut Session) {
        if self.offer().is_some()
            && let (slot, Ok(saved)) = self.found.remove(0)
        {
            self.restored = Some(Restored { slot, opened: session.opened(), written: self.count() });
            session.open(saved.setups());
        }
    }

    /// Takes away what is offered.
    pub fn discard(&mut self) {
        if self.offer().is_some() {
            self.found.remove(0).0.clear();
        }
    }

    /// Leaves everything for the next session.
    pub fn leave(&mut self) {
        self.found.clear();
    }
}

fn find(folder: &std::path::Path) -> Found {
    let read = |slot: Slot| {
        let saved = Saved::read(slot.file());
        (slot, saved)
    };
    Slot::left_behind(folder).into_iter().map(read).collect()
}
