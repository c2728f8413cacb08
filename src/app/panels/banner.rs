//! What is told when a simulation has diverged: where, when, why, and what can be done about it.

use egui::{Area, Color32, Frame, Rect, RichText, Ui};

use super::health::three;
use crate::{
    app::{
        engine::{LaneState, Limit, Order},
        session::Session,
    },
    params::Short,
    world::Health,
};

/// A step is safe below this part of the limit.
const SAFE: f64 = 0.9;
/// How far back the banner offers to go, s.
const BACK: f64 = 2.0;

/// A bar over the upper edge of the viewport: it takes no room from it, or the picture would jump when it comes and goes.
fn bar_ui(ui: &Ui, name: &str, viewport: Rect, [dark, light]: [Color32; 2], inside: impl FnOnce(&mut Ui)) {
    let fill = if ui.visuals().dark_mode { dark } else { light };
    let area = Area::new(egui::Id::unique(name)).fixed_pos(viewport.min).constrain(false);
    area.show(ui.ctx(), |ui| {
        let frame = Frame::new().fill(fill).inner_margin(8);
        ui.set_width(viewport.width());
        frame.show(ui, |ui| {
            ui.set_width(ui.available_width());
            inside(ui);
        });
    });
}

/// The banner, if a lane has diverged.
pub fn banner_ui(ui: &Ui, viewport: Rect, session: &mut Session) {
    let lanes = &session.state().lanes;
    let Some(number) = lanes.iter().position(|lane| lane.health.is_diverged()) else { return };
    let lane = lanes[number].clone();
    let only = (lanes.len() > 1).then_some(number);
    let Health::Diverged { time, particle, .. } = lane.health else { return };
    // The first frame only finds out how high it is, and while nothing moves there would be no other.
    ui.ctx().request_repaint_after(std::time::Duration::from_millis(150));
    let fills = [Color32::from_rgb(74, 30, 32), Color32::from_rgb(255, 222, 218)];
    bar_ui(ui, "banner", viewport, fills, |ui| {
        let whose = only.map_or("Diverged".to_owned(), |lane| format!("Lane {} diverged", lane + 1));
        let text = format!("{whose} at t = {time:.3} s, particle {particle}. Paused at the last good state.");
        ui.label(RichText::new(text).strong());
        ui.label(cause(&lane));
        ui.horizontal_wrapped(|ui| {
            let dt = lane.scene.dt;
            let set = |session: &mut Session, to: f64| {
                // What has burst is no shape to go on from.
                session.order(Order::GoBack(BACK));
                session.set(only, "dt", &format!("{to:?}"), &format!("{dt:?}"));
                session.end_edit();
            };
            if ui.button("Halve dt").on_hover_text(format!("Go back 2 s, and on from there with dt {} s", Short(dt / 2.0))).clicked() {
                set(session, dt / 2.0);
            }
            if let Some(safe) = safe_step(&lane).filter(|safe| *safe < dt) {
                let tip = "Go back 2 s, and on from there with 0.9 of the largest stable step in theory for this shape: it would have held";
                if ui.button(format!("Set dt to {} s", Short(safe))).on_hover_text(tip).clicked() {
                    set(session, safe);
                }
            }
            let back = ui
                .button("Go back 2 s")
                .on_hover_text("To the state of two simulated seconds ago; what was set since stays set");
            if back.clicked() {
                session.order(Order::GoBack(BACK));
            }
            if ui.button("Reset").on_hover_text("Back to the start of the scene (R)").clicked() {
                session.reset();
            }
        });
    });
}

/// What a mesh without a scene is taken for, and the offer to make it cloth; true if that is wanted.
pub fn offer_ui(ui: &Ui, viewport: Rect, session: &mut Session, busy: bool) -> bool {
    if session.lane_state().is_none() || session.keeps_defaults || !session.is_bare_mesh() {
        return false;
    }
    let fills = [Color32::from_rgb(30, 46, 70), Color32::from_rgb(218, 232, 250)];
    let mut wanted = false;
    bar_ui(ui, "offer", viewport, fills, |ui| {
        let text = "This mesh has the mass, springs and dt of the 25 m sheet, as every scene has by default.";
        ui.label(RichText::new(text).strong());
        ui.horizontal_wrapped(|ui| {
            let cotton = ui.add_enabled(!busy, egui::Button::new("Make it light cotton"));
            let tip = "0.2 kg/m², stretch 50 N/m, shear 10 N/m, bend 0.5 N/m, little damping, a dt that holds: for a garment in metres";
            wanted = cotton.on_hover_text(tip).clicked();
            if ui.button("Keep these values").on_hover_text("Everything can be set on the left").clicked() {
                session.keeps_defaults = true;
            }
            if busy {
                ui.spinner();
            }
        });
    });
    wanted
}

/// The step that would have held, to two digits.
fn safe_step(lane: &LaneState) -> Option<f64> {
    let safe = SAFE * lane.limit.dt()?;
    let digit = 10_f64.powf(safe.log10().floor() - 1.0);
    // Through text, or 0.012 would read 0.012000000000000002.
    format!("{:.1e}", (safe / digit).floor() * digit).parse().ok()
}

/// The likely cause, in a sentence.
fn cause(lane: &LaneState) -> String {
    let dt = lane.scene.dt;
    let method = super::simulation::title(&lane.scene.simulator.id);
    match lane.limit {
        Limit::At(limit) if limit <= 0.0 => {
            format!("{method} is stable at no step here: choose another method, or more damping.")
        }
        Limit::At(limit) if dt > limit => format!(
            "dt {} s is {:.2} x the stability limit {} s of {method} in this shape: stiffer springs or lighter particles ask for shorter steps.",
            Short(dt),
            dt / limit,
            three(limit)
        ),
        Limit::At(limit) => format!(
            "dt {} s is {:.2} x the stability limit {} s: a sudden pull, or springs far from their length (largest strain {:.0} %), ask for shorter steps than theory does for small motions.",
            Short(dt),
            dt / limit,
            three(limit),
            100.0 * lane.measures.max_strain
        ),
        Limit::Unknown => format!(
            "The stability limit of {method} in this shape is still being computed (largest strain {:.0} %).",
            100.0 * lane.measures.max_strain
        ),
        Limit::None => format!(
            "{method} has no stability limit in theory: a sudden pull or very strong forces (largest strain {:.0} %) are the likely cause.",
            100.0 * lane.measures.max_strain
        ),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_safe_step_reads_short() {
        for (limit, expected) in [(0.0137, "0.012"), (0.0223, "0.02"), (3.1e-4, "0.00027")] {
            let safe: f64 = 0.9 * limit;
            let digit = 10_f64.powf(safe.log10().floor() - 1.0);
            let text: f64 = format!("{:.1e}", (safe / digit).floor() * digit).parse().expect("a number");
            assert_eq!(format!("{text}"), expected);
        }
    }
}
