//! What a user can do to a running cloth: hands, pins, settings, reset, tearing, recordings.
#![allow(clippy::unwrap_used)]

mod common;

use common::{PRECISIONS, all_finite, free, method, run, set, sheet, spring_methods, step, world};
use glam::DVec3;
use proptest::prelude::*;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tenter::forces::wind::Wind;
use tenter::lab::adaptive;
use tenter::params::{Info, Params, Visitor};
use tenter::scene::{Mass, Pin, Pins, Place, Precision, Scene, Target, Tearing, to_ron};
use tenter::simulators;
use tenter::world::{Command, Health, Recording, World};

fn grab(world: &mut World, particle: u32) {
    world.apply(Command::Grab { particles: vec![particle] }).unwrap();
}

fn drag(world: &mut World, particle: u32, to: DVec3, steps: u32) {
    world.apply(Command::Drag { particle, to, steps }).unwrap();
}

fn release(world: &mut World, particle: u32) {
    world.apply(Command::Release { particles: vec![particle] }).unwrap();
}

/// A sheet of 6 x 5 in wind, every method stable on it.
fn windy() -> Scene {
    Scene {
        target: sheet(6, 5, 1.0),
        wind: Wind { enabled: true, ..Wind::default() },
        dt: 2e-3,
        ..Scene::default()
    }
}

#[test]
fn a_held_particle_is_exactly_where_the_hand_is() {
    for entry in simulators::ALL {
        for precision in PRECISIONS {
            let mut world = world(&Scene { simulator: method(entry), precision, ..windy() });
            step(&mut world, 20);
            let rounded =
                |to: DVec3| if precision == Precision::Single { to.as_vec3().as_dvec3() } else { to };
            grab(&mut world, 20);
            let from = world.positions()[20];
            assert_eq!(world.velocities()[20], DVec3::ZERO, "{}: a grab stops it", entry.id);
            step(&mut world, 10);
            assert_eq!(world.positions()[20], from, "{}: it waits for the hand", entry.id);
            let to = DVec3::new(0.123_456_789, -1.1, 0.7);
            drag(&mut world, 20, to, 8);
            for n in 1..=8 {
                world.step();
                // Straight and even, up to rounding, and there at the end.
                let on_the_way = from.lerp(to, f64::from(n) / 8.0);
                assert!(world.positions()[20].distance(on_the_way) < 1e-6, "{} at {n}", entry.id);
            }
            assert_eq!(world.positions()[20], rounded(to), "{}", entry.id);
            step(&mut world, 10);
            assert_eq!(world.positions()[20], rounded(to), "{}: it stays", entry.id);
            assert_eq!(world.velocities()[20], DVec3::ZERO, "{}: the hand is still", entry.id);
            assert_eq!(world.held().collect::<Vec<_>>(), [20]);
        }
    }
}

#[test]
fn a_flick_throws_equally_at_30_and_at_240_frames_a_second() {
    let velocity = DVec3::new(3.0, -1.0, 0.5);
    for entry in simulators::ALL {
        for (rate, dt) in [(30u32, 1.0 / 240.0), (240, 1.0 / 240.0), (30, 1.0 / 30.0), (60, 1.0 / 960.0)] {
            let mut world = world(&Scene { simulator: method(entry), dt, ..free(sheet(1, 1, 1.0)) });
            grab(&mut world, 0);
            let steps = (1.0 / f64::from(rate) / dt).round() as u32;
            // Half a second of an even motion, one drag a frame.
            for frame in 1..=rate / 2 {
                drag(&mut world, 0, velocity * (f64::from(frame) / f64::from(rate)), steps);
                step(&mut world, u64::from(steps));
            }
            release(&mut world, 0);
            let thrown = world.velocities()[0];
            // An even motion has one mean: round-off of 2 m over a tenth of a second.
            assert!((thrown - velocity).length() < 1e-12, "{} at {rate}/s, dt {dt}: {thrown}", entry.id);
            let from = world.positions()[0];
            step(&mut world, 10);
            let flown = (world.positions()[0] - from) / (10.0 * dt);
            assert!((flown - velocity).length() < 1e-9, "{}: {flown}", entry.id);
        }
    }
}

