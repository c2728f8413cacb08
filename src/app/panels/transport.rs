//! Time and hands: run, pause, step, reset and speed; the tool of the mouse and how it holds.

use egui::{Ui, WidgetInfo};

use super::{
    icons::{Icon, icon_button},
    menu::Action,
};
use crate::app::{engine::Order, hands::Tool, session::Session};

/// Speeds that the menu offers, simulated seconds a second.
const SPEEDS: [f64; 8] = [0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];

/// The buttons; returns what was asked for.
pub fn transport_ui(ui: &mut Ui, session: &mut Session) -> Option<Action> {
    let mut asked = None;
    let running = session.running();
    let (icon, name) = if running { (Icon::Pause, "Pause") } else { (Icon::Play, "Run") };
    let mut button = |ui: &mut Ui, icon, name, tip, action| {
        if icon_button(ui, icon, name, tip).clicked() {
            asked = Some(action);
        }
    };
    button(ui, icon, name, "Run or pause (Space)", Action::Run);
    button(ui, Icon::Step, "Step", "One step (.)", Action::Step);
    button(ui, Icon::Start, "Reset", "Back to the start of the scene (R)", Action::Reset);
    let speed = session.state().speed;
    let combo = egui::ComboBox::from_id_salt("speed").width(64.0).selected_text(format!("{speed}x"));
    let combo = combo.show_ui(ui, |ui| {
        for choice in SPEEDS {
            if ui.selectable_label(choice == speed, format!("{choice}x")).clicked() {
                session.order(Order::Speed(choice));
            }
        }
    });
    combo.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, "Speed"));
    combo.response.on_hover_text("Simulated seconds for each second: [ slower, ] faster");
    asked
}

/// The next speed below or above.
pub fn change_speed(session: &mut Session, faster: bool) {
    let now = session.state().speed;
    let next = if faster {
        SPEEDS.iter().find(|speed| **speed > now)
    } else {
        SPEEDS.iter().rev().find(|speed| **speed < now)
    };
    if let Some(speed) = next {
        session.order(Order::Speed(*speed));
    }
}

/// The button of the lab; true where it was pressed.
pub fn trade_button_ui(ui: &mut Ui) -> bool {
    let tip = "What each method costs and how wrong it is, on this scene as it stands";
    // A menu bar's buttons have no frame: this one is to be seen.
    let button =
        egui::Button::new(egui::RichText::new("Trade").strong()).fill(ui.visuals().widgets.inactive.bg_fill);
    ui.add(button.frame_when_inactive(true)).on_hover_text(tip).clicked()
}

/// What a drag does, and how it holds.
pub fn hands_ui(ui: &mut Ui, session: &mut Session, tool: &mut Tool) {
    let tools = [
        (Tool::Move, "Orbit", "A drag moves the cloth, and turns the view beside it (V)"),
        (Tool::Box, "Box", "The next drag frames a box, with Shift the ones after it too (B)"),
        (Tool::Lasso, "Lasso", "The next drag draws a lasso, with Shift the ones after it too (L)"),
    ];
    ui.spacing_mut().item_spacing.x = 2.0;
    for (choice, name, tip) in tools {
        ui.selectable_value(tool, choice, name).on_hover_text(tip);
    }
    ui.add_space(4.0);
    ui.separator();
    ui.add_space(4.0);
    let grip = &mut session.grip;
    ui.selectable_value(&mut grip.soft, false, "Hold")
        .on_hover_text("The mouse holds particles hard: they are where it is (H)");
    ui.selectable_value(&mut grip.soft, true, "Pull").on_hover_text(
        "The mouse pulls particles by a critically damped spring: they follow as the cloth lets them (H)",
    );
    ui.add_space(4.0);
    // Always there, so that nothing jumps when it is wanted.
    let speed = (grip.stiffness * 0.02).max(0.01);
    let field = egui::DragValue::new(&mut grip.stiffness).range(0.01..=1e9).speed(speed).suffix(" N/m");
    let field = ui.add_enabled(grip.soft, field.max_decimals(2));
    field.widget_info(|| WidgetInfo::labeled(egui::Role::SpinButton, true, "Stiffness of the mouse spring"));
    field.on_hover_text("Stiffness of the mouse spring");
}
