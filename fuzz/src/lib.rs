//! What holds for every file that Tenter reads: it is taken or refused in one short line, within the memory that its size allows,
//! and what was taken can be written, read again and stepped. The fuzz targets and the replay of their corpus ask the same.
#![allow(clippy::unwrap_used)]
#![allow(dead_code, reason = "every test file uses a part of this")]

#[path = "../../tests/memory/mod.rs"]
pub mod memory;

use std::fmt::Display;
use std::io::Write;
use tenter::model::Topology;
use tenter::scene::{Place, Scene, Target};
use tenter::simulators::Value;
use tenter::target::{Import, ImportError, ImportOptions, import_bytes};
use tenter::world::{Command, Recording, World};

/// Longest message, bytes: a parser's quotations are cut to 401 characters, and a file's name comes before.
pub const LONGEST_MESSAGE: usize = 600;

/// Asserts that a refusal is one short line.
pub fn assert_one_line(message: &impl Display) {
    let message = message.to_string();
    assert!(!message.chars().any(char::is_control), "{message:?}");
    assert!(message.len() < LONGEST_MESSAGE, "{message}");
}

/// A scene in RON; lines `--set KEY=VALUE` before it are applied to it, as on the command line.
pub fn scene(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let mut settings = Vec::new();
    let mut rest = text;
    while let Some((key, value, after)) = setting(rest) {
        settings.push((key, value));
        rest = after;
    }
    let (read, most) = memory::measured(|| Scene::from_ron(rest));
    assert_within(most, rest.len());
    let mut scene = match read {
        Ok(scene) => scene,
        Err(refusal) => return assert_one_line(&refusal),
    };
    for (key, value) in settings {
        let before = scene.clone();
        let (set, most) = memory::measured(|| scene.set_key(key, value));
        assert_within(most, text.len());
        if let Err(refusal) = set {
            assert_one_line(&refusal);
            assert_eq!(scene, before, "a refused setting changed the scene");
        }
    }
    assert_eq!(Scene::from_ron(&scene.to_ron().unwrap()).as_ref(), Ok(&scene), "written and read again");
    if is_small(&scene) {
        run(World::new(scene, Place::default()));
    }
}

/// The first line of a text where it is a setting, and the text behind it.
fn setting(text: &str) -> Option<(&str, &str, &str)> {
    let (line, rest) = text.strip_prefix("--set ")?.split_once('\n')?;
    let (key, value) = line.split_once('=')?;
    Some((key.trim(), value.trim(), rest))
}

/// A recording in RON.
pub fn recording(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let (read, most) = memory::measured(|| Recording::from_ron(text));
    assert_within(most, text.len());
    let recording = match read {
        Ok(recording) => recording,
        Err(refusal) => return assert_one_line(&refusal),
    };
    // As texts: a command may be of a number that is none, which is refused where it is applied and equals nothing.
    let written = recording.to_ron().unwrap();
    let again = Recording::from_ron(&written).and_then(|again| again.to_ron());
    assert_eq!(again.as_ref(), Ok(&written), "written and read again");
    // Every scene on the way must be one that is soon built and stepped.
    let mut scene = recording.scene.clone();
    if !is_small(&scene) {
        return;
    }
    for entry in &recording.commands {
        if let Command::Set { key, value } = &entry.command
            && scene.set_key(key, value).is_ok()
            && !is_small(&scene)
        {
            return;
        }
    }
    let mut world = match recording.start(Place::default()) {
        Ok(world) => world,
        Err(refusal) => return assert_one_line(&refusal),
    };
    let mut next = 0;
    for _ in 0..STEPS {
        if let Err(refusal) = recording.apply_due(&mut world, &mut next) {
            return assert_one_line(&refusal);
        }
        if world.steps() == recording.steps {
            break;
        }
        world.step();
    }
    assert_sound(&world);
}

/// An OBJ file.
pub fn obj(bytes: &[u8]) {
    mesh("a.obj", bytes);
}

/// A glTF file, binary where it begins as one.
pub fn gltf(bytes: &[u8]) {
    mesh(if bytes.starts_with(b"glTF") { "a.glb" } else { "a.gltf" }, bytes);
}

fn mesh(name: &str, bytes: &[u8]) {
    let exact = import(name, bytes, 0.0);
    let _ = import(name, bytes, 1e-3);
    let Ok(exact) = exact else { return };
    if exact.mesh.positions.len() > PARTICLES || exact.mesh.corners().len() > 8 * PARTICLES {
        return;
    }
    let mut file = tempfile::Builder::new().suffix(&name[1..]).tempfile().unwrap();
    file.write_all(bytes).unwrap();
    let path = file.path().to_str().unwrap();
    let mut place = Place::default();
    place.allow(path);
    run(World::new(Scene { target: Target::mesh(path), ..Scene::default() }, place));
}

/// Imports a mesh and asserts what holds for every input.
///
/// # Errors
/// Those of the import.
pub fn import(name: &str, bytes: &[u8], weld: f64) -> Result<Import, ImportError> {
    let options = ImportOptions { weld, surface: true, ..ImportOptions::default() };
    let (result, most) = memory::measured(|| import_bytes(name, bytes, None, &options));
    assert_within(most, bytes.len());
    match &result {
        Ok(import) => {
            let mesh = &import.mesh;
            assert!(mesh.face_count() > 0);
            assert!(mesh.positions.iter().all(|p| p.is_finite()));
            let count = mesh.positions.len() as u32;
            assert!(mesh.faces().all(|f| f.len() >= 3 && f.iter().all(|corner| *corner < count)));
            let in_order =
                |pairs: &[[u32; 2]]| pairs.is_sorted_by(|a, b| a < b) && pairs.iter().all(|p| p[0] < p[1]);
            assert!(Topology::of(mesh).pairs.iter().all(|pairs| in_order(pairs)));
        }
        Err(error) => assert_one_line(error),
    }
    result
}

/// Largest cloth that is stepped, particles.
const PARTICLES: usize = 100;
/// Steps that it takes.
const STEPS: u64 = 3;

/// Whether a step of a scene is soon done: a user may ask for a million particles and as many sweeps, and gets them.
fn is_small(scene: &Scene) -> bool {
    let few = match &scene.target {
        Target::Grid(grid) => u64::from(grid.columns) * u64::from(grid.rows) <= PARTICLES as u64,
        Target::Mesh(mesh) => mesh.asset().is_none(),
    };
    few && scene.simulator.params.values().all(|value| !matches!(value, Value::Count(n) if *n > 1000))
}

/// Steps a world that was made.
fn run(world: Result<World, tenter::scene::Refusal>) {
    let mut world = match world {
        Ok(world) => world,
        Err(refusal) => return assert_one_line(&refusal),
    };
    for _ in 0..STEPS {
        world.step();
    }
    assert_sound(&world);
}

/// Whatever happened, what is shown is finite.
fn assert_sound(world: &World) {
    assert!(world.positions().iter().all(|p| p.is_finite()), "{:?}", world.health());
    assert!(world.velocities().iter().all(|v| v.is_finite()), "{:?}", world.health());
    world.warnings().iter().for_each(assert_one_line);
    let _ = (world.measures(), world.dt_limit(&world.spectrum()), world.digest());
}

fn assert_within(most: usize, file: usize) {
    let allowed = memory::allowed(file);
    assert!(most <= allowed, "{most} bytes held for a file of {file}, {allowed} allowed");
}
