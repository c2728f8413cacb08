//! The map of a method's zones over stiffness or damping and dt, with the limit in theory and the guaranteed one; a click
//! sets both.

use egui::{Color32, RichText, Stroke, Ui, WidgetInfo};
use egui_plot::{Line, LineStyle, MarkerShape, PlotPoints, Polygon};

use super::{
    Finding, Freshness, Lab, freshness_ui,
    marks::{Look, legend_line_ui, legend_mark_ui, mark_ui, now_ui},
    plane::{log_log, zone_colour, zone_name},
};
use crate::{
    app::{
        panels::{health::three, simulation::title},
        session::Session,
    },
    lab::{
        stability::{Axis, Boundary, Cell, Stability},
        trial::Zone,
    },
    scene::Scene,
    simulators::{self, SimulatorSettings},
};

/// What is asked and shown of stability.
pub struct View {
    pub(super) finding: Option<Finding<Stability>>,
    pub(super) axis: Axis,
    /// The method to be mapped; none for that of the scene.
    chosen: Option<&'static str>,
}

impl Default for View {
    fn default() -> Self {
        Self { finding: None, axis: Axis::Stiffness, chosen: None }
    }
}

impl View {
    /// The method to be mapped.
    pub(super) fn method(&self, scene: &Scene) -> String {
        self.chosen.map_or_else(|| scene.simulator.id.clone(), str::to_owned)
    }
}

fn value_of(axis: Axis, scene: &Scene) -> f64 {
    match axis {
        Axis::Stiffness => scene.springs.stretch.stiffness,
        Axis::Damping => scene.springs.damping,
    }
}

fn set(axis: Axis, scene: &mut Scene, value: f64) {
    match axis {
        Axis::Stiffness => scene.springs.stretch.stiffness = value,
        Axis::Damping => scene.springs.damping = value,
    }
}

fn unit(axis: Axis) -> &'static str {
    match axis {
        Axis::Stiffness => "N/m",
        Axis::Damping => "kg/s",
    }
}

/// What a table was mapped against.
fn axis_of(table: &Stability) -> Axis {
    let damped = table.boundaries.iter().any(|b| b.along == "damping");
    if damped { Axis::Damping } else { Axis::Stiffness }
}

/// Which method, and dt against what.
pub fn controls_ui(ui: &mut Ui, view: &mut View, session: &Session) {
    let own = &session.scene().simulator.id;
    let name = |id: &str| if id == own { format!("{} (the scene's)", title(id)) } else { title(id) };
    let now = view.method(session.scene());
    ui.label("Method");
    let combo = egui::ComboBox::from_id_salt("mapped method").width(190.0).selected_text(name(&now));
    let combo = combo.height(400.0).show_ui(ui, |ui| {
        for entry in simulators::ALL {
            if ui.selectable_label(now == entry.id, name(entry.id)).clicked() {
                view.chosen = (entry.id != own).then_some(entry.id);
            }
        }
    });
    combo.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, "Method to map"));
    ui.separator();
    ui.label("dt against");
    ui.selectable_value(&mut view.axis, Axis::Stiffness, "Stiffness")
        .on_hover_text("Stiffness of the stretch springs, N/m");
    let is_damped = session.scene().springs.damping > 0.0;
    if !is_damped {
        view.axis = Axis::Stiffness;
    }
    ui.add_enabled_ui(is_damped, |ui| {
        ui.selectable_value(&mut view.axis, Axis::Damping, "Damping")
            .on_hover_text("Damping of the springs, kg/s")
            .on_disabled_hover_text("The scene's springs have no damping to vary");
    });
}

