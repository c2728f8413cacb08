//! What the physics tests share: small scenes, worlds that step, problems without a world, and a reference solution.
#![allow(dead_code, reason = "every test file uses a part of this")]
#![allow(clippy::unwrap_used)]

use glam::DVec3;
use tenter::forces::gravity::Gravity;
use tenter::forces::springs::{Kind, SpringParams};
use tenter::forces::{Cost, Problem, SpringSet};
use tenter::math::{Real, Vector};
use tenter::model::{Particles, Topology};
use tenter::scene::{GridTarget, Mass, Pin, Pins, Place, Plane, Precision, Scene, Target};
use tenter::simulators::{self, Build, Entry, Model, SimulatorSettings, Value};
use tenter::world::{Command, World};

pub const PRECISIONS: [Precision; 2] = [Precision::Single, Precision::Double];

/// Methods that solve the springs of the scene.
pub fn spring_methods() -> impl Iterator<Item = &'static Entry> {
    simulators::ALL.iter().filter(|entry| entry.model == Model::Springs)
}

/// Methods whose first step is like every other. A multistep method begins with a step of lower order, which closed forms
/// see: tests/methods has its figures.
pub fn one_step_methods() -> impl Iterator<Item = &'static Entry> {
    simulators::ALL.iter().filter(|entry| entry.id != "bdf2")
}

/// A method with its defaults; one that chooses its own steps is held to so many that a test of extremes ends.
pub fn method(entry: &Entry) -> SimulatorSettings {
    let settings = SimulatorSettings::new(entry.id);
    if entry.params.contains(&"most_steps") {
        settings.with("most_steps", Value::Count(100))
    } else {
        settings
    }
}

/// A method that iterates until nothing is left to gain.
pub fn converged(entry: &Entry) -> SimulatorSettings {
    if entry.params.contains(&"iterations") {
        method(entry).with("iterations", Value::Count(100))
    } else {
        method(entry)
    }
}

pub fn verlet(sweeps: u64) -> SimulatorSettings {
    SimulatorSettings::new("verlet").with("sweeps", Value::Count(sweeps))
}

pub fn sheet(columns: u32, rows: u32, spacing: f64) -> Target {
    Target::Grid(GridTarget { columns, rows, spacing, plane: Plane::Horizontal })
}

/// Upright, row 0 on top.
pub fn hanging(columns: u32, rows: u32, spacing: f64) -> Target {
    Target::Grid(GridTarget { columns, rows, spacing, plane: Plane::Vertical })
}

/// Stiffness by kind; 0 stays a spring, of no force.
pub fn stiffness(stretch: f64, shear: f64, bend: f64, damping: f64) -> SpringParams {
    let kind = |stiffness| Kind { stiffness, ..Kind::default() };
    SpringParams { stretch: kind(stretch), shear: kind(shear), bend: kind(bend), damping }
}

/// Only stretch springs, undamped.
pub fn only_stretch(stiffness: f64) -> SpringParams {
    let off = || Kind { enabled: false, ..Kind::default() };
    SpringParams { stretch: Kind { stiffness, ..Kind::default() }, shear: off(), bend: off(), damping: 0.0 }
}

pub fn no_gravity() -> Gravity {
    Gravity { enabled: false, ..Gravity::default() }
}

/// A scene in which nothing acts but the springs: no pins, damping, gravity or wind.
pub fn free(target: Target) -> Scene {
    Scene {
        target,
        pins: Pins::of([]),
        springs: stiffness(1000.0, 300.0, 100.0, 0.0),
        air_damping: 0.0,
        gravity: no_gravity(),
        ..Scene::default()
    }
}

/// The scene W1 of the lab: a sheet of 10 x 10 that swings down from two corners. omega_max = 503.51 rad/s at rest.
pub fn w1() -> Scene {
    Scene {
        target: sheet(10, 10, 0.1),
        pins: Pins::of([Pin::Particle(0), Pin::Particle(9)]),
        mass: Mass::PerParticle(0.02),
        springs: stiffness(1000.0, 300.0, 100.0, 0.0),
        air_damping: 0.01,
        gravity: Gravity { magnitude: 9.81, ..Gravity::default() },
        ..Scene::default()
    }
}

pub fn world(scene: &Scene) -> World {
    World::new(scene.clone(), Place::default()).unwrap()
}

/// A world after some steps.
pub fn run(scene: &Scene, steps: u64) -> World {
    let mut world = world(scene);
    step(&mut world, steps);
    world
}

