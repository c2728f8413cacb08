//! Error against work, both logarithmic: a line for each method, the Pareto front drawn out; a click on a mark uses its
//! settings.

use std::collections::BTreeSet;

use egui::{Color32, RichText, Stroke, Ui, WidgetInfo};
use egui_plot::{HLine, Line, LineStyle, MarkerShape, PlotPoints};

use super::{
    Finding, Freshness, Lab, freshness_ui,
    marks::{Look, legend_line_ui, legend_mark_ui, mark_ui, now_ui},
    plane::{colour_of, log_log, zone_name},
    use_settings, without_settings, words,
};
use crate::{
    app::{
        panels::{health::three, simulation::title},
        session::Session,
    },
    lab::{
        Settings,
        reference::{MARGIN, Reference},
        trade::{Row, Trade},
        trial::Zone,
    },
    scene::Precision,
    simulators,
};

/// What work is counted in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Work {
    /// Springs looked at.
    #[default]
    Visits,
    /// Measured time.
    Time,
}

/// What is shown of the trade.
#[derive(Default)]
pub struct View {
    pub(super) finding: Option<Finding<Trade>>,
    work: Work,
    /// Methods that are switched off in the legend.
    hidden: BTreeSet<String>,
}

/// A row in the diagram: logarithms of work and error.
struct Mark<'a> {
    row: &'a Row,
    at: [f64; 2],
    look: Look,
    /// It has an error, so that lines and front may touch it.
    is_told: bool,
}

/// Work of a row, where it is known.
fn work_of(row: &Row, work: Work) -> Option<f64> {
    let value = match work {
        Work::Visits => Some(row.spring_visits),
        Work::Time => row.seconds_per_simulated_second,
    };
    value.filter(|value| *value > 0.0 && value.is_finite())
}

/// Errors that the reference cannot tell are below this, m.
fn floor_of(reference: Option<&Reference>) -> Option<f64> {
    reference.map(|r| MARGIN * r.uncertainty).filter(|floor| *floor > 0.0)
}

/// Where runs that burst stand: half a decade above every error.
fn edge_of(rows: &[Row]) -> f64 {
    let errors = rows.iter().filter(|row| row.health != Zone::Diverged).filter_map(|row| row.rms_error);
    let highest = errors.filter(|error| *error > 0.0).map(f64::log10).fold(f64::NEG_INFINITY, f64::max);
    if highest.is_finite() { highest + 0.5 } else { 0.0 }
}

fn marks<'a>(table: &'a Trade, view: &View) -> Vec<Mark<'a>> {
    let floor = floor_of(table.reference.as_deref());
    let edge = edge_of(&table.rows);
    let shown = table.rows.iter().filter(|row| !view.hidden.contains(&row.settings.simulator));
    let mark = |row: &'a Row| {
        let x = work_of(row, view.work)?.log10();
        let colour = colour_of(&row.settings.simulator);
        let plain = if row.settings.precision == Precision::Single {
            MarkerShape::Diamond
        } else {
            MarkerShape::Circle
        };
        let look = |shape| Look { shape, colour, filled: row.same_model };
        let told = row.rms_error.filter(|error| *error > 0.0);
        let (y, look, is_told) = match (row.health, told) {
            (Zone::Diverged, _) | (_, None) => (edge, look(MarkerShape::Cross), false),
            _ if row.below_reference => (floor?.log10(), look(MarkerShape::Down), false),
            (Zone::Unsettled, Some(error)) => (error.log10(), look(MarkerShape::Plus), true),
            (Zone::Quiet, Some(error)) => (error.log10(), look(plain), true),
        };
        Some(Mark { row, at: [x, y], look, is_told })
    };
    shown.filter_map(mark).collect()
}

