//! The lab's dock below the viewport: what the open scene's methods cost and how wrong they are, where they stop being
//! stable, what the scene requires, and which settings are best. Studies run beside the simulation.

mod ablation;
mod advice;
mod export;
mod marks;
mod plane;
mod stability;
mod trade;

use std::{collections::BTreeSet, sync::Arc, time::Duration};

use egui::{Button, Color32, DragValue, RichText, Ui, WidgetInfo};

use super::{params::WARNING, simulation::title};
use crate::{
    app::{
        camera::Bounds,
        session::Session,
        study::{Answer, Question, Study, Subject},
    },
    lab::{self, Settings, advice::Goal, reference::References},
    scene::Scene,
    simulators,
};

/// The four questions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Tab {
    #[default]
    Trade,
    Stability,
    Ablation,
    Advice,
}

impl Tab {
    /// All, with what they are called and what they answer.
    pub const ALL: [(Self, &str, &str); 4] = [
        (Self::Trade, "Trade", "What each method costs, and how wrong it is"),
        (Self::Stability, "Stability", "Where a method is quiet, unsettled, or bursts"),
        (Self::Ablation, "Ablation", "What the scene requires, and what can be left out"),
        (Self::Advice, "Advice", "The cheapest settings that keep an error, or the best within a budget"),
    ];
}

/// What trials start from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Start {
    /// The state that the cloth is in.
    Now,
    /// The beginning of the scene.
    Beginning,
}

/// What a study found, and of what.
struct Finding<T> {
    subject: Subject,
    question: Question,
    table: T,
    /// More is to come, or would have come.
    is_whole: bool,
    /// Something else used the machine while time was measured.
    is_disturbed: bool,
    took: Duration,
}

impl Finding<()> {
    fn with<T>(self, table: T) -> Finding<T> {
        let Self { subject, question, is_whole, is_disturbed, took, .. } = self;
        Finding { subject, question, table, is_whole, is_disturbed, took }
    }
}

/// Whether a finding still speaks of what is open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Freshness {
    Fresh,
    /// The scene was edited since.
    Edited,
    /// It is of another scene.
    Elsewhere,
}

impl Subject {
    /// How the open scene relates to this; `aside` takes away what the study varies itself.
    fn freshness(&self, now: &Scene, aside: impl Fn(&mut Scene)) -> Freshness {
        let without = |scene: &Scene| {
            let mut scene = scene.clone();
            aside(&mut scene);
            scene
        };
        if self.scene.target != now.target {
            Freshness::Elsewhere
        } else if without(&self.scene) == without(now) {
            Freshness::Fresh
        } else {
            Freshness::Edited
        }
    }

    /// What it is, in words.
    fn label(&self) -> String {
        let start =
            self.from.map_or("from its start".to_owned(), |time| format!("from its state at {time:.2} s"));
        format!("{}, {start}, over {} s", self.title, self.seconds)
    }
}

/// Method, precision and dt are what some studies vary themselves.
fn without_settings(scene: &mut Scene) {
    *scene = Settings::double("symplectic_euler", 0.0).apply(scene);
}

/// The dock.
pub struct Lab {
    /// Whether it is shown.
    pub is_open: bool,
    /// Which question is shown.
    pub tab: Tab,
    /// Simulated time that is compared, s.
    seconds: f64,
    start: Start,
    measures_time: bool,
    /// Methods that are left out of trade and advice.
    left_out: BTreeSet<&'static str>,
    /// RMS position error that is accepted, m.
    tolerance: f64,
    /// The scene that the tolerance was proposed for.
    proposed_for: Option<crate::scene::Target>,
    /// A state was asked for, to study it.
    waiting: Option<(u64, Subject, Question)>,
    study: Option<Study>,
    references: Arc<References>,
    /// The simulation was paused while time is measured.
    has_paused: bool,
    /// Why there is nothing, or how it ended.
    message: Option<String>,
    trade: trade::View,
    stability: stability::View,
    ablation: ablation::View,
    advice: advice::View,
    export: export::View,
}

