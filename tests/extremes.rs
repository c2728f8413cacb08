//! Extremes: every one ends in a finite result or in `diverged` with its place and the last good state; never in NaN, a hang,
//! a panic or a silent clamp.
#![allow(clippy::unwrap_used)]

mod common;

use common::{
    PRECISIONS, advance, all_finite, free, hanging, method, run, set, sheet, step, stiffness, verlet, w1,
    world,
};
use glam::DVec3;
use std::fmt::Write;
use std::path::Path;
use tenter::forces::gravity::Gravity;
use tenter::forces::wind::Wind;
use tenter::forces::{Problem, Spectrum, SpringSet};
use tenter::math::Real;
use tenter::model::{Particles, Topology};
use tenter::params::{Info, Params, Visitor};
use tenter::scene::{Mass, Pin, Pins, Place, Precision, Scene, Target, Tearing};
use tenter::simulators::{self, Build, Entry, SimulatorSettings};
use tenter::world::{Command, Health, World};

/// Every method in both precisions on a scene.
fn variants(scene: &Scene) -> impl Iterator<Item = (&'static Entry, Scene)> + '_ {
    simulators::ALL.iter().flat_map(move |entry| {
        PRECISIONS.map(|precision| (entry, Scene { simulator: method(entry), precision, ..scene.clone() }))
    })
}

/// What every run owes: all `planned` steps with finite numbers, or `diverged` at the very next step, with the state that
/// a run up to there has, and no step after.
fn check_end(mut world: World, planned: u64, what: &str) -> Health {
    assert!(all_finite(&world), "{what}: {:?}, not finite", world.health());
    let health = world.health();
    if let Health::Diverged { step, time, particle } = health {
        assert_eq!(step, world.steps() + 1, "{what}");
        assert!((time - world.time() - world.scene().dt).abs() <= 4.0 * f64::EPSILON * time, "{what}");
        assert!((particle as usize) < world.pinned().len(), "{what}");
        let before = world.digest();
        world.step();
        assert_eq!((world.digest(), world.steps()), (before, step - 1), "{what}: it is not kept");
    } else {
        assert_eq!(world.steps(), planned, "{what}");
    }
    health
}

/// Largest |d|/L - 1 of the stretch springs of a grid, which stand first in the list and first in a result of strains.
fn stretch(world: &World) -> f64 {
    let mut strains = Vec::new();
    world.strains(&mut strains);
    let count = world.topology().pairs[0].len();
    strains.iter().filter(|(id, _)| (*id as usize) < count).map(|(_, s)| f64::from(*s)).fold(0.0, f64::max)
}

/// Runs a scene to its end, and says the largest strain of its stretch springs there; where it diverges the state kept is that of a run that stops one step before.
fn outcome(scene: &Scene, steps: u64, what: &str) -> (Health, f64) {
    let world = run(scene, steps);
    let (strain, digest, reached) = (stretch(&world), world.digest(), world.steps());
    let health = check_end(world, steps, what);
    if health.is_diverged() {
        let again = run(scene, reached);
        assert!(!again.health().is_diverged(), "{what}");
        assert_eq!(again.digest(), digest, "{what}: not the last good state");
    }
    (health, strain)
}

#[test]
fn any_step_length_ends_in_a_finite_cloth_or_says_where_it_diverged() {
    for (entry, scene) in variants(&w1()) {
        for dt in [1e-6, 1e-3, 1.0 / 240.0, 1.0 / 60.0, 0.1, 1.0] {
            let what = format!("{}, {:?}, dt = {dt}", entry.id, scene.precision);
            let (health, strain) = outcome(&Scene { dt, ..scene.clone() }, 120, &what);
            // 2/ω = 0.004 s: explicit methods burst beyond, relaxation never does.
            match entry.id {
                "explicit_euler" | "symplectic_euler" => {
                    assert_eq!(health.is_diverged(), dt > 2e-3, "{what}: {health:?}");
                    // Given to two digits. Explicit Euler has by then made e^15 of the rounding of its first step.
                    if dt == 1e-3 && scene.precision == Precision::Double {
                        assert!((strain - 0.036).abs() < 0.0005, "{what}: strain {strain}");
                    }
                }
                "verlet" => assert!(!health.is_diverged(), "{what}: {health:?}"),
                _ => {}
            }
        }
    }
}

#[test]
fn any_stiffness_ends_in_a_finite_cloth_or_says_where_it_diverged() {
    for (entry, mut scene) in variants(&Scene { dt: 1.0 / 60.0, ..w1() }) {
        for k in [0.0, 10.0, 1e3, 1e5, 1e7, 1e9] {
            let what = format!("{}, {:?}, k = {k}", entry.id, scene.precision);
            scene.springs = stiffness(k, 0.3 * k, 0.1 * k, 0.0);
            let (health, strain) = outcome(&scene, 120, &what);
            match entry.id {
                "symplectic_euler" => {
                    assert_eq!(health.is_diverged(), k > 10.0, "{what}: {health:?}");
                    if k == 10.0 {
                        assert!((strain - 1.2).abs() < 0.05, "{what}: strain {strain}");
                    }
                }
                "verlet" => assert!(!health.is_diverged(), "{what}: {health:?}"),
                _ => {}
            }
        }
    }
}

#[test]
fn the_smallest_cloths_run() {
    let table = [
        (1, 1, [0, 0, 0]),
        (2, 1, [1, 0, 0]),
        (1, 7, [6, 0, 5]),
        (7, 1, [6, 0, 5]),
        (2, 2, [4, 2, 0]),
        (2, 3, [7, 4, 2]),
    ];
    for (columns, rows, springs) in table {
        let wind = Wind { enabled: true, ..Wind::default() };
        let tearing = Tearing { enabled: true, ..Tearing::default() };
        for target in [sheet(columns, rows, 1.0), hanging(columns, rows, 1.0)] {
            let scene =
                Scene { target, wind: wind.clone(), tearing: tearing.clone(), dt: 2e-3, ..Scene::default() };
            for (entry, scene) in variants(&scene) {
                let what = format!("{columns} x {rows}, {}", entry.id);
                let world = run(&scene, 100);
                assert_eq!(world.topology().pairs.each_ref().map(Vec::len), springs, "{what}");
                assert_eq!(check_end(world, 100, &what), Health::Ok, "{what}");
            }
        }
    }
}

#[test]
fn a_cloth_of_pinned_particles_runs_and_does_not_move() {
    let pins = Pins::of((0..4).map(Pin::Row).collect::<Vec<_>>());
    let wind = Wind { enabled: true, ..Wind::default() };
    for dt in [1e-20, 1e-6, 0.02, 100.0] {
        let scene = Scene {
            target: sheet(4, 4, 1.0),
            pins: pins.clone(),
            wind: wind.clone(),
            dt,
            ..Scene::default()
        };
        for (entry, scene) in variants(&scene) {
            let what = format!("{}, {:?}, dt = {dt}", entry.id, scene.precision);
            let start = world(&scene);
            let end = run(&scene, 50);
            assert_eq!(end.positions(), start.positions(), "{what}");
            assert_eq!(end.velocities(), start.velocities(), "{what}");
            assert_eq!(end.warnings(), start.warnings(), "{what}");
            assert!(end.spectrum().omega_max() == 0.0, "{what}");
            assert_eq!(check_end(end, 50, &what), Health::Ok, "{what}");
        }
    }
}

#[test]
fn an_empty_mesh_is_refused_for_having_no_faces() {
    let folder = tempfile::tempdir().unwrap();
    for text in ["", "# nothing\n", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"] {
        std::fs::write(folder.path().join("empty.obj"), text).unwrap();
        let scene = Scene { target: Target::mesh("empty.obj"), ..Scene::default() };
        let refusal = World::new(scene, Place::folder(folder.path())).err().unwrap().to_string();
        assert!(refusal.contains("no faces"), "{refusal}");
    }
}

fn command(world: &mut World, command: Command) {
    world.apply(command).unwrap();
}

/// Takes a particle to a point within one step and holds it there.
fn drag(world: &mut World, particle: u32, to: DVec3) {
    command(world, Command::Grab { particles: vec![particle] });
    command(world, Command::Drag { particle, to, steps: 1 });
    world.step();
}

#[test]
fn two_particles_in_one_place_have_no_force_and_part_again() {
    for (entry, scene) in variants(&Scene { dt: 1e-3, ..free(sheet(2, 1, 1.0)) }) {
        let what = format!("{}, {:?}", entry.id, scene.precision);
        let mut world = world(&scene);
        let place = world.positions()[0];
        command(&mut world, Command::Grab { particles: vec![0] });
        drag(&mut world, 1, place);
        assert_eq!(world.positions()[0], world.positions()[1], "{what}");
        command(&mut world, Command::Release { particles: vec![0] });
        step(&mut world, 100);
        // No direction, no force: the free one has not moved from under the hand.
        assert_eq!(world.positions()[0], place, "{what}");
        assert!(all_finite(&world), "{what}");
        // Parted by something else, the spring pushes them to its length.
        drag(&mut world, 1, place + DVec3::new(0.0, 0.5, 0.0));
        step(&mut world, 20);
        assert!(world.positions()[0].y < -1e-3, "{what}: {:?}", world.positions());
        assert!(all_finite(&world), "{what}");
    }
}

#[test]
fn springs_of_rest_length_zero_pull_together() {
    for (entry, mut scene) in variants(&Scene { dt: 1e-3, ..free(sheet(4, 4, 1.0)) }) {
        let what = format!("{}, {:?}", entry.id, scene.precision);
        scene.springs.stretch.rest_scale = 0.0;
        scene.springs.shear.rest_scale = 0.0;
        scene.springs.bend.rest_scale = 0.0;
        let start = world(&scene).positions();
        let end = run(&scene, 15);
        let size = |x: &[DVec3]| x.iter().map(|x| x.length()).fold(0.0, f64::max);
        assert!(size(&end.positions()) < 0.9 * size(&start), "{what}");
        assert_eq!(end.measures().max_strain, 0.0, "{what}: no length, no strain");
        // Long enough to pass through one another, where |d| = 0 is near.
        outcome(&scene, 2000, &what);
    }
}

/// Two particles of 1 kg and 1 mg on a spring of 1000 N/m.
fn unequal_pair<T: Real>(scale: f64) -> (Problem<T>, Particles<T>) {
    let topology = Topology { pairs: [vec![[0, 1]], Vec::new(), Vec::new()] };
    let place = |x: f64| <T::Vec3 as tenter::math::Vector>::from_f64(DVec3::X * x);
    let params = stiffness(1000.0, 0.0, 0.0, 0.0);
    let set = SpringSet {
        topology: &topology,
        rest_positions: &[place(0.0), place(1.0)],
        params: &params,
        broken: &[],
    };
    let problem = Problem::new([1.0, 1e-6].map(T::from_f64).to_vec(), &set);
    (problem, Particles::at_rest(vec![place(0.0), place(scale)]))
}

#[test]
fn masses_of_one_to_a_million_have_the_limit_of_theory() {
    // ω² = k (1/m1 + 1/m2).
    let expected = 2.0 / (1000.0f64 * (1.0 + 1e6)).sqrt();
    assert!((expected - 6.325e-5).abs() < 5e-9);
    let settings = SimulatorSettings::new("symplectic_euler");
    let (problem, state) = unequal_pair::<f64>(1.0);
    let limit = f64::build(&settings).unwrap().dt_limit(&Spectrum::of(&problem, &state)).unwrap();
    assert!((limit / expected - 1.0).abs() < 1e-6, "{limit}");
    // 1 % below, an amplitude of 1 mm grows by the amplitude factor 1 / cos(asin(0.99)) = 7; 1 % above it doubles in 3 steps.
    for (part, holds) in [(0.99, true), (1.01, false)] {
        let (problem, mut state) = unequal_pair::<f64>(1.001);
        advance(&problem, &mut state, &settings, part * expected, 10_000);
        let length = state.positions[0].distance(state.positions[1]);
        assert_eq!((length - 1.0).abs() < 7.1e-3, holds, "{part} of the limit: length {length}");
        let momentum = state.velocities[0] * problem.mass[0] + state.velocities[1] * problem.mass[1];
        // Exchanged in one step at most: the light one's m v = 1e-6 x 1e-2 x ω.
        assert!(!holds || momentum.length() < 10_000.0 * f64::EPSILON * 1e-6 * 1e-2 * 31_623.0, "{momentum}");
    }
}

/// A sheet of quads, 1 m apart, whose middle is at `place`.
fn sheet_at(folder: &Path, place: DVec3) -> Target {
    let mut text = String::new();
    for (row, column) in (0..4).flat_map(|r| (0..4).map(move |c| (r, c))) {
        let at = place + DVec3::new(f64::from(column) - 1.5, 0.0, f64::from(row) - 1.5);
        writeln!(text, "v {} {} {}", at.x, at.y, at.z).unwrap();
    }
    for corner in (0..3).flat_map(|r| (0..3).map(move |c| 4 * r + c + 1)) {
        writeln!(text, "f {} {} {} {}", corner, corner + 1, corner + 5, corner + 4).unwrap();
    }
    std::fs::write(folder.join("sheet.obj"), text).unwrap();
    Target::mesh("sheet.obj")
}

#[test]
fn far_from_the_origin_single_precision_is_warned_of_and_double_is_not_harmed() {
    let folder = tempfile::tempdir().unwrap();
    let far = DVec3::new(1e5, 0.0, 0.0);
    for entry in simulators::ALL {
        let scene_at = |place: DVec3, precision| Scene {
            target: sheet_at(folder.path(), place),
            pins: Pins::of([Pin::Particle(0)]),
            simulator: method(entry),
            precision,
            dt: 1e-3,
            ..Scene::default()
        };
        let start = |scene: Scene| World::new(scene, Place::folder(folder.path())).unwrap();
        let single = start(scene_at(far, Precision::Single));
        assert!(single.warnings().iter().any(|w| w.contains("single precision")), "{:?}", single.warnings());
        assert_eq!(start(scene_at(DVec3::ZERO, Precision::Single)).warnings(), Vec::<String>::new());

        let (mut here, mut there) =
            (start(scene_at(DVec3::ZERO, Precision::Double)), start(scene_at(far, Precision::Double)));
        assert_eq!(there.warnings(), Vec::<String>::new());
        step(&mut here, 200);
        step(&mut there, 200);
        // Each step rounds coordinates of 1e5 m; 0.2 s of a soft sheet does not amplify by more than exp(ω t), ω = 72 / 4.
        let bound = 200.0 * 1e5 * f64::EPSILON * (18.0f64 * 0.2).exp() / 1e-3 * 1e-2;
        for (a, b) in here.positions().iter().zip(there.positions()) {
            assert!((*a + far).distance(b) < bound, "{}: {a} and {b}, bound {bound:e}", entry.id);
        }
    }
}

#[test]
fn a_step_too_short_for_single_precision_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |precision| Scene {
        target: sheet_at(folder.path(), DVec3::new(0.0, 1000.0, 0.0)),
        simulator: SimulatorSettings::new("symplectic_euler"),
        precision,
        dt: 1e-6,
        air_damping: 0.0,
        ..Scene::default()
    };
    let fall = |precision| {
        let mut world = World::new(scene(precision), Place::folder(folder.path())).unwrap();
        step(&mut world, 1000);
        (1000.0 - world.positions()[0].y, world.warnings())
    };
    let (fallen, warnings) = fall(Precision::Single);
    assert_eq!(fallen, 0.0, "every increment is below half a unit in the last place");
    assert!(warnings.iter().any(|w| w.contains("too short for single precision")), "{warnings:?}");
    let (fallen, warnings) = fall(Precision::Double);
    // g t² / 2 with its lag of g t dt / 2, and round-off of 1000 m.
    assert!((fallen - 5e-6).abs() < 5e-9 + 1000.0 * 1000.0 * f64::EPSILON, "{fallen}");
    assert_eq!(warnings, Vec::<String>::new());
}

