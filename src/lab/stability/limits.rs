//! The limits of a method around a state held fast: in theory, guaranteed, and measured on the method's own steps.

use super::super::{Progress, Settings, Stop, trade};
use super::Limit;
use super::growth::grows;
use crate::forces::{Cost, Problem, Spectrum};
use crate::model::Particles;
use crate::scene::Refusal;
use crate::simulators::{Build, SimulatorSettings};

/// The limits of a method around a state.
///
/// # Errors
/// Parameters that the method refuses; a listener that stops it.
pub fn limit(
    problem: &Problem<f64>,
    state: &Particles<f64>,
    settings: &Settings,
    progress: Progress,
) -> Result<Limit, Stop> {
    let spectrum = Spectrum::of(problem, state);
    let dt_theory = trade::theory(settings, &spectrum)?;
    Ok(Limit {
        simulator: settings.simulator.clone(),
        dt_theory,
        dt_measured: measured(problem, state, settings, &spectrum, dt_theory, progress)?,
        dt_guaranteed: trade::theory(settings, &Spectrum::stiffest(problem))?,
    })
}

/// Longest dt that is looked at, s.
const LONGEST: f64 = 10.0;

/// The largest dt at which a small disturbance of a state does not grow, s, by bisection.
fn measured(
    problem: &Problem<f64>,
    state: &Particles<f64>,
    settings: &Settings,
    spectrum: &Spectrum,
    theory: Option<f64>,
    progress: Progress,
) -> Result<Option<f64>, Stop> {
    let omega = spectrum.omega_max();
    if omega <= 0.0 {
        return Ok(None);
    }
    // Growth of less than a factor in thousands of steps is not seen: below this, a method counts as never stable.
    let shortest = 0.05 / omega;
    // A shape that buckles by itself grows without any fault of the method.
    let buckles = spectrum.extreme(-1.0, 0.0).omega_squared < -1e-9 * omega * omega;
    let own = SimulatorSettings { id: settings.simulator.clone(), params: settings.params.clone() };
    let stable = |dt: f64| -> Result<bool, Stop> {
        let mut stepper = <f64 as Build>::build(&own).map_err(Refusal::from)?;
        let mut step = |particles: &mut Particles<f64>| {
            stepper.step(problem, particles, dt, &mut Cost::default());
        };
        Ok(!grows(problem, state, dt, buckles, &mut step, progress)?)
    };
    let mut low = theory.unwrap_or(2.0 / omega).max(shortest) * 0.8;
    while !stable(low)? {
        low /= 2.0;
        if low < shortest {
            return Ok(Some(0.0));
        }
    }
    let mut high = low * 1.5;
    while stable(high)? {
        (low, high) = (high, high * 2.0);
        if high > LONGEST {
            return Ok(None);
        }
    }
    while high / low > 1.004 {
        let middle = (low * high).sqrt();
        if stable(middle)? {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(Some(low))
}
