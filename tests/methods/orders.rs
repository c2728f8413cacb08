//! Orders: the error of every method that solves the springs falls as it declares.

use super::scenes::{halvings, halvings_undamped, near, w1_error};
use tenter::simulators::{self, Entry, Model};

/// How a method is run for its order, and the steps in a quarter of a second that the halvings begin with. A method that is not
/// named runs as it is.
fn setting(id: &str) -> (String, u64) {
    let (params, steps) = match id {
        // Below dt ω² = g, 2e-5 s on the damped sheet.
        "explicit_euler" => ("", 16_000),
        "symplectic_euler" => ("", 1600),
        "implicit_euler" | "implicit_midpoint" | "bdf2" => ("(tolerance=1e-10)", 200),
        "xpbd" => ("(substeps=1)", 1600),
        "vbd" | "projective_dynamics" => ("(iterations=10)", 200),
        "rk4" => ("", 100),
        _ => ("", 400),
    };
    (format!("{id}{params}"), steps)
}

/// Checks the methods that iterate in a step, or those that do not.
fn check(iterate: bool) {
    let chosen = |entry: &&Entry| {
        // Where steps follow a tolerance instead of dt there is no order in dt.
        entry.model == Model::Springs
            && entry.params.contains(&"iterations") == iterate
            && !entry.params.contains(&"most_steps")
    };
    for entry in simulators::ALL.iter().filter(chosen) {
        let (method, first) = setting(entry.id);
        for (scene, orders) in
            [("W1 damped", halvings(&method, first, 2)), ("W1", halvings_undamped(&method, first, 2))]
        {
            println!("{method} on {scene}: {orders:.2?}, declared {}", entry.order);
            let declared = f64::from(entry.order);
            assert!(orders.iter().all(|o| (o - declared).abs() < 0.2), "{method} on {scene}: {orders:.2?}");
        }
    }
}

#[test]
fn orders_of_explicit_methods_are_those_declared() {
    check(false);
}

#[test]
fn orders_of_methods_that_iterate_are_those_declared() {
    check(true);
}

#[test]
fn errors_of_vbd_and_projective_dynamics_are_those_of_implicit_euler() {
    // They solve its equations.
    let truth = w1_error("implicit_euler", 480);
    for method in ["vbd", "projective_dynamics"] {
        near(method, w1_error(method, 480), truth, 0.01);
    }
}
