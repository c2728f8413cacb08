//! Particles in the user's hand: taken, moved, let go, or put back.

use glam::DVec3;

use super::{Edit, Grip, Order, Session};
use crate::world::Command;

impl Session {
    /// Takes hold of a particle, and of the selection if it is part of it.
    pub fn grab(&mut self, particle: u32) {
        let Some(lane) = self.lane_state().cloned() else { return };
        let particles: Vec<u32> = if self.selection.contains(&particle) {
            self.selection.iter().copied().collect()
        } else {
            vec![particle]
        };
        let place = |p: u32| Some((p, glam::Vec3::from(*lane.positions.get(p as usize)?).as_dvec3()));
        self.held = particles.iter().filter_map(|&p| place(p)).collect();
        self.moved = DVec3::ZERO;
        self.kept += 1;
        self.order(Order::Keep(self.kept));
        let Grip { soft, stiffness } = self.grip;
        let command = if soft { Command::Pull { particles, stiffness } } else { Command::Grab { particles } };
        self.order(Order::Apply(None, command));
    }

    /// Moves what is held to this far from where it was taken, m.
    pub fn drag(&mut self, by: DVec3) {
        self.moved = by;
        let to = self.held.iter().map(|(particle, from)| (*particle, *from + by)).collect();
        self.order(Order::Drag(to));
    }

    /// The hands of a mouse spring: the particle that each pulls, and where it is, m.
    pub fn pulling_hands(&self) -> impl Iterator<Item = (u32, DVec3)> + '_ {
        let soft = self.grip.soft;
        self.held.iter().filter(move |_| soft).map(|(particle, from)| (*particle, *from + self.moved))
    }

    /// Lets go. The drag can be taken back: the cloth then hangs as it did before.
    pub fn release(&mut self) {
        let particles: Vec<u32> =
            std::mem::take(&mut self.held).into_iter().map(|(particle, _)| particle).collect();
        if particles.is_empty() {
            return;
        }
        self.order(Order::Apply(None, Command::Release { particles }));
        let exchange = vec![Order::Exchange { number: self.kept, otherwise: Vec::new() }];
        let edit = Edit { label: "drag".to_owned(), lane: None, undo: exchange.clone(), redo: exchange };
        self.history.push(edit);
        self.history.seal();
    }

    /// Lets go, and puts everything back as it was when it was taken.
    pub fn cancel_drag(&mut self) {
        if !std::mem::take(&mut self.held).is_empty() {
            self.order(Order::Exchange { number: self.kept, otherwise: Vec::new() });
        }
    }
}
