//! The workbench: panels around the viewport, and what the keys, the menus and the mouse do.

mod drawing;
mod framing;

use std::{
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant},
};

use egui::{Ui, ViewportCommand};
use glam::Vec3;

use super::{
    Closer,
    engine::{LaneState, Order, Values},
    files::{Files, Next, Purpose},
    gallery::Gallery,
    hands::{Intent, Tool},
    panels::{self, Action, Ask, Display, Lab},
    picking,
    preferences::Preferences,
    render::{Cloth, Style, Theme},
    restoring::Restore,
    session::Session,
    shell::{Canvas, Content, Stage},
    theme,
    viewport::{Drawing, Viewport},
};
use framing::{Focus, Framing};

/// What fills the window.
pub struct Workbench {
    /// The simulation's other end.
    pub session: Session,
    /// What is shown.
    pub style: Style,
    /// How lanes are shown.
    pub display: Display,
    /// What is being opened and saved.
    pub files: Files,
    /// What methods cost, how wrong they are, and where they stop being stable.
    pub lab: Lab,
    preferences_file: Option<PathBuf>,
    ask: Option<Ask>,
    shows_gallery: bool,
    shows_help: bool,
    gallery: Gallery,
    export: panels::ExportWindow,
    /// What an earlier session left.
    pub restore: Restore,
    /// Where one looks from, and the mouse.
    pub viewport: Viewport,
    drawing: Option<(Drawing, Vec<Cloth>)>,
    device: String,
    window_title: String,
    framing: Framing,
    /// When what is being opened was asked for.
    opening_since: Option<Instant>,
    flags: Vec<u32>,
    ground_height: f32,
    is_finished: bool,
    /// Closes the window from elsewhere.
    pub closer: Closer,
}

impl Workbench {
    /// A workbench without a device: its panels work, nothing is drawn, and nothing is remembered.
    pub fn new(session: Session) -> Self {
        Self::with(session, Preferences::default(), None)
    }

    /// A workbench that remembers its preferences in a file.
    pub fn with(session: Session, preferences: Preferences, file: Option<PathBuf>) -> Self {
        Self {
            session,
            style: preferences.style.clone(),
            display: Display::default(),
            files: Files::new(preferences),
            lab: Lab::default(),
            preferences_file: file,
            ask: None,
            shows_gallery: false,
            shows_help: false,
            gallery: Gallery::default(),
            export: panels::ExportWindow::default(),
            restore: Restore::default(),
            viewport: Viewport::default(),
            drawing: None,
            device: String::new(),
            window_title: String::new(),
            framing: Framing::default(),
            opening_since: None,
            closer: Closer::default(),
            flags: Vec::new(),
            ground_height: 0.0,
            is_finished: false,
        }
    }

    /// Draws on a device from now on, and reads files on threads.
    pub fn attach(&mut self, stage: &Stage<'_>) {
        self.drawing = Some((Drawing::new(stage), Vec::new()));
        self.device = stage.gpu.description();
        self.files.attach(stage.egui);
        theme::apply(stage.egui);
    }

    /// Bytes uploaded for the last picture.
    pub fn uploaded(&self) -> u64 {
        self.drawing.as_ref().map_or(0, |(drawing, _)| drawing.uploaded())
    }

    /// One frame of panels and input.
    pub fn ui(&mut self, ui: &mut Ui) {
        let was_open = self.session.opening().is_some();
        self.session.refresh();
        if was_open && self.session.opening().is_none() {
            self.framing.focus = Some(Focus::Opened);
            self.lab.cancel();
            if let Some(why) = self.session.take_refused() {
                self.has_refused(&why);
            } else if self.session.state().lanes.is_empty() {
                // What the program was started with was given up.
                self.files.open("sheet");
            }
        }
        self.see_burst();
        if self.closer.is_asked() {
            self.finish();
        }
        self.poll(ui);
        self.lab.poll(&mut self.session, ui.ctx());
        let closes = (self.shows_help || self.shows_gallery || self.export.is_open()) && self.ask.is_none();
        if closes && ui.input_mut(|input| input.consume_key(egui::Modifiers::NONE, egui::Key::Escape)) {
            (self.shows_help, self.shows_gallery) = (false, false);
            if self.export.is_open() {
                self.export.toggle(&self.session);
            }
        }
        let is_opening = self.is_opening();
        if self.ask.is_none() && self.restore.offer().is_none() && !is_opening {
            for action in panels::pressed(ui) {
                self.perform(&action);
            }
        }
        let dark = self.style.theme == Theme::Dark;
        let wanted = if dark { egui::Theme::Dark } else { egui::Theme::Light };
        if ui.ctx().theme() != wanted {
            ui.ctx().set_theme(wanted);
            // What was laid out before has the old colours.
            ui.ctx().request_repaint();
        }
        self.panels_ui(ui);
        self.display.follow(&self.session.state().lanes);
        self.session.want(match () {
            () if self.by_distance() => Values::Distance,
            () if self.style.surface_values => Values::Strain,
            () => Values::None,
        });
        egui::CentralPanel::no_frame().show(ui, |ui| {
            let viewport = ui.max_rect();
            self.viewport_ui(ui);
            panels::banner_ui(ui, viewport, &mut self.session);
            if panels::offer_ui(ui, viewport, &mut self.session, self.files.is_making_cotton()) {
                self.files.make_cotton(&self.session);
            }
        });
        self.windows_ui(ui);
        self.title(ui);
    }

