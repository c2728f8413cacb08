//! The menus, and the keys of everything that has one: one table serves menus, keyboard and help.

use egui::{Button, Key, KeyboardShortcut, Modifiers, Ui};

use super::{lab::Tab, simulation::title};
use crate::{
    app::{camera::Side, files::Files, hands::Tool, session::Session},
    simulators,
};

/// What the user can ask for by menu, key or button.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Action {
    New,
    Open,
    OpenRecent(String),
    Save,
    SaveAs,
    Record,
    /// Opens a recording and plays it.
    Replay,
    /// Plays what was done once more, from the start.
    Again,
    Export,
    Gallery,
    Quit,
    Undo,
    Redo,
    SelectAll,
    SelectNone,
    SelectPinned,
    Pin,
    Run,
    Step,
    Reset,
    Slower,
    Faster,
    Focus,
    Look(Side),
    Projection,
    Use(Tool),
    Grip,
    AddLane(Option<&'static str>),
    Theme,
    /// Shows or hides the lab.
    Lab,
    /// Shows the trade, and measures it where it is not known.
    Trade,
    /// Shows one of the lab's questions.
    Study(Tab),
    Help,
}

const CTRL: Modifiers = Modifiers::COMMAND;
const NONE: Modifiers = Modifiers::NONE;

/// Key, action, and what the help says. Those with more modifiers come first: else the others would take their key.
pub const KEYS: &[(Modifiers, Key, Action, &str)] = &[
    (Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::S, Action::SaveAs, "Save under another name"),
    (Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z, Action::Redo, "Redo"),
    (CTRL, Key::N, Action::New, "New scene"),
    (CTRL, Key::O, Action::Open, "Open a scene or a mesh"),
    (CTRL, Key::S, Action::Save, "Save the scene"),
    (CTRL, Key::G, Action::Gallery, "Built-in scenes"),
    (CTRL, Key::Q, Action::Quit, "Quit"),
    (CTRL, Key::Z, Action::Undo, "Undo"),
    (CTRL, Key::Y, Action::Redo, "Redo"),
    (CTRL, Key::A, Action::SelectAll, "Select all particles"),
    (CTRL, Key::L, Action::AddLane(None), "Add a lane like this one"),
    (NONE, Key::Space, Action::Run, "Run or pause"),
    (NONE, Key::Period, Action::Step, "One step"),
    (NONE, Key::R, Action::Reset, "Back to the start of the scene"),
    (NONE, Key::OpenBracket, Action::Slower, "Slower"),
    (NONE, Key::CloseBracket, Action::Faster, "Faster"),
    (NONE, Key::P, Action::Pin, "Pin or free the selection"),
    (NONE, Key::V, Action::Use(Tool::Move), "A drag moves the cloth, and turns the view beside it"),
    (NONE, Key::B, Action::Use(Tool::Box), "The next drag frames a box"),
    (NONE, Key::L, Action::Use(Tool::Lasso), "The next drag draws a lasso"),
    (NONE, Key::H, Action::Grip, "Hold hard, or pull by a spring"),
    (NONE, Key::F, Action::Focus, "Look at the selection, or at the whole cloth"),
    (NONE, Key::Num1, Action::Look(Side::Front), "From the front"),
    (NONE, Key::Num3, Action::Look(Side::Right), "From the right"),
    (NONE, Key::Num7, Action::Look(Side::Top), "From above"),
    (NONE, Key::Num5, Action::Projection, "Perspective or orthographic"),
    (NONE, Key::T, Action::Theme, "Dark or light"),
    (NONE, Key::M, Action::Lab, "The lab: cost, error, stability, advice"),
    (NONE, Key::F1, Action::Help, "This help"),
];

/// What the keys of this frame ask for.
pub fn pressed(ui: &Ui) -> Vec<Action> {
    let typing = ui.ctx().egui_wants_keyboard_input();
    let wanted = KEYS.iter().filter(|(modifiers, ..)| !typing || modifiers.command);
    let mut actions: Vec<Action> = wanted
        .filter(|(modifiers, key, action, _)| {
            // While text is typed, undo is the text's.
            let is_text = typing && matches!(action, Action::Undo | Action::Redo | Action::SelectAll);
            !is_text && ui.input_mut(|input| input.consume_key(*modifiers, *key))
        })
        .map(|(_, _, action, _)| action.clone())
        .collect();
    actions.dedup();
    actions
}

