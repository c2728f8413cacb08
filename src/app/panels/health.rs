//! Whether the simulation can be trusted: dt against its limit, energies and strain over time, cost against real time.

use egui::{Color32, RichText, Ui, WidgetInfo};
use egui_plot::{AxisHints, Line, Plot, PlotPoints};

use crate::app::{
    engine::{LaneState, Limit},
    session::Session,
    trace::Sample,
};

const KINETIC: Color32 = Color32::from_rgb(86, 160, 240);
const GRAVITATIONAL: Color32 = Color32::from_rgb(150, 120, 220);
const ELASTIC: Color32 = Color32::from_rgb(240, 160, 70);
const TOTAL: Color32 = Color32::from_rgb(150, 156, 166);
const LARGEST: Color32 = Color32::from_rgb(226, 88, 84);
const MEAN: Color32 = Color32::from_rgb(100, 190, 120);

/// A colour to be read on the panel: darker on a light one.
fn readable(ui: &Ui, colour: Color32) -> Color32 {
    if ui.visuals().dark_mode { colour } else { colour.lerp_to_gamma(Color32::BLACK, 0.35) }
}

/// The panel.
pub fn health_ui(ui: &mut Ui, session: &Session) {
    let Some(lane) = session.lane_state() else { return };
    gauge(ui, lane);
    pace(ui, lane);
    egui::Grid::new("health").num_columns(2).spacing([12.0, 2.0]).show(ui, |ui| {
        let mut row = |name: &str, colour: Option<Color32>, value: String, tip: &str| {
            let text = RichText::new(name);
            let text = colour.map_or(text.clone(), |colour| text.color(readable(ui, colour)));
            ui.label(text).on_hover_text(tip);
            ui.monospace(value);
            ui.end_row();
        };
        let energy = lane.measures.energy;
        row("Kinetic", Some(KINETIC), format!("{:.4e} J", energy.kinetic), "Σ m v² / 2");
        row("Gravitational", Some(GRAVITATIONAL), format!("{:.4e} J", energy.gravitational), "Σ m g y");
        row("Elastic", Some(ELASTIC), format!("{:.4e} J", energy.elastic), "Σ k (|d| - L)² / 2");
        row("Total", Some(TOTAL), format!("{:.4e} J", energy.total()), "Their sum");
    });
    let samples: Vec<&Sample> = session.trace.lane(session.lane).collect();
    plot(
        ui,
        "Energy over time",
        &samples,
        &[
            ("kinetic", KINETIC, |s| s.energy.kinetic),
            ("gravitational", GRAVITATIONAL, |s| s.energy.gravitational),
            ("elastic", ELASTIC, |s| s.energy.elastic),
            ("total", TOTAL, |s| s.energy.total()),
        ],
    );
    egui::Grid::new("strain").num_columns(2).spacing([12.0, 2.0]).show(ui, |ui| {
        let tip = "|d|/L - 1 over the springs that act";
        let rows = [
            ("Largest strain", LARGEST, lane.measures.max_strain),
            ("Mean strain", MEAN, lane.measures.mean_strain),
        ];
        for (name, colour, strain) in rows {
            ui.label(RichText::new(name).color(readable(ui, colour))).on_hover_text(tip);
            // Rounded first: a little below zero is no "-0.00".
            ui.monospace(format!("{:.2} %", (1e4 * strain).round() / 100.0 + 0.0));
            ui.end_row();
        }
        ui.label("Torn springs").on_hover_text("Broken for good, until a reset or an undo");
        ui.monospace(lane.broken.to_string());
        ui.end_row();
    });
    plot(
        ui,
        "Strain over time",
        &samples,
        &[("largest %", LARGEST, |s| 100.0 * s.max_strain), ("mean %", MEAN, |s| 100.0 * s.mean_strain)],
    );
}

