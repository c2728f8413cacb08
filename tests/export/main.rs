//! Exports: what is in the files, and what becomes of them when something goes wrong. `tests/export/run` reads the same
//! formats with other programs' readers.
#![allow(clippy::unwrap_used)]

#[path = "../common/mod.rs"]
mod common;
mod files;
mod frames;
#[cfg(feature = "app")]
#[path = "../machine/mod.rs"]
mod machine;
#[cfg(feature = "app")]
mod pictures;
mod surface;
#[cfg(feature = "app")]
mod workbench;

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn patches() -> PathBuf {
    project().join("tests/export/patches.obj")
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// `tenter export` with these arguments, run in a folder.
fn export(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tenter"));
    command.arg("export").args(args).current_dir(folder).output().unwrap()
}

/// What an export tells as JSON when it is done.
fn exported(folder: &Path, args: &[&str]) -> Value {
    let output = export(folder, &[args, &["--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The names in a folder, hidden ones included, sorted.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap().flatten();
    let mut names: Vec<_> = entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}
