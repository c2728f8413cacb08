//! The README's promise that a method is one file and one line, done to the letter on a copy of the sources.

use std::fs;
use std::path::Path;
use std::process::Command;

/// The blocks of Rust in the README, in order.
fn rust_blocks(text: &str) -> Vec<&str> {
    text.split("```rust\n").skip(1).filter_map(|rest| rest.split("```").next()).collect()
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a folder");
    for entry in fs::read_dir(from).expect("a folder").flatten() {
        let (source, target) = (entry.path(), to.join(entry.file_name()));
        if source.is_dir() {
            copy(&source, &target);
        } else {
            fs::copy(&source, &target).expect("copied");
        }
    }
}

#[test]
fn a_method_written_from_the_readme_runs() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let readme = fs::read_to_string(root.join("README.md")).expect("the README");
    let blocks = rust_blocks(&readme);
    let [method, line] = blocks[..] else { panic!("{} blocks of Rust in the README", blocks.len()) };

    let dir = tempfile::tempdir().expect("a folder");
    for folder in ["src", "assets", "benches", "shaders", "tests"] {
        if root.join(folder).is_dir() {
            copy(&root.join(folder), &dir.path().join(folder));
        }
    }
    for file in ["Cargo.toml", "Cargo.lock", "README.md"] {
        fs::copy(root.join(file), dir.path().join(file)).expect("copied");
    }
    let registry = dir.path().join("src/simulators/mod.rs");
    let text = fs::read_to_string(&registry).expect("the registry");
    let (before, after) = text.split_once("registry! {\n").expect("the registry's start");
    fs::write(&registry, format!("{before}registry! {{\n{line}{after}")).expect("written");
    fs::write(dir.path().join("src/simulators/drift_kick_drift.rs"), method).expect("written");

    let target = root.join("target/readme");
    let output = Command::new(env!("CARGO"))
        .args(["run", "--quiet", "--offline", "--no-default-features", "--"])
        .args(["run", "sheet", "--set", "simulator.id=drift_kick_drift", "--steps", "50", "--json"])
        .args(["--set", "simulator.params.before=0.25"])
        .env("CARGO_TARGET_DIR", &target)
        .current_dir(dir.path())
        .output()
        .expect("cargo runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(result["simulator"], "drift_kick_drift");
    assert_eq!(result["health"]["state"], "ok");
    assert_eq!(result["cost"]["force_evaluations"], 50);
}
