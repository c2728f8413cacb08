//! A file that one session writes: a lock beside it, which the system opens when the process ends, however it ends, tells the others
//! whether it still does.

use std::{
    fs::{File, OpenOptions},
    path::{Path, PathBuf},
    time::Duration,
};

use crate::scene::UNFINISHED;

/// Sessions that one process may have at a time, and more than anybody opens at once.
const MOST: u32 = 64;

/// A file that nobody else writes.
#[derive(Debug)]
pub struct Slot {
    /// Held as long as this lives.
    lock: File,
    file: PathBuf,
}

impl Slot {
    /// A new one in a folder, which is made; none where that is not possible.
    pub fn take(folder: &Path) -> Option<Self> {
        std::fs::create_dir_all(folder).ok()?;
        let process = std::process::id();
        (0..MOST).find_map(|number| {
            let file = folder.join(format!("{process}-{number}.ron"));
            let slot = Self::lock(file)?;
            // A process of the same number may have ended without warning.
            (!slot.file.exists()).then_some(slot)
        })
    }

    /// Those of a folder that were left behind, the newest first.
    pub fn left_behind(folder: &Path) -> Vec<Self> {
        let files = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let files = files.filter(|path| !sweep(path));
        let files = files.filter(|path| path.extension().is_some_and(|ending| ending == "ron"));
        let changed = |path: &Path| path.metadata().and_then(|data| data.modified()).ok();
        let mut slots: Vec<Self> = files.filter_map(Self::lock).filter(|slot| slot.file.exists()).collect();
        slots.sort_by_key(|slot| std::cmp::Reverse(changed(&slot.file)));
        slots
    }

    /// None where another session has it.
    fn lock(file: PathBuf) -> Option<Self> {
        let path = file.with_extension("lock");
        let lock = OpenOptions::new().create(true).write(true).truncate(false).open(path).ok()?;
        lock.try_lock().ok()?;
        Some(Self { lock, file })
    }

    /// The file.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Takes file and lock away.
    pub fn clear(&self) {
        // What is not there any more need not go.
        let _ = std::fs::remove_file(&self.file);
        let _ = self.lock.unlock();
        let _ = std::fs::remove_file(self.file.with_extension("lock"));
    }
}

/// Takes away what a process was writing when it ended; true if that is what it is.
fn sweep(path: &Path) -> bool {
    /// Nobody writes for so long.
    const LONG: Duration = Duration::from_mins(10);
    let is_unfinished = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(UNFINISHED));
    let age = path.metadata().and_then(|data| data.modified()).ok().and_then(|time| time.elapsed().ok());
    if is_unfinished && age.is_some_and(|age| age > LONG) {
        let _ = std::fs::remove_file(path);
    }
    is_unfinished
}
