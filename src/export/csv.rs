//! A table of energies and strain over time, as comma-separated values.

use super::{Frame, Sink};
use crate::scene::{Pending, Refusal};
use std::io::Write;
use std::path::Path;

/// One row a frame. Measures are those of a state that was computed, never blended: of the first step at or after the
/// frame's time, with that step's own time; a step is listed once.
pub(super) struct Csv {
    file: Pending,
    text: String,
    last_step: Option<u64>,
}

const COLUMNS: &str =
    "step,time_s,kinetic_J,gravitational_J,elastic_J,total_J,max_strain,mean_strain,broken_springs";

impl Csv {
    pub(super) fn new(path: &Path) -> Result<Self, Refusal> {
        Ok(Self { file: Pending::new(path)?, text: format!("{COLUMNS}\n"), last_step: None })
    }
}

impl Sink for Csv {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), Refusal> {
        let world = frame.world;
        if self.last_step.replace(world.steps()) == Some(world.steps()) {
            return Ok(());
        }
        let measures = world.measures();
        let energy = measures.energy;
        let numbers = [
            world.time(),
            energy.kinetic,
            energy.gravitational,
            energy.elastic,
            energy.total(),
            measures.max_strain,
            measures.mean_strain,
        ];
        let numbers = numbers.map(|x| x.to_string()).join(",");
        self.text += &format!("{},{numbers},{}\n", world.steps(), world.broken().len());
        self.file.file().write_all(self.text.as_bytes()).map_err(|e| self.file.failed(e))?;
        self.text.clear();
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), Refusal> {
        self.file.keep()
    }
}
