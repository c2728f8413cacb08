//! `tenter replay`: runs a recording again and compares the end with what was recorded; with settings of one's own, the same
//! hands take another cloth, and how far that ends from the recorded one is told.

use super::run::{Difference, Results, advance, execute_as};
use super::{Common, Ending};
use crate::scene::{Place, Refusal, Scene, read_limited};
use crate::world::{Play, Recording, Script, World};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;

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
    let (name, common) = (options.log.display().to_string(), &options.common);
    let accepted = "accepted: a recording, as --record writes it";
    let text = read_limited(&options.log).map_err(|e| Refusal::new(format!("{e}; {accepted}")))?;
    let recording = Recording::from_ron(&text).map_err(|e| {
        if Scene::from_ron(&text).is_ok() {
            Refusal::new(format!("{name}: is a scene, which tenter run takes; {accepted}"))
        } else {
            e.at(&name)
        }
    })?;
    let mut place = Place::folder(options.log.parent().unwrap_or(Path::new(".")));
    if common.set.is_empty() {
        let (world, ending) = execute_as(
            start(&recording, &place, common, &name)?,
            &options.results,
            common,
            &name,
            recording.steps,
            as_recorded(&recording, &name),
            |_| Ok(None),
        )?;
        check(&recording, &world, &name)?;
        if world.steps() >= recording.steps {
            common.say(if recording.digest.is_empty() {
                "The recording has no digest of its end to compare with."
            } else {
                "The end is the recorded one, bit for bit."
            });
        }
        return Ok(ending);
    }
    let mut other = recording.clone();
    common.change(&mut other.scene, &mut place)?;
    let world = start(&other, &place, common, &name)?;
    let chosen = common.set.iter().map(|(key, _)| key.clone()).collect();
    let mut play = Play::new(Arc::new(Script::from(&recording)), &world, chosen);
    if other.scene.dt == 0.0 && play.script().seconds() > 0.0 {
        return Err(Refusal::new(
            "--set: dt is 0, so the recording's time never passes; accepted: any other",
        ));
    }
    let between = |world: &mut World| {
        play.apply_due(world).map_err(|e| e.at(&name))?;
        Ok(!play.is_over(world))
    };
    let compare = |world: &World| {
        common.say("The end is not compared bit for bit: settings differ from those recorded.");
        if world.health().is_diverged() || super::run::interrupted() {
            return Ok(None);
        }
        let difference = difference(&recording, world, &place, common, &name)?;
        if difference.is_none() {
            common.warn(&[
                "the recording's own end has other particles, or is not there: no distances".to_owned()
            ]);
        }
        Ok(difference)
    };
    let (_, ending) = execute_as(world, &options.results, common, &name, u64::MAX, between, compare)?;
    if play.left_out() > 0 {
        let count = play.left_out();
        common.warn(&[format!("{count} recorded settings were left out: --set has chosen otherwise")]);
    }
    Ok(ending)
}

fn start(recording: &Recording, place: &Place, common: &Common, name: &str) -> Result<World, Refusal> {
    let mut world = recording.start(place.clone()).map_err(|e| e.at(name))?;
    common.prepare(&mut world)?;
    Ok(world)
}

/// What is done between the steps, at the recorded ones.
fn as_recorded<'a>(
    recording: &'a Recording,
    name: &'a str,
) -> impl FnMut(&mut World) -> Result<bool, Refusal> + 'a {
    let mut next = 0;
    move |world| recording.apply_due(world, &mut next).map(|()| true).map_err(|e| e.at(name))
}

/// Refuses an end that is not the recorded one.
fn check(recording: &Recording, world: &World, name: &str) -> Result<(), Refusal> {
    if world.steps() < recording.steps || recording.agrees(world) {
        return Ok(());
    }
    Err(Refusal::new(format!(
        "{name}: replaying it did not end in the state that was recorded (digest {}, now {:016x})",
        recording.digest,
        world.digest()
    )))
}

/// How far a world is from the end of the recording, which runs again for that; none where it cannot, or does not come to its
/// end, or has other particles.
fn difference(
    recording: &Recording,
    world: &World,
    place: &Place,
    common: &Common,
    name: &str,
) -> Result<Option<Difference>, Refusal> {
    let Ok(mut recorded) = start(recording, place, common, name) else { return Ok(None) };
    advance(&mut recorded, common, recording.steps, as_recorded(recording, name))?;
    check(recording, &recorded, name)?;
    let is_whole = recorded.steps() == recording.steps;
    Ok(is_whole.then(|| Difference::of(world, &recorded)).flatten())
}
