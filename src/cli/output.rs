//! Where results go: standard output, and files that are written whole or not at all.

use crate::scene::Refusal;
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Prints a line. Whoever closed the pipe has read enough: that is no error.
pub fn print(line: &str) {
    let _ = writeln!(std::io::stdout().lock(), "{line}");
}

/// One line on standard error.
pub fn complain(line: &str) {
    complain_of("error", line);
}

/// One line on standard error, with what it is before it.
pub fn complain_of(what: &str, line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{what}: {}", crate::params::one_line(line));
}

/// JSON text of a result.
pub fn json<T: Serialize>(value: &T) -> Result<String, Refusal> {
    serde_json::to_string(value).map_err(|e| Refusal::new(format!("result cannot be written: {e}")))
}

/// A file to be: it is written beside its place and renamed into it when whole. Dropped before that, it leaves nothing.
pub struct Pending {
    file: tempfile::NamedTempFile,
    path: PathBuf,
}

impl Pending {
    /// Prepares a file. Doing so before long work tells early that a place cannot be written.
    pub fn new(path: &Path) -> Result<Self, Refusal> {
        let failed = |e: std::io::Error| Refusal::new(format!("{}: cannot be written: {e}", path.display()));
        if path.is_dir() {
            return Err(Refusal::new(format!("{}: is a folder; accepted: a file's name", path.display())));
        }
        let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.prefix(".tenter-").tempfile_in(folder).map_err(failed)?;
        Ok(Self { file, path: path.to_owned() })
    }

    /// Writes the content and puts the file into its place.
    pub fn finish(mut self, content: &[u8]) -> Result<(), Refusal> {
        let failed =
            |e: std::io::Error| Refusal::new(format!("{}: cannot be written: {e}", self.path.display()));
        self.file.write_all(content).and_then(|()| self.file.as_file().sync_all()).map_err(failed)?;
        self.file.persist(&self.path).map_err(|e| failed(e.error))?;
        Ok(())
    }
}
