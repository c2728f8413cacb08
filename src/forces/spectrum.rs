//! The extreme motions of a cloth in its current shape: what limits an explicit step.
//!
//! For small motions around a shape, M x'' + D x' + K x = 0. K is the sum over springs of
//! k [(1 - L/l) I + (L/l) n nᵀ] (l the current length, n the direction); D is c I plus the graph Laplacian of the springs
//! times k_d. The largest eigenvalue of a combination of M⁻¹K and M⁻¹D comes from the Lanczos iteration (Lanczos, "An
//! iteration method for the solution of the eigenvalue problem of linear differential and integral operators", 1950) on
//! the symmetric M^-1/2 (…) M^-1/2, with full reorthogonalisation.

use super::Problem;
use crate::math::{Real, Vector};
use crate::model::Particles;
use glam::DVec3;

/// Small motions of a cloth around its current shape, in double precision.
#[derive(Clone, Debug)]
pub struct Spectrum {
    /// 1/sqrt(m) of each particle, 0 where it cannot move.
    inverse_root: Vec<f64>,
    springs: Vec<Linear>,
    /// Particles that hands pull at, with stiffness (N/m) and damping (kg/s).
    pulls: Vec<(usize, f64, f64)>,
    /// k_d, kg/s.
    spring_damping: f64,
    /// c, kg/s.
    air_damping: f64,
}

/// A spring in its current length.
#[derive(Clone, Copy, Debug)]
struct Linear {
    ends: [u32; 2],
    /// Its direction.
    n: DVec3,
    /// Stiffness along it, k, and across it, k (1 - L/l): negative where it is compressed, N/m.
    along: f64,
    across: f64,
}

/// A motion y: x'' + g x' + ω² x = 0 along it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mode {
    /// ω², 1/s².
    pub omega_squared: f64,
    /// g, 1/s.
    pub damping: f64,
}

impl Spectrum {
    /// The small motions around a state.
    pub fn of<T: Real>(problem: &Problem<T>, state: &Particles<T>) -> Self {
        let springs = problem.springs.groups.iter().flat_map(|group| {
            let k = group.stiffness.to_f64();
            group.range.clone().map(move |s| (s, k))
        });
        let springs = springs
            .map(|(s, k)| {
                let ends = problem.springs.pairs[s];
                let [a, b] = ends.map(|p| state.positions[p as usize].to_f64());
                let length = (b - a).length();
                if length > 0.0 {
                    let across = k * (1.0 - problem.springs.rest[s].to_f64() / length);
                    Linear { ends, n: (b - a) / length, along: k, across }
                } else {
                    Linear { ends, n: DVec3::ZERO, along: 0.0, across: 0.0 }
                }
            })
            .collect();
        Self {
            inverse_root: problem.inverse_mass.iter().map(|w| w.to_f64().sqrt()).collect(),
            springs,
            pulls: problem
                .pulls
                .iter()
                .map(|p| (p.particle as usize, p.stiffness.to_f64(), p.damping.to_f64()))
                .collect(),
            spring_damping: problem.spring_damping.to_f64(),
            air_damping: problem.air_damping.to_f64(),
        }
    }

    /// A cloth that is stiffer than this one in any shape: each spring resists with k in every direction, so that K is k
    /// times the graph Laplacian, which no stretched or turned spring exceeds.
    pub fn stiffest<T: Real>(problem: &Problem<T>) -> Self {
        let at_once = Particles::<T>::at_rest(vec![T::Vec3::default(); problem.particles()]);
        let mut spectrum = Self::of(problem, &at_once);
        for group in &problem.springs.groups {
            let k = group.stiffness.to_f64();
            spectrum.springs[group.range.clone()].iter_mut().for_each(|s| (s.along, s.across) = (k, k));
        }
        spectrum
    }

    /// Largest natural frequency, rad/s: the square root of the largest eigenvalue of M⁻¹K.
    pub fn omega_max(&self) -> f64 {
        self.extreme(1.0, 0.0).omega_squared.max(0.0).sqrt()
    }

    /// The motion for which a ω² + b g is largest. Costs about 40 force evaluations.
    pub fn extreme(&self, a: f64, b: f64) -> Mode {
        if self.inverse_root.iter().all(|w| *w == 0.0) {
            return Mode::default();
        }
        let mode = top_eigenvector(&self.inverse_root, &|from, to| self.apply(a, b, from, to));
        let rayleigh = |a: f64, b: f64| {
            let mut image = vec![DVec3::ZERO; mode.len()];
            self.apply(a, b, &mode, &mut image);
            dot(&mode, &image)
        };
        Mode { omega_squared: rayleigh(1.0, 0.0), damping: rayleigh(0.0, 1.0) }
    }

    /// `to` = M^-1/2 (a K + b D) M^-1/2 `from`.
    fn apply(&self, a: f64, b: f64, from: &[DVec3], to: &mut [DVec3]) {
        let w = &self.inverse_root;
        for (t, (f, w)) in to.iter_mut().zip(from.iter().zip(w)) {
            *t = *f * (b * self.air_damping * w);
        }
        let damping = b * self.spring_damping;
        for spring in &self.springs {
            let [i, j] = spring.ends.map(|p| p as usize);
            let d = from[j] * w[j] - from[i] * w[i];
            let across = d * (a * spring.across + damping);
            let f = across + spring.n * (a * (spring.along - spring.across) * spring.n.dot(d));
            to[i] -= f;
            to[j] += f;
        }
        for &(p, stiffness, damping) in &self.pulls {
            to[p] += from[p] * (w[p] * (a * stiffness + b * damping));
        }
        for (t, w) in to.iter_mut().zip(w) {
            *t *= *w;
        }
    }
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// A unit eigenvector of a symmetric operator for its largest eigenvalue. `mask` is 0 where a particle cannot move. The
/// start is a fixed pseudo-random vector, so the result is the same every time.
fn top_eigenvector(mask: &[f64], apply: &dyn Fn(&[DVec3], &mut [DVec3])) -> Vec<DVec3> {
    /// Iterations at most, and the relative change of the eigenvalue at which they end.
    const MOST: usize = 80;
    const CHANGE: f64 = 1e-7;
    let n = mask.len();
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = || {
        // xorshift64 (Marsaglia, "Xorshift RNGs", 2003): any fixed vector with all frequencies in it will do.
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let mut start: Vec<DVec3> = mask
        .iter()
        .map(|m| if *m > 0.0 { DVec3::new(random(), random(), random()) } else { DVec3::ZERO })
        .collect();
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
        let settled = alphas.len() > 12 && (value - before).abs() <= CHANGE * value.abs();
        if beta.is_nan() || beta <= 1e-13 * value.abs() || settled {
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
    mode
}

/// Largest eigenvalue of the symmetric tridiagonal matrix, by bisection on the number of eigenvalues above.
fn ritz(alphas: &[f64], betas: &[f64]) -> f64 {
    let off = |i: usize| betas.get(i).copied().unwrap_or(0.0);
    let radius =
        |i: usize| if i > 0 { off(i - 1) } else { 0.0 } + if i + 1 < alphas.len() { off(i) } else { 0.0 };
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
