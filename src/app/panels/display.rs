//! What the viewport shows, and in which colours.

use egui::{Align2, Color32, FontId, Rect, Slider, Ui, WidgetInfo, pos2, vec2};

use std::sync::Arc;

use crate::app::{
    engine::LaneState,
    render::{Ramp, Style, Theme},
};

/// What is shown besides the style: how lanes lie, and whether their distance colours them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Display {
    /// All lanes in one picture instead of one each.
    pub overlaid: bool,
    /// The cloth is coloured by its distance from the reference lane.
    pub distance: bool,
    /// Distance that gets the last colour of the ramp, m.
    pub distance_range: f32,
    /// That is the largest distance that there is, rounded up.
    pub range_follows: bool,
}

impl Display {
    /// Lets the range follow the distances of the lanes.
    pub fn follow(&mut self, lanes: &[Arc<LaneState>]) {
        let largest = lanes.iter().filter_map(|lane| lane.distance).map(|[_, most]| most).fold(0.0, f64::max);
        if self.range_follows && largest > 0.0 && largest.is_finite() {
            self.distance_range = round_up(largest) as f32;
        }
    }
}

/// The next of 1, 2 and 5 times a power of ten: a range that changed with every picture would make the colours flicker.
fn round_up(value: f64) -> f64 {
    let power = 10_f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0].into_iter().map(|digit| digit * power).find(|step| *step >= value).unwrap_or(10.0 * power)
}

impl Default for Display {
    fn default() -> Self {
        Self { overlaid: false, distance: false, distance_range: 1.0, range_follows: true }
    }
}

/// The panel.
pub fn display_ui(ui: &mut Ui, style: &mut Style, display: &mut Display, lanes: usize) {
    ui.checkbox(&mut style.surface, "Surface").on_hover_text("The lit cloth");
    ui.add_enabled_ui(style.surface, |ui| {
        ui.checkbox(&mut style.edges, "Edges of the faces")
            .on_hover_text("Without the diagonals inside of quads");
        ui.checkbox(&mut style.surface_values, "Surface by strain")
            .on_hover_text("Mean strain of the springs around each particle");
    });
    ui.checkbox(&mut style.particles, "Particles")
        .on_hover_text("Pinned, grabbed and selected ones are always shown");
    slider(
        ui,
        "Particle size",
        &mut style.particle_size,
        0.02..=0.5,
        "Radius as a part of the mean spring length",
    );
    ui.add_space(4.0);
    for (kind, name) in ["Stretch springs", "Shear springs", "Bend springs"].into_iter().enumerate() {
        ui.horizontal(|ui| {
            let colour = ui.color_edit_button_srgb(&mut style.colours.springs[kind]);
            colour.widget_info(|| {
                WidgetInfo::labeled(egui::Role::ColorWell, true, format!("Colour of {name}"))
            });
            ui.checkbox(&mut style.springs[kind], name)
                .on_hover_text("Shown as lines while this kind is enabled");
        });
    }
    slider(ui, "Line width", &mut style.line_width, 0.5..=6.0, "Points");
    ui.checkbox(&mut style.spring_strain, "Springs by strain")
        .on_hover_text("Colours every spring by |d|/L - 1 instead of by its kind");
    ui.add_enabled_ui(style.spring_strain || style.surface_values, |ui| {
        slider(
            ui,
            "Strain range",
            &mut style.value_range,
            0.001..=2.0,
            "Strain that gets the last colour of the ramp",
        );
    });
    if lanes > 1 {
        ui.checkbox(&mut display.distance, "Surface by distance")
            .on_hover_text("Distance of every particle from the reference lane");
        ui.add_enabled_ui(display.distance, |ui| {
            ui.checkbox(&mut display.range_follows, "Range follows the largest")
                .on_hover_text("The largest distance that there is, rounded up, gets the last colour");
        });
        ui.add_enabled_ui(display.distance && !display.range_follows, |ui| {
            let tip = "Distance that gets the last colour of the ramp, m";
            slider(ui, "Distance range", &mut display.distance_range, 1e-6..=100.0, tip);
        });
    }
    ui.add_space(4.0);
    ui.checkbox(&mut style.ground, "Ground grid")
        .on_hover_text("Its cells follow the view: a power of ten, in m");
    ui.add_enabled_ui(style.ground, |ui| {
        ui.checkbox(&mut style.axes, "Axes").on_hover_text("x red, z blue, on the ground");
        ui.checkbox(&mut style.shadow, "Shadow").on_hover_text("Of the cloth on the ground");
    });
    ui.horizontal(|ui| {
        ui.label("Theme");
        ui.selectable_value(&mut style.theme, Theme::Dark, "Dark").on_hover_text("T");
        ui.selectable_value(&mut style.theme, Theme::Light, "Light").on_hover_text("T");
    });
    ui.collapsing("Colours", |ui| {
        let colours = &mut style.colours;
        let named = [
            ("Front", &mut colours.front),
            ("Back", &mut colours.back),
            ("Edges", &mut colours.edges),
            ("Particles", &mut colours.particle),
            ("Pinned", &mut colours.pinned),
            ("Grabbed", &mut colours.grabbed),
            ("Selected", &mut colours.selected),
        ];
        for (name, colour) in named {
            ui.horizontal(|ui| {
                let button = ui.color_edit_button_srgb(colour);
                button.widget_info(|| {
                    WidgetInfo::labeled(egui::Role::ColorWell, true, format!("Colour {name}"))
                });
                ui.label(name);
            });
        }
        if ui.button("Default colours").clicked() {
            *colours = crate::app::render::Colours::default();
        }
    });
}

