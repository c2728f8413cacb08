//! How long a sheet takes from its file to its first step, at four sizes: in linear time, what is told for each vertex stays
//! the same.
//!
//! Import stands beside a yardstick, the least that any reader does with the same bytes: of OBJ, splitting the text into words
//! and parsing each number, and besides what tobj takes for them; of glTF, parsing the JSON, and from its text (`.gltf`) or as they stand (`.glb`) reading each float
//! and each index. All that makes cloth of it comes on top: finding the polygons, welding, looking for what is there twice or
//! crossed, and for glTF bringing the quads back. Candidates take turns, and each keeps its shortest time.
#![allow(missing_docs, clippy::unwrap_used)]

use base64::Engine as _;
use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Instant;
use tenter::model::{Numbering, Topology};
use tenter::scene::{GridTarget, Pin, Pins, Place, Precision, Scene, Target};
use tenter::simulators::SimulatorSettings;
use tenter::target::{ImportOptions, QuadMesh, grid, import_bytes};
use tenter::world::World;

/// Particles along each side: 100 thousand, 200, 400, and a million.
const SIDES: [u32; 4] = [316, 447, 632, 1000];
const TURNS: usize = 5;

fn obj(mesh: &QuadMesh) -> String {
    let mut text = String::new();
    for p in &mesh.positions {
        writeln!(text, "v {:.6} {:.6} {:.6}", p.x, p.y, p.z).unwrap();
    }
    for face in mesh.faces() {
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| face[i] + 1);
        writeln!(text, "f {a} {b} {c} {d}").unwrap();
    }
    text
}

/// The same mesh with its vertices and its faces in an order without sense.
fn shuffled(mesh: &QuadMesh) -> QuadMesh {
    let [names, order] = [mesh.positions.len(), mesh.face_count()].map(permutation);
    let mut other = QuadMesh::new(mesh.positions.clone());
    for (name, at) in names.iter().zip(&mesh.positions) {
        other.positions[*name as usize] = *at;
    }
    for f in order {
        let face = mesh.face(f as usize);
        other.push_face(&[0, 1, 2, 3].map(|i| names[face[i] as usize]));
    }
    other
}

/// The same at every run, by xorshift64 (Marsaglia, "Xorshift RNGs", 2003).
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

/// A glTF document of two triangles a quad, and its binary data.
fn gltf(mesh: &QuadMesh) -> (serde_json::Value, Vec<u8>) {
    let positions: Vec<f32> = mesh.positions.iter().flat_map(|p| p.as_vec3().to_array()).collect();
    let indices: Vec<u32> = mesh.faces().flat_map(|f| [f[0], f[1], f[2], f[0], f[2], f[3]]).collect();
    let mut binary: Vec<u8> = positions.iter().flat_map(|x| x.to_le_bytes()).collect();
    let split = binary.len();
    binary.extend(indices.iter().flat_map(|i| i.to_le_bytes()));
    let json = serde_json::json!({
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": positions.len() / 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": indices.len(), "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": split},
            {"buffer": 0, "byteOffset": split, "byteLength": binary.len() - split}],
        "buffers": [{"byteLength": binary.len()}],
    });
    (json, binary)
}

/// The document with its data as text inside.
fn as_text((mut json, binary): (serde_json::Value, Vec<u8>)) -> String {
    let data = base64::engine::general_purpose::STANDARD.encode(binary);
    json["buffers"][0]["uri"] = format!("data:application/octet-stream;base64,{data}").into();
    json.to_string()
}

/// The document and its data as one binary file.
fn as_binary((json, binary): (serde_json::Value, Vec<u8>)) -> Vec<u8> {
    let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
    let json = json.to_string().into_bytes();
    gltf::Glb { header, json: json.into(), bin: Some(binary.into()) }.to_vec().unwrap()
}

/// Reads floats and indices, four bytes each.
fn numbers(binary: &[u8]) -> f64 {
    let (words, _) = binary.as_chunks::<4>();
    words.iter().map(|word| f64::from(f32::from_le_bytes(*word))).sum()
}

/// Shortest time of each candidate, s.
fn race<const N: usize>(turns: usize, mut candidates: [&mut dyn FnMut(); N]) -> [f64; N] {
    let mut best = [f64::INFINITY; N];
    for _ in 0..turns {
        for (best, work) in best.iter_mut().zip(&mut candidates) {
            let start = Instant::now();
            work();
            *best = best.min(start.elapsed().as_secs_f64());
        }
    }
    best
}

fn import(name: &str, bytes: &[u8]) {
    black_box(import_bytes(name, bytes, None, &ImportOptions::default()).unwrap());
}

