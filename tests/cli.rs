//! The commands as a user meets them: output, files, exit codes.

use serde_json::Value;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

fn tenter(folder: &Path, args: &[&str]) -> Output {
    with_input(folder, args, "")
}

fn with_input(folder: &Path, args: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_tenter"))
        .args(args)
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("tenter starts");
    // A command that does not read its input closes the pipe: that is its right.
    let _ = child.stdin.take().expect("a pipe").write_all(input.as_bytes());
    child.wait_with_output().expect("tenter ends")
}

fn json(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON on standard output")
}

/// The one line that a refusal leaves on standard error.
fn refused(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
    assert!(output.stdout.is_empty());
    text
}

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

#[test]
fn run_gives_the_result_that_the_contract_names() {
    let dir = folder();
    let result = json(&tenter(dir.path(), &["run", "sheet", "--steps", "100", "--json", "--positions"]));
    assert_eq!(result["simulator"], "symplectic_euler");
    assert_eq!(result["precision"], "Double");
    assert_eq!(result["dt"], 0.02);
    assert_eq!(result["steps"], 100);
    assert_eq!(result["time"], 2.0);
    assert_eq!(result["particles"], 625);
    assert_eq!(result["pinned"], 6);
    assert_eq!(result["springs"], serde_json::json!({"stretch": 1200, "shear": 1152, "bend": 1150}));
    assert_eq!(result["broken"], 0);
    assert_eq!(result["health"], serde_json::json!({"state": "ok"}));
    assert_eq!(result["cost"]["force_evaluations"], 100);
    assert_eq!(result["cost"]["spring_visits"], 350_200);
    for key in ["kinetic", "gravitational", "elastic"] {
        assert!(result["energy"][key].is_f64(), "{key}");
    }
    for key in ["momentum", "angular_momentum"] {
        assert_eq!(result[key].as_array().map(Vec::len), Some(3), "{key}");
    }
    for key in ["max_strain", "mean_strain", "wall_seconds"] {
        assert!(result[key].is_f64(), "{key}");
    }
    assert!(result["threads"].is_u64());
    assert_eq!(result["positions"].as_array().map(Vec::len), Some(625));
    assert_eq!(result["velocities"].as_array().map(Vec::len), Some(625));
    assert_eq!(result["scene"]["springs"]["shear"]["stiffness"], 300.0);
}

#[test]
fn seconds_and_steps_mean_the_same() {
    let dir = folder();
    let by = |option: &str, amount: &str| {
        let mut result =
            json(&tenter(dir.path(), &["run", "sheet", option, amount, "--json", "--positions"]));
        result.as_object_mut().expect("an object").remove("wall_seconds");
        result
    };
    assert_eq!(by("--seconds", "0.5"), by("--steps", "25"));
}

#[test]
fn divergence_ends_with_3_and_a_whole_result() {
    let dir = folder();
    let output =
        tenter(dir.path(), &["run", "explicit_bursts", "--seconds", "5", "--out", "r.json", "--positions"]);
    assert_eq!(output.status.code(), Some(3));
    let text = std::fs::read_to_string(dir.path().join("r.json")).expect("the result is written");
    let result: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(result["health"]["state"], "diverged");
    let step = result["health"]["step"].as_u64().expect("a step");
    assert_eq!(result["steps"], step - 1, "the state is the last good one");
    assert!((result["health"]["time"].as_f64().expect("a time") - 0.02 * step as f64).abs() < 1e-12);
    assert!(result["health"]["particle"].as_u64().expect("a particle") < 625);
    let finite = |key: &str| {
        let all = result[key].as_array().expect("vectors");
        assert_eq!(all.len(), 625);
        all.iter().flat_map(|v| v.as_array().expect("three")).all(Value::is_number)
    };
    assert!(finite("positions") && finite("velocities"));
}