/// The marks of the springs' own model that no other beats in both work and error, cheapest first. Errors below `floor`
/// (logarithm) are equal.
fn front(marks: &[Mark<'_>]) -> Vec<[f64; 2]> {
    let sound = |mark: &&Mark<'_>| {
        let is_counted = mark.is_told || mark.row.below_reference;
        mark.row.same_model && mark.row.health == Zone::Quiet && is_counted
    };
    let mut points: Vec<[f64; 2]> = marks.iter().filter(sound).map(|mark| mark.at).collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut front: Vec<[f64; 2]> = Vec::new();
    for point in points {
        if front.last().is_none_or(|last| point[1] < last[1]) {
            front.push(point);
        }
    }
    front
}

/// What is shown on the axes.
pub fn controls_ui(ui: &mut Ui, view: &mut View) {
    let has_time = view
        .finding
        .as_ref()
        .is_some_and(|f| f.table.rows.iter().any(|row| row.seconds_per_simulated_second.is_some()));
    if !has_time {
        view.work = Work::Visits;
    }
    ui.label("Against");
    ui.selectable_value(&mut view.work, Work::Visits, "Spring visits")
        .on_hover_text("Springs looked at for each simulated second: the same on every machine");
    ui.add_enabled_ui(has_time, |ui| {
        ui.selectable_value(&mut view.work, Work::Time, "Time")
            .on_hover_text(
                "Seconds of computing for each simulated second, one thread: the median of five rounds",
            )
            .on_disabled_hover_text("No time was measured yet");
    });
}

/// The tab.
pub fn ui(ui: &mut Ui, lab: &mut Lab, session: &mut Session) {
    let is_busy = lab.is_busy();
    let Some(finding) = &lab.trade.finding else {
        return lab.nothing_ui(ui, ["The converged solution comes first: every error is measured against it.", "Measure: every method, with several steps, sweeps and precisions, against a converged solution of this scene."]);
    };
    let freshness = finding.subject.freshness(session.scene(), without_settings);
    let current = Settings::of(session.scene());
    let mut used = None;
    let view = &lab.trade;
    let mut hidden = view.hidden.clone();
    egui::Panel::right("trade legend").resizable(false).exact_size(268.0).show_separator_line(false).show(
        ui,
        |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                freshness_ui(ui, freshness, finding.is_whole, is_busy);
                subject_ui(ui, finding, lab.tolerance);
                ui.separator();
                legend_ui(ui, &finding.table, &mut hidden, lab.tolerance);
            });
        },
    );
    egui::CentralPanel::no_frame().show(ui, |ui| {
        used = diagram_ui(ui, &finding.table, view, &current, lab.tolerance);
    });
    if let Some(settings) = used.filter(|_| freshness != Freshness::Elsewhere) {
        use_settings(session, &settings);
    }
    lab.trade.hidden = hidden;
}

/// What was studied, and against what.
fn subject_ui(ui: &mut Ui, finding: &Finding<Trade>, tolerance: f64) {
    let Finding { subject, table, is_disturbed, took, .. } = finding;
    ui.label(RichText::new(subject.label()).strong());
    let small = |ui: &mut Ui, text: String| ui.label(RichText::new(text).small());
    small(ui, format!("{} runs in {:.0} s", table.rows.len(), took.as_secs_f64()));
    if let Some(reference) = &table.reference {
        let text = format!(
            "Reference: {}, dt {} s, uncertain by {:.1e} m; {} is {:.1e} m off.",
            reference.method,
            three(reference.dt),
            reference.uncertainty,
            reference.second_method,
            reference.second_distance
        );
        small(ui, text);
        let text = format!(
            "Errors hold until {} s of {} s; the cloth moves by {} m (RMS).",
            three(reference.valid_until),
            subject.seconds,
            three(reference.displacement)
        );
        let tip =
            "After that time nearby trajectories have parted a hundredfold: positions are no longer compared";
        small(ui, text).on_hover_text(tip);
    }
    if table.reference.as_ref().is_some_and(|reference| reference.displacement < tolerance) {
        let text = "The cloth hardly moves from here: there is little to be wrong about. Move it, or measure from the start.";
        ui.label(RichText::new(text).small().color(super::warning(ui)));
    }
    if let Some(machine) = &table.machine {
        let text = format!("Time: one thread, {}, tenter {}", machine.processor, machine.tenter);
        small(ui, text);
    }
    if *is_disturbed {
        let text = "Times are disturbed: the simulation ran while they were measured.";
        ui.label(RichText::new(text).small().color(super::warning(ui)));
    }
}

