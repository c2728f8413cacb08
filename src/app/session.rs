//! The interface's side of the simulation: what it shows, what it has asked for, and what it can take back.
//!
//! Panels read a [`Session`] and send orders through it; they write no state. Until the simulation has answered, they show the
//! scene as it will be, so that a slider does not jump back while a step takes long.

mod hold;
mod lanes;
mod past;

use std::{collections::BTreeSet, path::PathBuf, sync::Arc, time::Duration};

use glam::DVec3;

use super::{
    engine::{Engine, LaneSetup, LaneState, Order, Origin, State, Values},
    history::{Edit, History},
    render::flag,
    simulation::Simulation,
    trace::Trace,
};
use crate::{
    scene::{Place, Scene, Target},
    world::{Command, Snapshot},
};

/// Where orders go.
pub enum Link {
    /// To the simulation's thread.
    Thread(Simulation),
    /// Straight to the engine: in tests, where nothing shall happen by itself.
    Here(Box<Engine>),
}

/// How the mouse holds particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// By a spring instead of a hard hold.
    pub soft: bool,
    /// Stiffness of that spring, N/m.
    pub stiffness: f64,
}

/// Scenes that the engine has been told to open, but has not answered about.
struct Opening {
    order: u64,
    setups: Vec<LaneSetup>,
    /// As they are on disk; none where that is not known.
    saved: Option<Scene>,
    /// It can be taken back.
    undo: Option<Vec<LaneSetup>>,
    /// It is not wanted any more.
    is_given_up: bool,
}

/// What the panels read, and through which they ask.
pub struct Session {
    link: Link,
    state: Arc<State>,
    /// The lanes' scenes once every order has been taken.
    drafts: Vec<Scene>,
    setups: Vec<LaneSetup>,
    history: History,
    sent: u64,
    seen_refusal: u64,
    seen_news: u64,
    /// A moment of the past is shown, or was asked for.
    is_in_the_past: bool,
    opening: Option<Opening>,
    /// Why the last opening came to nothing.
    refused: Option<String>,
    opened: u64,
    /// The lane that panels show and edit.
    pub lane: usize,
    /// Selected particles.
    pub selection: BTreeSet<u32>,
    /// How the mouse holds.
    pub grip: Grip,
    /// What was measured lately.
    pub trace: Trace,
    /// Held particles, with the place where each was taken, m, and how far they were moved since.
    held: Vec<(u32, DVec3)>,
    moved: DVec3,
    /// Number of the last state that was kept.
    kept: u64,
    running: bool,
    values: Values,
    saved: Option<Scene>,
    /// The user wants the values of a bare mesh as they are.
    pub keeps_defaults: bool,
    /// The last message to the user: what was refused, saved or undone.
    pub message: Option<String>,
}

impl Session {
    /// A session on lanes that are already in the engine behind `link`.
    pub fn new(link: Link, state: State, setups: Vec<LaneSetup>) -> Self {
        let drafts: Vec<Scene> = state.lanes.iter().map(|lane| lane.scene.clone()).collect();
        Self {
            saved: drafts.first().cloned(),
            running: state.running,
            link,
            state: Arc::new(state),
            drafts,
            setups,
            history: History::default(),
            sent: 0,
            seen_refusal: 0,
            seen_news: 0,
            is_in_the_past: false,
            opening: None,
            refused: None,
            opened: 0,
            lane: 0,
            selection: BTreeSet::new(),
            grip: Grip { soft: false, stiffness: 100.0 },
            trace: Trace::default(),
            held: Vec::new(),
            moved: DVec3::ZERO,
            kept: 0,
            values: Values::None,
            keeps_defaults: false,
            message: None,
        }
    }

