//! The panels around the viewport. They read the session, and ask for changes through it.

mod display;
mod health;
mod icons;
mod params;
mod simulation;
mod status;
mod transport;

pub use display::display_ui;
pub use health::health_ui;
pub use simulation::simulation_ui;
pub use status::status_ui;
pub use transport::transport_ui;