#[test]
fn scenes_come_from_files_names_meshes_and_standard_input() {
    let dir = folder();
    std::fs::write(dir.path().join("s.ron"), "(dt: 0.01)").expect("written");
    assert_eq!(json(&tenter(dir.path(), &["run", "s.ron", "--steps", "1", "--json"]))["dt"], 0.01);
    let piped = with_input(dir.path(), &["run", "-", "--steps", "1", "--json"], "(precision: Single)");
    assert_eq!(json(&piped)["precision"], "Single");
    let asset = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/meshes/cylinder_20x5.obj");
    let mesh = json(&tenter(dir.path(), &["run", &asset.display().to_string(), "--steps", "1", "--json"]));
    assert_eq!((&mesh["particles"], &mesh["pinned"]), (&120.into(), &0.into()));
}

#[test]
fn a_recording_is_told_from_a_scene_and_replayed_to_the_same_bits() {
    let dir = folder();
    let recorded = tenter(dir.path(), &["run", "sheet", "--steps", "5", "--record", "r.ron"]);
    assert!(recorded.status.success());
    let replayed = tenter(dir.path(), &["replay", "r.ron"]);
    assert!(replayed.status.success());
    assert!(String::from_utf8_lossy(&replayed.stdout).contains("bit for bit"));
    assert!(refused(&tenter(dir.path(), &["info", "r.ron"])).contains("tenter replay"));
    std::fs::write(dir.path().join("scene.ron"), "()").expect("written");
    for (what, why) in [("scene.ron", "tenter run"), ("missing.ron", "--record")] {
        let line = refused(&tenter(dir.path(), &["replay", what]));
        assert!(line.contains(what) && line.contains(why), "{line}");
    }
}

#[test]
fn set_reaches_every_part_of_the_scene() {
    let dir = folder();
    let result = json(&tenter(
        dir.path(),
        &[
            "run",
            "sheet",
            "--steps",
            "1",
            "--json",
            "--set",
            "dt=0.005",
            "--set",
            "simulator.id=verlet",
            "--set",
            "simulator.params.sweeps=7",
            "--set",
            "springs.stretch.stiffness=50",
            "--set",
            "target.columns=4",
            "--set",
            "target.plane=Vertical",
            "--set",
            "wind.direction=(1, 0, 0)",
            "--set",
            "pins=[Particle(0)]",
            "--set",
            "mass=PerArea(0.5)",
        ],
    ));
    let scene = &result["scene"];
    assert_eq!(scene["dt"], 0.005);
    assert_eq!(scene["simulator"], serde_json::json!({"id": "verlet", "params": {"sweeps": 7}}));
    assert_eq!(scene["springs"]["stretch"]["stiffness"], 50.0);
    assert_eq!(scene["target"]["Grid"]["columns"], 4);
    assert_eq!(scene["target"]["Grid"]["plane"], "Vertical");
    assert_eq!(scene["wind"]["direction"], serde_json::json!([1.0, 0.0, 0.0]));
    assert_eq!((&result["particles"], &result["pinned"]), (&100.into(), &1.into()));
    assert_eq!(scene["mass"]["PerArea"], 0.5);
}

#[test]
fn refusals_are_one_line_with_place_value_and_what_would_do() {
    let dir = folder();
    let line = |text: &str| {
        std::fs::write(dir.path().join("bad.ron"), text).expect("written");
        refused(&tenter(dir.path(), &["run", "bad.ron", "--steps", "1", "--out", "r.json"]))
    };
    for (text, parts) in [
        ("(\n    dt: -1,\n)", &["bad.ron:2:", "dt is -1", "0 to 100 s"][..]),
        ("(dt: inf)", &["bad.ron:1:", "dt is inf"]),
        ("(gravity: (strength: 3))", &["bad.ron:1:", "'strength'", "enabled, magnitude"]),
        ("(springs: (shear: (stiffness: \"soft\")))", &["bad.ron:1:"]),
        ("(simulator: (id: \"euler\"))", &["bad.ron:1:", "'euler'", "symplectic_euler"]),
        ("(simulator: (id: \"verlet\", params: {\"sweeps\": -1}))", &["bad.ron:1:", "sweeps"]),
        ("(tearing: (max_ratio: 1.0))", &["bad.ron:1:", "max_ratio is 1"]),
        ("(wind: (direction: (0, 0, 0)))", &["bad.ron", "wind.direction"]),
        ("(pins: [Particle(625)])", &["bad.ron", "Particle(625)", "0 to 624"]),
        ("(pins: [Row(25)])", &["bad.ron", "Row(25)", "0 to 24"]),
        ("(target: Grid(columns: 0))", &["bad.ron:1:", "columns is 0"]),
        ("(target: Grid(columns: 1000000, rows: 1000000))", &["bad.ron", "1000000000000 particles", "GB"]),
        ("(target: Mesh(scale: 2))", &["bad.ron", "path"]),
        ("(target: Mesh(path: \"/etc/passwd.obj\"))", &["bad.ron"]),
        ("(dt: 0.1, dt: 0.2)", &["bad.ron:1:", "dt", "twice"]),
        ("(dt: 0.1", &["bad.ron:1:"]),
    ] {
        let line = line(text);
        for part in parts {
            assert!(line.contains(part), "'{part}' is not in: {line}");
        }
        assert!(!dir.path().join("r.json").exists(), "{text}");
    }
}

