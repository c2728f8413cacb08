//! The lanes' table: method, precision and dt of each, what it costs, and how far it is from the lane taken as reference.

use egui::{Color32, RichText, Ui, WidgetInfo};

use super::{display::Display, simulation::title};
use crate::{
    app::{
        engine::{LaneState, Order},
        render::Colour,
        session::Session,
    },
    scene::Precision,
    simulators,
};

/// Colours of lanes that lie over each other.
const COLOURS: [Colour; 8] = [
    [88, 138, 196],
    [224, 134, 70],
    [102, 180, 104],
    [206, 92, 120],
    [150, 122, 206],
    [90, 186, 190],
    [206, 186, 84],
    [150, 150, 156],
];

/// The colour of a lane.
pub fn lane_colour(lane: usize) -> Colour {
    COLOURS[lane % COLOURS.len()]
}

/// What tells a lane from the others.
pub fn name_of(lane: &LaneState) -> String {
    let single = if lane.scene.precision == Precision::Single { ", single" } else { "" };
    format!("{}{single}, dt {} s", title(&lane.scene.simulator.id), lane.scene.dt)
}

/// The table.
pub fn lanes_ui(ui: &mut Ui, session: &mut Session, display: &mut Display) {
    ui.horizontal(|ui| {
        ui.heading("Lanes");
        ui.menu_button("Add lane", |ui| {
            if ui.button("like this one").clicked() {
                session.add_lane(None);
                ui.close();
            }
            for entry in simulators::ALL {
                if ui.button(title(entry.id)).on_hover_text(entry.summary).clicked() {
                    session.add_lane(Some(entry.id));
                    ui.close();
                }
            }
        })
        .response
        .on_hover_text(
            "A simulation beside this one, from its present state, with its own method, precision and dt",
        );
        ui.separator();
        ui.selectable_value(&mut display.overlaid, false, "Tiled")
            .on_hover_text("Each lane in a picture of its own");
        ui.selectable_value(&mut display.overlaid, true, "Overlaid")
            .on_hover_text("All lanes in one picture, each in its colour");
        ui.separator();
        ui.checkbox(&mut display.distance, "Colour by distance")
            .on_hover_text("Colours each cloth by its distance from the reference lane");
        ui.weak("Simulation edits the chosen lane")
            .on_hover_text("Method, precision and dt are the lane's own; all else is shared");
    });
    let state = session.state().clone();
    egui::ScrollArea::both().auto_shrink(false).show(ui, |ui| {
        egui::Grid::new("lanes").num_columns(9).spacing([16.0, 3.0]).striped(true).show(ui, |ui| {
            let heads = [
                ("Lane", "Click to edit it"),
                ("Reference", "The others are compared with this lane"),
                ("Cost s/s", "Seconds of computing for each simulated second"),
                ("dt / limit", "dt as a part of the largest stable one"),
                ("Strain %", "Largest strain"),
                ("Energy J", "Kinetic + gravitational + elastic"),
                ("RMS m", "Root mean square distance of the particles from the reference"),
                ("Max m", "Largest distance from the reference"),
                ("", ""),
            ];
            for (head, tip) in heads {
                ui.label(RichText::new(head).small().weak()).on_hover_text(tip);
            }
            ui.end_row();
            for (number, lane) in state.lanes.iter().enumerate() {
                row_ui(ui, session, state.reference, number, lane);
                ui.end_row();
            }
        });
    });
}

fn row_ui(ui: &mut Ui, session: &mut Session, reference: usize, number: usize, lane: &LaneState) {
    ui.horizontal(|ui| {
        let (rect, _) = ui.allocate_exact_size(egui::vec2(10.0, 10.0), egui::Sense::hover());
        let [r, g, b] = lane_colour(number);
        ui.painter().rect_filled(rect, 2.0, Color32::from_rgb(r, g, b));
        let name = format!("{}  {}", number + 1, name_of(lane));
        if ui.selectable_label(session.lane == number, name).clicked() {
            session.lane = number;
        }
        if lane.health.is_diverged() {
            ui.label(RichText::new("diverged").color(ui.visuals().error_fg_color));
        }
    });
    let radio = ui.radio(reference == number, "");
    let label = format!("Reference lane {}", number + 1);
    radio.widget_info(|| WidgetInfo::selected(egui::Role::RadioButton, true, reference == number, &label));
    if radio.clicked() {
        session.order(Order::Reference(number));
    }
    ui.monospace(format!("{:8.4}", lane.cost));
    ui.monospace(lane.limit.dt().map_or("-".to_owned(), |l| format!("{:.2}", lane.scene.dt / l)));
    ui.monospace(format!("{:7.2}", 100.0 * lane.measures.max_strain));
    ui.monospace(format!("{:11.4e}", lane.measures.energy.total()));
    let [rms, most] =
        lane.distance.map_or(["-".to_owned(), "-".to_owned()], |d| d.map(|d| format!("{d:9.3e}")));
    ui.monospace(rms);
    ui.monospace(most);
    let remove = ui.add_enabled(session.scenes().len() > 1, egui::Button::new("Remove").small());
    let label = format!("Remove lane {}", number + 1);
    remove.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, &label));
    if remove.clicked() {
        session.remove_lane(number);
    }
}