/// The key of an action, as the system writes it.
pub fn key_of(ui: &Ui, action: &Action) -> String {
    KEYS.iter()
        .find(|(_, _, known, _)| known == action)
        .map(|(modifiers, key, ..)| key_name(ui, *modifiers, *key))
        .unwrap_or_default()
}

/// A key with its modifiers, as the system writes it.
pub fn key_name(ui: &Ui, modifiers: Modifiers, key: Key) -> String {
    match key {
        Key::Period => ".".to_owned(),
        Key::OpenBracket => "[".to_owned(),
        Key::CloseBracket => "]".to_owned(),
        key => ui.ctx().format_shortcut(&KeyboardShortcut::new(modifiers, key)),
    }
}

/// The menus; returns what was chosen.
pub fn menu_ui(ui: &mut Ui, session: &Session, files: &Files) -> Option<Action> {
    let mut chosen = None;
    let mut entry = |ui: &mut Ui, name: &str, action: Action, is_enabled: bool| {
        let key = key_of(ui, &action);
        let button = Button::new(name).shortcut_text(key).min_size(egui::vec2(200.0, 0.0));
        if ui.add_enabled(is_enabled, button).clicked() {
            chosen = Some(action);
            ui.close();
        }
    };
    ui.menu_button("File", |ui| {
        entry(ui, "New", Action::New, true);
        entry(ui, "Open…", Action::Open, true);
        ui.menu_button("Open recent", |ui| {
            let recent = &files.preferences.recent;
            if recent.is_empty() {
                ui.weak("nothing yet");
            }
            for file in recent {
                let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
                let path = file.to_string_lossy().into_owned();
                entry(ui, &name, Action::OpenRecent(path), true);
            }
        });
        entry(ui, "Built-in scenes…", Action::Gallery, true);
        ui.separator();
        entry(ui, "Save", Action::Save, true);
        entry(ui, "Save as…", Action::SaveAs, true);
        ui.separator();
        entry(ui, "Save recording…", Action::Record, true);
        entry(ui, "Replay recording…", Action::Replay, true);
        entry(ui, "Play again from the start", Action::Again, true);
        ui.separator();
        entry(ui, "Export…", Action::Export, true);
        ui.separator();
        entry(ui, "Quit", Action::Quit, true);
    });
    ui.menu_button("Edit", |ui| {
        let [undo, redo] = session.undoable();
        let name = |verb: &str, what: Option<&str>| {
            what.map_or(verb.to_owned(), |what| format!("{verb} {}", crate::params::excerpt(what)))
        };
        entry(ui, &name("Undo", undo), Action::Undo, undo.is_some());
        entry(ui, &name("Redo", redo), Action::Redo, redo.is_some());
        ui.separator();
        entry(ui, "Select all", Action::SelectAll, true);
        entry(ui, "Select pinned", Action::SelectPinned, true);
        entry(ui, "Select none", Action::SelectNone, !session.selection.is_empty());
        entry(ui, "Pin or free selection", Action::Pin, !session.selection.is_empty());
    });
    ui.menu_button("View", |ui| {
        entry(ui, "Focus", Action::Focus, true);
        entry(ui, "Front", Action::Look(Side::Front), true);
        entry(ui, "Right", Action::Look(Side::Right), true);
        entry(ui, "Top", Action::Look(Side::Top), true);
        entry(ui, "Perspective / orthographic", Action::Projection, true);
        ui.separator();
        entry(ui, "Dark / light", Action::Theme, true);
    });
    ui.menu_button("Lanes", |ui| {
        entry(ui, "Add a lane like this one", Action::AddLane(None), true);
        ui.separator();
        for method in simulators::ALL {
            let name = format!("Add {}", title(method.id));
            entry(ui, &name, Action::AddLane(Some(method.id)), true);
        }
    });
    ui.menu_button("Lab", |ui| {
        entry(ui, "Show or hide the lab", Action::Lab, true);
        ui.separator();
        for (tab, name, _) in Tab::ALL {
            entry(ui, name, Action::Study(tab), true);
        }
    });
    ui.menu_button("Help", |ui| {
        entry(ui, "Keys and mouse", Action::Help, true);
    });
    chosen
}
