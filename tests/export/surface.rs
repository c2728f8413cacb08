//! The source's own surface comes back: vertices, faces, texture coordinates, names.

use super::{exported, folder, patches, project};
use glam::DVec3;
use std::path::Path;
use tenter::target::{
    Corner, Import, ImportOptions, RecoveryMethod, Surface, Vertex, grid, import_bytes, import_file,
};

const KEEP: ImportOptions = ImportOptions { scale: 1.0, weld: 0.0, surface: true };

fn surface(obj: &str, options: &ImportOptions) -> (Surface, Import) {
    let import = import_bytes("a.obj", obj.as_bytes(), None, options).unwrap();
    (import.surface.clone().unwrap(), import)
}

/// The lines of an OBJ file that begin with one of these words.
fn lines(text: &str, keywords: &[&str]) -> Vec<String> {
    let wanted = |line: &&str| line.split(' ').next().is_some_and(|word| keywords.contains(&word));
    text.lines().filter(wanted).map(str::to_owned).collect()
}

fn vertices(text: &str) -> Vec<DVec3> {
    let numbers = |line: String| -> Vec<f64> { line[2..].split(' ').map(|x| x.parse().unwrap()).collect() };
    lines(text, &["v"]).into_iter().map(|line| DVec3::from_slice(&numbers(line))).collect()
}

fn frame(folder: &Path, number: u64) -> String {
    std::fs::read_to_string(folder.join(format!("a/a_{number:04}.obj"))).unwrap()
}

#[test]
fn a_mesh_comes_back_as_its_file_has_it() {
    let dir = folder();
    let source = std::fs::read_to_string(patches()).unwrap();
    exported(dir.path(), &[patches().to_str().unwrap(), "--seconds", "0.08", "--out", "a.obj"]);
    // All but normals, which are left to the reader, and the file of the materials.
    let keywords = ["vt", "o", "g", "usemtl", "s", "f"];
    let without_normals = |line: &String| {
        let word = |word: &str| {
            let parts: Vec<_> = word.split('/').take(2).collect();
            parts.join("/").trim_end_matches('/').to_owned()
        };
        if line.starts_with("f ") {
            line.split(' ').map(word).collect::<Vec<_>>().join(" ")
        } else {
            line.clone()
        }
    };
    let expected: Vec<_> = lines(&source, &keywords).iter().map(without_normals).collect();
    for number in 0..3 {
        assert_eq!(lines(&frame(dir.path(), number), &keywords), expected);
    }
    let [first, last] = [0, 2].map(|number| vertices(&frame(dir.path(), number)));
    assert_eq!(first, vertices(&source));
    // The loose vertex stays, all others fall; the two sides of the split edge stay together.
    assert_eq!(last[0], first[0]);
    assert!((1..13).all(|v| last[v] != first[v]));
    assert_eq!([last[2], last[3]], [last[6], last[7]]);
}

#[test]
fn indices_are_read_in_all_their_forms() {
    // Before their vertices, counted back, with and without texture coordinates, continued, and one that names none.
    let obj = "f 1/1 2/2 3/3\nv 0 0 0\nv 1 0 0\nvt 0 0\nvt 1 0\nvt 1 1\nv 1 1 0\nv 0 1 0\n\
               f -4/-3 -2/-1 \\\n-1/9\nf 1 3 4 7\nv 0 0 0\nv 0 0 1\nv 0 1 1\nv 2 2 2\nf 1 2\n";
    let (surface, import) = surface(obj, &KEEP);
    let faces: Vec<Vec<_>> =
        surface.faces().map(|(face, _)| face.iter().map(|c| (c.vertex, c.uv)).collect()).collect();
    let forward = [Some(0), Some(1), Some(2)];
    assert_eq!(faces[0], [0, 1, 2].map(|i| (i as u32, forward[i])));
    assert_eq!(faces[1], [(0, Some(0)), (2, Some(2)), (3, None)]);
    assert_eq!(faces[2], [0, 2, 3, 6].map(|vertex| (vertex, None)));
    assert_eq!(faces.len(), 3);
    assert_eq!(surface.sections.len(), 1);
    // Vertex 5 coincides with vertex 1, but no face uses it.
    assert_eq!(surface.vertices[4], Vertex::Stays(DVec3::ZERO));
    let mut placed = Vec::new();
    surface.place(&import.mesh.positions, &mut placed);
    let file = lines(obj, &["v"]).join("\n");
    assert_eq!(placed, vertices(&file));
}

#[test]
fn vertices_that_were_welded_follow_one_particle() {
    let obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1.001 0 0\nv 2 0 0\nv 2 1 0\nv 1.001 1 0\nv 5 5 5\n\
               f 1 2 3 4\nf 5 6 7 8\n";
    let options = ImportOptions { scale: 2.0, weld: 0.01, surface: true };
    let (surface, import) = surface(obj, &options);
    let follows = [0, 1, 2, 3, 1, 4, 5, 2].map(Vertex::Follows);
    assert_eq!(surface.vertices[..8], follows);
    assert_eq!(surface.vertices[8], Vertex::Stays(DVec3::splat(10.0)));
    assert_eq!((surface.particles(), import.mesh.positions.len()), (6, 6));
    assert!(
        import_bytes("a.obj", obj.as_bytes(), None, &ImportOptions::default()).unwrap().surface.is_none()
    );
}

