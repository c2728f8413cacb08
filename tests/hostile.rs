//! Files that are broken or awkward, and bytes at random: a clear refusal in one line or a clean load, never a panic, and never more
//! memory than 64 times the file and 64 MiB.
#![allow(clippy::unwrap_used)]

#[path = "../fuzz/src/lib.rs"]
mod fuzz;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use fuzz::{assert_one_line, import as checked, memory};
use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;
use serde_json::Value;
use tenter::model::Topology;
use tenter::target::{Import, ImportError, ImportOptions, grid, import_bytes, import_file};

/// Imports, and tells how many bytes were held for it at most.
fn measured(name: &str, bytes: &[u8], weld: f64) -> (Result<Import, ImportError>, usize) {
    memory::measured(|| {
        import_bytes(name, bytes, None, &ImportOptions { scale: 1.0, weld, ..ImportOptions::default() })
    })
}

fn shared_meshes() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/meshes");
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(std::env::var_os("CI").is_none(), "{} is missing", folder.display());
    println!("skipped: {} is missing", folder.display());
    None
}

/// What the list says of each file: `ok` loads, `error` is refused, `warn` loads and tells, `error_or_warn` does either.
#[test]
fn every_hostile_file_does_what_its_list_says() {
    let Some(folder) = shared_meshes() else { return };
    let list: Vec<Value> =
        serde_json::from_slice(&std::fs::read(folder.join("hostile/hostile.json")).unwrap()).unwrap();
    for entry in &list {
        let file = entry["file"].as_str().unwrap();
        let path = folder.join("hostile").join(file);
        let result = import_file(&path, &ImportOptions::default());
        let _ = checked(file, &std::fs::read(&path).unwrap(), 0.0);
        let import = match (&result, entry["expect"].as_str().unwrap()) {
            (Ok(import), "ok") => import,
            // Invalid only in what this reader does not need.
            (Ok(import), "error_or_warn") if file == "g_no_minmax.gltf" => import,
            (Ok(import), "warn" | "error_or_warn") => {
                assert!(!import.report.warnings.is_empty(), "{file} gave no warning");
                import
            }
            (Err(error), "error" | "error_or_warn") => {
                let message = error.to_string();
                assert_one_line(&message);
                assert!(message.contains(file), "{message}");
                continue;
            }
            (result, expected) => {
                panic!("{file}: expected {expected}, got {:?}", result.as_ref().map(|i| &i.report))
            }
        };
        let [stretch, shear, bend] = Topology::of(&import.mesh).pairs.map(|pairs| pairs.len());
        let particles = import.mesh.positions.len();
        let is = |key: &str, got: usize| {
            if let Some(want) = entry["counts"][key].as_u64() {
                assert_eq!(got, want as usize, "{file}: {key}");
            }
        };
        is("particles", particles);
        is("particles_exact", particles);
        is("quads", import.report.faces.quads);
        is("stretch", stretch);
        is("shear", shear);
        is("bend_grid", bend);
    }
    assert!(list.len() >= 75);
}

#[test]
fn messages_name_the_place_and_the_value() {
    let refused = |name: &str, text: &str| checked(name, text.as_bytes(), 0.0).unwrap_err().to_string();
    let index = refused("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 9\n");
    assert!(index.contains("line 5") && index.contains("`9`") && index.contains("1 to 3"), "{index}");
    let number = refused("a.obj", "# x\r\nv 0 0\\\r\n zero\r\n");
    assert!(number.contains("line 2") && number.contains("zero"), "{number}");
    let nan = refused("a.obj", "v 0 0 0\rv 1 0 nan\rv 0 1 0\rf 1 2 3\r");
    assert!(nan.contains("line 2") && nan.contains("nan"), "{nan}");
    let empty = refused("a.obj", "v 0 0 0\n");
    assert!(empty.contains("holds no faces"), "{empty}");
    let extension = refused("a\n.stl", "solid");
    assert!(extension.contains("`stl`") && extension.contains(".obj"), "{extension}");
    let required = refused(
        "a.glb",
        r#"{"asset":{"version":"2.0"},"extensionsRequired":["KHR_draco_mesh_compression"]}"#,
    );
    assert!(required.contains("KHR_draco_mesh_compression"), "{required}");
    let missing =
        import_file(Path::new("/nowhere/at all.obj"), &ImportOptions::default()).unwrap_err().to_string();
    assert!(missing.starts_with("/nowhere/at all.obj: cannot be read"), "{missing}");
}

/// A triangle whose buffer is the file that `uri` names.
fn triangle_gltf(uri: &str) -> String {
    let document = serde_json::json!({
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri": uri}],
    });
    document.to_string()
}

