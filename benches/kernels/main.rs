//! Nanoseconds per spring visit of every method beside the machine's bounds and hand-written kernels, all in one run.
//!
//! `cargo bench --no-default-features --bench kernels`: explicit steps beside kernels by hand. `-- methods`: every method, or those that are named, in every
//! size, order of numbering, precision and number of threads; `-- sweeps`: relaxation and XPBD; `-- implicit`: the parts of
//! implicit steps; `-- around`: what watching and tearing add to a step, building, measuring, and the limit of stability; with
//! `large`, 1000² particles too. Candidates take turns and each keeps its shortest time, so that what else the machine does hits
//! all of them alike.
#![allow(missing_docs, clippy::unwrap_used)]

mod machine;
mod reference;

use glam::{DVec3, Vec3};
use machine::{Machine, Work};
use reference::Reference;
use std::fmt::Write as _;
use std::time::{Duration, Instant};
use tenter::forces::{Cost, Problem, SpringSet};
use tenter::math::Vector as _;
use tenter::model::{Particles, Topology};
use tenter::scene::{GridTarget, Pin, Pins, Place, Precision, Scene, Target};
use tenter::simulators::{self, Build, SimulatorSettings};
use tenter::target::grid;
use tenter::world::{Command, World};

/// A sheet on two corners. The step is far below the limit, so that no method bursts.
fn scene(side: u32, simulator: &str, precision: Precision) -> Scene {
    Scene {
        target: Target::Grid(GridTarget { columns: side, rows: side, ..GridTarget::default() }),
        pins: Pins::of([Pin::Corners(1)]),
        simulator: SimulatorSettings::new(simulator),
        precision,
        dt: 1e-4,
        ..Scene::default()
    }
}

fn flat(side: u32, simulator: &str, precision: Precision) -> World {
    World::new(scene(side, simulator, precision), Place::default()).expect("a sheet")
}

/// The sheet, crumpled, with its particles numbered along its rows or at random.
fn sheet(side: u32, shuffled: bool, simulator: &str, precision: Precision, threads: usize) -> World {
    if !shuffled {
        return crumpled(&flat(side, simulator, precision), threads);
    }
    let path = std::env::temp_dir().join(format!("tenter-bench-{}-{side}.obj", std::process::id()));
    std::fs::write(&path, shuffled_obj(side)).unwrap();
    let mut place = Place::default();
    place.allow(&path);
    let target = Target::mesh(path.to_str().unwrap());
    let pins = Pins::of([Pin::Particle(0), Pin::Particle(side)]);
    let world =
        World::new(Scene { target, pins, ..scene(side, simulator, precision) }, place).expect("a mesh");
    std::fs::remove_file(&path).unwrap();
    crumpled(&world, threads)
}

/// The world with its particles a little out of place. In a flat sheet at rest only what comes from the pins moves, with
/// speeds far away that are too small to be normal numbers, and a processor takes a hundred times as long for those.
fn crumpled(world: &World, threads: usize) -> World {
    let snapshot = world.snapshot();
    let (mut positions, velocities) = snapshot.motion();
    positions
        .iter_mut()
        .zip(world.pinned())
        .filter(|(_, pinned)| !**pinned)
        .for_each(|(x, _)| *x += crumple(*x));
    let moved = snapshot.moved(&positions, &velocities);
    let mut world = moved.branch(world.scene().clone()).expect("the same scene");
    world.set_threads(threads).expect("threads");
    world
}

/// How far out of place, m: up to a hundredth of a spring.
fn crumple(at: DVec3) -> DVec3 {
    DVec3::new((at.x * 5.1 + at.z).sin(), (at.x * 3.7 + at.z * 4.3).sin(), (at.z * 6.1 + at.x).sin()) * 0.01
}

/// The same number for every particle of a mesh at every run: a permutation by xorshift64 (Marsaglia, "Xorshift RNGs", 2003).
fn permutation(count: usize) -> Vec<u32> {
    let mut seed = 0x2545_f491_4f6c_dd1d_u64;
    let mut order: Vec<u32> = (0..count as u32).collect();
    for i in (1..count).rev() {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        order.swap(i, (seed % (i as u64 + 1)) as usize);
    }
    order
}

