//! The fastest frequency and the strongest damping of a cloth in its current shape: what limits an explicit step.
//!
//! For small motions around a shape, M x'' + D x' + K x = 0. K is the sum over springs of
//! k [(1 - L/l) I + (L/l) n nᵀ] (l the current length, n the direction); D is c I plus the graph Laplacian of the springs
//! times k_d. Largest eigenvalues of M⁻¹K and M⁻¹D come from the Lanczos iteration (Lanczos, "An iteration method for
//! the solution of the eigenvalue problem of linear differential and integral operators", 1950) on the symmetric
//! M^-1/2 K M^-1/2, with full reorthogonalisation.

use super::Problem;
use crate::math::{Real, Vector};
use crate::model::Particles;
use glam::DVec3;

/// The extreme rates of a cloth in its current shape.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spectrum {
    /// Largest natural frequency, rad/s: the square root of the largest eigenvalue of M⁻¹K.
    pub omega_max: f64,
    /// Damping rate of the motion at that frequency, 1/s: x'' + g x' + ω² x = 0.
    pub damping_at_omega_max: f64,
    /// Largest damping rate of any motion, 1/s: the largest eigenvalue of M⁻¹D.
    pub damping_max: f64,
}

impl Spectrum {
    /// The spectrum of a problem in a state. Costs about 40 force evaluations, in double precision.
    pub fn of<T: Real>(problem: &Problem<T>, state: &Particles<T>) -> Self {
        let inverse_root: Vec<f64> = problem.inverse_mass.iter().map(|w| w.to_f64().sqrt()).collect();
        let x: Vec<DVec3> = state.positions.iter().map(|p| p.to_f64()).collect();
        let weighted = |from: &[DVec3], to: &mut [DVec3], block: &dyn Fn(usize, DVec3, DVec3) -> DVec3| {
            to.fill(DVec3::ZERO);
            for (spring, pair) in problem.springs.pairs.iter().enumerate() {
                let [i, j] = pair.map(|p| p as usize);
                let difference = from[j] * inverse_root[j] - from[i] * inverse_root[i];
                let f = block(spring, x[j] - x[i], difference);
                to[i] -= f;
                to[j] += f;
            }
            for (t, w) in to.iter_mut().zip(&inverse_root) {
                *t *= *w;
            }
        };
        let mut stiffness_of = vec![0.0; problem.springs.len()];
        for group in &problem.springs.groups {
            stiffness_of[group.range.clone()].fill(group.stiffness.to_f64());
        }
        let stiffness = |from: &[DVec3], to: &mut [DVec3]| {
            weighted(from, to, &|spring, d, difference| {
                let length = d.length();
                if length == 0.0 {
                    return DVec3::ZERO;
                }
                let ratio = problem.springs.rest[spring].to_f64() / length;
                let n = d / length;
                (difference * (1.0 - ratio) + n * (n.dot(difference) * ratio)) * stiffness_of[spring]
            });
        };
        let (spring_damping, air) = (problem.spring_damping.to_f64(), problem.air_damping.to_f64());
        let damping = |from: &[DVec3], to: &mut [DVec3]| {
            weighted(from, to, &|_, _, difference| difference * spring_damping);
            for ((t, f), w) in to.iter_mut().zip(from).zip(&inverse_root) {
                *t += *f * (air * w * w);
            }
        };
        let free = problem.inverse_mass.iter().filter(|w| **w > T::ZERO).count();
        if free == 0 {
            return Self::default();
        }
        let (top, mode) = largest_eigenvalue(x.len(), &inverse_root, &stiffness);
        let mut damped = vec![DVec3::ZERO; x.len()];
        damping(&mode, &mut damped);
        let damping_at_omega_max = dot(&mode, &damped);
        let (damping_max, _) = largest_eigenvalue(x.len(), &inverse_root, &damping);
        Self { omega_max: top.max(0.0).sqrt(), damping_at_omega_max, damping_max: damping_max.max(0.0) }
    }
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// Largest eigenvalue of a symmetric operator and a unit vector of its eigenspace. `mask` is 0 where a particle cannot
/// move. The start is a fixed pseudo-random vector, so the result is the same every time.
fn largest_eigenvalue(
    n: usize,
    mask: &[f64],
    apply: &dyn Fn(&[DVec3], &mut [DVec3]),
) -> (f64, Vec<DVec3>) {
    /// Iterations at most, and the relative change of the eigenvalue at which they end.
    const MOST: usize = 120;
    const CHANGE: f64 = 1e-9;
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = || {
        // xorshift64 (Marsaglia, "Xorshift RNGs", 2003): any fixed vector with all frequencies in it will do.
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let mut start: Vec<DVec3> =
        mask.iter().map(|m| if *m > 0.0 { DVec3::new(random(), random(), random()) } else { DVec3::ZERO }).collect();
    let size = dot(&start, &start).sqrt();
    start.iter_mut().for_each(|c| *c /= size);

    let mut basis = vec![start];
    let (mut alphas, mut betas) = (Vec::new(), Vec::<f64>::new());
    let mut value = 0.0;
    let mut image = vec![DVec3::ZERO; n];
    while basis.len() <= MOST.min(3 * n) {
        let Some(last) = basis.last() else { break };
        apply(last, &mut image);
        alphas.push(dot(last, &image));
        let before = value;
        value = ritz(&alphas, &betas);
        // Twice, because once loses orthogonality to rounding (Parlett, "The Symmetric Eigenvalue Problem", 1980).
        for _ in 0..2 {
            for b in &basis {
                let along = dot(b, &image);
                image.iter_mut().zip(b).for_each(|(i, b)| *i -= *b * along);
            }
        }
        let beta = dot(&image, &image).sqrt();
        if !(beta > 1e-13 * value.abs()) || (alphas.len() > 12 && (value - before).abs() <= CHANGE * value.abs()) {
            break;
        }
        betas.push(beta);
        basis.push(image.iter().map(|i| *i / beta).collect());
    }
    let mut mode = vec![DVec3::ZERO; n];
    for (b, c) in basis.iter().zip(ritz_vector(&alphas, &betas, value)) {
        mode.iter_mut().zip(b).for_each(|(m, b)| *m += *b * c);
    }
    let size = dot(&mode, &mode).sqrt();
    if size > 0.0 {
        mode.iter_mut().for_each(|m| *m /= size);
    }
    (value, mode)
}

/// Largest eigenvalue of the symmetric tridiagonal matrix, by bisection on the number of eigenvalues above.
fn ritz(alphas: &[f64], betas: &[f64]) -> f64 {
    let off = |i: usize| betas.get(i).copied().unwrap_or(0.0);
    let radius = |i: usize| if i > 0 { off(i - 1) } else { 0.0 } + if i + 1 < alphas.len() { off(i) } else { 0.0 };
    let mut low = f64::INFINITY;
    let mut high = f64::NEG_INFINITY;
    for (i, a) in alphas.iter().enumerate() {
        low = low.min(a - radius(i));
        high = high.max(a + radius(i));
    }
    let none_above = |x: f64| {
        let mut pivot = 1.0;
        alphas.iter().enumerate().all(|(i, a)| {
            let coupling = if i > 0 { off(i - 1) * off(i - 1) / pivot } else { 0.0 };
            pivot = a - x - coupling;
            pivot < 0.0
        })
    };
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if none_above(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// The eigenvector of the tridiagonal matrix for its largest eigenvalue, by inverse iteration with a shift just above it:
/// the shifted matrix is negative definite, so elimination without pivoting is stable.
fn ritz_vector(alphas: &[f64], betas: &[f64], value: f64) -> Vec<f64> {
    let shift = value + value.abs().max(f64::MIN_POSITIVE) * 1e-12;
    let n = alphas.len();
    let mut y = vec![1.0; n];
    for _ in 0..3 {
        let mut pivots = vec![alphas[0] - shift; n];
        for i in 1..n {
            let factor = betas[i - 1] / pivots[i - 1];
            pivots[i] = alphas[i] - shift - factor * betas[i - 1];
            y[i] -= factor * y[i - 1];
        }
        for i in (0..n).rev() {
            let above = if i + 1 < n { betas[i] * y[i + 1] } else { 0.0 };
            y[i] = (y[i] - above) / pivots[i];
        }
        let size = y.iter().map(|c| c * c).sum::<f64>().sqrt();
        y.iter_mut().for_each(|c| *c /= size);
    }
    y
}