#[test]
fn buffers_come_from_the_mesh_s_own_folder_only() {
    let root = tempfile::tempdir().unwrap();
    let own = root.path().join("own");
    std::fs::create_dir_all(own.join("below")).unwrap();
    let triangle: Vec<u8> =
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    for file in [root.path().join("outside.bin"), own.join("in side.bin"), own.join("below/deep.bin")] {
        std::fs::write(file, &triangle).unwrap();
    }
    let load = |uri: &str| {
        let path = own.join("mesh.gltf");
        std::fs::write(&path, triangle_gltf(uri)).unwrap();
        import_file(&path, &ImportOptions::default()).map_err(|e| e.to_string())
    };
    for uri in ["in%20side.bin", "in side.bin", "./below/deep.bin"] {
        assert_eq!(load(uri).unwrap().mesh.positions.len(), 3, "{uri}");
    }
    let absolute = root.path().join("outside.bin").display().to_string();
    let mut outside = vec![
        "../outside.bin",
        "below/../../outside.bin",
        "%2e%2e/outside.bin",
        "..%2Foutside.bin",
        &absolute,
    ];
    outside.extend([
        "file:///etc/passwd",
        "http://127.0.0.1:9/x",
        "below",
        "",
        ".",
        "%00",
        "C:\\x",
        "%zz",
        "%",
    ]);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(root.path().join("outside.bin"), own.join("link.bin")).unwrap();
        std::os::unix::fs::symlink(root.path(), own.join("up")).unwrap();
        outside.extend(["link.bin", "up/outside.bin"]);
    }
    for uri in outside {
        let message = load(uri).map(|_| ()).unwrap_err();
        assert_one_line(&message);
        assert!(message.contains("buffer 0"), "{message}");
    }
    let unplaced =
        import_bytes("mesh.gltf", triangle_gltf("in side.bin").as_bytes(), None, &ImportOptions::default());
    assert!(unplaced.unwrap_err().to_string().contains("not in a folder"));
}

/// A big buffer counts as part of the file that names it, small as that may be.
#[test]
fn a_big_buffer_beside_a_small_file_is_read() {
    const VERTICES: u32 = 300_000;
    let folder = tempfile::tempdir().unwrap();
    let number = |i: u32| if i.is_multiple_of(3) { i as f32 } else { (i * i % 1009) as f32 };
    let data: Vec<u8> = (0..3 * VERTICES).flat_map(|i| number(i % 1000 + i / 1000).to_le_bytes()).collect();
    std::fs::write(folder.path().join("big.bin"), &data).unwrap();
    let text = triangle_gltf("big.bin").replace("36", &data.len().to_string());
    let path = folder.path().join("mesh.gltf");
    std::fs::write(&path, text.replace("\"count\":3", &format!("\"count\":{VERTICES}"))).unwrap();
    import_file(&path, &ImportOptions::default()).unwrap();
}

/// Files of a megabyte, each made to cost as much memory as it can.
#[test]
fn memory_stays_in_proportion() {
    const SIZE: usize = 1 << 20;
    let repeated = |head: &str, part: &str, tail: &str| {
        let body = part.repeat((SIZE - head.len() - tail.len()) / part.len());
        format!("{head}{}{tail}", body.strip_suffix(',').unwrap_or(&body))
    };
    let head = r#"{"asset":{"version":"2.0"},"#;
    let data = triangle_gltf("data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA");
    let one_triangle = data.trim_start_matches('{').trim_end_matches('}').to_owned() + ",";
    let without = |key: &str| {
        let mut document: Value = serde_json::from_str(&data).unwrap();
        document.as_object_mut().unwrap().remove(key);
        document.to_string().trim_end_matches('}').to_owned()
    };
    let files = [
        ("empty nodes", repeated(&format!("{head}\"nodes\":["), "{},", "]}")),
        ("children", repeated(&format!("{head}\"nodes\":[{{\"children\":["), "0,", "]}]}")),
        ("empty meshes", repeated(&format!("{head}\"meshes\":["), "{\"primitives\":[]},", "]}")),
        ("materials", repeated(&format!("{{{one_triangle}\"materials\":["), "{},", "]}")),
        ("extensions", repeated(&format!("{head}\"extensionsUsed\":["), "\"\",", "]}")),
        ("deep", repeated(&format!("{head}\"extras\":"), "[", "")),
        ("nodes with a mesh", repeated(&(without("nodes") + ",\"nodes\":["), "{\"mesh\":0},", "]}")),
        (
            "same primitive",
            repeated(
                &(without("meshes") + ",\"meshes\":[{\"primitives\":["),
                "{\"attributes\":{\"POSITION\":0}},",
                "]}]}",
            ),
        ),
    ];
    for (what, text) in files {
        sparing(what, "a.gltf", text.as_bytes());
    }
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let mut distinct = String::new();
    for i in 0.. {
        if distinct.len() > SIZE {
            break;
        }
        writeln!(distinct, "v {i} 0 0\nv 0 {i} 1\nv 1 2 {i}\nf -1 -2 -3").unwrap();
    }
    let texts = [
        ("vertices", repeated(triangle, "v 1 2 3\n", "f 1 2 3\n")),
        ("same face", repeated(triangle, "f 1 2 3\n", "")),
        ("corners", repeated(triangle, "f 1 2 3 1 2 3 1 2 3\n", "")),
        ("one long face", repeated(&format!("{triangle}f"), " 1 2 3", "\n")),
        ("objects", repeated(triangle, "f 1 2 3\no\n", "")),
        ("one corner", repeated(triangle, "f 1\n", "f 1 2 3\n")),
        ("empty lines", repeated(triangle, "\n", "f 1 2 3\n")),
        ("continuations", repeated(triangle, "f\\\n", "")),
        ("distinct triangles", distinct),
    ];
    for (what, text) in texts {
        sparing(what, "a.obj", text.as_bytes());
    }
    let binaries = [("same indices", vec![0, 1, 2]), ("all indices", (0..=255).collect())];
    for (what, indices) in binaries {
        sparing(what, "a.glb", &index_bomb(&indices, SIZE));
    }
}

