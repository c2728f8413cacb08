//! What every method promises, whatever it is: run over the registry, so that a new method is covered by being listed.
#![allow(clippy::unwrap_used)]

mod common;

use common::{
    PRECISIONS, advance, free, method, problem, problem_on, run, set, sheet, spring_methods, step, world,
};
use glam::DVec3;
use tenter::forces::wind::Wind;
use tenter::forces::{Cost, Problem};
use tenter::math::{Real, Vector};
use tenter::model::{Memory, Particles};
use tenter::params::{Info, Visitor};
use tenter::scene::{Pin, Pins, Place, Precision, Scene, Tearing};
use tenter::simulators::{self, Build, Entry, Model, SimulatorSettings, Value};
use tenter::world::{Command, World};

/// Every force on a soft sheet: no method bursts on it, and nothing is amplified much.
fn lively() -> Scene {
    Scene {
        target: sheet(7, 6, 1.0),
        wind: Wind { enabled: true, ..Wind::default() },
        dt: 2e-3,
        ..Scene::default()
    }
}

/// Shakes a state, the same way every time; what is pinned stays.
fn shake<T: Real>(problem: &Problem<T>, state: &mut Particles<T>, by: f64) {
    let mut noise = common::noise();
    let mut vector = move || T::Vec3::from_f64(DVec3::new(noise(), noise(), noise()) * by);
    for (i, w) in problem.inverse_mass.iter().enumerate() {
        if *w > T::ZERO {
            state.positions[i] += vector();
            state.velocities[i] += vector();
        }
    }
}

#[test]
fn a_pinned_particle_keeps_every_bit_of_its_place_and_no_velocity() {
    // Where the springs would tear it away: in wind, torn at, at steps on which explicit methods burst.
    let tearing = Tearing { enabled: true, max_ratio: 1.03 };
    for entry in simulators::ALL {
        for precision in PRECISIONS {
            for dt in [2e-3, 0.05] {
                let scene =
                    Scene { simulator: method(entry), precision, dt, tearing: tearing.clone(), ..lively() };
                let mut world = world(&scene);
                let start = world.positions();
                for _ in 0..300 {
                    world.step();
                    let (x, v) = (world.positions(), world.velocities());
                    for (i, _) in world.pinned().iter().enumerate().filter(|(_, pinned)| **pinned) {
                        assert_eq!(
                            x[i].to_array().map(f64::to_bits),
                            start[i].to_array().map(f64::to_bits),
                            "{}",
                            entry.id
                        );
                        assert_eq!(v[i], DVec3::ZERO, "{}", entry.id);
                    }
                }
                assert!(
                    world.broken().len() > 2 || entry.model == Model::RigidConstraints,
                    "{}: nothing tore",
                    entry.id
                );
            }
        }
    }
}

fn momentum_is_kept<T: Build>(entry: &Entry, epsilon: f64) {
    let (problem, mut state) = problem::<T>(&free(sheet(6, 5, 1.0)));
    shake(&problem, &mut state, 0.2);
    let sum = |state: &Particles<T>| state.velocities.iter().map(|v| v.to_f64()).sum::<DVec3>();
    let before = sum(&state);
    // A step rounds impulses of up to 1000 N/m x 0.5 m x dt; where velocities come from positions, 4 m / dt.
    let (dt, steps, rounded) = match entry.model {
        Model::Springs => (2e-3, 500, 1000.0 * 0.5 * 2e-3),
        Model::RigidConstraints => (2e-2, 20, 4.0 / 2e-2),
    };
    advance(&problem, &mut state, &method(entry), dt, steps);
    let bound = steps as f64 * state.len() as f64 * rounded * epsilon;
    let drift = (sum(&state) - before).length();
    assert!(drift <= bound, "{}: momentum drifts by {drift:e}, round-off is {bound:e}", entry.id);
    assert!(bound < 0.1 * before.length(), "the bound says nothing: {bound:e} of {before}");
}

#[test]
fn free_flight_conserves_momentum() {
    for entry in simulators::ALL {
        momentum_is_kept::<f64>(entry, f64::EPSILON);
        momentum_is_kept::<f32>(entry, f64::from(f32::EPSILON));
    }
}

