//! The timeline: the moments that are remembered, to look at and to go on from.

use egui::{RichText, Slider, Ui, WidgetInfo};

use crate::app::{
    engine::{Order, Remembered},
    session::Session,
};

/// Megabytes that may be allowed.
const MEGABYTES: std::ops::RangeInclusive<u32> = 1..=65_536;

/// The bar; `megabytes` is what the timeline may take.
pub fn timeline_ui(ui: &mut Ui, session: &mut Session, megabytes: &mut u32) {
    let Remembered { from, at, to, bytes: [used, allowed] } = session.state().timeline;
    if allowed != bytes(*megabytes) && !session.is_waiting() {
        session.order(Order::Remember(bytes(*megabytes)));
    }
    ui.horizontal(|ui| {
        ui.label("Timeline").on_hover_text(
            "Drag to look at what was. Run goes on from there and forgets what came after; undo brings it back",
        );
        ui.label(RichText::new(format!("{:>8}", behind(at - to))).monospace())
            .on_hover_text("How far the moment that is shown lies behind the last one");
        let is_past = at < to;
        let latest = ui.add_enabled(is_past, egui::Button::new("Latest").small());
        if latest.on_hover_text("Shows the last moment again").clicked() {
            session.scrub(to);
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let field = egui::DragValue::new(megabytes).range(MEGABYTES).speed(8.0).suffix(" MB");
            let field = ui.add(field);
            field.widget_info(|| WidgetInfo::drag_value(true, f64::from(*megabytes)));
            field.on_hover_text("Memory that states of the past may take; farther back fewer are kept");
            ui.label(RichText::new(format!("{:.0} s in {} of", to - from, in_words(used))).weak())
                .on_hover_text("Simulated time that is remembered, and the memory that it takes");
            if let Some([time, seconds]) = session.state().replay {
                ui.label(RichText::new(format!("replay {time:.1} of {seconds:.1} s")).strong())
                    .on_hover_text("What was recorded is done again; taking hold of the cloth ends it");
            }
            ui.spacing_mut().slider_width = (ui.available_width() - 8.0).max(0.0);
            let mut place = at;
            // A range of nothing has no places.
            let slider = Slider::new(&mut place, from..=to.max(from + 1e-3)).show_value(false);
            let slider = ui.add_enabled(to > from, slider);
            slider.widget_info(|| WidgetInfo::slider(true, at, "Timeline position"));
            if slider.changed() {
                session.scrub(place);
            }
        });
    });
}

/// Megabytes as bytes.
fn bytes(megabytes: u32) -> usize {
    megabytes as usize * 1_000_000
}

/// So many bytes.
fn in_words(bytes: usize) -> String {
    match bytes as f64 {
        few if few < 1e6 => format!("{:.0} kB", few / 1e3),
        many => format!("{:.1} MB", many / 1e6),
    }
}

/// A time before the last moment.
fn behind(seconds: f64) -> String {
    if seconds < 0.0 { format!("{seconds:.2} s") } else { "now".to_owned() }
}
