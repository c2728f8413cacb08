//! Vertex block descent and projective dynamics: on their way to implicit Euler.

use super::scenes::{W1, near, rms, run, w1_error, world};

#[test]
fn many_sweeps_are_implicit_euler() {
    for method in ["vbd(iterations=2000)"] {
        for (steps, expected) in [(30, 4.05e-2), (120, 1.62e-2)] {
            near(&format!("{method}, {steps} steps"), w1_error(method, steps), expected, 0.01);
        }
    }
}

#[test]
fn more_sweeps_come_nearer() {
    let end = |method: &str| run(world(W1, method, &["dt=0.008333333333333333"]), 60);
    let truth = end("implicit_euler(tolerance=1e-10)");
    let mut before = f64::INFINITY;
    for iterations in [10, 40, 160, 640] {
        let world = end(&format!("vbd(iterations={iterations})"));
        let apart = rms(&world, &world.positions(), &truth.positions());
        println!("{iterations} sweeps: {apart:.1e} m");
        assert!(apart < 0.7 * before || apart < 1e-9);
        before = apart;
    }
}
