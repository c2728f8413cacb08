//! A polygon mesh whose vertices are the particles: quads first of all, with triangles and larger polygons beside them.

use glam::DVec3;

/// Positions and polygons. Every corner is the index of a particle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuadMesh {
    /// Particle positions, m.
    pub positions: Vec<DVec3>,
    /// Start of each face in `corners`, with one more entry at the end: face f is `corners[starts[f]..starts[f + 1]]`.
    starts: Vec<u32>,
    corners: Vec<u32>,
}

impl QuadMesh {
    /// A mesh without faces.
    pub fn new(positions: Vec<DVec3>) -> Self {
        Self { positions, starts: vec![0], corners: Vec::new() }
    }

    /// Adds a face, its corners in order around it.
    pub fn push_face(&mut self, corners: &[u32]) {
        self.corners.extend_from_slice(corners);
        self.starts.push(self.corners.len() as u32);
    }

    /// Number of faces.
    pub fn face_count(&self) -> usize {
        self.starts.len() - 1
    }

    /// The faces, each as its corners in order.
    pub fn faces(&self) -> impl ExactSizeIterator<Item = &[u32]> + '_ {
        self.starts.windows(2).map(|w| &self.corners[w[0] as usize..w[1] as usize])
    }
}
