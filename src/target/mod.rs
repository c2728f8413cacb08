//! What is simulated: a generated grid or an imported mesh, as one polygon mesh with welded particles.

mod mesh;

pub use mesh::QuadMesh;
