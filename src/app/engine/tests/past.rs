//! The past comes back to the bit, and what was done is done again.

use super::{add, engine, exchange, setup};
use crate::{
    app::engine::{Engine, Order, Origin},
    world::{Command, Recording, Script},
};
use glam::DVec3;
use std::{collections::BTreeMap, sync::Arc};

/// All lanes: steps, time, digest, and the scene that they have then.
type Moment = Vec<(u64, f64, u64, crate::scene::Scene)>;

fn moment(engine: &Engine) -> Moment {
    let lanes = engine.lanes.iter().map(|lane| &lane.world);
    lanes.map(|world| (world.steps(), world.time(), world.digest(), world.scene().clone())).collect()
}

fn place(engine: &mut Engine) -> f64 {
    engine.state().timeline.at
}

fn set(key: &str, value: &str) -> Order {
    Order::Apply(None, Command::Set { key: key.to_owned(), value: value.to_owned() })
}

/// Takes one beat after the other, and notes the moment of each.
fn run(engine: &mut Engine, beats: u32, moments: &mut Vec<(f64, Moment)>) {
    for _ in 0..beats {
        engine.take(Order::Step(1));
        moments.push((place(engine), moment(engine)));
    }
}

const LIVELY: &str =
    "(dt: 0.01, tearing: (enabled: true, max_ratio: 1.06), simulator: (id: \"bdf2\"), wind: (enabled: true))";

/// Two lanes of different dt, with hands, pins and settings; and what every beat came to.
fn lived() -> (Engine, Vec<(f64, Moment)>) {
    let mut engine = engine(&[LIVELY, "(dt: 0.004, precision: Single)"]);
    let mut moments = Vec::new();
    run(&mut engine, 20, &mut moments);
    engine.take(Order::Apply(None, Command::Grab { particles: vec![312] }));
    for i in 1..=10 {
        engine.take(Order::Drag(vec![(312, DVec3::new(0.1 * f64::from(i), 1.0, 0.0))]));
        run(&mut engine, 2, &mut moments);
    }
    engine.take(Order::Apply(None, Command::Release { particles: vec![312] }));
    run(&mut engine, 10, &mut moments);
    engine.take(set("gravity.magnitude", "4"));
    engine.take(Order::Apply(Some(1), Command::Set { key: "dt".to_owned(), value: "0.003".to_owned() }));
    run(&mut engine, 20, &mut moments);
    engine.take(Order::Apply(None, Command::Pin { particles: vec![600] }));
    run(&mut engine, 30, &mut moments);
    (engine, moments)
}

#[test]
fn every_moment_comes_back_to_the_bit_forth_and_back() {
    let (mut engine, moments) = lived();
    let frames = engine.timeline.remembered();
    assert!((frames.to - moments.last().expect("beats").0).abs() < 1e-12 && !frames.is_past());
    // Commands given at a moment belong to it or not; all else is the same: so between commands.
    let asked = (3..moments.len() - 1).step_by(7).filter(|i| ![19, 39, 49, 69].contains(i));
    for i in asked.clone().chain(asked.collect::<Vec<_>>().into_iter().rev()) {
        let (at, expected) = &moments[i];
        engine.take(Order::Scrub(*at));
        assert_eq!(&moment(&engine), expected, "beat {i}");
        assert_eq!(place(&mut engine), *at);
    }
    engine.take(Order::Scrub(f64::INFINITY));
    assert_eq!(&moment(&engine), &moments.last().expect("beats").1);
    assert!(!engine.timeline.is_past());
}

#[test]
fn going_on_from_a_moment_gives_the_same_bits_as_the_first_time() {
    let (mut engine, moments) = lived();
    // After the last command: what comes is only what the cloth does.
    let from = 75;
    engine.take(Order::Scrub(moments[from].0));
    for (at, expected) in &moments[from + 1..] {
        engine.take(Order::Step(1));
        assert_eq!((&moment(&engine), place(&mut engine)), (expected, *at));
    }
    // From before: the commands that came later are gone, and the log is that of what happened.
    engine.take(Order::Scrub(moments[10].0));
    engine.take(Order::Step(50));
    assert!(engine.log(0).is_empty());
    assert!((engine.timeline.remembered().to - moments[60].0).abs() < 1e-9);
    let (recording, place) = engine.recording(0).expect("a lane");
    assert!(replayed(&recording, place), "what is recorded is what happened");
}

