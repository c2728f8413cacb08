//! Going to moments of the past, going on from them, and playing again what was done.

use std::{collections::VecDeque, sync::Arc};

use super::{Engine, Lane, LaneSetup, Origin};
use crate::{
    scene::{Refusal, Scene},
    world::{Command, Entry, Recording, Script},
};

impl Engine {
    /// Shows a moment of the past.
    pub(super) fn scrub(&mut self, to: f64) {
        self.running = false;
        if !self.timeline.is_past() {
            self.keep();
        }
        self.seek(to);
    }

    /// Goes back, forgets what came after, and keeps what was set since.
    pub(super) fn go_back(&mut self, seconds: f64) {
        let scenes: Vec<Scene> = self.lanes.iter().map(|lane| lane.world.scene().clone()).collect();
        self.scrub(self.timeline.remembered().at - seconds);
        self.go_on();
        for (lane, scene) in self.lanes.iter_mut().zip(&scenes) {
            lane.adopt(scene);
        }
    }

    /// Whatever happens now happens at the moment that is shown: what came after it is forgotten.
    pub(super) fn go_on(&mut self) {
        if !self.timeline.is_past() {
            return;
        }
        self.timeline.go_on();
        // Hands that held something then have long let go, unless a script is what moves them.
        self.lanes.iter_mut().filter(|lane| lane.play.is_none()).for_each(Lane::let_go);
    }

    /// Goes to a moment: from the last state before it that is kept, by the steps and commands that led on from there.
    fn seek(&mut self, to: f64) {
        let Some(way) = self.timeline.way(to).filter(|way| way.lanes.len() == self.lanes.len()) else {
            return;
        };
        let mut at = way.at;
        self.time = way.clock;
        let (mut logs, mut settings) = (Vec::new(), Vec::new());
        for (lane, stand) in self.lanes.iter_mut().zip(way.lanes) {
            lane.restore(&stand.snapshot, stand.play);
            logs.push(VecDeque::from(stand.commands));
            settings.push(stand.settings);
        }
        if way.leads_on {
            at = self.repeat(at, to, &mut logs);
        }
        for (lane, settings) in self.lanes.iter_mut().zip(settings) {
            // Accepted once, they are accepted again.
            let _ = lane.set(settings);
        }
        self.timeline.show(at);
        self.start_anew();
    }

    /// Takes the beats from one place to another once more, with the commands that were logged; the place that is reached.
    fn repeat(&mut self, mut at: f64, to: f64, logs: &mut [VecDeque<Entry>]) -> f64 {
        loop {
            for (lane, log) in self.lanes.iter_mut().zip(&mut *logs) {
                lane.repeat_commands(log);
            }
            let beat = self.beat_time();
            // Rounding does not decide whether a moment is reached.
            if !(beat > 0.0 && at + beat <= to + 1e-6 * beat) {
                return at;
            }
            for (lane, log) in self.lanes.iter_mut().zip(&mut *logs) {
                lane.repeat_to(self.time + beat, log);
            }
            if self.is_stopped() {
                return at;
            }
            at += beat;
            self.time += beat;
        }
    }

    /// Plays all lanes again from their starts, with what was done to each.
    pub(super) fn again(&mut self) -> Result<(), Refusal> {
        let setup = |lane: &Lane| LaneSetup {
            title: lane.title.clone(),
            scene: lane.start.clone(),
            place: lane.place.clone(),
            file: None,
            origin: Origin::Script(Arc::new(Script::from(&Recording::of(lane.start.clone(), &lane.world)))),
        };
        let lanes = self.build(self.lanes.iter().map(setup).collect())?;
        self.go_on();
        self.keep();
        self.lanes = lanes;
        self.running = false;
        self.has_jumped();
        Ok(())
    }

    /// Whoever takes hold of the cloth himself ends the script.
    pub(super) fn take_over(&mut self, command: &Command) {
        if matches!(command, Command::Set { .. }) || self.lanes.iter().all(|lane| lane.play.is_none()) {
            return;
        }
        for lane in &mut self.lanes {
            if lane.play.take().is_some() {
                lane.let_go();
            }
        }
        // From here on the clock is the cloth's own.
        self.has_jumped();
        self.tell("replay ended: the cloth is in your hands".to_owned());
    }

    /// Ends the script once every lane has come to its end, and says how.
    pub(super) fn end_script(&mut self) {
        let plays = self.lanes.iter().any(|lane| lane.play.is_some());
        if !plays || !self.lanes.iter().all(|lane| lane.play.is_none() || lane.has_played()) {
            return;
        }
        let ends = self.lanes.iter().filter_map(|lane| lane.play.as_ref()?.agrees(&lane.world));
        let told = match ends.reduce(|all, one| all && one) {
            Some(true) => "replayed to its end: the same state, bit for bit",
            Some(false) => "replayed to its end, but not to the state that was recorded",
            None => "replayed to its end; with other settings the end is another",
        };
        self.tell(told.to_owned());
        self.lanes.iter_mut().for_each(|lane| lane.play = None);
        self.running = false;
        self.has_jumped();
    }

    /// How far a script has been played, and how long it is, s.
    pub(super) fn replay(&self) -> Option<[f64; 2]> {
        let lane = self.lanes.iter().find(|lane| lane.play.is_some())?;
        let play = lane.play.as_ref()?;
        Some([play.time(&lane.world), play.script().seconds()])
    }

    /// Tells the user of something.
    pub(in crate::app) fn tell(&mut self, what: String) {
        let number = self.news.as_ref().map_or(0, |(number, _)| *number) + 1;
        self.news = Some((number, what));
    }
}
