//! The window that exports a scene's motion.

use std::path::{Path, PathBuf};

use egui::{Align2, ComboBox, Context, DragValue, ProgressBar, TextEdit, Ui, WidgetInfo, vec2};

use crate::{
    app::{
        exporting::{Exporting, Wish},
        files::proposal,
        session::Session,
    },
    export::Format,
};

/// What the window holds.
pub struct ExportWindow {
    is_open: bool,
    path: String,
    seconds: f64,
    fps: f64,
    under_way: Option<Exporting>,
    told: String,
}

impl Default for ExportWindow {
    fn default() -> Self {
        let (path, told) = Default::default();
        Self { is_open: false, path, seconds: 4.0, fps: 25.0, under_way: None, told }
    }
}

impl ExportWindow {
    /// Opens the window, or closes it; an export that is under way goes on.
    pub fn toggle(&mut self, session: &Session) {
        self.is_open = !self.is_open;
        if self.path.is_empty() {
            self.path = proposal(session).with_extension("glb").to_string_lossy().into_owned();
        }
    }

    /// The window, where it is open.
    pub fn ui(&mut self, ctx: &Context, session: &mut Session) {
        if let Some(told) = self.under_way.as_mut().and_then(Exporting::ended) {
            self.under_way = None;
            session.message = Some(told.clone());
            self.told = told;
        }
        let mut is_open = self.is_open;
        egui::Window::new("Export")
            .open(&mut is_open)
            .collapsible(false)
            .resizable(false)
            .anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0))
            .show(ctx, |ui| self.inside(ui, session));
        self.is_open = is_open;
        if self.under_way.is_some() {
            ctx.request_repaint_after_secs(0.1);
        }
    }

    fn inside(&mut self, ui: &mut Ui, session: &Session) {
        ui.set_width(440.0);
        ui.label("The first lane's scene runs from its start, with its present settings.");
        ui.add_space(4.0);
        ui.add_enabled_ui(self.under_way.is_none(), |ui| {
            let field = ui.add(TextEdit::singleline(&mut self.path).desired_width(f32::INFINITY));
            field.widget_info(|| WidgetInfo::text_edit(true, "", self.path.as_str(), ""));
            ui.horizontal(|ui| {
                let chosen = Format::of(Path::new(&self.path)).ok();
                ComboBox::from_id_salt("format")
                    .selected_text(chosen.map_or("format", Format::name))
                    .show_ui(ui, |ui| {
                        for (extension, format) in Format::ALL {
                            let text = format!("{extension}: {}", about(format));
                            if ui.selectable_label(chosen == Some(format), text).clicked() {
                                let path = PathBuf::from(&self.path).with_extension(extension);
                                self.path = path.to_string_lossy().into_owned();
                            }
                        }
                    });
                ui.add(DragValue::new(&mut self.seconds).range(0.0..=1e6).speed(0.1).suffix(" s"));
                ui.add(DragValue::new(&mut self.fps).range(0.01..=1e4).speed(0.1).suffix(" frames/s"));
            });
        });
        ui.add_space(4.0);
        match &self.under_way {
            Some(export) => {
                ui.horizontal(|ui| {
                    if ui.button("Cancel").clicked() {
                        export.stop();
                    }
                    ui.add(ProgressBar::new(export.progress()).show_percentage());
                });
            }
            None if ui.button("Export").clicked() => self.start(ui.ctx(), session),
            None => {}
        }
        if !self.told.is_empty() {
            ui.label(&self.told);
        }
    }

    fn start(&mut self, ctx: &Context, session: &Session) {
        let Some(scene) = session.scenes().first().cloned() else { return };
        let path = PathBuf::from(self.path.trim());
        let wish = Wish { scene, place: session.place(), path, seconds: self.seconds, fps: self.fps };
        let window = ctx.clone();
        self.told.clear();
        match Exporting::start(wish, move || window.request_repaint()) {
            Ok(export) => self.under_way = Some(export),
            Err(refusal) => self.told = refusal.to_string(),
        }
    }
}

fn about(format: Format) -> &'static str {
    match format {
        Format::Obj => "a folder of meshes",
        Format::Gltf | Format::Glb => "glTF with the motion in it",
        Format::Pc2 => "point cache",
        Format::Csv => "energies and strain",
        Format::Png => "a folder of pictures",
        Format::Gif => "an animated picture",
    }
}
