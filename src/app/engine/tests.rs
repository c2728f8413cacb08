//! Orders and the states that come of them.

mod past;

use super::*;
use crate::{
    app::render::flag,
    scene::{Place, Scene},
};

fn setup(ron: &str) -> LaneSetup {
    let scene = Scene::from_ron(ron).expect("a scene");
    LaneSetup { title: "test".to_owned(), scene, place: Place::default(), file: None, origin: Origin::Start }
}

fn engine(scenes: &[&str]) -> Engine {
    Engine::new(scenes.iter().map(|ron| setup(ron)).collect()).expect("opens")
}

fn add(title: &str, settings: Vec<(String, String)>) -> Order {
    Order::AddLane { from: 0, at: usize::MAX, title: title.to_owned(), settings, back: None }
}

#[test]
fn two_identical_lanes_stay_equal_while_dragged() {
    let mut engine = engine(&["()", "()"]);
    engine.take(Order::Values(Values::Distance));
    engine.take(Order::Apply(None, Command::Grab { particles: vec![312] }));
    for i in 0..20 {
        engine.take(Order::Drag(vec![(312, DVec3::new(0.1 * f64::from(i), 2.0, 0.0))]));
        engine.take(Order::Step(3));
    }
    let state = engine.state();
    assert_eq!(state.lanes[1].distance, Some([0.0, 0.0]));
    assert!(state.lanes[0].positions[312][1] > 1.0);
    assert_eq!(state.refusal, None);
}

#[test]
fn lanes_of_different_dt_reach_the_same_times() {
    let mut engine = engine(&["(dt: 0.01)", "(dt: 0.002)", "(dt: 0.003)"]);
    engine.take(Order::Step(30));
    let times = engine.state().lanes.iter().map(|lane| lane.time).collect::<Vec<_>>();
    assert!((times[0] - 0.3).abs() < 1e-9 && (times[1] - 0.3).abs() < 1e-9, "{times:?}");
    assert!((times[2] - 0.3).abs() < 0.003, "{times:?}");
}

#[test]
fn lanes_meet_again_after_one_was_broken_off() {
    let endless = "(simulator: (id: \"xpbd\", params: {\"substeps\": 100000, \"iterations\": 100000}))";
    let mut engine = engine(&["()", endless]);
    let stop = engine.stop();
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(50));
        stop.store(true, Ordering::Relaxed);
    });
    engine.take(Order::Step(3));
    engine.take(Order::Run(false));
    let steps = |engine: &mut Engine| engine.state().lanes.iter().map(|lane| lane.steps).collect::<Vec<_>>();
    assert_eq!(steps(&mut engine), [1, 0]);
    let (key, value) = ("simulator.id".to_owned(), "\"symplectic_euler\"".to_owned());
    engine.take(Order::Apply(Some(1), Command::Set { key, value }));
    engine.take(Order::Step(1));
    let state = engine.state();
    assert_eq!(state.lanes[0].steps, 2);
    assert_eq!(state.lanes[0].positions, state.lanes[1].positions);
}

#[test]
fn a_refused_order_changes_nothing_and_is_told() {
    let mut engine = engine(&["()"]);
    engine.take(Order::Apply(None, Command::Set { key: "dt".to_owned(), value: "-1".to_owned() }));
    let state = engine.state();
    assert_eq!(state.lanes[0].scene, Scene::default());
    assert_eq!(state.refusal.map(|(order, _)| order), Some(1));
}

#[test]
fn lanes_that_are_given_up_are_not_opened() {
    let mut engine = engine(&["()"]);
    engine.given_up().until(1);
    // Long enough to be given up on the way.
    engine.take(Order::Open(vec![setup("(target: Grid(columns: 700, rows: 700))")]));
    let state = engine.state();
    assert_eq!(state.refusal.map(|(order, _)| order), Some(1));
    assert_eq!(state.lanes[0].positions.len(), 625);
    engine.take(Order::Open(vec![setup("(target: Grid(columns: 7, rows: 7))")]));
    assert_eq!(engine.state().lanes[0].positions.len(), 49);
}

#[test]
fn an_engine_without_lanes_waits_for_its_first() {
    let mut engine = Engine::empty(None);
    engine.take(Order::Run(true));
    engine.advance(Duration::from_millis(100), || false);
    assert!(engine.state().lanes.is_empty() && engine.recording(0).is_none() && engine.draft().is_none());
    engine.take(Order::Open(vec![setup("()")]));
    assert_eq!(engine.state().lanes[0].positions.len(), 625);
}

