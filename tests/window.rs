//! The workbench in a real window: started, a particle dragged with a mouse, another one pinned, saved, closed; then the recording
//! and the saved scene are looked at.
//!
//! The window opens on a virtual display (Xvfb) of its own, whose mouse and keys xdotool moves.

#![cfg(target_os = "linux")]

mod display;
mod machine;

use display::{Display, Process};
use std::path::Path;
use std::process::{Command, Output};
use std::sync::{Arc, Mutex};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tenter::app::engine::{Engine, LaneSetup, Order, Origin};
use tenter::app::session::{Link, Session};
use tenter::app::shell::{self, Canvas, Content, Opening, ShellError, Stage};
use tenter::app::workbench::Workbench;
use tenter::scene::{Place, Scene};
use tenter::world::{Command as Act, Recording, World};

fn pause(seconds: f64) {
    sleep(Duration::from_secs_f64(seconds));
}

fn tenter(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tenter"));
    command.current_dir(folder);
    command
}

/// The program on a display.
fn on_display(display: &Display, folder: &Path) -> Command {
    let mut program = tenter(folder);
    program.env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
    // Neither the user's settings nor a session's bus belong to the test.
    program.env("XDG_RUNTIME_DIR", folder).env("XDG_CONFIG_HOME", folder).env("XDG_DATA_HOME", folder);
    program.env("XDG_CACHE_HOME", folder).env("HOME", folder);
    program
}

/// The workbench on the sheet, which is recorded.
fn open_on(display: &Display, folder: &Path) -> Process {
    let mut program = on_display(display, folder);
    Process::start(program.args(["sheet", "--record", "done.ron"]))
}

/// Where all particles are at the end of a run or replay.
fn positions(folder: &Path, args: &[&str]) -> Vec<[f64; 3]> {
    let output: Output = tenter(folder).args(args).args(["--positions", "--json"]).output().expect("runs");
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    serde_json::from_value(result["positions"].clone()).expect("positions")
}

fn lacking() -> Option<String> {
    let there = |program: &str| {
        let paths = std::env::var_os("PATH").unwrap_or_default();
        std::env::split_paths(&paths).any(|folder| folder.join(program).is_file())
    };
    let missing: Vec<_> = ["Xvfb", "xdotool"].into_iter().filter(|program| !there(program)).collect();
    if !missing.is_empty() {
        return Some(format!("{} is not installed", missing.join(" and ")));
    }
    tenter::app::gpu::Gpu::offscreen().err().map(|e| e.to_string())
}

