//! Questions and windows over the viewport: open, save, unsaved changes, the built-in scenes, and help.

use std::path::PathBuf;

use egui::{Align2, Context, Key, Modal, RichText, TextEdit, Ui, WidgetInfo, vec2};

use super::menu::{KEYS, key_name};
use crate::{
    app::{
        files::{Files, Next, Purpose, proposal},
        gallery::{Gallery, SIZE},
        session::Session,
    },
    scene::builtin,
};

/// What is being asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ask {
    /// For a file to open.
    Open(String),
    /// Where to save the scene, and what comes next.
    Save(String, Option<Next>),
    /// Where to save the recording.
    Record(String),
    /// For a recording to play.
    Replay(String),
    /// Whether to save before what comes next.
    Unsaved(Next),
}

impl Ask {
    /// Asks where to save the open scene.
    pub fn save(session: &Session, next: Option<Next>) -> Self {
        Self::Save(proposal(session).to_string_lossy().into_owned(), next)
    }

    /// Asks where to save a recording of it.
    pub fn record(session: &Session) -> Self {
        Self::Record(proposal(session).with_extension("recording.ron").to_string_lossy().into_owned())
    }
}

/// The question; returns what is to be done now, which ends it.
pub fn dialog_ui(
    ctx: &Context,
    ask: &mut Option<Ask>,
    session: &mut Session,
    files: &mut Files,
) -> Option<Next> {
    let mut asked = ask.take()?;
    let mut next = None;
    let frame = egui::Frame::popup(&ctx.global_style()).inner_margin(16);
    let modal = Modal::new(egui::Id::unique("question")).frame(frame).show(ctx, |ui| {
        ui.set_width(460.0);
        match &mut asked {
            Ask::Open(path) => {
                ui.heading("Open a scene or a mesh");
                let chosen = open_ui(ui, path, files);
                let is_open = chosen.is_none();
                next = chosen.map(Next::Open);
                is_open
            }
            Ask::Save(path, after) => {
                ui.heading("Save the scene");
                path_ui(ui, "Save", path, files, Purpose::Save).is_none_or(|path| {
                    files.save(session, &path, after.take());
                    false
                })
            }
            Ask::Record(path) => {
                ui.heading("Save a recording");
                ui.label("The scene at its start and every command since: tenter replay runs it again, bit for bit.");
                path_ui(ui, "Save", path, files, Purpose::Record).is_none_or(|path| {
                    Files::record(session, &path);
                    false
                })
            }
            Ask::Replay(path) => {
                ui.heading("Replay a recording");
                ui.label("What was done is done again at the same simulated times, on every lane: add one with another method, and compare.");
                let chosen = path_ui(ui, "Replay", path, files, Purpose::Replay);
                let is_open = chosen.is_none();
                next = chosen.map(Next::Replay);
                is_open
            }
            Ask::Unsaved(then) => {
                ui.heading(format!("Save the changes to {}?", session.title()));
                ui.label("What is not saved is lost.");
                ui.add_space(6.0);
                ui.horizontal(|ui| {
                    let mut is_open = true;
                    if ui.button("Save").clicked() {
                        is_open = false;
                        match session.file().cloned() {
                            Some(file) => files.save(session, &file, Some(then.clone())),
                            None => *ask = Some(Ask::save(session, Some(then.clone()))),
                        }
                    }
                    if ui.button("Do not save").clicked() {
                        is_open = false;
                        next = Some(then.clone());
                    }
                    is_open && !ui.button("Cancel").clicked()
                })
                .inner
            }
        }
    });
    if modal.inner && !modal.should_close() && next.is_none() {
        *ask = Some(asked);
    }
    next
}

fn open_ui(ui: &mut Ui, path: &mut String, files: &mut Files) -> Option<String> {
    ui.label("A .ron scene, or a mesh: .obj, .gltf, .glb. A file dropped on the window opens too.");
    let mut chosen =
        path_ui(ui, "Open", path, files, Purpose::Open).map(|path| path.to_string_lossy().into_owned());
    if let Some((name, why)) = &files.refused
        && name == path
    {
        ui.colored_label(ui.visuals().error_fg_color, why);
    }
    if !files.preferences.recent.is_empty() {
        ui.separator();
        ui.label(RichText::new("Recent").strong());
    }
    for file in &files.preferences.recent {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let folder = file.parent().unwrap_or(file).to_string_lossy();
        let button =
            egui::Button::new(name.as_ref()).right_text(RichText::new(folder.as_ref()).small().weak());
        if ui.add(button.frame(false).truncate().min_size(vec2(ui.available_width(), 0.0))).clicked() {
            chosen = Some(file.to_string_lossy().into_owned());
        }
    }
    chosen
}

