//! What is written comes back, and nobody writes over what another has left.

use super::*;
use crate::{
    app::engine::{Engine, Order},
    world::Command,
};
use glam::DVec3;

fn engine() -> Engine {
    let setup = LaneSetup::from(crate::scene::open("sheet").expect("a scene"));
    Engine::new(vec![setup]).expect("opens")
}

/// In the middle of a drag, with two lanes.
fn worked() -> Engine {
    let mut engine = engine();
    engine.take(Order::Apply(None, Command::Set { key: "gravity.magnitude".into(), value: "5".into() }));
    let (title, settings) = ("sheet".to_owned(), vec![("simulator.id".to_owned(), "\"verlet\"".to_owned())]);
    engine.take(Order::Step(5));
    engine.take(Order::AddLane { from: 0, at: 1, title, settings, back: None });
    engine.take(Order::Apply(None, Command::Grab { particles: vec![312] }));
    engine.take(Order::Drag(vec![(312, DVec3::new(0.0, 2.0, 0.0))]));
    engine.take(Order::Step(20));
    engine
}

fn wait(until: impl Fn() -> bool) {
    let start = Instant::now();
    while !until() {
        assert!(start.elapsed() < Duration::from_secs(20), "nothing happens");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_session_goes_on_from_what_was_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("1-0.ron");
    let mut engine = worked();
    engine.draft().expect("something was done").write(&file).expect("written");
    assert!(engine.draft().is_none(), "nothing has been done since");
    let saved = Saved::read(&file).expect("whole");
    assert_eq!(saved.title(), "sheet");
    assert!(saved.when().contains("UTC, "), "{}", saved.when());
    let mut again = Engine::new(saved.setups()).expect("opens");
    // The one lets go because whoever held it is gone, the other because it is told to.
    engine.take(Order::Apply(None, Command::Release { particles: vec![312] }));
    for engine in [&mut engine, &mut again] {
        engine.take(Order::Step(50));
    }
    let (state, restored) = (engine.state(), again.state());
    for (lane, restored) in state.lanes.iter().zip(&restored.lanes) {
        assert_eq!((&lane.scene, lane.time, lane.steps), (&restored.scene, restored.time, restored.steps));
        assert_eq!(lane.positions, restored.positions);
    }
    for lane in [0, 1] {
        let (done, _) = engine.recording(lane).expect("a lane");
        assert_eq!(again.recording(lane).expect("a lane").0, done, "scene, commands and every bit");
    }
}

#[test]
fn what_is_only_watched_is_not_written() {
    let mut engine = engine();
    engine.take(Order::Step(5));
    assert!(engine.draft().is_none());
}

#[test]
fn what_is_damaged_is_told_in_a_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("1-0.ron");
    assert!(Saved::read(&file).is_err());
    worked().draft().expect("a draft").write(&file).expect("written");
    let text = std::fs::read_to_string(&file).expect("text");
    for bad in [&text[..text.len() / 2], &text.replacen("format: 1", "format: 9", 1), "()"] {
        std::fs::write(&file, bad).expect("written");
        let refused = Saved::read(&file).expect_err("damaged").to_string();
        assert!(refused.contains("1-0.ron") && !refused.contains('\n'), "{refused}");
    }
    let state = text.find("state: \"").expect("a state") + 20;
    std::fs::write(&file, format!("{}AAAA{}", &text[..state], &text[state + 4..])).expect("written");
    let saved = Saved::read(&file).expect("it is RON all the same");
    // LZ4 has no checksum: either it is seen, or some particle starts elsewhere; nothing breaks.
    if let Ok(mut engine) = Engine::new(saved.setups()) {
        engine.take(Order::Step(2));
    }
}

#[test]
fn a_thread_writes_and_takes_away_at_the_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut autosave = Autosave::start(folder.path()).expect("starts");
    let written = autosave.written();
    let mut engine = worked();
    autosave.put(engine.draft());
    wait(|| written.count() == 1);
    assert!(Slot::left_behind(folder.path()).is_empty(), "it is in use");
    engine.take(Order::Step(1));
    autosave.put(engine.draft());
    wait(|| written.count() == 2);
    written.end();
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
}

#[test]
fn what_cannot_be_written_is_told_once_and_tried_again() {
    let above = tempfile::tempdir().expect("a folder");
    let folder = above.path().join("autosave");
    let mut autosave = Autosave::start(&folder).expect("starts");
    let written = autosave.written();
    std::fs::remove_dir_all(&folder).expect("removed");
    let mut engine = worked();
    autosave.put(engine.draft());
    let mut told = None;
    let start = Instant::now();
    while told.is_none() && start.elapsed() < Duration::from_secs(20) {
        told = autosave.failure();
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(told.is_some_and(|why| why.contains("cannot be written") && !why.contains('\n')));
    engine.take(Order::Step(1));
    autosave.put(engine.draft());
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!((autosave.failure(), written.count()), (None, 0), "it is told only once");
    std::fs::create_dir(&folder).expect("a folder");
    // Nothing is done any more: it writes what it has.
    wait(|| written.count() == 1);
}

#[test]
fn sessions_keep_out_of_each_others_way() {
    let folder = tempfile::tempdir().expect("a folder");
    let [first, second] = [(); 2].map(|()| Slot::take(folder.path()).expect("a slot"));
    assert_ne!(first.file(), second.file());
    let draft = worked().draft().expect("a draft");
    draft.write(first.file()).expect("written");
    draft.write(second.file()).expect("written");
    let path = first.file().to_owned();
    // As if its process had been killed.
    drop(first);
    let left = Slot::left_behind(folder.path());
    assert_eq!(left.iter().map(Slot::file).collect::<Vec<_>>(), [path.as_path()]);
    assert!(Slot::left_behind(folder.path()).is_empty(), "one session restores it, not two");
    let third = Slot::take(folder.path()).expect("a slot");
    assert!(third.file() != path && third.file() != second.file(), "what was left is not written over");
    left[0].clear();
    assert!(!path.exists());
}
