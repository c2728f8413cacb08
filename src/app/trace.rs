//! What was measured over the last simulated seconds, for the plots.

use std::collections::VecDeque;

use super::order::State;
use crate::world::Energy;

/// One moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Simulated time, s.
    pub time: f64,
    /// Energies, J.
    pub energy: Energy,
    /// Largest strain.
    pub max_strain: f64,
    /// Mean strain.
    pub mean_strain: f64,
}

/// Moments that are kept, and the time that they cover at most, s.
const SAMPLES: usize = 1500;
const SPAN: f64 = 12.0;

/// The last moments of each lane.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    lanes: Vec<VecDeque<Sample>>,
}

impl Trace {
    /// Adds what a state tells. Where time went back, what came after is forgotten; where it stood still, an edit may have changed
    /// what that moment holds.
    pub fn follow(&mut self, state: &State) {
        self.lanes.resize(state.lanes.len(), VecDeque::new());
        for (samples, lane) in self.lanes.iter_mut().zip(&state.lanes) {
            let time = lane.time;
            while samples.back().is_some_and(|last| last.time >= time) {
                samples.pop_back();
            }
            let measures = &lane.measures;
            if measures.energy.total().is_finite() {
                let (max_strain, mean_strain) = (measures.max_strain, measures.mean_strain);
                samples.push_back(Sample { time, energy: measures.energy, max_strain, mean_strain });
            }
            while samples.len() > SAMPLES || samples.front().is_some_and(|first| first.time < time - SPAN) {
                samples.pop_front();
            }
        }
    }

    /// The moments of a lane, oldest first.
    pub fn lane(&self, lane: usize) -> impl Iterator<Item = &Sample> {
        self.lanes.get(lane).into_iter().flatten()
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.lanes.clear();
    }
}