    /// A session that opens its first lanes. Until they are there, it shows their scenes.
    pub fn opening_first(link: Link, state: State, setups: Vec<LaneSetup>) -> Self {
        let mut session = Self::new(link, state, setups.clone());
        session.drafts = setups.iter().map(|setup| setup.scene.clone()).collect();
        session.saved = session.drafts.first().cloned();
        session.open_as(setups, None);
        session
    }

    /// Takes the newest state; called once a frame.
    pub fn refresh(&mut self) {
        self.state = match &mut self.link {
            Link::Thread(simulation) => simulation.state(),
            Link::Here(engine) => Arc::new(engine.state()),
        };
        let refusal = self.state.refusal.as_ref().filter(|(order, _)| *order > self.seen_refusal).cloned();
        if let Some((order, why)) = &refusal {
            self.seen_refusal = *order;
            self.message = Some(why.clone());
        }
        if let Some((number, what)) = self.state.news.as_ref().filter(|(number, _)| *number > self.seen_news)
        {
            self.seen_news = *number;
            self.message = Some(what.clone());
        }
        if let Some(opening) = self.opening.take_if(|opening| self.state.orders >= opening.order) {
            match refusal.filter(|(order, _)| *order == opening.order) {
                Some((_, why)) => self.refused = Some(why).filter(|_| !opening.is_given_up),
                None => self.has_opened(opening),
            }
        }
        if self.state.orders >= self.sent && !self.state.lanes.is_empty() {
            self.drafts = self.state.lanes.iter().map(|lane| lane.scene.clone()).collect();
            self.running = self.state.running;
            self.lane = self.lane.min(self.state.lanes.len().saturating_sub(1));
        }
        self.trace.follow(&self.state);
        let particles = self.lane_state().map_or(0, |lane| lane.positions.len());
        self.selection.retain(|p| (*p as usize) < particles);
    }

    fn has_opened(&mut self, Opening { setups, saved, undo, .. }: Opening) {
        if let Some(before) = undo {
            let label = format!("open {}", setups.first().map_or("", |setup| &setup.title));
            let (undo, redo) = (vec![Order::Open(before)], vec![Order::Open(setups.clone())]);
            self.history.push(Edit { label, lane: None, undo, redo });
            self.history.seal();
        }
        let starts = setups.iter().all(|setup| setup.origin == Origin::Start);
        self.setups = setups;
        self.opened += 1;
        self.saved = saved;
        self.selection.clear();
        self.held.clear();
        self.trace.clear();
        self.lane = 0;
        self.keeps_defaults = false;
        if starts {
            self.start();
        } else {
            self.message = Some("paused: Space runs it".to_owned());
        }
    }

    /// Lets time pass, unless the cloth would only fall out of sight.
    pub fn start(&mut self) {
        let hangs = self.state.lanes.iter().any(|lane| lane.pinned > 0 || !lane.scene.gravity.enabled);
        if !hangs {
            self.message = Some("nothing is pinned: select particles, P pins them, Space runs".to_owned());
        }
        self.run(hangs);
    }

    /// What the simulation looked like last.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The lane that is edited.
    pub fn lane_state(&self) -> Option<&Arc<LaneState>> {
        self.state.lanes.get(self.lane)
    }

    /// Whether the simulation has not answered to everything yet.
    pub fn is_waiting(&self) -> bool {
        self.state.orders < self.sent
    }

    /// Gives up what is being opened.
    pub fn give_up_opening(&mut self) {
        if let (Some(opening), Link::Thread(simulation)) = (&mut self.opening, &self.link) {
            opening.is_given_up = true;
            simulation.give_up(opening.order);
        }
    }

    /// The scene that is being opened.
    pub fn opening(&self) -> Option<&str> {
        self.opening.as_ref().and_then(|opening| opening.setups.first()).map(|setup| setup.title.as_str())
    }

    /// How often something has been opened.
    pub fn opened(&self) -> u64 {
        self.opened
    }

    /// The scene of the lane that is edited, as it will be.
    pub fn scene(&self) -> &Scene {
        &self.drafts[self.lane.min(self.drafts.len() - 1)]
    }

