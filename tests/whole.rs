//! A process that is killed while it writes leaves whole files: scenes, recordings, what is saved by itself, and exports.
//!
//! The test starts itself again as the process that writes, and kills it 200 times at moments drawn by a seed. What is then there
//! must be whole, whatever is written next to it under names that nobody reads.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use tenter::app::{
    autosave::Saved,
    engine::{Engine, LaneSetup, Order, Origin},
    exporting::{Exporting, Wish},
    files::Files,
    session::{Link, Session},
};
use tenter::scene::{Place, Scene, UNFINISHED};
use tenter::world::{Command as Act, Recording};

const FOLDER: &str = "TENTER_WRITES_INTO";
const KILLS: u64 = 200;
/// Begins the name of a folder that the writer itself takes away.
const GONE: &str = "gone-";
const SCENE: &str = "(target: Grid(columns: 16, rows: 16, spacing: 1.0, plane: Horizontal))";
/// Frames of the exports: from 0 to 0.2 s at 25 a second.
const FRAMES: usize = 6;

/// Does nothing unless the other test has said where to write; then it writes until it is killed.
#[test]
fn writes_until_it_is_killed() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else { return };
    let setup = LaneSetup {
        title: "mine".to_owned(),
        scene: Scene::from_ron(SCENE).expect("a scene"),
        place: Place::default(),
        file: None,
        origin: Origin::Start,
    };
    let mut engine = Engine::new(vec![setup.clone()]).expect("opens");
    let mut drafted = Engine::new(vec![setup.clone()]).expect("opens");
    let state = engine.state();
    let mut session = Session::new(Link::Here(Box::new(engine)), state, vec![setup]);
    let mut files = Files::default();
    println!("ready");
    for cycle in 0_u64.. {
        let gravity = Act::Set { key: "gravity.magnitude".to_owned(), value: (cycle % 9 + 1).to_string() };
        for order in [Order::Apply(None, gravity), Order::Step(2)] {
            session.order(order.clone());
            drafted.take(order);
        }
        session.refresh();
        files.save(&session, &folder.join("scene.ron"), None);
        Files::record(&mut session, &folder.join("recording.ron"));
        drafted.draft().expect("something was done").write(&folder.join("saved.ron")).expect("written");
        let frames = folder.join(format!("frames{}", std::process::id()));
        // Taken away under another name: a kill in the middle of that leaves part of a folder.
        let gone = folder.join(format!("{GONE}{cycle}"));
        if std::fs::rename(&frames, &gone).is_ok() {
            let _ = std::fs::remove_dir_all(&gone);
        }
        for name in ["film.glb", "film.pc2", "film.csv", &frames.with_extension("obj").to_string_lossy()] {
            let wish = Wish {
                scene: session.scene().clone(),
                place: Place::default(),
                path: folder.join(name),
                seconds: 0.2,
                fps: 25.0,
                size: None,
            };
            let mut export = Exporting::start(wish, || {}).expect("starts");
            while export.ended().is_none() {
                std::thread::yield_now();
            }
        }
    }
}