#[test]
fn a_particle_is_dragged_in_a_window() {
    if let Some(what) = lacking() {
        return machine::lacks("a_particle_is_dragged_in_a_window", &what);
    }
    let dir = tempfile::tempdir().expect("a folder");
    let folder = dir.path();
    let display = Display::open();
    let mut program = open_on(&display, folder);

    let found = display.xdotool(&["search", "--sync", "--onlyvisible", "--name", "Tenter"]);
    let window = found.lines().next().expect("a window").trim().to_owned();
    display.xdotool(&["windowfocus", "--sync", &window]);
    pause(3.0);
    // The cloth hangs in the middle. Between two particles the mouse may miss both, so it tries at several places.
    for (x, y) in [(740, 400), (765, 450), (715, 350)] {
        display.xdotool(&["mousemove", "--sync", &x.to_string(), &y.to_string()]);
        pause(0.5);
        display.xdotool(&["mousedown", "1"]);
        pause(0.4);
        for _ in 0..5 {
            display.xdotool(&["mousemove_relative", "--sync", "--", "-30", "-12"]);
            pause(0.3);
        }
        pause(0.5);
        display.xdotool(&["mouseup", "1"]);
        pause(0.6);
    }
    // Paused at its start, with all of the sheet in view, its middle is in the middle: a click selects there, P pins, and the
    // scene is saved where the dialog proposes.
    for key in ["space", "r", "f"] {
        display.xdotool(&["key", key]);
        pause(0.6);
    }
    display.xdotool(&["mousemove", "--sync", "660", "400"]);
    pause(0.5);
    display.xdotool(&["click", "1"]);
    pause(0.5);
    display.xdotool(&["key", "p"]);
    pause(0.5);
    display.xdotool(&["key", "ctrl+s"]);
    pause(1.0);
    display.xdotool(&["key", "Return"]);
    let saved = folder.join("sheet.ron");
    let start = Instant::now();
    while !saved.is_file() {
        assert!(start.elapsed() < Duration::from_secs(20), "nothing was saved");
        pause(0.1);
    }
    // Nothing is left to be saved, so nobody is asked.
    pause(1.0);
    display.close(window.parse().expect("a number"));
    assert_eq!(program.end(Duration::from_mins(1)), Some(0));

    let text = std::fs::read_to_string(folder.join("done.ron")).expect("the recording");
    let recording = Recording::from_ron(&text).expect("a recording");
    let steps = recording.steps;
    assert!(steps > 20, "{steps} steps in several seconds");
    let grabbed = recording.commands.iter().position(|entry| matches!(entry.command, Act::Grab { .. }));
    let grabbed = grabbed.unwrap_or_else(|| panic!("nothing was grabbed in {text}"));
    let Act::Grab { particles } = &recording.commands[grabbed].command else { unreachable!() };
    let [particle] = particles[..] else { panic!("{particles:?}") };
    let after = &recording.commands[grabbed..];
    let released = after.iter().position(|entry| matches!(entry.command, Act::Release { .. }));
    let released = grabbed + released.expect("a release");
    let drags = &recording.commands[grabbed + 1..released];
    // How many depends on how fast pictures are drawn.
    assert!(!drags.is_empty(), "nothing was dragged in {text}");
    assert!(
        drags.iter().all(|entry| matches!(entry.command, Act::Drag { particle: p, .. } if p == particle))
    );

    let pinned = after.iter().rev().find_map(|entry| match &entry.command {
        Act::Pin { particles } => Some(particles[..].to_vec()),
        _ => None,
    });
    let [pinned] = pinned.expect("a pin")[..] else { panic!("one particle was selected") };
    let scene = Scene::from_ron(&std::fs::read_to_string(&saved).expect("text")).expect("a scene");
    let expected: Vec<bool> = {
        let mut world = World::new(Scene::default(), Place::default()).expect("a world");
        world.apply(Act::Pin { particles: vec![pinned] }).expect("a particle");
        world.pinned().to_vec()
    };
    let reopened = World::new(scene.clone(), Place::default()).expect("a world");
    assert_eq!(reopened.pinned(), expected, "the saved scene pins what was pinned in the window");
    assert_eq!(scene, Scene { pins: scene.pins.clone(), ..Scene::default() }, "and is the same in all else");

    // The whole recording runs again to the same bits: replay compares the digest.
    positions(folder, &["replay", "done.ron"]);
    // Up to the moment before the hand opened, beside a cloth that nobody touched.
    let held = recording.commands[released].step;
    let commands = recording.commands[..released].to_vec();
    let until = Recording { steps: held, commands, digest: String::new(), ..recording };
    std::fs::write(folder.join("held.ron"), until.to_ron().expect("text")).expect("written");
    let touched = positions(folder, &["replay", "held.ron"]);
    let free = positions(folder, &["run", "sheet", "--steps", &held.to_string()]);
    let moved = |p: u32| glam::DVec3::from(touched[p as usize]).distance(free[p as usize].into());
    let own = moved(particle);
    assert!(own > 1.0, "particle {particle} was dragged by {own} m");
    let (row, column) = (particle / 25, particle % 25);
    let beside = [
        (row > 0).then(|| particle - 25),
        (row < 24).then(|| particle + 25),
        (column > 0).then(|| particle - 1),
        (column < 24).then(|| particle + 1),
    ];
    for neighbour in beside.into_iter().flatten() {
        let by = moved(neighbour);
        assert!(by > 0.2 * own, "particle {particle} went {own} m, its neighbour {neighbour} {by} m");
    }
}

#[test]
fn ctrl_c_in_the_terminal_closes_the_window_with_the_recording() {
    if let Some(what) = lacking() {
        return machine::lacks("ctrl_c_in_the_terminal_closes_the_window_with_the_recording", &what);
    }
    let dir = tempfile::tempdir().expect("a folder");
    let display = Display::open();
    let mut program = open_on(&display, dir.path());
    display.xdotool(&["search", "--sync", "--onlyvisible", "--name", "Tenter"]);
    pause(2.0);
    let interrupt = Command::new("kill").args(["-INT", &program.0.id().to_string()]).status();
    assert!(interrupt.expect("kill runs").success());
    assert_eq!(program.end(Duration::from_mins(1)), Some(0));
    let text = std::fs::read_to_string(dir.path().join("done.ron")).expect("the recording");
    assert!(Recording::from_ron(&text).expect("a recording").steps > 0);
}

#[test]
fn a_mesh_that_is_refused_at_its_end_closes_the_window_with_one_line() {
    if let Some(what) = lacking() {
        return machine::lacks("a_mesh_that_is_refused_at_its_end_closes_the_window_with_one_line", &what);
    }
    let dir = tempfile::tempdir().expect("a folder");
    let display = Display::open();
    // So long that the window is there before the end is read.
    let mut text = "v 0 0 0\nv 1 0 0\nv 0 0 1\n".repeat(300_000);
    text.push_str("f 1 2 3000000\n");
    std::fs::write(dir.path().join("long.obj"), text).expect("written");
    let mut program = on_display(&display, dir.path());
    let output = program.arg("long.obj").output().expect("runs");
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.lines().count() == 1 && told.contains("long.obj") && told.contains("3000000"), "{told}");
}

