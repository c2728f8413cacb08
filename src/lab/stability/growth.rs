//! Whether a small disturbance of a state grows under a method's own steps: from the derivative of a step, taken by differences.
//!
//! Where the shape resists every displacement, the derivative is applied again and again, and growth is read off. A shape
//! in motion seldom does: springs that are compressed push outwards, and the cloth buckles by itself. Then the eigenvalues z of
//! the derivative tell whose growth it is. K and D being symmetric and damping never giving energy, a motion exp(λ t) that
//! grows in the cloth has a real λ > 0, which a method makes a real z near exp(λ dt) > 1; a growing z that is not real and above 0
//! is the method's own. They are found by Arnoldi's iteration (Saad, "Numerical Methods for Large Eigenvalue Problems", 2011, 6.2),
//! restarted with the motions that matter.

use super::super::{Event, Progress, Stop};
use crate::forces::Problem;
use crate::math::random::Xorshift;
use crate::model::Particles;
use faer::Mat;
use glam::DVec3;

/// A method's step.
pub type Step<'a> = &'a mut dyn FnMut(&mut Particles<f64>);

/// Whether a disturbance of a state grows under steps of `dt` (s) without the cloth growing by itself, which it may only
/// where it `buckles`.
///
/// # Errors
/// A listener that stops it.
pub fn grows(
    problem: &Problem<f64>,
    state: &Particles<f64>,
    dt: f64,
    buckles: bool,
    step: Step,
    progress: Progress,
) -> Result<bool, Stop> {
    let mut map = Map::new(problem, state, dt, step);
    let start = map.start(problem);
    if buckles { map.has_growing_motion(start, progress) } else { map.grows(start, problem, progress) }
}

/// The derivative of a step around a state.
///
/// A disturbance is one of positions, m, of velocities times dt, m, and of what the method carries from step to step.
struct Map<'a> {
    step: Step<'a>,
    state: &'a Particles<f64>,
    dt: f64,
    base: Particles<f64>,
    /// What a shape held fast leaves in the method's memory: a step takes the memory that the step before left.
    memory: Vec<DVec3>,
    moved: Particles<f64>,
    /// Size of a disturbance, m, small beside the springs.
    small: f64,
}

impl<'a> Map<'a> {
    fn new(problem: &Problem<f64>, state: &'a Particles<f64>, dt: f64, step: Step<'a>) -> Self {
        let mut moved = state.clone();
        moved.memory.forget();
        step(&mut moved);
        // What a controller of its own steps carries is its own affair: it starts afresh in every step.
        if !moved.memory.numbers.is_empty() {
            moved.memory.forget();
        }
        let memory = moved.memory.vectors.clone();
        let mut base = Particles { memory: moved.memory.clone(), ..state.clone() };
        step(&mut base);
        let rest = &problem.springs.rest;
        let small = 1e-6 * (rest.iter().sum::<f64>() / rest.len().max(1) as f64).max(f64::MIN_POSITIVE);
        Self { step, state, dt, base, memory, moved, small: small * (state.len() as f64).sqrt() }
    }

    /// A disturbance with all motions in it.
    fn start(&self, problem: &Problem<f64>) -> Vec<DVec3> {
        let mut numbers = Xorshift::new(0x9e37_79b9_7f4a_7c15);
        let mut random = || numbers.centred();
        let free = problem.inverse_mass.iter().map(|w| f64::from(u8::from(*w > 0.0)));
        let free: Vec<f64> = free.collect();
        let mut start: Vec<DVec3> =
            free.iter().chain(&free).map(|free| DVec3::new(random(), random(), random()) * *free).collect();
        start.resize(2 * free.len() + self.memory.len(), DVec3::ZERO);
        start
    }

    /// Length of a disturbance of positions and velocities.
    fn size(&self, disturbance: &[DVec3]) -> f64 {
        disturbance[..2 * self.state.len()].iter().map(|d| d.length_squared()).sum::<f64>().sqrt()
    }

    /// What a step makes of a disturbance.
    fn apply(&mut self, disturbance: &mut [DVec3]) {
        let n = self.state.len();
        let scale = self.small / self.size(disturbance).max(f64::MIN_POSITIVE);
        let Self { step, state, dt, base, memory, moved, .. } = self;
        let (dx, rest) = disturbance.split_at_mut(n);
        let (dv, dm) = rest.split_at_mut(n);
        let add = |to: &mut Vec<DVec3>, from: &[DVec3], by: &[DVec3], scale: f64| {
            to.clear();
            to.extend(from.iter().zip(by).map(|(x, d)| *x + *d * scale));
        };
        add(&mut moved.positions, &state.positions, dx, scale);
        add(&mut moved.velocities, &state.velocities, dv, scale / *dt);
        moved.memory.numbers.clear();
        add(&mut moved.memory.vectors, memory, dm, scale);
        step(moved);
        let differ = |d: &mut [DVec3], to: &[DVec3], from: &[DVec3], factor: f64| {
            d.iter_mut().zip(to.iter().zip(from)).for_each(|(d, (a, b))| *d = (*a - *b) * (factor / scale));
        };
        differ(dx, &moved.positions, &base.positions, 1.0);
        differ(dv, &moved.velocities, &base.velocities, *dt);
        differ(dm, &moved.memory.vectors, &base.memory.vectors, 1.0);
    }

