//! What is simulated: the sheet's sizes or the mesh, its mass and pins, and what the import found and mended.

use egui::{RichText, Ui, WidgetInfo};

use super::{
    menu::Action,
    params::{Change, Changes, params_ui},
    simulation::{send, warnings_ui},
};
use crate::{
    app::session::Session,
    params::Params,
    scene::{GridTarget, Mass, Target, to_ron},
    target::RecoveryMethod,
};

/// The panel; returns what was asked for.
pub fn target_ui(ui: &mut Ui, session: &mut Session) -> Option<Action> {
    let mut asked = None;
    let mut target = session.scene().target.clone();
    let mut changes = Changes::default();
    ui.horizontal(|ui| {
        let is_grid = matches!(target, Target::Grid(_));
        if ui.selectable_label(is_grid, "Grid").on_hover_text("A generated sheet").clicked() && !is_grid {
            let before = to_ron(&target).unwrap_or_default();
            let value = to_ron(&Target::Grid(GridTarget::default())).unwrap_or_default();
            changes.changes.push(Change { key: "target".to_owned(), value, before });
            changes.ended = true;
        }
        if ui
            .selectable_label(!is_grid, "Mesh…")
            .on_hover_text("A mesh from a file: .obj, .gltf, .glb")
            .clicked()
        {
            asked = Some(Action::Open);
        }
    });
    match &mut target {
        Target::Grid(grid) => changes.add(params_ui(ui, "target", &|_| false, |visitor| grid.visit(visitor))),
        Target::Mesh(mesh) => {
            let name = mesh.path.rsplit(['/', '\\']).next().unwrap_or_default();
            ui.add(egui::Label::new(RichText::new(name).strong()).truncate()).on_hover_text(&mesh.path);
            changes.add(params_ui(ui, "target", &|_| false, |visitor| mesh.visit(visitor)));
        }
    }
    changes.add(mass_ui(ui, &session.scene().mass));
    send(session, None, changes);
    pins_ui(ui, session);
    found_ui(ui, session);
    warnings_ui(ui, session);
    asked
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
        ui.label("Mass").on_hover_text("Of every particle, or by the area of the faces around it");
        let combo = egui::ComboBox::from_id_salt("mass kind")
            .width(100.0)
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

fn pins_ui(ui: &mut Ui, session: &mut Session) {
    let Some(lane) = session.lane_state() else { return };
    let (pinned, selected) = (lane.pinned, session.selection.len());
    ui.horizontal(|ui| {
        ui.label(format!("{pinned} pinned · {selected} selected"));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let all = ui.add_enabled(pinned > 0, egui::Button::new("Free all"));
            if all.on_hover_text("Frees every pinned particle").clicked() {
                let particles = session.pinned();
                session.pin(&particles, false);
            }
            let pin = ui.add_enabled(selected > 0, egui::Button::new("Pin / free"));
            if pin.on_hover_text("Pins the selection, or frees it if all of it is pinned (P)").clicked() {
                session.pin_selection();
            }
        });
    });
}

/// What the import found and mended.
fn found_ui(ui: &mut Ui, session: &Session) {
    let Some(lane) = session.lane_state() else { return };
    let (report, mended) = (&lane.report, &lane.report.mended);
    let mut lines = Vec::new();
    let counted = [
        (report.faces.quads, "quads"),
        (report.faces.triangles, "triangles"),
        (report.faces.ngons, "larger faces"),
    ];
    let faces = counted.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}"));
    lines.push(format!("{}; {} in one piece", faces.collect::<Vec<_>>().join(", "), lane.positions.len()));
    if report.components > 1 {
        lines[0] = lines[0].replace("in one piece", &format!("particles in {} pieces", report.components));
    } else {
        lines[0] = lines[0].replace("in one piece", "particles in one piece");
    }
    lines.push(format!("{} kg in all", crate::params::Short(round(lane.mass))));
    let recovery = &report.quad_recovery;
    let by = match recovery.method {
        RecoveryMethod::None => "",
        RecoveryMethod::NgonEncoding => "the file's n-gon encoding",
        RecoveryMethod::Order => "the order of the triangles",
        RecoveryMethod::Geometry => "the shape of the triangles",
    };
    if recovery.quads > 0 {
        lines.push(format!("{} quads brought back by {by}", recovery.quads));
    }
    let mends = [
        (mended.welded, "vertices welded"),
        (mended.degenerate_faces, "faces without area dropped"),
        (mended.duplicate_faces, "duplicate faces dropped"),
        (mended.loose_vertices, "loose vertices dropped"),
    ];
    lines.extend(mends.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")));
    for line in lines {
        ui.label(RichText::new(line).small().weak());
    }
}

/// Four digits are enough to read.
fn round(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}
