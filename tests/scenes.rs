//! Scenes: defaults, reading and writing, and the built-in ones.

use glam::DVec3;
use proptest::prelude::*;
use tenter::scene::{GridTarget, Mass, Pin, Pins, Place, Plane, Precision, Scene, Target, builtin};
use tenter::world::{Health, World};

fn world(scene: Scene) -> World {
    World::new(scene, Place::default()).expect("the scene is accepted")
}

#[test]
fn an_empty_file_is_the_sheet_of_the_contract() {
    let text = r#"(
        target: Grid(columns: 25, rows: 25, spacing: 1.0, plane: Horizontal),
        pins: [Corners(3)],
        mass: PerParticle(1.0),
        springs: (
            stretch: (enabled: true, stiffness: 1000.0, rest_scale: 1.0),
            shear:   (enabled: true, stiffness: 300.0,  rest_scale: 1.0),
            bend:    (enabled: true, stiffness: 100.0,  rest_scale: 1.0),
            damping: 2.0,
        ),
        air_damping: 1.0,
        gravity: (enabled: true, magnitude: 10.0),
        wind: (enabled: false, strength: 10.0, frequency: 0.2, direction: (-0.2, 0.15, 0.85)),
        tearing: (enabled: false, max_ratio: 3.0),
        simulator: (id: "symplectic_euler", params: {}),
        precision: Double,
        dt: 0.02,
    )"#;
    let whole = Scene::from_ron(text).expect("the contract's scene");
    let empty = Scene::from_ron("()").expect("an empty scene");
    assert_eq!(Scene { pins: Pins::default(), ..whole.clone() }, empty);
    let (mut whole, mut empty) = (world(whole), world(empty));
    assert_eq!(whole.pinned(), empty.pinned());
    for _ in 0..50 {
        whole.step();
        empty.step();
    }
    assert_eq!(whole.digest(), empty.digest());
}

#[test]
fn what_a_file_leaves_out_of_a_kind_keeps_that_kinds_default() {
    let scene = Scene::from_ron("(springs: (shear: (enabled: false)))").expect("accepted");
    assert_eq!(scene.springs.shear.stiffness, 300.0);
    assert_eq!(scene.springs.bend.stiffness, 100.0);
}

#[test]
fn grids_are_numbered_row_by_row_where_the_contract_says() {
    let at = |plane: Plane| {
        let target = Target::Grid(GridTarget { columns: 4, rows: 3, spacing: 0.5, plane });
        world(Scene { target, ..Scene::default() }).positions()
    };
    for r in 0..3 {
        for c in 0..4 {
            let x = (f64::from(c) - 1.5) * 0.5;
            let index = (r * 4 + c) as usize;
            assert_eq!(at(Plane::Horizontal)[index], DVec3::new(x, 0.0, (f64::from(r) - 1.0) * 0.5));
            assert_eq!(at(Plane::Vertical)[index], DVec3::new(x, -0.5 * f64::from(r), 0.0));
        }
    }
}

#[test]
fn pins_are_a_union() {
    let pinned = |text: &str| {
        let scene = Scene::from_ron(&format!("(target: Grid(columns: 5, rows: 4), pins: {text})"));
        let world = world(scene.expect("accepted"));
        let chosen = world.pinned().iter().enumerate().filter(|(_, p)| **p);
        chosen.map(|(i, _)| i).collect::<Vec<_>>()
    };
    assert!(pinned("[]").is_empty());
    assert_eq!(pinned("[Particle(7), Corners(1)]"), [0, 4, 7usize]);
    assert_eq!(pinned("[Row(1)]"), [5, 6, 7, 8, 9usize]);
    assert_eq!(pinned("[Column(4)]"), [4, 9, 14, 19usize]);
    assert_eq!(pinned("[Nearest((100, 0, 100))]"), [19usize]);
    assert_eq!(pinned("[Box((-2, -1, -1.5), (-1, 1, -0.5))]"), [0, 1, 5, 6usize]);
    // A horizontal sheet has no height: all of it is its highest part.
    assert_eq!(pinned("[Top(0.1)]").len(), 20);
    assert_eq!(pinned("[Corners(9)]"), [0, 1, 2, 3, 4usize]);
}

