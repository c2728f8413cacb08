//! The viewport in the middle of the window: the camera, the mouse over it, and what is drawn beneath the panels.

use egui::{Color32, Pos2, Sense, Stroke};
use glam::{Vec2, Vec3};

use super::{
    camera::{Bounds, Camera},
    hands::{Hands, Intent, Pointer},
    picking,
    render::{Cloth, Look, Renderer, Style, View},
    shell::{Canvas, Stage},
};

/// Pixels around the cursor within which a particle is picked, points.
const PICK_TOLERANCE: f32 = 10.0;

/// One look at the cloth, with the mouse over it.
pub struct Viewport {
    /// Where one looks from.
    pub camera: Camera,
    /// What the mouse does.
    pub hands: Hands,
    /// Where the pictures are in the window, points: one, or a tile for each lane.
    rects: Vec<egui::Rect>,
    /// The tile that the mouse is over, or in which it was pressed.
    pub active: usize,
    pixels_per_point: f32,
    /// The button presses that began here, and not on a panel above.
    pressed: bool,
}

impl Default for Viewport {
    fn default() -> Self {
        Self {
            camera: Camera::default(),
            hands: Hands::default(),
            rects: vec![egui::Rect::ZERO],
            active: 0,
            pixels_per_point: 1.0,
            pressed: false,
        }
    }
}

impl Viewport {
    /// Size of the picture, or of each tile, pixels.
    pub fn size(&self) -> Vec2 {
        let rect = self.rect();
        Vec2::new(rect.width(), rect.height()) * self.pixels_per_point
    }

    /// The tile that the mouse is over, points.
    fn rect(&self) -> egui::Rect {
        self.rects.get(self.active).or(self.rects.first()).copied().unwrap_or(egui::Rect::ZERO)
    }

    /// All tiles, points.
    pub fn rects(&self) -> &[egui::Rect] {
        &self.rects
    }