fn slider(ui: &mut Ui, name: &str, value: &mut f32, range: std::ops::RangeInclusive<f32>, tip: &str) {
    ui.horizontal(|ui| {
        let height = ui.spacing().interact_size.y;
        ui.add_sized([88.0, height], egui::Label::new(name).truncate());
        ui.spacing_mut().slider_width = (ui.available_width() - 70.0).clamp(40.0, 160.0);
        let shown = f64::from(*value);
        let slider = ui.add(Slider::new(value, range).logarithmic(true).max_decimals(3));
        slider.widget_info(|| WidgetInfo::slider(true, shown, name));
        slider.on_hover_text(tip);
    });
}

/// What the colours mean, in a corner of the viewport.
pub fn legend_ui(ui: &Ui, viewport: Rect, style: &Style, display: &Display) {
    let by_distance = style.ramp == Ramp::Distance;
    if !(style.surface_values || style.spring_strain) {
        return;
    }
    let size = vec2(200.0, 10.0);
    let rect = Rect::from_min_size(viewport.right_bottom() - size - vec2(18.0, 30.0), size);
    let painter = ui.painter_at(viewport);
    painter.rect_filled(
        rect.expand2(vec2(10.0, 8.0)).with_max_y(rect.max.y + 22.0).with_min_y(rect.min.y - 22.0),
        4.0,
        ui.visuals().panel_fill.gamma_multiply(0.8),
    );
    let (steps, first) = (64, if by_distance { 0.0 } else { -1.0 });
    for i in 0..steps {
        let part = (i as f32 + 0.5) / steps as f32;
        let [r, g, b] = style.ramp.colour(first + (1.0 - first) * part);
        let cell = Rect::from_min_size(
            pos2(rect.left() + size.x * i as f32 / steps as f32, rect.top()),
            vec2(size.x / steps as f32 + 0.5, size.y),
        );
        painter.rect_filled(cell, 0.0, Color32::from_rgb(r, g, b));
    }
    let colour = ui.visuals().text_color();
    let text = |at, align, text: String| painter.text(at, align, text, FontId::proportional(11.0), colour);
    let below = rect.bottom() + 4.0;
    if by_distance {
        let name = "distance from the reference lane".to_owned();
        text(rect.center_top() - vec2(0.0, 4.0), Align2::CENTER_BOTTOM, name);
        text(pos2(rect.left(), below), Align2::LEFT_TOP, "0".to_owned());
        text(
            pos2(rect.right(), below),
            Align2::RIGHT_TOP,
            format!("{} m", crate::params::Short(f64::from(display.distance_range))),
        );
    } else {
        let percent = |value: f32| format!("{:+.1} %", value * 100.0);
        text(rect.center_top() - vec2(0.0, 4.0), Align2::CENTER_BOTTOM, "strain".to_owned());
        text(pos2(rect.left(), below), Align2::LEFT_TOP, percent(-style.value_range));
        text(pos2(rect.center().x, below), Align2::CENTER_TOP, "0".to_owned());
        text(pos2(rect.right(), below), Align2::RIGHT_TOP, percent(style.value_range));
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_range_is_rounded_up() {
        for (value, expected) in [(0.0123, 0.02), (0.3, 0.5), (1.0, 1.0), (7.0, 10.0), (2.1e-9, 5e-9)] {
            let range = super::round_up(value);
            assert!((range / expected - 1.0).abs() < 1e-12, "{value}: {range}");
        }
    }
}
