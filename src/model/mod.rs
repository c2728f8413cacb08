//! What stays constant while the cloth moves (topology, springs), and the state that changes (particles).

mod incidence;
mod numbering;
mod particles;
mod sorting;
mod springs;
mod topology;

pub use incidence::Incidence;
pub use numbering::Numbering;
pub use particles::{Memory, Particles, Seen};
pub use springs::{Group, KindSettings, Springs};
pub use topology::{SpringKind, Topology};
