//! All methods that solve the springs come to rest at the same place.

use super::scenes::{Reference, W1, scene, world};
use glam::DVec3;
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

#[test]
fn methods_rest_where_newtons_method_does() {
    let mut world = at_rest();
    let rest = world.positions();
    let snapshot = world.snapshot();
    // XPBD is off by what its directions turn within a substep, which falls as its square whatever the iterations are.
    for (id, params, dt) in [
        ("symplectic_euler", "{}", 1e-3),
        ("rk45", r#"{"tolerance": 1e-9}"#, 0.01),
        ("implicit_euler", "{}", 0.1),
        ("implicit_midpoint", "{}", 0.01),
        ("bdf2", "{}", 0.1),
        ("xpbd", r#"{"substeps": 100, "iterations": 20}"#, 0.01),
        ("vbd", r#"{"iterations": 200}"#, 0.01),
        ("projective_dynamics", r#"{"iterations": 100}"#, 0.01),
    ] {
        world.restore(&snapshot);
        let set = |key: &str, value: String| Command::Set { key: key.into(), value };
        world.apply(set("simulator", format!("(id: \"{id}\", params: {params})"))).expect("accepted");
        world.apply(set("dt", dt.to_string())).expect("accepted");
        let steps = (0.2 / dt) as u32;
        (0..steps).for_each(|_| world.step());
        let pairs = rest.iter().zip(world.positions());
        let off = pairs.map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
        println!("{id}: {off:.1e} m off");
        assert!(off < 1e-6, "{id}: {off:e} m off");
    }
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
