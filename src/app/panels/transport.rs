//! Time: run, pause, step, reset and speed.

use egui::{Ui, WidgetInfo};

use crate::app::{engine::Order, session::Session};

/// Speeds that the menu offers, simulated seconds a second.
const SPEEDS: [f64; 8] = [0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];

/// The buttons.
pub fn transport_ui(ui: &mut Ui, session: &mut Session) {
    let running = session.running();
    let button = |ui: &mut Ui, icon: &str, name: &str, tip: &str| {
        let response = ui.add(egui::Button::new(icon).min_size(egui::vec2(30.0, 24.0)));
        response.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, name));
        response.on_hover_text(tip).clicked()
    };
    let (icon, name) = if running { ("⏸", "Pause") } else { ("▶", "Run") };
    if button(ui, icon, name, "Run or pause (Space)") {
        session.run(!running);
    }
    if button(ui, "⏭", "Step", "One step (.)") {
        session.order(Order::Step(1));
    }
    if button(ui, "⏮", "Reset", "Back to the start of the scene (R)") {
        session.reset();
    }
    let speed = session.state().speed;
    let combo = egui::ComboBox::from_id_salt("speed").width(64.0).selected_text(format!("{speed}x")).show_ui(ui, |ui| {
        for choice in SPEEDS {
            if ui.selectable_label(choice == speed, format!("{choice}x")).clicked() {
                session.order(Order::Speed(choice));
            }
        }
    });
    combo.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, "Speed"));
    combo.response.on_hover_text("Simulated seconds for each second");
}
