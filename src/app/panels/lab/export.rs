//! Writes what the lab has found into a folder: tables, diagrams, scenes, and one page with everything.

use std::path::{Path, PathBuf};

use egui::{Align2, RichText, TextEdit, Ui, vec2};
use serde::Serialize;

use super::{Finding, Lab};
use crate::{
    app::{
        files::{Job, proposal, take},
        session::Session,
        study::{Question, Subject},
    },
    lab::{
        advice::Goal,
        journal::write_whole,
        report::{self, Figure},
        stability::Axis,
    },
    scene::Refusal,
};

/// The question where to.
#[derive(Default)]
pub struct View {
    /// The folder, while it is asked for.
    folder: Option<String>,
    picking: Option<Job<Option<PathBuf>>>,
    writing: Option<Job<Result<PathBuf, Refusal>>>,
}

/// The button, and the question that it opens.
pub fn ui(ui: &mut Ui, lab: &mut Lab, session: &mut Session) {
    let has_any = lab.trade.finding.is_some()
        || lab.stability.finding.is_some()
        || lab.ablation.finding.is_some()
        || lab.advice.finding.is_some();
    let button = ui.add_enabled(has_any, egui::Button::new("Export…"));
    let tip = "Writes what was found as CSV, JSON, SVG and one HTML page";
    if button.on_hover_text(tip).on_disabled_hover_text("Nothing was found yet").clicked() {
        let scene = proposal(session);
        let stem = scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        lab.export.folder = Some(scene.with_file_name(format!("{stem}-lab")).to_string_lossy().into_owned());
    }
    if let Some(picked) = take(&mut lab.export.picking).flatten() {
        lab.export.folder = Some(picked.to_string_lossy().into_owned());
    }
    match take(&mut lab.export.writing) {
        Some(Ok(page)) => session.message = Some(format!("exported: {}", page.display())),
        Some(Err(refusal)) => session.message = Some(refusal.to_string()),
        None => {}
    }
    question_ui(ui, lab);
}

fn question_ui(ui: &mut Ui, lab: &mut Lab) {
    let Some(mut folder) = lab.export.folder.take() else { return };
    let (mut writes, mut cancels, mut is_open) = (false, false, true);
    let window = egui::Window::new("Export what the lab has found").collapsible(false).resizable(false);
    window.open(&mut is_open).anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0)).show(ui.ctx(), |ui| {
        ui.set_width(440.0);
        let label = ui.label("Folder");
        ui.horizontal(|ui| {
            let field = TextEdit::singleline(&mut folder).desired_width(340.0);
            ui.add(field).labelled_by(label.id);
            if ui.button("Browse…").clicked() {
                let answer = rfd::AsyncFileDialog::new().pick_folder();
                let work = move || pollster::block_on(answer).map(|folder| folder.path().to_owned());
                lab.export.picking = Some(Job::start(Some(ui.ctx()), work));
            }
        });
        let text = "Tables (JSON, CSV, text), diagrams (SVG), the scenes, and report.html with all of it.";
        ui.label(RichText::new(text).small().weak());
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            writes = ui.add_enabled(!folder.trim().is_empty(), egui::Button::new("Write")).clicked();
            cancels = ui.button("Do not export").clicked();
        });
    });
    if writes {
        let (folder, bundle) = (PathBuf::from(folder.trim()), Bundle::of(lab));
        let work = move || bundle.and_then(|bundle| bundle.write(&folder));
        lab.export.writing = Some(Job::start(Some(ui.ctx()), work));
    } else if is_open && !cancels {
        lab.export.folder = Some(folder);
    }
}