/// A sheet whose vertices and faces stand in a random order.
fn shuffled_obj(side: u32) -> String {
    let mesh = grid(side, side, 1.0, false);
    let order = permutation(mesh.positions.len());
    let mut names = vec![0; order.len()];
    let mut text = String::new();
    for (name, &vertex) in order.iter().enumerate() {
        names[vertex as usize] = name + 1;
        let p = mesh.positions[vertex as usize];
        writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
    }
    for f in permutation(mesh.face_count()) {
        let corners = mesh.face(f as usize);
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| names[corners[i] as usize]);
        writeln!(text, "f {a} {b} {c} {d}").unwrap();
    }
    text
}

/// Something that is timed: does work and says how many springs it visited.
type Candidate<'a> = (String, Box<dyn FnMut() -> u64 + 'a>);

/// Shortest time per visit of each candidate, ns: they take turns of a few milliseconds.
fn race(candidates: &mut [Candidate], seconds: f64) -> Vec<f64> {
    const TURN: Duration = Duration::from_millis(3);
    let mut best = vec![f64::INFINITY; candidates.len()];
    let end = Instant::now() + Duration::from_secs_f64(seconds * candidates.len() as f64);
    let mut rounds = 0;
    while rounds < 3 || Instant::now() < end {
        for (best, (_, work)) in best.iter_mut().zip(&mut *candidates) {
            let turn = Instant::now();
            while turn.elapsed() < TURN {
                let start = Instant::now();
                let mut visits = work();
                // As many as take long beside reading the clock.
                while visits < 20_000 {
                    visits += work();
                }
                *best = best.min(start.elapsed().as_secs_f64() * 1e9 / visits as f64);
            }
        }
        rounds += 1;
    }
    best
}

/// Some steps at a time, as they are taken between two pictures: as many as look at a million springs, some two milliseconds.
fn step(mut world: World) -> Box<dyn FnMut() -> u64> {
    world.step();
    let visits = world.cost().spring_visits;
    let steps = (1_000_000 / visits).clamp(1, 64);
    Box::new(move || {
        let before = world.cost().spring_visits;
        world.threads().run(|| (0..steps).for_each(|_| world.step()));
        assert!(!world.health().is_diverged(), "a world that stands still is no measure");
        world.cost().spring_visits - before
    })
}

fn explicit(sides: &[u32]) {
    use Precision::{Double, Single};
    println!(
        "symplectic Euler, whole step of a world, ns per spring visit; ratios to the half gather and the stencil"
    );
    let mut machine = Machine::default();
    println!(
        "mesh             bound   list half-gather stencil | Single  ratio  ratio | two threads | Double   to Single"
    );
    let mut in_order = f64::NAN;
    for &side in sides {
        for shuffled in [false, true] {
            let of = |precision, threads| step(sheet(side, shuffled, "symplectic_euler", precision, threads));
            let work = work(&mut sheet(side, shuffled, "symplectic_euler", Single, 1));
            let reference = |kernel: fn(&mut Reference)| {
                let mut reference = Reference::new(side);
                Box::new(move || {
                    kernel(&mut reference);
                    reference.springs()
                })
            };
            let mut candidates: Vec<Candidate> = vec![
                ("list".into(), reference(Reference::list)),
                ("half gather".into(), reference(Reference::half_gather)),
                ("stencil".into(), reference(Reference::stencil)),
                ("Single".into(), of(Single, 1)),
                ("two threads".into(), of(Single, 2)),
                ("Double".into(), of(Double, 1)),
            ];
            let best = race(&mut candidates, 0.4);
            let [list, half, stencil, single, two, double] = best[..] else { unreachable!() };
            let name = if shuffled { "shuffled" } else { "in order" };
            println!(
                "{side:4}² {name}    {:5.2}  {list:5.2}  {half:6.2}    {stencil:5.2}   | {single:5.2}  {:5.2}  {:5.2}  | {two:5.2} ({:4.2}x) | {double:5.2}  {:5.2}",
                machine.bound(&work) / work.visits,
                single / half,
                single / stencil,
                single / two,
                double / single,
            );
            if shuffled {
                println!("      shuffled to in order: {:.2}", single / in_order);
            } else {
                in_order = single;
            }
        }
    }
}

