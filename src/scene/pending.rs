//! Files that are written whole or not at all.

use super::Refusal;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// How the names of files begin that are not whole yet.
pub const UNFINISHED: &str = ".tenter-";

/// A file to be: it is written beside its place and renamed into it when whole. Dropped before that, it leaves nothing.
pub struct Pending {
    file: tempfile::NamedTempFile,
    path: PathBuf,
}

impl Pending {
    /// Prepares a file. Doing so before long work tells early that a place cannot be written.
    ///
    /// # Errors
    /// The place is a folder, or cannot be written.
    pub fn new(path: &Path) -> Result<Self, Refusal> {
        let failed = |e: std::io::Error| Refusal::new(format!("{}: cannot be written: {e}", path.display()));
        if path.is_dir() {
            return Err(Refusal::new(format!("{}: is a folder; accepted: a file's name", path.display())));
        }
        let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            return Err(Refusal::new(format!(
                "{}: cannot be written: there is no folder {}",
                path.display(),
                folder.display()
            )));
        }
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        // Its error names the file beside; the user knows only the one to be.
        let plain = |e: std::io::Error| failed(e.kind().into());
        let file = builder.prefix(UNFINISHED).tempfile_in(folder).map_err(plain)?;
        Ok(Self { file, path: path.to_owned() })
    }

    /// The file beside its place, for content that comes in pieces.
    pub fn file(&self) -> &File {
        self.file.as_file()
    }

    /// What to say of an error in writing it.
    pub fn failed(&self, error: impl std::fmt::Display) -> Refusal {
        Refusal::new(format!("{}: cannot be written: {error}", self.path.display()))
    }

    /// Writes the content and puts the file into its place.
    ///
    /// # Errors
    /// The file cannot be written; then there is none.
    pub fn finish(self, content: &[u8]) -> Result<(), Refusal> {
        self.file().write_all(content).map_err(|e| self.failed(e))?;
        self.keep()
    }

    /// Puts what was written into its place.
    ///
    /// # Errors
    /// As [`finish`](Self::finish).
    pub fn keep(self) -> Result<(), Refusal> {
        self.file().sync_all().map_err(|e| self.failed(e))?;
        let path = self.path;
        let failed = |e: std::io::Error| Refusal::new(format!("{}: cannot be written: {e}", path.display()));
        self.file.persist(&path).map_err(|e| failed(e.error))?;
        Ok(())
    }
}
