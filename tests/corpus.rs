//! The corpus: files written by hand and inputs that fuzzing found, replayed through what the fuzz targets ask of every input.
//! fuzz/run makes new ones.

#[path = "../fuzz/src/lib.rs"]
mod fuzz;

use std::fs;
use std::path::Path;

/// Replays every file of one folder.
fn replay(folder: &str, ask: fn(&[u8])) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(folder);
    let mut files: Vec<_> =
        fs::read_dir(path).expect("a folder").map(|f| f.expect("a file").path()).collect();
    files.sort();
    assert!(files.len() >= 5, "{folder}: only {} files", files.len());
    for file in files {
        println!("{}", file.display());
        ask(&fs::read(file).expect("read"));
    }
}

#[test]
fn scenes() {
    replay("scene", fuzz::scene);
}

#[test]
fn recordings() {
    replay("recording", fuzz::recording);
}

#[test]
fn obj() {
    replay("obj", fuzz::obj);
}

#[test]
fn gltf() {
    replay("gltf", fuzz::gltf);
}
