//! The implicit methods: errors, orders, energy.

use super::scenes::{W1, near, run, w1_error, world};
use tenter::world::{Cause, Health};

#[test]
fn errors_are_those_that_an_independent_one_has() {
    for (steps, euler, midpoint) in [(30, 4.05e-2, 6.43e-3), (120, 1.62e-2, 4.78e-4), (480, 5.60e-3, 3.16e-5)]
    {
        near(&format!("implicit Euler, {steps} steps"), w1_error("implicit_euler", steps), euler, 0.01);
        near(
            &format!("implicit midpoint, {steps} steps"),
            w1_error("implicit_midpoint", steps),
            midpoint,
            0.01,
        );
    }
}

#[test]
fn one_newton_step_is_nearly_as_good_as_all_of_them_where_the_step_is_short() {
    let (one, all) = (w1_error("implicit_euler(newton_steps=1)", 120), w1_error("implicit_euler", 120));
    near("one Newton step", one, all, 0.02);
}

#[test]
fn equations_that_are_not_solved_are_told() {
    let settings = ["dt=0.016666666666666666"];
    let starved = run(world(W1, "implicit_euler(iterations=1)", &settings), 10);
    assert!(
        matches!(starved.health(), Health::Unsettled { cause: Cause::Unsolved, .. }),
        "{:?}",
        starved.health()
    );
    assert!(starved.cost().unsolved_steps > 0 && starved.cost().residual > 1.0);
    let fed = run(world(W1, "implicit_euler", &settings), 10);
    assert_eq!((fed.health(), fed.cost().unsolved_steps), (Health::Ok, 0));
    assert!(fed.cost().solver_iterations >= 10 && fed.cost().residual <= 1.0);
}
