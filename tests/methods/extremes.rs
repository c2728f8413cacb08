//! Extremes: every one ends in a bounded state or in a divergence with a name.

use super::scenes::{W1, near, run, world};
use tenter::model::SpringKind;
use tenter::simulators;
use tenter::world::{Command, Health, World};

/// The state is finite, and no coordinate has left the neighbourhood without the world saying so.
fn bounded_or_named(what: &str, world: &World) {
    let finite = world.positions().iter().chain(&world.velocities()).all(|v| v.is_finite());
    assert!(finite, "{what}: not finite");
    let named = matches!(world.health(), Health::Diverged { .. });
    let near = world.positions().iter().all(|x| x.length() < 1e3);
    assert!(near || named, "{what}: {:?}", world.health());
}

/// Methods that stay near at any dt and stiffness by theory.
const UNCONDITIONAL: [&str; 5] = ["verlet", "xpbd", "implicit_euler", "implicit_midpoint", "bdf2"];

fn check(what: &str, id: &str, world: &World) {
    bounded_or_named(what, world);
    if UNCONDITIONAL.contains(&id) {
        assert!(!world.health().is_diverged(), "{what}: {:?}", world.health());
    }
    let Health::Unsettled { cause, .. } = world.health() else { return };
    println!("{what}: unsettled, {cause:?}, {:.1e}", world.cost().residual);
}

/// A method that gives up soon where it must, so that the tests are brief.
fn brief(id: &str) -> String {
    match id {
        "rk45" => "rk45(most_steps=300)".into(),
        _ => id.into(),
    }
}

#[test]
fn any_dt() {
    for entry in simulators::ALL {
        for dt in ["1e-6", "1e-3", "0.004166666666666667", "0.016666666666666666", "0.1", "1.0"] {
            let what = format!("{}, dt {dt}", entry.id);
            let mut strain = 0.0;
            for precision in ["Double", "Single"] {
                let settings = [&*format!("dt={dt}"), &format!("precision={precision}")];
                // A dozen steps of a second settle more than a hundred of a millisecond.
                let steps = if dt.parse::<f64>().is_ok_and(|dt| dt > 0.05) { 12 } else { 60 };
                let world = run(world(W1, &brief(entry.id), &settings), steps);
                check(&format!("{what}, {precision}"), entry.id, &world);
                strain = world.measures().max_strain;
            }
            println!("{what}: strain {strain:.2e}");
        }
    }
}

#[test]
fn strains_are_those_that_an_independent_one_has() {
    // Largest strain of a stretch spring after 120 steps; that of XPBD depends on the order of springs.
    let end = |method: &str, dt: &str| {
        let world = run(world(W1, method, &[&format!("dt={dt}")]), 120);
        let stretch = world.topology().of_kind(SpringKind::Stretch).len() as u32;
        let mut strains = Vec::new();
        world.strains(&mut strains);
        strains.iter().filter(|(s, _)| *s < stretch).fold(0.0, |most, (_, e)| f64::from(*e).max(most))
    };
    for (dt, expected) in [("0.016666666666666666", 0.057), ("0.1", 0.063)] {
        near(&format!("implicit Euler, {dt}"), end("implicit_euler(newton_steps=1)", dt), expected, 0.05);
    }
    near("XPBD", end("xpbd(substeps=1,iterations=10)", "0.016666666666666666"), 0.082, 0.2);
}

#[test]
fn any_stiffness() {
    for entry in simulators::ALL {
        for k in ["0.0", "10.0", "1e3", "1e5", "1e7", "1e9"] {
            for dt in ["1e-6", "0.016666666666666666", "1.0"] {
                let what = format!("{}, k {k}, dt {dt}", entry.id);
                let stiffness =
                    ["stretch", "shear", "bend"].map(|kind| format!("springs.{kind}.stiffness={k}"));
                let dt = format!("dt={dt}");
                let settings = [&*stiffness[0], &stiffness[1], &stiffness[2], &dt, "air_damping=0.05"];
                let world = run(world(W1, &brief(entry.id), &settings), 12);
                if k == "0.0" && dt == "dt=1.0" {
                    assert!(world.measures().max_strain.is_finite());
                } else {
                    check(&what, entry.id, &world);
                }
                println!("{what}: strain {:.1e}", world.measures().max_strain);
            }
        }
    }
}

