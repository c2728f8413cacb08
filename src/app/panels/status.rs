//! The status bar: what is open, how large it is, and whether it keeps up.

use egui::{RichText, Ui};

use super::params::WARNING;
use crate::{app::session::Session, world::Health};

/// The bar; `busy` says what is being read, `device` and `uploaded` (bytes a picture) come from the window.
pub fn status_ui(ui: &mut Ui, session: &Session, busy: Option<&str>, device: &str, uploaded: u64) {
    let state = session.state();
    let Some(lane) = state.lanes.get(session.lane) else { return };
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 14.0;
        let springs: usize = lane.geometry.springs.iter().map(Vec::len).sum();
        ui.label(format!("{} particles · {springs} springs", lane.positions.len()));
        ui.label(RichText::new(format!("t = {:<9}", format!("{:.2} s", lane.time))).monospace())
            .on_hover_text("Simulated time");
        match (state.running, state.pace) {
            (false, _) => ui.label("paused"),
            (true, Some(pace)) if pace < 0.95 * state.speed => ui.label(
                RichText::new(format!("{pace:.2}x real time, {}x asked for", state.speed)).color(WARNING),
            ),
            (true, _) => ui.label(format!("{}x real time", state.speed)),
        };
        match lane.health {
            Health::Ok => {}
            Health::Unsettled { particle, .. } => {
                ui.label(RichText::new(format!("unsettled at particle {particle}")).color(WARNING));
            }
            Health::Diverged { particle, time, .. } => {
                let text = format!("diverged at t = {time:.3} s, particle {particle}");
                ui.label(RichText::new(text).color(ui.visuals().error_fg_color));
            }
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.label(RichText::new(device).weak().small()).on_hover_text("What draws");
            let kilobytes = format!("{:5.0} kB/frame", uploaded as f64 / 1000.0);
            ui.label(RichText::new(kilobytes).weak().small())
                .on_hover_text("Uploaded to it for the last picture");
            ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                let opening = busy.or(session.opening());
                if !session.at_work().is_zero() {
                    // While a step lasts nothing else asks for a picture.
                    ui.ctx().request_repaint_after(std::time::Duration::from_millis(500));
                }
                if let Some(name) = opening {
                    ui.add(egui::Label::new(format!("opening {name}")).truncate());
                } else if session.is_stuck() {
                    ui.spinner();
                    ui.add(egui::Label::new("a step takes long; Space breaks it off").truncate());
                } else if let Some(message) = &session.message {
                    ui.add(egui::Label::new(message).truncate()).on_hover_text(message);
                }
            });
        });
    });
}
