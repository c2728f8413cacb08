//! The same hands on another cloth: what was done in a recording, each act at its simulated time, for worlds that differ from the
//! recorded one in method, precision or dt.
//!
//! A world takes an act at the end of the last step that does not pass the act's time. With the recorded dt this is the recorded
//! step; with another one it is at most one step early, as it is between lanes that run side by side. A hand's way over some
//! steps becomes one over as many steps as take the same time. Where somebody has chosen a setting, what the recording sets
//! there is left out.

use super::{Command, Recording, World};
use crate::scene::Refusal;
use std::sync::Arc;

/// What was done, and when.
#[derive(Clone, Debug, PartialEq)]
pub struct Script {
    acts: Vec<Act>,
    /// Simulated time in all, s.
    seconds: f64,
    digest: String,
}

#[derive(Clone, Debug, PartialEq)]
struct Act {
    /// Simulated time before it since the start, s; a reset does not turn it back.
    time: f64,
    /// The step that was recorded there, s.
    dt: f64,
    command: Command,
}

/// How far a world is in a script.
#[derive(Clone, Debug)]
pub struct Play {
    script: Arc<Script>,
    next: usize,
    /// Steps of the world and time of the script from which it is counted on, and the dt since, s.
    anchor: (u64, f64),
    dt: f64,
    /// Settings that somebody has chosen.
    chosen: Vec<String>,
    left_out: usize,
}

impl From<&Recording> for Script {
    fn from(recording: &Recording) -> Self {
        let mut scene = recording.scene.clone();
        let mut anchor = (0, 0.0);
        let time = |anchor: (u64, f64), step: u64, dt: f64| anchor.1 + (step - anchor.0) as f64 * dt;
        let mut acts = Vec::with_capacity(recording.commands.len());
        for entry in &recording.commands {
            let (now, dt) = (time(anchor, entry.step, scene.dt), scene.dt);
            acts.push(Act { time: now, dt, command: entry.command.clone() });
            if let Command::Set { key, value } = &entry.command
                && overlap(key, "dt")
            {
                // What was recorded was accepted; if it is not, whoever plays it will be told.
                let _ = scene.set_key(key, value);
                if scene.dt != dt {
                    anchor = (entry.step, now);
                }
            }
        }
        let seconds = time(anchor, recording.steps, scene.dt);
        Self { acts, seconds, digest: recording.digest.clone() }
    }
}

impl Script {
    /// Simulated time in all, s.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }
}

impl Play {
    /// A world at the start of a script; settings that were chosen for it are told by their keys.
    pub fn new(script: Arc<Script>, world: &World, chosen: Vec<String>) -> Self {
        let (anchor, dt) = ((world.steps(), 0.0), world.scene().dt);
        Self { script, next: 0, anchor, dt, chosen, left_out: 0 }
    }

    /// What is played.
    pub fn script(&self) -> &Script {
        &self.script
    }

    /// From now on a setting is somebody's choice.
    pub fn choose(&mut self, key: &str) {
        self.chosen.push(key.to_owned());
    }

    /// Acts that were left out, because somebody chose otherwise.
    pub fn left_out(&self) -> usize {
        self.left_out
    }

    /// Time of the script, s.
    pub fn time(&self, world: &World) -> f64 {
        self.anchor.1 + (world.steps() - self.anchor.0) as f64 * self.dt
    }

    /// The next command that the world has to take before its next step, if there is one.
    pub fn due(&mut self, world: &World) -> Option<Command> {
        self.follow(world);
        while let Some(act) = self.script.acts.get(self.next) {
            if !self.passes(world, act.time) {
                return None;
            }
            self.next += 1;
            match &act.command {
                Command::Set { key, .. } if self.chosen.iter().any(|chosen| overlap(key, chosen)) => {
                    self.left_out += 1;
                }
                Command::Drag { particle, to, steps } if act.dt != self.dt && self.dt > 0.0 => {
                    let steps = (f64::from(*steps) * act.dt / self.dt).round().max(1.0) as u32;
                    return Some(Command::Drag { particle: *particle, to: *to, steps });
                }
                command => return Some(command.clone()),
            }
        }
        None
    }

    /// Applies all that is due.
    ///
    /// # Errors
    /// A command that the world refuses, with its number.
    pub fn apply_due(&mut self, world: &mut World) -> Result<(), Refusal> {
        while let Some(command) = self.due(world) {
            world.apply(command).map_err(|e| e.at(format!("command {}", self.next - 1)))?;
        }
        Ok(())
    }

    /// Whether nothing is left to be done and another step would pass the end.
    pub fn is_over(&self, world: &World) -> bool {
        self.next == self.script.acts.len() && self.passes(world, self.script.seconds)
    }

    /// Whether a world that has come to the end is in the state that was recorded; none where that is not to be expected,
    /// because somebody has chosen otherwise, or was not recorded.
    pub fn agrees(&self, world: &World) -> Option<bool> {
        let is_known = self.chosen.is_empty() && !self.script.digest.is_empty();
        is_known.then(|| self.script.digest == format!("{:016x}", world.digest()))
    }

