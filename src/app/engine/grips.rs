//! Hands that move while no time passes: the cloth stands still, but what is held shows where it will be.
//!
//! Let go at once, such a particle would fly off with the speed of its jump; so it is held for a moment when time passes
//! again.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use crate::world::Command;

/// Simulated time after which a hand that let go while time stood still does let go, s: long enough that it no longer
/// has the speed of its jump.
const LINGER: f64 = 0.15;

/// Who holds what.
#[derive(Default)]
pub(super) struct Grips {
    /// Particles held hard, and those of them whose hand has moved while no time passed.
    gripped: BTreeSet<u32>,
    posed: BTreeMap<u32, DVec3>,
    /// Particles to let go at a time, because their hand has moved while no time passed.
    lingering: Vec<(f64, Vec<u32>)>,
}

impl Grips {
    /// Follows a command given at `time` (s). False if it has to wait until time passes.
    pub fn mind(&mut self, command: &Command, time: f64) -> bool {
        match command {
            Command::Grab { particles } | Command::Pull { particles, .. } => {
                let hard = matches!(command, Command::Grab { .. });
                for particle in particles {
                    self.lingering.iter_mut().for_each(|(_, waiting)| waiting.retain(|p| p != particle));
                    if hard {
                        self.gripped.insert(*particle);
                    }
                }
                true
            }
            Command::Release { particles } => {
                if particles.iter().any(|p| self.posed.contains_key(p)) {
                    self.lingering.push((time + LINGER, particles.clone()));
                    return false;
                }
                self.gripped.retain(|p| !particles.contains(p));
                true
            }
            _ => true,
        }
    }

    /// Hands have moved to these points (m) while no time passed.
    pub fn pose(&mut self, to: &[(u32, DVec3)]) {
        self.posed.extend(to.iter().copied().filter(|(particle, _)| self.gripped.contains(particle)));
    }

    /// Where particles are to be shown until time passes, m.
    pub fn posed(&self) -> &BTreeMap<u32, DVec3> {
        &self.posed
    }

    /// Time has passed, until `time` (s): what is to be released now.
    pub fn let_go(&mut self, time: f64) -> Vec<Vec<u32>> {
        self.posed.clear();
        let (due, waiting): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.lingering).into_iter().partition(|(at, _)| *at <= time);
        self.lingering = waiting;
        let due: Vec<Vec<u32>> = due.into_iter().map(|(_, particles)| particles).collect();
        self.gripped.retain(|p| !due.iter().flatten().any(|gone| gone == p));
        due
    }
}
