//! What the viewport shows, and in which colours.

use egui::{Color32, RichText, Slider, Ui, WidgetInfo};

use crate::app::render::{Style, Theme, strain_colour};

/// The panel.
pub fn display_ui(ui: &mut Ui, style: &mut Style) {
    ui.checkbox(&mut style.surface, "Surface").on_hover_text("The lit cloth");
    ui.add_enabled_ui(style.surface, |ui| {
        ui.checkbox(&mut style.edges, "Edges of the faces");
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
            ui.checkbox(&mut style.springs[kind], name);
        });
    }
    slider(ui, "Line width", &mut style.line_width, 0.5..=6.0, "Points");
    ui.checkbox(&mut style.spring_strain, "Springs by strain");
    if style.spring_strain || style.surface_values {
        slider(
            ui,
            "Strain range",
            &mut style.value_range,
            0.001..=2.0,
            "Strain that gets the last colour of the ramp",
        );
        legend(ui, style.value_range);
    }
    ui.add_space(4.0);
    ui.checkbox(&mut style.ground, "Ground grid");
    ui.add_enabled_ui(style.ground, |ui| {
        ui.checkbox(&mut style.axes, "Axes");
        ui.checkbox(&mut style.shadow, "Shadow");
    });
    ui.horizontal(|ui| {
        ui.selectable_value(&mut style.theme, Theme::Dark, "Dark");
        ui.selectable_value(&mut style.theme, Theme::Light, "Light");
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

/// The strain ramp with its ends and middle.
pub fn legend(ui: &mut Ui, range: f32) {
    let width = ui.available_width().min(220.0);
    let (rect, _) = ui.allocate_exact_size(egui::vec2(width, 12.0), egui::Sense::hover());
    let steps = 64;
    for i in 0..steps {
        let value = (i as f32 + 0.5) / steps as f32 * 2.0 - 1.0;
        let [r, g, b] = strain_colour(value);
        let left = rect.left() + width * i as f32 / steps as f32;
        let cell = egui::Rect::from_min_size(
            egui::pos2(left, rect.top()),
            egui::vec2(width / steps as f32 + 0.5, 12.0),
        );
        ui.painter().rect_filled(cell, 0.0, Color32::from_rgb(r, g, b));
    }
    ui.horizontal(|ui| {
        ui.set_width(width);
        let percent = |value: f32| format!("{:+.1} %", value * 100.0);
        ui.label(RichText::new(percent(-range)).small());
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.label(RichText::new(percent(range)).small());
        });
    });
}
