//! Every mesh of the shared collection gives its expected counts, and the meshes that ship give theirs.
//!
//! The collection stands beside the project. Where it is missing these tests say so, and fail on a build server (`CI` is set).
#![allow(clippy::unwrap_used)]

use std::collections::HashSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde_json::Value;
use tenter::model::Topology;
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
        let mut want = expected_counts(&entry["total"]);
        if was_reordered(entry) {
            // The list has 1534 of the 1536 quads here; the truth is what must come back.
            let truth = entries(&folder).into_iter().find(|e| e["file"] == entry["truth"]).unwrap();
            want = expected_counts(&truth["expected"]);
        } else if want[1] == 0 {
            want[6] = counts(&import)[6];
        }
        assert_eq!(counts(&import), want, "{}", file(entry));
        seen += 1;
    }
    assert!(seen >= 30, "only {seen} files");
}

/// Whether a tool wrote the triangles in another order than that of the quads.
fn was_reordered(entry: &Value) -> bool {
    ["gt_reorder", "draco_decoded", "gp_q"].iter().any(|tool| file(entry).contains(tool))
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
        assert!(share >= if was_reordered(entry) { 0.998 } else { 1.0 }, "{}: {share}", file(entry));
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

/// glTF has triangles only, and the report says by which way quads came back from them.
#[test]
fn the_report_says_how_quads_came_back() {
    let Some(folder) = shared_meshes() else { return };
    let by = |file: &str| import(&folder.join(file)).unwrap().report;
    let of_way = |file: &str| by(file).quad_recovery.method;
    assert_eq!(of_way("obj/skirt_72x24.obj"), RecoveryMethod::None);
    assert_eq!(of_way("gltf/skirt_72x24.glb"), RecoveryMethod::Order);
    assert_eq!(of_way("gltf/fb_ngon_skirt_72x24_assimp525.glb"), RecoveryMethod::NgonEncoding);
    assert_eq!(of_way("gltf/fb_ngon_void_cape_mixed_assimpjs.glb"), RecoveryMethod::Order);
    assert_eq!(of_way("gltf/flag_wind_48x32__gt_reorder.glb"), RecoveryMethod::Geometry);
    let json = serde_json::to_value(by("gltf/fb_ngon_skirt_72x24_assimp525.glb")).unwrap();
    assert_eq!(json["quad_recovery"]["method"], "ngon_encoding");
    assert_eq!(json["faces"]["quads"], 1728);
    for file in
        ["gltf/flag_wind_48x32__gt_reorder.glb", "hostile/g_true_triangles.gltf", "gltf/cape_mixed.glb"]
    {
        assert!(!by(file).warnings.is_empty(), "{file}");
    }
    assert_eq!(by("gltf/skirt_72x24.glb").warnings, Vec::<String>::new());
}

#[test]
fn nodes_place_their_meshes() {
    let Some(folder) = shared_meshes() else { return };
    let import = import(&folder.join("hostile/g_matrix_and_negative_scale.gltf")).unwrap();
    // From the collection's list; single precision in the file, so 1e-6 of its size.
    let [low, high] = import.mesh.bounding_box().unwrap();
    assert!(low.distance(DVec3::new(3.0, 6.0, 7.0)) < 1e-5, "{low}");
    assert!(high.distance(DVec3::new(5.0, 6.0, 9.0)) < 1e-5, "{high}");
}

#[test]
fn scale_and_weld_are_applied() {
    let Some(folder) = shared_meshes() else { return };
    let seam = folder.join("hostile/t_seam_off_by_1ulp.obj");
    let particles = |weld| {
        let options = ImportOptions { weld, ..ImportOptions::default() };
        let import = import_file(&seam, &options).unwrap();
        (import.mesh.positions.len(), import.report.components)
    };
    assert_eq!(particles(0.0), (30, 2));
    assert_eq!(particles(1e-6), (25, 1));
    let towel = folder.join("obj/towel_thick_40x20.obj");
    let coarse =
        import_file(&towel, &ImportOptions { scale: 0.5, weld: 0.01, ..ImportOptions::default() }).unwrap();
    assert!(
        coarse.report.warnings.iter().any(|w| w.contains("weld tolerance")),
        "{:?}",
        coarse.report.warnings
    );
    let plain = import(&towel).unwrap();
    let half =
        import_file(&towel, &ImportOptions { scale: 0.5, weld: 0.0, ..ImportOptions::default() }).unwrap();
    assert_eq!(half.mesh.positions, plain.mesh.positions.iter().map(|p| *p * 0.5).collect::<Vec<_>>());
    for bad in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        import_file(&towel, &ImportOptions { scale: bad, weld: 0.0, ..ImportOptions::default() })
            .unwrap_err();
    }
    for bad in [f64::NAN, -1e-9, 1.5] {
        import_file(&towel, &ImportOptions { scale: 1.0, weld: bad, ..ImportOptions::default() })
            .unwrap_err();
    }
}

