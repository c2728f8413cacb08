//! Time per spring visit of every method, in both precisions and four sizes; and of what surrounds a step.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::{Duration, Instant};
use tenter::scene::{GridTarget, Place, Precision, Scene, Target};
use tenter::simulators::{self, SimulatorSettings};
use tenter::world::World;

/// A sheet of n x n on two corners. The step is far below the limit, so that no method bursts while it is timed.
fn sheet(n: u32, simulator: &str, precision: Precision) -> World {
    let scene = Scene {
        target: Target::Grid(GridTarget { columns: n, rows: n, ..GridTarget::default() }),
        simulator: SimulatorSettings::new(simulator),
        precision,
        dt: 1e-3,
        ..Scene::default()
    };
    World::new(scene, Place::default()).expect("a sheet")
}

/// Runs as many steps as hold `visits` spring visits, and scales their time to that number: so criterion's time of an
/// iteration is the time of a visit.
fn visit(world: &mut World, visits: u64) -> Duration {
    let before = world.cost().spring_visits;
    let start = Instant::now();
    while world.cost().spring_visits - before < visits {
        world.step();
        assert!(!world.health().is_diverged(), "a world that stands still is no measure");
    }
    start.elapsed().mul_f64(visits as f64 / (world.cost().spring_visits - before) as f64)
}

fn visits(criterion: &mut Criterion) {
    for entry in simulators::ALL {
        let mut group = criterion.benchmark_group(format!("visit/{}", entry.id));
        group
            .sample_size(10)
            .warm_up_time(Duration::from_millis(300))
            .measurement_time(Duration::from_secs(2));
        for precision in [Precision::Single, Precision::Double] {
            for n in [25, 100, 316, 1000] {
                group.bench_function(format!("{precision:?}/{n}x{n}"), |b| {
                    // Made here, so that what a filter leaves out costs nothing.
                    let mut world = sheet(n, entry.id, precision);
                    b.iter_custom(|iterations| visit(&mut world, iterations));
                });
            }
        }
        group.finish();
    }
}

/// What surrounds a step: building a scene, and telling what became of it.
fn around(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("around");
    group.sample_size(10);
    for n in [100, 316] {
        group.bench_function(format!("build/{n}x{n}"), |b| {
            b.iter_batched(
                || (),
                |()| sheet(n, "symplectic_euler", Precision::Single),
                BatchSize::PerIteration,
            );
        });
        let world = sheet(n, "symplectic_euler", Precision::Single);
        group.bench_function(format!("measures/{n}x{n}"), |b| b.iter(|| black_box(world.measures())));
    }
    group.finish();
}

criterion_group!(benches, visits, around);
criterion_main!(benches);
