//! Scenes and recordings out of anything: never a panic, never much memory, one line at most.

mod memory;

use proptest::prelude::*;
use std::fmt::Write as _;
use std::process::Command;
use tenter::scene::{Refusal, Scene, builtin};
use tenter::world::Recording;

/// Reads a text as a scene and as a recording, and asserts what holds for every input.
fn check(text: &str) {
    let one_line = |refusal: &Refusal| {
        let line = refusal.to_string();
        assert!(!line.chars().any(char::is_control), "{line:?}");
        assert!(line.chars().count() < 700, "{line}");
    };
    let (scene, held) = memory::measured(|| Scene::from_ron(text));
    assert!(held <= memory::allowed(text.len()), "{held} bytes held for a scene of {}", text.len());
    scene.as_ref().err().into_iter().for_each(one_line);
    let (recording, held) = memory::measured(|| Recording::from_ron(text));
    assert!(held <= memory::allowed(text.len()), "{held} bytes held for a recording of {}", text.len());
    recording.as_ref().err().into_iter().for_each(one_line);
}

/// A recording that has every kind of command.
fn recording() -> String {
    r#"(scene: (dt: 0.01), steps: 60, commands: [
        (step: 0, command: Pin(particles: [30, 31])),
        (step: 3, command: Grab(particles: [600])),
        (step: 3, command: Drag(particle: 600, to: (1.0, 2.5, -3.0), steps: 4)),
        (step: 9, command: Release(particles: [600])),
        (step: 9, command: Free(particles: [30])),
        (step: 9, command: Pull(particles: [3, 4], stiffness: 20.0)),
        (step: 20, command: Set(key: "springs.stretch.stiffness", value: "500")),
        (step: 40, command: Reset),
    ], digest: "")"#
        .to_owned()
}

fn valid() -> impl Strategy<Value = String> {
    let mut texts: Vec<_> =
        builtin::ALL.iter().map(|b| (b.make)().to_ron().expect("a scene is written")).collect();
    texts.push(recording());
    prop::sample::select(texts)
}

/// A text with some pieces cut, doubled, or replaced by others.
fn mutated() -> impl Strategy<Value = String> {
    const PIECES: &[&str] = &[
        "(",
        ")",
        "[",
        "]",
        "{",
        "}",
        ",",
        ":",
        "\"",
        "'",
        "-",
        "1e999",
        "NaN",
        "inf",
        "-inf",
        "-0.0",
        "1e308",
        "1e-308",
        "18446744073709551616",
        "0x",
        "Some(",
        "()",
        "/*",
        "//",
        "r#\"",
        "\\u{0}",
        "\n",
        "\u{feff}",
        "true",
        "Grid",
        "Mesh(path: \"a.obj\")",
        "Particle(4294967295)",
        "#![enable(implicit_some)]",
    ];
    let edit = (any::<prop::sample::Index>(), 0usize..20, prop::sample::select(PIECES), 0u8..3);
    (valid(), prop::collection::vec(edit, 1..8)).prop_map(|(mut text, edits)| {
        for (at, length, piece, kind) in edits {
            let mut start = at.index(text.len().max(1));
            while !text.is_char_boundary(start) {
                start -= 1;
            }
            let mut end = (start + length).min(text.len());
            while !text.is_char_boundary(end) {
                end += 1;
            }
            match kind {
                0 => text.replace_range(start..end, ""),
                1 => text.insert_str(start, piece),
                _ => text.insert_str(start, text.clone().get(start..end).unwrap_or_default()),
            }
        }
        text
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) })]

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        check(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn anything_like_ron_is_read_or_refused(text in r#"[\(\)\[\]\{\},:"a-z0-9 \.\-#/\*r]{0,200}"#) {
        check(&text);
    }

    #[test]
    fn mutated_files_are_read_or_refused(text in mutated()) {
        check(&text);
    }
}

#[test]
fn texts_made_to_cost_are_refused_cheaply() {
    let many = |piece: &str, times: usize| piece.repeat(times);
    let mut params = String::new();
    for i in 0..100_000 {
        let _ = write!(params, "\"p{i}\":1,");
    }
    for text in [
        many("(", 1_000_000),
        many("[", 1_000_000),
        format!("(pins: {})", many("[", 1_000_000)),
        format!("(target: {})", many("Grid(", 1_000_000)),
        format!("(simulator: (params: {{{}}}", many("\"a\":[", 300_000)),
        format!("(simulator: (params: {{{params}}}))"),
        format!("(simulator: (id: \"verlet\", params: {{{params}}}))"),
        format!("(simulator: (id: \"{}\"))", many("x", 1_000_000)),
        format!("({}: 1)", many("x", 1_000_000)),
        format!("(pins: [{}])", many("Row(1),", 300_000)),
        format!("(pins: [{}Row(1,)", many("Row(1),", 300_000)),
        many("/*", 500_000),
        format!("\"{}", many("\\u{41}", 300_000)),
        format!("(scene: (), steps: 1, commands: [{}])", many("(step:0,command:Reset),", 100_000)),
        format!(
            "(scene: (), steps: 1, commands: [(step: 0, command: Grab(particles: [{}]))])",
            many("1,", 500_000)
        ),
        format!("(dt: 0.{})", many("1", 1_000_000)),
    ] {
        check(&text);
    }
}

#[test]
fn the_recording_that_is_mutated_is_itself_sound() {
    let recording = Recording::from_ron(&recording()).expect("a recording");
    assert_eq!(recording.commands.len(), 8);
    assert_eq!(Recording::from_ron(&recording.to_ron().expect("written")).expect("read back"), recording);
}

#[test]
fn bad_files_end_a_command_with_1_and_one_line() {
    let dir = tempfile::tempdir().expect("a folder");
    let (scene, log) = (dir.path().join("bad.ron"), dir.path().join("log.ron"));
    for bytes in [&b""[..], b"\xff\xfe\x00", b"(", b"(((((((((", b"(dt: \"\n\n\")", b"[1, 2", b"\0\0\0\0"] {
        std::fs::write(&scene, bytes).expect("written");
        std::fs::write(&log, bytes).expect("written");
        for args in [["info", "bad.ron"], ["replay", "log.ron"]] {
            let output = Command::new(env!("CARGO_BIN_EXE_tenter"))
                .args(args)
                .current_dir(dir.path())
                .output()
                .expect("tenter runs");
            let text = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{args:?}: {text}");
            assert_eq!(text.lines().count(), 1, "{text}");
            assert!(output.stdout.is_empty());
        }
    }
}