#[test]
fn a_hand_that_has_rested_for_a_tenth_of_a_second_lets_go_at_rest() {
    let mut world = world(&Scene { dt: 0.01, ..free(sheet(1, 1, 1.0)) });
    grab(&mut world, 0);
    drag(&mut world, 0, DVec3::X, 2);
    step(&mut world, 2 + 11);
    release(&mut world, 0);
    assert_eq!(world.velocities()[0], DVec3::ZERO);
    step(&mut world, 10);
    assert_eq!(world.positions()[0], DVec3::X);
    // Caught and let go within the same step: no time to measure a velocity in.
    grab(&mut world, 0);
    release(&mut world, 0);
    assert_eq!(world.velocities()[0], DVec3::ZERO);
}

#[test]
fn a_pinned_particle_stays_where_it_was_put_and_never_keeps_a_velocity() {
    for entry in simulators::ALL {
        let mut world = world(&Scene { simulator: method(entry), ..windy() });
        grab(&mut world, 0);
        let to = DVec3::new(-2.0, 0.3, -2.2);
        drag(&mut world, 0, to, 5);
        step(&mut world, 5);
        assert_ne!(world.velocities()[0], DVec3::ZERO);
        release(&mut world, 0);
        for _ in 0..50 {
            assert_eq!((world.positions()[0], world.velocities()[0]), (to, DVec3::ZERO), "{}", entry.id);
            world.step();
        }
        // A moving particle that is pinned stops, and is at rest when it is freed.
        let moving = 20;
        assert_ne!(world.velocities()[moving], DVec3::ZERO);
        world.apply(Command::Pin { particles: vec![20] }).unwrap();
        let there = world.positions()[moving];
        step(&mut world, 20);
        assert_eq!(
            (world.positions()[moving], world.velocities()[moving]),
            (there, DVec3::ZERO),
            "{}",
            entry.id
        );
        world.apply(Command::Free { particles: vec![20] }).unwrap();
        assert_eq!(world.velocities()[moving], DVec3::ZERO, "{}", entry.id);
        step(&mut world, 20);
        assert_ne!(world.positions()[moving], there, "{}: freed", entry.id);
        // Pinned in the middle of a throw.
        grab(&mut world, 20);
        drag(&mut world, 20, DVec3::new(1.0, 0.0, 1.0), 10);
        step(&mut world, 5);
        world.apply(Command::Pin { particles: vec![20] }).unwrap();
        release(&mut world, 20);
        let there = world.positions()[moving];
        step(&mut world, 20);
        assert_eq!(
            (world.positions()[moving], world.velocities()[moving]),
            (there, DVec3::ZERO),
            "{}",
            entry.id
        );
    }
}

#[test]
fn a_pulled_particle_comes_to_the_hand_as_a_critically_damped_spring_brings_it() {
    let (k, dt) = (100.0f64, 1e-3);
    let omega = k.sqrt();
    for entry in simulators::ALL {
        let mut world = world(&Scene { simulator: method(entry), dt, ..free(sheet(1, 1, 1.0)) });
        world.apply(Command::Pull { particles: vec![0], stiffness: k }).unwrap();
        drag(&mut world, 0, DVec3::X, 1);
        for _ in 0..2000 {
            world.step();
            let t = world.time();
            let exact = 1.0 - (1.0 + omega * t) * (-omega * t).exp();
            // |λ| of (x, v/ω) is at most ω + 2 sqrt(κ/m) = 3 ω, and twice the leading term of an error of order 1 is
            // |λ|² dt t exp(-ω t), which is never more than 9 ω dt / e.
            let error = (world.positions()[0].x - exact).abs();
            assert!(error <= 9.0 * omega * dt / std::f64::consts::E, "{} at {t}: {error}", entry.id);
        }
        // 20 time constants: (1 + 20) exp(-20) = 4e-8 is left.
        assert!((world.positions()[0] - DVec3::X).length() < 1e-7, "{}", entry.id);
        // Let go in the middle of a pull, it flies on as it is.
        drag(&mut world, 0, DVec3::Y, 1);
        step(&mut world, 100);
        let flying = world.velocities()[0];
        release(&mut world, 0);
        assert_eq!(world.velocities()[0], flying, "{}", entry.id);
        assert!(flying.length() > 0.1, "{}", entry.id);
    }
}

