//! What every method promises, and what theory promises of some.

use super::scenes::{bare, stepper, world};
use glam::{DQuat, DVec3};
use tenter::forces::{Cost, Problem, Spectrum};
use tenter::model::Particles;
use tenter::simulators;

/// A sheet of 6 x 6 of unequal masses, unless they are asked to be equal, that flies, turns and swings.
fn flying(equal: bool) -> (Problem<f64>, Particles<f64>) {
    flying_sheet(6, equal)
}

/// The same of n x n.
fn flying_sheet(n: u32, equal: bool) -> (Problem<f64>, Particles<f64>) {
    let at = move |c: u32, r: u32| r * n + c;
    let shape: Vec<DVec3> =
        (0..n * n).map(|i| DVec3::new(f64::from(i % n), 0.0, f64::from(i / n)) * 0.1).collect();
    let across = (0..n).flat_map(|r| (0..n - 1).map(move |c| [at(c, r), at(c + 1, r)]));
    let along = (0..n - 1).flat_map(|r| (0..n).map(move |c| [at(c, r), at(c, r + 1)]));
    let aslant = (0..n - 1).flat_map(|r| (0..n - 1).map(move |c| [at(c, r), at(c + 1, r + 1)]));
    let pairs: Vec<[u32; 2]> = across.chain(along).chain(aslant).collect();
    let mass: Vec<f64> = (0..n * n).map(|i| if equal { 0.02 } else { 0.01 + 0.001 * f64::from(i) }).collect();
    let problem = bare(&mass, &pairs, &shape, 300.0, 0.95);
    let mut state = Particles::at_rest(shape);
    for (i, (x, v)) in state.positions.iter_mut().zip(&mut state.velocities).enumerate() {
        let phase = i as f64;
        *v = DVec3::new(1.0, 2.0, -0.5) + DVec3::new(0.3, 1.0, 0.2).cross(*x) * 3.0;
        *x += DVec3::new(phase.sin(), (2.0 * phase).sin(), (3.0 * phase).sin()) * 0.005;
    }
    (problem, state)
}

fn momentum(problem: &Problem<f64>, state: &Particles<f64>) -> DVec3 {
    problem.mass.iter().zip(&state.velocities).map(|(m, v)| *v * *m).sum()
}

fn angular_momentum(problem: &Problem<f64>, state: &Particles<f64>) -> DVec3 {
    let particles = problem.mass.iter().zip(&state.positions).zip(&state.velocities);
    particles.map(|((m, x), v)| x.cross(*v) * *m).sum()
}

#[test]
fn free_flight_keeps_momentum() {
    for entry in simulators::ALL {
        let (problem, mut state) = flying(entry.id == "verlet");
        let before = momentum(&problem, &state);
        let mut stepper = stepper(entry.id);
        for _ in 0..100 {
            stepper.step(&problem, &mut state, 1e-3, &mut Cost::default());
        }
        let drift = (momentum(&problem, &state) - before).length() / before.length();
        println!("{}: {drift:.1e}", entry.id);
        // Round-off of the positions, over dt where velocities are taken from them, adds up over the steps.
        assert!(drift < 1e-11, "{}: {drift:e}", entry.id);
    }
}

#[test]
fn free_flight_keeps_angular_momentum_where_theory_says_so() {
    for method in ["symplectic_euler", "implicit_midpoint(tolerance=1e-13)"] {
        let (problem, mut state) = flying(false);
        let before = angular_momentum(&problem, &state);
        let mut stepper = stepper(method);
        for _ in 0..100 {
            stepper.step(&problem, &mut state, 1e-3, &mut Cost::default());
        }
        let drift = (angular_momentum(&problem, &state) - before).length() / before.length();
        println!("{method}: {drift:.1e}");
        assert!(drift < 1e-11, "{method}: {drift:e}");
    }
}

/// Kinetic and elastic energy.
fn energy(problem: &Problem<f64>, state: &Particles<f64>) -> f64 {
    let kinetic = problem.mass.iter().zip(&state.velocities).map(|(m, v)| 0.5 * m * v.length_squared());
    let springs = &problem.springs;
    let elastic = springs.pairs.iter().zip(&springs.rest).map(|(pair, rest)| {
        let [i, j] = pair.map(|p| state.positions[p as usize]);
        0.5 * 300.0 * (i.distance(j) - rest).powi(2)
    });
    kinetic.sum::<f64>() + elastic.sum::<f64>()
}