/// A path to type, a dialog of the system to choose it with, and a button that takes it. `Some` ends the question; an empty path is a
/// cancel.
fn path_ui(
    ui: &mut Ui,
    verb: &str,
    path: &mut String,
    files: &mut Files,
    purpose: Purpose,
) -> Option<PathBuf> {
    let mut taken = None;
    ui.horizontal(|ui| {
        let width = ui.available_width() - 90.0;
        let field = ui.add(TextEdit::singleline(path).desired_width(width).hint_text("path"));
        field.widget_info(|| WidgetInfo::text_edit(true, "", path.as_str(), ""));
        let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
        if !entered && ui.memory(|memory| memory.focused().is_none()) {
            field.request_focus();
        }
        let browse = ui.add_enabled(!files.is_picking(), egui::Button::new("Browse…"));
        if browse.on_hover_text("The system's file dialog, where it has one").clicked() {
            files.pick(purpose, &PathBuf::from(path.as_str()));
        }
        if entered && !path.trim().is_empty() {
            taken = Some(PathBuf::from(path.trim()));
        }
    });
    if files.lacks_dialog {
        ui.label(RichText::new("The system offers no file dialog here: type the path.").weak());
    }
    ui.add_space(4.0);
    ui.horizontal(|ui| {
        if ui.add_enabled(!path.trim().is_empty(), egui::Button::new(verb)).clicked() {
            taken = Some(PathBuf::from(path.trim()));
        }
        if ui.button("Cancel").clicked() {
            ui.close();
        }
    });
    taken
}

/// The built-in scenes, with their pictures where these are there; returns the one that was chosen.
pub fn gallery_ui(ctx: &Context, is_open: &mut bool, gallery: &Gallery) -> Option<&'static str> {
    let mut chosen = None;
    let [width, height] = SIZE.map(|side| side as f32 * 0.5);
    egui::Window::new("Built-in scenes")
        .open(is_open)
        .collapsible(false)
        .resizable(false)
        .anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0))
        .show(ctx, |ui| {
            // Known before the first layout, which would else be drawn too narrow.
            ui.set_min_width(4.0 * width + 3.0 * 12.0);
            egui::Grid::new("gallery").spacing([12.0, 10.0]).show(ui, |ui| {
                for (i, scene) in builtin::ALL.iter().enumerate() {
                    if card_ui(ui, scene, gallery, vec2(width, height)) {
                        chosen = Some(scene.name);
                    }
                    if i % 4 == 3 {
                        ui.end_row();
                    }
                }
            });
        });
    if chosen.is_some() {
        *is_open = false;
    }
    chosen
}

fn card_ui(ui: &mut Ui, scene: &builtin::Builtin, gallery: &Gallery, size: egui::Vec2) -> bool {
    ui.vertical(|ui| {
        ui.set_width(size.x);
        let (rect, response) = ui.allocate_exact_size(size, egui::Sense::click());
        response
            .widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, format!("Open {}", scene.name)));
        let painter = ui.painter_at(rect);
        if let Some(picture) = gallery.picture(scene.name) {
            let whole = egui::Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
            painter.image(picture.id(), rect, whole, egui::Color32::WHITE);
        } else {
            painter.rect_filled(rect, 4.0, ui.visuals().extreme_bg_color);
        }
        let is_marked = response.hovered() || response.has_focus();
        let stroke =
            if is_marked { ui.visuals().widgets.hovered.fg_stroke } else { ui.visuals().window_stroke };
        painter.rect_stroke(rect, 4.0, stroke, egui::StrokeKind::Inside);
        ui.label(RichText::new(scene.name).strong());
        ui.label(RichText::new(scene.about).small().weak());
        response.on_hover_cursor(egui::CursorIcon::PointingHand).clicked()
    })
    .inner
}

/// The mouse, for the help.
const MOUSE: [(&str, &str); 10] = [
    ("Drag a particle", "moves it, and the whole selection if it is selected; let go while moving to throw"),
    ("Click · Shift click", "selects a particle · adds it, or takes it out"),
    ("Drag beside the cloth", "turns the view"),
    ("Shift drag beside it", "frames a box to select"),
    ("Ctrl drag beside it", "draws a lasso to select"),
    ("Right drag", "turns the view"),
    ("Middle drag, Shift right", "shifts the view"),
    ("Wheel", "comes nearer to the cursor"),
    ("Escape while dragging", "puts everything back as it was"),
    ("Escape", "selects nothing"),
];

/// Keys and mouse.
pub fn help_ui(ctx: &Context, is_open: &mut bool) {
    egui::Window::new("Keys and mouse")
        .open(is_open)
        .collapsible(false)
        .resizable(false)
        .anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0))
        .show(ctx, |ui| {
            ui.horizontal_top(|ui| {
                for (i, keys) in KEYS.chunks(KEYS.len().div_ceil(2)).enumerate() {
                    egui::Grid::new(("keys", i)).num_columns(2).spacing([14.0, 3.0]).show(ui, |ui| {
                        for (modifiers, key, _, text) in keys {
                            ui.monospace(key_name(ui, *modifiers, *key));
                            ui.label(*text);
                            ui.end_row();
                        }
                    });
                    ui.add_space(12.0);
                }
            });
            ui.separator();
            egui::Grid::new("mouse").num_columns(2).spacing([14.0, 3.0]).show(ui, |ui| {
                for (what, text) in MOUSE {
                    ui.label(RichText::new(what).strong());
                    ui.label(text);
                    ui.end_row();
                }
            });
            ui.separator();
            ui.label("Sliders: drag, or click the number and type. The arrow behind a value puts it back to its default.");
        });
}