impl Default for Lab {
    fn default() -> Self {
        Self {
            is_open: false,
            tab: Tab::Trade,
            seconds: 1.0,
            start: Start::Now,
            measures_time: true,
            left_out: BTreeSet::new(),
            tolerance: 1e-3,
            proposed_for: None,
            waiting: None,
            study: None,
            references: Arc::default(),
            has_paused: false,
            message: None,
            trade: trade::View::default(),
            stability: stability::View::default(),
            ablation: ablation::View::default(),
            advice: advice::View::default(),
            export: export::View::default(),
        }
    }
}

impl Lab {
    /// Whether a study is under way.
    pub fn is_busy(&self) -> bool {
        self.waiting.is_some() || self.study.is_some()
    }

    /// Shows a question.
    pub fn show(&mut self, tab: Tab) {
        (self.is_open, self.tab) = (true, tab);
    }

    /// Shows the trade, and measures it where nothing is known of the scene as it stands.
    pub fn show_trade(&mut self, session: &mut Session) {
        self.show(Tab::Trade);
        let scene = session.scene();
        let is_known = self.trade.finding.as_ref().is_some_and(|finding| {
            finding.is_whole && finding.subject.freshness(scene, without_settings) == Freshness::Fresh
        });
        if !is_known && !self.is_busy() {
            self.ask(session);
        }
    }

    /// Ends what is under way. What was found so far stays.
    pub fn cancel(&mut self) {
        self.waiting = None;
        if let Some(study) = &self.study {
            study.cancel();
        }
    }

    /// Takes what the study has brought; called once a frame, whether the dock is shown or not.
    pub fn poll(&mut self, session: &mut Session, window: &egui::Context) {
        if session.opening().is_some() {
            self.cancel();
        }
        self.propose(session);
        if let Some((number, ..)) = self.waiting
            && let Some(snapshot) = session.studied(number)
            && let Some((_, mut subject, question)) = self.waiting.take()
        {
            subject.scene = snapshot.scene().clone();
            subject.from = (self.start == Start::Now).then(|| snapshot.time());
            let (references, window) = (Arc::clone(&self.references), window.clone());
            match Study::start(subject, snapshot, question, references, move || window.request_repaint()) {
                Ok(study) => self.study = Some(study),
                Err(error) => self.message = Some(format!("the system gives no thread: {error}")),
            }
        }
        self.mind_time(session);
        let Some(study) = &mut self.study else { return };
        let news = study.news();
        let end = study.finish();
        let (subject, question) = (study.subject.clone(), study.question.clone());
        let (took, is_disturbed) = (study.elapsed(), study.is_disturbed);
        let finding = |is_whole| Finding { subject, question, table: (), is_whole, is_disturbed, took };
        match end {
            None => {
                if let Some(answer) = news {
                    self.take(answer, finding(false));
                }
            }
            Some(end) => {
                let is_whole = !study.is_cancelled();
                self.study = None;
                match end {
                    Ok(answer) => self.take(answer, finding(is_whole)),
                    Err(refusal) if is_whole => self.message = Some(refusal.to_string()),
                    Err(_) => {}
                }
                if !is_whole {
                    self.message = Some("cancelled: what is shown is what there was".to_owned());
                }
            }
        }
        // Nobody else wakes the window for the clock in the progress.
        window.request_repaint_after(Duration::from_millis(200));
    }

    fn take(&mut self, answer: Answer, finding: Finding<()>) {
        match answer {
            Answer::Trade(table) => self.trade.finding = Some(finding.with(table)),
            Answer::Stability(table) => self.stability.finding = Some(finding.with(table)),
            Answer::Ablation(table) => self.ablation.finding = Some(finding.with(table)),
            Answer::Advice(table) => self.advice.finding = Some(finding.with(table)),
        }
    }

    /// Pauses the simulation while time is measured. Who lets it run again has times that are marked.
    fn mind_time(&mut self, session: &mut Session) {
        let is_timing = self.study.as_ref().is_some_and(Study::is_timing);
        if is_timing && !self.has_paused && session.running() {
            session.run(false);
            self.has_paused = true;
        }
        if let Some(study) = &mut self.study {
            study.set_quiet(is_timing && !session.state().running);
        }
        if !is_timing && std::mem::take(&mut self.has_paused) {
            session.run(true);
        }
    }

