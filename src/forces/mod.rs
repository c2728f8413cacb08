//! Forces, one a file: equation, parameters, kernel; and the problem that they make up together.

pub mod air_damping;
pub mod gravity;
mod problem;
pub mod pull;
mod sliced;
mod spectrum;
pub mod springs;
pub mod wind;

pub use problem::{Cost, Problem, SpringSet};
pub(crate) use sliced::Loads;
pub use sliced::{Ahead, BLOCK as PRODUCT_BLOCK, Linear, Update};
pub use spectrum::{Mode, Spectrum};