/// Most of the 64 MiB is for tiny files; these are big enough to do with 8 of them.
fn sparing(what: &str, name: &str, bytes: &[u8]) {
    let (result, most) = measured(name, bytes, 1e-9);
    assert!(most <= 64 * bytes.len() + (8 << 20), "{what}: {most} bytes held for a file of {}", bytes.len());
    if let Err(error) = result {
        assert_one_line(&error.to_string());
    }
}

fn glb(document: &Value, binary: Vec<u8>) -> Vec<u8> {
    let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
    gltf::Glb { header, json: document.to_string().into_bytes().into(), bin: Some(binary.into()) }
        .to_vec()
        .unwrap()
}

/// 256 vertices and one byte an index.
fn index_bomb(indices: &[u8], size: usize) -> Vec<u8> {
    let mut binary: Vec<u8> = (0..768_u32).flat_map(|i| ((i * i % 997) as f32).to_le_bytes()).collect();
    let vertices = binary.len();
    // Triangles that differ: the second and third corner run at other speeds.
    binary.extend(
        (0..size - vertices).map(|i| indices[(i / 3 * [1, 3, 7][i % 3] + i % 3 + i / 768) % indices.len()]),
    );
    let count = (binary.len() - vertices) / 3 * 3;
    let document = serde_json::json!({
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 256, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5121, "count": count, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": vertices},
            {"buffer": 0, "byteOffset": vertices, "byteLength": binary.len() - vertices}],
        "buffers": [{"byteLength": binary.len()}],
    });
    glb(&document, binary)
}

/// A sheet of 5 x 4 as OBJ, glTF and GLB.
fn valid_files() -> [(&'static str, Vec<u8>); 3] {
    let mesh = grid(5, 4, 0.25, true);
    let mut obj = "# sheet\no sheet\n".to_owned();
    for p in &mesh.positions {
        writeln!(obj, "v {} {} {}", p.x, p.y, p.z).unwrap();
    }
    for f in mesh.faces() {
        writeln!(obj, "f {}/1/1 {}//2 {} {}/3", f[0] + 1, f[1] + 1, f[2] + 1, f[3] + 1).unwrap();
    }
    let mut binary: Vec<u8> =
        mesh.positions.iter().flat_map(|p| p.as_vec3().to_array()).flat_map(f32::to_le_bytes).collect();
    let vertices = binary.len();
    binary.extend(
        mesh.faces()
            .flat_map(|f| [f[0], f[1], f[2], f[0], f[2], f[3]])
            .flat_map(|i| (i as u16).to_le_bytes()),
    );
    let mut document = serde_json::json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "extensionsUsed": ["FB_ngon_encoding"],
        "nodes": [{"children": [1], "translation": [1, 2, 3], "rotation": [0, 0, 0, 1], "scale": [1, 2, 1]}, {"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 4}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": mesh.positions.len(), "type": "VEC3", "sparse": {"count": 1,
                "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 0, "byteOffset": 12}}},
            {"bufferView": 1, "componentType": 5123, "count": 6 * mesh.face_count(), "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": vertices, "byteStride": 12},
            {"buffer": 0, "byteOffset": vertices, "byteLength": binary.len() - vertices}],
        "buffers": [{"byteLength": binary.len()}],
    });
    let whole = glb(&document, binary.clone());
    document["buffers"][0]["uri"] =
        Value::from(format!("data:application/octet-stream;base64,{}", base64(&binary)));
    [("a.obj", obj.into_bytes()), ("a.gltf", document.to_string().into_bytes()), ("a.glb", whole)]
}

fn base64(bytes: &[u8]) -> String {
    const SYMBOLS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let bits = three.iter().chain([0; 3].iter()).take(3).fold(0_u32, |bits, b| bits << 8 | u32::from(*b));
        for i in 0..4 {
            let symbol = char::from(SYMBOLS[(bits >> (18 - 6 * i) & 63) as usize]);
            text.push(if i <= three.len() { symbol } else { '=' });
        }
    }
    text
}

