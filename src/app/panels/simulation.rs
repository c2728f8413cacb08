//! Method, precision, dt, mass, springs, damping, gravity, wind and tearing of the lane that is edited.

use egui::{RichText, Ui, WidgetInfo};

use super::params::{Change, Changes, WARNING, params_ui};
use crate::{
    app::session::Session,
    params::Params,
    scene::Mass,
    simulators::{self, Model, find},
};

/// The panel.
pub fn simulation_ui(ui: &mut Ui, session: &mut Session) {
    let mut scene = session.scene().clone();
    let lanes = session.state().lanes.len();
    let lane = session.lane;
    let mut own = method_ui(ui, session);
    let ignores_stiffness =
        find(&scene.simulator.id).is_ok_and(|entry| entry.model == Model::RigidConstraints);
    if let Ok(entry) = find(&scene.simulator.id) {
        let changes = params_ui(ui, "simulator.params", &|_| false, |visitor| {
            entry.visit(&scene.simulator.params, visitor);
        });
        own.changes.extend(changes.changes);
        own.ended |= changes.ended;
    }
    let lane_keys = ["precision", "dt"];
    let own_only = |key: &str| !lane_keys.contains(&key);
    let changes = params_ui(ui, "", &own_only, |visitor| scene.visit(visitor));
    own.changes.extend(changes.changes);
    own.ended |= changes.ended;
    // Lanes differ in these and in nothing else.
    send(session, (lanes > 1).then_some(lane), own);
    ui.separator();
    let mut shared = mass_ui(ui, &scene.mass);
    let hide = |key: &str| {
        let elsewhere = ["target", "pins", "mass", "simulator", "precision", "dt"];
        elsewhere.contains(&key) || (ignores_stiffness && key.ends_with(".stiffness"))
    };
    let changes = params_ui(ui, "", &hide, |visitor| scene.visit(visitor));
    shared.changes.extend(changes.changes);
    shared.ended |= changes.ended;
    send(session, None, shared);
}

fn send(session: &mut Session, lane: Option<usize>, changes: Changes) {
    for Change { key, value, before } in changes.changes {
        session.set(lane, &key, &value, &before);
    }
    if changes.ended {
        session.end_edit();
    }
}

fn method_ui(ui: &mut Ui, session: &Session) -> Changes {
    let current = session.scene().simulator.id.clone();
    let mut chosen = current.clone();
    ui.horizontal(|ui| {
        ui.label(RichText::new("Method").strong());
        let combo = egui::ComboBox::from_id_salt("method")
            .width(180.0)
            .selected_text(title(&current))
            .show_ui(ui, |ui| {
                for entry in simulators::ALL {
                    ui.selectable_value(&mut chosen, entry.id.to_owned(), title(entry.id))
                        .on_hover_text(entry.summary);
                }
            });
        combo.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, "Method"));
    });
    if let Ok(entry) = find(&current) {
        ui.label(RichText::new(entry.summary).small().weak());
    }
    if chosen == current {
        return Changes::default();
    }
    let quoted = |id: &str| format!("\"{id}\"");
    let change = Change { key: "simulator.id".to_owned(), value: quoted(&chosen), before: quoted(&current) };
    Changes { changes: vec![change], ended: true }
}

/// `symplectic_euler` becomes `Symplectic Euler`.
pub fn title(id: &str) -> String {
    let words = id.split('_').map(|word| {
        let mut word = word.to_owned();
        if let Some(first) = word.get_mut(..1) {
            first.make_ascii_uppercase();
        }
        word
    });
    words.collect::<Vec<_>>().join(" ")
}

fn mass_ui(ui: &mut Ui, mass: &Mass) -> Changes {
    let (mut by_area, mut value) = match *mass {
        Mass::PerParticle(value) => (false, value),
        Mass::PerArea(value) => (true, value),
    };
    let text =
        |by_area: bool, value: f64| format!("{}({value:?})", if by_area { "PerArea" } else { "PerParticle" });
    let before = text(by_area, value);
    let mut ended = false;
    ui.horizontal(|ui| {
        ui.label(RichText::new("Mass").strong())
            .on_hover_text("Of every particle, or by the area of the faces around it");
        let combo = egui::ComboBox::from_id_salt("mass kind")
            .width(110.0)
            .selected_text(if by_area { "per area" } else { "per particle" })
            .show_ui(ui, |ui| {
                ui.selectable_value(&mut by_area, false, "per particle");
                ui.selectable_value(&mut by_area, true, "per area");
            });
        combo.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, "Mass kind"));
        let unit = if by_area { " kg/m²" } else { " kg" };
        let speed = (value * 0.01).max(1e-6);
        let field =
            egui::DragValue::new(&mut value).speed(speed).range(Mass::RANGE).suffix(unit).max_decimals(6);
        let field = ui.add(field);
        field.widget_info(|| WidgetInfo::labeled(egui::Role::SpinButton, true, "Mass"));
        ended = field.drag_stopped() || field.lost_focus();
    });
    let now = text(by_area, value);
    let changes =
        if now == before { Vec::new() } else { vec![Change { key: "mass".to_owned(), value: now, before }] };
    Changes { changes, ended }
}

/// Warnings of the lane, one a line.
pub fn warnings_ui(ui: &mut Ui, session: &Session) {
    if let Some(lane) = session.state().lanes.get(session.lane) {
        for warning in lane.warnings.iter() {
            ui.label(RichText::new(warning).small().color(WARNING));
        }
    }
}
