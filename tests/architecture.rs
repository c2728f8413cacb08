//! The directions between modules, and where the wall clock may be read.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules by level: one uses only those of lower levels.
const LEVELS: &[&[&str]] = &[
    &["math", "params"],
    &["target"],
    &["model"],
    &["forces"],
    &["simulators"],
    &["scene"],
    &["world"],
    &["lab", "export"],
    &["app"],
    &["cli"],
];

fn level(module: &str) -> Option<usize> {
    LEVELS.iter().position(|level| level.contains(&module))
}

/// All Rust files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("the folder is there").flatten() {
        let path = entry.path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found
}

fn module_of(file: &Path, src: &Path) -> String {
    let inside = file.strip_prefix(src).expect("below src");
    let first = inside.components().next().expect("a name").as_os_str().to_string_lossy().into_owned();
    first.trim_end_matches(".rs").to_owned()
}

#[test]
fn modules_use_only_those_before_them() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut checked = 0;
    for file in sources(&src) {
        let module = module_of(&file, &src);
        let Some(own) = level(&module) else {
            assert!(["lib", "main"].contains(&module.as_str()), "{module} has no level");
            continue;
        };
        let text = fs::read_to_string(&file).expect("a source");
        for used in text.split("crate::").skip(1) {
            let name: String = used.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            if let Some(other) = level(&name) {
                checked += 1;
                assert!(other < own || name == module, "{} uses {name}", file.display());
            }
        }
    }
    assert!(checked > 50, "only {checked} uses seen: the test no longer reads what it should");
}

#[test]
fn only_the_outermost_modules_read_the_wall_clock() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for file in sources(&src) {
        let module = module_of(&file, &src);
        let text = fs::read_to_string(&file).expect("a source");
        let reads = text.contains("std::time") || text.contains("Instant::now");
        assert!(!reads || ["app", "lab", "cli"].contains(&module.as_str()), "{}", file.display());
    }
}

#[test]
fn every_file_says_in_its_first_line_what_it_is() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for folder in ["src", "tests", "benches"] {
        for file in sources(&root.join(folder)) {
            let text = fs::read_to_string(&file).expect("a source");
            assert!(text.starts_with("//! "), "{}", file.display());
        }
    }
}
