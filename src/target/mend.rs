//! Mends what files get wrong: welds vertices, and drops faces without area, faces that are there twice and vertices of no face.

use std::collections::hash_map::RandomState;
use std::hash::BuildHasher;

use glam::DVec3;
use serde::Serialize;

use super::QuadMesh;
use super::mesh::Pieces;
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
    pub source_faces: Vec<u32>,
    /// The particle of every raw vertex; `u32::MAX` where no face uses it.
    pub particles: Vec<u32>,
    pub mended: Mended,
    /// A tolerance that is too coarse for this mesh: its ratio to the shortest edge.
    pub coarse_weld: Option<f64>,
}

/// Welds and cleans raw faces; `weld_fraction` is the tolerance as a fraction of the bounding box's diagonal. The particles of the
/// result are numbered in the order in which its faces first use them. `non_manifold_edges` is not counted here.
pub(super) fn mend(raw: &QuadMesh, weld_fraction: f64) -> Result<Whole, String> {
    let diagonal = diagonal(&raw.positions)?;
    let tolerance = if weld_fraction < FINEST_WELD { 0.0 } else { weld_fraction * diagonal };
    let first = weld(&raw.positions, tolerance);
    let mut mended = Mended::default();
    let mut welded = QuadMesh::new(Vec::new());
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
        if kept {
            source_faces.push(f as u32);
            welded.push_face(&face);
        }
    }
    let duplicate = duplicates(&welded);

    let mut particle = vec![u32::MAX; raw.positions.len()];
    let mut mesh = QuadMesh::new(Vec::new());
    let mut kept = Vec::with_capacity(source_faces.len());
    for (f, corners) in welded.faces().enumerate() {
        if duplicate[f] {
            mended.duplicate_faces += 1;
            continue;
        }
        kept.push(source_faces[f]);
        face.clear();
        for corner in corners {
            let number = &mut particle[*corner as usize];
            if *number == u32::MAX {
                *number = mesh.positions.len() as u32;
                mesh.positions.push(raw.positions[*corner as usize] + DVec3::ZERO);
            }
            face.push(*number);
        }
        mesh.push_face(&face);
    }
    mended.loose_vertices = first.iter().filter(|f| particle[**f as usize] == u32::MAX).count();
    mended.welded = raw.positions.len() - mended.loose_vertices - mesh.positions.len();
    let coarse_weld = if tolerance > 0.0 { coarse(raw, tolerance) } else { None };
    let particles = first.into_iter().map(|f| particle[f as usize]).collect();
    Ok(Whole { mesh, source_faces: kept, particles, mended, coarse_weld })
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

/// Which faces are the same polygon as an earlier one. Faces are compared where their hashes agree; the hash is keyed at random,
/// so that no file can make many agree, and the result does not depend on it.
fn duplicates(mesh: &QuadMesh) -> Vec<bool> {
    let hasher = RandomState::new();
    let mut polygon = Vec::new();
    let mut by_hash: Vec<(u64, u32)> = Vec::with_capacity(mesh.face_count());
    for (f, face) in mesh.faces().enumerate() {
        canonical(face, &mut polygon);
        by_hash.push((hasher.hash_one(&polygon), f as u32));
    }
    by_hash.sort_unstable();
    let mut duplicate = vec![false; mesh.face_count()];
    let mut first = Vec::new();
    for same in by_hash.chunk_by(|a, b| a.0 == b.0) {
        canonical(mesh.face(same[0].1 as usize), &mut first);
        for (_, f) in &same[1..] {
            canonical(mesh.face(*f as usize), &mut polygon);
            duplicate[*f as usize] = polygon == first;
        }
    }
    duplicate
}

/// A polygon of distinct corners, turned and wound so that its lowest corner comes first and the lower of that one's neighbours next.
fn canonical(face: &[u32], polygon: &mut Vec<u32>) {
    polygon.clear();
    polygon.extend_from_slice(face);
    let lowest = (0..face.len()).min_by_key(|i| face[*i]).unwrap_or(0);
    polygon.rotate_left(lowest);
    if polygon.len() > 2 && polygon[1] > polygon[polygon.len() - 1] {
        polygon[1..].reverse();
    }
}

/// What is left unmended but worth telling.
pub(super) struct Oddities {
    /// Edges of three faces or more.
    pub non_manifold_edges: usize,
    /// Particles where pieces touch that share no edge there.
    pub pinched_particles: usize,
    /// Quads whose border crosses itself.
    pub crossed_quads: usize,
}

impl Oddities {
    pub(super) fn of(mesh: &QuadMesh) -> Self {
        // Every side of every face: the edge, and where the corners at its low and its high end stand in the list of corners.
        let mut sides: Vec<(u64, [u32; 2])> = Vec::with_capacity(mesh.corners().len());
        let mut start = 0;
        for face in mesh.faces() {
            for (i, a) in face.iter().enumerate() {
                let next = (i + 1) % face.len();
                let b = face[next];
                let [i, next] = [i, next].map(|i| start + i as u32);
                let corners = if *a < b { [i, next] } else { [next, i] };
                sides.push((u64::from(*a.min(&b)) << 32 | u64::from(*a.max(&b)), corners));
            }
            start += face.len() as u32;
        }
        sides.sort_unstable();
        // Corners at one particle belong together where their faces share an edge there; more than one group is a pinch.
        let mut fans = Pieces::new(mesh.corners().len());
        let mut non_manifold_edges = 0;
        for edge in sides.chunk_by(|a, b| a.0 == b.0) {
            non_manifold_edges += usize::from(edge.len() > 2);
            for pair in edge.windows(2) {
                fans.join(pair[0].1[0], pair[1].1[0]);
                fans.join(pair[0].1[1], pair[1].1[1]);
            }
        }
        let mut groups = vec![0_u32; mesh.positions.len()];
        for (i, corner) in mesh.corners().iter().enumerate() {
            groups[*corner as usize] += u32::from(fans.root(i as u32) == i as u32);
        }
        Self {
            non_manifold_edges,
            pinched_particles: groups.iter().filter(|g| **g > 1).count(),
            crossed_quads: mesh.faces().filter(|f| is_crossed(&mesh.positions, f)).count(),
        }
    }
}

/// A quad crosses itself if it is folded over along both of its diagonals (along one of them it is only concave).
fn is_crossed(positions: &[DVec3], face: &[u32]) -> bool {
    let [a, b, c, d] = *face else { return false };
    let [a, b, c, d] = [a, b, c, d].map(|corner| positions[corner as usize]);
    // Scaled to about 1, or the products of tiny lengths would vanish.
    let scale = (c - a).abs().max_element().max((d - b).abs().max_element());
    let folded = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| {
        let [ab, ac, ad] = [b - a, c - a, d - a].map(|side| side / scale);
        ab.cross(ac).dot(ac.cross(ad)) < 0.0
    };
    folded(a, b, c, d) && folded(b, c, d, a)
}
