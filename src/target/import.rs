//! Imports a mesh file: reads it, mends it, and says what was found.

use std::borrow::Cow;
use std::path::Path;

use serde::Serialize;

use super::mend::{Mended, Whole, crossed_quads, diagonal, mend};
use super::recover_quads::{QuadRecovery, Recovered, RecoveryMethod, recover};
use super::surface::Surface;
use super::{FaceCounts, QuadMesh, gltf, obj, obj_surface};
use crate::params;

/// How a mesh file is taken in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImportOptions {
    /// Metres per unit of the file, > 0.
    pub scale: f64,
    /// Vertices nearer than this fraction of the bounding box's diagonal become one, 0 to 1; those at the same place always do.
    /// More than 1e-6 may join what should stay apart.
    pub weld: f64,
    /// Whether the file's own surface is kept, for exports.
    pub surface: bool,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self { scale: 1.0, weld: 0.0, surface: false }
    }
}

/// A mesh that was imported, with at least one face.
#[derive(Clone, Debug)]
pub struct Import {
    /// The mesh in metres; particles in the order in which the faces first use them.
    pub mesh: QuadMesh,
    /// What was found and mended.
    pub report: ImportReport,
    /// The file's own surface, where it was asked for.
    pub surface: Option<Surface>,
}

/// What was found in a mesh file, and what was done to it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ImportReport {
    /// Faces by size, after mending.
    pub faces: FaceCounts,
    /// Connected pieces.
    pub components: usize,
    /// What became of the triangles of a glTF file.
    pub quad_recovery: QuadRecovery,
    /// What was mended.
    pub mended: Mended,
    /// Sentences for the user: what was left out or guessed, or looks wrong.
    pub warnings: Vec<String>,
}

/// Why a mesh file was refused. The message is one line: the file, the line or element where there is one, the offending value, and
/// what would be accepted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}: {reason}")]
pub struct ImportError {
    file: String,
    reason: String,
}

impl ImportError {
    fn new(file: &str, reason: &str) -> Self {
        // A file's name and what a file says may hold line ends, terminal codes and a megabyte in one word.
        Self { file: params::one_line(file), reason: params::brief(reason) }
    }
}

/// Imports a Wavefront OBJ (`.obj`) or glTF 2.0 (`.gltf`, `.glb`) file. Buffers of a glTF file are read from its own folder only.
///
/// # Errors
/// Where the file cannot be read, is malformed, needs a glTF extension that is not supported, or holds no faces.
pub fn import_file(path: &Path, options: &ImportOptions) -> Result<Import, ImportError> {
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|e| ImportError::new(&name, &format!("cannot be read: {e}")))?;
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    import_bytes(&name, &bytes, Some(folder), options)
}

/// Imports a mesh from memory; the extension of `name` tells the format. Without a folder no other file is opened.
///
/// # Errors
/// As [`import_file`].
pub fn import_bytes(
    name: &str,
    bytes: &[u8],
    folder: Option<&Path>,
    options: &ImportOptions,
) -> Result<Import, ImportError> {
    import(name, bytes, folder, options).map_err(|reason| ImportError::new(name, &reason))
}

fn import(
    name: &str,
    bytes: &[u8],
    folder: Option<&Path>,
    options: &ImportOptions,
) -> Result<Import, String> {
    if !(options.scale.is_finite() && options.scale > 0.0) {
        return Err(format!("scale {} is refused; a finite number above 0 would be accepted", options.scale));
    }
    if !(0.0..=1.0).contains(&options.weld) {
        return Err(format!("weld {} is refused; 0 to 1 would be accepted", options.weld));
    }
    // Corners are counted in 32 bits, and no format spends less than a byte on one.
    if u32::try_from(bytes.len()).is_err() {
        return Err(format!("{} bytes are too many; up to 4 GiB would be accepted", bytes.len()));
    }
    let extension = Path::new(name).extension().and_then(|e| e.to_str()).unwrap_or_default();
    let (mut import, pinched_particles) = match extension.to_ascii_lowercase().as_str() {
        "obj" => from_obj(bytes, options)?,
        "gltf" | "glb" => from_gltf(bytes, folder, options)?,
        _ => {
            return Err(format!(
                "the extension `{extension}` is not known; `.obj`, `.gltf` and `.glb` would be accepted"
            ));
        }
    };
    if import.mesh.face_count() == 0 {
        let dropped = import.report.mended.degenerate_faces;
        let but = if dropped > 0 { format!(" ({dropped} without area were dropped)") } else { String::new() };
        return Err(format!(
            "the mesh holds no faces{but}; triangles, quads or larger polygons would be accepted"
        ));
    }
    for position in &mut import.mesh.positions {
        *position *= options.scale;
    }
    if let Some(surface) = &mut import.surface {
        surface.scale(options.scale);
    }
    finish(&mut import, pinched_particles)?;
    import.mesh.shrink();
    Ok(import)
}

