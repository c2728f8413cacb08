//! Method, precision, dt, mass, springs, damping, gravity, wind and tearing of the lane that is edited.

use egui::{RichText, Ui, WidgetInfo};

use super::params::{Change, Changes, WARNING, params_ui};
use crate::{
    app::session::Session,
    params::Params,
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
        own.add(params_ui(ui, "simulator.params", &|_| false, |visitor| {
            entry.visit(&scene.simulator.params, visitor);
        }));
    }
    let lane_keys = ["precision", "dt"];
    let own_only = |key: &str| !lane_keys.contains(&key);
    own.add(params_ui(ui, "", &own_only, |visitor| scene.visit(visitor)));
    // Lanes differ in these and in nothing else.
    send(session, (lanes > 1).then_some(lane), own);
    ui.separator();
    if !ignores_stiffness {
        set_all_ui(ui, session);
    }
    let hide = |key: &str| {
        let elsewhere = ["target", "pins", "mass", "simulator", "precision", "dt"];
        let of_springs = key == "springs.damping" || key.ends_with(".stiffness");
        elsewhere.contains(&key) || (ignores_stiffness && of_springs)
    };
    let shared = params_ui(ui, "", &hide, |visitor| scene.visit(visitor));
    send(session, None, shared);
}

/// One stiffness for all kinds of springs, as a first guess.
fn set_all_ui(ui: &mut Ui, session: &mut Session) {
    let springs = session.scene().springs.clone();
    let kinds = [("stretch", &springs.stretch), ("shear", &springs.shear), ("bend", &springs.bend)];
    let mut value = springs.stretch.stiffness;
    ui.horizontal(|ui| {
        ui.label("All springs").on_hover_text("Sets one stiffness for stretch, shear and bend");
        let speed = (value * 0.01).max(1e-3);
        let field = egui::DragValue::new(&mut value).range(0.0..=1e12).speed(speed).suffix(" N/m");
        let field = ui.add(field.max_decimals(3));
        field.widget_info(|| WidgetInfo::labeled(egui::Role::SpinButton, true, "All springs stiffness"));
        let changed = field.changed();
        let ended = field.drag_stopped() || field.lost_focus();
        let pressed = ui
            .button("Same for all")
            .on_hover_text("Gives shear and bend the stiffness of stretch")
            .clicked();
        if changed || pressed {
            let change = |(kind, now): &(&str, &crate::forces::springs::Kind)| {
                (format!("springs.{kind}.stiffness"), format!("{value:?}"), format!("{:?}", now.stiffness))
            };
            session.set_all(None, "one stiffness for all springs", &kinds.each_ref().map(change));
        }
        if ended || pressed {
            session.end_edit();
        }
    });
}

pub(super) fn send(session: &mut Session, lane: Option<usize>, changes: Changes) {
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
            .height(480.0)
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
        // Abbreviations, as in rk4 and xpbd: they have no vowels.
        if !word.contains(['a', 'e', 'i', 'o', 'u', 'y']) {
            return word.to_uppercase();
        }
        let mut word = word.to_owned();
        if let Some(first) = word.get_mut(..1) {
            first.make_ascii_uppercase();
        }
        word
    });
    words.collect::<Vec<_>>().join(" ")
}

/// Warnings of the lane, one a line.
pub fn warnings_ui(ui: &mut Ui, session: &Session) {
    if let Some(lane) = session.state().lanes.get(session.lane) {
        for warning in lane.warnings.iter() {
            ui.label(RichText::new(warning).small().color(WARNING));
        }
    }
}
