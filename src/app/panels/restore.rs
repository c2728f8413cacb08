//! The question whether to go on from what a session left that ended without warning.

use egui::{Context, Key, Modal, Modifiers};

use crate::app::{restoring::Restore, session::Session};

/// The question, while there is something to be offered.
pub fn restore_ui(ctx: &Context, restore: &mut Restore, session: &mut Session) {
    let Some(saved) = restore.offer() else { return };
    let question = format!("Restore {} as of {}?", crate::params::excerpt(saved.title()), saved.when());
    let frame = egui::Frame::popup(&ctx.global_style()).inner_margin(16);
    let modal = Modal::new(egui::Id::unique("restore")).frame(frame).show(ctx, |ui| {
        ui.set_width(460.0);
        ui.heading("Tenter ended without closing");
        ui.label(question);
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            let tip = "Scene, edits and the cloth as it hung; what was undone before is not";
            if ui.button("Restore").on_hover_text(tip).clicked() {
                restore.restore(session);
            }
            if ui.button("Discard").on_hover_text("Takes it away for good").clicked() {
                restore.discard();
            }
            if ui.button("Later").on_hover_text("Asks again when Tenter starts the next time").clicked() {
                restore.leave();
            }
        });
    });
    // A click beside it is meant for what lies there, and is no answer.
    if modal.is_top_modal && ctx.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Escape)) {
        restore.leave();
    }
}