fn legend_ui(ui: &mut Ui, table: &Trade, hidden: &mut BTreeSet<String>, tolerance: f64) {
    ui.spacing_mut().item_spacing.y = 1.0;
    let methods = simulators::ALL.iter().filter(|e| table.rows.iter().any(|r| r.settings.simulator == e.id));
    for entry in methods {
        let same_model = entry.model == simulators::Model::Springs;
        let mut on = !hidden.contains(entry.id);
        ui.horizontal(|ui| {
            let response = ui.checkbox(&mut on, "").on_hover_text(entry.summary);
            let name = format!("Show {}", title(entry.id));
            response.widget_info(|| WidgetInfo::selected(egui::Role::CheckBox, true, on, &name));
            let (rect, _) = ui.allocate_exact_size(egui::vec2(14.0, 14.0), egui::Sense::hover());
            let colour = colour_of(entry.id).gamma_multiply(if on { 1.0 } else { 0.35 });
            Look { filled: same_model, ..Look::dot(colour) }.paint(ui.painter(), rect.center(), 4.5);
            let order = table.orders.iter().find(|order| order.simulator == entry.id && order.asymptotic);
            ui.label(title(entry.id)).on_hover_text(entry.summary);
            if let Some(order) = order.filter(|_| same_model) {
                let observed = order.observed.unwrap_or_default();
                let text = RichText::new(format!("order {observed:.1}")).small().weak();
                let text = if order.flagged { text.color(super::warning(ui)) } else { text };
                let tip = format!("Observed over halvings of dt, in Double; declared {}", order.declared);
                ui.label(text).on_hover_text(tip);
            }
        });
        if on {
            hidden.remove(entry.id);
        } else {
            hidden.insert(entry.id.to_owned());
        }
    }
    ui.separator();
    let strong = ui.visuals().strong_text_color();
    let grey = ui.visuals().text_color();
    let look = |shape, filled| Look { shape, colour: grey, filled };
    legend_line_ui(ui, Stroke::new(3.0, strong), false, "Pareto front: nothing beats these in both");
    legend_line_ui(
        ui,
        Stroke::new(1.5, super::warning(ui)),
        true,
        &format!("tolerance, {} m", three(tolerance)),
    );
    legend_mark_ui(ui, look(MarkerShape::Circle, true), "double precision");
    legend_mark_ui(ui, look(MarkerShape::Diamond, true), "single precision, dotted line");
    legend_mark_ui(ui, look(MarkerShape::Plus, true), "unsettled: shakes from step to step");
    legend_mark_ui(ui, look(MarkerShape::Cross, true), "burst or given up: on the upper edge");
    legend_mark_ui(ui, look(MarkerShape::Down, true), "below what the reference can tell");
    if table.rows.iter().any(|row| !row.same_model) {
        legend_mark_ui(ui, look(MarkerShape::Circle, false), "hollow: solves another model");
        ui.label(RichText::new(ANOTHER_MODEL).small().weak());
    }
}

const ANOTHER_MODEL: &str = "Springs are taken as rigid constraints: as dt goes to 0 the cloth does not approach the springs. \
                             How stiff it looks is a matter of dt and sweeps.";

