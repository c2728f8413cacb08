//! The workbench: a window in which cloth is seen, taken hold of, and changed while it runs.

pub mod camera;
pub mod gpu;
pub mod picking;
pub mod picture;
pub mod render;