    /// Takes the rest of `ui`, divided into so many tiles, and the mouse over it; `target` is what can be picked in a tile. Does what
    /// the camera can do and returns what the others must.
    pub fn ui<'a>(
        &mut self,
        ui: &mut egui::Ui,
        tiles: usize,
        target: impl Fn(usize) -> picking::Target<'a>,
    ) -> Vec<Intent> {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Canvas, true, "Viewport"));
        self.rects = divide(rect, tiles.max(1));
        self.active = self.active.min(self.rects.len() - 1);
        if let Some(at) = response.hover_pos()
            && !self.pressed
            && let Some(tile) = self.rects.iter().position(|rect| rect.contains(at))
        {
            self.active = tile;
        }
        self.pixels_per_point = ui.pixels_per_point();
        let pointer = self.pointer(ui, &response);
        let tapped = !pointer.left
            && response.contains_pointer()
            && ui.input(|input| input.pointer.button_pressed(egui::PointerButton::Primary));
        let size = self.size();
        if size.min_element() < 1.0 {
            return Vec::new();
        }
        let tolerance = PICK_TOLERANCE * self.pixels_per_point;
        let camera = self.camera;
        let target = &target(self.active);
        let mut update = |pointer: &Pointer| {
            self.hands.update(
                pointer,
                &camera,
                size,
                |at| picking::nearest(target, &camera, size, at, tolerance),
                |particle| target.positions.get(particle as usize).map(|&p| Vec3::from(p)),
            )
        };
        let mut intents = Vec::new();
        if tapped {
            // Down and up again within one slow picture is a click all the same.
            intents.extend(update(&Pointer { left: true, ..pointer }));
        }
        intents.extend(update(&pointer));
        intents.retain(|intent| {
            match *intent {
                Intent::Orbit(drag) => self.camera.orbit(drag, size),
                Intent::Pan(drag) => self.camera.pan(drag, size),
                Intent::Zoom(factor, at) => self.camera.zoom(1.0 / factor, at, size),
                _ => return true,
            }
            false
        });
        if let Some(at) = pointer.at {
            self.paint_outline(ui, at);
        }
        intents
    }

    fn pointer(&mut self, ui: &egui::Ui, response: &egui::Response) -> Pointer {
        let over = response.contains_pointer();
        ui.input(|input| {
            let buttons = &input.pointer;
            // A drag that began here goes on outside of the viewport; one that began on a panel does not come in.
            if buttons.any_pressed() && over {
                self.pressed = true;
            } else if !buttons.any_down() {
                self.pressed = false;
            }
            let down = |button| self.pressed && buttons.button_down(button);
            let at = buttons.latest_pos().filter(|_| over || self.pressed || self.hands.are_holding());
            let scroll =
                if over { (input.smooth_scroll_delta().y * 0.004).exp() * input.zoom_delta() } else { 1.0 };
            Pointer {
                at: at.map(|p| self.to_pixel(p)),
                moved: Vec2::new(buttons.delta().x, buttons.delta().y) * self.pixels_per_point,
                left: down(egui::PointerButton::Primary),
                right: down(egui::PointerButton::Secondary),
                middle: down(egui::PointerButton::Middle),
                shift: input.modifiers.shift,
                ctrl: input.modifiers.command,
                escape: input.key_pressed(egui::Key::Escape),
                zoom: scroll,
            }
        })
    }

    fn to_pixel(&self, point: Pos2) -> Vec2 {
        let min = self.rect().min;
        Vec2::new(point.x - min.x, point.y - min.y) * self.pixels_per_point
    }

    fn to_point(&self, pixel: Vec2) -> Pos2 {
        self.rect().min + egui::vec2(pixel.x, pixel.y) / self.pixels_per_point
    }

    fn paint_outline(&self, ui: &egui::Ui, at: Vec2) {
        let outline: Vec<Pos2> = self.hands.outline(at).into_iter().map(|p| self.to_point(p)).collect();
        if outline.len() > 1 {
            let colour = Color32::from_rgb(80, 200, 255);
            let painter = ui.painter_at(self.rect());
            if let [a, _, b, _] = outline[..] {
                painter.rect_filled(egui::Rect::from_two_pos(a, b), 0.0, colour.gamma_multiply(0.08));
            }
            painter.add(egui::Shape::closed_line(outline, Stroke::new(1.0, colour)));
        }
    }

    /// A line from each particle to the hand whose spring pulls it.
    pub fn paint_springs(&self, ui: &egui::Ui, springs: &[(Vec3, Vec3)]) {
        let (projector, painter) = (self.camera.projector(self.size()), ui.painter_at(self.rect()));
        let colour = Color32::from_rgb(255, 220, 120);
        for (particle, hand) in springs {
            if let (Some(from), Some(to)) = (projector.pixel(*particle), projector.pixel(*hand)) {
                let (from, to) = (self.to_point(from.pixel), self.to_point(to.pixel));
                painter.line_segment([from, to], Stroke::new(1.5, colour));
                painter.circle_filled(to, 4.0, colour);
            }
        }
    }

    /// Three short axes in a corner: which way is up.
    pub fn paint_axes(&self, ui: &egui::Ui) {
        let [right, up, forward] = self.camera.axes();
        let Some(rect) = self.rects.first() else { return };
        let origin = egui::pos2(rect.min.x + 40.0, rect.max.y - 40.0);
        let painter = ui.painter_at(*rect);
        let mut axes = [
            (Vec3::X, "x", Color32::from_rgb(226, 90, 92)),
            (Vec3::Y, "y", Color32::from_rgb(120, 196, 96)),
            (Vec3::Z, "z", Color32::from_rgb(92, 142, 240)),
        ];
        // The farthest first, so that the nearest lies on top.
        axes.sort_by(|a, b| b.0.dot(forward).total_cmp(&a.0.dot(forward)));
        for (axis, name, colour) in axes {
            let colour = if axis.dot(forward) > 0.2 { colour.gamma_multiply(0.55) } else { colour };
            let direction = egui::vec2(axis.dot(right), -axis.dot(up));
            painter.line_segment([origin, origin + direction * 24.0], Stroke::new(2.0, colour));
            let font = egui::FontId::proportional(12.0);
            painter.text(origin + direction * 32.0, egui::Align2::CENTER_CENTER, name, font, colour);
        }
    }
}

