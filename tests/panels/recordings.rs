//! The timeline, recordings that are played, and what an earlier session has left.

use super::{click, lane, message, open, press, scene, step, type_path};
use egui::{Key, Modifiers, Role};
use egui_kittest::kittest::Queryable;
use tenter::app::{
    autosave::{Saved, Slot},
    engine::{Engine, LaneSetup, Order, Origin},
    panels::Action,
    session::Session,
};
use tenter::scene::{Place, Scene};
use tenter::world::Recording;

fn session(window: &mut super::Window) -> &mut Session {
    &mut window.state_mut().session
}

fn scrub(window: &mut super::Window, to: f64) {
    super::set(window, "Timeline position", to);
}

#[test]
fn the_timeline_shows_what_was_and_time_goes_on_from_there() {
    let mut window = open("()");
    step(&mut window, 50);
    let (then, at) = (lane(&window, 0).positions.clone(), window.state().session.state().timeline.at);
    step(&mut window, 50);
    let (now, end) = (lane(&window, 0).positions.clone(), window.state().session.state().timeline.to);
    scrub(&mut window, at);
    assert_eq!((lane(&window, 0).time, &lane(&window, 0).positions), (1.0, &then));
    window.get_by_label_contains("-1.00 s");
    click(&mut window, "Latest");
    assert_eq!(lane(&window, 0).positions, now);
    scrub(&mut window, at);
    assert_eq!(window.state().session.state().timeline.to, end, "nothing is forgotten by looking");
    step(&mut window, 20);
    assert!(window.state().session.state().timeline.to < end, "what came after is");
    step(&mut window, 30);
    assert_eq!(lane(&window, 0).positions, now, "the same bits as the first time");
    step(&mut window, 7);
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!((lane(&window, 0).time, &lane(&window, 0).positions), (2.0, &now), "{}", message(&window));
}

#[test]
fn all_lanes_go_back_together_and_an_edit_in_the_past_goes_on_from_there() {
    let mut window = open("()");
    step(&mut window, 10);
    press(&mut window, Modifiers::COMMAND, Key::L);
    super::choose(&mut window, "Method", "RK4");
    step(&mut window, 20);
    let (at, then) =
        (window.state().session.state().timeline.at, [0, 1].map(|i| lane(&window, i).positions.clone()));
    step(&mut window, 20);
    scrub(&mut window, at);
    assert_eq!([0, 1].map(|i| lane(&window, i).positions.clone()), then);
    click(&mut window, "Wind enabled");
    assert!(!window.state().session.state().timeline.is_past());
    assert!(scene(&window).wind.enabled);
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert!(!scene(&window).wind.enabled);
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert!((lane(&window, 0).time - 1.0).abs() < 1e-9, "back to where one looked back from");
}

#[test]
fn the_timeline_takes_the_memory_that_it_is_given() {
    let mut window = open("()");
    window.run_steps(3);
    assert_eq!(window.state().session.state().timeline.bytes[1], 256_000_000);
    window.state_mut().files.preferences.timeline = 3;
    window.run_steps(3);
    step(&mut window, 200);
    let [used, allowed] = window.state().session.state().timeline.bytes;
    assert!(allowed == 3_000_000 && used <= allowed && used > 0);
}