#[test]
fn implicit_methods_stay_bounded_at_any_stiffness_and_step() {
    // Six by six of W1: the stiffest are solved in thousands of iterations.
    let sheet = [
        "target=Grid(columns: 6, rows: 6, spacing: 0.1, plane: Horizontal)",
        "pins=[Particle(0), Particle(5)]",
        "air_damping=0.05",
    ];
    for method in ["implicit_euler", "implicit_midpoint", "bdf2"] {
        for k in ["0.0", "10.0", "1e3", "1e5", "1e7", "1e9"] {
            for dt in ["1e-6", "1e-4", "0.016666666666666666", "0.1", "1.0"] {
                let what = format!("{method}, k {k}, dt {dt}");
                let stiffness =
                    ["stretch", "shear", "bend"].map(|kind| format!("springs.{kind}.stiffness={k}"));
                let dt = format!("dt={dt}");
                let settings = [&sheet[..], &[&*stiffness[0], &stiffness[1], &stiffness[2], &dt]].concat();
                let mut world = world(W1, method, &settings);
                let (mass, start) = (0.02 * 36.0, world.measures().energy);
                let (mut highest, mut strain) = (0.0f64, 0.0f64);
                for _ in 0..60 {
                    world.step();
                    let (measures, energy) = (world.measures(), world.measures().energy);
                    highest = highest.max(energy.kinetic + energy.elastic + energy.gravitational);
                    strain = strain.max(measures.max_strain);
                }
                let unsolved = world.cost().unsolved_steps;
                let rise = highest - start.gravitational;
                println!("{what}: energy up by {rise:.1e} J, strain {strain:.1e}, {unsolved} unsolved");
                assert!(!world.health().is_diverged(), "{what}: {:?}", world.health());
                // Nothing gives energy. A tenth of what a fall by the length of the sheet sets free is what one step of implicit
                // midpoint may create.
                assert!(rise < 0.1 * mass * 9.81 * 0.5, "{what}: {rise} J");
                let told = matches!(world.health(), Health::Unsettled { .. });
                assert!(told || unsolved == 0, "{what}: {unsolved} steps unsolved and not told");
            }
        }
    }
}

#[test]
fn odd_shapes_and_settings() {
    let targets =
        ["columns: 1, rows: 1", "columns: 1, rows: 5", "columns: 5, rows: 1", "columns: 2, rows: 2"];
    let odd = [
        "pins=[Box((-9.0,-9.0,-9.0),(9.0,9.0,9.0))]",
        "springs.stretch.rest_scale=0.0",
        "springs.stretch.enabled=false",
        "springs.damping=1e9",
        "springs.stretch.stiffness=1e12",
        "springs.stretch.stiffness=1e-300",
        "gravity.magnitude=1e6",
        "air_damping=1e9",
        "mass=PerParticle(1e-6)",
    ];
    for entry in simulators::ALL {
        for target in targets.iter().chain(&["columns: 4, rows: 4"]) {
            for setting in odd {
                for precision in ["Double", "Single"] {
                    let scene = format!("(target: Grid({target}, spacing: 0.5), precision: {precision})");
                    let world = run(world(&scene, &brief(entry.id), &[setting]), 20);
                    let what = format!("{}, {target}, {setting}, {precision}", entry.id);
                    let finite = world.positions().iter().chain(&world.velocities()).all(|v| v.is_finite());
                    assert!(finite, "{what}");
                }
            }
        }
    }
}

#[test]
fn a_drag_far_away_comes_back() {
    for entry in simulators::ALL {
        for far in [1.0, 10.0, 1000.0] {
            let mut world = world(W1, &brief(entry.id), &["dt=0.004166666666666667"]);
            let act = |world: &mut World, command: Command| world.apply(command).expect("accepted");
            act(&mut world, Command::Grab { particles: vec![99] });
            let to = world.positions()[99] + glam::DVec3::new(0.0, far, far);
            act(&mut world, Command::Drag { particle: 99, to, steps: 1 });
            world.step();
            act(
                &mut world,
                Command::Drag { particle: 99, to: to - glam::DVec3::new(0.0, far, far), steps: 1 },
            );
            let world = run(world, 50);
            check(&format!("{}, {far} m", entry.id), entry.id, &world);
        }
    }
}

#[test]
fn a_sheet_in_its_own_plane_stays_there() {
    for entry in simulators::ALL {
        let sheet = "(target: Grid(columns: 6, rows: 6, spacing: 1.0, plane: Vertical), pins: [Row(0)])";
        let world = run(world(sheet, entry.id, &[]), 50);
        assert!(world.positions().iter().all(|x| x.z == 0.0), "{}", entry.id);
    }
}

#[test]
fn hands_that_pull_hard_are_followed() {
    for id in ["xpbd", "implicit_euler", "implicit_midpoint", "bdf2"] {
        let mut world = world(W1, id, &["dt=0.016666666666666666", "air_damping=0.1"]);
        world.apply(Command::Pull { particles: vec![99], stiffness: 1e9 }).expect("accepted");
        let to = glam::DVec3::new(0.4, 0.1, 0.4);
        world.apply(Command::Drag { particle: 99, to, steps: 10 }).expect("accepted");
        let world = run(world, 60);
        let off = world.positions()[99].distance(to);
        assert!(off < 1e-3, "{id}: {off} m off, {:?}", world.health());
    }
}