    /// Whether the derivative, applied again and again, makes a disturbance grow.
    fn grows(
        &mut self,
        mut disturbance: Vec<DVec3>,
        problem: &Problem<f64>,
        progress: Progress,
    ) -> Result<bool, Stop> {
        /// Steps after which growth is judged: soon where it is plain, late where it is not.
        const JUDGED: [u32; 5] = [200, 1000, 4000, 10_000, 20_000];
        /// Growth over the second half, natural logarithm: linear growth, which a limit itself has, doubles once.
        const GROWN: f64 = 1.4;
        // Without damping nothing ever decays, and beyond a limit growth is fast: looking longer tells no more.
        let damped = problem.spring_damping > 0.0 || problem.air_damping > 0.0;
        let last = if damped { JUDGED[4] } else { JUDGED[2] };
        let mut growth = vec![0.0];
        for n in 1..=last {
            let before = self.size(&disturbance);
            self.apply(&mut disturbance);
            let now = self.size(&disturbance);
            if !now.is_finite() {
                return Ok(true);
            }
            if now == 0.0 {
                return Ok(false);
            }
            // Kept near one: growth over thousands of steps is no number.
            disturbance.iter_mut().for_each(|d| *d *= 1.0 / now);
            let so_far = growth.last().copied().unwrap_or(0.0) + (now / before).ln();
            growth.push(so_far);
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

    /// Whether the derivative has an eigenvalue outside of the unit circle that is not real and above 0.
    fn has_growing_motion(&mut self, mut start: Vec<DVec3>, progress: Progress) -> Result<bool, Stop> {
        /// Steps before the first look: what decays fast need not be looked at.
        const BEFORE: usize = 100;
        /// Vectors of a look, the looks at most, and the motions that the next one starts from.
        const VECTORS: usize = 40;
        const LOOKS: usize = 16;
        const KEPT: usize = 6;
        /// What is left of the equation of a motion, or changes from look to look, at which |z| is known: as a part of its
        /// distance from 1, which decides; or altogether.
        const PART: f64 = 0.1;
        const LEAST: f64 = 1e-6;
        for _ in 0..BEFORE {
            self.apply(&mut start);
            let size = self.size(&start);
            if !size.is_finite() {
                return Ok(true);
            }
            start.iter_mut().for_each(|d| *d *= 1.0 / size.max(f64::MIN_POSITIVE));
        }
        let n = 2 * self.state.len();
        // What a method remembers has units of its own: weighed so that it counts as much.
        let remembered = start[n..].iter().map(|d| d.length_squared()).sum::<f64>().sqrt();
        let weight = if remembered > 0.0 { self.size(&start) / remembered } else { 1.0 };
        let product = |a: &[DVec3], b: &[DVec3]| -> f64 {
            let sum = |range: std::ops::Range<usize>| -> f64 {
                a[range.clone()].iter().zip(&b[range]).map(|(a, b)| a.dot(*b)).sum()
            };
            sum(0..n) + weight * weight * sum(n..a.len())
        };
        let unit = |vector: &mut [DVec3]| -> f64 {
            let length = product(vector, vector).sqrt();
            vector.iter_mut().for_each(|d| *d *= 1.0 / length.max(f64::MIN_POSITIVE));
            length
        };
        let mut before = f64::INFINITY;
        for _ in 0..LOOKS {
            if !progress(Event::Alive) {
                return Err(Stop::Cancelled);
            }
            unit(&mut start);
            let mut basis = vec![start.clone()];
            let mut h: Vec<Vec<f64>> = Vec::new();
            for j in 0..VECTORS {
                let mut image = basis[j].clone();
                self.apply(&mut image);
                if !image.iter().all(|d| d.is_finite()) {
                    return Ok(true);
                }
                let mut column = vec![0.0; j + 2];
                for _ in 0..2 {
                    for (other, part) in basis.iter().zip(&mut column) {
                        let along = product(&image, other);
                        image.iter_mut().zip(other).for_each(|(d, o)| *d -= *o * along);
                        *part += along;
                    }
                }
                column[j + 1] = unit(&mut image);
                let ended = column[j + 1] < 1e-10;
                h.push(column);
                if ended {
                    break;
                }
                basis.push(image);
            }
            let m = h.len();
            let matrix = Mat::from_fn(m, m, |i, j| h[j].get(i).copied().unwrap_or(0.0));
            let Ok(eigen) = matrix.eigen() else { return Ok(false) };
            let (values, vectors) = (eigen.S(), eigen.U());
            let own = |i: &usize| values[*i].im > 0.0 || (values[*i].im == 0.0 && values[*i].re < 0.0);
            let size = |i: usize| values[i].re.hypot(values[i].im);
            let mut motions: Vec<usize> = (0..m).filter(own).collect();
            motions.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
            let Some(&largest) = motions.first() else { return Ok(false) };
            // How far it is from being a motion.
            let left = h[m - 1][m] * vectors[(m - 1, largest)].re.hypot(vectors[(m - 1, largest)].im);
            let now = size(largest);
            let unknown = left.min((now - before).abs());
            if unknown < LEAST.max(PART * (now - 1.0).abs()) || m < VECTORS {
                return Ok(now > 1.0);
            }
            before = now;
            start.iter_mut().for_each(|d| *d = DVec3::ZERO);
            for &motion in motions.iter().take(KEPT) {
                for (j, vector) in basis.iter().take(m).enumerate() {
                    let part = vectors[(j, motion)].re + vectors[(j, motion)].im;
                    start.iter_mut().zip(vector).for_each(|(d, v)| *d += *v * part);
                }
            }
        }
        Ok(before > 1.0)
    }
}
