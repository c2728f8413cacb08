//! The advice: what is wanted, the pick with its evidence, and the best of every method.

use egui::{DragValue, RichText, Ui, WidgetInfo};

use super::{
    Finding, Freshness, Lab, controls::tolerance_ui, freshness_ui, use_settings, without_settings, words,
};
use crate::{
    app::{panels::health::three, session::Session},
    lab::{
        Settings,
        advice::{Advice, Candidate, Goal},
    },
};

/// What is asked and shown of the advice.
pub struct View {
    pub(super) finding: Option<Finding<Advice>>,
    /// A budget of time is given instead of an error.
    pub(super) by_budget: bool,
    /// Computing time of a frame of 1/60 s, ms.
    pub(super) budget: f64,
}

impl Default for View {
    fn default() -> Self {
        Self { finding: None, by_budget: false, budget: 4.0 }
    }
}

/// What is wanted.
pub fn controls_ui(ui: &mut Ui, view: &mut View, tolerance: &mut f64) {
    ui.selectable_value(&mut view.by_budget, false, "Keep an error")
        .on_hover_text("The least work with an RMS position error up to the tolerance");
    ui.selectable_value(&mut view.by_budget, true, "Keep a budget")
        .on_hover_text("The least error within a time for each frame of 1/60 s");
    if view.by_budget {
        let field = DragValue::new(&mut view.budget).range(1e-3..=1e4).speed(0.05).suffix(" ms a frame");
        let field = ui.add(field.max_decimals(3));
        field.widget_info(|| WidgetInfo::labeled(egui::Role::SpinButton, true, "Budget"));
        field.on_hover_text("Computing time of a frame of 1/60 s, one thread");
    } else {
        tolerance_ui(ui, tolerance);
    }
}

/// The tab.
pub fn ui(ui: &mut Ui, lab: &mut Lab, session: &mut Session) {
    let is_busy = lab.is_busy();
    let Some(finding) = &lab.advice.finding else {
        return lab.nothing_ui(ui, ["The converged solution first, then each method's longest step that will do.", "Search: the cheapest settings that keep the tolerance, or the most accurate within a budget."]);
    };
    let freshness = finding.subject.freshness(session.scene(), without_settings);
    let mut used = None;
    egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        freshness_ui(ui, freshness, finding.is_whole, is_busy);
        ui.label(
            RichText::new(format!("{}, {}", finding.subject.label(), goal(finding.table.goal))).strong(),
        );
        ui.add_space(4.0);
        used = pick_ui(ui, finding, freshness);
        ui.add_space(6.0);
        used = used.take().or(candidates_ui(ui, &finding.table, freshness));
        if let Some(machine) = &finding.table.machine {
            let disturbed =
                if finding.is_disturbed { "; disturbed: the simulation ran meanwhile" } else { "" };
            let text =
                format!("Time: one thread, {}, tenter {}{disturbed}", machine.processor, machine.tenter);
            ui.label(RichText::new(text).small().weak());
        }
    });
    if let Some(settings) = used {
        use_settings(session, &settings);
    }
}

fn goal(goal: Goal) -> String {
    match goal {
        Goal::MaxError(error) => format!("an RMS error up to {} m", three(error)),
        Goal::BudgetMs(ms) => format!("up to {} ms a frame", three(ms)),
    }
}

fn metres(error: Option<f64>) -> String {
    error.map_or("none to tell".to_owned(), |error| format!("{} m", three(error)))
}

fn margin(margin: Option<f64>) -> String {
    margin.map_or("no limit".to_owned(), |margin| format!("{margin:.2} x dt"))
}

fn pick_ui(ui: &mut Ui, finding: &Finding<Advice>, freshness: Freshness) -> Option<Settings> {
    let advice = &finding.table;
    let mut used = None;
    if !advice.met {
        ui.label(RichText::new("Nothing meets this; the closest is").color(super::warning(ui)));
    }
    ui.horizontal_wrapped(|ui| {
        let button = egui::Button::new(RichText::new("Apply").strong());
        let tip = "Uses these settings: one edit that can be taken back";
        if ui.add_enabled(freshness != Freshness::Elsewhere, button).on_hover_text(tip).clicked() {
            used = Some(advice.settings.clone());
        }
        ui.label(RichText::new(words(&advice.settings)).heading());
    });
    let ms = advice.ms_per_frame.map_or(String::new(), |ms| format!(", {} ms a frame", three(ms)));
    ui.label(format!(
        "RMS error {}, {} spring visits /s{ms}.",
        metres(advice.error),
        three(advice.spring_visits)
    ));
    ui.label(format!(
        "Longest stable step in theory: {}. Seen quiet for {} simulated seconds. {} runs in {:.0} s.",
        margin(advice.stability_margin),
        three(advice.quiet_seconds),
        advice.trials,
        finding.took.as_secs_f64(),
    ));
    used
}

/// The best of every method; returns what was clicked.
fn candidates_ui(ui: &mut Ui, advice: &Advice, freshness: Freshness) -> Option<Settings> {
    let mut used = None;
    egui::Grid::new("candidates").num_columns(7).striped(true).spacing([24.0, 4.0]).show(ui, |ui| {
        let heads = [
            "The best of each method",
            "RMS error",
            "Spring visits /s",
            "ms a frame",
            "Limit in theory",
            "Runs",
            "",
        ];
        for name in heads {
            ui.label(RichText::new(name).strong());
        }
        ui.end_row();
        for candidate in &advice.candidates {
            let Candidate { settings, met, error, spring_visits, ms_per_frame, stability_margin, trials } =
                candidate;
            let text = RichText::new(words(settings));
            ui.label(if *met { text } else { text.weak() });
            ui.monospace(metres(*error));
            ui.monospace(three(*spring_visits).to_string());
            ui.monospace(ms_per_frame.map_or("-".to_owned(), |ms| three(ms).to_string()));
            ui.monospace(margin(*stability_margin));
            ui.monospace(trials.to_string());
            ui.horizontal(|ui| {
                let button =
                    ui.add_enabled(freshness != Freshness::Elsewhere, egui::Button::new("Use").small());
                let name = format!("Use {}", words(settings));
                button.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, &name));
                if button.clicked() {
                    used = Some(settings.clone());
                }
                ui.label(if *met { "meets it" } else { "does not meet it" });
            });
            ui.end_row();
        }
    });
    used
}
