//! Parameters as widgets: a visitor that draws every parameter from its own declaration, so that a new method or force has its
//! panel at once.

use egui::{Color32, RichText, Slider, SliderClamping, Ui, WidgetInfo};
use glam::DVec3;

use super::icons::{Icon, small_icon_button};
use crate::params::{Info, Scale, Visitor};

/// A parameter that the user has changed: its path in the scene, and RON texts of its value now and before.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// As in `springs.stretch.stiffness`.
    pub key: String,
    /// Now.
    pub value: String,
    /// Before.
    pub before: String,
}

/// Draws parameters and collects what is changed.
pub struct ParamsUi<'a> {
    ui: &'a mut Ui,
    path: Vec<&'static str>,
    prefix: &'a str,
    /// Set where a switch hides the rest of its group.
    hidden: bool,
    hide: &'a dyn Fn(&str) -> bool,
    /// The choices of this group that were drawn: what hangs on one of them stands behind it.
    chosen: Vec<(&'static str, &'static str)>,
    changes: Vec<Change>,
    ended: bool,
}

/// What came of drawing parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Changes {
    /// Changed in this frame.
    pub changes: Vec<Change>,
    /// A slider was let go or a field left: the edit is complete.
    pub ended: bool,
}

impl Changes {
    /// Adds those of another set.
    pub fn add(&mut self, more: Self) {
        self.changes.extend(more.changes);
        self.ended |= more.ended;
    }
}

/// Draws what `show` shows to a visitor. Paths begin with `prefix`; a path for which `hide` is true is left out.
pub fn params_ui(
    ui: &mut Ui,
    prefix: &str,
    hide: &dyn Fn(&str) -> bool,
    show: impl FnOnce(&mut dyn Visitor),
) -> Changes {
    let mut drawer = ParamsUi::new(ui, Vec::new(), prefix, hide);
    show(&mut drawer);
    Changes { changes: drawer.changes, ended: drawer.ended }
}

/// From the panel's edge to the widgets, points.
const LABEL_WIDTH: f32 = 122.0;

impl<'a> ParamsUi<'a> {
    fn new(ui: &'a mut Ui, path: Vec<&'static str>, prefix: &'a str, hide: &'a dyn Fn(&str) -> bool) -> Self {
        let (chosen, changes) = (Vec::new(), Vec::new());
        Self { ui, path, prefix, hidden: false, hide, chosen, changes, ended: false }
    }

    fn key(&self, name: &str) -> String {
        let parts = std::iter::once(self.prefix).chain(self.path.iter().copied()).chain([name]);
        parts.filter(|part| !part.is_empty()).collect::<Vec<_>>().join(".")
    }

    fn is_shown(&self, key: &str) -> bool {
        !self.hidden && !(self.hide)(key)
    }

    /// One row: label with tooltip, the widget, and a button back to the default where it differs.
    fn row(
        &mut self,
        info: &'static Info,
        [value, default]: [String; 2],
        accepted: &str,
        widget: impl FnOnce(&mut Ui, &str) -> (egui::Response, Option<String>),
    ) {
        let key = self.key(info.name);
        if !self.is_shown(&key) || info.when.is_some_and(|choice| !self.chosen.contains(&choice)) {
            return;
        }
        let name = accessible_name(&key);
        let differs = value != default;
        let (mut changed, mut ended) = (None, false);
        self.ui.horizontal(|ui| {
            let text = RichText::new(info.label());
            let text = if differs { text.strong() } else { text };
            let height = ui.spacing().interact_size.y;
            // However deep a group is, its widgets stand below each other.
            let indent = ui.cursor().left() - ui.clip_rect().left();
            let width = (LABEL_WIDTH - indent).max(40.0);
            let label = ui.allocate_ui_with_layout(
                egui::vec2(width, height),
                egui::Layout::left_to_right(egui::Align::Center),
                |ui| {
                    ui.set_min_width(width);
                    ui.add(egui::Label::new(text).truncate())
                },
            );
            let tip = tooltip(info, accepted, &key, &default);
            label.inner.on_hover_text(&tip);
            let (response, new) = widget(ui, &name);
            ended = response.drag_stopped()
                || response.lost_focus()
                || (response.changed() && !response.dragged());
            response.on_hover_text(tip);
            changed = new;
            if differs {
                let (name, tip) = (format!("Default of {name}"), format!("Back to {default}"));
                if small_icon_button(ui, Icon::Back, &name, &tip).clicked() {
                    changed = Some(default.clone());
                    ended = true;
                }
            }
        });
        self.ended |= ended;
        if let Some(new) = changed
            && new != value
        {
            self.changes.push(Change { key, value: new, before: value });
        }
    }
}

/// `MassWeighted` becomes `Mass weighted`.
fn spaced(name: &str) -> String {
    let mut words = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !words.is_empty() {
            words.push(' ');
            words.extend(letter.to_lowercase());
        } else {
            words.push(letter);
        }
    }
    words
}

/// `springs.stretch.stiffness` becomes `Springs stretch stiffness`: what a screen reader and a test call it.
pub fn accessible_name(key: &str) -> String {
    let mut name = key.replace(['.', '_'], " ");
    if let Some(first) = name.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    name
}

fn tooltip(info: &Info, accepted: &str, key: &str, default: &str) -> String {
    format!("{}\n\nAccepted: {accepted}\nDefault: {default}\nKey: {key}", info.doc.trim())
}

