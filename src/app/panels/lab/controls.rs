//! The head of the lab's dock: its tabs, what is asked, and how far the study is.

use egui::{Button, DragValue, RichText, Ui, WidgetInfo};

use super::{Lab, Start, Tab, ablation, advice, export, stability, trade, warning};
use crate::{
    app::{
        panels::{health::three, simulation::title},
        session::Session,
        study::Question,
    },
    simulators,
};

impl Lab {
    /// The dock's contents.
    pub fn ui(&mut self, ui: &mut Ui, session: &mut Session) {
        ui.add_space(3.0);
        self.tabs_ui(ui, session);
        ui.separator();
        ui.horizontal_wrapped(|ui| self.controls_ui(ui, session));
        self.progress_ui(ui);
        ui.add_space(2.0);
        match self.tab {
            Tab::Trade => trade::ui(ui, self, session),
            Tab::Stability => stability::ui(ui, self, session),
            Tab::Ablation => ablation::ui(ui, self, session),
            Tab::Advice => advice::ui(ui, self, session),
        }
    }

    fn tabs_ui(&mut self, ui: &mut Ui, session: &mut Session) {
        ui.horizontal(|ui| {
            ui.label(RichText::new("Lab").heading());
            ui.add_space(6.0);
            for (tab, name, tip) in Tab::ALL {
                let response = ui.selectable_label(self.tab == tab, name).on_hover_text(tip);
                let name = format!("{name} tab");
                response.widget_info(|| WidgetInfo::selected(egui::Role::Tab, true, self.tab == tab, &name));
                if response.clicked() {
                    self.tab = tab;
                    self.message = None;
                }
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let close = ui.button("Close").on_hover_text("Hides the lab; what it found stays (M)");
                close.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, "Close the lab"));
                if close.clicked() {
                    self.is_open = false;
                }
                export::ui(ui, self, session);
            });
        });
    }

    /// What is asked: of what, over how long, with which methods.
    fn controls_ui(&mut self, ui: &mut Ui, session: &mut Session) {
        let verb = if self.tab == Tab::Advice { "Search" } else { "Measure" };
        if self.is_busy() {
            if ui.button("Cancel study").on_hover_text("Ends it; what was found so far stays").clicked() {
                self.cancel();
            }
        } else {
            let none = self.left_out.len() == simulators::ALL.len();
            let can = !(none && matches!(self.tab, Tab::Trade | Tab::Advice));
            let button = Button::new(RichText::new(verb).strong()).min_size(egui::vec2(76.0, 0.0));
            if ui.add_enabled(can, button).clicked() {
                self.ask(session);
            }
        }
        ui.separator();
        for (start, name, tip) in [
            (Start::Now, "From now", "Trials start from the state that the cloth is in"),
            (Start::Beginning, "From start", "Trials start from the beginning of the scene"),
        ] {
            ui.selectable_value(&mut self.start, start, name).on_hover_text(tip);
        }
        ui.label("over");
        let field =
            DragValue::new(&mut self.seconds).range(0.01..=60.0).speed(0.02).suffix(" s").max_decimals(3);
        let field = ui.add(field);
        field.widget_info(|| WidgetInfo::labeled(egui::Role::SpinButton, true, "Simulated time"));
        field.on_hover_text("Simulated time that is compared, s");
        ui.separator();
        match self.tab {
            Tab::Trade => {
                self.methods_ui(ui);
                self.time_ui(ui);
                ui.separator();
                trade::controls_ui(ui, &mut self.trade);
                ui.separator();
                ui.label("Tolerance");
                tolerance_ui(ui, &mut self.tolerance);
            }
            Tab::Stability => stability::controls_ui(ui, &mut self.stability, session),
            Tab::Ablation => {
                ablation::controls_ui(ui, &mut self.ablation);
                self.time_ui(ui);
            }
            Tab::Advice => {
                advice::controls_ui(ui, &mut self.advice, &mut self.tolerance);
                ui.separator();
                self.methods_ui(ui);
                self.time_ui(ui);
            }
        }
    }

    fn time_ui(&mut self, ui: &mut Ui) {
        let needed = self.tab == Tab::Advice && self.advice.by_budget;
        let mut on = self.measures_time || needed;
        let checkbox = ui.add_enabled(!needed, egui::Checkbox::new(&mut on, "Measure time"));
        let tip = "Besides counts, which are the same on every machine; the simulation pauses for it";
        if checkbox.on_hover_text(tip).changed() {
            self.measures_time = on;
        }
    }

    fn methods_ui(&mut self, ui: &mut Ui) {
        let all = simulators::ALL.len();
        let text = match all - self.left_out.len() {
            n if n == all => "All methods".to_owned(),
            1 => "1 method".to_owned(),
            n => format!("{n} methods"),
        };
        let config = egui::containers::menu::MenuConfig::new()
            .close_behavior(egui::PopupCloseBehavior::CloseOnClickOutside);
        let menu = egui::containers::menu::MenuButton::new(text).config(config);
        let (response, _) = menu.ui(ui, |ui| {
            ui.horizontal(|ui| {
                if ui.button("All").clicked() {
                    self.left_out.clear();
                }
                if ui.button("None").clicked() {
                    self.left_out = simulators::ALL.iter().map(|entry| entry.id).collect();
                }
            });
            for entry in simulators::ALL {
                let mut on = !self.left_out.contains(entry.id);
                let checkbox = ui.checkbox(&mut on, title(entry.id)).on_hover_text(entry.summary);
                let name = format!("Study {}", title(entry.id));
                checkbox.widget_info(|| WidgetInfo::selected(egui::Role::CheckBox, true, on, &name));
                if checkbox.changed() && !on {
                    self.left_out.insert(entry.id);
                } else if checkbox.changed() {
                    self.left_out.remove(entry.id);
                }
            }
        });
        response.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, "Methods to study"));
        response.on_hover_text("Methods that are tried");
    }

    fn progress_ui(&self, ui: &mut Ui) {
        if let Some(study) = &self.study {
            let status = study.status();
            let part = if status.of > 1 { status.done as f32 / status.of as f32 } else { 0.0 };
            let name = match &study.question {
                Question::Trade(_) => "Trade",
                Question::Stability(_) => "Stability",
                Question::Ablation(_) => "Ablation",
                Question::Advice(_) => "Advice",
            };
            let parts =
                if status.of > 1 { format!(" {} of {}", status.done, status.of) } else { String::new() };
            let pauses = if study.is_timing() { " (the simulation pauses)" } else { "" };
            let ends = if study.is_cancelled() { ", ending" } else { "" };
            let seconds = study.elapsed().as_secs();
            let text = format!("{name}: {}{parts}{pauses}{ends}, {seconds} s", status.stage);
            let bar = egui::ProgressBar::new(part).desired_height(16.0).text(RichText::new(text).small());
            let response = ui.add(bar);
            response.widget_info(|| {
                WidgetInfo::labeled(egui::Role::ProgressIndicator, true, "Progress of the study")
            });
        } else if let Some(message) = &self.message {
            ui.label(RichText::new(message).color(warning(ui)));
        }
    }
}

/// An error that is accepted, m.
pub fn tolerance_ui(ui: &mut Ui, tolerance: &mut f64) {
    let speed = (*tolerance * 0.02).max(1e-12);
    let field = DragValue::new(tolerance)
        .range(1e-12..=1e3)
        .speed(speed)
        .suffix(" m")
        .custom_formatter(|value, _| three(value).to_string());
    let field = ui.add(field);
    field.widget_info(|| WidgetInfo::labeled(egui::Role::SpinButton, true, "Tolerance"));
    field.on_hover_text("RMS position error that is accepted, m");
}
