//! What stays constant while the cloth moves (topology, springs), and the state that changes (particles).

mod particles;
mod springs;
mod topology;

pub use particles::{Memory, Particles};
pub use springs::{Group, KindSettings, Springs};
pub use topology::{SpringKind, Topology};
