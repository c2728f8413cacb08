//! Tenter: cloth simulation with its error, cost and stability measured.
#![cfg_attr(not(test), warn(clippy::unwrap_used))]

pub mod model;
pub mod target;