/// Methods whose solver's iterations multiply by a matrix.
const MULTIPLYING: [&str; 3] = ["implicit_euler", "implicit_midpoint", "bdf2"];

/// What a step of a world does, from the one that it takes here.
fn work(world: &mut World) -> Work {
    let springs = Reference::new(world.pinned().len().isqrt() as u32).springs() as f64;
    let before = world.cost();
    world.step();
    let cost = world.cost();
    let visits = (cost.spring_visits - before.spring_visits) as f64;
    let is_multiplying = MULTIPLYING.contains(&world.scene().simulator.id.as_str());
    let iterations = (cost.solver_iterations - before.solver_iterations) as f64;
    let products = if is_multiplying { iterations * springs } else { 0.0 };
    let size = if world.scene().precision == Precision::Single { 4 } else { 8 };
    Work { particles: world.pinned().len() as f64, springs, visits: visits - products, products, size }
}

fn methods(sides: &[u32]) {
    println!(
        "every method, ns per spring visit: bound; one thread, and how many times the bound; times as fast on two; ms a step on one"
    );
    let mut machine = Machine::default();
    let named = |entry: &&simulators::Entry| std::env::args().any(|argument| argument == entry.id);
    let any_named = simulators::ALL.iter().any(|entry| named(&entry));
    for entry in simulators::ALL.iter().filter(|entry| !any_named || named(entry)) {
        for precision in [Precision::Single, Precision::Double] {
            for shuffled in [false, true] {
                let order = if shuffled { "shuffled" } else { "in order" };
                print!("{:20} {:6} {order}", entry.id, format!("{precision:?}"));
                for &side in sides {
                    // A factor of 1000² takes gigabytes.
                    if side >= 1000 && entry.id == "projective_dynamics" {
                        continue;
                    }
                    let mut one = sheet(side, shuffled, entry.id, precision, 1);
                    // Twice as many threads on the same cloth.
                    let mut two = one.snapshot().branch(one.scene().clone()).expect("the same scene");
                    two.set_threads(2).expect("threads");
                    one.step();
                    let work = work(&mut one);
                    let visits = work.visits + work.products;
                    let bound = machine.bound(&work) / visits;
                    let mut candidates = [(entry.id.into(), step(one)), (entry.id.into(), step(two))];
                    let [one, two] = race(&mut candidates, 0.25)[..] else { unreachable!() };
                    let (ratio, faster, ms) = (one / bound, one / two, one * visits / 1e6);
                    print!(" | {side:4}²: {bound:5.2} {one:6.2} {ratio:5.1}x {faster:4.2}x {ms:9.3}");
                }
                println!();
            }
        }
    }
}

/// A sheet crumpled and stepped by the method alone: no world that watches, tears and logs.
fn bare(side: u32, simulator: &str) -> Box<dyn FnMut() -> u64> {
    let mesh = grid(side, side, 1.0, false);
    let scene = scene(side, simulator, Precision::Single);
    let rest: Vec<Vec3> = mesh.positions.iter().map(|p| p.as_vec3()).collect();
    let topology = Topology::of(&mesh);
    let set = SpringSet { topology: &topology, rest_positions: &rest, params: &scene.springs, broken: &[] };
    let mut problem = Problem::new(vec![1.0_f32; rest.len()], &set);
    problem.gravity = scene.gravity.acceleration();
    problem.air_damping = scene.air_damping as f32;
    (problem.inverse_mass[0], problem.inverse_mass[side as usize - 1]) = (0.0, 0.0);
    let mut state = Particles::at_rest(mesh.positions.iter().map(|p| (*p + crumple(*p)).as_vec3()).collect());
    let mut stepper = f32::build(&scene.simulator).expect("a method");
    let (dt, mut cost) = (scene.dt as f32, Cost::default());
    Box::new(move || {
        let before = cost.spring_visits;
        stepper.step(&problem, &mut state, dt, &mut cost);
        cost.spring_visits - before
    })
}

