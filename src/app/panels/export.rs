//! The window that exports a scene's motion.

use std::path::{Path, PathBuf};

use egui::{
    Align2, Button, ComboBox, Context, DragValue, ProgressBar, RichText, Role, TextEdit, Ui, WidgetInfo, vec2,
};

use super::params::WARNING;
use crate::{
    app::{
        exporting::{Exporting, Wish, size_of},
        files::{Files, Purpose, proposal},
        session::Session,
    },
    export::Format,
};

/// Longest side of a picture that can be asked for, pixels; what draws it may refuse less.
const LONGEST: u32 = 16384;

/// What the window holds.
pub struct ExportWindow {
    is_open: bool,
    path: String,
    seconds: f64,
    fps: f64,
    /// Pixels of pictures; none for those of the format.
    size: Option<[u32; 2]>,
    under_way: Option<Exporting>,
    told: String,
}

impl Default for ExportWindow {
    fn default() -> Self {
        let (path, told) = Default::default();
        Self { is_open: false, path, seconds: 4.0, fps: 25.0, size: None, under_way: None, told }
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

    /// Takes a path that the system's dialog gave.
    pub fn take(&mut self, path: &Path) {
        self.path = path.to_string_lossy().into_owned();
    }

    /// Whether the window is open.
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// The window, where it is open.
    pub fn ui(&mut self, ctx: &Context, session: &mut Session, files: &mut Files) {
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
            .show(ctx, |ui| self.inside(ui, session, files));
        self.is_open = is_open;
        if self.under_way.is_some() {
            ctx.request_repaint_after_secs(0.1);
        }
    }

    fn inside(&mut self, ui: &mut Ui, session: &Session, files: &mut Files) {
        ui.set_width(440.0);
        ui.label("The first lane's scene runs from its start, with its present settings.");
        ui.add_space(4.0);
        ui.add_enabled_ui(self.under_way.is_none(), |ui| self.wish_ui(ui, files));
        for warning in self.warnings(session) {
            ui.label(RichText::new(warning).color(WARNING));
        }
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

    fn format(&self) -> Option<Format> {
        Format::of(Path::new(self.path.trim())).ok()
    }

    /// What is to be exported, and where to.
    fn wish_ui(&mut self, ui: &mut Ui, files: &mut Files) {
        ui.horizontal(|ui| {
            let width = ui.available_width() - 90.0;
            let field = ui.add(TextEdit::singleline(&mut self.path).desired_width(width));
            field.widget_info(|| WidgetInfo::text_edit(true, "", self.path.as_str(), ""));
            let browse = ui.add_enabled(!files.is_picking(), Button::new("Browse…"));
            if browse.on_hover_text("The system's file dialog, where it has one").clicked() {
                files.pick(Purpose::Export, Path::new(&self.path));
            }
        });
        let format = self.format();
        ui.horizontal(|ui| {
            let combo = ComboBox::from_id_salt("format").selected_text(format.map_or("format", Format::name));
            let combo = combo.show_ui(ui, |ui| {
                for (extension, choice) in Format::ALL {
                    let text = format!("{extension}: {}", about(choice));
                    if ui.selectable_label(format == Some(choice), text).clicked() {
                        let path = PathBuf::from(&self.path).with_extension(extension);
                        self.path = path.to_string_lossy().into_owned();
                    }
                }
            });
            combo.response.widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, "Format"));
            let seconds = DragValue::new(&mut self.seconds).range(0.0..=1e6).speed(0.1).suffix(" s");
            named(&ui.add(seconds), "Simulated time");
            let fps = DragValue::new(&mut self.fps).range(0.01..=1e4).speed(0.1).suffix(" frames/s");
            named(&ui.add(fps), "Frames a second");
        });
        if let Some(format) = format.filter(|format| format.is_drawn()) {
            ui.horizontal(|ui| {
                let mut size = self.size.unwrap_or_else(|| size_of(format));
                let [width, height] = &mut size;
                for (side, name) in [(width, "Width"), (height, "Height")] {
                    let field = DragValue::new(side).range(1..=LONGEST).suffix(" px");
                    let field = ui.add(field).on_hover_text(name);
                    named(&field, name);
                }
                if size != self.size.unwrap_or_else(|| size_of(format)) {
                    self.size = Some(size);
                }
            });
        }
    }

    /// What to know before it is done.
    fn warnings(&self, session: &Session) -> Vec<String> {
        let Some(lane) = session.state().lanes.first() else { return Vec::new() };
        let mut warnings = lane.warnings.to_vec();
        let is_mesh = self.format().is_some_and(|format| !format.is_drawn() && format != Format::Csv);
        if is_mesh && lane.scene.tearing.enabled {
            warnings.push("Exported faces stay closed where springs tear; pictures show it.".to_owned());
        }
        warnings
    }

    fn start(&mut self, ctx: &Context, session: &Session) {
        let Some(scene) = session.scenes().first().cloned() else { return };
        let path = PathBuf::from(self.path.trim());
        let (seconds, fps, size) = (self.seconds, self.fps, self.size);
        let wish = Wish { scene, place: session.place(), path, seconds, fps, size };
        let window = ctx.clone();
        self.told.clear();
        match Exporting::start(wish, move || window.request_repaint()) {
            Ok(export) => self.under_way = Some(export),
            Err(refusal) => self.told = refusal.to_string(),
        }
    }
}

/// What a screen reader and a test call a field.
fn named(field: &egui::Response, name: &str) {
    field.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, name));
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