/// Also counts the particles where pieces only touch.
fn from_obj(bytes: &[u8], options: &ImportOptions) -> Result<(Import, usize), String> {
    let polygons = obj::read(bytes)?;
    let Whole { mesh, edges, particles, mut mended, coarse_weld, .. } = mend(&polygons.mesh, options.weld)?;
    mended.degenerate_faces += polygons.short_faces;
    mended.loose_vertices += polygons.unused_vertices;
    let mut report = ImportReport { mended, warnings: polygons.warnings, ..ImportReport::default() };
    warn_of_coarse_weld(&mut report.warnings, coarse_weld);
    let surface = options.surface.then(|| obj_surface::read(bytes, &polygons.mesh, &particles));
    let (pinched_particles, components) = rayon::join(|| edges.pinched(&mesh), || mesh.components());
    report.components = components;
    Ok((Import { mesh, report, surface }, pinched_particles))
}

/// A mesh of a glTF file in its own space, once it is whole.
struct Part {
    mesh: QuadMesh,
    recovery: QuadRecovery,
    mended: Mended,
    pinched_particles: usize,
    components: usize,
    surface: Option<Surface>,
}

/// Each mesh is welded and turned into quads in its own space, once, and then placed by every node that shows it.
/// Also counts the particles where pieces only touch.
fn from_gltf(
    bytes: &[u8],
    folder: Option<&Path>,
    options: &ImportOptions,
) -> Result<(Import, usize), String> {
    let scene = gltf::Scene::read(bytes, folder)?;
    let none = options.surface.then(Surface::default);
    let mut import = Import { mesh: QuadMesh::default(), report: ImportReport::default(), surface: none };
    let mut parts: Vec<Option<Part>> = (0..scene.mesh_count()).map(|_| None).collect();
    let mut pinched = 0;
    let instances = scene.instances()?;
    let skinned = instances.iter().filter(|i| i.is_skinned).count();
    if skinned > 0 {
        import.report.warnings.push(format!(
            "{skinned} nodes have a skin, which is not read: the cloth starts in the shape that the skin would bend"
        ));
    }
    for instance in instances {
        let cached = &mut parts[instance.mesh];
        if cached.is_none() {
            let (triangles, shown) = scene.triangles(instance.mesh, &mut import.report.warnings)?;
            let Whole { mesh, edges, source_faces, particles, mended, coarse_weld } =
                mend(&triangles, options.weld)?;
            warn_of_coarse_weld(&mut import.report.warnings, coarse_weld);
            let (raw, _) = triangles.corners().as_chunks();
            let raw: Cow<[[u32; 3]]> = if source_faces.len() == raw.len() {
                raw.into()
            } else {
                source_faces.iter().map(|f| raw[*f as usize]).collect()
            };
            let ngon_encoding = scene.ngon_encoding();
            let quads = || recover(&mesh, &edges, &raw, ngon_encoding);
            let (
                Recovered { mut faces, triangles: sources, recovery, is_suspicious },
                (pinched_particles, components),
            ) = rayon::join(quads, || (edges.pinched(&mesh), mesh.components()));
            faces.positions = mesh.positions;
            let mesh = faces;
            if is_suspicious {
                import.report.warnings.push(format!(
                    "the {} quads of mesh {} are far from rectangles: they may be pairs of true triangles",
                    recovery.quads, instance.mesh
                ));
            }
            let surface = options.surface.then(|| {
                let faces = gltf::Faces {
                    positions: &triangles.positions,
                    particles: &particles,
                    triangles: &raw,
                    mesh: &mesh,
                    sources: &sources,
                };
                scene.surface(instance.mesh, &shown, &faces)
            });
            *cached = Some(Part { mesh, recovery, mended, pinched_particles, components, surface });
        }
        let Some(Part { mesh, recovery, mended, pinched_particles, components, surface }) = cached else {
            continue;
        };
        scene.spend(mesh.positions.len() + mesh.corners().len())?;
        let first = import.mesh.positions.len();
        import.mesh.append(mesh);
        for position in &mut import.mesh.positions[first..] {
            *position = instance.transform.transform_point3(*position);
        }
        if let (Some(whole), Some(part)) = (&mut import.surface, surface) {
            scene.spend(part.vertices.len())?;
            whole.append(part, first as u32, |p| instance.transform.transform_point3(p));
        }
        let (total, report) = (&mut import.report.mended, &mut import.report.quad_recovery);
        report.method = report.method.max(recovery.method);
        report.quads += recovery.quads;
        report.triangles_left += recovery.triangles_left;
        total.welded += mended.welded;
        total.degenerate_faces += mended.degenerate_faces;
        total.duplicate_faces += mended.duplicate_faces;
        total.loose_vertices += mended.loose_vertices;
        total.non_manifold_edges += mended.non_manifold_edges;
        pinched += *pinched_particles;
        import.report.components += *components;
    }
    tell_recovery(&mut import.report);
    Ok((import, pinched))
}

