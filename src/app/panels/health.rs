//! Whether the simulation can be trusted: energies, strain, cost, and dt against its limit.

use egui::{Color32, RichText, Ui};

use super::simulation::warnings_ui;
use crate::app::{engine::LaneState, session::Session};

/// The panel.
pub fn health_ui(ui: &mut Ui, session: &Session) {
    let Some(lane) = session.state().lanes.get(session.lane) else { return };
    gauge(ui, lane);
    egui::Grid::new("health").num_columns(2).spacing([12.0, 3.0]).show(ui, |ui| {
        let mut row = |name: &str, value: String, tip: &str| {
            ui.label(name).on_hover_text(tip);
            ui.monospace(value);
            ui.end_row();
        };
        let energy = lane.measures.energy;
        row("Kinetic", format!("{:.4e} J", energy.kinetic), "Σ m v² / 2");
        row("Gravitational", format!("{:.4e} J", energy.gravitational), "Σ m g y");
        row("Elastic", format!("{:.4e} J", energy.elastic), "Σ k (|d| - L)² / 2");
        row(
            "Largest strain",
            format!("{:.2} %", 100.0 * lane.measures.max_strain),
            "|d|/L - 1 over the springs that act",
        );
        row(
            "Mean strain",
            format!("{:.2} %", 100.0 * lane.measures.mean_strain),
            "|d|/L - 1 over the springs that act",
        );
        row("Cost", format!("{:.3} s/s", lane.cost), "Seconds of computing for each simulated second");
        if lane.broken > 0 {
            row("Torn springs", lane.broken.to_string(), "Broken for good, until a reset");
        }
    });
    warnings_ui(ui, session);
}

/// dt as a part of the largest stable one.
fn gauge(ui: &mut Ui, lane: &LaneState) {
    let dt = lane.scene.dt;
    let Some(limit) = lane.dt_limit else {
        ui.label(RichText::new(format!("dt {dt} s; this method has no stability limit")).small());
        return;
    };
    let part = if limit > 0.0 { (dt / limit) as f32 } else { f32::INFINITY };
    let colour = match part {
        p if p < 0.8 => Color32::from_rgb(90, 180, 110),
        p if p <= 1.0 => Color32::from_rgb(230, 170, 60),
        _ => Color32::from_rgb(220, 80, 70),
    };
    let text = if limit > 0.0 {
        format!("dt {dt} s is {:.0} % of the limit {limit:.4} s", 100.0 * part)
    } else {
        format!("dt {dt} s: no dt is stable here")
    };
    let bar = egui::ProgressBar::new(part.min(1.0)).fill(colour).corner_radius(2.0).desired_height(8.0);
    ui.add(bar);
    ui.label(RichText::new(text).small())
        .on_hover_text("Largest stable dt in theory, for small motions around the current shape");
}
