//! Starts the program again and again on a display of its own.

#[path = "../../tests/display/mod.rs"]
mod display;

use display::{Display, Process};
use std::collections::HashSet;
use std::fs;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{ConnectionExt, ImageFormat};

const RUNS: usize = 10;
/// Colours that an empty screen does not have, but any picture of the workbench.
const COLOURS: usize = 50;
/// Until nothing more is loaded.
const REST: Duration = Duration::from_secs(5);

/// Starts the program and waits for its picture; how long that took, and its memory at rest, MB, where that is asked for.
fn start(display: &Display, rests: bool) -> (Duration, Option<f64>) {
    let (connection, screen) = x11rb::connect(Some(&display.name)).expect("the display");
    let root = connection.setup().roots[screen].root;
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = Command::new(env!("CARGO_BIN_EXE_tenter"));
    command.env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
    command.env("XDG_CONFIG_HOME", folder.path()).current_dir(folder.path()).stderr(Stdio::null());
    let begin = Instant::now();
    let program = Process::start(&mut command);
    loop {
        let image = connection.get_image(ImageFormat::Z_PIXMAP, root, 0, 0, 1280, 800, !0).expect("sent");
        let image = image.reply().expect("the screen").data;
        let colours: HashSet<&[u8]> = image.chunks_exact(4).collect();
        if colours.len() > COLOURS {
            break;
        }
        assert!(begin.elapsed() < Duration::from_mins(1), "nothing is drawn");
        sleep(Duration::from_millis(2));
    }
    let taken = begin.elapsed();
    let memory = rests.then(|| {
        sleep(REST);
        let status = fs::read_to_string(format!("/proc/{}/status", program.0.id())).expect("a process");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
        line.trim().trim_end_matches(" kB").trim().parse::<f64>().expect("a number") / 1000.0
    });
    (taken, memory)
}

/// Makes the system forget what it has read of files, which only root may.
fn forget_files() -> bool {
    let _ = Command::new("sync").status();
    fs::write("/proc/sys/vm/drop_caches", "3").is_ok()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Prints the figures with the machine.
pub fn all() {
    let cpu = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = cpu.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or("?");
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let adapter = tenter::app::gpu::Gpu::offscreen().map_or_else(|e| e.to_string(), |gpu| gpu.description());
    println!("{}, {cores} cores; {adapter}", name.trim_start_matches([' ', '\t', ':']));
    let display = Display::open();
    let milliseconds = |cold: bool| {
        let run = |_| {
            let is_cold = cold && forget_files();
            (cold == is_cold).then(|| 1e3 * start(&display, false).0.as_secs_f64())
        };
        (0..RUNS).map(run).collect::<Option<Vec<f64>>>().map(median)
    };
    if let Some(cold) = milliseconds(true) {
        println!("to the first picture, files not read before: {cold:.0} ms");
    }
    println!("to the first picture, files read before: {:.0} ms", milliseconds(false).unwrap_or(f64::NAN));
    let memory = (0..3).filter_map(|_| start(&display, true).1).collect();
    println!("memory at rest, {} s after that: {:.0} MB", REST.as_secs(), median(memory));
    let size = fs::metadata(env!("CARGO_BIN_EXE_tenter")).map_or(0, |data| data.len());
    println!("program: {:.1} MB", size as f64 / 1e6);
}
