//! How the panels look, dark and light: quiet, close, and with one accent.

use egui::{
    Color32, Context, CornerRadius, FontId, Stroke, Style, TextStyle, Theme, style::WidgetVisuals, vec2,
};

/// Sets fonts, spacing and colours of both themes.
pub fn apply(context: &Context) {
    context.all_styles_mut(|style| {
        style.spacing.item_spacing = vec2(8.0, 4.0);
        style.spacing.button_padding = vec2(7.0, 2.0);
        style.spacing.interact_size.y = 20.0;
        style.spacing.indent = 12.0;
        style.spacing.slider_rail_height = 4.0;
        // A scroll bar lies beside what is scrolled, not on it, and tells at all times that there is more.
        let scroll = &mut style.spacing.scroll;
        scroll.floating_allocated_width = 8.0;
        scroll.floating_width = 4.0;
        (scroll.dormant_handle_opacity, scroll.dormant_background_opacity) = (0.6, 0.3);
        style.text_styles = [
            (TextStyle::Heading, FontId::proportional(15.0)),
            (TextStyle::Body, FontId::proportional(13.0)),
            (TextStyle::Button, FontId::proportional(13.0)),
            (TextStyle::Monospace, FontId::monospace(12.0)),
            (TextStyle::Small, FontId::proportional(11.0)),
        ]
        .into();
    });
    context.style_mut_of(Theme::Dark, |style| {
        colour(
            style,
            &Palette {
                panel: Color32::from_rgb(27, 29, 34),
                field: Color32::from_rgb(17, 18, 22),
                widget: Color32::from_rgb(44, 47, 55),
                hovered: Color32::from_rgb(58, 62, 72),
                line: Color32::from_rgb(48, 51, 59),
                text: Color32::from_rgb(206, 210, 218),
                strong: Color32::from_rgb(240, 242, 246),
                accent: Color32::from_rgb(72, 132, 208),
            },
        );
    });
    context.style_mut_of(Theme::Light, |style| {
        colour(
            style,
            &Palette {
                panel: Color32::from_rgb(244, 245, 247),
                field: Color32::from_rgb(255, 255, 255),
                widget: Color32::from_rgb(224, 227, 232),
                hovered: Color32::from_rgb(210, 214, 221),
                line: Color32::from_rgb(206, 210, 217),
                text: Color32::from_rgb(52, 56, 64),
                strong: Color32::from_rgb(16, 18, 22),
                accent: Color32::from_rgb(44, 108, 190),
            },
        );
    });
}

struct Palette {
    panel: Color32,
    field: Color32,
    widget: Color32,
    hovered: Color32,
    line: Color32,
    text: Color32,
    strong: Color32,
    accent: Color32,
}

fn colour(style: &mut Style, palette: &Palette) {
    let visuals = &mut style.visuals;
    visuals.panel_fill = palette.panel;
    visuals.window_fill = palette.panel;
    visuals.window_stroke = Stroke::new(1.0, palette.line);
    visuals.extreme_bg_color = palette.field;
    visuals.faint_bg_color = palette.widget.gamma_multiply(0.5);
    visuals.selection.bg_fill = palette.accent.gamma_multiply(0.75);
    visuals.selection.stroke = Stroke::new(1.0, Color32::WHITE);
    visuals.hyperlink_color = palette.accent;
    visuals.slider_trailing_fill = true;
    let set = |widget: &mut WidgetVisuals, fill: Color32, text: Color32| {
        widget.bg_fill = fill;
        widget.weak_bg_fill = fill;
        widget.bg_stroke = Stroke::NONE;
        widget.fg_stroke = Stroke::new(1.0, text);
        widget.corner_radius = CornerRadius::same(4);
        widget.expansion = 0.0;
    };
    let widgets = &mut visuals.widgets;
    set(&mut widgets.noninteractive, palette.panel, palette.text);
    widgets.noninteractive.bg_stroke = Stroke::new(1.0, palette.line);
    set(&mut widgets.inactive, palette.widget, palette.text);
    set(&mut widgets.hovered, palette.hovered, palette.strong);
    set(&mut widgets.active, palette.accent, palette.strong);
    set(&mut widgets.open, palette.hovered, palette.strong);
}