/// A strip whose vertices are each 1 from the next, welded at 1.5: pairs become one, the whole strip does not.
#[test]
fn welding_keeps_first_ones_apart() {
    let mut text = String::new();
    for i in 0..100 {
        writeln!(text, "v {i} 0 0\nv {i} 10 0").unwrap();
    }
    for i in (1..198).step_by(2) {
        writeln!(text, "f {i} {} {} {}", i + 1, i + 3, i + 2).unwrap();
    }
    let options = ImportOptions { weld: 1.5 / 99_f64.hypot(10.0), ..ImportOptions::default() };
    let import = import_bytes("strip.obj", text.as_bytes(), None, &options).unwrap();
    assert_eq!((import.mesh.positions.len(), import.report.faces.quads), (100, 49));
    assert_eq!((import.report.mended.welded, import.report.mended.degenerate_faces), (100, 50));
}

const ASSETS: [(&str, [usize; 7]); 4] = [
    ("cylinder_20x5.obj", [120, 100, 0, 0, 220, 200, 200]),
    ("cylinder_20x5.gltf", [120, 100, 0, 0, 220, 200, 200]),
    ("skirt_72x24.obj", [1800, 1728, 0, 0, 3528, 3456, 3456]),
    ("cape_mixed.obj", [376, 334, 24, 1, 734, 668, 635]),
];

#[test]
fn shipped_meshes_give_their_counts() {
    for (name, want) in ASSETS {
        let import = import(&project().join("assets/meshes").join(name)).unwrap();
        assert_eq!(counts(&import), want, "{name}");
        let mended = import.report.mended;
        assert_eq!(
            (mended.degenerate_faces, mended.duplicate_faces, mended.non_manifold_edges),
            (0, 0, 0),
            "{name}"
        );
    }
}

/// The cylinder is the same cloth from both files: same particles up to single precision, same faces.
#[test]
fn shipped_cylinders_agree() {
    let [obj, gltf] = ["obj", "gltf"]
        .map(|end| import(&project().join(format!("assets/meshes/cylinder_20x5.{end}"))).unwrap().mesh);
    assert_eq!(quads_by_vertex(&gltf, &obj), quads_by_vertex(&obj, &obj));
    for [a, b] in &Topology::of(&obj).pairs[0] {
        let length = obj.positions[*a as usize].distance(obj.positions[*b as usize]);
        // Coordinates have nine decimals.
        assert!((length - 1.0).abs() < 1e-8, "{length}");
    }
}

/// Vertices, edges, diagonals and next-but-one neighbours of a sheet, counted by hand: one for each row and column.
#[test]
fn grids_have_the_contract_s_springs() {
    for (columns, rows) in [(1, 1), (1, 2), (1, 7), (6, 1), (2, 2), (2, 5), (5, 2), (3, 3), (25, 25), (7, 4)]
    {
        let mesh = grid(columns, rows, 0.1, false);
        let (c, r) = (columns as usize, rows as usize);
        let [stretch, shear, bend] = Topology::of(&mesh).pairs;
        assert_eq!(mesh.positions.len(), c * r);
        assert_eq!(stretch.len(), (c - 1) * r + (r - 1) * c, "{columns} x {rows}");
        assert_eq!(shear.len(), 2 * (c - 1) * (r - 1), "{columns} x {rows}");
        let mut next_but_one: Vec<[u32; 2]> = Vec::new();
        for i in 0..columns * rows {
            if i % columns + 2 < columns {
                next_but_one.push([i, i + 2]);
            }
            if i / columns + 2 < rows {
                next_but_one.push([i, i + 2 * columns]);
            }
        }
        next_but_one.sort_unstable();
        assert_eq!(bend, next_but_one, "{columns} x {rows}");
        assert_eq!(mesh.components(), 1);
    }
}

#[test]
fn grids_stand_where_the_contract_says() {
    let sheet = grid(3, 2, 0.5, false);
    let [first, last] = [sheet.positions[0], sheet.positions[5]];
    assert_eq!((first, last), (DVec3::new(-0.5, 0.0, -0.25), DVec3::new(0.5, 0.0, 0.25)));
    let hanging = grid(3, 2, 0.5, true);
    assert_eq!(hanging.positions[5], DVec3::new(0.5, -0.5, 0.0));
    let zeros = [sheet, hanging].map(|m| m.positions).concat();
    let is_negative_zero = |x: f64| x == 0.0 && x.is_sign_negative();
    assert!(!zeros.iter().flat_map(DVec3::to_array).any(is_negative_zero));
}

/// A mesh of triangles bends over every interior edge: two of them over one, a tetrahedron over all six, each pair once.
#[test]
fn triangles_bend_over_edges() {
    let of = |text: &str| {
        Topology::of(&import_bytes("t.obj", text.as_bytes(), None, &ImportOptions::default()).unwrap().mesh)
    };
    let two = of("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n");
    assert_eq!(two.pairs, [vec![[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]], vec![], vec![[1, 3]]]);
    let solid = of("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n");
    assert_eq!(solid.pairs.map(|pairs| pairs.len()), [6, 0, 6]);
}
