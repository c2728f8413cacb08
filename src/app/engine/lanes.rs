//! Lanes that are opened, added and removed, with their past.

use super::{Engine, Lane, LaneSetup, opening};
use crate::scene::Refusal;

impl Engine {
    /// Lanes to be; a refused scene leaves everything as it was.
    pub(super) fn build(&self, setups: Vec<LaneSetup>) -> Result<Vec<Lane>, Refusal> {
        if setups.is_empty() {
            return Err(Refusal::new("there is no scene to open"));
        }
        let lanes = opening::build(setups, self.threads, self.orders, &self.given_up)?;
        Ok(lanes.into_iter().map(|lane| self.stoppable(lane)).collect())
    }

    fn stoppable(&self, mut lane: Lane) -> Lane {
        lane.world.heed(Some(self.stop()));
        lane
    }

    pub(super) fn add_lane(
        &mut self,
        from: usize,
        at: usize,
        title: String,
        settings: &[(String, String)],
        back: Option<u64>,
    ) -> Result<(), Refusal> {
        let at = at.min(self.lanes.len());
        self.go_on();
        if back.is_some_and(|number| self.memory.put_back(number, at, &mut self.lanes)) {
            // The others were remembered without it.
            self.timeline.clear();
            self.has_jumped();
        } else if let Some(lane) = self.lanes.get(from) {
            let lane = self.stoppable(lane.branch(title, settings.to_vec(), self.threads)?);
            self.keep();
            self.lanes.insert(at, lane);
            self.timeline.add_lane(from, at, settings);
            self.timeline.jump();
            self.keep();
        }
        if at <= self.reference && at + 1 < self.lanes.len() {
            self.reference += 1;
        }
        Ok(())
    }

    pub(super) fn remove_lane(&mut self, lane: usize, number: u64) {
        if self.lanes.len() > 1 && lane < self.lanes.len() {
            self.go_on();
            self.memory.put_away(number, lane, &mut self.lanes);
            self.timeline.remove_lane(lane);
            if self.reference >= lane {
                self.reference = self.reference.saturating_sub(1);
            }
        }
    }
}