    fn panels_ui(&mut self, ui: &mut Ui) {
        let mut actions = Vec::new();
        egui::Panel::top("top").show(ui, |ui| {
            egui::MenuBar::new().ui(ui, |ui| {
                actions.extend(panels::menu_ui(ui, &self.session, &self.files));
                ui.separator();
                actions.extend(panels::transport_ui(ui, &mut self.session));
                ui.separator();
                panels::hands_ui(ui, &mut self.session, &mut self.viewport.hands.tool);
                ui.separator();
                actions.extend(panels::trade_button_ui(ui).then_some(Action::Trade));
            });
        });
        egui::Panel::bottom("status").show(ui, |ui| {
            let uploaded = self.uploaded();
            panels::status_ui(ui, &self.session, self.files.loading(), &self.device, uploaded);
        });
        egui::Panel::bottom("timeline").show(ui, |ui| {
            panels::timeline_ui(ui, &mut self.session, &mut self.files.preferences.timeline);
        });
        if self.lab.is_open {
            let height = ui.available_height();
            let panel = egui::Panel::bottom("lab").resizable(true).default_size(0.52 * height);
            panel.size_range(200.0..=0.8 * height).show(ui, |ui| self.lab.ui(ui, &mut self.session));
        }
        let [left, right, bottom] = self.files.preferences.panels;
        let widths = &mut self.files.preferences.panels;
        let lanes = self.session.state().lanes.len();
        if lanes > 1 {
            let panel = egui::Panel::bottom("lanes").resizable(true).default_size(bottom);
            let shown = panel.size_range(96.0..=320.0).show(ui, |ui| {
                panels::lanes_ui(ui, &mut self.session, &mut self.display);
            });
            widths[2] = shown.response.rect.height();
        }
        let shown = egui::Panel::left("left").default_size(left).size_range(280.0..=480.0).show(ui, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                section(ui, "Target", |ui| actions.extend(panels::target_ui(ui, &mut self.session)));
                section(ui, "Simulation", |ui| panels::simulation_ui(ui, &mut self.session));
            });
        });
        widths[0] = shown.response.rect.width();
        let lanes = self.session.state().lanes.len();
        let shown =
            egui::Panel::right("right").default_size(right).size_range(240.0..=440.0).show(ui, |ui| {
                egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    section(ui, "Health", |ui| panels::health_ui(ui, &self.session));
                    section(ui, "Display", |ui| {
                        panels::display_ui(ui, &mut self.style, &mut self.display, lanes);
                    });
                });
            });
        widths[1] = shown.response.rect.width();
        for action in actions {
            self.perform(&action);
        }
    }

    /// What lies over the viewport: questions, gallery, help, and the hint that a file may be dropped.
    fn windows_ui(&mut self, ui: &Ui) {
        let ctx = ui.ctx().clone();
        if self.shows_gallery {
            if self.drawing.is_some() {
                self.gallery.start(&ctx, &self.style);
            }
            self.gallery.poll(&ctx);
            if let Some(name) = panels::gallery_ui(&ctx, &mut self.shows_gallery, &self.gallery) {
                self.request(Next::Open(name.to_owned()));
            }
        }
        self.export.ui(&ctx, &mut self.session, &mut self.files);
        if self.shows_help {
            panels::help_ui(&ctx, &mut self.shows_help);
        }
        // A question may have come meanwhile, as when the window is to be closed.
        if self.is_opening() && self.ask.is_none() {
            self.opening_ui(&ctx);
            return;
        }
        panels::restore_ui(&ctx, &mut self.restore, &mut self.session);
        let is_asking = matches!(self.ask, Some(Ask::Unsaved(_)));
        if let Some(next) = panels::dialog_ui(&ctx, &mut self.ask, &mut self.session, &mut self.files) {
            if is_asking {
                self.go_on(next);
            } else {
                self.request(next);
            }
        }
        let is_hovered = ctx.input(|input| !input.raw.hovered_files.is_empty());
        if is_hovered && let Some(rect) = self.viewport.rects().iter().copied().reduce(egui::Rect::union) {
            let painter =
                ctx.layer_painter(egui::LayerId::new(egui::Order::Foreground, egui::Id::unique("drop")));
            painter.rect_filled(rect, 0.0, egui::Color32::from_black_alpha(140));
            let font = egui::FontId::proportional(20.0);
            let text = "Drop a scene or a mesh to open it";
            painter.text(rect.center(), egui::Align2::CENTER_CENTER, text, font, egui::Color32::WHITE);
        }
    }

    /// What is being opened, by name.
    fn opening(&self) -> Option<&str> {
        self.files.loading().or(self.session.opening())
    }

    /// Whether something is being opened that takes long.
    fn is_opening(&mut self) -> bool {
        /// Until then nothing is said of it: it would only flash up. Where there is no cloth yet, there is nothing else to see.
        const SOON: Duration = Duration::from_millis(300);
        if self.opening().is_none() {
            self.opening_since = None;
            return false;
        }
        let since = *self.opening_since.get_or_insert_with(Instant::now);
        since.elapsed() >= SOON || self.session.state().lanes.is_empty()
    }

    /// What is being opened, over everything else: what is done meanwhile would be done to a cloth that goes.
    fn opening_ui(&mut self, ctx: &egui::Context) {
        let Some(since) = self.opening_since else { return };
        let name = self.opening().unwrap_or_default().to_owned();
        if panels::opening_ui(ctx, &name, since.elapsed()) {
            self.session.message = Some(format!("{name} was not opened"));
            self.opening_since = None;
            self.files.give_up_loading();
            self.session.give_up_opening();
        }
    }

    /// What was being opened is no cloth. Where there is no other, the program ends with that.
    fn has_refused(&mut self, why: &str) {
        if self.session.state().lanes.is_empty() {
            self.closer.refuse(why);
            self.finish();
        } else {
            self.files.refuse(why);
        }
    }

    /// Takes what threads and the system have brought.
    fn poll(&mut self, ui: &Ui) {
        self.restore.poll(&mut self.session);
        let (picked, next) = self.files.poll(&mut self.session);
        match picked {
            Some((Purpose::Open, path)) => {
                self.ask = None;
                self.request(Next::Open(path.to_string_lossy().into_owned()));
            }
            Some((Purpose::Save, path)) => {
                let after = match self.ask.take() {
                    Some(Ask::Save(_, after)) => after,
                    _ => None,
                };
                self.files.save(&self.session, &path, after);
            }
            Some((Purpose::Replay, path)) => {
                self.ask = None;
                self.request(Next::Replay(path));
            }
            Some((Purpose::Record, path)) => {
                self.ask = None;
                Files::record(&mut self.session, &path);
            }
            Some((Purpose::Export, path)) => self.export.take(&path),
            None => {}
        }
        if let Some(next) = next {
            self.go_on(next);
        }
        if let Some(name) = self.files.take_refused()
            && self.ask.is_none()
        {
            // Where it was asked for, to be put right.
            self.ask = Some(Ask::Open(name));
        }
        let dropped = ui.input(|input| input.raw.dropped_files.last().map(|file| file.path().to_owned()));
        if let Some(path) = dropped {
            self.request(Next::Open(path.to_string_lossy().into_owned()));
        }
    }

    /// Does what loses the scene, but asks first whether its changes are to be saved.
    fn request(&mut self, next: Next) {
        if self.session.is_unsaved() && next != Next::Ask {
            self.ask = Some(Ask::Unsaved(next));
        } else {
            self.go_on(next);
        }
    }

    fn go_on(&mut self, next: Next) {
        match next {
            Next::New => self.files.open("sheet"),
            Next::Ask => self.ask = Some(Ask::Open(String::new())),
            Next::Open(name) => self.files.open(&name),
            Next::Replay(path) => self.files.replay(&path),
            Next::Quit => self.finish(),
        }
    }

    fn finish(&mut self) {
        self.is_finished = true;
        self.restore.end();
    }

    /// Does what a key, a menu or a button asks for.
    pub fn perform(&mut self, action: &Action) {
        let session = &mut self.session;
        match action {
            Action::New => self.request(Next::New),
            Action::Open => self.request(Next::Ask),
            Action::OpenRecent(path) => self.request(Next::Open(path.clone())),
            Action::Save => match session.file().cloned() {
                Some(file) => self.files.save(session, &file, None),
                None => self.ask = Some(Ask::save(session, None)),
            },
            Action::SaveAs => self.ask = Some(Ask::save(session, None)),
            Action::Record => self.ask = Some(Ask::record(session)),
            Action::Replay => self.ask = Some(Ask::Replay(String::new())),
            Action::Again => session.play_again(),
            Action::Export => self.export.toggle(session),
            Action::Gallery => self.shows_gallery = !self.shows_gallery,
            Action::Quit => self.request(Next::Quit),
            Action::Undo => session.undo(),
            Action::Redo => session.redo(),
            Action::SelectAll => {
                let particles = session.lane_state().map_or(0, |lane| lane.positions.len());
                session.selection = (0..particles as u32).collect();
            }
            Action::SelectNone => session.selection.clear(),
            Action::SelectPinned => session.selection = session.pinned().into_iter().collect(),
            Action::Pin => session.pin_selection(),
            Action::Run => session.run(!session.running() && !session.is_stuck()),
            Action::Step => session.order(Order::Step(1)),
            Action::Reset => session.reset(),
            Action::Slower => panels::change_speed(session, false),
            Action::Faster => panels::change_speed(session, true),
            Action::Focus => self.framing.focus = Some(Focus::Wanted),
            Action::Look(side) => self.viewport.camera.look_from(*side),
            Action::Projection => self.viewport.camera.switch_projection(),
            Action::Use(tool) => {
                let used = &mut self.viewport.hands.tool;
                *used = if used == tool { Tool::Move } else { *tool };
            }
            Action::Grip => session.grip.soft = !session.grip.soft,
            Action::AddLane(method) => session.add_lane(*method),
            Action::Theme => {
                self.style.theme = if self.style.theme == Theme::Dark { Theme::Light } else { Theme::Dark };
            }
            Action::Lab => self.lab.is_open = !self.lab.is_open,
            Action::Trade => self.lab.show_trade(session),
            Action::Study(tab) => self.lab.show(*tab),
            Action::Help => self.shows_help = !self.shows_help,
        }
    }

    /// In tiles each lane has its own picture.
    fn is_tiled(&self) -> bool {
        self.session.state().lanes.len() > 1 && !self.display.overlaid
    }

    fn by_distance(&self) -> bool {
        self.display.distance && self.session.state().lanes.len() > 1
    }

    fn viewport_ui(&mut self, ui: &mut Ui) {
        let lanes = self.session.state().lanes.clone();
        let tiles = if self.is_tiled() { lanes.len() } else { 1 };
        let chosen = self.session.lane.min(lanes.len().saturating_sub(1));
        let lane_of = |tile: usize| if tiles > 1 { tile } else { chosen };
        if tiles != self.viewport.rects().len() {
            self.framing.focus = self.framing.focus.or(Some(Focus::Wanted));
        }
        let shows_surface = self.style.surface;
        let target = |tile: usize| {
            let Some(lane) = lanes.get(lane_of(tile)) else {
                return picking::Target { positions: &[], triangles: &[] };
            };
            let triangles: &[[u32; 3]] = if shows_surface { &lane.geometry.triangles } else { &[] };
            picking::Target { positions: &lane.positions, triangles }
        };
        let before = self.viewport.camera;
        let intents = self.viewport.ui(ui, tiles, target);
        self.framing.follows &= intents.is_empty() && self.viewport.camera == before;
        let Some(lane) = lanes.get(lane_of(self.viewport.active)) else { return };
        if self.framing.focus.is_some() && self.viewport.size().min_element() > 1.0 {
            self.look(lane);
        } else if self.framing.follows && self.session.running() && self.framing.before_burst.is_none() {
            self.follow(lane, ui.input(|input| input.stable_dt));
        }
        for intent in intents {
            if tiles > 1 && matches!(intent, Intent::Grab(_) | Intent::Click { .. }) {
                self.session.lane = self.viewport.active;
            }
            self.act(intent, lane);
        }
        let springs: Vec<(Vec3, Vec3)> = self
            .session
            .pulling_hands()
            .filter_map(|(p, hand)| Some((Vec3::from(*lane.positions.get(p as usize)?), hand.as_vec3())))
            .collect();
        self.viewport.paint_springs(ui, &springs);
        self.viewport.paint_axes(ui);
        if tiles > 1 {
            self.paint_tiles(ui, &lanes);
        }
        if let Some(rect) = self.viewport.rects().iter().copied().reduce(egui::Rect::union) {
            panels::legend_ui(ui, rect, &self.shown_style(), &self.display);
        }
        let state = self.session.state();
        if state.running && !state.is_still && lanes.iter().any(|lane| lane.previous.is_some()) {
            // Between two states the picture blends.
            ui.ctx().request_repaint();
        }
    }

    /// Names and borders of the tiles.
    fn paint_tiles(&self, ui: &Ui, lanes: &[Arc<LaneState>]) {
        let line = ui.visuals().widgets.noninteractive.bg_stroke;
        for (number, (rect, lane)) in self.viewport.rects().iter().zip(lanes).enumerate() {
            let painter = ui.painter_at(*rect);
            let [r, g, b] = panels::lane_colour(number);
            let colour = egui::Color32::from_rgb(r, g, b);
            let is_chosen = number == self.session.lane;
            let stroke = if is_chosen { egui::Stroke::new(2.0, colour) } else { line };
            painter.rect_stroke(*rect, 0.0, stroke, egui::StrokeKind::Inside);
            let text = format!("{}  {}", number + 1, panels::name_of(lane));
            let font = egui::FontId::proportional(13.0);
            let at = rect.min + egui::vec2(12.0, 8.0);
            painter.text(at, egui::Align2::LEFT_TOP, text, font, ui.visuals().strong_text_color());
        }
    }

    fn act(&mut self, intent: Intent, lane: &LaneState) {
        let session = &mut self.session;
        let camera = &self.viewport.camera;
        let size = self.viewport.size();
        let select = |session: &mut Session, found: Vec<u32>, add: bool| {
            if !add {
                session.selection.clear();
            }
            session.selection.extend(found);
        };
        match intent {
            Intent::Click { particle, add } => match particle {
                Some(particle) if add && session.selection.contains(&particle) => {
                    session.selection.remove(&particle);
                }
                _ => select(session, particle.into_iter().collect(), add),
            },
            Intent::Box(corners, add) => {
                let found = picking::in_box(&lane.positions, camera, size, corners);
                select(session, found, add);
            }
            Intent::Lasso(outline, add) => {
                let found = picking::in_lasso(&lane.positions, camera, size, &outline);
                select(session, found, add);
            }
            Intent::Deselect => session.selection.clear(),
            Intent::Grab(particle) => session.grab(particle),
            Intent::Drag(by) => session.drag(by.as_dvec3()),
            Intent::Release => session.release(),
            Intent::Cancel => session.cancel_drag(),
            // The viewport has moved its camera already.
            Intent::Orbit(_) | Intent::Pan(_) | Intent::Zoom(..) => {}
        }
    }

    fn title(&mut self, ui: &Ui) {
        let star = if self.session.is_unsaved() { "*" } else { "" };
        let title = format!("{star}{} - Tenter", self.session.title());
        if title != self.window_title {
            self.window_title.clone_from(&title);
            ui.ctx().send_viewport_cmd(ViewportCommand::Title(title));
        }
        let window = ui.input(|input| (input.content_rect().size(), input.viewport().maximized));
        let preferences = &mut self.files.preferences;
        preferences.maximized = window.1.unwrap_or(false);
        if !preferences.maximized {
            preferences.size = window.0.into();
        }
        if self.is_finished {
            ui.ctx().request_repaint();
        }
    }
}

impl Drop for Workbench {
    fn drop(&mut self) {
        if let Some(file) = &self.preferences_file {
            self.files.preferences.style = self.style.clone();
            self.files.preferences.save(file);
        }
    }
}

/// A heading under which a panel can be folded away.
fn section(ui: &mut Ui, name: &str, contents: impl FnOnce(&mut Ui)) {
    let header = egui::CollapsingHeader::new(egui::RichText::new(name).heading());
    header.default_open(true).show_unindented(ui, contents);
    ui.add_space(6.0);
}

impl Content for Workbench {
    fn ui(&mut self, ui: &mut Ui) {
        Self::ui(self, ui);
    }

    fn attach(&mut self, stage: &Stage<'_>) {
        Self::attach(self, stage);
        self.session.message =
            Some("the graphics device was lost; drawing goes on with another one".to_owned());
    }

    fn draw(&mut self, canvas: &mut Canvas<'_>) {
        self.draw_lanes(canvas);
    }

    fn close_requested(&mut self) -> bool {
        self.request(Next::Quit);
        self.is_finished
    }

    fn is_finished(&self) -> bool {
        self.is_finished
    }
}
