//! The workbench: a window in which cloth is seen, taken hold of, and changed while it runs.

pub mod camera;
pub mod display;
pub mod engine;
pub mod geometry;
pub mod gpu;
pub mod hands;
pub mod picking;
pub mod picture;
pub mod render;
pub mod shell;
pub mod simulation;
mod swapchain;
pub mod viewport;
