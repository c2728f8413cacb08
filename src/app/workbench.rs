//! The workbench: panels around the viewport, and what the keys and the mouse do.

use std::time::Instant;

use egui::{Key, Modifiers, Ui};
use glam::Vec3;

use super::{
    camera::{Bounds, Side},
    engine::{LaneState, Order, Values},
    hands::Intent,
    panels, picking,
    render::{Cloth, Frame, Style, Theme, flag},
    session::Session,
    shell::{Canvas, Content, Stage},
    theme,
    viewport::{Drawing, Tile, Viewport},
};

/// What fills the window.
pub struct Workbench {
    /// The simulation's other end.
    pub session: Session,
    /// What is shown.
    pub style: Style,
    viewport: Viewport,
    drawing: Option<(Drawing, Vec<Cloth>)>,
    device: String,
    /// The first frame looks at the whole cloth.
    focus: bool,
    /// Counts what the cloth on the device must follow: new states, selections, blends.
    frame: u64,
    positions: Vec<[f32; 3]>,
    flags: Vec<u32>,
    ground_height: f32,
    finished: bool,
}

impl Workbench {
    /// A workbench without a device: its panels work, nothing is drawn.
    pub fn new(session: Session) -> Self {
        Self {
            session,
            style: Style::default(),
            viewport: Viewport::default(),
            drawing: None,
            device: String::new(),
            focus: true,
            frame: 0,
            positions: Vec::new(),
            flags: Vec::new(),
            ground_height: 0.0,
            finished: false,
        }
    }

    /// Draws on a device from now on.
    pub fn attach(&mut self, stage: &Stage<'_>) {
        self.drawing = Some((Drawing::new(stage), Vec::new()));
        self.device = stage.gpu.description();
        theme::apply(stage.egui);
    }

    /// Bytes uploaded for the last picture.
    pub fn uploaded(&self) -> u64 {
        self.drawing.as_ref().map_or(0, |(drawing, _)| drawing.uploaded())
    }

