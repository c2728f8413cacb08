//! Where results go: standard output, and files that are written whole or not at all.

pub use crate::scene::Pending;
use crate::scene::Refusal;
use serde::Serialize;
use std::io::Write;

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