/// What a world adds to the method's own step, and what tearing adds to that.
fn overheads(sides: &[u32]) {
    /// Where its memory lies makes a step up to a tenth slower: the best of so many counts.
    const PLACES: usize = 5;
    const METHODS: [&str; 6] =
        ["symplectic_euler", "velocity_verlet", "rk4", "verlet", "xpbd", "implicit_euler"];
    println!("Single, one thread, ns per spring visit");
    println!(
        "                          the method alone | world: all that watches, over the method | tearing on at 3 rest lengths, over the world"
    );
    for method in METHODS {
        for &side in sides {
            let of = |tearing: bool| {
                let mut scene = scene(side, method, Precision::Single);
                scene.tearing.enabled = tearing;
                step(crumpled(&World::new(scene, Place::default()).expect("a sheet"), 1))
            };
            let mut candidates: Vec<Candidate> = Vec::new();
            for _ in 0..PLACES {
                candidates.push(("alone".into(), bare(side, method)));
                candidates.push(("world".into(), of(false)));
                candidates.push(("tearing".into(), of(true)));
            }
            let times = race(&mut candidates, 0.5);
            let best = [0, 1, 2]
                .map(|kind| times.iter().skip(kind).step_by(3).copied().fold(f64::INFINITY, f64::min));
            let [alone, world, tearing] = best;
            println!(
                "{method:20} {side:4}² {alone:6.2}           | {world:6.2} {:+5.1} %                          | {tearing:6.2} {:+5.1} %",
                100.0 * (world / alone - 1.0),
                100.0 * (tearing / world - 1.0)
            );
        }
    }
}

/// Ten sweeps a step, by order of the springs and by model.
fn sweeps(sides: &[u32]) {
    println!(
        "ten sweeps a step, ns per spring visit of a whole step; beside them one sweep of a plain list, and of eights by hand"
    );
    println!(
        "          list by-hand | creation tiles  ratio two threads   XPBD  two threads  undamped | in Double: tiles  XPBD | ms a step, tiles, one and two threads"
    );
    for &side in sides {
        let of = |id: &str, sets: &[(&str, &str)], precision, threads| {
            let mut scene = Scene { dt: 1.0 / 60.0, ..scene(side, id, precision) };
            for (key, value) in sets {
                scene.set_key(key, value).expect("a setting");
            }
            // Moved a little: a sheet at rest is no measure.
            let world = World::new(scene, Place::default()).expect("a sheet");
            step(crumpled(&world, threads))
        };
        let creation = [("simulator.params.order", "Creation")];
        let tiles = [("simulator.params.order", "Coloured")];
        let xpbd = [("simulator.params.substeps", "1"), ("simulator.params.iterations", "10")];
        let undamped = [xpbd[0], xpbd[1], ("springs.damping", "0")];
        let (mut list, mut eights) = (Reference::new(side), Reference::new(side));
        let mut candidates: Vec<Candidate> = vec![
            (
                "list".into(),
                Box::new(move || {
                    list.relax();
                    list.springs()
                }),
            ),
            (
                "by hand".into(),
                Box::new(move || {
                    eights.relax_coloured();
                    eights.coloured_springs()
                }),
            ),
            ("creation".into(), of("verlet", &creation, Precision::Single, 1)),
            ("tiles".into(), of("verlet", &tiles, Precision::Single, 1)),
            ("tiles, two".into(), of("verlet", &tiles, Precision::Single, 2)),
            ("XPBD".into(), of("xpbd", &xpbd, Precision::Single, 1)),
            ("XPBD, two".into(), of("xpbd", &xpbd, Precision::Single, 2)),
            ("undamped".into(), of("xpbd", &undamped, Precision::Single, 1)),
            ("tiles".into(), of("verlet", &tiles, Precision::Double, 1)),
            ("XPBD".into(), of("xpbd", &xpbd, Precision::Double, 1)),
        ];
        let best = race(&mut candidates, 0.4);
        let [list, hand, creation, tiles, tiles_two, xpbd, xpbd_two, undamped, tiles_double, xpbd_double] =
            best[..]
        else {
            unreachable!()
        };
        let visits = 10.0 * Reference::new(side).springs() as f64;
        println!(
            "{side:4}²    {list:5.2}   {hand:5.2} |    {creation:5.2} {tiles:5.2}  {:5.2} {tiles_two:5.2} ({:4.2}x) {xpbd:5.2} {xpbd_two:5.2} ({:4.2}x) {undamped:5.2} |            {tiles_double:5.2} {xpbd_double:5.2} | {:.3} {:.3}",
            tiles / hand,
            tiles / tiles_two,
            xpbd / xpbd_two,
            tiles * visits * 1e-6,
            tiles_two * visits * 1e-6,
        );
    }
}

