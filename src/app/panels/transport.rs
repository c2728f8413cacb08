//! Time: run, pause, step, reset and speed.

use egui::{Ui, WidgetInfo};

use super::icons::{Icon, icon_button};
use crate::app::{engine::Order, session::Session};

/// Speeds that the menu offers, simulated seconds a second.
const SPEEDS: [f64; 8] = [0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];

/// The buttons.
pub fn transport_ui(ui: &mut Ui, session: &mut Session) {
    let running = session.running();
    let (icon, name) = if running { (Icon::Pause, "Pause") } else { (Icon::Play, "Run") };
    if icon_button(ui, icon, name, "Run or pause (Space)").clicked() {
        session.run(!running);
    }
    if icon_button(ui, Icon::Step, "Step", "One step (.)").clicked() {
        session.order(Order::Step(1));
    }
    if icon_button(ui, Icon::Start, "Reset", "Back to the start of the scene (R)").clicked() {
        session.reset();
    }
    let speed = session.state().speed;
    let combo = egui::ComboBox::from_id_salt("speed").width(64.0).selected_text(format!("{speed}x")).show_ui(
        ui,
        |ui| {
            for choice in SPEEDS {
                if ui.selectable_label(choice == speed, format!("{choice}x")).clicked() {
                    session.order(Order::Speed(choice));
                }
            }
        },
    );
    combo.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, "Speed"));
    combo.response.on_hover_text("Simulated seconds for each second");
}
