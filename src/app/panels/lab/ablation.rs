//! What each ingredient of the scene is worth, and the proposal of what can be left out.

use egui::{DragValue, RichText, Ui, WidgetInfo};

use super::{Finding, Freshness, Lab, freshness_ui};
use crate::{
    app::{panels::health::three, session::Session},
    lab::{
        Case,
        ablation::{Ablation, Row, without},
    },
};

/// What is asked and shown of the ablation.
pub struct View {
    pub(super) finding: Option<Finding<Ablation>>,
    /// Change that does not matter, relative to the motion.
    pub(super) tolerance: f64,
}

impl Default for View {
    fn default() -> Self {
        Self { finding: None, tolerance: 0.01 }
    }
}

/// Which change does not matter.
pub fn controls_ui(ui: &mut Ui, view: &mut View) {
    ui.label("A change up to");
    let mut percent = 100.0 * view.tolerance;
    let speed = (percent * 0.02).max(1e-6);
    let field = DragValue::new(&mut percent).range(1e-6..=100.0).speed(speed).suffix(" %").max_decimals(6);
    let field = ui.add(field);
    field.widget_info(|| WidgetInfo::labeled(egui::Role::SpinButton, true, "Change that does not matter"));
    if field.on_hover_text("RMS change of the positions, as a part of the motion").changed() {
        view.tolerance = percent / 100.0;
    }
    ui.label("of the motion does not matter");
    ui.separator();
}

/// An ingredient in words.
pub fn name_of(ingredient: &str) -> String {
    match ingredient {
        "springs.stretch" => "Stretch springs".to_owned(),
        "springs.shear" => "Shear springs".to_owned(),
        "springs.bend" => "Bend springs".to_owned(),
        "springs.damping" => "Spring damping".to_owned(),
        "precision" => "Double precision".to_owned(),
        "resolution" => "Full resolution (half tried)".to_owned(),
        "sweeps" => "All sweeps (half tried)".to_owned(),
        path => super::super::params::accessible_name(path),
    }
}

fn percent(part: Option<f64>) -> String {
    part.map_or("-".to_owned(), |part| format!("{:.1} %", 100.0 * part))
}

fn change(row: &Row) -> String {
    row.change.map_or("burst".to_owned(), |change| format!("{} %", three(100.0 * change)))
}

/// The tab.
pub fn ui(ui: &mut Ui, lab: &mut Lab, session: &mut Session) {
    let is_busy = lab.is_busy();
    let Some(finding) = &lab.ablation.finding else {
        return lab.nothing_ui(ui, ["The whole scene first, then the same without each ingredient.", "Measure: what each spring kind, force, damping, precision and sweep changes, and what it costs."]);
    };
    let freshness = finding.subject.freshness(session.scene(), |_| {});
    let mut applies = false;
    egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        freshness_ui(ui, freshness, finding.is_whole, is_busy);
        let method = super::words(&crate::lab::Settings::of(&finding.subject.scene));
        ui.label(RichText::new(format!("{}, by {method}", finding.subject.label())).strong());
        ui.add_space(4.0);
        applies = proposal_ui(ui, finding, freshness);
        ui.add_space(6.0);
        table_ui(ui, &finding.table);
        if !finding.table.resolution_tried {
            let text =
                "A lower resolution was not tried: only a grid from its beginning can be made coarser here.";
            ui.label(RichText::new(text).small().weak());
        }
        if let Some(machine) = &finding.table.machine {
            let disturbed =
                if finding.is_disturbed { "; disturbed: the simulation ran meanwhile" } else { "" };
            let text =
                format!("Time: one thread, {}, tenter {}{disturbed}", machine.processor, machine.tenter);
            ui.label(RichText::new(text).small().weak());
        }
    });
    if applies
        && let Some(proposal) = &finding.table.proposal
        && let Ok(case) = Case::new(session.scene().clone(), session.place(), finding.subject.seconds)
    {
        let whole = session.scene().clone();
        let scene = proposal.leave_out.iter().fold(whole, |scene, name| without(&case, &scene, name));
        session.become_scene("leave out what is not needed", &scene);
    }
}

/// What can be left out together; true where it is to be.
fn proposal_ui(ui: &mut Ui, finding: &Finding<Ablation>, freshness: Freshness) -> bool {
    let table = &finding.table;
    let Some(proposal) = &table.proposal else {
        let text = if finding.is_whole {
            format!(
                "Nothing can be left out: each changes more than {} of the motion.",
                percent(Some(table.tolerance))
            )
        } else {
            "No proposal: not every ingredient was tried.".to_owned()
        };
        ui.label(text);
        return false;
    };
    let names: Vec<String> = proposal.leave_out.iter().map(|name| name_of(name)).collect();
    let mut applies = false;
    ui.horizontal_wrapped(|ui| {
        let button = egui::Button::new(RichText::new("Leave out").strong());
        let tip = "One edit that can be taken back. It was run as a whole.";
        applies = ui.add_enabled(freshness == Freshness::Fresh, button).on_hover_text(tip).clicked();
        ui.label(RichText::new(names.join(", ")).strong());
    });
    let time =
        proposal.time_saved.map_or(String::new(), |time| format!(" and {} of the time", percent(Some(time))));
    ui.label(format!(
        "Run together without them, the cloth changes by {} % of its motion; {} of the spring visits{time} are saved.",
        three(100.0 * proposal.change),
        percent(Some(proposal.work_saved)),
    ));
    applies
}

fn table_ui(ui: &mut Ui, table: &Ablation) {
    egui::Grid::new("ablation").num_columns(5).striped(true).spacing([28.0, 4.0]).show(ui, |ui| {
        let heads = [
            ("Left out", "One ingredient at a time"),
            ("Change", "RMS distance from the whole scene's run, as a part of the motion"),
            ("Visits saved", "Part of the springs looked at; below 0 where it costs more"),
            ("Time saved", "Part of the measured time, one thread"),
            ("Verdict", "Whether the change matters"),
        ];
        for (name, tip) in heads {
            ui.label(RichText::new(name).strong()).on_hover_text(tip);
        }
        ui.end_row();
        for row in &table.rows {
            ui.label(name_of(&row.ingredient));
            ui.monospace(change(row));
            ui.monospace(percent(Some(row.work_saved)));
            ui.monospace(percent(row.time_saved));
            let text = RichText::new(row.verdict());
            ui.label(if row.needed { text } else { text.color(egui::Color32::from_rgb(90, 180, 110)) });
            ui.end_row();
        }
    });
}