    /// One frame of panels and input.
    pub fn ui(&mut self, ui: &mut Ui) {
        self.session.refresh();
        self.keys(ui);
        let dark = self.style.theme == Theme::Dark;
        ui.ctx().set_theme(if dark { egui::Theme::Dark } else { egui::Theme::Light });
        egui::Panel::top("top").show(ui, |ui| {
            ui.horizontal(|ui| {
                ui.strong("Tenter");
                ui.separator();
                panels::transport_ui(ui, &mut self.session);
            });
        });
        egui::Panel::bottom("status").show(ui, |ui| {
            let uploaded = self.uploaded();
            panels::status_ui(ui, &self.session, &self.device, uploaded);
        });
        egui::Panel::left("simulation").default_size(320.0).size_range(260.0..=480.0).show(ui, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                ui.heading("Simulation");
                panels::simulation_ui(ui, &mut self.session);
            });
        });
        egui::Panel::right("display").default_size(270.0).size_range(220.0..=420.0).show(ui, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                ui.heading("Health");
                panels::health_ui(ui, &self.session);
                ui.separator();
                ui.heading("Display");
                panels::display_ui(ui, &mut self.style);
            });
        });
        self.session.want(if self.style.surface_values { Values::Strain } else { Values::None });
        egui::CentralPanel::no_frame().show(ui, |ui| self.viewport_ui(ui));
    }

    fn viewport_ui(&mut self, ui: &mut Ui) {
        let state = self.session.state();
        let Some(lane) = state.lanes.get(self.session.lane).cloned() else { return };
        let triangles: &[[u32; 3]] = if self.style.surface { &lane.geometry.triangles } else { &[] };
        let target = picking::Target { positions: &lane.positions, triangles };
        let intents = self.viewport.ui(ui, &target);
        if self.focus && self.viewport.size().min_element() > 1.0 {
            self.focus = false;
            self.look_at_all(&lane);
        }
        for intent in intents {
            self.act(intent, &lane);
        }
        self.viewport.paint_axes(ui);
        if state_is_moving(&self.session) {
            ui.ctx().request_repaint();
        }
    }

    fn look_at_all(&mut self, lane: &LaneState) {
        let size = self.viewport.size();
        if let Some(bounds) = Bounds::of(lane.positions.iter()) {
            // Cloth falls: below a flat sheet there must be room for it.
            let fall = ((bounds.max - bounds.min).with_y(0.0).max_element() - (bounds.max.y - bounds.min.y))
                .max(0.0);
            let room = Bounds { min: bounds.min - Vec3::Y * fall * 0.8, max: bounds.max };
            self.ground_height = bounds.min.y - fall * 1.1 - bounds.radius() * 0.1;
            self.viewport.camera.focus(&room, size);
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

    fn keys(&mut self, ui: &Ui) {
        if ui.ctx().egui_wants_keyboard_input() {
            return;
        }
        let pressed = |key| ui.input_mut(|input| input.consume_key(Modifiers::NONE, key));
        let command = |key, modifiers| ui.input_mut(|input| input.consume_key(modifiers, key));
        if command(Key::Z, Modifiers::COMMAND | Modifiers::SHIFT) || command(Key::Y, Modifiers::COMMAND) {
            self.session.redo();
        } else if command(Key::Z, Modifiers::COMMAND) {
            self.session.undo();
        }
        if pressed(Key::Space) {
            self.session.run(!self.session.running());
        }
        if pressed(Key::Period) {
            self.session.order(Order::Step(1));
        }
        if pressed(Key::R) {
            self.session.reset();
        }
        if pressed(Key::P) {
            self.session.pin_selection();
        }
        if pressed(Key::F) {
            self.focus = true;
        }
        for (key, side) in [(Key::Num1, Side::Front), (Key::Num3, Side::Right), (Key::Num7, Side::Top)] {
            if pressed(key) {
                self.viewport.camera.look_from(side);
            }
        }
        if pressed(Key::Num5) {
            self.viewport.camera.switch_projection();
        }
    }
}

/// Whether the picture changes by itself: between two states it blends.
fn state_is_moving(session: &Session) -> bool {
    session.state().running && session.state().lanes.iter().any(|lane| lane.previous.is_some())
}

impl Content for Workbench {
    fn ui(&mut self, ui: &mut Ui) {
        Self::ui(self, ui);
    }

    fn draw(&mut self, canvas: &mut Canvas<'_>) {
        let Some((drawing, cloths)) = &mut self.drawing else { return };
        let (device, queue) = (&canvas.gpu.device, &canvas.gpu.queue);
        let state = self.session.state();
        while cloths.len() < state.lanes.len() {
            cloths.push(Cloth::new(device, queue, drawing.renderer()));
        }
        cloths.truncate(state.lanes.len());
        self.frame += 1;
        let mut bounds: Option<Bounds> = None;
        for (lane, cloth) in state.lanes.iter().zip(cloths.iter_mut()) {
            let blended = blend(state.running, state.at, state.beat, lane, &mut self.positions);
            let positions = if blended { &self.positions } else { lane.positions.as_ref() };
            self.flags.clone_from(&lane.flags);
            for particle in &self.session.selection {
                if let Some(flag) = self.flags.get_mut(*particle as usize) {
                    *flag |= flag::SELECTED;
                }
            }
            cloth.set_topology(device, queue, drawing.renderer(), &lane.geometry.topology());
            let kinds = lane.scene.springs.kinds();
            let frame = Frame {
                // A still picture uploads nothing: the state's version stands for all that it holds.
                version: if blended { u64::MAX - self.frame } else { state.version },
                positions,
                flags: &self.flags,
                values: lane.values.as_ref().map(|values| values.as_slice()),
                enabled: kinds.each_ref().map(|kind| kind.enabled),
                rest_scale: kinds.each_ref().map(|kind| kind.rest_scale as f32),
                tint: None,
            };
            cloth.set_frame(device, queue, drawing.renderer(), &frame, &self.style);
            bounds = [bounds, Bounds::of(positions.iter())].into_iter().flatten().reduce(|a, b| a.union(&b));
        }
        let tile = Tile {
            viewport: &self.viewport,
            lanes: 0..cloths.len(),
            ground_height: self.ground_height,
            bounds,
        };
        drawing.draw(canvas, &[tile], cloths, &self.style);
    }

    fn close_requested(&mut self) -> bool {
        true
    }

    fn is_finished(&self) -> bool {
        self.finished
    }
}

/// Writes the lane's positions between its last two states into `into`; false if the last state is to be shown as it is.
fn blend(
    running: bool,
    at: Instant,
    beat: std::time::Duration,
    lane: &LaneState,
    into: &mut Vec<[f32; 3]>,
) -> bool {
    let Some(previous) = lane.previous.as_ref().filter(|_| running && !beat.is_zero()) else { return false };
    let part = (at.elapsed().as_secs_f32() / beat.as_secs_f32()).min(1.0);
    into.clear();
    into.extend(
        previous
            .iter()
            .zip(lane.positions.iter())
            .map(|(&a, &b)| Vec3::from(a).lerp(Vec3::from(b), part).to_array()),
    );
    true
}