/// Largest distance of the energy from that at the start, as a part of it, in the first and in the second half of an undamped
/// flight of a sheet of n x n with dt ω = 0.5, looked at every tenth step, and the energy lost in the end.
fn energy_in_flight(method: &str, n: u32, steps: u32) -> (f64, f64, f64) {
    let (problem, mut state) = flying_sheet(n, false);
    let dt = 0.5 / Spectrum::of(&problem, &state).omega_max();
    let mut stepper = stepper(method);
    let start = energy(&problem, &state);
    let mut halves = [0.0f64; 2];
    for step in 0..steps {
        stepper.step(&problem, &mut state, dt, &mut Cost::default());
        if step % 10 == 0 {
            let half = &mut halves[(step >= steps / 2) as usize];
            *half = half.max((energy(&problem, &state) / start - 1.0).abs());
        }
    }
    let lost = 1.0 - energy(&problem, &state) / start;
    println!("{method}, {n} x {n}: within {:.1e}, then {:.1e}, lost {lost:.1e}", halves[0], halves[1]);
    (halves[0], halves[1], lost)
}

#[test]
fn undamped_flight_keeps_energy_over_a_million_steps() {
    // The energy that they do keep differs by dt v·F/2 in symplectic Euler, at most dt ω/2 of that of a motion; by a quarter of
    // (dt ω)² in the others.
    for (method, n, bound) in [
        ("symplectic_euler", 4, 0.25),
        ("velocity_verlet", 4, 0.0625),
        // Its equations are solved in every step: fewer particles.
        ("implicit_midpoint(tolerance=1e-9)", 2, 0.0625),
    ] {
        let (first, second, _) = energy_in_flight(method, n, 1_000_000);
        // Chaotic motion comes to its extremes late: a second half that is like the first may still pass its largest.
        assert!(first < bound && second < 1.5 * first, "{method}: {first:e}, {second:e}");
    }
}

#[test]
fn undamped_flight_tells_what_it_loses() {
    // What stretches dies away, what flies and turns as one piece stays.
    for method in ["implicit_euler", "xpbd(substeps=1)", "bdf2"] {
        let (_, _, lost) = energy_in_flight(method, 6, 2000);
        assert!(lost > 0.0 && lost < 0.5, "{method} lost {lost}");
    }
}

#[test]
fn implicit_euler_damps_an_oscillation_as_theory_says() {
    // Two particles on a spring that swings along itself, which is linear: x'' = -ω² x, ω² = k (1/m1 + 1/m2).
    let shape = [DVec3::ZERO, DVec3::X];
    let problem = bare(&[1.0, 3.0], &[[0, 1]], &shape, 300.0, 1.0);
    let omega_squared = 300.0 * (1.0 + 1.0 / 3.0);
    for (method, factor) in [
        ("implicit_euler(tolerance=1e-12)", (|z: f64| 1.0 / (1.0 + z)) as fn(f64) -> f64),
        ("implicit_midpoint(tolerance=1e-12)", |_| 1.0),
    ] {
        for dt in [1e-3, 1e-2, 0.1] {
            let mut state = Particles::at_rest(vec![DVec3::ZERO, DVec3::X * 1.1]);
            let start = energy(&problem, &state);
            let mut stepper = stepper(method);
            (0..20).for_each(|_| stepper.step(&problem, &mut state, dt, &mut Cost::default()));
            let (kept, theory) =
                ((energy(&problem, &state) / start).powf(0.05), factor(dt * dt * omega_squared));
            println!(
                "{method}, dt ω = {:.2}: keeps {kept:.4} of its energy a step",
                dt * omega_squared.sqrt()
            );
            assert!((kept / theory - 1.0).abs() < 1e-6, "{method}, dt {dt}: {kept}, {theory}");
        }
    }
}

#[test]
fn pinned_particles_stay_to_the_bit_and_held_ones_move_as_they_are_told() {
    for entry in simulators::ALL {
        let (mut problem, mut state) = flying(true);
        problem.gravity = Some(DVec3::new(0.0, -10.0, 0.0));
        problem.set_fixed(0, true);
        problem.set_fixed(35, true);
        state.velocities[0] = DVec3::ZERO;
        state.velocities[35] = DVec3::new(0.1, 0.2, -0.3);
        let (pinned, held) = (state.positions[0], state.positions[35]);
        let mut stepper = stepper(entry.id);
        for step in 1..=20 {
            stepper.step(&problem, &mut state, 1e-3, &mut Cost::default());
            assert_eq!((state.positions[0], state.velocities[0]), (pinned, DVec3::ZERO), "{}", entry.id);
            let goal = held + state.velocities[35] * (1e-3 * f64::from(step));
            assert!(state.positions[35].distance(goal) < 1e-14, "{}", entry.id);
            assert_eq!(state.velocities[35], DVec3::new(0.1, 0.2, -0.3), "{}", entry.id);
        }
    }
}

