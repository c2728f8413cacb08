//! The interface's side of the simulation: what it shows, what it has asked for, and what it can take back.
//!
//! Panels read a [`Session`] and send orders through it; they write no state. Until the simulation has answered, they show the
//! scene as it will be, so that a slider does not jump back while a step takes long.

use std::{collections::BTreeSet, sync::Arc};

use glam::DVec3;

use super::{
    engine::{Engine, LaneSetup, Order, State, Values},
    history::{Edit, History},
    simulation::Simulation,
};
use crate::{
    scene::{Place, Scene},
    world::Command,
};

/// Where orders go.
pub enum Link {
    /// To the simulation's thread.
    Thread(Simulation),
    /// Straight to the engine: in tests, where nothing shall happen by itself.
    Here(Box<Engine>),
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
    /// The lane that panels show and edit.
    pub lane: usize,
    /// Selected particles.
    pub selection: BTreeSet<u32>,
    /// Held particles, with the place where each was taken, m.
    held: Vec<(u32, DVec3)>,
    running: bool,
    values: Values,
    saved: Scene,
    /// The last message to the user: what was refused, saved or undone.
    pub message: Option<String>,
}

impl Session {
    /// A session on lanes that are already in the engine behind `link`.
    pub fn new(link: Link, state: State, setups: Vec<LaneSetup>) -> Self {
        let drafts: Vec<Scene> = state.lanes.iter().map(|lane| lane.scene.clone()).collect();
        Self {
            saved: drafts.first().cloned().unwrap_or_default(),
            running: state.running,
            link,
            state: Arc::new(state),
            drafts,
            setups,
            history: History::default(),
            sent: 0,
            seen_refusal: 0,
            lane: 0,
            selection: BTreeSet::new(),
            held: Vec::new(),
            values: Values::None,
            message: None,
        }
    }

    /// Takes the newest state; called once a frame.
    pub fn refresh(&mut self) {
        self.state = match &mut self.link {
            Link::Thread(simulation) => simulation.state(),
            Link::Here(engine) => Arc::new(engine.state()),
        };
        if let Some((order, why)) = &self.state.refusal
            && *order > self.seen_refusal
        {
            self.seen_refusal = *order;
            self.message = Some(why.clone());
        }
        if self.state.orders >= self.sent {
            self.drafts = self.state.lanes.iter().map(|lane| lane.scene.clone()).collect();
            self.running = self.state.running;
        }
        self.lane = self.lane.min(self.state.lanes.len().saturating_sub(1));
        let particles = self.particles();
        self.selection.retain(|p| (*p as usize) < particles);
    }

    /// What the simulation looked like last.
    pub fn state(&self) -> &State {
        &self.state
    }

    fn particles(&self) -> usize {
        self.state.lanes.get(self.lane).map_or(0, |lane| lane.positions.len())
    }

    /// The scene of the lane that is edited, as it will be.
    pub fn scene(&self) -> &Scene {
        &self.drafts[self.lane.min(self.drafts.len() - 1)]
    }

    /// Sends an order that cannot be taken back.
    pub fn order(&mut self, order: Order) {
        self.sent += 1;
        match &mut self.link {
            Link::Thread(simulation) => simulation.send(order),
            Link::Here(engine) => engine.take(order),
        }
    }

    /// Whether time passes, or will.
    pub fn running(&self) -> bool {
        self.running
    }

    /// Runs or pauses.
    pub fn run(&mut self, running: bool) {
        self.running = running;
        self.order(Order::Run(running));
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
        let mut draft = self.scene().clone();
        if let Err(refusal) = draft.set_key(key, value) {
            self.message = Some(refusal.to_string());
            return;
        }
        let command = |value: &str| Command::Set { key: key.to_owned(), value: value.to_owned() };
        let edit = Edit {
            label: key.to_owned(),
            lane: only,
            undo: vec![command(before)],
            redo: vec![command(value)],
        };
        self.edit(edit);
    }

    /// Pins what is selected, or frees it if all of it is pinned.
    pub fn pin_selection(&mut self) {
        let scene_pins = |particle: &u32| {
            let flags = &self.state.lanes[self.lane].flags;
            flags.get(*particle as usize).is_some_and(|flag| flag & super::render::flag::PINNED != 0)
        };
        let (pinned, free): (Vec<u32>, Vec<u32>) = self.selection.iter().copied().partition(scene_pins);
        if pinned.is_empty() && free.is_empty() {
            return;
        }
        let edit = if free.is_empty() {
            let particles = pinned;
            let undo = vec![Command::Pin { particles: particles.clone() }];
            Edit { label: "free".to_owned(), lane: None, undo, redo: vec![Command::Free { particles }] }
        } else {
            let particles = free;
            let undo = vec![Command::Free { particles: particles.clone() }];
            Edit { label: "pin".to_owned(), lane: None, undo, redo: vec![Command::Pin { particles }] }
        };
        self.edit(edit);
    }