#[test]
fn the_files_that_are_mutated_are_valid() {
    for (name, bytes) in valid_files() {
        let import = checked(name, &bytes, 0.0).unwrap();
        // In the two glTF files the sparse accessor moves a corner of the first quad onto the one diagonal to it: both its
        // triangles vanish, and with them the particle that belonged to no other face.
        assert!(import.mesh.positions.len() >= 18, "{name}: {}", import.mesh.positions.len());
    }
}

/// One change to a file: bytes replaced, removed, repeated, or a number in its text replaced by an extreme one.
fn mutate(bytes: &mut Vec<u8>, at: usize, kind: u8, value: u64) {
    const NUMBERS: [&str; 12] = [
        "-1",
        "0",
        "4294967295",
        "4294967296",
        "18446744073709551615",
        "-9223372036854775808",
        "1e999",
        "nan",
        "5126",
        "5121",
        "0.5",
        "[]",
    ];
    if bytes.is_empty() {
        return;
    }
    let at = at % bytes.len();
    let end = (at + 1 + value as usize % 16).min(bytes.len());
    match kind % 5 {
        0 => bytes[at] = value as u8,
        1 => drop(bytes.drain(at..end)),
        2 => {
            let copy = bytes[at..end].to_vec();
            bytes.splice(at..at, copy);
        }
        3 => bytes.truncate(at),
        _ => {
            let is_number = |b: &u8| b.is_ascii_digit();
            let Some(start) = bytes[at..].iter().position(is_number).map(|i| at + i) else { return };
            let end = bytes[start..].iter().position(|b| !is_number(b)).map_or(bytes.len(), |i| start + i);
            bytes.splice(start..end, NUMBERS[value as usize % NUMBERS.len()].bytes());
        }
    }
}

fn cases(count: u32) -> ProptestConfig {
    ProptestConfig {
        cases: count,
        failure_persistence: Some(Box::new(FileFailurePersistence::Off)),
        ..ProptestConfig::default()
    }
}

#[test]
fn a_long_text_in_the_wrong_place_is_told_in_short() {
    let long = "x".repeat(5000);
    let text = format!(r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":"{long}"}}]}}"#);
    let message = checked("a.gltf", text.as_bytes(), 0.0).unwrap_err().to_string();
    assert!(message.contains("invalid type") && message.contains("line 1 column"), "{message}");
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn bytes_at_random_are_refused_or_loaded(
        bytes in proptest::collection::vec(any::<u8>(), 0..600),
        head in prop::sample::select(vec!["", "glTF\u{2}\0\0\0", "{\"asset\":{\"version\":\"2.0\"}", "v 0 0 0\nf ", "\u{feff}"]),
    ) {
        let bytes = [head.as_bytes(), &bytes].concat();
        for name in ["a.obj", "a.gltf", "a.glb"] {
            let _ = checked(name, &bytes, 1e-6);
        }
    }
}

proptest! {
    #![proptest_config(cases(100))]

    #[test]
    fn text_like_obj_is_refused_or_loaded(
        text in "((v|f|l|p|vt|o|#|\\\\)( (-?[0-9]{1,2}|[0-9]\\.5|nan|1/2/3|/|1e308|\\\\))*(\n|\r\n|\\\\\n)){0,40}",
    ) {
        let _ = checked("a.obj", text.as_bytes(), 0.01);
    }
}

proptest! {
    #![proptest_config(cases(3000))]

    #[test]
    fn valid_files_that_were_changed_are_refused_or_loaded(
        file in 0_usize..3,
        changes in proptest::collection::vec((any::<usize>(), any::<u8>(), any::<u64>()), 1..6),
        weld in prop::sample::select(vec![0.0, 1e-300, 1e-17, 1e-6, 0.3, 1.0]),
    ) {
        let (name, mut bytes) = valid_files()[file].clone();
        for (at, kind, value) in changes {
            mutate(&mut bytes, at, kind, value);
        }
        let _ = checked(name, &bytes, weld);
    }
}
