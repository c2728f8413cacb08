//! Closed forms: what physics says exactly, and how far a method of its order may be from it at the step given.
//!
//! For y' = λ y a method of order 1 errs by λ² dt t / 2 at first order, higher orders by less; tolerances are twice the
//! leading term, so that the next terms fit in and a wrong factor anywhere does not.
#![allow(clippy::unwrap_used)]

mod common;

use common::{
    all_finite, converged, free, hanging, method, one_step_methods, only_stretch, run, set, sheet,
    spring_methods, step, verlet, world,
};
use glam::DVec3;
use std::f64::consts::TAU;
use tenter::forces::gravity::Gravity;
use tenter::forces::springs::Kind;
use tenter::forces::wind::Wind;
use tenter::scene::{Pin, Pins, Scene};
use tenter::simulators;

/// Round-off of one operation in double precision.
const EPS: f64 = f64::EPSILON;

#[test]
fn a_free_particle_falls_by_half_g_t_squared() {
    let (g, dt, steps) = (9.81, 0.01, 100);
    for entry in one_step_methods() {
        let scene = Scene {
            gravity: Gravity { magnitude: g, ..Gravity::default() },
            simulator: method(entry),
            dt,
            ..free(sheet(1, 1, 1.0))
        };
        let world = run(&scene, steps);
        let t = world.time();
        // Constant acceleration: order 1 is out by g dt t / 2 (whose sign says which Euler it is), higher orders by nothing.
        let lag = if entry.order == 1 { g * dt * t / 2.0 } else { 0.0 };
        let round_off = steps as f64 * EPS * g * t / dt;
        let (x, v) = (world.positions()[0], world.velocities()[0]);
        assert!((x.y + g * t * t / 2.0).abs() <= lag + round_off, "{}: y = {}", entry.id, x.y);
        assert!((v.y + g * t).abs() <= round_off, "{}: v = {}", entry.id, v.y);
        assert_eq!((x.x, x.z), (0.0, 0.0), "{}", entry.id);
    }
}

/// Two particles 1 m apart, the left one pinned, on a spring of rest length 0.9 m: along x the motion is linear.
fn oscillator(k: f64, spring_damping: f64, air_damping: f64) -> Scene {
    let mut springs = only_stretch(k);
    springs.stretch.rest_scale = 0.9;
    springs.damping = spring_damping;
    Scene { pins: Pins::of([Pin::Particle(0)]), springs, air_damping, ..free(sheet(2, 1, 1.0)) }
}

/// Elongation of the oscillator's spring, m.
fn elongation(world: &tenter::world::World) -> f64 {
    let x = world.positions();
    x[1].x - x[0].x - 0.9
}

#[test]
fn an_oscillator_swings_with_the_period_and_the_decay_of_its_closed_form() {
    let (k, amplitude, per_period) = (100.0f64, 0.1, 10_000);
    let omega = k.sqrt();
    for (spring_damping, air_damping) in [(0.0, 0.0), (1.5, 0.5), (0.0, 2.0)] {
        let gamma = f64::midpoint(spring_damping, air_damping);
        let damped_omega = (k - gamma * gamma).sqrt();
        let dt = TAU / damped_omega / f64::from(per_period);
        for entry in spring_methods().filter(|entry| entry.id != "bdf2") {
            let with = |dt| {
                world(&Scene { simulator: method(entry), dt, ..oscillator(k, spring_damping, air_damping) })
            };
            let (mut coarse, mut fine) = (with(dt), with(dt / 2.0));
            let order = entry.order.cast_signed();
            let weight = 2f64.powi(order);
            for n in 1..=2 * per_period {
                coarse.step();
                step(&mut fine, 2);
                let t = f64::from(n) * dt;
                let phase = damped_omega * t;
                let exact =
                    amplitude * (-gamma * t).exp() * (phase.cos() + gamma / damped_omega * phase.sin());
                // |λ| of (x, v/ω) is at most ω + 2γ; see the top of this file. Round-off of 1 m gathers beside it.
                let rate = omega + 2.0 * gamma;
                let round_off = EPS * f64::from(n).powi(2);
                let tolerance = amplitude * rate * t * (rate * dt).powi(order) + round_off;
                let error = (elongation(&coarse) - exact).abs();
                assert!(error <= tolerance, "{} at {t}: {error:e} over {tolerance:e}", entry.id);
                // Two steps lengths without their leading error (Richardson): one order more, with the square of λ t in
                // front, since that error is itself carried on with an error.
                let better = (weight * elongation(&fine) - elongation(&coarse)) / (weight - 1.0);
                let tolerance =
                    amplitude * rate * t * (1.0 + rate * t) * (rate * dt).powi(order + 1) + 10.0 * round_off;
                let error = (better - exact).abs();
                assert!(error <= tolerance, "{} at {t}: {error:e} over {tolerance:e} extrapolated", entry.id);
            }
        }
    }
}