/// The tab.
pub fn ui(ui: &mut Ui, lab: &mut Lab, session: &mut Session) {
    let is_busy = lab.is_busy();
    let Some(finding) = &lab.stability.finding else {
        return lab.nothing_ui(ui, ["Limits first, then the map: its boundaries are found by bisection.", "Measure: what becomes of this scene at other steps and stiffnesses, and what theory says of it."]);
    };
    let axis = axis_of(&finding.table);
    let freshness = finding.subject.freshness(session.scene(), |scene| {
        super::without_settings(scene);
        set(axis, scene, 0.0);
    });
    let scene = session.scene().clone();
    let method = finding.table.limits.first().map(|limit| limit.simulator.clone());
    let mut wanted = None;
    egui::Panel::right("stability legend")
        .resizable(false)
        .exact_size(268.0)
        .show_separator_line(false)
        .show(ui, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                freshness_ui(ui, freshness, finding.is_whole, is_busy);
                subject_ui(ui, finding, &scene);
                ui.separator();
                legend_ui(ui, &finding.table, axis);
            });
        });
    egui::CentralPanel::no_frame().show(ui, |ui| {
        wanted = map_ui(ui, &finding.table, axis, &scene);
    });
    if let (Some([value, dt]), Some(method)) = (wanted, method)
        && freshness != Freshness::Elsewhere
    {
        let mut next = Scene { dt, ..scene.clone() };
        set(axis, &mut next, value);
        if next.simulator.id != method {
            next.simulator = SimulatorSettings::new(&method);
        }
        let what = if axis == Axis::Stiffness { "stiffness" } else { "damping" };
        session
            .become_scene(&format!("dt {} s and {what} {} {}", three(dt), three(value), unit(axis)), &next);
    }
}

fn subject_ui(ui: &mut Ui, finding: &Finding<Stability>, scene: &Scene) {
    let Finding { subject, table, .. } = finding;
    ui.label(RichText::new(subject.label()).strong());
    let Some(limit) = table.limits.first() else { return };
    ui.label(title(&limit.simulator));
    egui::Grid::new("limits").num_columns(2).spacing([12.0, 2.0]).show(ui, |ui| {
        let mut line = |name: &str, text: String, tip: &str| {
            ui.label(name).on_hover_text(tip);
            ui.label(text);
            ui.end_row();
        };
        let longest = |dt: Option<f64>| match dt {
            None => "no limit".to_owned(),
            Some(dt) if dt > 0.0 => format!("dt < {} s", three(dt)),
            Some(_) => "never stable".to_owned(),
        };
        line("Theory", longest(limit.dt_theory), "The method's region of stability on the motions of the present shape");
        let tip = "The method's own steps around the present shape, held fast: where a small disturbance starts to grow";
        line("Measured", longest(limit.dt_measured), tip);
        line("Guaranteed", longest(limit.dt_guaranteed), "Below this it is stable in any shape");
        line("dt now", format!("{} s", three(scene.dt)), "That of the open scene");
        let omega = format!("{} rad/s", three(table.omega_max));
        line("Fastest motion", omega, "Largest natural frequency of the present shape");
        line("In any shape", format!("≤ {} rad/s", three(table.omega_bound)), "A bound on it");
    });
}

fn legend_ui(ui: &mut Ui, table: &Stability, axis: Axis) {
    ui.spacing_mut().item_spacing.y = 1.0;
    let look = |zone| Look { shape: MarkerShape::Circle, colour: zone_colour(zone), filled: true };
    legend_mark_ui(ui, look(Zone::Quiet), "quiet");
    legend_mark_ui(ui, look(Zone::Unsettled), "unsettled: shakes from step to step");
    legend_mark_ui(ui, look(Zone::Diverged), "diverged: burst");
    let strong = ui.visuals().strong_text_color();
    if table.boundaries.iter().any(|b| b.theory.is_some()) {
        legend_line_ui(ui, Stroke::new(2.5, strong), false, "limit in theory, for the shape as it was");
        legend_line_ui(ui, Stroke::new(1.5, strong), true, "guaranteed in any shape");
    } else {
        ui.label(RichText::new("Theory sets no limit to this method.").small());
    }
    let what = if axis == Axis::Stiffness { "stiffness" } else { "damping" };
    let text = format!(
        "Marks are runs; between them boundaries are interpolated. The cross is what is set now; a click sets dt and {what}."
    );
    ui.label(RichText::new(text).small().weak());
}

/// The boundaries of a column of the map, logarithms: quiet up to the first, diverged from the second.
fn column(boundary: &Boundary, cells: &[Cell], axis: Axis, [low, high]: [f64; 2]) -> [f64; 3] {
    let value = |cell: &Cell| match axis {
        Axis::Stiffness => cell.stiffness,
        Axis::Damping => cell.damping,
    };
    let own = || cells.iter().filter(|cell| (value(cell) / boundary.at - 1.0).abs() < 1e-9);
    let is_quiet = own().all(|cell| cell.zone == Zone::Quiet);
    let quiet = match boundary.quiet_until {
        _ if is_quiet => high,
        Some(dt) => dt.log10(),
        None => low,
    };
    let diverged = boundary.diverged_from.map_or(high, f64::log10);
    [boundary.at.log10(), quiet, diverged.max(quiet)]
}

