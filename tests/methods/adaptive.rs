//! Dormand-Prince with a tolerance instead of dt.

use super::scenes::{W1, run, w1_error, world};
use tenter::world::{Cause, Command, Health};

#[test]
fn the_tolerance_and_not_dt_says_how_accurate_it_is() {
    let errors = |steps| [1e-4, 1e-6, 1e-8].map(|t| w1_error(&format!("rk45(tolerance={t})"), steps));
    let (coarse, fine) = (errors(5), errors(50));
    println!("{coarse:?} {fine:?}");
    for (a, b) in coarse.iter().zip(fine) {
        assert!(*a < 10.0 * b && b < 10.0 * a);
    }
    assert!(coarse[2] < 1e-6 && coarse[1] < 1e-4 && coarse[2] < coarse[1] && coarse[1] < coarse[0]);
}

#[test]
fn steps_that_run_out_are_told() {
    let world = run(world(W1, "rk45(most_steps=3)", &["dt=0.1"]), 5);
    let told = match world.health() {
        Health::Unsettled { cause, .. } => cause == Cause::Unsolved,
        Health::Diverged { .. } => true,
        Health::Ok => false,
    };
    assert!(told, "{:?}", world.health());
}

#[test]
fn the_controller_starts_afresh_after_a_change() {
    let mut changed = run(world(W1, "rk45", &["dt=0.01"]), 5);
    let snapshot = changed.snapshot();
    let set = |key: &str, value: &str| Command::Set { key: key.into(), value: value.into() };
    changed.apply(set("dt", "0.02")).expect("accepted");
    changed.step();
    // The same way without a memory: another method in between, with no step.
    let mut fresh = world(W1, "rk45", &["dt=0.01"]);
    fresh.restore(&snapshot);
    fresh.apply(set("simulator.id", "symplectic_euler")).expect("accepted");
    fresh.apply(set("simulator.id", "rk45")).expect("accepted");
    fresh.apply(set("dt", "0.02")).expect("accepted");
    fresh.step();
    assert_eq!(changed.digest(), fresh.digest());
}