fn diagram_ui(
    ui: &mut Ui,
    table: &Trade,
    view: &View,
    current: &Settings,
    tolerance: f64,
) -> Option<Settings> {
    let marks = marks(table, view);
    let x = match view.work {
        Work::Visits => "springs looked at for each simulated second",
        Work::Time => "seconds of computing for each simulated second",
    };
    let name = if view.work == Work::Visits { "trade by visits" } else { "trade by time" };
    let (strong, accent) = (ui.visuals().strong_text_color(), super::warning(ui));
    let lines = lines(&marks);
    let front: Vec<[f64; 2]> = front(&marks);
    let edge = marks.iter().any(|mark| mark.look.shape == MarkerShape::Cross).then(|| edge_of(&table.rows));
    let has_floor = marks.iter().any(|mark| mark.look.shape == MarkerShape::Down);
    let floor = floor_of(table.reference.as_deref()).filter(|_| has_floor).map(f64::log10);
    let plot = log_log(name, x, "RMS position error, m");
    // Marks are drawn over the diagram; their places are what it is scaled to.
    let places: PlotPoints<'_> = marks.iter().map(|mark| mark.at).collect();
    let shown = plot.show(ui, |plot| {
        plot.points(
            egui_plot::Points::new("marks", places)
                .radius(0.0)
                .color(Color32::TRANSPARENT)
                .allow_hover(false),
        );
        let line = |height: f64, name: &str, colour: Color32, style| {
            HLine::new(name, height).color(colour).width(1.0).style(style).allow_hover(false)
        };
        if let Some(edge) = edge {
            plot.hline(line(edge, "edge", Color32::GRAY.gamma_multiply(0.5), LineStyle::dotted_loose()));
        }
        if let Some(floor) = floor {
            plot.hline(line(floor, "floor", Color32::GRAY.gamma_multiply(0.5), LineStyle::dotted_loose()));
        }
        plot.hline(line(tolerance.log10(), "tolerance", accent, LineStyle::dashed_dense()).width(1.5));
        lines.into_iter().for_each(|line| plot.line(line));
        if front.len() > 1 {
            plot.line(Line::new("front", front).color(strong).width(3.0).allow_hover(false));
        }
    });
    shown.response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, "Error against work"));
    let mut used = None;
    for (i, mark) in marks.iter().enumerate() {
        let name = words(&mark.row.settings);
        let id = shown.response.id.with(("mark", i));
        let Some(response) = mark_ui(ui, &shown, id, mark.at, mark.look, &name) else { continue };
        if response.clicked() {
            used = Some(mark.row.settings.clone());
        }
        response.on_hover_ui_at_pointer(|ui| row_ui(ui, mark.row, table));
    }
    if let Some(mark) = marks.iter().find(|mark| mark.row.settings == *current) {
        now_ui(ui, &shown, mark.at);
    }
    used
}