/// Divides a rectangle into equal tiles, in as many columns as keeps them broad.
fn divide(rect: egui::Rect, tiles: usize) -> Vec<egui::Rect> {
    let columns = (1..=tiles).find(|columns| columns * columns * 2 >= tiles).unwrap_or(1);
    let columns = if tiles == 2 { 2 } else { columns.max(usize::from(tiles > 2) * 2) };
    let rows = tiles.div_ceil(columns);
    let size = egui::vec2(rect.width() / columns as f32, rect.height() / rows as f32);
    let at = |i: usize| egui::vec2((i % columns) as f32 * size.x, (i / columns) as f32 * size.y);
    let mut rects: Vec<_> = (0..tiles).map(|i| egui::Rect::from_min_size(rect.min + at(i), size)).collect();
    if let Some(last) = rects.last_mut() {
        // What is left of the last row belongs to its last tile.
        last.max = rect.max;
    }
    rects
}

/// The device's side of the viewports: pipelines, and one view for each tile.
pub struct Drawing {
    renderer: Renderer,
    views: Vec<View>,
    uploaded: u64,
}

/// One tile of a picture.
pub struct Tile<'a> {
    /// Where one looks from.
    pub camera: &'a Camera,
    /// Where it is in the window, points.
    pub rect: egui::Rect,
    /// The lanes drawn in it, by number.
    pub lanes: std::ops::Range<usize>,
    /// Height of the ground, m.
    pub ground_height: f32,
    /// Box around these lanes.
    pub bounds: Option<Bounds>,
}

impl Drawing {
    /// Pipelines for the window.
    pub fn new(stage: &Stage<'_>) -> Self {
        let renderer = Renderer::new(&stage.gpu.device, stage.format, stage.samples);
        Self { renderer, views: Vec::new(), uploaded: 0 }
    }

    /// The pipelines, which a cloth is made for.
    pub fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// Draws tiles of cloths onto the canvas.
    pub fn draw(&mut self, canvas: &mut Canvas<'_>, tiles: &[Tile<'_>], cloths: &mut [Cloth], style: &Style) {
        let device = &canvas.gpu.device;
        while self.views.len() < tiles.len() {
            self.views.push(View::new(device, &self.renderer));
        }
        let [width, height] = canvas.attachments.size();
        self.uploaded = 0;
        for (tile, view) in tiles.iter().zip(&mut self.views) {
            let look = Look {
                camera: tile.camera,
                size: (Vec2::new(tile.rect.width(), tile.rect.height()) * canvas.pixels_per_point)
                    .max(Vec2::ONE),
                pixels_per_point: canvas.pixels_per_point,
                ground_height: tile.ground_height,
                bounds: tile.bounds,
            };
            view.set(&canvas.gpu.queue, &look, style);
            self.renderer.prepare(device, canvas.encoder, view, &mut cloths[tile.lanes.clone()], style);
            self.uploaded += view.take_uploaded();
        }
        let mut pass = canvas.attachments.begin(canvas.encoder, canvas.target, wgpu::Color::BLACK);
        for (tile, view) in tiles.iter().zip(&self.views) {
            let min = tile.rect.min * canvas.pixels_per_point;
            let size = tile.rect.size() * canvas.pixels_per_point;
            // A layout may reach past the window for a frame while it is resized.
            let x = min.x.clamp(0.0, width as f32 - 1.0);
            let y = min.y.clamp(0.0, height as f32 - 1.0);
            let w = size.x.min(width as f32 - x).max(1.0);
            let h = size.y.min(height as f32 - y).max(1.0);
            pass.set_viewport(x, y, w, h, 0.0, 1.0);
            let right = (x + w).ceil().min(width as f32) as u32;
            let bottom = (y + h).ceil().min(height as f32) as u32;
            pass.set_scissor_rect(x as u32, y as u32, right - x as u32, bottom - y as u32);
            self.renderer.draw(&mut pass, view, &cloths[tile.lanes.clone()], style);
        }
        drop(pass);
        self.uploaded += cloths.iter_mut().map(Cloth::take_uploaded).sum::<u64>();
    }

    /// Bytes uploaded for the last picture.
    pub fn uploaded(&self) -> u64 {
        self.uploaded
    }
}
