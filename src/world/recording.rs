//! A recording: a scene and the commands applied to it, each with its step. Running it again gives the same bits.

use super::{Command, World};
use crate::params;
use crate::scene::{Place, Refusal, Scene, to_ron};
use serde::{Deserialize, Serialize};

/// A command with the number of steps taken before it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Steps taken before the command was applied.
    pub step: u64,
    /// The command.
    pub command: Command,
}

/// Everything that is needed to run a simulation again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recording {
    /// The scene at the start.
    pub scene: Scene,
    /// Steps in all.
    pub steps: u64,
    /// Commands in the order in which they were applied.
    #[serde(default)]
    pub commands: Vec<Entry>,
    /// [`World::digest`] at the end; replaying compares it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub digest: String,
}

impl Recording {
    /// The recording of a world that was started on `scene`.
    pub fn of(scene: Scene, world: &World) -> Self {
        let digest = format!("{:016x}", world.digest());
        Self { scene, steps: world.steps(), commands: world.log(), digest }
    }

    /// Reads a recording from RON text.
    ///
    /// # Errors
    /// `line:column: what is wrong`; commands that are not in the order of their steps.
    pub fn from_ron(text: &str) -> Result<Self, Refusal> {
        let recording: Self = params::ron_options().from_str(text)?;
        let mut before = 0;
        for (i, entry) in recording.commands.iter().enumerate() {
            if entry.step < before || entry.step > recording.steps {
                return Err(Refusal::new(format!(
                    "command {i} is at step {}; accepted: {before} to {}",
                    entry.step, recording.steps
                )));
            }
            before = entry.step;
        }
        Ok(recording)
    }

    /// The recording as RON text.
    ///
    /// # Errors
    /// Those of the writer; none are known.
    pub fn to_ron(&self) -> Result<String, Refusal> {
        to_ron(self)
    }

    /// A world at the start of the recording.
    ///
    /// # Errors
    /// Those of [`World::new`].
    pub fn start(&self, place: Place) -> Result<World, Refusal> {
        World::new(self.scene.clone(), place)
    }

    /// Applies the commands that stand before the world's next step; `next` counts those applied so far.
    ///
    /// # Errors
    /// A command that the world refuses, with its number.
    pub fn apply_due(&self, world: &mut World, next: &mut usize) -> Result<(), Refusal> {
        while let Some(entry) = self.commands.get(*next).filter(|entry| entry.step <= world.steps()) {
            world.apply(entry.command.clone()).map_err(|e| e.at(format!("command {next}")))?;
            *next += 1;
        }
        Ok(())
    }

    /// Whether a world that has run to the end is in the state that was recorded; yes where none was.
    pub fn agrees(&self, world: &World) -> bool {
        self.digest.is_empty() || self.digest == format!("{:016x}", world.digest())
    }
}