#[test]
fn wind_faster_than_the_step_can_follow_is_warned_of() {
    let scene = |frequency| Scene {
        wind: Wind { enabled: true, frequency, ..Wind::default() },
        dt: 0.5,
        simulator: verlet(10),
        gravity: common::no_gravity(),
        ..Scene::default()
    };
    assert_eq!(world(&scene(1.0)).warnings(), Vec::<String>::new());
    let fast = run(&scene(2.0), 10);
    assert!(fast.warnings().iter().any(|w| w.contains("2 Hz")), "{:?}", fast.warnings());
    // Always met where it vanishes: up to the rounding of π f t, no wind at all.
    assert!(fast.velocities().iter().all(|v| v.length() < 1e-20));
}

#[test]
fn a_drag_of_any_length_in_one_step_ends_finite_or_says_where() {
    for (entry, scene) in variants(&Scene { dt: 1e-3, ..w1() }) {
        for distance in [1.0, 10.0, 1000.0, 1e6, 1e12] {
            let what = format!("{}, {:?}, {distance} m", entry.id, scene.precision);
            let mut world = world(&scene);
            let to = DVec3::new(0.3, -0.8, 0.5).normalize() * distance;
            drag(&mut world, 99, to);
            if !world.health().is_diverged() {
                let there = world.positions()[99];
                let rounded = if scene.precision == Precision::Single { to.as_vec3().as_dvec3() } else { to };
                assert_eq!(there, rounded, "{what}");
                step(&mut world, 200);
            }
            let health = check_end(world, 201, &what);
            if entry.id == "verlet" {
                assert!(!health.is_diverged(), "{what}: {health:?}");
            }
        }
    }
}

