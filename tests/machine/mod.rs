//! What a test does on a machine that lacks something it needs.

use std::io::Write;

/// Reports a test as skipped, by name; where `CI` is set, it fails instead: CI has everything, and its absence is a defect.
pub fn lacks(test: &str, what: &str) {
    assert!(std::env::var_os("CI").is_none(), "{test}: {what}");
    // Past the test's captured output: who skips a test has to say so.
    let _ = writeln!(std::io::stderr().lock(), "skipped {test}: {what}");
}