    /// The scenes of all lanes, as they will be.
    pub fn scenes(&self) -> &[Scene] {
        &self.drafts
    }

    /// Sends an order that cannot be taken back.
    pub fn order(&mut self, order: Order) {
        self.sent += 1;
        self.is_in_the_past &= !past::goes_on(&order);
        match &mut self.link {
            Link::Thread(simulation) => simulation.send(order),
            Link::Here(engine) => engine.take(order),
        }
    }

    /// Whether time passes, or will.
    pub fn running(&self) -> bool {
        self.running
    }

    /// Runs or pauses; a step that takes long is broken off for a pause.
    pub fn run(&mut self, running: bool) {
        self.running = running;
        if !running
            && self.is_stuck()
            && let Link::Thread(simulation) = &self.link
        {
            simulation.break_off();
        }
        self.order(Order::Run(running));
    }

    /// How long the simulation has been at work without a look at what is asked of it.
    pub fn at_work(&self) -> Duration {
        match &self.link {
            Link::Thread(simulation) => simulation.at_work(),
            Link::Here(_) => Duration::ZERO,
        }
    }

    /// Whether a step takes so long that the user is told how to break it off.
    pub fn is_stuck(&self) -> bool {
        self.opening().is_none() && self.at_work() > Duration::from_secs(1)
    }

    /// Chooses what colours the surface.
    pub fn want(&mut self, values: Values) {
        if self.values != values {
            self.values = values;
            self.order(Order::Values(values));
        }
    }

    /// Sets what a key in the scene names, from RON text; for all lanes unless `only` one is meant.
    pub fn set(&mut self, only: Option<usize>, key: &str, value: &str, before: &str) {
        self.set_all(only, key, &[(key.to_owned(), value.to_owned(), before.to_owned())]);
    }

    /// Sets several keys as one edit: key, value, and the value before.
    pub fn set_all(&mut self, only: Option<usize>, label: &str, changes: &[(String, String, String)]) {
        let mut draft = self.scene().clone();
        for (key, value, _) in changes {
            if let Err(refusal) = draft.set_key(key, value) {
                self.message = Some(refusal.to_string());
                return;
            }
        }
        let set = |key: &str, value: &str| Command::Set { key: key.to_owned(), value: value.to_owned() };
        let redo: Vec<_> = changes.iter().map(|(key, value, _)| (only, set(key, value))).collect();
        let undo: Vec<_> = changes.iter().rev().map(|(key, _, before)| (only, set(key, before))).collect();
        let apply = |(lane, command)| Order::Apply(lane, command);
        // What has torn, or was replaced, is not brought back by a setting, but with the state.
        let tears = draft.tearing.enabled || self.scene().tearing.enabled;
        let loses = tears || changes.iter().any(|(key, ..)| key.starts_with("target"));
        let grows = self.history.is_growing(label, only);
        let (undo, redo_orders) = if loses && !grows {
            self.kept += 1;
            self.order(Order::Keep(self.kept));
            let number = self.kept;
            let back = Order::Exchange { number, otherwise: undo };
            (vec![back], vec![Order::Exchange { number, otherwise: redo.clone() }])
        } else if loses {
            (Vec::new(), vec![Order::Exchange { number: self.kept, otherwise: redo.clone() }])
        } else {
            (undo.into_iter().map(apply).collect(), redo.iter().cloned().map(apply).collect())
        };
        self.message = None;
        self.history.push(Edit { label: label.to_owned(), lane: only, undo, redo: redo_orders });
        let redo: Vec<Order> = redo.into_iter().map(apply).collect();
        self.send(&redo);
    }

    /// Pins what is selected, or frees it if all of it is pinned.
    pub fn pin_selection(&mut self) {
        let particles: Vec<u32> = self.selection.iter().copied().collect();
        let all_pinned = particles.iter().all(|p| self.is_pinned(*p));
        self.pin(&particles, !all_pinned);
    }