fn replayed(recording: &Recording, place: crate::scene::Place) -> bool {
    let mut world = recording.start(place).expect("starts");
    let mut next = 0;
    recording.apply_due(&mut world, &mut next).expect("accepted");
    while world.steps() < recording.steps {
        world.step();
        recording.apply_due(&mut world, &mut next).expect("accepted");
    }
    recording.agrees(&world)
}

#[test]
fn whoever_holds_something_in_the_past_lets_go_only_when_time_goes_on() {
    let (mut engine, moments) = lived();
    engine.take(Order::Scrub(moments[30].0));
    assert_eq!(engine.lanes[0].world.held().count(), 1);
    engine.take(Order::Scrub(moments[45].0));
    assert_eq!(&moment(&engine), &moments[45].1, "nothing has been let go on the way");
    engine.take(Order::Scrub(moments[30].0));
    engine.take(Order::Step(1));
    assert_eq!(engine.lanes[0].world.held().count(), 0);
    let (recording, place) = engine.recording(0).expect("a lane");
    assert!(replayed(&recording, place));
}

#[test]
fn little_memory_keeps_fewer_states_and_still_leads_to_every_moment() {
    let (mut engine, moments) = lived();
    let frames = engine.timeline.remembered();
    let one = 3 * 625 * 2 * (8 + 4) + 2 * 3 * 625 * 8;
    engine.take(Order::Remember(one));
    let fewer = engine.timeline.remembered();
    assert!(fewer.bytes[0] <= fewer.bytes[1].max(2 * one) && fewer.bytes[0] <= frames.bytes[0]);
    engine.take(Order::Scrub(moments[15].0));
    // Computing time decides how far states may stand apart: where all of this took more than two seconds, the first has gone, at
    // the latest when the present was kept for the way back.
    if engine.timeline.remembered().from == frames.from {
        assert_eq!(&moment(&engine), &moments[15].1);
    }
    engine.take(Order::Remember(1));
    assert!(engine.timeline.remembered().from > frames.from, "only the last state is left");
    engine.take(Order::Scrub(0.0));
    assert_eq!(&moment(&engine), &moments.last().expect("beats").1);
}

#[test]
fn both_sides_of_a_jump_come_back() {
    let mut engine = engine(&[LIVELY]);
    let mut moments = Vec::new();
    engine.take(Order::Keep(1));
    run(&mut engine, 40, &mut moments);
    engine.take(Order::Apply(None, Command::Reset));
    run(&mut engine, 40, &mut moments);
    engine.take(exchange(1));
    run(&mut engine, 40, &mut moments);
    engine.take(set("target.columns", "7"));
    run(&mut engine, 40, &mut moments);
    for i in [39, 38, 5, 45, 79, 85, 119, 130, 159] {
        engine.take(Order::Scrub(moments[i].0));
        assert_eq!(&moment(&engine), &moments[i].1, "beat {i}");
        let (recording, place) = engine.recording(0).expect("a lane");
        assert!(replayed(&recording, place), "beat {i}");
    }
}

#[test]
fn taking_an_edit_back_and_doing_it_again_keeps_the_recording_whole() {
    let mut engine = engine(&[LIVELY]);
    engine.take(Order::Step(10));
    engine.take(Order::Keep(1));
    engine.take(Order::Apply(None, Command::Grab { particles: vec![312] }));
    engine.take(Order::Drag(vec![(312, DVec3::new(0.0, 2.0, 0.0))]));
    engine.take(Order::Step(20));
    engine.take(Order::Apply(None, Command::Release { particles: vec![312] }));
    engine.take(Order::Step(5));
    for _ in 0..3 {
        engine.take(exchange(1));
        engine.take(Order::Step(3));
        let (recording, place) = engine.recording(0).expect("a lane");
        assert!(replayed(&recording, place));
    }
}

#[test]
fn a_lane_that_was_added_has_the_past_of_the_one_that_it_came_from() {
    let mut engine = engine(&["()"]);
    let mut moments = Vec::new();
    run(&mut engine, 30, &mut moments);
    engine.take(add("other", vec![("simulator.id".to_owned(), "\"verlet\"".to_owned())]));
    run(&mut engine, 30, &mut moments);
    assert_eq!(moments[59].1.len(), 2);
    engine.take(Order::Scrub(moments[45].0));
    assert_eq!(moment(&engine), moments[45].1);
    engine.take(Order::Scrub(moments[15].0));
    let both = moment(&engine);
    assert_eq!(both[0], moments[15].1[0]);
    assert_eq!(engine.lanes[1].world.positions(), engine.lanes[0].world.positions());
    assert_eq!(both[1].3.simulator.id, "verlet");
    engine.take(Order::Step(10));
    for lane in [0, 1] {
        let (recording, place) = engine.recording(lane).expect("a lane");
        assert!(replayed(&recording, place), "lane {lane}");
    }
    engine.take(Order::RemoveLane { lane: 0, number: 3 });
    engine.take(Order::Scrub(moments[10].0));
    assert_eq!(engine.lanes.len(), 1);
    assert_eq!(engine.lanes[0].world.scene().simulator.id, "verlet");
}

