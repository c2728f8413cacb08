//! The methods against independent figures: errors, orders, equilibria, energies, extremes.

mod adaptive;
mod descent;
mod equilibrium;
mod extremes;
mod implicit;
mod orders;
mod position_based;
mod promises;
mod scenes;