#[test]
fn a_pinned_particle_cannot_be_pulled_away() {
    for entry in simulators::ALL {
        let mut world = world(&Scene { simulator: method(entry), ..windy() });
        let there = world.positions()[0];
        world.apply(Command::Pull { particles: vec![0], stiffness: 1e3 }).unwrap();
        drag(&mut world, 0, DVec3::Y, 3);
        step(&mut world, 50);
        assert_eq!((world.positions()[0], world.velocities()[0]), (there, DVec3::ZERO), "{}", entry.id);
    }
}

#[test]
fn pinning_and_freeing_edits_the_scene() {
    let mut living = world(&windy());
    for (n, command) in [
        Command::Pin { particles: vec![7, 29, 7] },
        Command::Free { particles: vec![0, 29] },
        Command::Free { particles: vec![13] },
        Command::Pin { particles: vec![0] },
    ]
    .into_iter()
    .enumerate()
    {
        step(&mut living, 5);
        living.apply(command).unwrap();
        let saved = Scene::from_ron(&living.scene().to_ron().unwrap()).unwrap();
        assert_eq!(world(&saved).pinned(), living.pinned(), "command {n}");
    }
    let pinned: Vec<usize> = (0..30).filter(|i| living.pinned()[*i]).collect();
    assert_eq!(pinned, [0, 1, 2, 3, 4, 5, 7]);
}

/// Collects every key with a value that differs from the current one.
#[derive(Default)]
struct Others {
    prefix: String,
    found: Vec<(String, String)>,
}

impl Others {
    fn add(&mut self, info: &Info, value: impl std::fmt::Display) {
        self.found.push((format!("{}{}", self.prefix, info.name), format!("{value}")));
    }
}

