//! Vertex block descent and projective dynamics: on their way to implicit Euler.

use super::scenes::{W1, near, rms, run, w1_error, world};

#[test]
fn many_iterations_are_implicit_euler() {
    for method in ["vbd(iterations=100)", "projective_dynamics(iterations=60)"] {
        near(method, w1_error(method, 120), 1.62e-2, 0.01);
    }
}

#[test]
fn more_iterations_come_nearer() {
    let end = |method: &str| run(world(W1, method, &["dt=0.008333333333333333"]), 60);
    let truth = end("implicit_euler(tolerance=1e-10)");
    for method in ["vbd", "projective_dynamics"] {
        let mut before = f64::INFINITY;
        for iterations in [5, 20, 80] {
            let world = end(&format!("{method}(iterations={iterations})"));
            let apart = rms(&world, &world.positions(), &truth.positions());
            println!("{method}, {iterations} iterations: {apart:.1e} m");
            assert!(
                apart < 0.7 * before,
                "{method}: {apart:e} m after {iterations} iterations, {before:e} m before"
            );
            before = apart;
        }
    }
}

#[test]
fn acceleration_comes_nearer_in_the_same_iterations() {
    let end = |method: &str| run(world(W1, method, &["dt=0.008333333333333333"]), 60);
    let truth = end("implicit_euler(tolerance=1e-10)");
    for method in ["vbd", "projective_dynamics"] {
        let apart = |acceleration: f64| {
            let world = end(&format!("{method}(iterations=20,acceleration={acceleration})"));
            rms(&world, &world.positions(), &truth.positions())
        };
        let (plain, accelerated) = (apart(0.0), apart(0.8));
        println!("{method}: {plain:.1e} m, accelerated {accelerated:.1e} m");
        assert!(accelerated < 0.5 * plain, "{method}: {plain:e} m, accelerated {accelerated:e} m");
    }
}
