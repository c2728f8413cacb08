//! How much simulated time passes in a second, over the last moments.

use std::time::Duration;

/// Counts both times.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    wall: f64,
    simulated: f64,
}

impl Pace {
    /// So much simulated time (s) has passed in so much time.
    pub fn count(&mut self, wall: Duration, simulated: f64) {
        self.wall += wall.as_secs_f64();
        self.simulated += simulated;
        // A window that forgets: about the last second.
        if self.wall > 1.0 {
            self.wall *= 0.5;
            self.simulated *= 0.5;
        }
    }

    /// Their ratio, once it can be told.
    pub fn value(self) -> Option<f64> {
        (self.wall > 0.2).then(|| self.simulated / self.wall)
    }
}
