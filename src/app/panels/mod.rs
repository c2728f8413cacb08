//! The panels around the viewport. They read the session, and ask for changes through it.

mod banner;
mod dialogs;
mod display;
mod export;
mod health;
mod icons;
mod lab;
mod lanes;
mod menu;
mod opening;
mod params;
mod restore;
mod simulation;
mod status;
mod target;
mod timeline;
mod transport;

pub use banner::{banner_ui, offer_ui};
pub use dialogs::{Ask, dialog_ui, gallery_ui, help_ui};
pub use display::{Display, display_ui, legend_ui};
pub use export::ExportWindow;
pub use health::health_ui;
pub use lab::{Lab, Tab};
pub use lanes::{lane_colour, lanes_ui, name_of};
pub use menu::{Action, menu_ui, pressed};
pub use opening::opening_ui;
pub use restore::restore_ui;
pub use simulation::simulation_ui;
pub use status::status_ui;
pub use target::target_ui;
pub use timeline::timeline_ui;
pub use transport::{change_speed, hands_ui, trade_button_ui, transport_ui};