#[test]
fn refused_settings_are_told_in_words_and_not_by_types_of_the_program() {
    let dir = folder();
    for (setting, part) in [
        ("dt=abc", "a number is missing; accepted: 0 to 100 s"),
        ("dt=1 2", "more follows"),
        ("gravity.enabled=3", "neither true nor false"),
        ("simulator=verlet", "accepted: (id: \"verlet\")"),
        ("pins=[Foo(3)]", "unknown `Foo`; known: `Particle`, `Corners`"),
        ("pins=[Corners]", "`(` is missing"),
        ("pins=3", "`[` is missing"),
        ("mass=3", "accepted: PerParticle(kg)"),
        ("target=Grid(columns: a)", "columns: it is no whole number; accepted: 1 to"),
        ("target=Mesh(path: 3)", "a text in quotes is missing"),
    ] {
        let line = refused(&tenter(dir.path(), &["info", "sheet", "--set", setting]));
        assert!(line.contains(part), "'{part}' is not in: {line}");
        for word in ["Expected", "struct", "enum", "identifier"] {
            assert!(!line.contains(word), "{line}");
        }
    }
    std::fs::write(dir.path().join("five.ron"), "5").expect("written");
    let line = refused(&tenter(dir.path(), &["info", "five.ron"]));
    assert!(line.contains("five.ron:1:1: an opening `(` is missing"), "{line}");
}

#[test]
fn a_scene_of_pinned_particles_says_that_nothing_can_move() {
    let dir = folder();
    let info = |pins: &str| {
        let set = format!("pins=[{pins}]");
        json(&tenter(dir.path(), &["info", "sheet", "--json", "--set", &set]))["warnings"].to_string()
    };
    assert!(info("Top(0.03)").contains("every particle is pinned"), "a flat sheet is all top");
    assert!(!info("Corners(2)").contains("every particle is pinned"));
}

#[test]
fn meshes_outside_the_scenes_folder_stay_closed() {
    let dir = folder();
    let inside = dir.path().join("scenes");
    std::fs::create_dir(&inside).expect("made");
    let mesh = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    std::fs::write(dir.path().join("quad.obj"), mesh).expect("written");
    std::fs::write(inside.join("quad.obj"), mesh).expect("written");
    std::fs::write(inside.join("out.ron"), "(target: Mesh(path: \"../quad.obj\"))").expect("written");
    std::fs::write(inside.join("in.ron"), "(target: Mesh(path: \"quad.obj\"))").expect("written");
    let run = |args: &[&str]| tenter(dir.path(), args);
    assert!(refused(&run(&["info", "scenes/out.ron"])).contains("outside"));
    assert_eq!(json(&run(&["info", "scenes/in.ron", "--json"]))["particles"], 4);
    // What the user names on the command line may be opened.
    let named = run(&["info", "scenes/in.ron", "--set", "target.path=quad.obj", "--json"]);
    assert_eq!(json(&named)["particles"], 4);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(dir.path().join("quad.obj"), inside.join("link.obj")).expect("linked");
        std::fs::write(inside.join("link.ron"), "(target: Mesh(path: \"link.obj\"))").expect("written");
        assert!(refused(&run(&["info", "scenes/link.ron"])).contains("outside"));
    }
}