/// What is wrong with a file, if anything is; nothing with one that is told to be unfinished.
fn fault(path: &Path) -> Option<String> {
    let name = path.file_name().expect("a name").to_string_lossy().into_owned();
    let bytes = if path.is_dir() { Vec::new() } else { std::fs::read(path).expect("there") };
    let text = || String::from_utf8(bytes.clone()).map_err(|e| e.to_string());
    let number = |at: usize| {
        let word = bytes.get(at..at + 4).ok_or("too short")?;
        Ok::<_, String>(u32::from_le_bytes(word.try_into().expect("four bytes")) as usize)
    };
    let is = |sound: bool, what: &str| if sound { Ok(()) } else { Err(what.to_owned()) };
    let look = || match name.as_str() {
        "scene.ron" => {
            let scene = Scene::from_ron(&text()?).map_err(|e| e.to_string())?;
            is((1.0..=9.0).contains(&scene.gravity.magnitude) && text()?.ends_with('\n'), "another scene")
        }
        "recording.ron" => {
            let recording = Recording::from_ron(&text()?).map_err(|e| e.to_string())?;
            let mut world = recording.start(Place::default()).map_err(|e| e.to_string())?;
            let mut next = 0;
            recording.apply_due(&mut world, &mut next).map_err(|e| e.to_string())?;
            while world.steps() < recording.steps {
                world.step();
                recording.apply_due(&mut world, &mut next).map_err(|e| e.to_string())?;
            }
            is(recording.agrees(&world) && !recording.digest.is_empty(), "it ends in another state")
        }
        "saved.ron" => {
            let saved = Saved::read(path).map_err(|e| e.to_string())?;
            let engine = Engine::new(saved.setups()).map_err(|e| e.to_string())?;
            is(!engine.log(0).is_empty(), "nothing was done")
        }
        "film.glb" => is(bytes.starts_with(b"glTF") && number(8)? == bytes.len(), "its length"),
        "film.pc2" => {
            let (points, frames) = (number(16)?, number(28)?);
            is((points, frames) == (256, FRAMES) && bytes.len() == 32 + 12 * points * frames, "its length")
        }
        "film.csv" => is(text()?.ends_with('\n') && text()?.lines().count() == FRAMES + 1, "its rows"),
        _ if name.starts_with("frames") => {
            let files: Vec<PathBuf> =
                std::fs::read_dir(path).expect("a folder").flatten().map(|entry| entry.path()).collect();
            let vertices = |file: &PathBuf| {
                let text = std::fs::read_to_string(file).expect("text");
                text.lines().filter(|line| line.starts_with("v ")).count()
            };
            is(files.len() == FRAMES && files.iter().all(|file| vertices(file) == 256), "its frames")
        }
        _ => Err("nobody has written it".to_owned()),
    };
    look().err().map(|what| format!("{name}: {what}"))
}

#[test]
fn two_hundred_kills_leave_only_whole_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = std::env::current_exe().expect("this test");
    let (mut hits, mut seen, mut state) = (0, 0, 0x2545_f491_4f6c_dd1d_u64);
    for kill in 0..KILLS {
        let mut command = Command::new(&program);
        command.args(["--exact", "writes_until_it_is_killed", "--nocapture", "--test-threads=1"]);
        command.env(FOLDER, folder.path()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().expect("starts");
        let output = BufReader::new(child.stdout.take().expect("a pipe"));
        let ready = output.lines().map_while(Result::ok).any(|line| line.ends_with("ready"));
        assert!(ready, "kill {kill}: it has ended by itself");
        // Xorshift (Marsaglia 2003): the moments are the same in every run, as far as a machine's clock goes.
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        std::thread::sleep(Duration::from_micros(state % 60_000));
        child.kill().expect("killed");
        child.wait().expect("ended");
        let mut unfinished = false;
        for entry in std::fs::read_dir(folder.path()).expect("a folder").flatten() {
            let path = entry.path();
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.starts_with(GONE) {
                std::fs::remove_dir_all(&path).expect("removed");
                continue;
            }
            if name.starts_with(UNFINISHED) {
                unfinished = true;
                let gone =
                    if path.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
                gone.expect("removed");
                continue;
            }
            seen += 1;
            assert_eq!(fault(&path), None, "kill {kill}");
            if path.is_dir() {
                std::fs::remove_dir_all(&path).expect("removed");
            }
        }
        hits += u64::from(unfinished);
    }
    println!("{hits} of {KILLS} kills came while a file was being written; {seen} whole files were read");
    assert!(hits >= KILLS / 10, "only {hits} kills came while a file was being written");
    // The eyes that saw nothing would have seen it.
    for name in ["scene.ron", "recording.ron", "saved.ron", "film.glb", "film.pc2", "film.csv"] {
        let path = folder.path().join(name);
        let bytes = std::fs::read(&path).expect("it was written at least once");
        std::fs::write(&path, &bytes[..bytes.len() * 2 / 3]).expect("written");
        assert!(fault(&path).is_some(), "{name}");
    }
}