#[test]
fn a_recording_is_saved_and_replayed_beside_another_method() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("drag.ron");
    let mut window = open("()");
    step(&mut window, 5);
    session(&mut window).grab(312);
    for i in 0..10 {
        session(&mut window).drag(glam::DVec3::new(0.0, 0.2 * f64::from(i), 0.0));
        step(&mut window, 2);
    }
    session(&mut window).release();
    step(&mut window, 30);
    let end = lane(&window, 0).positions.clone();
    window.state_mut().perform(&Action::Record);
    window.run_steps(3);
    type_path(&mut window, &file, "Save");
    let recorded = Recording::from_ron(&std::fs::read_to_string(&file).expect("text")).expect("a recording");
    assert_eq!(recorded.steps, 55);
    window.state_mut().perform(&Action::Replay);
    window.run_steps(3);
    type_path(&mut window, &file, "Replay");
    assert_eq!(window.state().session.title(), "drag.ron", "{}", message(&window));
    assert_eq!((lane(&window, 0).steps, window.state().session.running()), (0, false));
    session(&mut window).add_lane(Some("rk4"));
    window.run_steps(3);
    step(&mut window, 20);
    window.get_by_label_contains("replay 0.4 of 1.1 s");
    step(&mut window, 60);
    assert!(message(&window).contains("bit for bit"), "{}", message(&window));
    assert_eq!((lane(&window, 0).steps, &lane(&window, 0).positions), (55, &end));
    assert_eq!(lane(&window, 1).scene.simulator.id, "rk4");
    assert!(lane(&window, 1).distance.is_some_and(|[rms, _]| rms > 0.0));
    // And once more, from the start, both lanes as they were in the end.
    window.state_mut().perform(&Action::Again);
    window.run_steps(3);
    assert_eq!(lane(&window, 1).time, 0.0);
    step(&mut window, 80);
    assert_eq!(lane(&window, 0).positions, end);
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!((lane(&window, 0).steps, &lane(&window, 0).positions), (55, &end));
}

#[test]
fn what_is_no_recording_is_refused_in_a_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.ron");
    std::fs::write(&file, "(dt: 0.01)").expect("written");
    let mut window = open("()");
    for path in [file.as_path(), &folder.path().join("nothing.ron")] {
        window.state_mut().perform(&Action::Replay);
        window.run_steps(3);
        type_path(&mut window, path, "Replay");
        assert_eq!(window.state().session.title(), "test");
        assert!(message(&window).contains(".ron"), "{}", message(&window));
    }
}

/// What a session left that was killed after 30 steps with wind; where it hung.
fn left(folder: &std::path::Path) -> Vec<[f32; 3]> {
    let setup = LaneSetup {
        title: "cape".to_owned(),
        scene: Scene::from_ron("(dt: 0.01)").expect("a scene"),
        place: Place::default(),
        file: Some(folder.join("cape.ron")),
        origin: Origin::Start,
    };
    let mut engine = Engine::new(vec![setup]).expect("opens");
    let command = tenter::world::Command::Set { key: "wind.enabled".to_owned(), value: "true".to_owned() };
    engine.take(Order::Apply(None, command));
    engine.take(Order::Step(30));
    let slot = Slot::take(folder).expect("a slot");
    engine.draft().expect("a draft").write(slot.file()).expect("written");
    assert!(Saved::read(slot.file()).is_ok());
    engine.state().lanes[0].positions.to_vec()
}

#[test]
fn what_an_earlier_session_left_is_restored() {
    let folder = tempfile::tempdir().expect("a folder");
    let hung = left(folder.path());
    let mut window = open("()");
    window.state_mut().restore.look_now(folder.path());
    window.run_steps(3);
    window.get_by_label("Tenter ended without closing");
    window.get_by_label_contains("Restore cape as of ");
    press(&mut window, Modifiers::NONE, Key::Space);
    assert!(!window.state().session.running(), "keys wait for the answer");
    click(&mut window, "Restore");
    assert!(scene(&window).wind.enabled);
    assert_eq!((lane(&window, 0).steps, &**lane(&window, 0).positions), (30, &hung[..]));
    let session = &window.state().session;
    assert!(session.is_unsaved() && !session.running());
    assert_eq!((session.title(), session.file()), ("cape", Some(&folder.path().join("cape.ron"))));
    assert!(window.query_by_label("Restore").is_none());
    // It is the session's own now, and goes with it.
    window.state_mut().session.has_saved(folder.path().join("cape.ron"));
    press(&mut window, Modifiers::COMMAND, Key::Q);
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
}

#[test]
fn what_an_earlier_session_left_is_discarded_or_waits() {
    let folder = tempfile::tempdir().expect("a folder");
    left(folder.path());
    let mut window = open("()");
    window.state_mut().restore.look_now(folder.path());
    window.run_steps(3);
    click(&mut window, "Later");
    assert!(window.query_by_label("Tenter ended without closing").is_none());
    window.state_mut().restore.look_now(folder.path());
    window.run_steps(3);
    click(&mut window, "Discard");
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    assert_eq!(window.state().session.title(), "test");
    assert!(window.query_by_role_and_label(Role::Button, "Discard").is_none());
}
