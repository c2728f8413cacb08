//! Folders of numbered files that are there whole or not at all.

use super::Span;
use crate::scene::{Refusal, UNFINISHED};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder to be, with a file for each frame: it is filled beside its place and renamed into it when whole. Dropped
/// before that, it leaves nothing.
pub struct PendingFolder {
    folder: TempDir,
    path: PathBuf,
    stem: String,
    digits: usize,
    extension: &'static str,
}

impl PendingFolder {
    /// Prepares the folder `path` without its extension; the files are called as the folder is, with the frame's
    /// number behind it.
    ///
    /// # Errors
    /// The place is taken, or cannot be written.
    pub fn new(path: &Path, extension: &'static str, span: Span) -> Result<Self, Refusal> {
        let is_named = path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
        let path = if is_named { path.with_extension("") } else { path.to_owned() };
        let Some(stem) = path.file_name().map(|name| name.to_string_lossy().into_owned()) else {
            return Err(Refusal::new(format!("{}: accepted: the name of a new folder", path.display())));
        };
        let is_taken = match std::fs::read_dir(&path) {
            Ok(mut entries) => entries.next().is_some(),
            Err(_) => path.symlink_metadata().is_ok(),
        };
        if is_taken {
            return Err(Refusal::new(format!(
                "{}: is there already; accepted: the name of a new folder, or of an empty one",
                path.display()
            )));
        }
        let beside = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
        let folder = builder.prefix(UNFINISHED).tempdir_in(beside);
        let folder = folder.map_err(|e| failed(&path, &e))?;
        let digits = span.last.to_string().len().max(4);
        Ok(Self { folder, path, stem, digits, extension })
    }

    /// Writes the file of a frame.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, frame: u64, content: &[u8]) -> Result<(), Refusal> {
        let Self { stem, digits, extension, .. } = self;
        let file = self.folder.path().join(format!("{stem}_{frame:0digits$}.{extension}"));
        std::fs::write(file, content).map_err(|e| failed(&self.path, &e))
    }

    /// Puts the folder into its place.
    ///
    /// # Errors
    /// The place was taken in the meantime, or cannot be written.
    pub fn keep(self) -> Result<(), Refusal> {
        // Only an empty folder is taken away; elsewhere than on Unix a folder is not renamed over it.
        let _ = std::fs::remove_dir(&self.path);
        std::fs::rename(self.folder.path(), &self.path).map_err(|e| failed(&self.path, &e))?;
        // It is no longer there to be taken away.
        let _ = self.folder.keep();
        Ok(())
    }
}

fn failed(path: &Path, error: &std::io::Error) -> Refusal {
    Refusal::new(format!("{}: cannot be written: {error}", path.display()))
}