#[test]
fn time_passes_only_while_running_and_at_the_speed_asked_for() {
    let mut engine = engine(&["()"]);
    engine.state();
    assert!(!engine.advance(Duration::from_millis(100), || false));
    engine.take(Order::Run(true));
    engine.take(Order::Speed(0.5));
    for _ in 0..10 {
        engine.advance(Duration::from_millis(100), || false);
    }
    let time = engine.state().lanes[0].time;
    assert!((time - 0.5).abs() < 0.021, "{time}");
}

#[test]
fn a_burst_pauses_and_going_back_gives_a_good_state() {
    let mut engine = engine(&["(simulator: (id: \"explicit_euler\", params: {}), dt: 0.05)"]);
    engine.take(Order::Run(true));
    for _ in 0..2000 {
        engine.advance(Duration::from_millis(50), || false);
        if !engine.running {
            break;
        }
    }
    let burst = engine.state();
    assert!(burst.lanes[0].health.is_diverged() && !burst.running);
    engine.take(Order::GoBack(0.5));
    let back = engine.state();
    assert!(back.lanes[0].time < burst.lanes[0].time && !back.lanes[0].health.is_diverged());
}

#[test]
fn what_has_burst_goes_on_once_something_is_set_and_tells_when_it_bursts_again() {
    let set = |value: &str| {
        let key = "springs.stretch.stiffness".to_owned();
        Order::Apply(None, Command::Set { key, value: value.to_owned() })
    };
    let mut engine = engine(&["()"]);
    let advance = |engine: &mut Engine| {
        for _ in 0..200 {
            engine.advance(Duration::from_millis(50), || false);
        }
        let state = engine.state();
        (state.running, state.lanes[0].health.is_diverged())
    };
    engine.take(Order::Run(true));
    // As a hand on a slider does.
    for stiffness in ["1e5", "3e5", "1e6"] {
        engine.take(set(stiffness));
        assert_eq!(advance(&mut engine), (false, true), "{stiffness}");
    }
    engine.take(Order::GoBack(2.0));
    assert!(!engine.state().running);
    engine.take(set("1000"));
    assert_eq!(advance(&mut engine), (true, false));
    // Whoever has paused it or takes single steps does so still.
    engine.take(Order::Step(1));
    engine.take(set("1e6"));
    engine.take(Order::Step(200));
    engine.take(set("1e5"));
    assert!(!engine.state().running);
}

#[test]
fn a_lane_added_while_time_passes_goes_on_from_the_same_state() {
    let mut engine = engine(&["()"]);
    engine.take(Order::Step(20));
    engine.take(add("same", Vec::new()));
    engine.take(Order::Apply(None, Command::Grab { particles: vec![300] }));
    for i in 0..10 {
        engine.take(Order::Drag(vec![(300, DVec3::new(0.0, 0.2 * f64::from(i), 1.0))]));
        engine.take(Order::Step(2));
    }
    let state = engine.state();
    assert_eq!(state.refusal, None);
    assert_eq!(state.lanes[1].distance, Some([0.0, 0.0]));
    assert_eq!(state.lanes[0].time, state.lanes[1].time);
    let settings = vec![("simulator.id".to_owned(), "\"verlet\"".to_owned())];
    engine.take(add("other", settings));
    engine.take(Order::Step(10));
    let state = engine.state();
    assert!(state.lanes[2].distance.is_some_and(|[rms, _]| rms > 0.0));
}

fn exchange(number: u64) -> Order {
    Order::Exchange { number, otherwise: Vec::new() }
}

#[test]
fn exchanging_states_goes_back_and_forth() {
    let mut engine = engine(&["(tearing: (enabled: true, max_ratio: 1.05))"]);
    engine.take(Order::Keep(7));
    engine.take(Order::Step(150));
    let torn = engine.state();
    assert!(torn.lanes[0].broken > 0);
    engine.take(exchange(7));
    let whole = engine.state();
    assert_eq!((whole.lanes[0].broken, whole.lanes[0].time), (0, 0.0));
    assert_eq!(whole.lanes[0].geometry.triangles.len(), 2 * 24 * 24);
    engine.take(exchange(7));
    assert_eq!(engine.state().lanes[0].positions, torn.lanes[0].positions);
    engine.take(exchange(8));
    assert!(engine.state().refusal.is_some());
}

