//! Particles are stored in another order than the target's where that is faster; nobody outside may notice.
#![allow(clippy::unwrap_used)]

mod common;

use common::{advance, problem_on, step};
use glam::DVec3;
use std::fmt::Write as _;
use tenter::model::Numbering;
use tenter::scene::{Pin, Pins, Place, Scene, Target};
use tenter::simulators::SimulatorSettings;
use tenter::target::grid;
use tenter::world::{Command, World};

const SIDE: u32 = 20;
const COUNT: u32 = SIDE * SIDE;

/// The faces of the sheet in an order without sense: the step has no divisor in common with their count.
fn faces() -> impl Iterator<Item = Vec<u32>> {
    const FACES: usize = (SIDE as usize - 1).pow(2);
    let mesh = grid(SIDE, SIDE, 1.0, false);
    (0..FACES).map(move |f| mesh.face(f * 7919 % FACES).to_vec())
}

/// The number that a particle of the sheet has on the shuffled mesh: particles are numbered as its faces first use them.
fn name(of: u32) -> u32 {
    let mut met = Vec::new();
    for p in faces().flatten() {
        if !met.contains(&p) {
            met.push(p);
        }
    }
    met.iter().position(|p| *p == of).unwrap() as u32
}

/// A world on a sheet whose particles stand in an order without sense, hanging by two corners.
fn shuffled(settings: SimulatorSettings) -> World {
    let mut text = String::new();
    for p in grid(SIDE, SIDE, 1.0, false).positions {
        writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
    }
    for face in faces() {
        let corners: Vec<String> = face.iter().map(|p| (p + 1).to_string()).collect();
        writeln!(text, "f {}", corners.join(" ")).unwrap();
    }
    let file = tempfile::Builder::new().suffix(".obj").tempfile().unwrap();
    std::fs::write(file.path(), text).unwrap();
    let mut place = Place::default();
    place.allow(file.path());
    let scene = Scene {
        target: Target::mesh(file.path().to_str().unwrap()),
        pins: Pins::of([Pin::Particle(name(0)), Pin::Particle(name(SIDE - 1))]),
        simulator: settings,
        dt: 0.01,
        ..Scene::default()
    };
    let world = World::new(scene, place).unwrap();
    assert!(!Numbering::of(COUNT as usize, world.topology()).is_identity());
    world
}

#[test]
fn the_trajectory_is_that_of_the_particles_in_their_own_order() {
    let steps = 100u32;
    // A force is a sum of 14 terms of at most 1000 N here. In another order each sum differs by at most 14 units in the last
    // place of what it adds up, in every step, and what a step adds to a velocity carries on to the end.
    let bound = 0.01f64.powi(2) * f64::from(steps).powi(2) * 14.0 * 14.0 * 1000.0 * f64::EPSILON;
    // A sweep goes on in the order in which the springs were made, to the last bit.
    for (id, bound) in
        [("symplectic_euler", bound), ("velocity_verlet", bound), ("rk4", bound), ("verlet", 0.0)]
    {
        let mut world = shuffled(SimulatorSettings::new(id));
        let scene = world.scene().clone();
        let (problem, mut state) =
            problem_on::<f64>(&scene, world.topology(), &world.mesh().positions, world.pinned());
        step(&mut world, u64::from(steps));
        advance(&problem, &mut state, &scene.simulator, scene.dt, u64::from(steps));
        let pairs = world.positions().into_iter().zip(&state.positions);
        let worst = pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        println!("{id}: {worst:.1e} of {bound:.1e}");
        assert!(worst <= bound, "{id}: {worst:e}");
        // It has moved at all, and by itself.
        assert!(world.positions().iter().any(|p| p.y < -1.0), "{id}");
    }
}