#[test]
fn a_pull_of_any_stiffness_ends_finite_or_says_where() {
    for (entry, scene) in variants(&Scene { dt: 1e-3, ..w1() }) {
        for (stiffness, distance) in [(0.0, 1e12), (1.0, 1.0), (1e3, 10.0), (1e9, 1e6), (1e9, 1e12)] {
            let what = format!("{}, {:?}, {stiffness} N/m, {distance} m", entry.id, scene.precision);
            let mut world = world(&scene);
            // A pull this weak is no reason to burst, but explicit Euler has a better one.
            let stable = world.dt_limit(&world.spectrum()).is_none_or(|limit| scene.dt < limit);
            command(&mut world, Command::Pull { particles: vec![99], stiffness });
            command(&mut world, Command::Drag { particle: 99, to: DVec3::X * distance, steps: 1 });
            step(&mut world, 200);
            let health = check_end(world, 200, &what);
            assert!(stiffness > 1.0 || !stable || !health.is_diverged(), "{what}: {health:?}");
        }
    }
}

#[test]
fn relaxation_comes_back_from_a_drag_of_any_length() {
    for precision in PRECISIONS {
        for distance in [1.0, 10.0, 1000.0, 1e6] {
            let mut world = world(&Scene { simulator: verlet(10), precision, dt: 1.0 / 60.0, ..w1() });
            drag(&mut world, 99, DVec3::new(0.0, -distance, 0.0));
            // It lets go at rest, after more than the tenth of a second over which a throw is measured.
            step(&mut world, 12);
            command(&mut world, Command::Release { particles: vec![99] });
            step(&mut world, 1200);
            let strain = world.measures().max_strain;
            assert!(strain < 4.0, "{precision:?}, {distance} m: strain {strain}");
            check_end(world, 1213, "released");
        }
    }
}