fn number_slider(ui: &mut Ui, info: &Info, value: &mut f64, name: &str, integer: bool) -> egui::Response {
    let suffix = if info.unit.is_empty() { String::new() } else { format!(" {}", info.unit) };
    let response = if let Some((scale, range)) = &info.slider {
        // Beside it there is room for a long number and the way back to the default: what does not fit makes the panel grow.
        ui.spacing_mut().slider_width = (ui.available_width() - 140.0).clamp(40.0, 150.0);
        let mut slider = Slider::new(value, range.clone())
            .logarithmic(*scale == Scale::Log)
            .clamping(SliderClamping::Never)
            .smallest_positive(1e-6)
            .suffix(suffix);
        if integer {
            slider = slider.integer();
        } else {
            slider = slider.max_decimals(6);
        }
        ui.add(slider)
    } else {
        let speed = (value.abs() * 0.01).max(1e-4);
        ui.add(egui::DragValue::new(value).speed(speed).suffix(suffix).max_decimals(6))
    };
    let shown = *value;
    response.widget_info(|| WidgetInfo::slider(true, shown, name));
    response
}

impl Visitor for ParamsUi<'_> {
    fn number(&mut self, info: &'static Info, value: &mut f64, default: f64) {
        let texts = [ron(*value), ron(default)];
        self.row(info, texts, &info.accepted(), |ui, name| {
            let mut new = *value;
            let response = number_slider(ui, info, &mut new, name, false);
            (response, (new != *value).then(|| ron(new)))
        });
    }

    fn count(&mut self, info: &'static Info, value: &mut u32, default: u32) {
        let texts = [value.to_string(), default.to_string()];
        self.row(info, texts, &info.accepted(), |ui, name| {
            let mut new = f64::from(*value);
            let response = number_slider(ui, info, &mut new, name, true);
            let new = new.round().clamp(0.0, f64::from(u32::MAX)) as u32;
            (response, (new != *value).then(|| new.to_string()))
        });
    }

    fn switch(&mut self, info: &'static Info, value: &mut bool, default: bool) {
        let texts = [value.to_string(), default.to_string()];
        self.row(info, texts, "on, off", |ui, name| {
            let mut new = *value;
            let response = ui.checkbox(&mut new, "");
            response.widget_info(|| WidgetInfo::selected(egui::Role::CheckBox, true, new, name));
            if response.clicked() && new {
                let below = response.rect.translate(egui::vec2(0.0, 90.0));
                ui.scroll_to_rect(response.rect.union(below), None);
            }
            (response, (new != *value).then(|| new.to_string()))
        });
        // What is switched off hides what it would use; switched on, it may open below the panel's edge.
        if info.name == "enabled" && !*value {
            self.hidden = true;
        }
    }

    fn choice(
        &mut self,
        info: &'static Info,
        names: &'static [&'static str],
        value: &mut usize,
        default: usize,
    ) {
        self.chosen.push((info.name, names[*value]));
        let texts = [names[*value].to_owned(), names[default].to_owned()];
        self.row(info, texts, &names.join(", "), |ui, name| {
            let mut new = *value;
            let combo = egui::ComboBox::from_id_salt(name).selected_text(spaced(names[*value]));
            let combo = combo.show_ui(ui, |ui| {
                for (i, choice) in names.iter().enumerate() {
                    ui.selectable_value(&mut new, i, spaced(choice));
                }
            });
            combo.response.widget_info(|| WidgetInfo::labeled(egui::Role::ComboBox, true, name));
            (combo.response, (new != *value).then(|| names[new].to_owned()))
        });
    }

    fn vector(&mut self, info: &'static Info, value: &mut DVec3, default: DVec3) {
        let text = |v: DVec3| format!("({}, {}, {})", ron(v.x), ron(v.y), ron(v.z));
        let texts = [text(*value), text(default)];
        self.row(info, texts, &info.accepted(), |ui, name| {
            let mut new = *value;
            let response = ui
                .horizontal(|ui| {
                    ui.spacing_mut().item_spacing.x = 3.0;
                    let parts = [(&mut new.x, "x"), (&mut new.y, "y"), (&mut new.z, "z")];
                    let mut all: Option<egui::Response> = None;
                    for (part, axis) in parts {
                        let response = ui.add(egui::DragValue::new(part).speed(0.01).max_decimals(3));
                        let label = format!("{name} {axis}");
                        response.widget_info(|| WidgetInfo::labeled(egui::Role::SpinButton, true, &label));
                        all = Some(all.map_or(response.clone(), |before| before.union(response)));
                    }
                    all
                })
                .inner
                .unwrap_or_else(|| ui.label(""));
            (response, (new != *value).then(|| text(new)))
        });
    }

    fn group(&mut self, info: &'static Info, inside: &mut dyn FnMut(&mut dyn Visitor)) {
        let key = self.key(info.name);
        if !self.is_shown(&key) {
            return;
        }
        let (path, prefix, hide) = (&mut self.path, self.prefix, self.hide);
        path.push(info.name);
        let header = egui::CollapsingHeader::new(RichText::new(info.label()).strong())
            .id_salt(&key)
            .default_open(true)
            .show(self.ui, |ui| {
                let mut drawer = ParamsUi::new(ui, path.clone(), prefix, hide);
                inside(&mut drawer);
                (drawer.changes, drawer.ended)
            });
        header.header_response.on_hover_text(info.doc.trim());
        self.path.pop();
        if let Some((changes, ended)) = header.body_returned {
            self.changes.extend(changes);
            self.ended |= ended;
        }
    }
}

/// A number as RON reads it back.
fn ron(value: f64) -> String {
    format!("{value:?}")
}

/// Colour of text that warns.
pub const WARNING: Color32 = Color32::from_rgb(240, 170, 60);