fn tell_recovery(report: &mut ImportReport) {
    let QuadRecovery { method, quads, triangles_left } = report.quad_recovery;
    report.warnings.extend(match method {
        RecoveryMethod::None if triangles_left > 0 => Some(format!(
            "glTF holds triangles only and no quads were found among these {triangles_left}; they get no shear springs"
        )),
        RecoveryMethod::Geometry => Some(format!(
            "{quads} quads were guessed from the shape of the triangles ({triangles_left} stayed); check them, or use an OBJ file with quads"
        )),
        _ if triangles_left > 0 => {
            Some(format!("{triangles_left} triangles stayed beside the {quads} quads that came back"))
        }
        _ => None,
    });
}

fn warn_of_coarse_weld(warnings: &mut Vec<String>, ratio: Option<f64>) {
    if let Some(ratio) = ratio {
        warnings.push(format!(
            "the weld tolerance is {ratio:.2} of the shortest edge, which may join what should stay apart; below 0.1 is safe"
        ));
    }
}

/// Counts what the mesh holds now that it stands in its place, and tells what looks wrong.
fn finish(import: &mut Import, pinched_particles: usize) -> Result<(), String> {
    let Import { mesh, report, .. } = import;
    if let Some(bad) = mesh.positions.iter().position(|p| !p.is_finite()) {
        return Err(format!(
            "particle {bad} is not finite after scale and transforms; a smaller scale would be accepted"
        ));
    }
    for position in &mut mesh.positions {
        // -0.0 becomes +0.0.
        *position += glam::DVec3::ZERO;
    }
    let diagonal = diagonal(&mesh.positions)?;
    report.faces = mesh.face_counts();
    let mended = report.mended;
    let mut count = |count: usize, what: &str| {
        if count > 0 {
            report.warnings.push(format!("{count} {what}"));
        }
    };
    count(mended.degenerate_faces, "faces without area or with a repeated corner were cleaned or dropped");
    count(mended.duplicate_faces, "faces that are there twice were dropped");
    count(mended.loose_vertices, "vertices that no face uses were dropped");
    count(mended.non_manifold_edges, "edges have three faces or more; no bend springs cross them");
    count(pinched_particles, "particles join pieces that touch nowhere else");
    count(crossed_quads(mesh), "quads cross themselves: their corners are out of order");
    if !(1e-6..=1e6).contains(&diagonal) {
        report.warnings.push(format!("the mesh is {diagonal:.1e} m across: check the scale"));
    }
    Ok(())
}
