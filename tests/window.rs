//! The workbench in a real window: started, a particle dragged with a mouse, another one pinned, saved, closed; then the recording
//! and the saved scene are looked at.
//!
//! The window opens on a virtual display (Xvfb) of its own, whose mouse and keys xdotool moves.

#![cfg(target_os = "linux")]

mod machine;

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tenter::scene::{Place, Scene};
use tenter::world::{Command as Act, Recording, World};
use x11rb::protocol::xproto::{AtomEnum, ClientMessageEvent, ConnectionExt, EventMask};

/// Ends with the test, whatever becomes of it.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // Ended already: that is what is wanted.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Process {
    fn start(command: &mut Command) -> Self {
        Self(command.spawn().expect("starts"))
    }

    /// Waits for its end; its exit code.
    fn end(&mut self, longest: Duration) -> Option<i32> {
        let start = Instant::now();
        while start.elapsed() < longest {
            if let Some(status) = self.0.try_wait().expect("a process") {
                return status.code();
            }
            sleep(Duration::from_millis(50));
        }
        panic!("the program has not ended after {longest:?}");
    }
}

/// A display without a screen.
struct Display {
    _server: Process,
    name: String,
}

impl Display {
    fn open() -> Self {
        // The server takes a free number and tells it.
        let mut command = Command::new("Xvfb");
        command.args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp"]);
        let mut server = Process::start(command.stdout(Stdio::piped()).stderr(Stdio::null()));
        let mut number = String::new();
        let output = server.0.stdout.take().expect("a pipe");
        BufReader::new(output).read_line(&mut number).expect("a number");
        Self { _server: server, name: format!(":{}", number.trim()) }
    }

    /// Runs xdotool; what it printed.
    fn xdotool(&self, args: &[&str]) -> String {
        let mut command = Command::new("timeout");
        command.args(["60", "xdotool"]).args(args).env("DISPLAY", &self.name);
        let output = command.output().expect("xdotool runs");
        assert!(output.status.success(), "xdotool {args:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Asks a window to close, as the cross in its frame does; xdotool only can through a window manager.
    fn close(&self, window: u32) {
        let (connection, _) = x11rb::connect(Some(&self.name)).expect("the display");
        let atom = |name: &str| {
            connection.intern_atom(false, name.as_bytes()).expect("sent").reply().expect("an atom").atom
        };
        let (protocols, delete) = (atom("WM_PROTOCOLS"), atom("WM_DELETE_WINDOW"));
        let offered = connection.get_property(false, window, protocols, AtomEnum::ATOM, 0, 9);
        let offered = offered.expect("sent").reply().expect("a property");
        assert!(offered.value32().expect("atoms").any(|atom| atom == delete), "the window cannot be closed");
        let event = ClientMessageEvent::new(32, window, protocols, [delete, 0, 0, 0, 0]);
        connection.send_event(false, window, EventMask::NO_EVENT, event).expect("sent");
        // An answer to a later request says that the server has read this one: it drops what a closed connection left.
        connection.get_input_focus().expect("sent").reply().expect("an answer");
    }
}

fn pause(seconds: f64) {
    sleep(Duration::from_secs_f64(seconds));
}

fn tenter(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tenter"));
    command.current_dir(folder);
    command
}

/// The workbench on the sheet, which is recorded.
fn open_on(display: &Display, folder: &Path) -> Process {
    let mut program = tenter(folder);
    program.args(["sheet", "--record", "done.ron"]);
    program.env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
    // Neither the user's settings nor a session's bus belong to the test.
    program.env("XDG_RUNTIME_DIR", folder).env("XDG_CONFIG_HOME", folder).env("XDG_DATA_HOME", folder);
    program.env("XDG_CACHE_HOME", folder).env("HOME", folder);
    Process::start(&mut program)
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