    /// Does an edit and remembers it.
    fn edit(&mut self, edit: Edit) {
        self.message = None;
        self.send_all(edit.lane, &edit.redo);
        self.history.push(edit);
    }

    fn send_all(&mut self, lane: Option<usize>, commands: &[Command]) {
        for command in commands {
            if let Command::Set { key, value } = command {
                let drafts = self.drafts.iter_mut().enumerate();
                for (_, draft) in drafts.filter(|(i, _)| lane.is_none_or(|only| only == *i)) {
                    // Refused by the draft as by the world, which tells why.
                    let _ = draft.set_key(key, value);
                }
            }
            self.order(Order::Apply(lane, command.clone()));
        }
    }

    /// A slider was let go: the next change of the same key is another edit.
    pub fn end_edit(&mut self) {
        self.history.seal();
    }

    /// Takes the last edit back.
    pub fn undo(&mut self) {
        if let Some(edit) = self.history.undo() {
            self.message = Some(format!("undone: {}", edit.label));
            self.send_all(edit.lane, &edit.undo);
        }
    }

    /// Does the edit again that was taken back last.
    pub fn redo(&mut self) {
        if let Some(edit) = self.history.redo() {
            self.message = Some(format!("done again: {}", edit.label));
            self.send_all(edit.lane, &edit.redo);
        }
    }

    /// What would be undone and redone, by name.
    pub fn undoable(&self) -> [Option<&str>; 2] {
        self.history.names()
    }

    /// Puts the cloth back to the start of its scene.
    pub fn reset(&mut self) {
        self.held.clear();
        self.order(Order::Apply(None, Command::Reset));
    }

    /// Opens other lanes.
    pub fn open(&mut self, setups: Vec<LaneSetup>) {
        let Some(first) = setups.first() else { return };
        self.saved = first.scene.clone();
        self.drafts = setups.iter().map(|setup| setup.scene.clone()).collect();
        self.setups.clone_from(&setups);
        self.selection.clear();
        self.held.clear();
        self.history = History::default();
        self.lane = 0;
        self.message = None;
        self.order(Order::Open(setups));
    }

    /// Whether the scene differs from the file that it came from.
    pub fn is_unsaved(&self) -> bool {
        self.drafts.first() != Some(&self.saved)
    }

    /// The scene has been written.
    pub fn mark_saved(&mut self) {
        if let Some(first) = self.drafts.first() {
            self.saved.clone_from(first);
        }
    }

    /// Name of the scene that is open.
    pub fn title(&self) -> &str {
        self.setups.first().map_or("", |setup| &setup.title)
    }

    /// Where the open scene's meshes are.
    pub fn place(&self) -> Place {
        self.setups.first().map(|setup| setup.place.clone()).unwrap_or_default()
    }

    /// Takes hold of a particle, and of the selection if it is part of it.
    pub fn grab(&mut self, particle: u32) {
        let particles: Vec<u32> = if self.selection.contains(&particle) {
            self.selection.iter().copied().collect()
        } else {
            vec![particle]
        };
        let positions = &self.state.lanes[self.lane].positions;
        self.held = particles
            .iter()
            .filter_map(|&p| Some((p, glam::Vec3::from(*positions.get(p as usize)?).as_dvec3())))
            .collect();
        self.order(Order::Apply(None, Command::Grab { particles }));
    }

    /// Moves what is held to this far from where it was taken, m.
    pub fn drag(&mut self, by: DVec3) {
        let to = self.held.iter().map(|(particle, from)| (*particle, *from + by)).collect();
        self.order(Order::Drag(to));
    }

    /// Lets go.
    pub fn release(&mut self) {
        let particles = std::mem::take(&mut self.held).into_iter().map(|(particle, _)| particle).collect();
        self.order(Order::Apply(None, Command::Release { particles }));
    }

    /// Puts back what is held, and lets go.
    pub fn cancel_drag(&mut self) {
        self.drag(DVec3::ZERO);
        self.release();
    }
}
