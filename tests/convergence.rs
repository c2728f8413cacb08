//! Order: how the error of both Euler methods falls with dt on a cloth, against a reference of order 4 that states its own
//! uncertainty.

mod common;

use common::{problem, rk4, rms, run, step, w1, world};
use glam::DVec3;
use tenter::model::SpringKind;
use tenter::scene::Scene;
use tenter::simulators::SimulatorSettings;

/// Where the particles truly are after `seconds`, with the uncertainty: the distance to the solution of half as many
/// steps, which is 15 times the error of the finer one for a method of order 4.
fn reference(scene: &Scene, seconds: f64, steps: u64) -> (Vec<DVec3>, f64) {
    let solve = |steps: u64| {
        let (problem, mut state) = problem::<f64>(scene);
        rk4(&problem, &mut state, seconds / steps as f64, steps);
        state.positions
    };
    let (fine, coarse) = (solve(steps), solve(steps / 2));
    let uncertainty = rms(&fine, &coarse, world(scene).pinned());
    (fine, uncertainty)
}

/// RMS error of a method at `seconds` with that many steps, m.
fn error(scene: &Scene, method: &str, seconds: f64, steps: u64, truth: &[DVec3]) -> f64 {
    let scene =
        Scene { simulator: SimulatorSettings::new(method), dt: seconds / steps as f64, ..scene.clone() };
    let world = run(&scene, steps);
    assert_eq!(world.steps(), steps, "{method} diverged: {:?}", world.health());
    rms(&world.positions(), truth, world.pinned())
}

#[test]
fn the_reference_is_of_order_four() {
    let mut scene = w1();
    scene.springs.damping = 0.02;
    let uncertainty = |steps| reference(&scene, 0.25, steps).1;
    // dt ω = 0.31 and 0.16: beyond the first few tenths the leading term rules.
    let order = (uncertainty(400) / uncertainty(800)).log2();
    assert!((order - 4.0).abs() < 0.25, "{order}");
}

#[test]
fn halving_dt_halves_the_error_of_both_euler_methods_on_a_damped_cloth() {
    let mut scene = w1();
    scene.springs.damping = 0.02;
    let seconds = 0.25;
    let (truth, uncertainty) = reference(&scene, seconds, 1600);
    // Explicit Euler is stable below dt ω² = g, here 2e-5 s: 11500 steps.
    for (method, first) in [("explicit_euler", 12_800), ("symplectic_euler", 3_200)] {
        let errors: Vec<f64> =
            (0..4).map(|halvings| error(&scene, method, seconds, first << halvings, &truth)).collect();
        // No error below ten times the uncertainty counts.
        assert!(errors.iter().all(|e| *e > 10.0 * uncertainty), "{method}: {errors:?}, {uncertainty:e}");
        for pair in errors.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!((order - 1.0).abs() <= 0.1, "{method}: order {order}, errors {errors:?}");
        }
    }
}

#[test]
fn symplectic_euler_errs_on_a_swinging_cloth_as_an_independent_implementation_says() {
    // RMS over the free particles and five samples, 0.1 s apart; relative to the displacement over the same.
    const SAMPLES: u64 = 5;
    let (seconds, steps) = (0.5, 3200);
    let scene = w1();
    let start = world(&scene);
    let (problem, mut state) = problem::<f64>(&scene);
    let truth: Vec<Vec<DVec3>> = (0..SAMPLES)
        .map(|_| {
            rk4(&problem, &mut state, seconds / steps as f64, steps / SAMPLES);
            state.positions.clone()
        })
        .collect();
    let mean =
        |distances: &[f64]| (distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64).sqrt();
    let from_start: Vec<f64> = truth.iter().map(|x| rms(x, &start.positions(), start.pinned())).collect();
    // Given to three digits.
    assert!((mean(&from_start) - 0.467).abs() < 0.0005, "RMS displacement {from_start:?}");
    let (_, uncertainty) = reference(&scene, seconds, steps);
    for (steps, known) in [(200, 6.15e-3), (400, 3.07e-3), (1600, 7.66e-4), (6400, 1.91e-4)] {
        let mut world = world(&Scene { dt: seconds / steps as f64, ..scene.clone() });
        let errors: Vec<f64> = truth
            .iter()
            .map(|truth| {
                step(&mut world, steps / SAMPLES);
                rms(&world.positions(), truth, start.pinned())
            })
            .collect();
        let relative = mean(&errors) / mean(&from_start);
        assert!(uncertainty < 1e-3 * mean(&errors), "the reference is only known to {uncertainty:e} m");
        assert!((relative / known - 1.0).abs() < 0.01, "{steps} steps: {relative:e} instead of {known:e}");
    }
}

#[test]
fn a_swinging_cloth_stretches_as_much_as_an_independent_implementation_says() {
    let scene = w1();
    let (problem, mut state) = problem::<f64>(&scene);
    rk4(&problem, &mut state, 0.5 / 3200.0, 3200);
    let springs = &problem.springs;
    let stretch =
        springs.groups.iter().find(|group| group.kind == SpringKind::Stretch).map(|g| g.range.clone());
    let strains = stretch.into_iter().flatten().map(|s| {
        let [i, j] = springs.pairs[s].map(|p| state.positions[p as usize]);
        i.distance(j) / springs.rest[s] - 1.0
    });
    let largest = strains.fold(0.0, f64::max);
    // Given to three digits.
    assert!((largest - 0.167).abs() < 0.0005, "{largest}");
}

#[test]
fn a_step_beyond_the_limit_of_the_swinging_cloth_diverges() {
    // dt ω = 2.5.
    let world = run(&Scene { dt: 0.005, ..w1() }, 100);
    assert!(world.health().is_diverged(), "{:?}", world.health());
    assert!(world.steps() < 100);
}
