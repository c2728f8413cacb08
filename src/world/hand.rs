//! A hand at one particle: how it grips, where it goes, and how fast it was when it let go.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Simulated time over which a hand's velocity is measured, s: long enough to smooth a frame of 1/30 s, short enough for
/// a flick.
const WINDOW: f64 = 0.1;
/// Most samples kept of the window.
const SAMPLES: f64 = 64.0;

/// How a hand takes hold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Grip {
    /// The particle is where the hand is.
    Hold,
    /// The particle is drawn by a spring of this stiffness, N/m.
    Pull(f64),
}

/// A hand at one particle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Hand {
    pub particle: u32,
    pub grip: Grip,
    /// Where the hand is, m.
    at: DVec3,
    /// Where it goes, m, and in how many steps it is there.
    to: DVec3,
    steps: u32,
    /// Where it was over the last [`WINDOW`], by simulated time.
    trail: VecDeque<(f64, DVec3)>,
}

impl Hand {
    /// A hand that takes hold at a point.
    pub fn new(particle: u32, grip: Grip, at: DVec3, time: f64) -> Self {
        Self { particle, grip, at, to: at, steps: 0, trail: VecDeque::from([(time, at)]) }
    }

    /// Whether its particle goes where it goes.
    pub fn holds(&self) -> bool {
        self.grip == Grip::Hold
    }

    /// Where it is, m.
    pub fn at(&self) -> DVec3 {
        self.at
    }

    /// Sends it to a point over some steps.
    pub fn drag(&mut self, to: DVec3, steps: u32) {
        self.to = to;
        self.steps = steps.max(1);
    }

    /// Where it is at the end of the next step.
    pub fn next(&self) -> DVec3 {
        match self.steps {
            0 => self.at,
            1 => self.to,
            n => self.at + (self.to - self.at) / f64::from(n),
        }
    }

    /// Moves it by one step that ends at `time` (s).
    pub fn advance(&mut self, time: f64) {
        self.at = self.next();
        self.steps = self.steps.saturating_sub(1);
        if self.trail.back().is_none_or(|(last, _)| time - last >= WINDOW / SAMPLES) {
            self.trail.push_back((time, self.at));
        }
        // One sample before the window stays, for interpolating at its start.
        while self.trail.get(1).is_some_and(|(second, _)| *second <= time - WINDOW) {
            self.trail.pop_front();
        }
    }

    /// Its mean velocity over the last [`WINDOW`] of simulated time before `time` (s), m/s; zero where it has been still
    /// for so long.
    pub fn velocity(&self, time: f64) -> DVec3 {
        let Some(&(first, _)) = self.trail.front() else { return DVec3::ZERO };
        let start = (time - WINDOW).max(first);
        let mut before = (start, self.at);
        for &(t, p) in &self.trail {
            if t > start {
                let part = if t > before.0 { (start - before.0) / (t - before.0) } else { 0.0 };
                return (self.at - before.1.lerp(p, part)) / (time - start);
            }
            before = (t, p);
        }
        if time > start { (self.at - before.1) / (time - start) } else { DVec3::ZERO }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flick: still, then 3 m/s along x for 0.25 s, sampled by frames of a given rate and steps of a given dt.
    fn flick(frames_per_second: f64, dt: f64) -> DVec3 {
        let mut hand = Hand::new(0, Grip::Hold, DVec3::ZERO, 0.0);
        let steps = (1.0 / frames_per_second / dt).round() as u32;
        let mut step = 0u32;
        while f64::from(step) * dt < 0.5 - 1e-9 {
            let at = f64::from(step + steps) * dt;
            hand.drag(DVec3::X * 3.0 * (at - 0.25).max(0.0), steps);
            for _ in 0..steps {
                step += 1;
                hand.advance(f64::from(step) * dt);
            }
        }
        hand.velocity(f64::from(step) * dt)
    }

    #[test]
    fn a_flick_throws_equally_at_30_and_240_frames_per_second() {
        for (rate, dt) in
            [(30.0, 1.0 / 240.0), (240.0, 1.0 / 240.0), (30.0, 1.0 / 30.0), (60.0, 1.0 / 7680.0)]
        {
            let v = flick(rate, dt);
            // Even motion: any mean over the window is exact up to rounding.
            assert!((v - DVec3::X * 3.0).length() < 1e-9, "{rate} frames/s, dt {dt}: {v}");
        }
    }

    #[test]
    fn a_hand_that_rests_lets_go_at_rest() {
        let mut hand = Hand::new(0, Grip::Hold, DVec3::ZERO, 0.0);
        hand.drag(DVec3::Y, 1);
        for step in 1..=20 {
            hand.advance(f64::from(step) * 0.01);
        }
        assert_eq!(hand.velocity(0.2), DVec3::ZERO);
    }

    #[test]
    fn a_hand_that_lets_go_at_once_throws_nothing() {
        assert_eq!(Hand::new(0, Grip::Hold, DVec3::ONE, 3.0).velocity(3.0), DVec3::ZERO);
    }
}
