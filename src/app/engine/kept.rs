//! States of all lanes that taking an edit back returns to, and lanes that were removed.

use std::collections::VecDeque;

use super::Lane;
use crate::world::{Play, Snapshot};

/// States kept for taking edits back, and the particles of all of them: memory, not time, is the limit.
const KEPT: usize = 24;
const KEPT_PARTICLES: usize = 4_000_000;

/// A state of all lanes to exchange with.
struct Kept {
    number: u64,
    torn: Vec<usize>,
    lanes: Vec<(Snapshot, Option<Play>)>,
    /// A lane that was removed then.
    away: Option<Lane>,
}

/// What is kept, the oldest first.
#[derive(Default)]
pub(super) struct Memory(VecDeque<Kept>);

/// Particles of all lanes.
fn particles(lanes: &[Lane]) -> usize {
    lanes.iter().map(|lane| lane.world.pinned().len()).sum::<usize>().max(1)
}

/// Torn springs of each lane.
fn torn(lanes: &[Lane]) -> Vec<usize> {
    lanes.iter().map(|lane| lane.world.broken().len()).collect()
}

fn moment(lane: &Lane) -> (Snapshot, Option<Play>) {
    (lane.world.snapshot(), lane.play.clone())
}

/// Hands that held something then have long let go, unless a script is what moves them.
fn restore(lane: &mut Lane, (snapshot, play): &(Snapshot, Option<Play>)) {
    lane.restore(snapshot, play.clone());
    if lane.play.is_none() {
        lane.let_go();
    }
}

impl Memory {
    /// Keeps the present state under a number.
    pub fn keep(&mut self, number: u64, lanes: &[Lane]) {
        let most = (KEPT_PARTICLES / particles(lanes)).clamp(1, KEPT);
        self.0.retain(|kept| kept.number != number);
        let states = lanes.iter().map(moment).collect();
        self.0.push_back(Kept { number, torn: torn(lanes), lanes: states, away: None });
        while self.0.len() > most {
            self.0.pop_front();
        }
    }

    /// Goes to the state of a number and keeps the present one in its place. False, and nothing has changed, where it is no
    /// longer remembered, or where `commands_do` because nothing has torn since.
    pub fn exchange(&mut self, number: u64, commands_do: bool, lanes: &mut [Lane]) -> bool {
        let torn = torn(lanes);
        let fits = |kept: &&mut Kept| kept.number == number && kept.lanes.len() == lanes.len();
        let Some(kept) = self.0.iter_mut().find(fits).filter(|kept| !(commands_do && kept.torn == torn))
        else {
            return false;
        };
        kept.torn = torn;
        for (lane, state) in lanes.iter_mut().zip(&mut kept.lanes) {
            let now = moment(lane);
            restore(lane, state);
            *state = now;
        }
        true
    }

    /// Takes a lane out, and keeps the state that all are in.
    pub fn put_away(&mut self, number: u64, lane: usize, lanes: &mut Vec<Lane>) {
        self.keep(number, lanes);
        let away = lanes.remove(lane);
        if let Some(kept) = self.0.back_mut() {
            kept.away = Some(away);
        }
    }

    /// Brings the lane back that was taken out under a number, and all lanes to the state that they were in. False, and
    /// nothing has changed, where that is no longer remembered.
    pub fn put_back(&mut self, number: u64, at: usize, lanes: &mut Vec<Lane>) -> bool {
        let fits = |kept: &&mut Kept| kept.number == number && kept.lanes.len() == lanes.len() + 1;
        let Some(kept) = self.0.iter_mut().find(fits) else { return false };
        let Some(away) = kept.away.take() else { return false };
        lanes.insert(at, away);
        for (lane, state) in lanes.iter_mut().zip(&kept.lanes) {
            restore(lane, state);
        }
        true
    }
}
