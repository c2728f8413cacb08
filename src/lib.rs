//! Tenter: cloth simulation with its error, cost and stability measured.
#![cfg_attr(not(test), warn(clippy::unwrap_used))]

#[cfg(feature = "app")]
pub mod app;
pub mod cli;
pub mod export;
pub mod forces;
pub mod lab;
pub mod math;
pub mod model;
pub mod params;
pub mod scene;
pub mod simulators;
pub mod target;
pub mod world;