#[test]
fn a_grid_carries_its_texture_once() {
    let surface = Surface::of_grid(&grid(3, 2, 1.0, true), 3, 2);
    assert_eq!(surface.uvs, [[0.0, 1.0], [0.5, 1.0], [1.0, 1.0], [0.0, 0.0], [0.5, 0.0], [1.0, 0.0]]);
    assert_eq!(surface.faces().len(), 2);
    assert!(surface.corners().iter().all(|c| c.uv == Some(c.vertex)));
    let chain = Surface::of_grid(&grid(4, 1, 1.0, true), 4, 1);
    assert_eq!(chain.faces().len(), 0);
    assert_eq!(chain.edges, [[0, 1], [1, 2], [2, 3]]);
}

#[test]
fn gltf_brings_quads_texture_coordinates_and_materials_back() {
    let dir = folder();
    let skirt = project().join("assets/meshes/skirt_72x24.obj");
    for (source, quads, triangles) in [(skirt, 1728, 0), (patches(), 4, 3)] {
        for name in ["a.glb", "a.gltf"] {
            exported(dir.path(), &[source.to_str().unwrap(), "--seconds", "0.08", "--out", name]);
            let back = import_file(&dir.path().join(name), &KEEP).unwrap();
            // Each of the two pentagons is a fan of three triangles: a quad and a triangle for a reader of quads.
            let recovery = back.report.quad_recovery;
            assert_eq!(recovery.method, RecoveryMethod::NgonEncoding);
            assert_eq!((recovery.quads, recovery.triangles_left), (quads, triangles), "{source:?}");
            let original = import_file(&source, &KEEP).unwrap().surface.unwrap();
            let surface = back.surface.unwrap();
            // By face, wherever it begins; the source has six decimals, and single precision holds them.
            let uvs = |s: &Surface| -> Vec<Vec<[i64; 2]>> {
                let uv = |uv: u32| s.uvs[uv as usize].map(|x| (x * 1e6).round() as i64);
                let face = |face: &[Corner]| face.iter().filter_map(|c| c.uv.map(uv)).collect();
                let mut faces: Vec<Vec<_>> = s.faces().map(|(corners, _)| face(corners)).collect();
                faces.iter_mut().for_each(|face| face.sort_unstable());
                faces.sort();
                faces
            };
            if quads == 1728 {
                assert_eq!(uvs(&surface), uvs(&original));
                assert!(uvs(&surface).iter().all(|face| face.len() == 4));
            } else {
                let materials: Vec<_> = surface.sections.iter().map(|s| s.material.as_deref()).collect();
                assert_eq!(materials, [Some("red cloth"), Some("blue")]);
            }
            assert_eq!(surface.particles(), back.mesh.positions.len());
        }
    }
}

#[test]
fn quads_of_a_gltf_file_are_written_as_quads() {
    let dir = folder();
    let cylinder = project().join("assets/meshes/cylinder_20x5.gltf");
    exported(dir.path(), &[cylinder.to_str().unwrap(), "--seconds", "0", "--out", "a.obj"]);
    let text = frame(dir.path(), 0);
    let faces = lines(&text, &["f"]);
    assert_eq!((vertices(&text).len(), faces.len()), (120, 100));
    assert!(faces.iter().all(|face| face.split(' ').count() == 5));
    assert_eq!(lines(&text, &["o"]), ["o cylinder"]);
}

#[test]
fn a_stock_reader_finds_objects_and_polygons() {
    let dir = folder();
    exported(dir.path(), &[patches().to_str().unwrap(), "--seconds", "0", "--out", "a.obj"]);
    let options = tobj::LoadOptions::default();
    let (models, _) = tobj::load_obj(dir.path().join("a/a_0000.obj"), &options).unwrap();
    // It calls a model by its latest name, and splits by material only where it finds the material's file.
    let read: Vec<_> = models.iter().map(|m| (m.name.as_str(), m.mesh.face_arities.as_slice())).collect();
    assert_eq!(read, [("left", &[4][..]), ("sleeve cuff", &[4, 3, 5, 5])]);
    assert_eq!(models.iter().map(|m| m.mesh.texcoords.len() / 2).collect::<Vec<_>>(), [4, 4]);
}

#[test]
fn skins_and_morph_targets_are_told_of() {
    let text = std::fs::read_to_string(project().join("assets/meshes/cylinder_20x5.gltf")).unwrap();
    let mut document: serde_json::Value = serde_json::from_str(&text).unwrap();
    let told = |document: &serde_json::Value| {
        let bytes = document.to_string();
        let import = import_bytes("a.gltf", bytes.as_bytes(), None, &ImportOptions::default()).unwrap();
        import.report.warnings.join("\n")
    };
    let before = told(&document);
    assert!(!before.contains("skin") && !before.contains("morph"), "{before}");
    document["nodes"][0]["skin"] = 0.into();
    assert!(told(&document).contains("1 nodes have a skin, which is not read"));
    document["meshes"][0]["primitives"][0]["targets"] =
        serde_json::json!([{ "POSITION": 0 }, { "POSITION": 0 }]);
    assert!(told(&document).contains("mesh 0 primitive 0 has 2 morph targets, which are not read"));
}