#[test]
fn a_tearing_ratio_of_one_or_less_is_refused() {
    for ratio in ["1", "1.0", "0.5", "0", "-1", "NaN", "inf"] {
        let refusal = Scene::default().set_key("tearing.max_ratio", ratio).unwrap_err().to_string();
        assert!(refusal.contains("max_ratio") && refusal.contains("accepted"), "{refusal}");
    }
}

#[test]
fn a_ratio_just_above_one_tears_a_stretched_cloth_to_particles_that_fly_free() {
    let tearing = Tearing { enabled: true, max_ratio: 1f64.next_up() };
    for (entry, mut scene) in variants(&Scene { tearing, dt: 1e-3, ..w1() }) {
        let what = format!("{}, {:?}", entry.id, scene.precision);
        for kind in [&mut scene.springs.stretch, &mut scene.springs.shear, &mut scene.springs.bend] {
            // So little that no method takes more than the excess away within the step.
            kind.rest_scale = 0.5;
            kind.stiffness = 1e-3;
        }
        scene.simulator = if entry.id == "verlet" { verlet(0) } else { scene.simulator };
        let mut world = world(&scene);
        world.step();
        assert_eq!(world.acting_springs(), 0, "{what}");
        let visits = world.cost().spring_visits;
        step(&mut world, 99);
        assert_eq!(world.cost().spring_visits, visits, "{what}: torn springs cost nothing");
        let fallen = -world.positions()[50].y;
        // Free fall but for 1 mN for one step and the air's c t / m = 5 % at most.
        assert!((fallen / 0.049 - 1.0).abs() < 0.06, "{what}: {fallen}");
        assert_eq!(check_end(world, 100, &what), Health::Ok, "{what}");
    }
}