#[test]
fn symplectic_euler_keeps_amplitude_and_period_of_an_oscillator_for_ever() {
    let k = 100.0f64;
    let dt = 0.02;
    let theta = k.sqrt() * dt;
    let mut world = world(&Scene { dt, ..oscillator(k, 0.0, 0.0) });
    // Its steps solve x(n+1) - 2 x(n) + x(n-1) = -θ² x(n) exactly: an angle of 2 asin(θ/2) a step, and from x = A, v = 0
    // an amplitude of A / cos(angle / 2).
    let angle = 2.0 * (theta / 2.0).asin();
    let amplitude = 0.1 / (angle / 2.0).cos();
    for n in 0..20_000 {
        let exact = amplitude * (angle * f64::from(n) + angle / 2.0).cos();
        // Round-off of 1 m coordinates accumulates in phase, at worst as n².
        let tolerance = EPS * 10.0 * f64::from(n + 1).powi(2);
        assert!((elongation(&world) - exact).abs() <= tolerance, "step {n}");
        world.step();
    }
}

#[test]
fn explicit_euler_feeds_an_oscillator_by_its_known_factor() {
    let k = 100.0f64;
    let dt = 0.001;
    let scene = Scene {
        simulator: simulators::SimulatorSettings::new("explicit_euler"),
        dt,
        ..oscillator(k, 0.0, 0.0)
    };
    let mut world = world(&scene);
    step(&mut world, 3000);
    let e = elongation(&world);
    let v = world.velocities()[1].x;
    let size = (e * e + v * v / k).sqrt();
    // |1 + i ω dt| a step, exactly; round-off is multiplied as often as it is made.
    let exact = 0.1 * (1.0 + k * dt * dt).powf(1500.0);
    assert!((size / exact - 1.0).abs() < 3000.0 * 10.0 * EPS / 0.1, "{size} instead of {exact}");
}

#[test]
fn two_free_particles_keep_their_centre_of_mass_where_it_is() {
    for entry in simulators::ALL {
        let mut scene = Scene { simulator: method(entry), dt: 1e-3, ..free(sheet(2, 1, 1.0)) };
        scene.springs.stretch.rest_scale = 0.5;
        let mut world = world(&scene);
        let mut moved = false;
        for n in 1..=1000 {
            world.step();
            let x = world.positions();
            let fastest = world.velocities().iter().map(|v| v.length()).fold(0.0, f64::max);
            // Each step rounds positions of 0.5 m; a method that takes velocity from positions divides that by dt.
            let round_off = f64::from(n) * EPS * (fastest + 0.5 / scene.dt);
            let momentum = world.measures().momentum.length();
            assert!(momentum <= round_off, "{}: momentum {momentum:e}", entry.id);
            assert!((x[0] + x[1]).length() <= f64::from(n) * scene.dt * round_off, "{}", entry.id);
            moved |= (x[0].x + 0.5).abs() > 0.1;
        }
        assert!(moved, "{}: the spring pulls them together", entry.id);
    }
}

#[test]
fn each_spring_of_a_hanging_chain_carries_the_weight_below_it() {
    let (k, g, n) = (1000.0, 10.0, 10u32);
    for entry in spring_methods() {
        let scene = Scene {
            pins: Pins::of([Pin::Particle(0)]),
            springs: only_stretch(k),
            air_damping: 10.0,
            gravity: Gravity { magnitude: g, ..Gravity::default() },
            simulator: converged(entry),
            dt: 1e-3,
            ..free(hanging(1, n, 1.0))
        };
        // The slowest motion has ω = 2 sqrt(k/m) sin(π / 38) = 5.2 rad/s and decays as exp(-5 t): after 10 s 1e-20 of it is left.
        let world = run(&scene, 10_000);
        for (i, pair) in world.positions().windows(2).enumerate() {
            let below = f64::from(n) - 1.0 - i as f64;
            let exact = 1.0 + g * below / k;
            // A force of 90 N out of lengths near 10 m: round-off of k x eps x 10 m is worth eps x 10 m of length.
            let length = pair[0].y - pair[1].y;
            // Methods that take a fixed number of sweeps, without a tolerance, rest where those end: a micrometre is what is
            // asked of them, round-off of all others.
            let sweeps = ["xpbd", "vbd", "projective_dynamics"].contains(&entry.id);
            let tolerance = if sweeps { 1e-6 } else { 100.0 * EPS * 10.0 };
            assert!((length - exact).abs() < tolerance, "{}, spring {i}: {length}", entry.id);
        }
    }
}

