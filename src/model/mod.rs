//! What stays constant while the cloth moves (topology, masses, springs), and the state that changes.

mod topology;

pub use topology::{SpringKind, Topology};
