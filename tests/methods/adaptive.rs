//! Dormand-Prince with a tolerance instead of dt.

use super::scenes::{W1, bare, run, stepper, w1_error, world};
use glam::DVec3;
use tenter::forces::Cost;
use tenter::model::Particles;
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
fn the_error_falls_with_the_fifth_power_of_the_work() {
    // Two particles on a spring that swings along itself, x = a cos ωt with ω² = k (1/m1 + 1/m2) = 400, for 10 s.
    let problem = bare(&[1.0, 3.0], &[[0, 1]], &[DVec3::ZERO, DVec3::X], 300.0, 1.0);
    let runs = [1e-5, 1e-7, 1e-9].map(|tolerance| {
        let mut state = Particles::at_rest(vec![DVec3::ZERO, DVec3::X * 1.1]);
        let mut stepper = stepper(&format!("rk45(tolerance={tolerance})"));
        let (mut cost, mut error) = (Cost::default(), 0.0f64);
        for n in 1..=100 {
            stepper.step(&problem, &mut state, 0.1, &mut cost);
            state.time = 0.1 * f64::from(n);
            let (length, phase) = (state.positions[1].x - state.positions[0].x, 20.0 * state.time);
            let speed = state.velocities[1].x - state.velocities[0].x;
            error = error.max((length - 1.0 - 0.1 * phase.cos()).hypot(speed / 20.0 + 0.1 * phase.sin()));
        }
        (cost.force_evaluations as f64, error)
    });
    for pair in runs.windows(2) {
        let order = (pair[0].1 / pair[1].1).ln() / (pair[1].0 / pair[0].0).ln();
        println!("order {order:.2}: {pair:?}");
        assert!((order - 5.0).abs() < 0.5, "order {order}: {runs:?}");
    }
}

#[test]
fn short_steps_of_the_grid_cost_no_more_than_long_ones() {
    // Inner steps are about 6 ms long: the state after each millisecond is read off them.
    let work = |dt: f64| {
        let steps = (0.5 / dt).round() as u64;
        let method = "rk45(tolerance=1e-6)";
        (
            run(world(W1, method, &[&format!("dt={dt}")]), steps).cost().force_evaluations,
            w1_error(method, steps),
        )
    };
    let ((fine, fine_error), (coarse, coarse_error)) = (work(0.001), work(0.1));
    println!("{fine} evaluations, error {fine_error:.1e}; {coarse}, {coarse_error:.1e}");
    assert!((fine as f64) < 1.1 * coarse as f64);
    assert!(fine_error < 2.0 * coarse_error);
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
