//! All methods that solve the springs come to rest at the same place.

use super::scenes::{Reference, W1, scene, world};
use glam::DVec3;
use tenter::simulators::{self, Entry, Model};
use tenter::world::{Command, World};

/// Damped enough to come to rest.
const DAMPED: &str = "air_damping=0.5";

/// W1 at rest: implicit Euler at a long dt, which leaves no force on any free particle.
fn at_rest() -> World {
    let mut world = world(W1, "implicit_euler(tolerance=1e-12,newton_steps=1000)", &[DAMPED, "dt=1.0"]);
    (0..200).for_each(|_| world.step());
    let still = vec![DVec3::ZERO; world.positions().len()];
    let forces = Reference::new(&scene(W1, &[DAMPED])).forces(&world.positions(), &still);
    let largest = forces.iter().map(|f| f.length()).fold(0.0, f64::max);
    println!("largest force {largest:.1e} N");
    // A weight is 0.2 N; the softest motion has about as many newtons a metre.
    assert!(largest < 1e-9, "{largest:e} N");
    world
}

/// W1 at rest, then a free corner drawn aside by some centimetres and let go: the same place to rest at.
fn disturbed() -> (World, Vec<DVec3>) {
    let mut world = at_rest();
    let rest = world.positions();
    let act = |world: &mut World, command: Command| world.apply(command).expect("accepted");
    let set = |key: &str, value: &str| Command::Set { key: key.into(), value: value.into() };
    act(&mut world, set("simulator", "(id: \"symplectic_euler\", params: {})"));
    act(&mut world, set("dt", "1e-3"));
    // Nearly as much as lets the slowest motion die away without swinging.
    act(&mut world, set("air_damping", "0.1"));
    act(&mut world, set("springs.damping", "0.02"));
    act(&mut world, Command::Grab { particles: vec![99] });
    let to = rest[99] + DVec3::new(0.02, 0.01, 0.03);
    act(&mut world, Command::Drag { particle: 99, to, steps: 50 });
    (0..50).for_each(|_| world.step());
    act(&mut world, Command::Release { particles: vec![99] });
    let apart = world.positions().iter().zip(&rest).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(apart > 0.03, "{apart} m");
    (world, rest)
}

#[test]
fn explicit_methods_come_to_rest_where_newtons_method_does() {
    check(false);
}

#[test]
fn methods_that_iterate_come_to_rest_where_newtons_method_does() {
    check(true);
}

/// Lets the methods that iterate in a step, or the others, come to rest.
fn check(iterate: bool) {
    let (mut world, rest) = disturbed();
    let snapshot = world.snapshot();
    // Where a solver is not told a tolerance, the cloth settles first with few iterations and then with enough. XPBD is off by
    // what its directions turn within a substep, which falls as its square whatever the iterations are.
    let once = |id: &str, params: &str, dt: f64| vec![(format!("(id: \"{id}\", params: {params})"), dt, 6.0)];
    let twice = |id: &str, rough: &str, fine: &str| {
        vec![
            (format!("(id: \"{id}\", params: {rough})"), 0.01, 5.0),
            (format!("(id: \"{id}\", params: {fine})"), 0.01, 2.5),
        ]
    };
    let mut off_by = Vec::new();
    let chosen =
        |entry: &&Entry| entry.model == Model::Springs && entry.params.contains(&"iterations") == iterate;
    for entry in simulators::ALL.iter().filter(chosen) {
        let phases = match entry.id {
            "explicit_euler" => once(entry.id, "{}", 2e-5),
            "implicit_euler" | "bdf2" => once(entry.id, r#"{"tolerance": 1e-9}"#, 0.02),
            // What is much faster than dt dies away slowly in it.
            "implicit_midpoint" => once(entry.id, r#"{"tolerance": 1e-9}"#, 0.005),
            "rk45" => once(entry.id, r#"{"tolerance": 1e-8}"#, 0.01),
            "xpbd" => twice(
                entry.id,
                r#"{"substeps": 20, "iterations": 5}"#,
                r#"{"substeps": 100, "iterations": 20}"#,
            ),
            "vbd" => twice(entry.id, "{}", r#"{"iterations": 200}"#),
            "projective_dynamics" => twice(entry.id, "{}", r#"{"iterations": 100}"#),
            _ => once(entry.id, "{}", 1e-3),
        };
        world.restore(&snapshot);
        for (simulator, dt, seconds) in phases {
            let set = |key: &str, value: String| Command::Set { key: key.into(), value };
            world.apply(set("simulator", simulator)).expect("accepted");
            world.apply(set("dt", dt.to_string())).expect("accepted");
            (0..(seconds / dt) as u32).for_each(|_| world.step());
        }
        let pairs = rest.iter().zip(world.positions());
        let off = pairs.map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
        println!("{}: {off:.1e} m off", entry.id);
        off_by.push((entry.id, off));
    }
    assert!(off_by.iter().all(|(_, off)| *off < 1e-6), "{off_by:?}");
}

#[test]
fn xpbd_rests_as_far_off_as_an_independent_one() {
    let mut world = at_rest();
    let (rest, snapshot) = (world.positions(), world.snapshot());
    for (dt, iterations, expected) in
        [("0.016666666666666666", 10, 4.9e-3), ("0.016666666666666666", 100, 1.3e-4)]
    {
        world.restore(&snapshot);
        let set = |key: &str, value: String| Command::Set { key: key.into(), value };
        let params = format!(r#"(id: "xpbd", params: {{"substeps": 1, "iterations": {iterations}}})"#);
        world.apply(set("simulator", params)).expect("accepted");
        world.apply(set("dt", dt.into())).expect("accepted");
        (0..600).for_each(|_| world.step());
        let off = super::scenes::rms(&world, &rest, &world.positions());
        println!("{iterations} iterations at {dt} s: {off:.1e} m off, there {expected:.1e}");
        assert!(off < 2.0 * expected, "{off:e} m");
    }
}
