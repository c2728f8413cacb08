//! Buttons with drawn icons: the fonts do not have these signs on every system.

use std::f32::consts::{PI, TAU};

use egui::{
    Color32, Pos2, Rect, Response, Sense, Shape, Stroke, Ui, Vec2, WidgetInfo, epaint::PathShape, vec2,
};

/// The signs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Icon {
    /// A triangle to the right.
    Play,
    /// Two bars.
    Pause,
    /// A triangle and a bar.
    Step,
    /// A bar and a triangle to the left.
    Start,
    /// An arrow that turns back.
    Back,
}

/// A button with an icon; `name` is what a screen reader says, `tip` what a tooltip adds.
pub fn icon_button(ui: &mut Ui, icon: Icon, name: &str, tip: &str) -> Response {
    button(ui, icon, name, tip, vec2(30.0, 24.0), true)
}

/// A small one without a frame, as it stands at the end of a row.
pub fn small_icon_button(ui: &mut Ui, icon: Icon, name: &str, tip: &str) -> Response {
    let side = ui.spacing().interact_size.y * 0.85;
    button(ui, icon, name, tip, Vec2::splat(side), false)
}

fn button(ui: &mut Ui, icon: Icon, name: &str, tip: &str, size: Vec2, framed: bool) -> Response {
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    response.widget_info(|| WidgetInfo::labeled(egui::Role::Button, ui.is_enabled(), name));
    let visuals = ui.style().interact(&response);
    if framed || response.hovered() || response.has_focus() {
        ui.painter().rect(
            rect.expand(visuals.expansion),
            visuals.corner_radius,
            visuals.weak_bg_fill,
            visuals.bg_stroke,
            egui::StrokeKind::Inside,
        );
    }
    let colour = if framed { visuals.text_color() } else { visuals.text_color().gamma_multiply(0.7) };
    let side = rect.size().min_elem() * if framed { 0.5 } else { 0.6 };
    for shape in shapes(icon, Rect::from_center_size(rect.center(), Vec2::splat(side)), colour) {
        ui.painter().add(shape);
    }
    response.on_hover_text(tip)
}

fn shapes(icon: Icon, r: Rect, colour: Color32) -> Vec<Shape> {
    let triangle = |from: f32, to: f32| {
        let points = vec![Pos2::new(from, r.top()), Pos2::new(to, r.center().y), Pos2::new(from, r.bottom())];
        // Clockwise, or egui's feathering is inside out.
        let points = if to > from { points } else { points.into_iter().rev().collect() };
        Shape::Path(PathShape::convex_polygon(points, colour, Stroke::NONE))
    };
    let bar = |x: f32| {
        Shape::rect_filled(Rect::from_x_y_ranges(x..=x + r.width() * 0.22, r.y_range()), 1.0, colour)
    };
    match icon {
        Icon::Play => vec![triangle(r.left() + r.width() * 0.08, r.right())],
        Icon::Pause => vec![bar(r.left() + r.width() * 0.12), bar(r.right() - r.width() * 0.34)],
        Icon::Step => {
            vec![triangle(r.left(), r.right() - r.width() * 0.25), bar(r.right() - r.width() * 0.22)]
        }
        Icon::Start => vec![bar(r.left()), triangle(r.right(), r.left() + r.width() * 0.25)],
        Icon::Back => {
            let radius = r.width() * 0.4;
            let at = |angle: f32| r.center() + radius * vec2(angle.cos(), angle.sin());
            let (start, end) = (-PI * 0.75, PI * 0.75);
            let arc = (0..=20).map(|i| at(start + (end - start) * i as f32 / 20.0)).collect();
            let tip = at(start);
            let head = [0.35, 0.35 + TAU / 4.0]
                .map(|turn| tip + radius * 0.9 * vec2(f32::cos(turn - 1.2), f32::sin(turn - 1.2)));
            let stroke = Stroke::new(1.3, colour);
            vec![
                Shape::line(arc, stroke),
                Shape::line_segment([tip, head[0]], stroke),
                Shape::line_segment([tip, head[1]], stroke),
            ]
        }
    }
}