#[test]
fn mass_by_area_gives_each_corner_its_part() {
    let scene = Scene::from_ron("(target: Grid(columns: 3, rows: 2, spacing: 2.0), mass: PerArea(0.5))");
    let scene = scene.expect("accepted");
    let mass = scene.mass.of(world(scene.clone()).mesh()).expect("faces");
    // Each quad has 4 m² and so 2 kg, 0.5 kg for each corner.
    assert_eq!(mass, [0.5, 1.0, 0.5, 0.5, 1.0, 0.5]);
    let chain = Scene::from_ron("(target: Grid(columns: 3, rows: 1), mass: PerArea(0.5))").expect("read");
    let refusal = World::new(chain, Place::default()).err().expect("a chain has no area");
    assert!(refusal.to_string().contains("PerParticle"), "{refusal}");
}

#[test]
fn built_in_scenes_read_back_as_themselves_and_run_soundly() {
    for known in builtin::ALL {
        let scene = (known.make)();
        let text = scene.to_ron().expect("written");
        assert_eq!(Scene::from_ron(&text).expect("read back"), scene, "{}\n{text}", known.name);
        let mut world = world(scene);
        for _ in 0..200 {
            world.step();
        }
        let bursts = known.name == "explicit_bursts";
        assert_eq!(world.health().is_diverged(), bursts, "{}: {:?}", known.name, world.health());
        assert!(bursts || world.health() == Health::Ok, "{}: {:?}", known.name, world.health());
    }
}

#[test]
fn the_thesis_demonstrations_show_what_they_say() {
    let after = |name: &str, seconds: f64| {
        let scene = (builtin::find(name).expect("built in").make)();
        let steps = (seconds / scene.dt).round() as u64;
        let mut world = world(scene);
        for _ in 0..steps {
            world.step();
        }
        world
    };
    let (two, fifty) = (after("verlet_2_sweeps", 10.0), after("verlet_50_sweeps", 10.0));
    assert!(two.measures().max_strain > 10.0 * fifty.measures().max_strain, "sweeps make it stiffer");
    let torn = after("tearing", 10.0);
    assert!(!torn.broken().is_empty() && torn.acting_springs() + torn.broken().len() == 1200 + 1152 + 1150);
    let [obj, gltf] = ["cylinder", "cylinder_gltf"].map(|name| after(name, 1.0));
    let difference =
        |p: &DVec3| gltf.positions().iter().map(|q| q.distance(*p)).fold(f64::INFINITY, f64::min);
    // The files hold the same shape in single precision; 1 s of smooth motion amplifies that little.
    let apart = obj.positions().iter().map(difference).fold(0.0, f64::max);
    assert!(apart < 1e-3, "{apart}");
}

prop_compose! {
    fn any_scene()(
        columns in 1u32..20, rows in 1u32..20, spacing in 1e-3f64..1e3, vertical: bool,
        pins in proptest::option::of(prop::collection::vec(0u32..1, 0..3)),
        by_area: bool, mass in 1e-6f64..1e6,
        k in 0.0f64..1e9, shear: bool, damping in 0.0f64..100.0, rest_scale in 0.0f64..2.0,
        wind: bool, direction in (-1.0f64..1.0, -1.0f64..1.0, 0.1f64..1.0),
        single: bool, dt in 0.0f64..1.0,
    ) -> Scene {
        let plane = if vertical { Plane::Vertical } else { Plane::Horizontal };
        let mut scene = Scene {
            target: Target::Grid(GridTarget { columns, rows, spacing, plane }),
            mass: if by_area { Mass::PerArea(mass) } else { Mass::PerParticle(mass) },
            precision: if single { Precision::Single } else { Precision::Double },
            dt,
            ..Scene::default()
        };
        if let Some(pins) = pins {
            scene.pins = Pins::of(pins.into_iter().map(Pin::Particle).collect::<Vec<_>>());
        }
        scene.springs.stretch.stiffness = k;
        scene.springs.stretch.rest_scale = rest_scale;
        scene.springs.shear.enabled = shear;
        scene.springs.damping = damping;
        scene.wind.enabled = wind;
        scene.wind.direction = DVec3::from(direction);
        scene
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(200) })]

    #[test]
    fn a_scene_that_is_saved_and_loaded_again_is_the_same(scene in any_scene()) {
        let text = scene.to_ron().expect("written");
        let again = Scene::from_ron(&text).expect("read back");
        prop_assert_eq!(&again, &scene);
        prop_assert_eq!(again.to_ron().expect("written"), text);
    }
}
