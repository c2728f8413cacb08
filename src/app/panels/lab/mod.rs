//! The lab's dock below the viewport: what the open scene's methods cost and how wrong they are, where they stop being
//! stable, what the scene requires, and which settings are best. Studies run beside the simulation.

mod ablation;
mod advice;
mod controls;
mod export;
mod marks;
mod plane;
mod stability;
mod trade;

use std::{collections::BTreeSet, sync::Arc, time::Duration};

use egui::{Color32, RichText, Ui};

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

    /// The question that is being answered.
    fn answered(&self) -> Option<Tab> {
        let waiting = self.waiting.as_ref().map(|(.., question)| question);
        waiting.or(self.study.as_ref().map(|study| &study.question)).map(|question| match question {
            Question::Trade(_) => Tab::Trade,
            Question::Stability(_) => Tab::Stability,
            Question::Ablation(_) => Tab::Ablation,
            Question::Advice(_) => Tab::Advice,
        })
    }

    /// What is shown where nothing was found yet: what comes first, or what could be asked.
    fn nothing_ui(&self, ui: &mut Ui, [first, offer]: [&str; 2]) {
        let text = match self.answered() {
            Some(tab) if tab == self.tab => first.to_owned(),
            Some(tab) => format!("{tab:?} is being answered: one question at a time."),
            None => offer.to_owned(),
        };
        ui.centered_and_justified(|ui| ui.label(RichText::new(text).weak()));
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