/// Returns what was clicked: the axis' value and dt.
fn map_ui(ui: &mut Ui, table: &Stability, axis: Axis, scene: &Scene) -> Option<[f64; 2]> {
    let place = |cell: &Cell| {
        let value = if axis == Axis::Stiffness { cell.stiffness } else { cell.damping };
        [value, cell.dt]
    };
    let logs = |[x, y]: [f64; 2]| [x.log10(), y.log10()];
    let heights = || table.map.iter().map(|cell| cell.dt.log10());
    let span =
        [heights().fold(f64::INFINITY, f64::min) - 0.1, heights().fold(f64::NEG_INFINITY, f64::max) + 0.1];
    let mut along_dt: Vec<&Boundary> =
        table.boundaries.iter().filter(|b| b.along == "dt" && b.at > 0.0).collect();
    along_dt.sort_by(|a, b| a.at.total_cmp(&b.at));
    let columns: Vec<[f64; 3]> = along_dt.iter().map(|b| column(b, &table.map, axis, span)).collect();
    let line = |of: fn(&Boundary) -> Option<f64>| -> PlotPoints<'static> {
        let points =
            along_dt.iter().filter_map(|b| Some([b.at.log10(), of(b).filter(|dt| *dt > 0.0)?.log10()]));
        points.collect()
    };
    let (theory, guaranteed) = (line(|b| b.theory), line(|b| b.guaranteed));
    let strong = ui.visuals().strong_text_color();
    let x = match axis {
        Axis::Stiffness => "stiffness of the stretch springs, N/m",
        Axis::Damping => "damping of the springs, kg/s",
    };
    let name = if axis == Axis::Stiffness { "map of stiffness" } else { "map of damping" };
    let now = [value_of(axis, scene), scene.dt];
    let shown = log_log(name, x, "dt, s").show(ui, |plot| {
        for (i, ends) in columns.windows(2).enumerate() {
            let [a, b] = [ends[0], ends[1]];
            let bands = [
                (Zone::Quiet, [span[0], span[0]], [a[1], b[1]]),
                (Zone::Unsettled, [a[1], b[1]], [a[2], b[2]]),
                (Zone::Diverged, [a[2], b[2]], [span[1], span[1]]),
            ];
            for (zone, low, high) in bands {
                let corners = vec![[a[0], low[0]], [b[0], low[1]], [b[0], high[1]], [a[0], high[0]]];
                let colour = zone_colour(zone).gamma_multiply(0.45);
                let band = Polygon::new(format!("{} {i}", zone_name(zone)), PlotPoints::from(corners));
                plot.polygon(band.fill_color(colour).stroke(Stroke::NONE).allow_hover(false));
            }
        }
        plot.line(Line::new("theory", theory).color(strong).width(2.5).allow_hover(false));
        let dashed = Line::new("guaranteed", guaranteed).color(strong).width(1.5).allow_hover(false);
        plot.line(dashed.style(LineStyle::dashed_dense()));
        if now[0] > 0.0 && now[1] > 0.0 {
            // So that it is in the picture.
            let points = egui_plot::Points::new("now", vec![logs(now)]).radius(0.0);
            plot.points(points.color(Color32::TRANSPARENT).allow_hover(false));
        }
    });
    shown.response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, "Map of zones"));
    let mut wanted = None;
    for (i, cell) in table.map.iter().enumerate() {
        let [value, dt] = place(cell);
        if value <= 0.0 {
            continue;
        }
        let name = format!("dt {} s, {} {}: {}", three(dt), three(value), unit(axis), zone_name(cell.zone));
        let look = Look::dot(zone_colour(cell.zone));
        let id = shown.response.id.with(("cell", i));
        if let Some(response) = mark_ui(ui, &shown, id, logs([value, dt]), look, &name) {
            if response.clicked() {
                wanted = Some([value, dt]);
            }
            response.on_hover_text_at_pointer(format!("{name}\nClick: set both"));
        }
    }
    if now[0] > 0.0 && now[1] > 0.0 {
        now_ui(ui, &shown, logs(now));
    }
    if shown.response.clicked()
        && let Some(at) = shown.response.interact_pointer_pos()
    {
        let point = shown.transform.value_from_position(at);
        // Three digits: what a click can mean.
        let near = |log: f64| three(10_f64.powf(log)).0;
        wanted = Some([near(point.x), near(point.y)]);
    }
    wanted
}
