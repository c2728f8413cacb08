//! A polygon mesh whose vertices are the particles: quads first of all, with triangles and larger polygons beside them.

use glam::DVec3;
use serde::Serialize;

/// Positions and polygons. Every corner is the index of a particle.
#[derive(Clone, Debug, PartialEq)]
pub struct QuadMesh {
    /// Particle positions, m.
    pub positions: Vec<DVec3>,
    /// Start of each face in `corners`, with one more entry at the end: face f is `corners[starts[f]..starts[f + 1]]`.
    starts: Vec<u32>,
    corners: Vec<u32>,
    /// Edges that belong to no face: a chain of particles has nothing else.
    edges: Vec<[u32; 2]>,
}

/// Faces by their number of corners.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FaceCounts {
    /// Faces with three corners.
    pub triangles: usize,
    /// Faces with four corners.
    pub quads: usize,
    /// Faces with five corners or more.
    pub ngons: usize,
}

impl Default for QuadMesh {
    fn default() -> Self {
        Self::new(Vec::new())
    }
}

impl QuadMesh {
    /// A mesh without faces.
    pub fn new(positions: Vec<DVec3>) -> Self {
        Self { positions, starts: vec![0], corners: Vec::new(), edges: Vec::new() }
    }

    /// Takes memory for so many more faces with so many corners in all.
    pub(super) fn reserve(&mut self, faces: usize, corners: usize) {
        self.starts.reserve_exact(faces);
        self.corners.reserve_exact(corners);
    }

    /// Gives back the memory that it does not need.
    pub(super) fn shrink(&mut self) {
        self.positions.shrink_to_fit();
        self.starts.shrink_to_fit();
        self.corners.shrink_to_fit();
    }

    /// Adds a face, its corners in order around it.
    pub fn push_face(&mut self, corners: &[u32]) {
        self.corners.extend_from_slice(corners);
        self.starts.push(self.corners.len() as u32);
    }

    /// Adds an edge that belongs to no face.
    pub fn push_edge(&mut self, ends: [u32; 2]) {
        self.edges.push(ends);
    }

    /// Removes faces, named in their order.
    pub(super) fn remove_faces(&mut self, faces: &[u32]) {
        let mut removed = faces.iter().peekable();
        let mut kept = Self::default();
        for (f, face) in self.faces().enumerate() {
            if removed.next_if_eq(&&(f as u32)).is_none() {
                kept.push_face(face);
            }
        }
        (self.starts, self.corners) = (kept.starts, kept.corners);
    }

    /// Appends another mesh; its particles come after those that are here.
    pub fn append(&mut self, other: &Self) {
        let first = self.positions.len() as u32;
        let corners = self.corners.len() as u32;
        self.positions.extend_from_slice(&other.positions);
        self.corners.extend(other.corners.iter().map(|c| c + first));
        self.starts.extend(other.starts.iter().skip(1).map(|s| s + corners));
        self.edges.extend(other.edges.iter().map(|e| e.map(|end| end + first)));
    }

    /// Number of faces.
    pub fn face_count(&self) -> usize {
        self.starts.len() - 1
    }

    /// The corners of face `f`, in order.
    pub fn face(&self, f: usize) -> &[u32] {
        &self.corners[self.starts[f] as usize..self.starts[f + 1] as usize]
    }

    /// The faces, each as its corners in order.
    pub fn faces(&self) -> impl ExactSizeIterator<Item = &[u32]> + '_ {
        self.starts.windows(2).map(|w| &self.corners[w[0] as usize..w[1] as usize])
    }

    /// The face that has a corner, by the number of the corner among those of all faces, and its number in that face.
    pub(super) fn face_at(&self, corner: u32) -> (usize, usize) {
        // Where all faces have as many corners, a division tells.
        let mut face = (u64::from(corner) * self.face_count() as u64 / self.corners.len() as u64) as usize;
        if !(self.starts[face]..self.starts[face + 1]).contains(&corner) {
            face = self.starts.partition_point(|start| *start <= corner) - 1;
        }
        (face, (corner - self.starts[face]) as usize)
    }

    /// The next corner around the same face, by its number among those of all faces.
    pub(super) fn after(&self, corner: u32) -> u32 {
        let (face, _) = self.face_at(corner);
        if corner + 1 < self.starts[face + 1] { corner + 1 } else { self.starts[face] }
    }

    /// All corners of all faces, one face after the other.
    pub fn corners(&self) -> &[u32] {
        &self.corners
    }

    /// The edges that belong to no face.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// Faces by size.
    pub fn face_counts(&self) -> FaceCounts {
        let mut counts = FaceCounts::default();
        for face in self.faces() {
            match face.len() {
                3 => counts.triangles += 1,
                4 => counts.quads += 1,
                _ => counts.ngons += 1,
            }
        }
        counts
    }

    /// Number of connected pieces; a particle that nothing holds is a piece of its own.
    pub fn components(&self) -> usize {
        let mut pieces = Pieces::new(self.positions.len());
        for face in self.faces() {
            for pair in face.windows(2) {
                pieces.join(pair[0], pair[1]);
            }
        }
        for [a, b] in &self.edges {
            pieces.join(*a, *b);
        }
        pieces.count()
    }

    /// Lowest and highest coordinates, m; `None` without particles.
    pub fn bounding_box(&self) -> Option<[DVec3; 2]> {
        let first = *self.positions.first()?;
        Some(self.positions.iter().fold([first; 2], |[low, high], p| [low.min(*p), high.max(*p)]))
    }
}

/// Disjoint sets of numbered things (union by lower number, path halving).
pub(super) struct Pieces {
    parent: Vec<u32>,
}

impl Pieces {
    pub(super) fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect() }
    }

    pub(super) fn root(&mut self, of: u32) -> u32 {
        let mut at = of as usize;
        while self.parent[at] as usize != at {
            self.parent[at] = self.parent[self.parent[at] as usize];
            at = self.parent[at] as usize;
        }
        at as u32
    }

    pub(super) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    pub(super) fn count(&self) -> usize {
        self.parent.iter().enumerate().filter(|(i, p)| *i == **p as usize).count()
    }
}
