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

/// What was seen of one start.
struct Seen {
    /// Until the first picture, ms.
    taken: f64,
    /// The files that the program has mapped, itself included.
    files: HashSet<String>,
    /// Memory at rest, MB, where that was waited for.
    memory: f64,
}

/// Starts the program and waits for its picture, and then until it is at rest where that is asked for.
fn start(display: &Display, connection: &impl Connection, rests: bool) -> Seen {
    let root = connection.setup().roots[0].root;
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
    let taken = 1e3 * begin.elapsed().as_secs_f64();
    if rests {
        sleep(REST);
    }
    let told = |of: &str| fs::read_to_string(format!("/proc/{}/{of}", program.0.id())).expect("a process");
    let maps = told("maps");
    let files = maps.lines().filter_map(|line| line.find(" /").map(|at| line[at + 1..].to_owned())).collect();
    let status = told("status");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
    let kilobytes: f64 = line.trim().trim_end_matches(" kB").trim().parse().expect("a number");
    Seen { taken, files, memory: kilobytes / 1000.0 }
}

/// Makes the system forget what it has read of files that nobody else has mapped.
fn forget(files: &HashSet<String>) {
    for file in files {
        let mut command = Command::new("dd");
        let done = command
            .arg(format!("if={file}"))
            .args(["iflag=nocache", "count=0"])
            .stderr(Stdio::null())
            .status();
        assert!(done.is_ok(), "dd is missing");
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Prints the figures with the machine.
pub fn all() {
    tenter::app::gpu::quiet_drivers();
    let cpu = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = cpu.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or("?");
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let adapter = tenter::app::gpu::Gpu::offscreen().map_or_else(|e| e.to_string(), |gpu| gpu.description());
    println!("{}, {cores} cores; {adapter}", name.trim_start_matches([' ', '\t', ':']));
    let display = Display::open();
    // Kept for all runs: a server without a client begins anew.
    let (connection, _) = x11rb::connect(Some(&display.name)).expect("the display");
    let files = start(&display, &connection, false).files;
    let cold = (0..RUNS).map(|_| {
        forget(&files);
        start(&display, &connection, false).taken
    });
    println!("to the first picture, program and libraries read from disk: {:.0} ms", median(cold.collect()));
    let warm = (0..RUNS).map(|_| start(&display, &connection, false).taken);
    println!("to the first picture, in memory already: {:.0} ms", median(warm.collect()));
    let memory = (0..3).map(|_| start(&display, &connection, true).memory);
    println!("memory at rest, {} s after that: {:.0} MB", REST.as_secs(), median(memory.collect()));
    let size = fs::metadata(env!("CARGO_BIN_EXE_tenter")).map_or(0, |data| data.len());
    println!("program: {:.1} MB", size as f64 / 1e6);
}
