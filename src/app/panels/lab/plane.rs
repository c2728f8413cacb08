//! Logarithmic diagrams: their axes, and the colours of methods and zones.

use egui::Color32;
use egui_plot::{GridMark, Plot};

use crate::{
    app::panels::health::three,
    lab::{report::method_colour, trial::Zone},
};

/// The colour of a method, as in reports.
pub fn colour_of(simulator: &str) -> Color32 {
    let [r, g, b] = method_colour(simulator);
    Color32::from_rgb(r, g, b)
}

/// The colour of a zone: green, amber, red, as in the health panel.
pub fn zone_colour(zone: Zone) -> Color32 {
    match zone {
        Zone::Quiet => Color32::from_rgb(90, 180, 110),
        Zone::Unsettled => Color32::from_rgb(230, 170, 60),
        Zone::Diverged => Color32::from_rgb(220, 80, 70),
    }
}

/// What a zone is called.
pub fn zone_name(zone: Zone) -> &'static str {
    match zone {
        Zone::Quiet => "quiet",
        Zone::Unsettled => "unsettled",
        Zone::Diverged => "diverged",
    }
}

/// A diagram of decimal logarithms, with decades as its grid.
pub fn log_log<'a>(name: &'a str, x: &'a str, y: &'a str) -> Plot<'a> {
    Plot::new(name)
        .x_axis_label(x)
        .y_axis_label(y)
        .x_grid_spacer(|input| decades(input.bounds))
        .y_grid_spacer(|input| decades(input.bounds))
        .x_axis_formatter(|mark, range| tick(mark, range.end() - range.start()))
        .y_axis_formatter(|mark, range| tick(mark, range.end() - range.start()))
        .y_axis_min_width(46.0)
        .grid_color(Color32::GRAY.gamma_multiply(0.4))
        .show_x(false)
        .show_y(false)
        .show_crosshair(false)
        .allow_boxed_zoom(false)
        .set_margin_fraction(egui::vec2(0.04, 0.06))
}

/// Grid lines at powers of ten, and between them where there is room.
fn decades(bounds: (f64, f64)) -> Vec<GridMark> {
    let (low, high) = (bounds.0.floor() as i32, bounds.1.ceil() as i32);
    // A diagram that is not laid out yet has no sensible bounds.
    if !(0..=60).contains(&(high - low)) {
        return Vec::new();
    }
    let mut marks: Vec<GridMark> = Vec::new();
    for decade in low..=high {
        // Where many decades leave no room for all labels, every third has one.
        let step_size = if high - low > 8 && decade % 3 == 0 { 3.0 } else { 1.0 };
        marks.push(GridMark { value: f64::from(decade), step_size });
        if high - low <= 8 {
            let between = (2..10).map(|n| f64::from(decade) + f64::from(n).log10());
            marks.extend(between.map(|value| GridMark { value, step_size: 0.12 }));
        }
    }
    marks.retain(|mark| (bounds.0..=bounds.1).contains(&mark.value));
    marks
}

fn tick(mark: GridMark, span: f64) -> String {
    let digit = 10_f64.powf(mark.value - mark.value.floor()).round();
    if (mark.value - mark.value.round()).abs() < 1e-9 {
        power(mark.value.round() as i32)
    } else if span < 1.7 && (digit == 2.0 || digit == 5.0) {
        three(10_f64.powf(mark.value)).to_string()
    } else {
        String::new()
    }
}

/// A power of ten, as a plain number where that is short.
fn power(exponent: i32) -> String {
    match exponent {
        -2..=3 => format!("{}", 10_f64.powi(exponent)),
        _ => format!("1e{exponent}"),
    }
}