#[test]
fn commands_and_results_name_particles_as_the_target_does() {
    let mut world = shuffled(SimulatorSettings::default());
    let (corner, middle, goal) = (name(0), name(COUNT / 2), DVec3::new(0.0, 3.0, 0.0));
    let start = world.positions();
    assert_eq!(start, world.mesh().positions);
    world.apply(Command::Grab { particles: vec![middle] }).unwrap();
    world.apply(Command::Drag { particle: middle, to: goal, steps: 20 }).unwrap();
    world.apply(Command::Pull { particles: vec![name(COUNT - 1)], stiffness: 100.0 }).unwrap();
    step(&mut world, 20);
    let now = world.positions();
    assert_eq!(now[middle as usize], goal);
    assert_eq!(now[corner as usize], start[corner as usize]);
    assert!((0..COUNT as usize).all(|p| world.pinned()[p] == (now[p] == start[p])));
    // Who is pulled stays behind where its hand is, its neighbour falls faster.
    let fallen = |p: u32| start[name(p) as usize].y - now[name(p) as usize].y;
    assert!(fallen(COUNT - 1) < fallen(COUNT - 2));

    let mut strains = Vec::new();
    world.strains(&mut strains);
    let pairs = world.topology().pairs.concat();
    assert_eq!(strains.len(), pairs.len());
    for (id, strain) in strains {
        let [a, b] = pairs[id as usize].map(|p| p as usize);
        let exact = now[a].distance(now[b]) / start[a].distance(start[b]) - 1.0;
        // Two lengths and a quotient near 1 in double precision, rounded to single at the end.
        assert!(
            (f64::from(strain) - exact).abs() <= exact.abs() * f64::from(f32::EPSILON) + 8.0 * f64::EPSILON
        );
    }
}

#[test]
fn every_hand_pulls_at_its_own_particle() {
    for id in ["symplectic_euler", "explicit_euler", "velocity_verlet", "implicit_euler"] {
        let fallen = |pulled: &[u32]| {
            let mut world = shuffled(SimulatorSettings::new(id));
            world.apply(Command::Pull { particles: pulled.to_vec(), stiffness: 1000.0 }).unwrap();
            step(&mut world, 20);
            let heights = world.mesh().positions.iter().zip(world.positions());
            heights.map(|(start, now)| start.y - now.y).collect::<Vec<f64>>()
        };
        // Some beside each other, some far apart.
        let pulled: Vec<u32> = [57, 58, 77, 130, 260, 399].map(name).to_vec();
        let (alone, held) = (fallen(&[]), fallen(&pulled));
        for p in &pulled {
            let (alone, held) = (alone[*p as usize], held[*p as usize]);
            assert!(held < 0.5 * alone, "{id}, particle {p}: {held} instead of {alone}");
        }
    }
}

#[test]
fn snapshots_branches_and_edits_keep_every_particle_at_its_place() {
    let mut world = shuffled(SimulatorSettings::default());
    step(&mut world, 10);
    let snapshot = world.snapshot();
    let (positions, velocities) = snapshot.motion();
    assert_eq!((&positions, &velocities), (&world.positions(), &world.velocities()));
    let branch = snapshot.branch(world.scene().clone()).unwrap();
    assert_eq!(branch.positions(), positions);
    let moved = snapshot.moved(&positions, &velocities).branch(world.scene().clone()).unwrap();
    assert_eq!((moved.positions(), moved.velocities()), (positions.clone(), velocities));
    let (problem, state) = snapshot.problem(world.scene()).unwrap();
    assert_eq!(state.positions, positions);
    let fixed: Vec<bool> = problem.inverse_mass.iter().map(|w| *w == 0.0).collect();
    assert_eq!(fixed, world.pinned());

    // The same count of particles in another order: each goes on from where the particle of its name was.
    let target = format!("Grid(columns: {SIDE}, rows: {SIDE}, spacing: 1.0)");
    world.apply(Command::Set { key: "target".into(), value: target }).unwrap();
    assert_eq!(world.positions(), positions);
    world.restore(&snapshot);
    assert_eq!(world.positions(), positions);
}
