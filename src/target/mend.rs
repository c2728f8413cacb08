//! Mends what files get wrong: welds vertices, and drops faces without area, faces that are there twice and vertices of no face.

use glam::DVec3;
use serde::Serialize;

use super::QuadMesh;
use super::edges::Edges;
use super::weld::weld;

/// What was mended in a mesh file, or found and left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Mended {
    /// Vertices that became one with an earlier vertex.
    pub welded: usize,
    /// Faces that lost a repeated corner, or were dropped because fewer than three corners were left or a corner came back.
    pub degenerate_faces: usize,
    /// Faces dropped because the same polygon is there already, wound either way.
    pub duplicate_faces: usize,
    /// Vertices dropped because no face uses them.
    pub loose_vertices: usize,
    /// Edges of three faces or more; they are left.
    pub non_manifold_edges: usize,
}

/// A smaller fraction of the bounding box's diagonal is no tolerance: cells of its size could not be counted in 64 bits, and it is
/// far below the resolution of coordinates.
const FINEST_WELD: f64 = 1e-18;

/// A mesh after mending, with the raw face that each of its faces comes from.
pub(super) struct Whole {
    pub mesh: QuadMesh,
    pub edges: Edges,
    pub source_faces: Vec<u32>,
    /// The particle of every raw vertex; `u32::MAX` where no face uses it.
    pub particles: Vec<u32>,
    pub mended: Mended,
    /// A tolerance that is too coarse for this mesh: its ratio to the shortest edge.
    pub coarse_weld: Option<f64>,
}

/// Welds and cleans raw faces; `weld_fraction` is the tolerance as a fraction of the bounding box's diagonal. The particles of the
/// result are numbered in the order in which its faces first use them.
pub(super) fn mend(raw: &QuadMesh, weld_fraction: f64) -> Result<Whole, String> {
    let diagonal = diagonal(&raw.positions)?;
    let tolerance = if weld_fraction < FINEST_WELD { 0.0 } else { weld_fraction * diagonal };
    let first = weld(&raw.positions, tolerance);
    let mut mended = Mended::default();
    let mut particle = vec![u32::MAX; raw.positions.len()];
    let mut mesh = QuadMesh::new(Vec::with_capacity(raw.positions.len()));
    mesh.reserve(raw.face_count(), raw.corners().len());
    let mut source_faces = Vec::with_capacity(raw.face_count());
    let mut face = Vec::new();
    for (f, corners) in raw.faces().enumerate() {
        face.clear();
        face.extend(corners.iter().map(|c| first[*c as usize]));
        face.dedup();
        while face.len() > 1 && face.first() == face.last() {
            face.pop();
        }
        let kept = face.len() >= 3 && all_distinct(&face);
        mended.degenerate_faces += usize::from(!kept || face.len() < corners.len());
        if !kept {
            continue;
        }
        for corner in &mut face {
            let number = &mut particle[*corner as usize];
            if *number == u32::MAX {
                *number = mesh.positions.len() as u32;
                mesh.positions.push(raw.positions[*corner as usize] + DVec3::ZERO);
            }
            *corner = *number;
        }
        source_faces.push(f as u32);
        mesh.push_face(&face);
    }
    let mut edges = Edges::of(&mesh);
    if !edges.repeated.is_empty() {
        mended.duplicate_faces = edges.repeated.len();
        mesh.remove_faces(&edges.repeated);
        let mut removed = edges.repeated.iter().peekable();
        let mut number = 0..;
        source_faces.retain(|_| removed.next_if(|removed| number.next() == Some(**removed)).is_none());
        edges = Edges::of(&mesh);
    }
    mended.non_manifold_edges = edges.crowded;
    mended.loose_vertices = first.iter().filter(|f| particle[**f as usize] == u32::MAX).count();
    mended.welded = raw.positions.len() - mended.loose_vertices - mesh.positions.len();
    let coarse_weld = if tolerance > 0.0 { coarse(raw, tolerance) } else { None };
    let particles = first.into_iter().map(|f| particle[f as usize]).collect();
    Ok(Whole { mesh, edges, source_faces, particles, mended, coarse_weld })
}

/// Length of the bounding box's diagonal; an extent that overflows is refused.
pub(super) fn diagonal(positions: &[DVec3]) -> Result<f64, String> {
    let low = positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let length = if positions.is_empty() { 0.0 } else { low.distance(high) };
    if length.is_finite() {
        Ok(length)
    } else {
        Err(format!("the extent from {low} to {high} overflows; coordinates up to 1e150 would be accepted"))
    }
}

/// A tolerance of a tenth of the shortest edge or more may join what should stay apart (a thick towel's two sides, a hem).
fn coarse(raw: &QuadMesh, tolerance: f64) -> Option<f64> {
    let length = |a: u32, b: u32| raw.positions[a as usize].distance(raw.positions[b as usize]);
    let lengths = raw.faces().flat_map(|f| f.windows(2).map(|side| length(side[0], side[1])));
    let shortest = lengths.filter(|l| *l > 0.0).fold(f64::INFINITY, f64::min);
    (tolerance >= 0.1 * shortest).then(|| tolerance / shortest)
}

fn all_distinct(face: &[u32]) -> bool {
    match face {
        [a, b, c] => a != b && b != c && c != a,
        [a, b, c, d] => a != b && a != c && a != d && b != c && b != d && c != d,
        _ => {
            let mut sorted = face.to_vec();
            sorted.sort_unstable();
            sorted.windows(2).all(|w| w[0] != w[1])
        }
    }
}

/// Quads whose border crosses itself.
pub(super) fn crossed_quads(mesh: &QuadMesh) -> usize {
    mesh.faces().filter(|face| is_crossed(&mesh.positions, face)).count()
}

/// A quad crosses itself if it is folded over along both of its diagonals (along one of them it is only concave).
fn is_crossed(positions: &[DVec3], face: &[u32]) -> bool {
    let [a, b, c, d] = *face else { return false };
    let [a, b, c, d] = [a, b, c, d].map(|corner| positions[corner as usize]);
    // Scaled to about 1, or the products of tiny lengths would vanish.
    let scale = 1.0 / (c - a).abs().max((d - b).abs()).max_element().max(f64::MIN_POSITIVE);
    let folded = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| {
        let [ab, ac, ad] = [b - a, c - a, d - a].map(|side| side * scale);
        ab.cross(ac).dot(ac.cross(ad)) < 0.0
    };
    folded(a, b, c, d) && folded(b, c, d, a)
}