    /// Pins or frees particles.
    pub fn pin(&mut self, particles: &[u32], pinned: bool) {
        let particles: Vec<u32> =
            particles.iter().copied().filter(|p| self.is_pinned(*p) != pinned).collect();
        if particles.is_empty() {
            return;
        }
        let (label, other) = if pinned { ("pin", "free") } else { ("free", "pin") };
        let command = |name: &str| {
            let particles = particles.clone();
            if name == "pin" { Command::Pin { particles } } else { Command::Free { particles } }
        };
        let apply = |name: &str| vec![Order::Apply(None, command(name))];
        self.message = None;
        let (undo, redo) = if pinned {
            (apply(other), apply(label))
        } else {
            // What was freed falls: it is hung up again where it was.
            self.kept += 1;
            let number = self.kept;
            self.order(Order::Keep(number));
            let exchange =
                |name: &str| vec![Order::Exchange { number, otherwise: vec![(None, command(name))] }];
            (exchange(other), exchange(label))
        };
        self.send(&apply(label));
        self.history.push(Edit { label: label.to_owned(), lane: None, undo, redo });
        self.history.seal();
    }

    /// The particles that are pinned.
    pub fn pinned(&self) -> Vec<u32> {
        let flags = self.lane_state().map(|lane| Arc::clone(&lane.flags)).unwrap_or_default();
        (0..).zip(flags.iter()).filter(|(_, flag)| **flag & flag::PINNED != 0).map(|(i, _)| i).collect()
    }

    fn is_pinned(&self, particle: u32) -> bool {
        let flag = self.lane_state().and_then(|lane| lane.flags.get(particle as usize).copied());
        flag.is_some_and(|flag| flag & flag::PINNED != 0)
    }

    /// Sends orders of an edit, and shows at once what they will set.
    fn send(&mut self, orders: &[Order]) {
        for order in orders {
            match order {
                Order::Apply(lane, command) => self.foresee(*lane, command),
                Order::Exchange { otherwise, .. } => {
                    otherwise.iter().for_each(|(lane, command)| self.foresee(*lane, command));
                }
                Order::AddLane { from, at, settings, .. } => self.foresee_lane(*from, *at, settings),
                Order::RemoveLane { lane, .. } if self.drafts.len() > 1 && *lane < self.drafts.len() => {
                    self.drafts.remove(*lane);
                    self.setups.remove(*lane);
                    if self.lane >= *lane {
                        self.lane = self.lane.saturating_sub(1);
                    }
                }
                Order::Open(setups) => {
                    let setups = setups.clone();
                    let order = self.sent + 1;
                    self.opening =
                        Some(Opening { order, setups, saved: None, undo: None, is_given_up: false });
                }
                _ => {}
            }
            self.order(order.clone());
        }
    }

    fn foresee(&mut self, lane: Option<usize>, command: &Command) {
        if let Command::Set { key, value } = command {
            let drafts = self.drafts.iter_mut().enumerate();
            for (_, draft) in drafts.filter(|(i, _)| lane.is_none_or(|only| only == *i)) {
                // Refused by the draft as by the world, which tells why.
                let _ = draft.set_key(key, value);
            }
        }
    }

    /// Asks for the present state of the lane that is edited; answers with the number to ask [`studied`](Self::studied) for.
    pub fn study(&mut self) -> u64 {
        self.order(Order::Study(self.lane));
        self.sent
    }

    /// The state that was asked for, once it is there.
    pub fn studied(&self, number: u64) -> Option<Arc<Snapshot>> {
        let studied = self.state.studied.as_ref().filter(|studied| studied.order == number);
        studied.map(|studied| Arc::clone(&studied.snapshot))
    }

    /// A slider was let go: the next change of the same key is another edit.
    pub fn end_edit(&mut self) {
        self.history.seal();
    }