#[test]
fn a_hand_moves_at_once_while_time_stands_still_and_throws_nothing() {
    let mut engine = engine(&["(gravity: (enabled: false))"]);
    let to = DVec3::new(0.0, 0.5, 0.0);
    engine.take(Order::Apply(None, Command::Grab { particles: vec![312] }));
    engine.take(Order::Drag(vec![(312, to)]));
    engine.take(Order::Apply(None, Command::Release { particles: vec![312] }));
    assert_eq!(engine.state().lanes[0].positions[312], to.as_vec3().to_array());
    engine.take(Order::Step(1));
    let state = engine.state();
    assert_eq!(state.lanes[0].positions[312], to.as_vec3().to_array());
    assert_eq!(state.lanes[0].flags[312], flag::GRABBED);
    engine.take(Order::Step(20));
    let state = engine.state();
    assert_eq!(state.lanes[0].flags[312], 0);
    assert!(state.lanes[0].positions[312][1] < 1.0, "{:?}", state.lanes[0].positions[312]);
    assert_eq!(state.refusal, None);
}

#[test]
fn a_new_target_starts_its_own_time() {
    let mut engine = engine(&["()"]);
    engine.take(Order::Step(50));
    let set = Command::Set { key: "target.columns".to_owned(), value: "10".to_owned() };
    engine.take(Order::Apply(None, set));
    engine.take(Order::Step(1));
    let state = engine.state();
    assert_eq!(state.lanes[0].positions.len(), 250);
    assert!((state.lanes[0].time - 0.02).abs() < 1e-9, "{}", state.lanes[0].time);
}

#[test]
fn going_back_keeps_what_was_set_since() {
    let mut engine = engine(&["()"]);
    engine.take(Order::Step(100));
    engine.take(Order::Apply(None, Command::Set { key: "dt".to_owned(), value: "0.01".to_owned() }));
    engine.take(Order::GoBack(1.0));
    let state = engine.state();
    assert_eq!(state.lanes[0].scene.dt, 0.01);
    assert!((state.lanes[0].time - 1.0).abs() < 0.11, "{}", state.lanes[0].time);
}

#[test]
fn a_large_cloth_has_its_limit_too_found_in_parts() {
    let mut engine = engine(&["(target: Grid(columns: 150, rows: 150, spacing: 1.0, plane: Horizontal))"]);
    let exact = engine.lanes[0].world.dt_limit(&engine.lanes[0].world.spectrum()).expect("a limit");
    assert_eq!(engine.state().lanes[0].limit, Limit::Unknown, "nobody waits for it");
    let mut states = 0;
    while engine.state().lanes[0].limit == Limit::Unknown {
        states += 1;
        assert!(states < 10_000, "it is never found");
        engine.limit_at = Instant::now();
    }
    let limit = engine.state().lanes[0].limit.dt().expect("a limit");
    assert!((limit / exact - 1.0).abs() < 1e-3, "{limit} instead of {exact}");
    let key = "simulator.id".to_owned();
    engine.take(Order::Apply(None, Command::Set { key, value: "\"rk4\"".to_owned() }));
    engine.limit_at = Instant::now() + Duration::from_mins(1);
    assert_eq!(engine.state().lanes[0].limit, Limit::Unknown, "another method has another limit");
}

/// Orders wait for the end of a beat: however small a dt is, there must be one soon.
#[test]
fn a_beat_has_an_end_whatever_the_steps() {
    let steps = |scenes: &[&str]| {
        let mut engine = engine(scenes);
        engine.take(Order::Step(3));
        engine.state().lanes.iter().map(|lane| lane.steps).collect::<Vec<_>>()
    };
    assert_eq!(steps(&["(dt: 1e-20)"]), [3]);
    assert_eq!(steps(&["(dt: 0.1)", "(dt: 0.001)"]), [3, 300]);
    let apart = steps(&["(dt: 0.1)", "(dt: 1e-20)"]);
    assert!(apart[0] <= 3 && apart[1] <= u64::from(3 * STEPS_OF_A_BEAT), "{apart:?}");
}