fn imports() {
    println!("import, ms, and how many times its yardstick");
    println!(
        "vertices | OBJ: numbers, import, ratio | tobj, import, ratio | glTF: text, import, ratio | GLB: floats, import, ratio"
    );
    for side in SIDES {
        let mesh = grid(side, side, 0.01, false);
        let (obj, text, glb) = (obj(&mesh), as_text(gltf(&mesh)), as_binary(gltf(&mesh)));
        let times = race(
            TURNS,
            [
                &mut || {
                    let numbers = obj.split_ascii_whitespace().filter_map(|word| word.parse::<f64>().ok());
                    black_box(numbers.sum::<f64>());
                },
                &mut || import("a.obj", obj.as_bytes()),
                &mut || {
                    let options = tobj::LoadOptions::default();
                    let none = |_: &std::path::Path| Ok(<(Vec<_>, _)>::default());
                    black_box(tobj::load_obj_buf(&mut obj.as_bytes(), &options, none).unwrap().0);
                },
                &mut || import("a.obj", obj.as_bytes()),
                &mut || {
                    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
                    let uri = json["buffers"][0]["uri"].as_str().unwrap();
                    let data = uri.split_once(',').unwrap().1;
                    black_box(numbers(&base64::engine::general_purpose::STANDARD.decode(data).unwrap()));
                },
                &mut || import("a.gltf", text.as_bytes()),
                &mut || {
                    black_box(numbers(&glb));
                },
                &mut || import("a.glb", &glb),
            ],
        );
        print!("{:8}", mesh.positions.len());
        for [least, all] in *times.as_chunks::<2>().0.as_array::<4>().unwrap() {
            print!(" | {:7.1} {:7.1} {:6.2}", 1e3 * least, 1e3 * all, all / least);
        }
        println!();
    }
}

fn scene(target: Target, method: &str) -> Scene {
    let pins = Pins::of([Pin::Particle(0)]);
    let simulator = SimulatorSettings::new(method);
    Scene { target, pins, simulator, precision: Precision::Single, dt: 1e-4, ..Scene::default() }
}

/// Time of the first step beyond that of the next, for each vertex, ns.
fn preparation(target: &Target, method: &str) -> f64 {
    let mut world = World::new(scene(target.clone(), method), Place::default()).unwrap();
    let mut step = || {
        let start = Instant::now();
        world.step();
        start.elapsed().as_secs_f64()
    };
    let first = step();
    1e9 * (first - step()) / world.pinned().len() as f64
}

fn parts() {
    const METHODS: [&str; 4] = ["symplectic_euler", "verlet", "xpbd", "vbd"];
    println!("\nfor each vertex, ns: springs of a sheet in order and shuffled, numbering of the latter;");
    println!(
        "a world of a grid, of the OBJ file, of the file shuffled; what {METHODS:?} prepare for the first step on a grid"
    );
    let folder = tempfile::tempdir().unwrap();
    for side in SIDES {
        let mesh = grid(side, side, 0.01, false);
        let shuffled = shuffled(&mesh);
        let topology = Topology::of(&shuffled);
        let each = 1e9 / mesh.positions.len() as f64;
        let file = |name: &str, mesh: &QuadMesh| {
            let path = folder.path().join(name);
            std::fs::write(&path, obj(mesh)).unwrap();
            (Target::mesh(path.to_str().unwrap()), path)
        };
        let files = [file("a.obj", &mesh), file("b.obj", &shuffled)];
        let grid =
            Target::Grid(GridTarget { columns: side, rows: side, spacing: 0.01, ..GridTarget::default() });
        let world = |target: &Target, place: &Place| {
            black_box(World::new(scene(target.clone(), "symplectic_euler"), place.clone()).unwrap());
        };
        let named = |(target, path): &(Target, std::path::PathBuf)| {
            let mut place = Place::default();
            place.allow(path);
            world(target, &place);
        };
        let times = race(
            3,
            [
                &mut || drop(black_box(Topology::of(&mesh))),
                &mut || drop(black_box(Topology::of(&shuffled))),
                &mut || drop(black_box(Numbering::of(shuffled.positions.len(), &topology))),
                &mut || world(&grid, &Place::default()),
                &mut || named(&files[0]),
                &mut || named(&files[1]),
            ],
        );
        print!("{:8} |", mesh.positions.len());
        times.iter().for_each(|time| print!(" {:6.0}", time * each));
        print!(" |");
        METHODS.iter().for_each(|method| print!(" {:6.0}", preparation(&grid, method)));
        println!(" | worlds in all, s: {:.2} {:.2} {:.2}", times[3], times[4], times[5]);
    }
}

fn main() {
    if std::env::args().any(|word| word == "--test") {
        return;
    }
    imports();
    parts();
}