/// A workbench under which the device is destroyed in some pictures.
struct Losing {
    workbench: Workbench,
    /// Pictures before which and after which it is.
    lost: fn(u32) -> [bool; 2],
    pictures: u32,
    /// Devices that were given, besides the first; and steps that the cloth has taken at the end.
    told: Arc<Mutex<(u32, u64)>>,
}

impl Content for Losing {
    fn ui(&mut self, ui: &mut egui::Ui) {
        self.workbench.ui(ui);
        ui.ctx().request_repaint();
    }

    fn attach(&mut self, stage: &Stage<'_>) {
        self.told.lock().expect("a number").0 += 1;
        Content::attach(&mut self.workbench, stage);
    }

    fn draw(&mut self, canvas: &mut Canvas<'_>) {
        self.pictures += 1;
        let [before, after] = (self.lost)(self.pictures);
        if before {
            canvas.gpu.device.destroy();
        }
        self.workbench.draw(canvas);
        if after {
            canvas.gpu.device.destroy();
        }
        self.told.lock().expect("a number").1 = self.workbench.session.state().lanes[0].steps;
    }

    fn close_requested(&mut self) -> bool {
        true
    }

    fn is_finished(&self) -> bool {
        self.pictures >= 12
    }
}

/// Shows a sheet after 10 steps until 12 pictures were drawn; how the window closed, with what [`Losing`] tells.
fn show(lost: fn(u32) -> [bool; 2]) -> (Result<(), ShellError>, u32, u64) {
    let setup = LaneSetup {
        title: "sheet".to_owned(),
        scene: Scene::default(),
        place: Place::default(),
        file: None,
        origin: Origin::Start,
    };
    let mut engine = Engine::new(vec![setup.clone()]).expect("opens");
    let state = engine.state();
    let mut session = Session::new(Link::Here(Box::new(engine)), state, vec![setup]);
    session.order(Order::Step(10));
    let told = Arc::new(Mutex::new((0, 0)));
    let ours = Arc::clone(&told);
    let opening =
        Opening { title: "Tenter".to_owned(), size: [800.0, 600.0], maximized: false, samples: None };
    let closed = shell::run(opening, |stage| {
        let mut workbench = Workbench::new(session);
        workbench.attach(stage);
        Losing { workbench, lost, pictures: 0, told }
    });
    let (devices, steps) = *ours.lock().expect("numbers");
    (closed, devices, steps)
}

/// Runs a test of this file again in a process of its own, on a display of its own: a process has one event loop.
fn in_a_window_of_its_own(test: &str, show: impl FnOnce()) {
    const INSIDE: &str = "TENTER_TEST_IN_A_WINDOW";
    if std::env::var_os(INSIDE).is_some() {
        return show();
    }
    if let Some(what) = lacking() {
        return machine::lacks(test, &what);
    }
    let display = Display::open();
    let mut command = Command::new(std::env::current_exe().expect("this program"));
    command.args([test, "--exact", "--nocapture"]).env(INSIDE, "1").env("DISPLAY", &display.name);
    command.env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
    assert_eq!(Process::start(&mut command).end(Duration::from_mins(2)), Some(0));
}

#[test]
fn a_lost_device_is_replaced_and_the_cloth_stays() {
    in_a_window_of_its_own("a_lost_device_is_replaced_and_the_cloth_stays", || {
        let (closed, devices, steps) = show(|picture| [picture == 3, picture == 6]);
        closed.expect("closed by itself");
        assert_eq!((devices, steps), (2, 10));
    });
}

#[test]
fn a_device_that_fails_again_and_again_is_told_in_one_line() {
    in_a_window_of_its_own("a_device_that_fails_again_and_again_is_told_in_one_line", || {
        let (closed, devices, steps) = show(|_| [true, false]);
        let told = closed.expect_err("no picture was drawn").to_string();
        assert!(told.starts_with("the graphics device failed") && !told.contains('\n'), "{told}");
        assert_eq!((devices, steps), (3, 10));
    });
}

/// A window of any size and none at all: what is outdated or gone is drawn into again once it is there.
#[test]
fn a_window_is_resized_hidden_and_shown() {
    if let Some(what) = lacking() {
        return machine::lacks("a_window_is_resized_hidden_and_shown", &what);
    }
    let dir = tempfile::tempdir().expect("a folder");
    let display = Display::open();
    let mut program = open_on(&display, dir.path());
    let found = display.xdotool(&["search", "--sync", "--onlyvisible", "--name", "Tenter"]);
    let window = found.lines().next().expect("a window").trim().to_owned();
    for size in [["1", "1"], ["4000", "3000"], ["1", "3000"], ["1280", "800"]] {
        display.xdotool(&["windowsize", &window, size[0], size[1]]);
        pause(0.7);
        display.xdotool(&["windowunmap", &window]);
        pause(0.3);
        display.xdotool(&["windowmap", &window]);
        pause(0.5);
    }
    display.close(window.parse().expect("a number"));
    assert_eq!(program.end(Duration::from_mins(1)), Some(0));
}
