//! The extreme motions of a cloth in its current shape: what limits an explicit step.
//!
//! For small motions around a shape, M x'' + D x' + K x = 0. K is the sum over springs of
//! k [(1 - L/l) I + (L/l) n nᵀ] (l the current length, n the direction); D is c I plus the graph Laplacian of the springs
//! times k_d. The largest eigenvalue of a combination of M⁻¹K and M⁻¹D is found on the symmetric M^-1/2 (…) M^-1/2 by the
//! locally optimal conjugate gradients of Knyazev ("Toward the optimal preconditioned eigensolver: LOBPCG", 2001) with a
//! block of one and no preconditioner: a handful of vectors whatever the number of iterations.

mod damped;

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
    /// Iterations at most, and at least, and the relative change of the eigenvalue at which they end.
    const MOST: usize = 100;
    const LEAST: usize = 12;
    const CHANGE: f64 = 1e-7;
    let n = mask.len();
    let mut x = random_vector(mask);
    let mut ax = vec![DVec3::ZERO; n];
    apply(&x, &mut ax);
    let mut value = dot(&x, &ax);
    let [mut w, mut aw] = [vec![DVec3::ZERO; n], vec![DVec3::ZERO; n]];
    // The direction of the last step, with its image; none at first.
    let mut p: Option<[Vec<DVec3>; 2]> = None;
    for iteration in 0..MOST {
        w.iter_mut().zip(x.iter().zip(&ax)).for_each(|(w, (x, ax))| *w = *ax - *x * value);
        let residual = dot(&w, &w).sqrt();
        if residual.is_nan() || residual <= 1e-12 * value.abs() {
            break;
        }
        scale(&mut w, 1.0 / residual);
        // The residual stands at right angles to x up to rounding, which grows as it shrinks.
        let along = dot(&w, &x);
        add(&mut w, &x, -along);
        apply(&w, &mut aw);
        if let Some([p, ap]) = &mut p {
            for (other, image) in [(&x, &ax), (&w, &aw)] {
                let along = dot(p, other);
                add(p, other, -along);
                add(ap, image, -along);
            }
            let length = dot(p, p).sqrt();
            if length > 1e-14 {
                scale(p, 1.0 / length);
                scale(ap, 1.0 / length);
            }
        }
        // A missing direction gets a value that can never be the largest.
        let mut ritz = [[value, dot(&x, &aw), 0.0], [0.0, dot(&w, &aw), 0.0], [0.0, 0.0, f64::MIN / 4.0]];
        if let Some([p, ap]) = &p
            && dot(p, p) > 0.5
        {
            (ritz[0][2], ritz[1][2], ritz[2][2]) = (dot(&x, ap), dot(&w, ap), dot(p, ap));
        }
        for (row, column) in [(1, 0), (2, 0), (2, 1)] {
            ritz[row][column] = ritz[column][row];
        }
        let [cx, cw, cp] = top_of_three(ritz);
        let [mut step, mut image] = p.take().unwrap_or_else(|| [vec![DVec3::ZERO; n], vec![DVec3::ZERO; n]]);
        for (direction, (w, p)) in [(&mut step, (&w, cp)), (&mut image, (&aw, cp))] {
            scale(direction, p);
            add(direction, w, cw);
        }
        for (vector, direction) in [(&mut x, &step), (&mut ax, &image)] {
            scale(vector, cx);
            add(vector, direction, 1.0);
        }
        let length = dot(&x, &x).sqrt();
        scale(&mut x, 1.0 / length);
        scale(&mut ax, 1.0 / length);
        p = Some([step, image]);
        let before = std::mem::replace(&mut value, dot(&x, &ax));
        if iteration >= LEAST && (value - before).abs() <= CHANGE * value.abs() {
            break;
        }
    }
    x
}

/// A fixed unit vector with all frequencies in it, by xorshift64 (Marsaglia, "Xorshift RNGs", 2003).
fn random_vector(mask: &[f64]) -> Vec<DVec3> {
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = || {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let any = |m: &f64| if *m > 0.0 { DVec3::new(random(), random(), random()) } else { DVec3::ZERO };
    let mut vector: Vec<DVec3> = mask.iter().map(any).collect();
    let length = dot(&vector, &vector).sqrt();
    scale(&mut vector, 1.0 / length);
    vector
}

fn scale(vector: &mut [DVec3], factor: f64) {
    vector.iter_mut().for_each(|v| *v *= factor);
}

fn add(to: &mut [DVec3], vector: &[DVec3], factor: f64) {
    to.iter_mut().zip(vector).for_each(|(t, v)| *t += *v * factor);
}

/// The unit eigenvector of a symmetric 3 x 3 matrix for its largest eigenvalue, by Jacobi's rotations.
fn top_of_three(mut a: [[f64; 3]; 3]) -> [f64; 3] {
    let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    // Off-diagonal parts shrink quadratically: six rounds leave rounding.
    for (i, j) in [(0, 1), (0, 2), (1, 2)].repeat(6) {
        if a[i][j] == 0.0 {
            continue;
        }
        let angle = 0.5 * libm::atan2(2.0 * a[i][j], a[j][j] - a[i][i]);
        let (sin, cos) = libm::sincos(angle);
        for row in &mut a {
            (row[i], row[j]) = (cos * row[i] - sin * row[j], sin * row[i] + cos * row[j]);
        }
        let [upper, lower] = [a[i], a[j]];
        a[i] = std::array::from_fn(|k| cos * upper[k] - sin * lower[k]);
        a[j] = std::array::from_fn(|k| sin * upper[k] + cos * lower[k]);
        for row in &mut vectors {
            (row[i], row[j]) = (cos * row[i] - sin * row[j], sin * row[i] + cos * row[j]);
        }
    }
    let top = (0..3).max_by(|&i, &j| a[i][i].total_cmp(&a[j][j])).unwrap_or(0);
    [vectors[0][top], vectors[1][top], vectors[2][top]]
}
