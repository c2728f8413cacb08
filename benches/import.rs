//! How long it takes to import a sheet of 100k vertices, beside merely reading its text or its floats.
#![allow(missing_docs, clippy::unwrap_used)]

use std::fmt::Write;
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use tenter::model::Topology;
use tenter::target::{ImportOptions, QuadMesh, grid, import_bytes};

const SIDE: u32 = 317;

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

fn glb(mesh: &QuadMesh) -> Vec<u8> {
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
    let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
    let json = json.to_string().into_bytes();
    gltf::Glb { header, json: json.into(), bin: Some(binary.into()) }.to_vec().unwrap()
}

fn import(c: &mut Criterion) {
    let mesh = grid(SIDE, SIDE, 0.01, false);
    let (text, binary) = (obj(&mesh), glb(&mesh));
    let options = ImportOptions::default();
    let mut group = c.benchmark_group("import_100k_vertices");
    group.sample_size(10).throughput(Throughput::Elements(mesh.positions.len() as u64));
    let split = || text.split_ascii_whitespace().map(str::len).sum::<usize>();
    group.bench_function("obj_split_words_only", |b| b.iter(|| black_box(split())));
    let numbers = || text.split_ascii_whitespace().filter_map(|w| w.parse::<f64>().ok()).sum::<f64>();
    group.bench_function("obj_parse_numbers_only", |b| b.iter(|| black_box(numbers())));
    group.bench_function("obj", |b| {
        b.iter(|| import_bytes("a.obj", text.as_bytes(), None, &options).unwrap());
    });
    let nearby = ImportOptions { weld: 1e-6, ..options };
    group.bench_function("obj_weld_1e-6", |b| {
        b.iter(|| import_bytes("a.obj", text.as_bytes(), None, &nearby).unwrap());
    });
    let floats = || binary.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).sum::<f32>();
    group.bench_function("glb_read_floats_only", |b| b.iter(|| black_box(floats())));
    group.bench_function("glb", |b| b.iter(|| import_bytes("a.glb", &binary, None, &options).unwrap()));
    group.finish();
}

fn topology(c: &mut Criterion) {
    let mut group = c.benchmark_group("topology");
    group.sample_size(10);
    for side in [100, 316, 1000] {
        let mesh = grid(side, side, 0.01, false);
        group.throughput(Throughput::Elements(mesh.positions.len() as u64));
        group.bench_function(format!("grid_{side}"), |b| b.iter(|| Topology::of(&mesh)));
    }
    group.finish();
}

criterion_group!(benches, import, topology);
criterion_main!(benches);