#[test]
fn at_dt_zero_nothing_happens_to_the_bit() {
    let scene = Scene { wind: Wind { enabled: true, ..Wind::default() }, dt: 1e-3, ..w1() };
    for (entry, scene) in variants(&scene) {
        let mut world = run(&scene, 100);
        command(&mut world, Command::Grab { particles: vec![50] });
        command(&mut world, Command::Drag { particle: 50, to: DVec3::ONE, steps: 10 });
        world.step();
        set(&mut world, "dt", 0.0);
        let (digest, time, cost) = (world.digest(), world.time(), world.cost());
        step(&mut world, 100);
        assert_eq!((world.digest(), world.time(), world.cost()), (digest, time, cost), "{}", entry.id);
        assert_eq!(world.health(), Health::Ok);
        set(&mut world, "dt", 1e-3);
        step(&mut world, 9);
        assert_eq!(world.positions()[50], DVec3::ONE, "{}: the hand goes on afterwards", entry.id);
    }
    for dt in ["-0.01", "NaN", "inf", "-inf"] {
        assert!(Scene::default().set_key("dt", dt).is_err(), "{dt}");
    }
}

#[test]
fn a_sheet_in_its_own_plane_stays_in_it_to_the_bit() {
    let scene =
        Scene { target: hanging(8, 8, 1.0), dt: 5e-3, gravity: Gravity::default(), ..Scene::default() };
    for (entry, scene) in variants(&scene) {
        let mut world = world(&scene);
        let mut moved = false;
        for _ in 0..400 {
            world.step();
            assert!(world.positions().iter().all(|x| x.z == 0.0), "{}, {:?}", entry.id, scene.precision);
            moved |= world.positions()[60].y < -7.0;
        }
        assert!(moved, "{}", entry.id);
    }
}

