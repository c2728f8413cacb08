//! The methods against independent figures: errors, orders, equilibria, energies, extremes.

mod descent;
mod extremes;
mod implicit;
mod position_based;
mod promises;
mod scenes;
