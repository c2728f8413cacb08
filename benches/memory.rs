//! Memory that a world holds, counted byte by byte as it is asked for: for each particle, and for each of its springs.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../tests/memory/mod.rs"]
mod memory;

use std::fmt::Write as _;
use tenter::scene::{GridTarget, Place, Precision, Scene, Target};
use tenter::target::grid;
use tenter::world::World;

/// Particles along each side.
const SIDE: u32 = 1000;

/// The sheet as a mesh file, its faces along its rows or in an order without sense: particles are numbered as faces use them.
fn obj(is_shuffled: bool) -> String {
    let mesh = grid(SIDE, SIDE, 1.0, false);
    let mut text = String::new();
    for p in &mesh.positions {
        writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
    }
    let count = mesh.face_count();
    for f in 0..count {
        // A step without a divisor in common with the count comes by every face.
        let face = mesh.face(if is_shuffled { f * 618_034 % count } else { f });
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| face[i] + 1);
        writeln!(text, "f {a} {b} {c} {d}").unwrap();
    }
    text
}

/// A world with these kinds of springs enabled.
fn world(target: &Target, place: &Place, precision: Precision, is_enabled: bool) -> World {
    let mut scene = Scene { target: target.clone(), precision, dt: 1e-3, ..Scene::default() };
    for kind in ["stretch", "shear", "bend"] {
        scene.set_key(&format!("springs.{kind}.enabled"), if is_enabled { "true" } else { "false" }).unwrap();
    }
    World::new(scene, place.clone()).unwrap()
}

fn main() {
    if std::env::args().any(|word| word == "--test") {
        return;
    }
    println!(
        "bytes for each of {SIDE}² particles: built, after ten steps, at most until then; for each acting spring of all that"
    );
    let folder = tempfile::tempdir().unwrap();
    let mut place = Place::default();
    let mut mesh = |name: &str, is_shuffled| {
        let path = folder.path().join(name);
        std::fs::write(&path, obj(is_shuffled)).unwrap();
        place.allow(&path);
        Target::mesh(path.to_str().unwrap())
    };
    let targets = [
        ("grid", Target::Grid(GridTarget { columns: SIDE, rows: SIDE, ..GridTarget::default() })),
        ("mesh", mesh("a.obj", false)),
        ("mesh, shuffled", mesh("b.obj", true)),
    ];
    for (name, target) in &targets {
        for precision in [Precision::Single, Precision::Double] {
            let stepped = |is_enabled| {
                let mut built = 0;
                let mut springs = 0;
                let (world, most) = memory::measured(|| {
                    let (mut world, held) = memory::added(|| world(target, &place, precision, is_enabled));
                    (built, springs) = (held, world.acting_springs());
                    (0..10).for_each(|_| world.step());
                    world
                });
                let particles = world.pinned().len();
                let ((), freed) = memory::added(|| drop(world));
                (built, -freed, most, particles, springs)
            };
            let (built, held, most, particles, springs) = stepped(true);
            let (_, without, ..) = stepped(false);
            let each = |bytes: isize| bytes as f64 / particles as f64;
            println!(
                "{name:14} {precision:?}: {:5.0} {:5.0} {:5.0}; {:4.1}",
                each(built),
                each(held),
                each(most.cast_signed()),
                (held - without) as f64 / springs as f64
            );
        }
    }
}
