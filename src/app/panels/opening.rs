//! What is being opened, while that takes long, and how to give it up.

use std::{path::Path, time::Duration};

use egui::{Context, Key, Modal, Modifiers};

/// Says what is being opened, and since when; true where it is given up.
pub fn opening_ui(ctx: &Context, name: &str, since: Duration) -> bool {
    let short = Path::new(name).file_name().unwrap_or_default().to_string_lossy();
    let frame = egui::Frame::popup(&ctx.global_style()).inner_margin(16);
    let modal = Modal::new(egui::Id::unique("opening")).frame(frame).show(ctx, |ui| {
        ui.set_width(360.0);
        ui.heading(format!("Opening {}…", crate::params::excerpt(&short)));
        ui.label(format!("{} s", since.as_secs()));
        ui.add_space(6.0);
        ui.button("Cancel").clicked()
    });
    // Nothing that moves: who opens it needs the processor.
    ctx.request_repaint_after(Duration::from_millis(250));
    modal.inner || ctx.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Escape))
}