impl Visitor for Others {
    fn number(&mut self, info: &'static Info, value: &mut f64, _: f64) {
        let other = if *value == 0.0 { 0.5 } else { *value * 0.875 };
        let largest = info.range.as_ref().map_or(f64::INFINITY, |r| *r.end());
        self.add(info, other.min(largest));
    }
    fn count(&mut self, info: &'static Info, value: &mut u32, _: u32) {
        self.add(info, *value + 1);
    }
    fn switch(&mut self, info: &'static Info, value: &mut bool, _: bool) {
        self.add(info, !*value);
    }
    fn choice(&mut self, info: &'static Info, names: &'static [&'static str], value: &mut usize, _: usize) {
        self.add(info, names[(*value + 1) % names.len()]);
    }
    fn vector(&mut self, info: &'static Info, value: &mut DVec3, _: DVec3) {
        self.add(info, format!("({}, {}, {})", -value.x, value.y + 1.0, value.z));
    }
    fn group(&mut self, info: &'static Info, inside: &mut dyn FnMut(&mut dyn Visitor)) {
        let before = self.prefix.len();
        write!(self.prefix, "{}.", info.name).unwrap();
        inside(self);
        self.prefix.truncate(before);
    }
}

#[test]
fn every_setting_can_be_set_and_does_what_a_scene_with_it_does() {
    for entry in simulators::ALL {
        let mut scene =
            Scene { simulator: method(entry), tearing: Tearing { enabled: true, max_ratio: 1.5 }, ..windy() };
        let mut others = Others::default();
        scene.visit(&mut others);
        others.prefix = "simulator.params.".to_owned();
        entry.visit(&scene.simulator.params, &mut others);
        let mut keys = others.found;
        let by_hand = [
            ("target", "Grid(columns: 4, rows: 3)"),
            ("mass", "PerParticle(2.0)"),
            ("pins", "[Row(0), Particle(29)]"),
            ("springs", "(stretch: (stiffness: 700.0))"),
            ("wind", "(enabled: true, strength: 3.0)"),
            ("simulator", "(id: \"verlet\", params: {\"sweeps\": 3})"),
            ("simulator.id", "explicit_euler"),
            ("simulator.params", "{}"),
        ];
        keys.extend(by_hand.map(|(key, value)| (key.to_owned(), value.to_owned())));
        for (key, value) in keys {
            let mut edited = scene.clone();
            edited.set_key(&key, &value).unwrap();
            let mut set_later = world(&scene);
            set(&mut set_later, &key, &value);
            assert_eq!(set_later.scene(), &edited, "{key} = {value}");
            assert_eq!(Scene::from_ron(&edited.to_ron().unwrap()).unwrap(), edited, "{key} = {value}");
            if key == "target.spacing" || key == "target.plane" {
                // The shape stays where it is, by design, when the particles are as many as before.
                assert_eq!(set_later.positions(), world(&scene).positions(), "{key}");
                continue;
            }
            let mut set_before = world(&edited);
            step(&mut set_later, 20);
            step(&mut set_before, 20);
            assert_eq!(set_later.digest(), set_before.digest(), "{}: {key} = {value}", entry.id);
            assert_eq!(set_later.cost(), set_before.cost(), "{}: {key} = {value}", entry.id);
        }
    }
}

#[test]
fn a_refused_command_changes_nothing_and_says_why_in_a_line() {
    let mut world = run(&windy(), 30);
    grab(&mut world, 20);
    let set = |key: &str, value: &str| Command::Set { key: key.to_owned(), value: value.to_owned() };
    let refused = [
        Command::Grab { particles: vec![1, 30] },
        Command::Release { particles: vec![u32::MAX] },
        Command::Pin { particles: vec![2, 99] },
        Command::Free { particles: vec![0, 30] },
        Command::Pull { particles: vec![30], stiffness: 10.0 },
        Command::Pull { particles: vec![1], stiffness: -1.0 },
        Command::Pull { particles: vec![1], stiffness: f64::NAN },
        Command::Pull { particles: vec![1], stiffness: 1.1e9 },
        Command::Drag { particle: 5, to: DVec3::ZERO, steps: 1 },
        Command::Drag { particle: 20, to: DVec3::new(f64::NAN, 0.0, 0.0), steps: 1 },
        Command::Drag { particle: 20, to: DVec3::new(0.0, f64::INFINITY, 0.0), steps: 1 },
        Command::Drag { particle: 20, to: DVec3::new(0.0, 0.0, 2e12), steps: 1 },
        set("dt", "-1"),
        set("dt", "0.01 0.02"),
        set("no.such.key", "1"),
        set("", "()"),
        set("springs.stretch.stiffness", "1e13"),
        set("simulator.id", "rk5"),
        set("simulator.params.sweeps", "3"),
        set("pins", "[Row(99)]"),
        set("target", "Mesh(path: \"../../etc/passwd.obj\")"),
        set("target.columns", "0"),
        set("target", "Grid(columns: 1000000, rows: 1000000)"),
        set("wind.direction", "(0, 0, 0)"),
        set("mass", "PerArea(-1)"),
        set("tearing.max_ratio", "1"),
        set("dt", "1\n2\u{7}"),
    ];
    for command in refused {
        let before =
            (world.digest(), world.scene().clone(), world.log().len(), world.cost(), world.pinned().to_vec());
        let line = world.apply(command.clone()).unwrap_err().to_string();
        let after =
            (world.digest(), world.scene().clone(), world.log().len(), world.cost(), world.pinned().to_vec());
        assert_eq!(before, after, "{command:?}");
        assert!(!line.is_empty() && !line.contains(char::is_control), "{command:?}: {line:?}");
        assert_eq!(world.held().collect::<Vec<_>>(), [20], "{command:?}");
    }
    // And it goes on as if nobody had asked.
    let mut undisturbed = run(&windy(), 30);
    grab(&mut undisturbed, 20);
    step(&mut world, 30);
    step(&mut undisturbed, 30);
    assert_eq!(world.digest(), undisturbed.digest());
}

/// A sheet that tears within a few hundredths of a second.
fn tearing() -> Scene {
    Scene { tearing: Tearing { enabled: true, max_ratio: 1.005 }, pins: Pins::of([Pin::Row(0)]), ..windy() }
}

#[test]
fn reset_starts_the_scene_as_it_is_now_from_its_beginning() {
    for entry in simulators::ALL {
        let mut living = world(&Scene { simulator: method(entry), ..tearing() });
        step(&mut living, 100);
        grab(&mut living, 8);
        drag(&mut living, 8, DVec3::new(0.0, 5.0, 0.0), 10);
        step(&mut living, 30);
        assert!(!living.broken().is_empty(), "{}", entry.id);
        living.apply(Command::Pin { particles: vec![29] }).unwrap();
        set(&mut living, "springs.stretch.stiffness", 800.0);
        set(&mut living, "dt", 1e-3);
        living.apply(Command::Reset).unwrap();
        let mut fresh = world(living.scene());
        assert_eq!((living.time(), living.broken().len(), living.held().count()), (0.0, 0, 0));
        for _ in 0..50 {
            assert_eq!(living.digest(), fresh.digest(), "{}", entry.id);
            living.step();
            fresh.step();
        }
    }
}

#[test]
fn a_snapshot_brings_back_every_bit_of_the_future() {
    for entry in simulators::ALL {
        let mut world = world(&Scene { simulator: method(entry), ..tearing() });
        step(&mut world, 70);
        grab(&mut world, 20);
        drag(&mut world, 20, DVec3::new(0.0, 2.0, 0.0), 40);
        step(&mut world, 7);
        let snapshot = world.snapshot();
        let future = |world: &mut World| {
            step(world, 50);
            release(world, 20);
            step(world, 50);
            (world.digest(), world.cost(), world.time(), world.steps(), world.broken().to_vec())
        };
        let first = future(&mut world);
        let log = world.log();
        // What happens in between is forgotten, settings and a target of another size included.
        set(&mut world, "precision", "Single");
        set(&mut world, "target.rows", 3);
        step(&mut world, 5);
        world.restore(&snapshot);
        assert_eq!((world.steps(), world.log().len()), (77, 2), "{}", entry.id);
        assert_eq!(future(&mut world), first, "{}", entry.id);
        assert_eq!(world.log(), log, "{}", entry.id);
    }
}

#[test]
fn time_goes_on_from_where_it_is_when_dt_changes() {
    let mut world = world(&Scene { dt: 0.25, ..free(sheet(1, 1, 1.0)) });
    step(&mut world, 4);
    set(&mut world, "dt", 0.125);
    assert_eq!(world.time(), 1.0);
    step(&mut world, 4);
    set(&mut world, "dt", 0);
    step(&mut world, 4);
    set(&mut world, "dt", 0.5);
    step(&mut world, 1);
    assert_eq!((world.time(), world.steps()), (2.0, 13));
    // Counted, not added up: a million steps of 0.1 s end at 1e5 s to the last bit.
    let mut world = common::world(&Scene { dt: 0.1, ..free(sheet(1, 1, 1.0)) });
    step(&mut world, 1_000_000);
    assert_eq!(world.time(), 1e5);
}

#[test]
fn a_burst_is_over_once_dt_is_right_or_the_cloth_is_reset() {
    let scene =
        Scene { simulator: simulators::SimulatorSettings::new("symplectic_euler"), dt: 0.05, ..windy() };
    let burst = || {
        let mut world = run(&scene, 500);
        assert!(world.health().is_diverged(), "dt = 0.05 is beyond the limit: {:?}", world.health());
        assert!(all_finite(&world));
        let (digest, steps) = (world.digest(), world.steps());
        step(&mut world, 10);
        assert_eq!((world.digest(), world.steps()), (digest, steps), "it waits");
        world
    };
    let mut world = burst();
    set(&mut world, "dt", 1e-5);
    assert_eq!(world.health(), Health::Ok);
    step(&mut world, 3000);
    assert!(!world.health().is_diverged() && all_finite(&world), "{:?}", world.health());

    let mut world = burst();
    world.apply(Command::Reset).unwrap();
    set(&mut world, "dt", 2e-3);
    step(&mut world, 500);
    assert_eq!(world.health(), Health::Ok);
    // And a recording of all this ends in the same bits.
    let recording = Recording::of(scene.clone(), &world);
    assert_eq!(replayed(&recording).digest(), world.digest());
}

/// A mesh file of a sheet of 6 x 6 with its particles in another order; answers with the path inside `folder`.
fn sheet_in_order(folder: &std::path::Path, name: &str, order: impl Fn(usize) -> usize) -> Target {
    let mut lines = vec![String::new(); 36];
    for (row, column) in (0..6).flat_map(|r| (0..6).map(move |c| (r, c))) {
        lines[order(6 * row + column)] = format!("v {column} -{row} 0");
    }
    let mut text = lines.join("\n") + "\n";
    for corner in (0..5).flat_map(|r| (0..5).map(move |c| 6 * r + c)) {
        let [a, b, c, d] = [corner, corner + 1, corner + 7, corner + 6].map(|i| order(i) + 1);
        writeln!(text, "f {a} {b} {c} {d}").unwrap();
    }
    std::fs::write(folder.join(name), text).unwrap();
    Target::mesh(name)
}

#[test]
fn which_springs_tear_does_not_depend_on_their_order() {
    let folder = tempfile::tempdir().unwrap();
    for entry in spring_methods() {
        let torn = |order: fn(usize) -> usize| {
            let scene = Scene {
                target: sheet_in_order(folder.path(), "sheet.obj", order),
                pins: Pins::of([Pin::Top(0.1)]),
                mass: Mass::PerParticle(1.0),
                simulator: method(entry),
                ..tearing()
            };
            let mut world = World::new(scene, Place::folder(folder.path())).unwrap();
            step(&mut world, 150);
            let pairs = world.topology().pairs.concat();
            let rest = &world.mesh().positions;
            let ends = |id: &u32| {
                let mut ends = pairs[*id as usize].map(|p| rest[p as usize].to_array().map(|c| c as i32));
                ends.sort_unstable();
                ends
            };
            world.broken().iter().map(ends).collect::<BTreeSet<_>>()
        };
        let plain = torn(|i| i);
        assert!(plain.len() > 5, "{}: {} torn", entry.id, plain.len());
        assert_eq!(plain, torn(|i| 35 - i), "{}: backwards", entry.id);
        assert_eq!(plain, torn(|i| (i * 7 + 3) % 36), "{}: shuffled", entry.id);
    }
}

#[test]
fn a_torn_spring_stays_torn_and_costs_nothing() {
    for entry in spring_methods() {
        let mut world = world(&Scene { simulator: method(entry), ..tearing() });
        let all = world.topology().pairs.iter().map(Vec::len).sum::<usize>();
        let mut torn: Vec<u32> = Vec::new();
        for n in 0..200 {
            if n == 100 {
                // Switching a kind off and on again mends nothing.
                set(&mut world, "springs.stretch.enabled", false);
                set(&mut world, "springs.stretch.enabled", true);
                set(&mut world, "tearing.max_ratio", 2.0);
            }
            let (acting, before) = (world.acting_springs() as u64, world.cost());
            world.step();
            let (visits, evaluations) = (
                world.cost().spring_visits - before.spring_visits,
                world.cost().force_evaluations - before.force_evaluations,
            );
            assert_eq!(visits % acting.max(1), 0, "{}", entry.id);
            // A method that chooses its own steps may have passed the end of this one before.
            let is_behind = visits >= acting && evaluations > 0;
            let is_ahead = adaptive(entry) && (visits, evaluations) == (0, 0);
            assert!(is_behind || is_ahead, "{} in step {n}", entry.id);
            assert!(torn.iter().all(|id| world.broken().contains(id)), "{} in step {n}", entry.id);
            torn = world.broken().to_vec();
            assert!(torn.is_sorted() && torn.windows(2).all(|ids| ids[0] != ids[1]), "{}", entry.id);
            assert_eq!(world.acting_springs() + torn.len(), all, "{}", entry.id);
        }
        assert!(!torn.is_empty(), "{}", entry.id);
    }
}

/// A spring at exactly its tearing length holds: it breaks when it is longer.
#[test]
fn a_spring_breaks_beyond_its_ratio_and_not_at_it() {
    for (to, torn) in [(2.0, 0), (2.0f64.next_up(), 1)] {
        let tearing = Tearing { enabled: true, max_ratio: 2.0 };
        let mut world =
            world(&Scene { tearing, pins: Pins::of([Pin::Particle(0)]), ..free(sheet(2, 1, 1.0)) });
        grab(&mut world, 1);
        // The pinned end stands at -0.5 m; 1.5 m and the next number up are 2 m and a hair away, exactly.
        let x = if torn == 0 { 1.5 } else { 1.5f64.next_up() + (to - 2.0) };
        drag(&mut world, 1, DVec3::new(x, 0.0, 0.0), 1);
        world.step();
        assert_eq!(world.broken().len(), torn, "at {x} m");
    }
}

/// Runs a recording again, as `tenter replay` does.
fn replayed(recording: &Recording) -> World {
    let mut world = recording.start(Place::default()).unwrap();
    let mut next = 0;
    recording.apply_due(&mut world, &mut next).unwrap();
    while world.steps() < recording.steps {
        world.step();
        recording.apply_due(&mut world, &mut next).unwrap();
    }
    world
}

#[test]
fn a_recording_out_of_order_is_refused() {
    let entry = |step: u64| format!("(step: {step}, command: Reset)");
    let text = |steps: &[u64]| {
        let commands: Vec<_> = steps.iter().map(|s| entry(*s)).collect();
        format!("(scene: (), steps: 10, commands: [{}])", commands.join(", "))
    };
    assert!(Recording::from_ron(&text(&[0, 3, 3, 10])).is_ok());
    for steps in [&[3, 2][..], &[0, 11], &[10, 0]] {
        let line = Recording::from_ron(&text(steps)).unwrap_err().to_string();
        assert!(line.contains("command 1") && line.contains("accepted"), "{line}");
    }
    for text in
        ["", "(", "(scene: (), steps: -1)", "(scene: (dt: -1), steps: 1)", "(scene: (), steps: 1, more: 2)"]
    {
        assert!(Recording::from_ron(text).is_err(), "{text}");
    }
}

/// What a user could do, sensible or not.
fn any_command() -> impl Strategy<Value = Command> {
    let particles = || proptest::collection::vec(0u32..20, 0..4);
    let set = |key: &'static str, values: &'static [&'static str]| {
        proptest::sample::select(values)
            .prop_map(move |value| Command::Set { key: key.to_owned(), value: value.to_owned() })
    };
    let to = (-3.0..3.0, -3.0..3.0, -3.0..3.0).prop_map(|(x, y, z)| DVec3::new(x, y, z));
    prop_oneof![
        3 => particles().prop_map(|particles| Command::Grab { particles }),
        4 => (0u32..20, to, 0u32..9).prop_map(|(particle, to, steps)| Command::Drag { particle, to, steps }),
        1 => (particles(), 0.0..1e5).prop_map(|(particles, stiffness)| Command::Pull { particles, stiffness }),
        2 => particles().prop_map(|particles| Command::Release { particles }),
        1 => particles().prop_map(|particles| Command::Pin { particles }),
        1 => particles().prop_map(|particles| Command::Free { particles }),
        1 => Just(Command::Reset),
        2 => set("dt", &["0", "0.001", "0.02", "0.3", "-1"]),
        1 => set("simulator.id", &["explicit_euler", "symplectic_euler", "verlet", "nonsense"]),
        1 => set("precision", &["Single", "Double"]),
        1 => set("springs.shear.enabled", &["true", "false"]),
        1 => set("springs.stretch.stiffness", &["0", "1000", "1e9"]),
        1 => set("target.columns", &["4", "5"]),
        1 => set("tearing", &["(enabled: true, max_ratio: 1.1)", "()"]),
        1 => set("pins", &["[]", "[Row(0)]", "[Particle(19)]"]),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn whatever_a_user_does_its_recording_ends_in_the_same_bits(
        acts in proptest::collection::vec((any_command(), 0u64..12), 0..40)
    ) {
        let scene = Scene { target: sheet(4, 4, 1.0), ..windy() };
        let mut world = world(&scene);
        for (command, steps) in acts {
            // Some are refused; those are not part of the recording.
            let _ = world.apply(command);
            step(&mut world, steps);
            prop_assert!(all_finite(&world), "{:?}", world.health());
        }
        let recording = Recording::of(scene, &world);
        let read = Recording::from_ron(&to_ron(&recording).unwrap()).unwrap();
        prop_assert_eq!(&read, &recording);
        let again = replayed(&read);
        prop_assert!(read.agrees(&again), "digest {:016x} instead of {}", again.digest(), read.digest);
        prop_assert_eq!(again.scene(), world.scene());
        prop_assert_eq!(again.cost(), world.cost());
        prop_assert_eq!(again.log(), world.log());
    }
}

/// What it leaves is the state before, and all that follows is as if nobody had begun it.
#[test]
fn a_step_that_is_broken_off_was_never_taken() {
    // Some hours of it.
    let endless = [
        "(id: \"bdf2\", params: {\"tolerance\": 1e-14, \"newton_steps\": 1000, \"iterations\": 1000000})",
        "(id: \"rk45\", params: {\"tolerance\": 1e-14, \"most_steps\": 100000000})",
        "(id: \"xpbd\", params: {\"substeps\": 100000, \"iterations\": 100000})",
    ];
    for settings in endless {
        let bdf2 = Scene::from_ron("(simulator: (id: \"bdf2\"))").unwrap();
        let mut worlds = [(); 2].map(|()| world(&bdf2));
        for world in &mut worlds {
            (0..10).for_each(|_| world.step());
            set(world, "dt", "100.0");
            set(world, "simulator", settings);
        }
        let [stopped, other] = &mut worlds;
        let stop = Arc::new(AtomicBool::new(false));
        stopped.heed(Some(Arc::clone(&stop)));
        let before = (stopped.digest(), stopped.cost(), stopped.time());
        let flag = Arc::clone(&stop);
        let waits = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(50));
            flag.store(true, Ordering::Relaxed);
        });
        stopped.step();
        waits.join().unwrap();
        assert_eq!((stopped.digest(), stopped.cost(), stopped.time()), before, "{settings}");
        stopped.step();
        assert_eq!(stopped.steps(), 10, "no step while it is set");
        stop.store(false, Ordering::Relaxed);
        for world in [stopped, other] {
            set(world, "simulator.id", "\"symplectic_euler\"");
            set(world, "dt", "0.02");
            (0..10).for_each(|_| world.step());
        }
        assert_eq!(worlds[0].digest(), worlds[1].digest(), "{settings}");
    }
}