#[test]
fn velocity_verlet_computes_one_force_a_step_and_two_where_a_hand_moves() {
    let (mut problem, mut state) = flying(true);
    problem.spring_damping = 0.1;
    let mut stepper = stepper("velocity_verlet");
    let mut evaluations = |problem: &Problem<f64>, state: &mut Particles<f64>| {
        let mut cost = Cost::default();
        stepper.step(problem, state, 1e-3, &mut cost);
        cost.force_evaluations
    };
    let counts: Vec<u64> = (0..4).map(|_| evaluations(&problem, &mut state)).collect();
    assert_eq!(counts, [2, 1, 1, 1]);
    // What a hand does jumps from step to step, and so would the force that was kept: the step is that without memory.
    problem.set_fixed(35, true);
    for velocity in [DVec3::X, DVec3::Y, DVec3::Z] {
        state.velocities[35] = velocity;
        let mut afresh = state.clone();
        afresh.memory.forget();
        assert_eq!([evaluations(&problem, &mut state), evaluations(&problem, &mut afresh)], [2, 2]);
        assert_eq!(state, afresh);
    }
    state.velocities[35] = DVec3::ZERO;
    let counts: Vec<u64> = (0..3).map(|_| evaluations(&problem, &mut state)).collect();
    assert_eq!(counts, [2, 1, 1]);
}

#[test]
fn a_fresh_instance_between_steps_changes_no_bit() {
    for entry in simulators::ALL {
        let (problem, state) = flying(true);
        let (mut one, mut fresh) = (state.clone(), state);
        let mut stepper_of_one = stepper(entry.id);
        for _ in 0..20 {
            stepper_of_one.step(&problem, &mut one, 1e-3, &mut Cost::default());
            stepper(entry.id).step(&problem, &mut fresh, 1e-3, &mut Cost::default());
        }
        assert_eq!(one, fresh, "{}", entry.id);
    }
}

#[test]
fn a_snapshot_carries_what_a_method_remembers() {
    for entry in simulators::ALL {
        let mut world = world("(target: Grid(columns: 6, rows: 6, spacing: 1.0))", entry.id, &["dt=0.005"]);
        (0..10).for_each(|_| world.step());
        let snapshot = world.snapshot();
        (0..10).for_each(|_| world.step());
        let end = world.digest();
        world.restore(&snapshot);
        (0..10).for_each(|_| world.step());
        assert_eq!(world.digest(), end, "{}", entry.id);
    }
}

#[test]
fn threads_change_no_bit() {
    for entry in simulators::ALL {
        let end = |threads: usize| {
            let sheet = "(target: Grid(columns: 70, rows: 70, spacing: 1.0))";
            let mut world = world(sheet, entry.id, &["dt=0.001"]);
            world.set_threads(threads).expect("threads");
            (0..3).for_each(|_| world.step());
            world.digest()
        };
        assert_eq!(end(1), end(2), "{}", entry.id);
    }
}

#[test]
fn a_moved_and_turned_scene_has_the_moved_and_turned_result() {
    let (turn, shift) = (DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.0), DVec3::new(3.0, -1.0, 2.0));
    for entry in simulators::ALL {
        let (problem, state) = flying(true);
        let mut turned = state.clone();
        turned.positions.iter_mut().for_each(|x| *x = turn * *x + shift);
        turned.velocities.iter_mut().for_each(|v| *v = turn * *v);
        let run = |mut state: Particles<f64>| {
            let mut stepper = stepper(entry.id);
            (0..20).for_each(|_| stepper.step(&problem, &mut state, 1e-3, &mut Cost::default()));
            state
        };
        let (plain, turned) = (run(state), run(turned));
        let pairs = plain.positions.iter().zip(&turned.positions);
        let worst = pairs.map(|(a, b)| (turn * *a + shift).distance(*b)).fold(0.0, f64::max);
        println!("{}: {worst:.1e}", entry.id);
        // A solver stops elsewhere by its tolerance of a millionth of a spring.
        assert!(worst < 1e-8, "{}: {worst:e}", entry.id);
    }
}
