//! The surface of a target as its source has it: the file's own vertices, faces, texture coordinates and names, and
//! for every vertex the particle that it follows. Exports need it; nothing that steps does.

use super::QuadMesh;
use glam::DVec3;
use std::sync::Arc;

/// What a vertex of the source does while the particles move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Vertex {
    /// It is where this particle is.
    Follows(u32),
    /// No face of the cloth uses it: it stays here, m.
    Stays(DVec3),
}

/// A corner of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Corner {
    /// Its vertex.
    pub vertex: u32,
    /// Its place in the list of texture coordinates, where it has one.
    pub uv: Option<u32>,
}

/// What a run of faces is called.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Section {
    /// The object (`o`), or the node of a glTF file.
    pub object: Option<Arc<str>>,
    /// The groups (`g`).
    pub group: Option<Arc<str>>,
    /// The material (`usemtl`).
    pub material: Option<Arc<str>>,
    /// The smoothing group (`s`).
    pub smoothing: Option<Arc<str>>,
}

/// Vertices, faces, texture coordinates and names, in the order of the source.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// The vertices.
    pub vertices: Vec<Vertex>,
    /// Texture coordinates: u to the right, v up, (0, 0) at the lower left.
    pub uvs: Vec<[f64; 2]>,
    /// Edges without a face, as vertices: a chain has nothing else.
    pub edges: Vec<[u32; 2]>,
    /// What faces are called; each names its section by its place here.
    pub sections: Vec<Section>,
    corners: Vec<Corner>,
    /// End of each face among the corners, and its section.
    ends: Vec<(u32, u32)>,
}

impl Surface {
    /// The surface of a [grid](super::grid), whose texture lies over it once: u = column / (columns - 1), and v falls
    /// from 1 in row 0 to 0 in the last.
    pub fn of_grid(mesh: &QuadMesh, columns: u32, rows: u32) -> Self {
        let along = |i: u32, count: u32| f64::from(i) / f64::from(count.max(2) - 1);
        let all = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let mut surface = Self {
            vertices: (0..mesh.positions.len() as u32).map(Vertex::Follows).collect(),
            uvs: all.map(|(row, column)| [along(column, columns), 1.0 - along(row, rows)]).collect(),
            edges: mesh.edges().to_vec(),
            sections: vec![Section::default()],
            ..Self::default()
        };
        for face in mesh.faces() {
            surface.push_face(face.iter().map(|i| Corner { vertex: *i, uv: Some(*i) }), 0);
        }
        surface
    }

    /// Adds a face of a section, its corners in order around it.
    pub fn push_face(&mut self, corners: impl IntoIterator<Item = Corner>, section: u32) {
        self.corners.extend(corners);
        self.ends.push((self.corners.len() as u32, section));
    }

    /// The faces in order: the corners of each and its section.
    pub fn faces(&self) -> impl ExactSizeIterator<Item = (&[Corner], u32)> + '_ {
        let mut start = 0;
        self.ends.iter().map(move |(end, section)| {
            let corners = &self.corners[start..*end as usize];
            start = *end as usize;
            (corners, *section)
        })
    }

    pub(super) fn change_corners(&mut self, change: impl FnMut(&mut Corner)) {
        self.corners.iter_mut().for_each(change);
    }

    /// All corners of all faces, one face after the other.
    pub fn corners(&self) -> &[Corner] {
        &self.corners
    }

    /// Writes where the vertices are over `into`, from where the particles are, m.
    ///
    /// # Panics
    /// There are fewer particles than vertices follow.
    pub fn place(&self, particles: &[DVec3], into: &mut Vec<DVec3>) {
        into.clear();
        into.extend(self.vertices.iter().map(|vertex| match vertex {
            Vertex::Follows(particle) => particles[*particle as usize],
            Vertex::Stays(at) => *at,
        }));
    }

    /// How many particles there must be at least.
    pub fn particles(&self) -> usize {
        let followed = self.vertices.iter().filter_map(|vertex| match vertex {
            Vertex::Follows(particle) => Some(*particle as usize + 1),
            Vertex::Stays(_) => None,
        });
        followed.max().unwrap_or(0)
    }

    /// Appends another surface, whose particles come after the first `particles`.
    pub(super) fn append(&mut self, other: &Self, particles: u32, place: impl Fn(DVec3) -> DVec3) {
        let [vertices, uvs, corners, sections] =
            [self.vertices.len(), self.uvs.len(), self.corners.len(), self.sections.len()].map(|n| n as u32);
        self.vertices.extend(other.vertices.iter().map(|vertex| match vertex {
            Vertex::Follows(particle) => Vertex::Follows(particle + particles),
            Vertex::Stays(at) => Vertex::Stays(place(*at)),
        }));
        self.uvs.extend_from_slice(&other.uvs);
        self.edges.extend(other.edges.iter().map(|edge| edge.map(|end| end + vertices)));
        self.sections.extend_from_slice(&other.sections);
        let moved = |c: &Corner| Corner { vertex: c.vertex + vertices, uv: c.uv.map(|uv| uv + uvs) };
        self.corners.extend(other.corners.iter().map(moved));
        self.ends.extend(other.ends.iter().map(|(end, section)| (end + corners, section + sections)));
    }

    /// Multiplies the places of vertices that stay. One that is then not finite, which no face uses, goes to the origin.
    pub(super) fn scale(&mut self, scale: f64) {
        for vertex in &mut self.vertices {
            if let Vertex::Stays(at) = vertex {
                *at *= scale;
                *at = if at.is_finite() { *at + DVec3::ZERO } else { DVec3::ZERO };
            }
        }
    }
}