/// Everything that is written.
#[derive(Default)]
struct Bundle {
    files: Vec<(String, String)>,
    figures: Vec<Figure>,
    subjects: Vec<(&'static str, Subject)>,
}

impl Bundle {
    fn of(lab: &Lab) -> Result<Self, Refusal> {
        let mut bundle = Self::default();
        if let Some(found) = &lab.trade.finding {
            let (text, diagram) = (report::trade(&found.table), report::trade_diagram(&found.table));
            bundle.file("trade", "csv", report::trade_csv(&found.table));
            bundle.file("trade", "svg", diagram.clone());
            bundle.add("trade", "Speed against accuracy", found, &text, diagram)?;
        }
        if let Some(found) = &lab.stability.finding {
            let method = found.table.limits.first().map_or("", |limit| &limit.simulator);
            let (text, diagram) = (report::stability(&found.table), report::map(&found.table, method));
            bundle.file("stability", "csv", report::stability_csv(&found.table));
            bundle.file("stability", "svg", diagram.clone());
            bundle.add("stability", "Stability", found, &text, diagram)?;
        }
        if let Some(found) = &lab.ablation.finding {
            bundle.file("ablate", "csv", report::ablation_csv(&found.table));
            let text = report::ablation(&found.table);
            bundle.add("ablate", "What the scene requires", found, &text, String::new())?;
        }
        if let Some(found) = &lab.advice.finding {
            bundle.add("advise", "Advice", found, &report::advice(&found.table), String::new())?;
        }
        Ok(bundle)
    }

    fn file(&mut self, name: &str, ending: &str, content: String) {
        if !content.is_empty() {
            self.files.push((format!("{name}.{ending}"), content));
        }
    }

    fn add<T: Serialize>(
        &mut self,
        name: &'static str,
        title: &str,
        found: &Finding<T>,
        text: &str,
        diagram: String,
    ) -> Result<(), Refusal> {
        let json = serde_json::to_string_pretty(&found.table).map_err(|e| Refusal::new(e.to_string()))?;
        self.file(name, "json", json + "\n");
        let disturbed =
            if found.is_disturbed { "times are disturbed: the simulation ran meanwhile\n" } else { "" };
        let table = format!("{}\n{disturbed}{text}", found.subject.label());
        self.file(name, "txt", table.clone());
        let command = command(name, &found.question, &found.subject);
        self.figures.push(Figure { title: title.to_owned(), table, diagram, command });
        self.subjects.push((name, found.subject.clone()));
        Ok(())
    }

    /// Writes everything; answers with the page.
    fn write(self, folder: &Path) -> Result<PathBuf, Refusal> {
        std::fs::create_dir_all(folder).map_err(|e| Refusal::new(format!("{}: {e}", folder.display())))?;
        for (name, subject) in &self.subjects {
            let scene = subject.place.moved(&subject.scene, folder).to_ron()?;
            write_whole(&folder.join(format!("{name}.ron")), scene.as_bytes())?;
        }
        for (name, content) in &self.files {
            write_whole(&folder.join(name), content.as_bytes())?;
        }
        let title = self.subjects.first().map_or("Tenter", |(_, subject)| &subject.title);
        let page = folder.join("report.html");
        write_whole(&page, report::html(&format!("Tenter: {title}"), &self.figures).as_bytes())?;
        Ok(page)
    }
}

/// The command that makes a study again. One that started from the state of the moment says so: a command starts from
/// the scene's beginning.
fn command(name: &str, question: &Question, subject: &Subject) -> String {
    let mut words = vec![format!("tenter {name} {name}.ron --seconds {}", subject.seconds)];
    let (methods, time): (&[String], bool) = match question {
        Question::Trade(options) => (&options.simulators, options.time),
        Question::Stability(options) => {
            let axis = if options.map == Some(Axis::Damping) { "damping" } else { "stiffness" };
            words.push(format!("--map {axis}"));
            (&options.simulators, true)
        }
        Question::Ablation(options) => {
            words.push(format!("--tolerance {}", options.tolerance));
            (&[], options.time)
        }
        Question::Advice(options) => {
            words.push(match options.goal {
                Goal::MaxError(error) => format!("--max-error {error}"),
                Goal::BudgetMs(ms) => format!("--budget-ms {ms}"),
            });
            (&options.simulators, options.time)
        }
    };
    if !methods.is_empty() {
        words.push(format!("--simulators {}", methods.join(",")));
    }
    if !time {
        words.push("--counts-only".to_owned());
    }
    if let Some(time) = subject.from {
        words.push(format!("(from the scene's beginning; these figures are from its state at {time:.4} s)"));
    }
    words.join(" ")
}
