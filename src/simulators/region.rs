//! The longest stable step of a method that multiplies each motion x'' + g x' + ω² x = 0 by itself each step.

use crate::forces::{Mode, Spectrum};

/// The longest stable dt (s) of a cloth from that of a single motion, `alone`: the shortest one over the cloth's damped motions.
pub(super) fn dt_limit(spectrum: &Spectrum, alone: impl Fn(Mode) -> f64) -> Option<f64> {
    Some(spectrum.smallest_over_damped(&alone)).filter(|dt| dt.is_finite())
}

/// The longest dt (s) at which `multiplier` (the spectral radius of one step of the method on a motion) is at most 1 for
/// every shorter dt too.
pub(super) fn longest_stable(mode: Mode, multiplier: impl Fn(Mode, f64) -> f64) -> f64 {
    /// What rounding may add to 1.
    const ROUNDING: f64 = 1e-9;
    /// Steps in which the rate is walked through: fine against the bays of any region of stability.
    const SCAN: f64 = 0.02;
    let mode = Mode { omega_squared: mode.omega_squared.max(0.0), ..mode };
    let rate = mode.omega_squared.sqrt() + mode.damping;
    if rate <= 0.0 {
        return f64::INFINITY;
    }
    let stable = |scaled: f64| multiplier(mode, scaled / rate) <= 1.0 + ROUNDING;
    let Some(burst) = (1..1000).map(|i| f64::from(i) * SCAN).find(|scaled| !stable(*scaled)) else {
        return f64::INFINITY;
    };
    let (mut low, mut high) = (burst - SCAN, burst);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if stable(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low / rate
}