/// A numeric field of a scene: its path, and what is declared about it.
struct Field {
    path: String,
    info: &'static Info,
    whole: bool,
}

/// Collects the numeric fields; fields without a general form by name.
#[derive(Default)]
struct Collector {
    prefix: String,
    fields: Vec<Field>,
    others: Vec<&'static str>,
}

impl Collector {
    fn add(&mut self, info: &'static Info, whole: bool) {
        self.fields.push(Field { path: format!("{}{}", self.prefix, info.name), info, whole });
    }
}

impl Visitor for Collector {
    fn number(&mut self, info: &'static Info, _: &mut f64, _: f64) {
        self.add(info, false);
    }
    fn count(&mut self, info: &'static Info, _: &mut u32, _: u32) {
        self.add(info, true);
    }
    fn switch(&mut self, _: &'static Info, _: &mut bool, _: bool) {}
    fn choice(&mut self, _: &'static Info, _: &'static [&'static str], _: &mut usize, _: usize) {}
    fn vector(&mut self, info: &'static Info, _: &mut DVec3, _: DVec3) {
        self.add(info, false);
    }
    fn group(&mut self, info: &'static Info, inside: &mut dyn FnMut(&mut dyn Visitor)) {
        let before = self.prefix.len();
        self.prefix.push_str(info.name);
        self.prefix.push('.');
        inside(self);
        self.prefix.truncate(before);
    }
    fn other(&mut self, info: &'static Info) {
        self.others.push(info.name);
    }
}

/// A scene in which every force acts, for a method and a precision.
fn everything_on(simulator: &SimulatorSettings, precision: Precision) -> Scene {
    Scene {
        target: sheet(4, 3, 0.1),
        wind: Wind { enabled: true, strength: 0.1, ..Wind::default() },
        tearing: Tearing { enabled: true, ..Tearing::default() },
        springs: stiffness(1000.0, 300.0, 100.0, 0.02),
        simulator: simulator.clone(),
        precision,
        dt: 1e-3,
        ..w1()
    }
}

/// What a file could hold for a number.
const NUMBERS: [&str; 10] = ["NaN", "inf", "-inf", "-1", "-1e308", "0", "-0.0", "1e-308", "5e-324", "1e308"];
const WHOLE: [&str; 7] = ["NaN", "-1", "0", "0.5", "4294967295", "4294967296", "1e308"];

/// Sets a field by its key and through the text of a file; both must take it, or both refuse it with its name and what
/// would be accepted. What is taken must run.
fn try_value(scene: &Scene, key: &str, value: &str, name: &str, file: &str) {
    let what = format!("{key} = {value} ({}, {:?})", scene.simulator.id, scene.precision);
    let mut edited = scene.clone();
    let taken = edited.set_key(key, value);
    let read = Scene::from_ron(file);
    assert_eq!(taken.is_ok(), read.is_ok(), "{what}: {taken:?}, but from a file {read:?}");
    match (taken, read) {
        (Ok(()), Ok(_)) => {
            if let Ok(world) = World::new(edited.clone(), Place::default()) {
                drop(world);
                outcome(&edited, 40, &what);
            }
        }
        (Err(by_key), Err(by_file)) => {
            assert_eq!(&edited, scene, "{what}: refused, but changed");
            assert!(by_key.to_string().contains(name), "{what}: {by_key}");
            let line = by_file.to_string();
            // Text that is no number of this kind is refused by its place in the file.
            assert!(line.contains(name) || line.starts_with("1:"), "{what}: {line}");
            for line in [by_key.to_string(), line] {
                assert!(line.contains("accepted"), "{what}: {line}");
            }
        }
        _ => unreachable!(),
    }
}

/// `a.b.c` with a value as nested RON.
fn nested(path: &str, value: &str) -> String {
    let text = path.rsplit('.').fold(value.to_owned(), |inner, name| format!("({name}: {inner})"));
    text.replace("(target: (", "(target: Grid(")
}

#[test]
fn any_number_in_any_field_is_refused_by_name_or_runs() {
    let mut seen = Collector::default();
    Scene::default().visit(&mut seen);
    // What has no general form is tried below by hand; anything new must be added there.
    assert_eq!(seen.others, ["pins", "mass", "simulator"]);
    assert!(seen.fields.len() > 15, "only {} fields", seen.fields.len());
    for simulator in simulators::ALL.iter().map(method) {
        for precision in PRECISIONS {
            let scene = everything_on(&simulator, precision);
            for field in &seen.fields {
                for value in if field.whole { &WHOLE[..] } else { &NUMBERS } {
                    let is_vector = field.info.name == "direction";
                    let value = if is_vector { format!("({value}, 0.5, 0.5)") } else { (*value).to_owned() };
                    try_value(&scene, &field.path, &value, field.info.name, &nested(&field.path, &value));
                }
            }
        }
    }
}

#[test]
fn any_number_in_any_parameter_of_a_method_is_refused_by_name_or_runs() {
    for entry in simulators::ALL {
        let mut seen = Collector::default();
        entry.visit(&method(entry).params, &mut seen);
        assert_eq!(seen.others, Vec::<&str>::new());
        for field in &seen.fields {
            for value in if field.whole { &WHOLE[..] } else { &NUMBERS } {
                let key = format!("simulator.params.{}", field.path);
                let file =
                    format!("(simulator: (id: \"{}\", params: {{\"{}\": {value}}}))", entry.id, field.path);
                for precision in PRECISIONS {
                    try_value(&everything_on(&method(entry), precision), &key, value, field.info.name, &file);
                }
            }
        }
    }
}

#[test]
fn any_number_in_mass_and_pins_is_refused_by_name_or_runs() {
    let templates = [
        ("mass", "PerParticle(#)"),
        ("mass", "PerArea(#)"),
        ("pins", "[Nearest((#, 0, 0))]"),
        ("pins", "[Box((#, 0, 0), (1, 1, 1))]"),
        ("pins", "[Box((-1, -1, -1), (1, #, 1))]"),
        ("pins", "[Top(#)]"),
    ];
    for simulator in simulators::ALL.iter().map(method) {
        for precision in PRECISIONS {
            let scene = everything_on(&simulator, precision);
            for (key, template) in templates {
                for value in NUMBERS {
                    let value = template.replace('#', value);
                    try_value(&scene, key, &value, key, &nested(key, &value));
                }
            }
        }
    }
    let scene = everything_on(&SimulatorSettings::default(), Precision::Double);
    for value in ["Particle(12)", "Particle(4294967295)", "Row(3)", "Column(4)", "Particle(-1)"] {
        let mut edited = scene.clone();
        let refused = edited
            .set_key("pins", &format!("[{value}]"))
            .and_then(|()| World::new(edited, Place::default()).map(|_| ()))
            .unwrap_err();
        assert!(refused.to_string().contains("pins"), "{value}: {refused}");
    }
    assert!(matches!(scene.mass, Mass::PerParticle(_)));
}
