//! `tenter replay`: runs a recording again and compares the end with what was recorded.

use super::run::{Results, execute};
use super::{Common, Ending};
use crate::scene::{Place, Refusal, read_limited};
use crate::world::Recording;
use clap::Args;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub struct Options {
    /// A recording.
    log: PathBuf,
    #[command(flatten)]
    results: Results,
    #[command(flatten)]
    common: Common,
}

pub fn replay(options: &Options) -> Result<Ending, Refusal> {
    let name = options.log.display();
    let text = read_limited(&options.log)?;
    let mut recording = Recording::from_ron(&text).map_err(|e| e.at(&name))?;
    let mut place = Place::folder(options.log.parent().unwrap_or(Path::new(".")));
    options.common.change(&mut recording.scene, &mut place)?;
    let mut world = recording.start(place).map_err(|e| e.at(&name))?;
    world.set_threads(options.common.threads() as usize)?;
    let mut next = 0;
    let (world, ending) =
        execute(world, &options.results, &options.common, &name.to_string(), recording.steps, |world| {
            recording.apply_due(world, &mut next).map_err(|e| e.at(&name))
        })?;
    let finished = world.steps() == recording.steps;
    if finished && options.common.set.is_empty() && !recording.agrees(&world) {
        return Err(Refusal::new(format!(
            "{name}: replaying it did not end in the state that was recorded (digest {}, now {:016x})",
            recording.digest,
            world.digest()
        )));
    }
    Ok(ending)
}