#[test]
fn wrong_usage_ends_with_2() {
    let dir = folder();
    for args in [
        &["run", "sheet"][..],
        &["run", "sheet", "--steps", "1", "--seconds", "1"],
        &["run", "sheet", "--seconds", "-1"],
        &["run", "sheet", "--seconds", "nan"],
        &["run", "sheet", "--steps", "1", "--set", "dt"],
        &["run", "sheet", "--steps", "1", "--threads", "0"],
        &["run", "--steps", "1"],
        &["info"],
    ] {
        let output = tenter(dir.path(), args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(output.stdout.is_empty(), "{args:?}");
    }
}

#[test]
fn a_place_that_cannot_be_written_is_refused_before_any_work() {
    let dir = folder();
    for out in ["missing/r.json", "."] {
        refused(&tenter(dir.path(), &["run", "sheet", "--steps", "1000000000", "--out", out]));
    }
    assert_eq!(std::fs::read_dir(dir.path()).expect("a folder").count(), 0);
}

#[test]
fn info_tells_what_a_mesh_and_a_scene_hold() {
    let dir = folder();
    let info = json(&tenter(dir.path(), &["info", "cylinder_gltf", "--json"]));
    assert_eq!(info["particles"], 120);
    assert_eq!(info["pinned"], 2);
    assert_eq!(info["faces"], serde_json::json!({"triangles": 0, "quads": 100, "ngons": 0}));
    assert_eq!(info["springs"], serde_json::json!({"stretch": 220, "shear": 200, "bend": 200}));
    assert_eq!(info["total_mass"], 120.0);
    assert_eq!(info["components"], 1);
    assert_eq!(
        info["quad_recovery"],
        serde_json::json!({"method": "order", "quads": 100, "triangles_left": 0})
    );
    assert!(info["stability"]["omega_max"].as_f64().expect("a number") > 0.0);
    let asset = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/meshes/cape_mixed.obj");
    let mesh = json(&tenter(dir.path(), &["info", &asset.display().to_string(), "--json"]));
    assert_eq!(mesh["faces"], serde_json::json!({"triangles": 24, "quads": 334, "ngons": 1}));
    assert!(mesh.get("stability").is_none());
}

#[test]
fn lists_name_scenes_and_methods() {
    let dir = folder();
    let scenes = json(&tenter(dir.path(), &["scenes", "--json"]));
    assert!(scenes.as_array().expect("a list").iter().any(|s| s["name"] == "sheet"));
    let methods = json(&tenter(dir.path(), &["simulators", "--json"]));
    let verlet = methods.as_array().expect("a list").iter().find(|m| m["id"] == "verlet").expect("verlet");
    assert_eq!(verlet["params"][0]["name"], "sweeps");
    assert_eq!(verlet["params"][0]["range"], serde_json::json!([0.0, 100_000.0]));
}

#[test]
fn a_recording_replays_to_the_same_bits_and_a_forged_one_does_not_pass() {
    let dir = folder();
    let run = ["run", "flag", "--steps", "200", "--record", "log.ron", "--json", "--positions"];
    let first = json(&tenter(dir.path(), &run));
    let again = json(&tenter(dir.path(), &["replay", "log.ron", "--json", "--positions", "--threads", "2"]));
    assert_eq!(first["positions"], again["positions"]);
    assert_eq!(first["velocities"], again["velocities"]);
    let log = std::fs::read_to_string(dir.path().join("log.ron")).expect("recorded");
    let start = log.find("digest: \"").expect("a digest") + 9;
    let forged = format!("{}0123456789abcdef{}", &log[..start], &log[start + 16..]);
    std::fs::write(dir.path().join("forged.ron"), forged).expect("written");
    let output = tenter(dir.path(), &["replay", "forged.ron", "--quiet"]);
    assert!(refused(&output).contains("0123456789abcdef"));
}

#[test]
fn the_same_hands_on_another_cloth_tell_how_far_it_ends_from_the_recorded_one() {
    let dir = folder();
    let run = ["run", "flag", "--steps", "200", "--record", "log.ron", "--json"];
    let first = json(&tenter(dir.path(), &run));
    let replay = |set: &[&str]| {
        let set: Vec<&str> = set.iter().flat_map(|set| ["--set", *set]).collect();
        json(&tenter(dir.path(), &[&["replay", "log.ron", "--json"], &set[..]].concat()))
    };
    let near = |result: &serde_json::Value| {
        let [a, b] = [result, &first].map(|result| result["time"].as_f64().expect("a time"));
        // Rounded sums of steps.
        (a - b).abs() < 1e-9
    };
    let other = replay(&["simulator.id=rk4", "precision=Single"]);
    assert_eq!((&other["simulator"], &other["steps"]), (&"rk4".into(), &200.into()));
    let [rms, most] = ["rms", "max"].map(|what| other["difference"][what].as_f64().expect("a distance"));
    assert!(rms > 0.0 && most >= rms && near(&other), "{other}");
    assert_eq!(other["difference"]["energy"], first["energy"]);
    let dt = first["dt"].as_f64().expect("a dt");
    let finer = replay(&[&format!("dt={}", dt / 4.0)]);
    assert_eq!(finer["steps"], 800);
    assert!(near(&finer) && finer["difference"]["max"].as_f64().is_some_and(|most| most > 0.0));
    // The same settings are the same cloth, to the bit.
    let same = replay(&[&format!("dt={dt}")]);
    assert_eq!((&same["difference"]["max"], &same["energy"]), (&0.0.into(), &first["energy"]));
    let smaller = tenter(dir.path(), &["replay", "log.ron", "--set", "target.columns=9"]);
    assert_eq!(smaller.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&smaller.stdout).contains("not compared bit for bit"));
    assert!(String::from_utf8_lossy(&smaller.stderr).contains("no distances"));
    assert!(refused(&tenter(dir.path(), &["replay", "log.ron", "--set", "dt=0"])).contains("dt is 0"));
}

