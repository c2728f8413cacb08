//! The limits of a method around a state held fast: in theory, guaranteed, and measured on the method's own steps.

use super::super::{Event, Progress, Settings, Stop, trade};
use super::Limit;
use crate::forces::{Cost, Problem, Spectrum};
use crate::model::Particles;
use crate::scene::Refusal;
use crate::simulators::{Build, SimulatorSettings};
use glam::DVec3;

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
    let dt_theory = theory(settings, &spectrum)?;
    Ok(Limit {
        simulator: settings.simulator.clone(),
        dt_theory,
        dt_measured: measured(problem, state, settings, &spectrum, dt_theory, progress)?,
        dt_guaranteed: trade::theory(settings, &Spectrum::stiffest(problem))?,
    })
}

/// Methods whose step multiplies a motion exp(λ t) by a polynomial in dt λ: their region of stability alone decides.
const BY_REGION: [&str; 2] = ["explicit_euler", "rk4"];

/// The largest stable dt in theory, s. A method's own limit is a bound where damping and stiffness do not share their
/// shapes; here it is made sharp by the damped motions themselves, each held against the method's region of stability.
fn theory(settings: &Settings, spectrum: &Spectrum) -> Result<Option<f64>, Refusal> {
    let bound = trade::theory(settings, spectrum)?;
    let Some(bound) = bound.filter(|dt| *dt > 0.0 && BY_REGION.contains(&settings.simulator.as_str())) else {
        return Ok(bound);
    };
    let alone = |mode| {
        let limit = trade::theory(settings, &Spectrum::oscillator(mode));
        limit.ok().flatten().unwrap_or(f64::INFINITY)
    };
    Ok(Some(spectrum.smallest_over_damped(&alone)).filter(|dt| dt.is_finite()).or(Some(bound)))
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
    let buckling = spectrum.extreme(-1.0, 0.0).omega_squared.min(0.0).abs().sqrt();
    let own = SimulatorSettings { id: settings.simulator.clone(), params: settings.params.clone() };
    let stable = |dt: f64| -> Result<bool, Stop> {
        let mut stepper = <f64 as Build>::build(&own).map_err(Refusal::from)?;
        let mut step = |particles: &mut Particles<f64>| {
            stepper.step(problem, particles, dt, &mut Cost::default());
        };
        Ok(!grows(problem, state, dt, buckling * dt, &mut step, progress)?)
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

/// Whether the derivative of a step around a state, applied again and again, makes a disturbance grow. `drift` is the
/// growth a step (natural logarithm) that the cloth itself has.
fn grows(
    problem: &Problem<f64>,
    state: &Particles<f64>,
    dt: f64,
    drift: f64,
    step: &mut dyn FnMut(&mut Particles<f64>),
    progress: Progress,
) -> Result<bool, Stop> {
    /// Steps after which growth is judged: soon where it is plain, late where it is not.
    const JUDGED: [u32; 5] = [200, 1000, 4000, 10_000, 20_000];
    /// Growth over the second half, natural logarithm: linear growth, which a limit itself has, doubles once.
    const GROWN: f64 = 1.4;
    // Without damping nothing ever decays, and beyond a limit growth is fast: looking longer tells no more.
    let damped = problem.spring_damping > 0.0 || problem.air_damping > 0.0;
    let last = if damped { JUDGED[4] } else { JUDGED[2] };
    let rest = &problem.springs.rest;
    let small = 1e-6 * (rest.iter().sum::<f64>() / rest.len().max(1) as f64).max(f64::MIN_POSITIVE);
    // What the method carries from step to step is disturbed with the shape, around what a shape held fast leaves in it: a
    // step takes the memory that the step before left. A controller's is its own affair: it starts afresh in every step.
    let mut remembered = state.clone();
    remembered.memory.forget();
    step(&mut remembered);
    let mut memory = remembered.memory;
    if !memory.numbers.is_empty() {
        memory.forget();
    }
    let mut base = Particles { memory: memory.clone(), ..state.clone() };
    step(&mut base);
    let mut missed = vec![DVec3::ZERO; memory.vectors.len()];

    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = || {
        // xorshift64 (Marsaglia, "Xorshift RNGs", 2003).
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let free = |i: usize| f64::from(u8::from(problem.inverse_mass[i] > 0.0));
    // Disturbances of position, m, and of velocity times dt, m.
    let mut disturbance: Vec<[DVec3; 2]> = (0..state.len())
        .map(|i| [0, 1].map(|_| DVec3::new(random(), random(), random()) * free(i)))
        .collect();
    let size = |of: &[[DVec3; 2]]| of.iter().flatten().map(|d| d.length_squared()).sum::<f64>().sqrt();
    let particles = (state.len() as f64).sqrt();
    let mut scale = small * particles / size(&disturbance).max(f64::MIN_POSITIVE);
    let mut growth = vec![0.0];
    let mut moved = state.clone();
    for n in 1..=last {
        moved.positions.clone_from(&state.positions);
        moved.velocities.clone_from(&state.velocities);
        moved.memory.clone_from(&memory);
        moved.memory.vectors.iter_mut().zip(&missed).for_each(|(m, d)| *m += *d * scale);
        for ((x, v), [dx, dv]) in moved.positions.iter_mut().zip(&mut moved.velocities).zip(&disturbance) {
            *x += *dx * scale;
            *v += *dv * (scale / dt);
        }
        step(&mut moved);
        let after = moved.positions.iter().zip(&moved.velocities);
        let before = base.positions.iter().zip(&base.velocities);
        for (d, ((x, v), (x0, v0))) in disturbance.iter_mut().zip(after.zip(before)) {
            *d = [*x - *x0, (*v - *v0) * dt];
        }
        let remembered = moved.memory.vectors.iter().zip(&base.memory.vectors);
        missed.iter_mut().zip(remembered).for_each(|(d, (m, m0))| *d = *m - *m0);
        let now = size(&disturbance);
        if !now.is_finite() {
            return Ok(true);
        }
        if now == 0.0 {
            return Ok(false);
        }
        let so_far = growth.last().copied().unwrap_or(0.0) + (now / (small * particles)).ln() - drift;
        growth.push(so_far);
        scale = small * particles / now;
        if JUDGED.contains(&n) {
            if !progress(Event::Alive) {
                return Err(Stop::Cancelled);
            }
            let late = so_far - growth[growth.len() / 2];
            if late > 4.0 * GROWN || (n == last && late > GROWN) {
                return Ok(true);
            }
            if late < -4.0 * GROWN {
                return Ok(false);
            }
        }
    }
    Ok(false)
}