type Series = (&'static str, Color32, fn(&Sample) -> f64);

fn plot(ui: &mut Ui, name: &str, samples: &[&Sample], series: &[Series]) {
    let lines: Vec<Line<'_>> = series
        .iter()
        .map(|(name, colour, value)| {
            let points: PlotPoints<'_> = samples.iter().map(|s| [s.time, value(s)]).collect();
            Line::new(*name, points).color(*colour).width(1.5)
        })
        .collect();
    let [times, values] = [
        room(samples.iter().map(|s| s.time)),
        room(samples.iter().flat_map(|s| series.iter().map(move |(_, _, value)| value(s)))),
    ];
    let plot = times.into_iter().flatten().fold(Plot::new(name), Plot::include_x);
    let shown = values
        .into_iter()
        .flatten()
        .fold(plot, Plot::include_y)
        .height(96.0)
        .show_axes([true, true])
        .custom_y_axes(vec![
            AxisHints::new_y()
                .min_thickness(38.0)
                .label_spacing(egui::Rangef::new(12.0, 24.0))
                .formatter(|mark, _| short(mark.value)),
        ])
        .x_axis_formatter(|mark, _| format!("{} s", crate::params::Short(mark.value)))
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .show(ui, |plot| lines.into_iter().for_each(|line| plot.line(line)));
    shown.response.widget_info(|| WidgetInfo::labeled(egui::Role::Label, true, name));
}

/// What an axis must show beside these numbers where they differ by no more than rounding: the plot cannot divide nothing.
fn room(numbers: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let [low, high] =
        numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
    let size = low.abs().max(high.abs());
    let pad = if size > 0.0 { 1e-3 * size } else { 1.0 };
    (high >= low && high - low < pad).then_some([low - pad, high + pad])
}

/// Three digits.
pub fn three(value: f64) -> crate::params::Short {
    crate::params::Short(format!("{value:.2e}").parse().unwrap_or(value))
}

/// At most six letters: the axis is narrow.
fn short(value: f64) -> String {
    let size = value.abs();
    if size >= 1e4 || (size > 0.0 && size < 1e-2) { format!("{value:.0e}") } else { format!("{value}") }
}

/// Green well below 1, amber near it, red above.
fn colour_of(part: f32) -> Color32 {
    match part {
        p if p < 0.8 => Color32::from_rgb(90, 180, 110),
        p if p <= 1.0 => Color32::from_rgb(230, 170, 60),
        _ => Color32::from_rgb(220, 80, 70),
    }
}

fn bar(ui: &mut Ui, name: &str, part: f32, text: String, tip: &str) {
    let shown = if part.is_finite() { part.clamp(0.0, 1.0) } else { 1.0 };
    let bar = egui::ProgressBar::new(shown).fill(colour_of(part)).corner_radius(2.0).desired_height(7.0);
    let response = ui.add(bar);
    response.widget_info(|| WidgetInfo::labeled(egui::Role::ProgressIndicator, true, name));
    ui.label(RichText::new(text).small()).on_hover_text(tip);
}

/// dt as a part of the largest stable one.
fn gauge(ui: &mut Ui, lane: &LaneState) {
    let dt = lane.scene.dt;
    let tip = "Largest stable dt in theory, for small motions around the current shape";
    let (part, text) = match lane.limit {
        Limit::Unknown => (0.0, format!("dt {dt} s: the stability limit is being computed")),
        Limit::None => (0.0, format!("dt {dt} s: no stability limit; a longer dt costs less")),
        Limit::At(limit) if limit > 0.0 => {
            let part = dt / limit;
            (
                part as f32,
                format!("dt {dt} s is {:.0} % of the stability limit {} s", 100.0 * part, three(limit)),
            )
        }
        Limit::At(_) => (f32::INFINITY, format!("dt {dt} s: this method is stable at no dt here")),
    };
    bar(ui, "dt against the stability limit", part, text, tip);
}

/// Computing time of a step as a part of the time that it simulates.
fn pace(ui: &mut Ui, lane: &LaneState) {
    let step = lane.cost * lane.scene.dt * 1000.0;
    let text = format!("{step:.3} ms a step, {:.0} % of real time", 100.0 * lane.cost);
    bar(
        ui,
        "Time per step against real time",
        lane.cost as f32,
        text,
        "Computing time of a step, and as a part of the time that it simulates; above 100 % it becomes slow motion",
    );
}

#[cfg(test)]
mod tests {
    use super::room;

    #[test]
    fn an_axis_has_room_for_numbers_that_are_alike() {
        for numbers in [[1700.0, 1700.0], [1e20, 1e20], [0.0, 0.0], [-3e-19, 4e-19], [1e-300, 1e-300]] {
            let [low, high] = room(numbers.into_iter()).unwrap_or(numbers);
            assert!(low < high && high - low > 1e-6 * low.abs(), "{numbers:?}: {low} to {high}");
        }
        assert_eq!(room([0.0, 1.0].into_iter()), None);
        assert_eq!(room([].into_iter()), None);
    }
}