#[test]
fn a_recording_finds_its_mesh_from_its_own_folder() {
    let dir = folder();
    std::fs::create_dir(dir.path().join("meshes")).expect("made");
    std::fs::create_dir(dir.path().join("logs")).expect("made");
    let mesh = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    std::fs::write(dir.path().join("meshes/quad.obj"), mesh).expect("written");
    let record = |log: &str| tenter(dir.path(), &["run", "meshes/quad.obj", "--steps", "9", "--record", log]);
    assert_eq!(record("log.ron").status.code(), Some(0));
    assert_eq!(tenter(dir.path(), &["replay", "log.ron"]).status.code(), Some(0));
    assert_eq!(record("logs/log.ron").status.code(), Some(0));
    assert!(refused(&tenter(dir.path(), &["replay", "logs/log.ron"])).contains("outside"));
    let named = ["replay", "logs/log.ron", "--set", "target.path=meshes/quad.obj", "--json"];
    assert_eq!(json(&tenter(dir.path(), &named))["steps"], 9);
}

/// `tenter` on a machine without a screen, and without what the session around the tests would add.
fn without_a_screen(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tenter"));
    for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET", "XDG_RUNTIME_DIR"] {
        command.env_remove(name);
    }
    command.args(args).current_dir(folder).stdin(Stdio::null()).output().expect("tenter runs")
}