/// A line for each method, sweeps and precision, from its longest to its shortest step.
fn lines(marks: &[Mark<'_>]) -> Vec<Line<'static>> {
    let mut families: Vec<Vec<&Mark<'_>>> = Vec::new();
    for mark in marks.iter().filter(|mark| mark.is_told || mark.row.below_reference) {
        let own = &mark.row.settings;
        let is_kin = |family: &&mut Vec<&Mark<'_>>| {
            let other = &family[0].row.settings;
            (&other.simulator, &other.params, other.precision) == (&own.simulator, &own.params, own.precision)
        };
        match families.iter_mut().find(is_kin) {
            Some(family) => family.push(mark),
            None => families.push(vec![mark]),
        }
    }
    let line = |(i, mut family): (usize, Vec<&Mark<'_>>)| {
        family.sort_by(|a, b| b.row.settings.dt.total_cmp(&a.row.settings.dt));
        let points: PlotPoints<'static> = family.iter().map(|mark| mark.at).collect();
        let single = family[0].row.settings.precision == Precision::Single;
        let style = if single { LineStyle::dotted_dense() } else { LineStyle::Solid };
        let colour = family[0].look.colour.gamma_multiply(0.75);
        Line::new(format!("line {i}"), points).color(colour).style(style).width(1.2).allow_hover(false)
    };
    families.into_iter().enumerate().map(line).collect()
}

/// Everything about a row.
fn row_ui(ui: &mut Ui, row: &Row, table: &Trade) {
    ui.set_max_width(340.0);
    ui.label(RichText::new(words(&row.settings)).strong());
    egui::Grid::new("row").num_columns(2).spacing([12.0, 2.0]).show(ui, |ui| {
        let mut line = |name: &str, text: String| {
            ui.label(name);
            ui.label(text);
            ui.end_row();
        };
        let metres = |error: f64| format!("{} m", three(error));
        match (row.rms_error, row.relative_error) {
            _ if row.below_reference => line("RMS error", "below what the reference can tell".to_owned()),
            (Some(rms), Some(relative)) => {
                line("RMS error", format!("{} m, {} % of the motion", three(rms), three(100.0 * relative)));
            }
            _ if row.capped => line("RMS error", "none: given up, as its work passed the cap".to_owned()),
            _ => line("RMS error", "none: it burst before the end".to_owned()),
        }
        if let Some(largest) = row.max_error.filter(|_| !row.below_reference) {
            line("Largest error", metres(largest));
        }
        if let Some(error) = row.equilibrium_error {
            line("Off equilibrium", metres(error));
        }
        if let Some(error) = row.limit_error {
            line("Off its own limit", format!("{} % of the motion", three(100.0 * error)));
        }
        if let Some(strain) = row.max_strain {
            line("Largest strain", format!("{} %", three(100.0 * strain)));
        }
        if let Some(drift) = row.energy_drift {
            line("Energy drift", format!("{} %", three(100.0 * drift)));
        }
        line("Spring visits", format!("{} /s", three(row.spring_visits)));
        line("Force evaluations", format!("{} /s", three(row.force_evaluations)));
        if let Some((time, [fast, slow])) = row.seconds_per_simulated_second.zip(row.seconds_spread) {
            line("Time", format!("{} s/s ({} to {})", three(time), three(fast), three(slow)));
        }
        let own = |order: &&crate::lab::trade::Order| {
            order.simulator == row.settings.simulator && order.params == row.settings.params
        };
        if let Some(order) = table.orders.iter().find(own).filter(|_| row.same_model) {
            line("Order", format!("{}, declared {}", order.told(), order.declared));
        }
        line("Health", zone_name(row.health).to_owned());
    });
    if !row.same_model {
        ui.label(RichText::new(ANOTHER_MODEL).small());
    }
    ui.label(RichText::new("Click: use these settings").small().weak());
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn row(simulator: &str, visits: f64, error: Option<f64>, health: Zone) -> Row {
        Row {
            settings: Settings { params: BTreeMap::new(), ..Settings::double(simulator, 0.01) },
            rms_error: error,
            max_error: error,
            relative_error: error,
            below_reference: false,
            equilibrium_error: None,
            limit_error: None,
            energy_drift: None,
            max_strain: None,
            force_evaluations: visits,
            spring_visits: visits,
            seconds_per_simulated_second: None,
            seconds_spread: None,
            same_model: simulator != "verlet",
            health,
            capped: false,
            statistics: None,
            pareto: false,
        }
    }

    #[test]
    fn the_front_holds_what_nothing_beats_and_bursts_stand_on_the_edge() {
        let rows = vec![
            row("rk4", 1e4, Some(1e-3), Zone::Quiet),
            row("rk4", 1e3, Some(1e-2), Zone::Quiet),
            row("symplectic_euler", 2e3, Some(1e-1), Zone::Quiet),
            row("verlet", 1e2, Some(1e-4), Zone::Quiet),
            row("velocity_verlet", 5e2, Some(1e-5), Zone::Unsettled),
            row("explicit_euler", 1e2, None, Zone::Diverged),
        ];
        let table = Trade { reference: None, rows, orders: Vec::new(), missing: 0, machine: None };
        let marks = marks(&table, &View::default());
        assert_eq!(marks.len(), 6);
        assert_eq!(front(&marks), [[3.0, -2.0], [4.0, -3.0]]);
        assert_eq!(marks[5].at[1], -0.5);
        let hidden = View { hidden: ["rk4".to_owned()].into(), ..View::default() };
        assert_eq!(super::marks(&table, &hidden).len(), 4);
    }
}
