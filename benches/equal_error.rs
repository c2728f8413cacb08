//! Time per step and per simulated second of every method that solves the springs, each at the longest dt of a halving row with
//! which it errs by at most one per cent.
//!
//! The built-in sheet at 25², 100² and 316² particles falls for half a second. Error: RMS distance to the classical
//! Runge-Kutta method at dt ω = 0.15, over the RMS displacement from the start. `-- 25 100` runs these sizes only.

use std::time::Instant;
use tenter::scene::{GridTarget, Place, Precision, Scene, Target, builtin};
use tenter::simulators::{self, Model, SimulatorSettings};
use tenter::world::World;

/// Simulated time, s.
const SECONDS: f64 = 0.5;
/// Longest dt, s, and how often it is halved at most.
const LONGEST: f64 = 0.1;
const HALVINGS: u32 = 14;
/// Error allowed.
const ERROR: f64 = 0.01;

fn sheet(n: u32, simulator: &str, dt: f64) -> World {
    let mut scene: Scene = (builtin::find("sheet").expect("the built-in sheet").make)();
    scene.target = Target::Grid(GridTarget { columns: n, rows: n, ..GridTarget::default() });
    scene.simulator = SimulatorSettings::new(simulator);
    scene.precision = Precision::Double;
    scene.dt = dt;
    World::new(scene, Place::default()).expect("a sheet")
}

/// Runs to the end; answers with the seconds that it took, or nothing where the run cannot be trusted.
fn run(world: &mut World, steps: u64) -> Option<f64> {
    let start = Instant::now();
    for _ in 0..steps {
        world.step();
        if world.health().is_diverged() {
            return None;
        }
    }
    Some(start.elapsed().as_secs_f64())
}

fn rms(a: &World, b: &[glam::DVec3]) -> f64 {
    let squares = a.positions().iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum::<f64>();
    (squares / b.len() as f64).sqrt()
}

fn main() {
    let wanted: Vec<u32> = std::env::args().filter_map(|arg| arg.parse().ok()).collect();
    for n in [25, 100, 316].into_iter().filter(|n| wanted.is_empty() || wanted.contains(n)) {
        let omega = sheet(n, "rk4", 1e-3).spectrum().omega_max();
        let steps = (SECONDS * omega / 0.15).ceil();
        let mut truth = sheet(n, "rk4", SECONDS / steps);
        run(&mut truth, steps as u64).expect("a reference");
        let displacement = rms(&sheet(n, "rk4", 1e-3), &truth.positions());
        println!("{n} x {n}, {ERROR} relative error after {SECONDS} s:");
        for entry in simulators::ALL.iter().filter(|entry| entry.model == Model::Springs) {
            let found = (0..=HALVINGS).find_map(|halving| {
                let dt = LONGEST / f64::from(1 << halving);
                let steps = (SECONDS / dt).round();
                let mut world = sheet(n, entry.id, dt);
                let seconds = run(&mut world, steps as u64)?;
                let error = rms(&world, &truth.positions()) / displacement;
                (error <= ERROR).then_some((dt, error, seconds / steps, seconds / SECONDS))
            });
            match found {
                Some((dt, error, step, second)) => println!(
                    "  {:20} dt {:8.3} ms, error {:.4}: {:10.3} ms a step, {second:9.4} s a simulated second",
                    entry.id,
                    1e3 * dt,
                    error,
                    1e3 * step
                ),
                None => println!("  {:20} not within {HALVINGS} halvings of {LONGEST} s", entry.id),
            }
        }
    }
}
