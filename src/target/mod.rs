//! What is simulated: a generated grid or an imported mesh, as one polygon mesh with welded particles.

mod edges;
mod firsts;
mod gltf;
mod grid;
mod import;
mod mend;
mod mesh;
mod obj;
mod obj_surface;
mod recover_quads;
mod surface;
mod weld;

pub use grid::grid;
pub use import::{Import, ImportError, ImportOptions, ImportReport, import_bytes, import_file};
pub use mend::Mended;
pub use mesh::{FaceCounts, QuadMesh};
pub use recover_quads::{QuadRecovery, RecoveryMethod};
pub use surface::{Corner, Section, Surface, Vertex};
