//! Time of a step: every method, both precisions, four sizes. Criterion prints it with the throughput in spring visits,
//! so that 1 / throughput is the time per visit.

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Duration;
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
    let mut world = World::new(scene, Place::default()).expect("a sheet");
    world.set_threads(1).expect("a thread");
    world.step();
    world
}

fn step(criterion: &mut Criterion) {
    for entry in simulators::ALL {
        let mut group = criterion.benchmark_group(entry.id);
        group
            .sample_size(10)
            .warm_up_time(Duration::from_millis(300))
            .measurement_time(Duration::from_secs(2));
        for precision in [Precision::Single, Precision::Double] {
            for n in [25, 100, 316, 1000] {
                let mut world = sheet(n, entry.id, precision);
                let before = world.cost().spring_visits;
                world.step();
                group.throughput(Throughput::Elements(world.cost().spring_visits - before));
                group.bench_function(format!("{precision:?}/{n}x{n}"), |b| b.iter(|| world.step()));
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

criterion_group!(benches, step, around);
criterion_main!(benches);