#[test]
fn without_a_window_a_scene_still_runs() {
    let dir = folder();
    let small = ["--set", "target.columns=4", "--set", "target.rows=4", "--record", "log.ron"];
    let output = without_a_screen(dir.path(), &[&small[..], &["--json"]].concat());
    let note = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(note.starts_with("note: ") && note.contains("window"), "{note}");
    let result = json(&output);
    assert_eq!((&result["particles"], &result["time"]), (&16.into(), &10.0.into()));
    let again = json(&tenter(dir.path(), &["replay", "log.ron", "--json"]));
    assert_eq!(again["energy"], result["energy"]);

    let output = without_a_screen(dir.path(), &["explicit_bursts"]);
    assert_eq!(output.status.code(), Some(3));
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    let drawn = dir.path().join("tenter-explicit_bursts.png");
    assert!(told.contains("diverged"), "{told}");
    assert_eq!(told.contains("tenter-explicit_bursts.png: "), drawn.is_file(), "{told}");
    for args in [&["nonsense"][..], &["sheet", "nonsense"], &["--set", "pins=[Particle(625)]"]] {
        refused(&without_a_screen(dir.path(), args));
    }
}

#[test]
fn render_draws_a_scene_or_says_what_is_missing() {
    let dir = folder();
    let render = |scene: &str, more: &[&str]| {
        let args = ["render", scene, "--seconds", "1", "--out", "p.png", "--size", "64x40"];
        without_a_screen(dir.path(), &[&args[..], more].concat())
    };
    let output = render("sheet", &["--json"]);
    if output.status.code() == Some(1) {
        let why = refused(&output);
        let missing = if cfg!(feature = "app") { "install" } else { "no renderer" };
        assert!(why.contains(missing), "{why}");
        assert_eq!(std::fs::read_dir(dir.path()).expect("a folder").count(), 0);
        return;
    }
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    let drawn = json(&output);
    assert_eq!((&drawn["steps"], &drawn["time"]), (&50.into(), &1.0.into()));
    assert_eq!((&drawn["size"], &drawn["file"]), (&serde_json::json!([64, 40]), &"p.png".into()));
    assert!(!drawn["adapter"].as_str().expect("a name").is_empty());
    let png = std::fs::read(dir.path().join("p.png")).expect("a picture");
    assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
    assert_eq!((&png[16..20], &png[20..24]), (&64_u32.to_be_bytes()[..], &40_u32.to_be_bytes()[..]));

    std::fs::remove_file(dir.path().join("p.png")).expect("removed");
    assert_eq!(render("explicit_bursts", &[]).status.code(), Some(3));
    assert!(dir.path().join("p.png").is_file(), "a burst scene has its picture too");
    let again = |out: &str, size: &str| {
        let args = ["render", "sheet", "--steps", "1", "--out", out, "--size", size];
        without_a_screen(dir.path(), &args)
    };
    assert!(refused(&again("q.png", "1000000x1")).contains("1000000 x 1"));
    refused(&again("missing/q.png", "64x40"));
    assert!(refused(&again("q.jpg", "64x40")).contains("ends in .png"));
    for size in ["64", "0x40", "64x-1", "axb"] {
        assert_eq!(again("q.png", size).status.code(), Some(2), "{size}");
    }
    assert!(!dir.path().join("q.png").exists());
}

/// A step of which there would be some hours is no reason to wait.
#[test]
#[cfg(target_os = "linux")]
fn ctrl_c_breaks_off_a_step() {
    let dir = folder();
    let child = Command::new(env!("CARGO_BIN_EXE_tenter"))
        .args(["run", "sheet", "--steps", "3", "--json", "--set", "simulator.id=xpbd"])
        .args(["--set", "simulator.params.substeps=100000", "--set", "simulator.params.iterations=100000"])
        .current_dir(dir.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("tenter starts");
    let catches_interrupts = || {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        caught.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).is_ok_and(|mask| mask & 0b10 != 0))
    };
    while !catches_interrupts() {
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    std::thread::sleep(std::time::Duration::from_millis(100));
    let told = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
    assert!(told.success());
    let output = child.wait_with_output().expect("it ends");
    let result = json(&output);
    assert_eq!((&result["steps"], &result["health"]["state"]), (&0.into(), &"ok".into()));
    let warned = String::from_utf8(output.stderr).expect("text");
    assert_eq!(warned.lines().count(), 1, "{warned}");
    assert!(warned.contains("interrupted after 0 of 3 steps"), "{warned}");
}