    /// About a thousandth of the cloth's size, a power of ten, until the user says otherwise.
    fn propose(&mut self, session: &Session) {
        let target = &session.scene().target;
        if self.proposed_for.as_ref() == Some(target) {
            return;
        }
        let Some(bounds) = session.lane_state().and_then(|lane| Bounds::of(lane.positions.iter())) else {
            return;
        };
        self.proposed_for = Some(target.clone());
        let size = f64::from((bounds.max - bounds.min).max_element());
        if size > 0.0 {
            self.tolerance = 10_f64.powf((size * 1e-3).log10().round());
        }
    }

    fn question(&self, session: &Session) -> Question {
        let chosen = simulators::ALL.iter().map(|entry| entry.id).filter(|id| !self.left_out.contains(id));
        let simulators: Vec<String> = chosen.map(str::to_owned).collect();
        let time = self.measures_time;
        match self.tab {
            Tab::Trade => Question::Trade(lab::trade::Options { simulators, time }),
            Tab::Stability => {
                let simulator = self.stability.method(session.scene());
                let map = Some(self.stability.axis);
                Question::Stability(lab::stability::Options { simulators: vec![simulator], map })
            }
            Tab::Ablation => {
                Question::Ablation(lab::ablation::Options { tolerance: self.ablation.tolerance, time })
            }
            Tab::Advice => {
                let by_budget = self.advice.by_budget;
                let goal = if by_budget {
                    Goal::BudgetMs(self.advice.budget)
                } else {
                    Goal::MaxError(self.tolerance)
                };
                Question::Advice(lab::advice::Options { simulators, goal, time: time || by_budget })
            }
        }
    }

    /// Asks the simulation for its state, to study it.
    fn ask(&mut self, session: &mut Session) {
        let question = self.question(session);
        self.message = None;
        let subject = Subject {
            title: session.title().to_owned(),
            scene: session.scene().clone(),
            place: session.place(),
            from: None,
            seconds: self.seconds,
        };
        self.waiting = Some((session.study(), subject, question));
    }

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
fn tolerance_ui(ui: &mut Ui, tolerance: &mut f64) {
    let speed = (*tolerance * 0.02).max(1e-12);
    let field = DragValue::new(tolerance)
        .range(1e-12..=1e3)
        .speed(speed)
        .suffix(" m")
        .custom_formatter(|value, _| super::health::three(value).to_string());
    let field = ui.add(field);
    field.widget_info(|| WidgetInfo::labeled(egui::Role::SpinButton, true, "Tolerance"));
    field.on_hover_text("RMS position error that is accepted, m");
}

/// Colour of text and lines that warn, to be read on dark and on light.
fn warning(ui: &Ui) -> Color32 {
    if ui.visuals().dark_mode { WARNING } else { Color32::from_rgb(176, 100, 0) }
}

/// What is to be said about a finding's age.
fn freshness_ui(ui: &mut Ui, freshness: Freshness, is_whole: bool, is_busy: bool) {
    let text = match freshness {
        Freshness::Fresh if is_whole || is_busy => return,
        Freshness::Fresh => "Not whole: it was cancelled.",
        Freshness::Edited => "The scene was edited since: these are figures of the scene as it was.",
        Freshness::Elsewhere => "These are figures of another scene than the one that is open.",
    };
    ui.label(RichText::new(text).color(warning(ui)));
}

/// What is shown where nothing was found yet.
fn nothing_ui(ui: &mut Ui, text: &str) {
    ui.centered_and_justified(|ui| ui.label(RichText::new(text).weak()));
}

/// Makes the scene's method, precision and dt those of a trial: one edit that can be taken back.
fn use_settings(session: &mut Session, settings: &Settings) {
    let scene = settings.apply(session.scene());
    let label = format!("use {}", words(settings));
    session.become_scene(&label, &scene);
}

/// `rk4, sweeps 4, Double` in words.
fn words(settings: &Settings) -> String {
    let mut words = vec![title(&settings.simulator)];
    words.extend(settings.params.iter().map(|(name, value)| format!("{} {value}", name.replace('_', " "))));
    words.push(format!("{:?}", settings.precision));
    words.push(format!("dt {} s", super::health::three(settings.dt)));
    words.join(", ")
}