fn recorded() -> Recording {
    let (engine, _) = lived();
    engine.recording(0).expect("a lane").0
}

fn playing(recording: &Recording) -> Engine {
    let script = Arc::new(Script::from(recording));
    let mut setup = setup("()");
    setup.scene = recording.scene.clone();
    setup.origin = Origin::Script(script);
    Engine::new(vec![setup]).expect("opens")
}

fn to_the_end(engine: &mut Engine) -> String {
    engine.take(Order::Run(true));
    for _ in 0..100_000 {
        engine.take(Order::Step(1));
        if engine.replay().is_none() {
            return engine.state().news.expect("it is told").1;
        }
    }
    panic!("it does not end")
}

#[test]
fn a_recording_is_played_to_the_same_bits_also_after_looking_back() {
    let recording = recorded();
    let mut engine = playing(&recording);
    assert_eq!(engine.replay().map(|[time, _]| time), Some(0.0));
    engine.take(Order::Step(60));
    let moment = moment(&engine);
    let at = place(&mut engine);
    engine.take(Order::Step(20));
    engine.take(Order::Scrub(at - 0.3));
    engine.take(Order::Step(10));
    engine.take(Order::Scrub(at - 0.25));
    engine.take(Order::Step(25));
    assert_eq!(super::past::moment(&engine), moment);
    assert!(to_the_end(&mut engine).contains("bit for bit"));
    assert_eq!(format!("{:016x}", engine.lanes[0].world.digest()), recording.digest);
}

#[test]
fn the_same_hands_take_another_cloth_beside_the_recorded_one() {
    let recording = recorded();
    let mut engine = playing(&recording);
    engine.take(add("finer", vec![("dt".to_owned(), "0.002".to_owned())]));
    engine.take(add("other", vec![("simulator.id".to_owned(), "\"rk4\"".to_owned())]));
    let told = to_the_end(&mut engine);
    assert!(told.contains("bit for bit"), "the first lane is as recorded: {told}");
    assert_eq!(format!("{:016x}", engine.lanes[0].world.digest()), recording.digest);
    let times: BTreeMap<usize, f64> = engine.lanes.iter().map(|lane| lane.world.time()).enumerate().collect();
    assert!(times.values().all(|time| (time - times[&0]).abs() < 0.002 + 1e-9), "{times:?}");
    assert_eq!(engine.lanes[2].world.scene().simulator.id, "rk4");
    for lane in &engine.lanes {
        let grabs = lane.world.log();
        let grab = grabs.iter().find(|entry| matches!(entry.command, Command::Grab { .. })).expect("a grab");
        let dt = if lane.world.scene().dt < 0.005 { 0.002 } else { 0.01 };
        assert_eq!(grab.step, (0.2_f64 / dt).round() as u64, "the same time on every lane");
    }
}

#[test]
fn taking_hold_oneself_ends_a_replay_and_a_setting_does_not() {
    let mut engine = playing(&recorded());
    engine.take(Order::Step(5));
    engine.take(set("gravity.magnitude", "7"));
    engine.take(Order::Step(80));
    assert!(engine.replay().is_some());
    assert_eq!(engine.lanes[0].world.scene().gravity.magnitude, 7.0, "what was recorded is left out");
    engine.take(Order::Apply(None, Command::Grab { particles: vec![0] }));
    assert!(engine.replay().is_none());
}

#[test]
fn everything_is_played_again_from_the_start() {
    let (mut engine, moments) = lived();
    let end = moment(&engine);
    engine.take(Order::Keep(9));
    engine.take(Order::Again);
    assert!(engine.lanes.iter().all(|lane| lane.world.time() == 0.0));
    assert!(to_the_end(&mut engine).contains("bit for bit"));
    let digests = |moment: &Moment| moment.iter().map(|lane| lane.2).collect::<Vec<_>>();
    assert_eq!(digests(&moment(&engine)), digests(&end));
    engine.take(exchange(9));
    assert_eq!(moment(&engine), end);
    engine.take(Order::Scrub(moments[15].0));
    assert_eq!(moment(&engine), moments[15].1);
}
