//! XPBD, and Verlet with relaxation.

use super::scenes::{W1, bare, near, rms, run, stepper, w1_error, world};
use glam::DVec3;
use tenter::forces::Cost;
use tenter::model::Particles;

#[test]
fn xpbd_with_small_steps_has_the_errors_that_an_independent_one_has() {
    // One iteration a step; what remains depends on the order of the springs.
    for (steps, expected) in [(120, 3.1e-2), (480, 5.9e-3), (1920, 1.6e-3), (7680, 4.1e-4)] {
        let method = "xpbd(substeps=1,iterations=1)";
        near(&format!("{steps} steps"), w1_error(method, steps), expected, 0.2);
    }
    for (iterations, expected) in [(10, 4.3e-2), (100, 3.9e-2), (1000, 3.9e-2)] {
        let method = format!("xpbd(substeps=1,iterations={iterations})");
        near(&format!("{iterations} iterations"), w1_error(&method, 30), expected, 0.2);
    }
}

#[test]
fn xpbd_keeps_its_stiffness_from_few_iterations_to_many() {
    let strain = |iterations: u32| {
        let method = format!("xpbd(substeps=10,iterations={iterations})");
        run(world(W1, &method, &["dt=0.01", "air_damping=0.5"]), 100).measures().max_strain
    };
    near("largest strain", strain(20), strain(200), 0.01);
}

#[test]
fn relaxation_keeps_momentum_where_it_weighs_masses_and_loses_it_where_it_halves() {
    // Two free particles of 1 and 1e6 kg on a spring twice its rest length.
    let lost = |correction: &str| {
        let problem = bare(&[1.0, 1e6], &[[0, 1]], &[DVec3::X, DVec3::ZERO], 1000.0, 0.5);
        let mut state = Particles::at_rest(vec![DVec3::X, DVec3::ZERO]);
        let mut stepper = stepper(&format!("verlet(sweeps=3,correction={correction})"));
        stepper.step(&problem, &mut state, 0.01, &mut Cost::default());
        let momenta: Vec<DVec3> = (0..2).map(|i| state.velocities[i] * problem.mass[i]).collect();
        (momenta[0] + momenta[1]).length() / momenta[0].length()
    };
    assert!(lost("HalfHalf") > 0.05);
    assert!(lost("MassWeighted") < 1e-12);
}

#[test]
fn the_order_of_constraints_is_part_of_relaxation() {
    // What the order changes on a sheet of 10 x 10 is a few millimetres.
    let hung = |order: &str| run(world(W1, &format!("verlet(sweeps=50,order={order})"), &["dt=0.01"]), 50);
    let (creation, coloured) = (hung("Creation"), hung("Coloured"));
    let apart = rms(&creation, &creation.positions(), &coloured.positions());
    println!("apart: {apart:.1e} m");
    assert!(apart > 1e-6 && apart < 1e-2);
}
