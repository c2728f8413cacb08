//! Files are there whole or not at all, whatever happens; and refusals are one line.

use super::{export, exported, folder, names};
use std::path::Path;
use std::process::Output;

/// The one line that a refusal leaves.
fn refused(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), text.lines().count()), (Some(1), 1), "{text}");
    text
}

const BRIEF: [&str; 3] = ["sheet", "--seconds", "0.04"];
const CORE: [&str; 5] = ["obj", "gltf", "glb", "pc2", "csv"];

#[test]
fn sequences_are_folders_of_numbered_files() {
    let dir = folder();
    let told = exported(dir.path(), &[&BRIEF[..], &["--fps", "50", "--out", "a.obj"]].concat());
    assert_eq!((&told["format"], &told["frames"], &told["steps"]), (&"obj".into(), &3.into(), &2.into()));
    // A folder may also be called without the extension, and may be there if it is empty.
    std::fs::create_dir(dir.path().join("b")).unwrap();
    exported(dir.path(), &[&BRIEF[..], &["--format", "obj", "--out", "b"]].concat());
    assert_eq!(names(dir.path()), ["a", "b"]);
    assert_eq!(names(&dir.path().join("a")), ["a_0000.obj", "a_0001.obj", "a_0002.obj"]);
    assert_eq!(names(&dir.path().join("b")), ["b_0000.obj", "b_0001.obj"]);
    let again = export(dir.path(), &[&BRIEF[..], &["--out", "a.obj"]].concat());
    assert!(refused(&again).contains("a: is there already; accepted: the name of a new folder"));
    // A file is written anew.
    exported(dir.path(), &[&BRIEF[..], &["--out", "a.csv"]].concat());
    exported(dir.path(), &[&BRIEF[..], &["--out", "a.csv"]].concat());
    assert_eq!(names(dir.path()), ["a", "a.csv", "b"]);
}

#[test]
fn what_cannot_be_written_is_refused_before_the_run() {
    let dir = folder();
    for (args, why) in [
        (&["--out", "a.xyz"][..], "the extension 'xyz' is not known; accepted: .obj, .gltf"),
        (&["--out", "a"], "the extension '' is not known"),
        (&["--out", "no/where/a.pc2"], "cannot be written"),
        (&["--out", "no/where/a.obj"], "cannot be written"),
        (&["--out", "a.pc2", "--fps", "0"], "0 frames a second; accepted: a number above 0"),
        (&["--out", "a.pc2", "--fps", "1e9"], "accepted: up to 1000000 frames"),
        (&["--out", "a.glb", "--set", "target=Grid(columns: 1, rows: 1)"], "there are no faces and no edges"),
        (&["--out", "a.glb", "--fps", "500000", "--seconds", "1.9"], "accepted in one glTF file: 3 GB"),
        (&["--out", "a.pc2", "--set", "dt=0"], "dt is 0 s, so no time passes"),
    ] {
        let seconds = if args.contains(&"--seconds") { &[][..] } else { &["--seconds", "1"] };
        let output = export(dir.path(), &[&["sheet"], args, seconds].concat());
        assert!(refused(&output).contains(why), "{args:?}: {}", refused(&output));
        assert_eq!(names(dir.path()), [""; 0], "{args:?}");
    }
    let usage = export(dir.path(), &[&BRIEF[..], &["--out", "a", "--format", "xyz"]].concat());
    assert_eq!(usage.status.code(), Some(2));
}

#[test]
fn numbers_that_single_precision_cannot_hold_are_refused() {
    let dir = folder();
    let far = "v 0 0 0\nv 1e39 0 0\nv 1e39 1e39 0\nf 1 2 3\n";
    std::fs::write(dir.path().join("far.obj"), far).unwrap();
    for name in ["a.pc2", "a.glb", "a.gltf"] {
        let output = export(dir.path(), &["far.obj", "--seconds", "0", "--out", name]);
        let lines = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1));
        assert!(lines.contains("vertex 1 is beyond single precision; accepted: an OBJ sequence"), "{lines}");
    }
    exported(dir.path(), &["far.obj", "--seconds", "0", "--out", "a.obj"]);
    assert_eq!(names(dir.path()), ["a", "far.obj"]);
}

#[test]
fn a_run_that_diverges_writes_what_was_good() {
    for format in CORE {
        let dir = folder();
        let out = format!("a.{format}");
        let output =
            export(dir.path(), &["explicit_bursts", "--seconds", "10", "--fps", "50", "--out", &out]);
        let told = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(output.status.code(), Some(3), "{told}");
        assert!(told.contains("health: diverged in step 48 (0.9600 s)"), "{told}");
        assert!(told.contains("48 frames from 0 to 0.94 s"), "{told}");
        assert_eq!(names(dir.path()).len(), 1);
    }
}

/// Files that may not grow beyond so many KiB stand for a disk that is full: the error comes in the middle of writing.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_leaves_nothing() {
    for format in CORE {
        let dir = folder();
        let tenter = env!("CARGO_BIN_EXE_tenter");
        let script = format!(
            "trap '' XFSZ; ulimit -f 16; exec '{tenter}' export sheet --seconds 40 --fps 25 --out a.{format}"
        );
        let output = std::process::Command::new("bash")
            .args(["-c", &script])
            .current_dir(dir.path())
            .output()
            .unwrap();
        let line = refused(&output);
        assert!(line.contains("cannot be written: File too large"), "{line}");
        assert_eq!(names(dir.path()), [""; 0], "{format}");
    }
}

/// Waits until an export has written so many bytes beside its place.
#[cfg(unix)]
fn wait_for(folder: &Path, bytes: u64, child: &mut std::process::Child) {
    loop {
        let sizes = std::fs::read_dir(folder).unwrap().flatten();
        let sizes = sizes.filter_map(|entry| entry.metadata().ok()).map(|m| m.len());
        if sizes.sum::<u64>() > bytes {
            return;
        }
        assert!(child.try_wait().unwrap().is_none(), "ended by itself");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_the_frames_that_are_there() {
    let dir = folder();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_tenter"));
    command.args(["export", "sheet", "--seconds", "39000", "--out", "a.csv"]).current_dir(dir.path());
    let mut child = command.stderr(std::process::Stdio::piped()).spawn().unwrap();
    wait_for(dir.path(), 2000, &mut child);
    let id = child.id().to_string();
    assert!(std::process::Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{told}");
    assert!(told.contains("interrupted after") && told.contains("of 975001 frames"), "{told}");
    assert_eq!(names(dir.path()), ["a.csv"]);
    let text = std::fs::read_to_string(dir.path().join("a.csv")).unwrap();
    assert!(text.ends_with('\n') && text.lines().count() > 10);
    assert!(text.lines().all(|line| line.split(',').count() == 9));
}

#[cfg(not(feature = "app"))]
#[test]
fn pictures_take_the_renderer() {
    let dir = folder();
    for out in ["a.png", "a.gif"] {
        let output = export(dir.path(), &[&BRIEF[..], &["--out", out]].concat());
        assert!(refused(&output).contains("this build has no renderer; build it with the feature app"));
    }
}