/// The parts of an implicit step: one iteration of conjugate gradients, as what sixty more take; all else in it, of which building
/// the matrix is the most; an iteration of projective dynamics, and of it the solve alone.
fn implicit(sides: &[u32]) {
    println!(
        "ns per spring: building the matrix and all else in a step, an iteration of conjugate gradients, one by hand in Single on one thread | vertex block descent, a sweep | projective dynamics, ms: an iteration, a solve alone, its part"
    );
    for &side in sides {
        for (name, threads) in
            [("Single", 1), ("Single, 2 threads", 2), ("Double", 1), ("Double, 2 threads", 2)]
        {
            let of = |set: &[(&str, &str)]| {
                if name.starts_with("Single") {
                    one_step::<f32>(side, set, threads)
                } else {
                    one_step::<f64>(side, set, threads)
                }
            };
            let newton = |iterations| {
                of(&[
                    ("simulator.id", "implicit_euler"),
                    ("simulator.params.newton_steps", "1"),
                    ("simulator.params.tolerance", "1e-14"),
                    ("simulator.params.iterations", iterations),
                ])
            };
            let projective = |iterations| {
                of(&[("simulator.id", "projective_dynamics"), ("simulator.params.iterations", iterations)])
            };
            let descent =
                |iterations| of(&[("simulator.id", "vbd"), ("simulator.params.iterations", iterations)]);
            let springs = Reference::new(side).springs();
            let mut by_hand = reference::Gradients::new(side);
            let mut candidates: Vec<Candidate> = vec![
                ("few".into(), newton("2")),
                ("many".into(), newton("62")),
                ("by hand".into(), Box::new(move || (by_hand.iterate(), springs).1)),
                ("one sweep".into(), descent("1")),
                ("more".into(), descent("11")),
            ];
            // A factor of 1000² takes gigabytes.
            if side < 1000 {
                let mut solve = reference::solve(side);
                candidates.extend([
                    ("one".into(), projective("1")),
                    ("more".into(), projective("11")),
                    ("solve".into(), Box::new(move || (solve(), springs).1)),
                ]);
            }
            let best = race(&mut candidates, 1.0);
            let [few, many, by_hand, sweep, sweeps, ref projective @ ..] = best[..] else { unreachable!() };
            let iteration = (many - few) / 60.0;
            print!("{side:4}² {name:18} {:6.2} {iteration:6.2} {by_hand:6.2}", few - 2.0 * iteration);
            print!(" | {:6.2}", (sweeps - sweep) / 10.0);
            if let [one, more, solve] = *projective {
                let [iteration, solve] = [(more - one) / 10.0, solve].map(|ns| ns * springs as f64 * 1e-6);
                print!(" | {iteration:8.3} {solve:8.3} {:5.0} %", 100.0 * solve / iteration);
            }
            println!();
        }
    }
}