pub fn step(world: &mut World, steps: u64) {
    (0..steps).for_each(|_| world.step());
}

pub fn set(world: &mut World, key: &str, value: impl std::fmt::Display) {
    world.apply(Command::Set { key: key.to_owned(), value: format!("{value}") }).unwrap();
}

/// Every number that a result could show is finite.
pub fn all_finite(world: &World) -> bool {
    let measures = world.measures();
    let energy = measures.energy;
    world.positions().iter().chain(&world.velocities()).all(|v| v.is_finite())
        && [energy.kinetic, energy.gravitational, energy.elastic].iter().all(|e| e.is_finite())
        && [measures.max_strain, measures.mean_strain].iter().all(|s| s.is_finite())
        && measures.momentum.is_finite()
        && measures.angular_momentum.is_finite()
        && world.time().is_finite()
}

/// The problem and the start of a grid scene without a world around them, for tests that need a state that no command
/// leads to.
pub fn problem<T: Real>(scene: &Scene) -> (Problem<T>, Particles<T>) {
    let world = world(scene);
    problem_on::<T>(scene, world.topology(), &world.mesh().positions, world.pinned())
}

/// The same on a topology and a shape of the test's own.
pub fn problem_on<T: Real>(
    scene: &Scene,
    topology: &Topology,
    shape: &[DVec3],
    pinned: &[bool],
) -> (Problem<T>, Particles<T>) {
    let Mass::PerParticle(mass) = scene.mass else { panic!("tests here give mass by particle") };
    let rest: Vec<T::Vec3> = shape.iter().map(|p| T::Vec3::from_f64(*p)).collect();
    let set = SpringSet { topology, rest_positions: &rest, params: &scene.springs, broken: &[] };
    let mut problem = Problem::new(vec![T::from_f64(mass); rest.len()], &set);
    problem.air_damping = T::from_f64(scene.air_damping);
    problem.gravity = scene.gravity.acceleration();
    problem.wind = scene.wind.enabled.then(|| scene.wind.clone());
    for (i, pinned) in pinned.iter().enumerate() {
        problem.set_fixed(i, *pinned);
    }
    (problem, Particles::at_rest(rest))
}

/// Steps a state with one stepper; answers with the work done.
pub fn advance<T: Build>(
    problem: &Problem<T>,
    state: &mut Particles<T>,
    settings: &SimulatorSettings,
    dt: f64,
    steps: u64,
) -> Cost {
    let mut stepper = T::build(settings).unwrap();
    let mut cost = Cost::default();
    let start = state.time;
    for n in 1..=steps {
        stepper.step(problem, state, T::from_f64(dt), &mut cost);
        state.time = start + n as f64 * dt;
    }
    cost
}

/// The classical Runge-Kutta method of order 4 on [`Problem::accelerations`]: the reference solution.
pub fn rk4(problem: &Problem<f64>, state: &mut Particles<f64>, dt: f64, steps: u64) {
    let mut accelerations = Vec::new();
    let start = state.time;
    for n in 0..steps {
        let t = start + n as f64 * dt;
        let base = Particles { time: t, ..state.clone() };
        let mut at = base.clone();
        // Each stage: its weight in the sum, and how far its derivatives carry to where the next one looks.
        for (weight, ahead) in [(1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0)] {
            let (weight, next) = (weight * dt / 6.0, ahead * dt);
            problem.accelerations(&at, &mut accelerations, &mut Cost::default());
            for (i, &a) in accelerations.iter().enumerate() {
                let v = at.velocities[i];
                state.positions[i] += v * weight;
                state.velocities[i] += a * weight;
                at.positions[i] = base.positions[i] + v * next;
                at.velocities[i] = base.velocities[i] + a * next;
            }
            at.time = t + next;
        }
        state.time = start + (n + 1) as f64 * dt;
    }
}

/// Root of the mean square distance over the particles that are free, m.
pub fn rms(a: &[DVec3], b: &[DVec3], pinned: &[bool]) -> f64 {
    let squares =
        a.iter().zip(b).zip(pinned).filter(|(_, pinned)| !**pinned).map(|((a, b), _)| a.distance_squared(*b));
    let (sum, count) = squares.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}

/// Numbers between -0.5 and 0.5, the same every time: xorshift64 (Marsaglia, "Xorshift RNGs", 2003).
pub fn noise() -> impl FnMut() -> f64 {
    let mut seed = 0x2545_f491_4f6c_dd1d_u64;
    move || {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }
}
