//! A virtual display (Xvfb) of one's own, whose mouse and keys xdotool moves, and processes that end with whoever started them.
#![allow(dead_code, reason = "every user takes a part of this")]

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use x11rb::protocol::xproto::{AtomEnum, ClientMessageEvent, ConnectionExt, EventMask};

/// Ends with the test, whatever becomes of it.
pub struct Process(pub Child);

impl Drop for Process {
    fn drop(&mut self) {
        // Ended already: that is what is wanted.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Process {
    /// Starts it.
    pub fn start(command: &mut Command) -> Self {
        Self(command.spawn().expect("starts"))
    }

    /// Waits for its end; its exit code.
    pub fn end(&mut self, longest: Duration) -> Option<i32> {
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
pub struct Display {
    _server: Process,
    /// What `DISPLAY` is set to.
    pub name: String,
}

impl Display {
    /// Opens one.
    pub fn open() -> Self {
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
    pub fn xdotool(&self, args: &[&str]) -> String {
        let mut command = Command::new("timeout");
        command.args(["60", "xdotool"]).args(args).env("DISPLAY", &self.name);
        let output = command.output().expect("xdotool runs");
        assert!(output.status.success(), "xdotool {args:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Asks a window to close, as the cross in its frame does; xdotool only can through a window manager.
    pub fn close(&self, window: u32) {
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