#[test]
fn a_falling_particle_approaches_terminal_velocity_exponentially() {
    let (g, c, dt) = (10.0, 2.0, 0.01);
    for entry in simulators::ALL {
        let scene = Scene {
            air_damping: c,
            gravity: Gravity { magnitude: g, ..Gravity::default() },
            simulator: method(entry),
            dt,
            ..free(sheet(1, 1, 1.0))
        };
        let mut world = world(&scene);
        let terminal = g / c;
        // 20 time constants: the last of these is the terminal speed.
        for _ in 0..1000 {
            world.step();
            let exact = -terminal * (1.0 - (-c * world.time()).exp());
            let v = world.velocities()[0].y;
            // Order p: terminal speed x (c dt / m)^p; half of it in theory, for the Euler methods and where the decay is
            // exact but gravity is added at the end of the step.
            let tolerance = terminal * (c * dt).powi(entry.order.cast_signed());
            assert!((v - exact).abs() <= tolerance, "{} at {}: {v}", entry.id, world.time());
        }
    }
}

#[test]
fn a_gust_gives_each_particle_half_its_strength_times_its_duration() {
    let (strength, frequency, steps) = (3.0, 0.5, 200u32);
    for direction in [DVec3::new(-0.2, 0.15, 0.85), DVec3::new(0.0, 3e5, -4e5), DVec3::new(0.0, 0.0, 1e-300)]
    {
        for entry in one_step_methods() {
            let scene = Scene {
                wind: Wind { enabled: true, strength, frequency, direction },
                simulator: method(entry),
                dt: 1.0 / frequency / f64::from(steps),
                ..free(sheet(1, 1, 1.0))
            };
            let world = run(&scene, u64::from(steps));
            let unit = (direction / direction.abs().max_element()).normalize();
            let exact = unit * (strength / (2.0 * frequency));
            // Equal samples of sin² over a whole period sum up exactly; what is left is round-off, that of positions of
            // 3 m divided by dt where a method takes velocity from positions.
            // One that chooses its own steps keeps to its tolerance instead: 1e-8 m in a tenth of a second.
            let own_steps = entry.params.contains(&"most_steps");
            let tolerance = if own_steps { 1e-7 } else { f64::from(steps) * EPS * (3.0 + 3.0 / scene.dt) };
            let v = world.velocities()[0];
            assert!((v - exact).length() <= tolerance, "{}: {v} instead of {exact}", entry.id);
        }
    }
}

/// A chain of 10 under its own weight that has come to rest, with springs taken as rigid constraints.
fn relaxed_chain(sweeps: u64, dt: f64) -> Vec<f64> {
    let scene = Scene {
        pins: Pins::of([Pin::Particle(0)]),
        springs: only_stretch(1000.0),
        air_damping: 4.0,
        gravity: Gravity::default(),
        simulator: verlet(sweeps),
        dt,
        ..free(hanging(1, 10, 1.0))
    };
    let world = run(&scene, (20.0 / dt) as u64);
    assert!(all_finite(&world));
    world.positions().windows(2).map(|p| p[0].y - p[1].y - 1.0).collect()
}

#[test]
fn one_sweep_leaves_each_spring_g_dt_squared_longer_than_the_one_below() {
    // At rest every particle falls by δ = g dt² in a step and the sweep takes it back. From the top: the pinned end gives
    // c1 = e1 + δ to particle 1, of which spring 2 takes back half of its c2 = e2 + c1, and so on; each must have risen by
    // δ, so the elongations fall by δ from spring to spring, to 0 at the last one. The top spring stretches as one of
    // stiffness (m / dt²) 9 / 8 would: stiffness is a matter of dt, and halving dt makes it four times as large.
    for dt in [1.0 / 60.0, 1.0 / 120.0] {
        for (i, elongation) in relaxed_chain(1, dt).into_iter().enumerate() {
            let exact = 10.0 * dt * dt * (8.0 - i as f64);
            // Nothing but round-off of 10 m coordinates, and what a spring's error gathers from those below.
            assert!((elongation - exact).abs() < 1e3 * 10.0 * EPS, "dt {dt}, spring {i}: {elongation}");
        }
    }
}

#[test]
fn a_chain_of_rigid_springs_keeps_its_lengths_the_better_the_more_sweeps() {
    let longest = |sweeps| relaxed_chain(sweeps, 1.0 / 60.0).into_iter().fold(0.0, f64::max);
    let sag: Vec<f64> = [1, 2, 5, 10, 30, 100].map(longest).into();
    assert!(sag.windows(2).all(|s| s[1] < 0.6 * s[0]), "{sag:?}");
    // Errors of length diffuse along the chain: a sweep leaves at most cos²(π / 19) = 0.973 of any.
    assert!(sag[5] < sag[4] * 0.973f64.powi(60), "{sag:?}");
}

#[test]
fn a_spring_without_stiffness_lets_its_particles_fall_freely() {
    for entry in spring_methods() {
        let mut scene = Scene {
            gravity: Gravity::default(),
            simulator: method(entry),
            dt: 0.125,
            ..free(sheet(2, 1, 1.0))
        };
        scene.springs.stretch = Kind { stiffness: 0.0, ..Kind::default() };
        let mut with = world(&scene);
        let mut without = world(&scene);
        set(&mut without, "springs.stretch.enabled", false);
        for _ in 0..8 {
            with.step();
            without.step();
            assert_eq!(with.digest(), without.digest(), "{}", entry.id);
        }
    }
}
