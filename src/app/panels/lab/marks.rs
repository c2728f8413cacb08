//! Marks in a diagram that can be pointed at and clicked, and the rows of a legend.

use egui::{Color32, CursorIcon, Id, Pos2, Rect, Response, Sense, Shape, Stroke, Ui, Vec2, WidgetInfo, vec2};
use egui_plot::{MarkerShape, PlotPoint, PlotResponse};

/// How a mark looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Its shape.
    pub shape: MarkerShape,
    /// Its colour.
    pub colour: Color32,
    /// Filled, or hollow.
    pub filled: bool,
}

impl Look {
    /// A filled circle.
    pub fn dot(colour: Color32) -> Self {
        Self { shape: MarkerShape::Circle, colour, filled: true }
    }

    /// Paints it.
    pub fn paint(self, painter: &egui::Painter, at: Pos2, radius: f32) {
        let stroke = Stroke::new((radius * 0.4).clamp(1.2, 2.0), self.colour);
        let line = |a: Vec2, b: Vec2| Shape::line_segment([at + a * radius, at + b * radius], stroke);
        let polygon = |corners: &[Vec2]| {
            let points = corners.iter().map(|corner| at + *corner * radius).collect();
            if self.filled {
                Shape::convex_polygon(points, self.colour, Stroke::NONE)
            } else {
                Shape::closed_line(points, stroke)
            }
        };
        match self.shape {
            MarkerShape::Cross => {
                painter.add(line(vec2(-0.8, -0.8), vec2(0.8, 0.8)));
                painter.add(line(vec2(-0.8, 0.8), vec2(0.8, -0.8)));
            }
            MarkerShape::Plus => {
                painter.add(line(vec2(-1.0, 0.0), vec2(1.0, 0.0)));
                painter.add(line(vec2(0.0, -1.0), vec2(0.0, 1.0)));
            }
            MarkerShape::Down => {
                painter.add(polygon(&[vec2(-0.95, -0.7), vec2(0.95, -0.7), vec2(0.0, 1.0)]));
            }
            MarkerShape::Diamond => {
                let corners = [vec2(0.0, -1.1), vec2(1.1, 0.0), vec2(0.0, 1.1), vec2(-1.1, 0.0)];
                painter.add(polygon(&corners));
            }
            _ if self.filled => {
                painter.circle_filled(at, radius, self.colour);
            }
            _ => {
                painter.circle_stroke(at, radius * 0.9, stroke);
            }
        }
    }
}

/// A mark of a diagram, drawn over it: pointed at it grows, and a screen reader and a test know it by its name.
pub fn mark_ui<R>(
    ui: &mut Ui,
    plot: &PlotResponse<R>,
    id: Id,
    [x, y]: [f64; 2],
    look: Look,
    name: &str,
) -> Option<Response> {
    let at = plot.transform.position_from_point(&PlotPoint::new(x, y));
    let frame = *plot.transform.frame();
    if !frame.contains(at) {
        return None;
    }
    let rect = Rect::from_center_size(at, Vec2::splat(9.0));
    let response = ui.interact(rect, id, Sense::CLICK).on_hover_cursor(CursorIcon::PointingHand);
    response.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, name));
    let painter = ui.painter_at(frame);
    if response.hovered() {
        painter.circle_stroke(at, 8.0, Stroke::new(1.5, ui.visuals().strong_text_color()));
    }
    look.paint(&painter, at, if response.hovered() { 5.0 } else { 3.6 });
    Some(response)
}

/// A ring with a cross around a place of a diagram: what is set now.
pub fn now_ui<R>(ui: &Ui, plot: &PlotResponse<R>, [x, y]: [f64; 2]) {
    let frame = *plot.transform.frame();
    let at = plot.transform.position_from_point(&PlotPoint::new(x, y));
    let (painter, colour) = (ui.painter_at(frame), ui.visuals().strong_text_color());
    let under = Stroke::new(4.0, ui.visuals().extreme_bg_color.gamma_multiply(0.7));
    for stroke in [under, Stroke::new(2.0, colour)] {
        painter.circle_stroke(at, 8.0, stroke);
        for along in [vec2(1.0, 0.0), vec2(0.0, 1.0)] {
            painter.line_segment([at + along * 8.0, at + along * 13.0], stroke);
            painter.line_segment([at - along * 8.0, at - along * 13.0], stroke);
        }
    }
}

/// A row of a legend that explains a mark.
pub fn legend_mark_ui(ui: &mut Ui, look: Look, text: &str) {
    ui.horizontal(|ui| {
        let (rect, _) = ui.allocate_exact_size(vec2(16.0, 14.0), Sense::hover());
        look.paint(ui.painter(), rect.center(), 4.0);
        ui.add(egui::Label::new(egui::RichText::new(text).small()).wrap());
    });
}

/// A row of a legend that explains a line; a dashed one is drawn in pieces.
pub fn legend_line_ui(ui: &mut Ui, stroke: Stroke, dashed: bool, text: &str) {
    ui.horizontal(|ui| {
        let (rect, _) = ui.allocate_exact_size(vec2(16.0, 14.0), Sense::hover());
        let ends = [rect.left_center(), rect.right_center()];
        if dashed {
            ui.painter().extend(Shape::dashed_line(&ends, stroke, 4.0, 3.0));
        } else {
            ui.painter().line_segment(ends, stroke);
        }
        ui.add(egui::Label::new(egui::RichText::new(text).small()).wrap());
    });
}