    /// Takes over a dt that has changed.
    fn follow(&mut self, world: &World) {
        if self.dt != world.scene().dt {
            self.anchor = (world.steps(), self.time(world));
            self.dt = world.scene().dt;
        }
    }

    /// Whether the next step would pass a time. Times that are the same but for rounding count as the same.
    fn passes(&self, world: &World, time: f64) -> bool {
        let steps = world.steps() - self.anchor.0;
        if self.dt > 0.0 {
            self.anchor.1 + (steps + 1) as f64 * self.dt > time + 1e-6 * self.dt
        } else {
            time <= self.anchor.1
        }
    }
}

/// Whether setting the one may set the other: one is the other or lies in it, or both are the method's.
fn overlap(a: &str, b: &str) -> bool {
    let mut parts = a.trim().split('.').zip(b.trim().split('.'));
    let is_method = |key: &str| key.trim().split('.').next() == Some("simulator");
    parts.all(|(a, b)| a == b) || (is_method(a) && is_method(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Place, Scene};
    use glam::DVec3;

    fn set(key: &str, value: &str) -> Command {
        Command::Set { key: key.to_owned(), value: value.to_owned() }
    }

    /// Hands, settings of dt and method, no time for a while, and a reset.
    fn recorded() -> (Recording, World) {
        let scene = Scene::default();
        let mut world = World::new(scene.clone(), Place::default()).unwrap();
        let mut act = |command: Command, steps: u32| {
            world.apply(command).unwrap();
            (0..steps).for_each(|_| world.step());
        };
        act(Command::Grab { particles: vec![312] }, 3);
        act(Command::Drag { particle: 312, to: DVec3::new(0.5, 2.0, 0.0), steps: 20 }, 25);
        act(set("dt", "0.01"), 30);
        act(Command::Reset, 11);
        act(set("dt", "0"), 7);
        act(set("simulator", "(id: \"verlet\")"), 0);
        act(set("dt", "0.015"), 40);
        act(Command::Pin { particles: vec![300] }, 0);
        (Recording::of(scene, &world), world)
    }

    fn played(recording: &Recording, chosen: &[(&str, &str)]) -> (World, Play) {
        let mut scene = recording.scene.clone();
        chosen.iter().for_each(|(key, value)| scene.set_key(key, value).unwrap());
        let mut world = World::new(scene, Place::default()).unwrap();
        let keys = chosen.iter().map(|(key, _)| (*key).to_owned()).collect();
        let mut play = Play::new(Arc::new(Script::from(recording)), &world, keys);
        play.apply_due(&mut world).unwrap();
        while !play.is_over(&world) {
            world.step();
            play.apply_due(&mut world).unwrap();
        }
        (world, play)
    }

    #[test]
    fn with_nothing_chosen_every_bit_is_that_of_the_recording() {
        let (recording, world) = recorded();
        let (again, play) = played(&recording, &[]);
        assert_eq!((again.digest(), again.time()), (world.digest(), world.time()));
        assert_eq!(play.agrees(&again), Some(true));
        assert_eq!(again.scene(), world.scene());
        // Steps at dt 0 change nothing, and are not taken.
        assert_eq!(again.steps() + 7, world.steps());
    }

    #[test]
    fn acts_keep_their_time_when_dt_is_another() {
        let (recording, _) = recorded();
        let (world, play) = played(&recording, &[("dt", "0.004")]);
        // 28 steps of 0.02 s, 41 of 0.01 s, 40 of 0.015 s.
        let seconds = 28.0 * 0.02 + 41.0 * 0.01 + 40.0 * 0.015;
        assert!((play.script().seconds() - seconds).abs() < 1e-12);
        assert_eq!(world.steps(), (seconds / 0.004_f64).floor() as u64);
        assert_eq!((play.left_out(), play.agrees(&world), world.scene().dt), (3, None, 0.004));
        let steps: Vec<u64> = world.log().iter().map(|entry| entry.step).collect();
        // Grab, drag, reset, method, pin.
        let times = [0.0, 0.06, 0.86, 0.97, 1.57].map(|time: f64| (time / 0.004 + 1e-6).floor() as u64);
        assert_eq!(steps, times);
        let Command::Drag { steps, .. } = world.log()[1].command else { panic!("a drag") };
        assert_eq!(steps, 100, "0.4 s");
    }

    #[test]
    fn a_method_that_was_chosen_stays() {
        let (recording, _) = recorded();
        let (world, play) = played(&recording, &[("simulator.id", "\"rk4\""), ("precision", "Single")]);
        assert_eq!(world.scene().simulator.id, "rk4");
        assert_eq!((play.left_out(), play.agrees(&world)), (1, None));
        assert!((world.time() - (11.0 * 0.01 + 40.0 * 0.015)).abs() < 1e-12);
    }

    #[test]
    fn keys_overlap_where_one_sets_the_other() {
        for (a, b) in
            [("dt", "dt"), ("springs", "springs.bend.enabled"), ("simulator.id", "simulator.params.sweeps")]
        {
            assert!(overlap(a, b) && overlap(b, a), "{a} {b}");
        }
        for (a, b) in [("dt", "mass"), ("springs.bend", "springs.shear"), ("wind", "gravity")] {
            assert!(!overlap(a, b) && !overlap(b, a), "{a} {b}");
        }
    }
}