fn fresh_changes_nothing<T: Build>(settings: &SimulatorSettings) {
    let (problem, start) = problem::<T>(&lively());
    let mut one = start.clone();
    let mut many = start;
    shake(&problem, &mut one, 0.1);
    shake(&problem, &mut many, 0.1);
    let mut kept = T::build(settings).unwrap();
    for n in 1..=200 {
        let mut cost = [Cost::default(); 2];
        kept.step(&problem, &mut one, T::from_f64(2e-3), &mut cost[0]);
        T::build(settings).unwrap().step(&problem, &mut many, T::from_f64(2e-3), &mut cost[1]);
        assert_eq!(one, many, "{} in step {n}", settings.id);
        assert_eq!(cost[0], cost[1], "{} in step {n}", settings.id);
        one.time = f64::from(n) * 2e-3;
        many.time = one.time;
    }
}

#[test]
fn a_method_replaced_by_a_fresh_one_before_every_step_changes_no_bit() {
    for entry in simulators::ALL {
        fresh_changes_nothing::<f32>(&method(entry));
        fresh_changes_nothing::<f64>(&method(entry));
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits_every_time() {
    for entry in simulators::ALL {
        for precision in PRECISIONS {
            // 4225 particles: enough for the work to be shared.
            let scene = Scene {
                target: sheet(65, 65, 1.0),
                simulator: method(entry),
                precision,
                tearing: Tearing { enabled: true, max_ratio: 1.01 },
                ..lively()
            };
            let digests = [1, 2, 3, 2].map(|threads| {
                let mut world = world(&scene);
                world.set_threads(threads).unwrap();
                // A step that solves equations costs a hundred that only add up forces.
                step(&mut world, if entry.params.contains(&"iterations") { 8 } else { 30 });
                (world.digest(), world.cost())
            });
            assert!(digests.iter().all(|d| *d == digests[0]), "{}, {precision:?}: {digests:?}", entry.id);
        }
    }
}

/// Where a scene's particles are after a while, when shape, gravity and wind are turned and moved; turned back.
fn moved(
    settings: &SimulatorSettings,
    turn: fn(DVec3) -> DVec3,
    back: fn(DVec3) -> DVec3,
    by: DVec3,
) -> Vec<DVec3> {
    let scene = lively();
    let origin = world(&scene);
    let shape: Vec<DVec3> = origin.mesh().positions.iter().map(|x| turn(*x) + by).collect();
    let (mut problem, mut state) = problem_on::<f64>(&scene, origin.topology(), &shape, origin.pinned());
    problem.gravity = problem.gravity.map(turn);
    let wind = Wind { direction: turn(scene.wind.direction), ..scene.wind };
    problem.wind = Some(wind);
    advance(&problem, &mut state, settings, 2e-3, 250);
    state.positions.into_iter().map(|x| back(x - by)).collect()
}

#[test]
fn a_scene_that_is_turned_or_moved_gives_the_result_turned_or_moved() {
    let quarter = |v: DVec3| DVec3::new(-v.y, v.x, v.z);
    let back = |v: DVec3| DVec3::new(v.y, -v.x, v.z);
    let same = |v: DVec3| v;
    for entry in simulators::ALL {
        let here = moved(&method(entry), same, same, DVec3::ZERO);
        for (what, there, size) in [
            ("turned", moved(&method(entry), quarter, back, DVec3::ZERO), 10.0),
            ("moved", moved(&method(entry), same, same, DVec3::new(1000.0, -300.0, 77.0)), 1000.0),
        ] {
            // Each of 250 steps rounds coordinates of that size, and in a method that takes velocity from positions the
            // rounding goes on as a velocity: quadratic in the steps. The sheet amplifies little in half a second.
            let bound = 250.0 * 250.0 * size * f64::EPSILON * 10.0;
            let worst = here.iter().zip(&there).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            assert!(worst <= bound, "{} {what}: {worst:e}, bound {bound:e}", entry.id);
        }
    }
}

fn off_is_absent<T: Build>(settings: &SimulatorSettings) {
    for kind in 0..3 {
        let mut scene = lively();
        let world = world(&scene);
        let mut without = world.topology().clone();
        without.pairs[kind].clear();
        let solve = |scene: &Scene, topology| {
            let (problem, mut state) =
                problem_on::<T>(scene, topology, &world.mesh().positions, world.pinned());
            let cost = advance(&problem, &mut state, settings, 2e-3, 50);
            (state, cost, problem.springs.len())
        };
        let absent = solve(&scene, &without);
        let key = ["springs.stretch.enabled", "springs.shear.enabled", "springs.bend.enabled"][kind];
        scene.set_key(key, "false").unwrap();
        let off = solve(&scene, world.topology());
        assert_eq!(off.0, absent.0, "{}: kind {kind}", settings.id);
        assert_eq!((off.1, off.2), (absent.1, absent.2), "{}: kind {kind}", settings.id);
    }
}

#[test]
fn springs_that_are_switched_off_are_as_if_they_were_not_there() {
    for entry in simulators::ALL {
        off_is_absent::<f32>(&method(entry));
        off_is_absent::<f64>(&method(entry));
    }
}

#[test]
fn only_springs_that_act_are_visited_and_paid_for() {
    for entry in simulators::ALL {
        for switched_off in [&[][..], &["stretch"], &["shear", "bend"], &["stretch", "shear", "bend"]] {
            let mut scene = Scene { simulator: method(entry), ..lively() };
            for kind in switched_off {
                scene.set_key(&format!("springs.{kind}.enabled"), "false").unwrap();
            }
            let world = run(&scene, 40);
            let (cost, acting) = (world.cost(), world.acting_springs() as u64);
            // A whole number of passes over the springs that act, none over others.
            let passes = cost.spring_visits.checked_div(acting).unwrap_or(0);
            assert_eq!(cost.spring_visits, passes * acting, "{} without {switched_off:?}", entry.id);
            let expected = match entry.id {
                "explicit_euler" | "symplectic_euler" => Some((40, 40)),
                "verlet" => Some((40, 400)),
                _ => None,
            };
            if let Some((evaluations, visits)) = expected {
                assert_eq!(cost.force_evaluations, evaluations, "{}", entry.id);
                assert_eq!(cost.spring_visits, visits * acting, "{}", entry.id);
            }
        }
    }
}

#[test]
fn forces_and_tearing_that_are_off_change_no_bit_and_no_count() {
    for entry in simulators::ALL {
        let plain = Scene { simulator: method(entry), wind: Wind::default(), ..lively() };
        let mut other = plain.clone();
        for (key, value) in
            [("wind.strength", "1e6"), ("wind.frequency", "3"), ("tearing.max_ratio", "1.0001")]
        {
            other.set_key(key, value).unwrap();
        }
        let (plain, other) = (run(&plain, 100), run(&other, 100));
        assert_eq!((plain.digest(), plain.cost()), (other.digest(), other.cost()), "{}", entry.id);
        // Tearing that is on but tears nothing changes nothing either.
        let mut idle = plain.scene().clone();
        idle.tearing = Tearing { enabled: true, max_ratio: 1e6 };
        let idle = run(&idle, 100);
        assert_eq!((plain.digest(), plain.cost()), (idle.digest(), idle.cost()), "{}", entry.id);
    }
}

#[test]
fn forces_that_act_cost_no_more_evaluations() {
    for entry in spring_methods() {
        let calm = Scene { simulator: method(entry), wind: Wind::default(), ..lively() };
        let windy = Scene { wind: Wind { enabled: true, ..Wind::default() }, ..calm.clone() };
        let (calm, windy) = (run(&calm, 20), run(&windy, 20));
        assert_ne!(calm.digest(), windy.digest(), "{}", entry.id);
        assert_eq!(calm.cost().force_evaluations, windy.cost().force_evaluations, "{}", entry.id);
    }
}

/// One of the changes that a user can make while the cloth moves.
fn change(step: usize) -> Command {
    let methods = simulators::ALL.len();
    let set = |key: &str, value: String| Command::Set { key: key.to_owned(), value };
    let toggle = |kind: &str, on: bool| set(&format!("springs.{kind}.enabled"), on.to_string());
    match step % 13 {
        0 | 5 | 9 => set("simulator.id", simulators::ALL[step / 3 % methods].id.to_owned()),
        1 => set("dt", ["0.002", "0.0015", "0.001"][step / 13 % 3].to_owned()),
        2 => toggle("shear", step.is_multiple_of(2)),
        3 => Command::Pin { particles: vec![(step % 42) as u32] },
        4 => Command::Free { particles: vec![(step % 42) as u32, ((step + 20) % 42) as u32] },
        6 => toggle("bend", step % 2 == 1),
        7 => set("springs.stretch.stiffness", format!("{}", 500 + step % 500)),
        8 => set("springs.stretch.rest_scale", format!("{}", 0.9 + 0.01 * (step % 20) as f64)),
        10 => set("mass", format!("PerParticle({})", 1.0 + (step % 7) as f64)),
        11 => set("precision", ["Single", "Double"][step / 13 % 2].to_owned()),
        _ => set("wind.enabled", (step.is_multiple_of(2)).to_string()),
    }
}

#[test]
fn after_any_change_the_cloth_goes_on_as_one_freshly_started_from_its_state() {
    let mut living = world(&Scene { tearing: Tearing { enabled: true, max_ratio: 1.5 }, ..lively() });
    for n in 0..1000 {
        living.apply(change(n)).unwrap();
        let snapshot = living.snapshot();
        // Built from the scene as it stands now; it shares nothing with the living world but the state put into it.
        let mut fresh = World::new(living.scene().clone(), Place::default()).unwrap();
        assert_eq!(fresh.pinned(), living.pinned(), "change {n}: the scene says what is pinned");
        fresh.restore(&snapshot);
        living.step();
        fresh.step();
        assert_eq!(fresh.digest(), living.digest(), "after change {n}: {:?}", change(n));
        assert_eq!(fresh.cost(), living.cost(), "after change {n}: {:?}", change(n));
        assert!(!living.health().is_diverged(), "after change {n}: {:?}", living.health());
    }
    assert!(living.scene().pins != Pins::default() && living.pinned().iter().any(|p| *p));
}

#[test]
fn switching_the_method_there_and_back_between_two_steps_changes_no_bit() {
    // What a method remembers from step to step a change of method starts afresh.
    let forgetful = |entry: &&Entry| {
        let (problem, mut state) = problem::<f64>(&lively());
        advance(&problem, &mut state, &method(entry), 2e-3, 1);
        state.memory == Memory::default()
    };
    for entry in simulators::ALL.iter().filter(forgetful) {
        let scene = Scene { simulator: method(entry), ..lively() };
        let mut switched = world(&scene);
        let mut plain = world(&scene);
        for _ in 0..50 {
            for other in simulators::ALL {
                set(&mut switched, "simulator.id", other.id);
            }
            set(&mut switched, "simulator.id", entry.id);
            switched.step();
            plain.step();
            assert_eq!(switched.digest(), plain.digest(), "{}", entry.id);
        }
    }
}

#[test]
fn single_precision_follows_double_as_far_as_its_rounding_lets_it() {
    for entry in simulators::ALL {
        let end = |precision| {
            run(
                &Scene { simulator: method(entry), precision, pins: Pins::of([Pin::Row(0)]), ..lively() },
                250,
            )
        };
        let (single, double) = (end(Precision::Single).positions(), end(Precision::Double).positions());
        let worst = single.iter().zip(&double).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        // As in the test above: quadratic in the steps where velocities come from positions.
        let bound = 250.0 * 250.0 * 10.0 * f64::from(f32::EPSILON);
        assert!(worst > 0.0 && worst < bound, "{}: {worst:e}, bound {bound:e}", entry.id);
    }
}

/// Settings with which a method works as long as it ever does: the finest tolerance, the most iterations.
struct Longest(SimulatorSettings);

impl Longest {
    fn put(&mut self, info: &Info, value: Value) {
        self.0 = self.0.clone().with(info.name, value);
    }
}

impl Visitor for Longest {
    fn number(&mut self, info: &'static Info, _: &mut f64, _: f64) {
        if let Some(range) = &info.range {
            self.put(info, Value::Number(*range.start()));
        }
    }
    fn count(&mut self, info: &'static Info, _: &mut u32, _: u32) {
        if let Some(range) = &info.range {
            self.put(info, Value::Count(*range.end() as u64));
        }
    }
    fn switch(&mut self, _: &'static Info, _: &mut bool, _: bool) {}
    fn choice(&mut self, _: &'static Info, _: &'static [&'static str], _: &mut usize, _: usize) {}
    fn vector(&mut self, _: &'static Info, _: &mut DVec3, _: DVec3) {}
    fn group(&mut self, _: &'static Info, _: &mut dyn FnMut(&mut dyn Visitor)) {}
}

/// A few passes over the springs and no more, where there could be millions: so a user who does not want to wait for a step
/// does not wait.
#[test]
fn a_method_that_is_stopped_returns_soon_whatever_it_is_set_to() {
    fn passes<T: Build>(settings: &SimulatorSettings) -> f64 {
        let (mut problem, mut state) = problem::<T>(&Scene { dt: 10.0, ..lively() });
        problem.stop = Some(std::sync::Arc::new(true.into()));
        let mut cost = Cost::default();
        T::build(settings).unwrap().step(&problem, &mut state, T::from_f64(10.0), &mut cost);
        cost.spring_visits as f64 / problem.springs.len() as f64
    }
    for entry in simulators::ALL {
        let mut longest = Longest(SimulatorSettings::new(entry.id));
        entry.visit(&longest.0.params.clone(), &mut longest);
        for passes in [passes::<f32>(&longest.0), passes::<f64>(&longest.0)] {
            assert!(passes <= 10.0, "{}: {passes} passes over the springs", entry.id);
        }
    }
}