/// The same step over and over from a crumpled sheet, by the method alone, at a dt so long that conjugate gradients have work.
fn one_step<T: Build>(side: u32, set: &[(&str, &str)], threads: usize) -> Box<dyn FnMut() -> u64> {
    let mesh = grid(side, side, 1.0, false);
    let mut scene = Scene { dt: 1.0, ..scene(side, "implicit_euler", Precision::Double) };
    for (key, value) in set {
        scene.set_key(key, value).expect("a setting");
    }
    let rest: Vec<T::Vec3> = mesh.positions.iter().map(|p| T::Vec3::from_f64(*p)).collect();
    let topology = Topology::of(&mesh);
    let springs =
        SpringSet { topology: &topology, rest_positions: &rest, params: &scene.springs, broken: &[] };
    let mut problem = Problem::new(vec![T::ONE; rest.len()], &springs);
    problem.gravity = scene.gravity.acceleration();
    problem.air_damping = T::from_f64(scene.air_damping);
    (problem.inverse_mass[0], problem.inverse_mass[side as usize - 1]) = (T::ZERO, T::ZERO);
    problem.threads = threads;
    let crumpled = mesh.positions.iter().map(|p| T::Vec3::from_f64(*p + crumple(*p) * 10.0));
    let start = Particles::at_rest(crumpled.collect());
    let (mut state, mut stepper) = (start.clone(), T::build(&scene.simulator).expect("a method"));
    let (dt, springs) = (T::from_f64(scene.dt), problem.springs.len() as u64);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    Box::new(move || {
        pool.install(|| {
            state.clone_from(&start);
            stepper.step(&problem, &mut state, dt, &mut Cost::default());
        });
        springs
    })
}

/// What surrounds a step: from a scene to a world, and telling what became of it.
fn around(sides: &[u32]) {
    println!("Single, one thread, ms: a grid built; its measures");
    for &side in sides {
        let best = |work: &mut dyn FnMut()| {
            let times = (0..3).map(|_| {
                let start = Instant::now();
                work();
                start.elapsed().as_secs_f64() * 1e3
            });
            times.fold(f64::INFINITY, f64::min)
        };
        let build = best(&mut || drop(flat(side, "symplectic_euler", Precision::Single)));
        let world = flat(side, "symplectic_euler", Precision::Single);
        println!(
            "{side:4}²: {build:8.2} {:8.2}",
            best(&mut || {
                std::hint::black_box(world.measures());
            })
        );
    }
}

/// The limit of stability, looked for in parts as the workbench's gauge does, from where the search before has ended.
fn limits(sides: &[u32]) {
    println!("limit of stability in parts: ms in all, the longest part, and how many steps take as long");
    for id in ["symplectic_euler", "velocity_verlet", "explicit_euler", "rk4"] {
        for &side in sides {
            let mut world = sheet(side, false, "symplectic_euler", Precision::Single, 1);
            let start = Instant::now();
            (0..50).for_each(|_| world.step());
            let step = start.elapsed().as_secs_f64() / 50.0;
            world.apply(Command::Set { key: "simulator.id".into(), value: id.into() }).unwrap();
            let mut earlier = None;
            let mut last = (0.0, 0.0_f64);
            for _ in 0..2 {
                let spectrum = world.spectrum().in_parts(earlier.take());
                last = (0.0, 0.0);
                loop {
                    let start = Instant::now();
                    spectrum.allow((100_000 / (side * side) as usize).clamp(1, 1000));
                    std::hint::black_box(world.dt_limit(&spectrum));
                    let part = start.elapsed().as_secs_f64();
                    last = (last.0 + part, last.1.max(part));
                    if spectrum.is_settled() {
                        break;
                    }
                }
                earlier = Some(spectrum);
            }
            println!("{id:20} {side:4}²: {:8.2} {:8.2} {:8.0}", last.0 * 1e3, last.1 * 1e3, last.0 / step);
        }
    }
}

fn main() {
    let asked = |word: &str| std::env::args().any(|argument| argument == word);
    let sides: &[u32] = if asked("large") { &[25, 100, 316, 1000] } else { &[25, 100, 316] };
    if asked("methods") {
        methods(sides);
    } else if asked("sweeps") {
        sweeps(sides);
    } else if asked("implicit") {
        implicit(sides);
    } else if asked("around") {
        overheads(sides);
        around(sides);
        limits(sides);
    } else {
        explicit(sides);
    }
}
