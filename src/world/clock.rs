//! From frame time to steps: pure, so that the same frames give the same steps.

/// Divides time into steps of equal length, with a limit on the time that it tries to make up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Simulated seconds for each second of the user's; 1 is real time.
    pub speed: f64,
    /// Longest simulated time that one frame may ask for, s. What is beyond is dropped and told, so that a simulation
    /// slower than real time becomes slow motion instead of falling further and further behind.
    pub longest_frame: f64,
    /// Simulated time that has been asked for but does not fill a step yet, s.
    owed: f64,
}

/// What a frame has to do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tick {
    /// Steps to take.
    pub steps: u64,
    /// How far the frame stands between the last state (0) and the next (1): the picture blends the last two states.
    pub blend: f64,
    /// Simulated time that was asked for and given up, s.
    pub dropped: f64,
}

impl Default for Clock {
    fn default() -> Self {
        Self { speed: 1.0, longest_frame: 0.1, owed: 0.0 }
    }
}

impl Clock {
    /// The steps of length `dt` (s) that a frame of `frame_time` (s) asks for. None where either is not a positive number.
    pub fn advance(&mut self, frame_time: f64, dt: f64) -> Tick {
        let asked = frame_time * self.speed;
        if !(asked > 0.0 && asked.is_finite() && dt > 0.0 && dt.is_finite()) {
            return Tick::default();
        }
        // A step longer than the limit must still come round.
        let longest = self.longest_frame.max(dt);
        let owed = self.owed + asked;
        let dropped = (owed - longest).max(0.0);
        let owed = owed - dropped;
        let steps = (owed / dt).floor();
        self.owed = (owed - steps * dt).clamp(0.0, dt);
        Tick { steps: steps as u64, blend: (self.owed / dt).min(1.0), dropped }
    }

    /// Forgets the time that is owed: after a pause or a reset.
    pub fn restart(&mut self) {
        self.owed = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_do_not_depend_on_how_time_is_cut_into_frames() {
        let total = |frame: f64, frames: usize| {
            let mut clock = Clock::default();
            (0..frames).map(|_| clock.advance(frame, 0.004).steps).sum::<u64>()
        };
        // 1.0625 s in frames whose sums are exact in binary, so that only the clock could lose a step: 265 full steps.
        assert_eq!(total(1.0 / 32.0, 34), 265);
        assert_eq!(total(1.0 / 256.0, 272), 265);
    }

    #[test]
    fn a_frame_that_takes_too_long_drops_time_and_says_so() {
        let mut clock = Clock { longest_frame: 0.125, ..Clock::default() };
        let tick = clock.advance(10.0, 0.03125);
        assert_eq!((tick.steps, tick.dropped), (4, 9.875));
        assert_eq!(clock.advance(0.0, 0.03125), Tick::default());
    }

    #[test]
    fn a_step_longer_than_the_limit_still_comes_round() {
        let mut clock = Clock { longest_frame: 0.1, ..Clock::default() };
        let steps: u64 = (0..32).map(|_| clock.advance(0.0625, 0.5).steps).sum();
        assert_eq!(steps, 4);
    }

    #[test]
    fn blend_runs_from_one_state_to_the_next() {
        let mut clock = Clock { speed: 0.5, ..Clock::default() };
        let tick = clock.advance(0.0625, 0.125);
        assert_eq!((tick.steps, tick.blend), (0, 0.25));
    }

    #[test]
    fn nonsense_asks_for_nothing() {
        let mut clock = Clock::default();
        for (frame, dt) in [(f64::NAN, 0.1), (1.0, 0.0), (1.0, f64::NAN), (-1.0, 0.1), (f64::INFINITY, 0.1)] {
            assert_eq!(clock.advance(frame, dt), Tick::default());
        }
    }
}