    /// Why what was being opened last is not there, once.
    pub fn take_refused(&mut self) -> Option<String> {
        self.refused.take()
    }

    /// Takes the last edit back. Where that leaves the open scene it is only told at first.
    pub fn undo(&mut self) {
        if self.history.warns() {
            let label = self.history.names()[0].unwrap_or_default();
            self.message = Some(format!("undo once more takes back: {label}, and shows the scene before"));
            return;
        }
        if let Some(edit) = self.history.undo() {
            self.message = Some(format!("undone: {}", edit.label));
            self.send(&edit.undo);
        }
    }

    /// Does the edit again that was taken back last.
    pub fn redo(&mut self) {
        if let Some(edit) = self.history.redo() {
            self.message = Some(format!("done again: {}", edit.label));
            self.send(&edit.redo);
        }
    }

    /// What would be undone and redone, by name.
    pub fn undoable(&self) -> [Option<&str>; 2] {
        self.history.names()
    }

    /// Puts the cloth back to the start of its scene.
    pub fn reset(&mut self) {
        self.held.clear();
        self.message = None;
        self.order(Order::Apply(None, Command::Reset));
    }

    /// Opens other lanes. Until they are built, and if they are refused, everything stays as it is.
    pub fn open(&mut self, setups: Vec<LaneSetup>) {
        // Without lanes there is nothing to go back to.
        let undo = (!self.state.lanes.is_empty()).then(|| self.setups_now());
        self.open_as(setups, undo);
    }

    fn open_as(&mut self, setups: Vec<LaneSetup>, undo: Option<Vec<LaneSetup>>) {
        let Some(first) = setups.first() else { return };
        // A mesh without a scene is nothing that was saved; what an earlier session left is not saved either.
        let is_left = matches!(first.origin, Origin::Saved(_));
        let saved = (!is_left).then(|| first.scene.clone());
        self.message = None;
        let order = self.sent + 1;
        self.opening = Some(Opening { order, setups: setups.clone(), saved, undo, is_given_up: false });
        self.order(Order::Open(setups));
    }

    fn setups_now(&self) -> Vec<LaneSetup> {
        let lanes = self.setups.iter().zip(&self.drafts);
        lanes
            .map(|(setup, scene)| LaneSetup { scene: scene.clone(), origin: Origin::Start, ..setup.clone() })
            .collect()
    }

    /// Whether the scene differs from the file that it came from.
    pub fn is_unsaved(&self) -> bool {
        self.drafts.first() != self.saved.as_ref()
    }

    /// Whether this is a user's mesh with the mass, springs and dt that every scene has by default: those of a sheet of 25 m.
    pub fn is_bare_mesh(&self) -> bool {
        let (scene, default) = (self.scene(), Scene::default());
        matches!(&scene.target, Target::Mesh(mesh) if mesh.asset().is_none())
            && self.file().is_none()
            && (&scene.mass, &scene.springs, scene.dt) == (&default.mass, &default.springs, default.dt)
    }

    /// The scene has been written to a file.
    pub fn has_saved(&mut self, file: PathBuf) {
        self.saved = self.drafts.first().cloned();
        self.message = Some(format!("saved {}", file.display()));
        if let Some(setup) = self.setups.first_mut() {
            setup.title = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            setup.file = Some(file.clone());
            let title = setup.title.clone();
            self.order(Order::Rename(title, file));
        }
    }

    /// Name of the scene that is open.
    pub fn title(&self) -> &str {
        self.setups.first().map_or("", |setup| &setup.title)
    }

    /// The file of the scene that is open.
    pub fn file(&self) -> Option<&PathBuf> {
        self.setups.first().and_then(|setup| setup.file.as_ref())
    }

    /// Where the open scene's meshes are.
    pub fn place(&self) -> Place {
        self.setups.first().map(|setup| setup.place.clone()).unwrap_or_default()
    }
}
