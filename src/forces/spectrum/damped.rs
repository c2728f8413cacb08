//! Damped motions: solutions x exp(λ t) of M x'' + D x' + K x = 0, where D and K need not share their shapes.
//!
//! (λ² + λ D + K) x = 0, symmetric after scaling by M^-1/2, is projected onto a growing space of real vectors (Rayleigh and
//! Ritz; for quadratic problems Meerbergen, "Locking and restarting quadratic eigenvalue solvers", 2001). Since the
//! matrices are symmetric, an eigenvalue of the projection errs by the square of what its vector does. The space grows by
//! the residual of the motion that is sought, and by that residual's image under K.

use super::{Mode, Spectrum, add, dot, scale};
use faer::Mat;
use glam::DVec3;

/// Vectors in the space at most, and the relative change of the answer, three times in a row, at which it ends.
const MOST: usize = 72;
const CHANGE: f64 = 1e-4;

impl Spectrum {
    /// One motion alone.
    pub fn oscillator(mode: Mode) -> Self {
        Self {
            inverse_root: vec![1.0],
            springs: Vec::new(),
            pulls: vec![(0, mode.omega_squared, mode.damping)],
            spring_damping: 0.0,
            air_damping: 0.0,
            parts: None,
        }
    }

    /// The smallest `limit` over the damped motions that decay, each given as the single motion x'' + g x' + ω² x = 0
    /// with the same λ. A hundred force evaluations, and eigenvalues of small matrices.
    pub fn smallest_over_damped(&self, limit: &dyn Fn(Mode) -> f64) -> f64 {
        let n = self.inverse_root.len();
        if n == 0 || self.inverse_root.iter().all(|w| *w == 0.0) {
            return f64::INFINITY;
        }
        let mut space = Space { spectrum: self, v: Vec::new(), kv: Vec::new(), dv: Vec::new() };
        let fastest = self.extreme(1.0, 0.0);
        let slow = fastest.damping / fastest.omega_squared.max(f64::MIN_POSITIVE);
        for (a, b) in [(1.0, 0.0), (0.0, 1.0), (slow.min(1e6), -1.0)] {
            space.grow(super::top_eigenvector(&self.inverse_root, &|from, to| self.apply(a, b, from, to)));
        }
        let mut best = f64::INFINITY;
        let mut still = 0;
        while space.v.len() < MOST.min(3 * n) {
            let Some((value, [re, im], [x_re, x_im])) = space.best(limit) else { return best };
            still = if (value - best).abs() <= CHANGE * best.abs() { still + 1 } else { 0 };
            best = value;
            if still == 3 {
                break;
            }
            let before = space.v.len();
            // (λ² + λ D + K) x, λ = re + i im.
            let (square_re, square_im) = (re * re - im * im, 2.0 * re * im);
            let mut residual = [vec![DVec3::ZERO; n], vec![DVec3::ZERO; n]];
            let [r_re, r_im] = &mut residual;
            for j in 0..before {
                let (a, b) = (x_re[j], x_im[j]);
                add(r_re, &space.v[j], square_re * a - square_im * b);
                add(r_im, &space.v[j], square_re * b + square_im * a);
                add(r_re, &space.dv[j], re * a - im * b);
                add(r_im, &space.dv[j], re * b + im * a);
                add(r_re, &space.kv[j], a);
                add(r_im, &space.kv[j], b);
            }
            for r in residual {
                let mut image = vec![DVec3::ZERO; n];
                self.apply(1.0, 0.0, &r, &mut image);
                space.grow(r);
                space.grow(image);
            }
            if space.v.len() == before {
                break;
            }
        }
        best
    }
}

/// An orthonormal set of vectors with their images.
struct Space<'a> {
    spectrum: &'a Spectrum,
    v: Vec<Vec<DVec3>>,
    kv: Vec<Vec<DVec3>>,
    dv: Vec<Vec<DVec3>>,
}

/// The worth of a motion, its λ, and its shape in the space: real and imaginary parts.
type Found = (f64, [f64; 2], [Vec<f64>; 2]);

impl Space<'_> {
    fn grow(&mut self, mut vector: Vec<DVec3>) {
        let length = dot(&vector, &vector).sqrt();
        if length.is_nan() || length <= 0.0 {
            return;
        }
        scale(&mut vector, 1.0 / length);
        for _ in 0..2 {
            for other in &self.v {
                let along = dot(&vector, other);
                add(&mut vector, other, -along);
            }
        }
        let rest = dot(&vector, &vector).sqrt();
        if rest.is_nan() || rest < 1e-8 {
            return;
        }
        scale(&mut vector, 1.0 / rest);
        for (a, b, images) in [(1.0, 0.0, &mut self.kv), (0.0, 1.0, &mut self.dv)] {
            let mut image = vec![DVec3::ZERO; vector.len()];
            self.spectrum.apply(a, b, &vector, &mut image);
            images.push(image);
        }
        self.v.push(vector);
    }

    /// The motion of the space with the smallest worth.
    fn best(&self, limit: &dyn Fn(Mode) -> f64) -> Option<Found> {
        let m = self.v.len();
        let of = |images: &[Vec<DVec3>]| -> Vec<Vec<f64>> {
            self.v.iter().map(|v| images.iter().map(|image| dot(v, image)).collect()).collect()
        };
        let (k, d) = (of(&self.kv), of(&self.dv));
        // Time is scaled so that both blocks are of one size.
        let rate = k.iter().enumerate().map(|(i, row)| row[i]).fold(0.0, f64::max).sqrt();
        if rate.is_nan() || rate <= 0.0 {
            return None;
        }
        let companion = Mat::from_fn(2 * m, 2 * m, |i, j| match (i < m, j < m) {
            (true, true) => 0.0,
            (true, false) => f64::from(u8::from(i == j - m)),
            (false, true) => -k[i - m][j] / (rate * rate),
            (false, false) => -d[i - m][j - m] / rate,
        });
        let eigen = companion.eigen().ok()?;
        let (values, vectors) = (eigen.S(), eigen.U());
        let decays = (0..2 * m).filter(|i| values[*i].re * rate < 0.0 && values[*i].im >= 0.0);
        let worth = decays.map(|i| {
            let (re, im) = (values[i].re * rate, values[i].im * rate);
            let mode = if im > 0.0 {
                Mode { omega_squared: re * re + im * im, damping: -2.0 * re }
            } else {
                // A single exponential: the other one of its pair is slow beside it.
                Mode { omega_squared: 1e-12 * re * re, damping: -re }
            };
            (limit(mode), i)
        });
        let (value, i) = worth.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let shape = |part: &dyn Fn(usize) -> f64| (0..m).map(part).collect();
        let shapes = [shape(&|j| vectors[(j, i)].re), shape(&|j| vectors[(j, i)].im)];
        Some((value, [values[i].re * rate, values[i].im * rate], shapes))
    }
}
