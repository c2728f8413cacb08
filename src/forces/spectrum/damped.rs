//! Damped motions: solutions x exp(λ t) of M x'' + D x' + K x = 0, where D and K need not share their shapes.
//!
//! (λ² + λ D + K) x = 0, symmetric after scaling by M^-1/2, is projected onto a growing space of real vectors (Rayleigh and
//! Ritz; for quadratic problems Meerbergen, "Locking and restarting quadratic eigenvalue solvers", 2001). Since the
//! matrices are symmetric, an eigenvalue of the projection errs by the square of what its vector does. The space grows by
//! the residuals of the two best motions, so that neither is taken for the other's better, and by the image of the best one's under
//! K; once it is full, the shapes of the motions that matter most are kept of it.

use super::{Mode, Parts, Spectrum, add, dot, scale};
use faer::Mat;
use glam::DVec3;
use std::sync::PoisonError;

/// Vectors in the space at most, and the motions whose shapes are kept of a full one.
const MOST: usize = 48;
const KEPT: usize = 4;
/// The relative change of the answer, so often in a row, at which the search ends; and the growths after which it does anyway.
const CHANGE: f64 = 1e-4;
const STILL: usize = 3;
const LONGEST: usize = 40;
/// What a growth costs in iterations of the search for an extreme motion; and its small matrices, times the particles.
const ITERATIONS: usize = 14;
const SMALL: usize = 100_000;
/// Particles from which on the space would not fit into memory: 350 MB up to here.
const LARGE: usize = 100_000;

/// How far a search in parts has come.
#[derive(Debug, Default)]
pub(super) enum Progress {
    #[default]
    Unknown,
    /// Not begun, but near these shapes.
    Near(Vec<Vec<DVec3>>),
    UnderWay(Box<Search>),
    /// The answer, and the shapes that belong to it.
    Found(f64, Vec<Vec<DVec3>>),
}

impl Progress {
    pub fn near(shapes: Vec<Vec<DVec3>>) -> Self {
        if shapes.is_empty() { Self::Unknown } else { Self::Near(shapes) }
    }

    pub fn is_under_way(&self) -> bool {
        matches!(self, Self::UnderWay(_))
    }

    /// The shapes that are known to matter.
    pub fn found(self) -> Vec<Vec<DVec3>> {
        match self {
            Self::Near(shapes) | Self::Found(_, shapes) => shapes,
            _ => Vec::new(),
        }
    }
}

impl Spectrum {
    /// The smallest `limit` over the damped motions that decay, each given as the single motion x'' + g x' + ω² x = 0
    /// with the same λ. A few hundred force evaluations, and eigenvalues of small matrices. In parts the same `limit` must be
    /// asked for every time.
    ///
    /// Undamped that is the fastest motion's. Where the spectrum is the [`stiffest`](Self::stiffest), of very many particles, or
    /// of numbers that are not finite, the smallest over every ω² = x·Kx and g = x·Dx is taken, not only of those that belong
    /// together in a motion: that is on the safe side.
    pub fn smallest_over_damped(&self, limit: &dyn Fn(Mode) -> f64) -> f64 {
        let n = self.inverse_root.len();
        if self.inverse_root.iter().all(|w| *w == 0.0) {
            return f64::INFINITY;
        }
        let fastest = self.extreme(1.0, 0.0);
        let pulled = self.pulls.iter().any(|(.., damping)| *damping > 0.0);
        if self.spring_damping <= 0.0 && self.air_damping <= 0.0 && !pulled {
            return limit(fastest);
        }
        if self.any_shape || n > LARGE {
            return self.smallest_over_shapes(limit);
        }
        let slow = fastest.damping / fastest.omega_squared.max(f64::MIN_POSITIVE);
        // The last three are damped least for their frequency: among the fast motions, the slow ones, and between.
        let slow = slow.min(1e6);
        let extremes = [[1.0, 0.0], [0.0, 1.0], [slow, -1.0], [0.5 * slow, -1.0], [2.0 * slow, -1.0]];
        let Some(parts) = &self.parts else {
            let mut search = Search::default();
            for [a, b] in extremes {
                let apply = |from: &[DVec3], to: &mut [DVec3]| self.apply(a, b, from, to);
                search.space.grow(self, super::top_eigenvector(&self.inverse_root, &apply));
            }
            while !search.go_on(self, limit) {}
            return if search.best.is_finite() { search.best } else { self.smallest_over_shapes(limit) };
        };
        // One after the other: what is asked while another is looked for is not begun.
        for [a, b] in extremes {
            self.extreme(a, b);
        }
        let mut locked = parts.lock().unwrap_or_else(PoisonError::into_inner);
        let Parts { known, current, damped, left, .. } = &mut *locked;
        if current.is_some() && !matches!(damped, Progress::Found(..)) {
            return limit(fastest);
        }
        let mut search = match std::mem::take(damped) {
            Progress::Found(value, shapes) => {
                *damped = Progress::Found(value, shapes);
                drop(locked);
                return if value.is_finite() { value } else { self.smallest_over_shapes(limit) };
            }
            Progress::UnderWay(search) => search,
            begun => {
                let mut search = Box::<Search>::default();
                begun.found().into_iter().for_each(|shape| search.space.grow(self, shape));
                for (question, _, shape) in known.iter() {
                    if extremes.contains(question) {
                        search.space.grow(self, shape.clone());
                    }
                }
                search
            }
        };
        let mut found = false;
        while *left > 0 && !found {
            *left = left.saturating_sub(ITERATIONS + SMALL / n);
            found = search.go_on(self, limit);
        }
        let value = search.best;
        *damped = if found { Progress::Found(value, search.shapes) } else { Progress::UnderWay(search) };
        drop(locked);
        if found && !value.is_finite() { self.smallest_over_shapes(limit) } else { value }
    }

    /// The smallest `limit` of any shape's ω² and g, whether the shape moves by itself or not: of the fastest, the most
    /// damped, and then in turn of those that are most critical together and least damped for their frequency at what was
    /// found so far (Dinkelbach, "On nonlinear fractional programming", 1967).
    fn smallest_over_shapes(&self, limit: &dyn Fn(Mode) -> f64) -> f64 {
        let at = |[a, b]: [f64; 2]| limit(self.extreme(a, b));
        // As much damping without any stiffness creeps faster than with.
        let creeping = Mode { omega_squared: 0.0, ..self.extreme(0.0, 1.0) };
        let mut smallest = at([1.0, 0.0]).min(limit(creeping));
        for _ in 0..4 {
            let dt = smallest.min(1e6);
            let next = smallest.min(at([dt * dt, 2.0 * dt])).min(at([dt, -1.0]));
            if smallest - next <= 1e-6 * smallest {
                break;
            }
            smallest = next;
        }
        smallest
    }
}

/// The search for the motion of the smallest worth.
#[derive(Debug)]
pub(super) struct Search {
    space: Space,
    best: f64,
    /// The shape of the best motion: its real and imaginary parts.
    shapes: Vec<Vec<DVec3>>,
    still: usize,
    growths: usize,
}

impl Default for Search {
    fn default() -> Self {
        Self { space: Space::default(), best: f64::INFINITY, shapes: Vec::new(), still: 0, growths: 0 }
    }
}

impl Search {
    /// Looks for the best motion of the space, and lets the space grow towards it; true at the end.
    fn go_on(&mut self, spectrum: &Spectrum, limit: &dyn Fn(Mode) -> f64) -> bool {
        let n = spectrum.inverse_root.len();
        let motions = self.space.motions(limit);
        let Some(Motion { worth, parts, .. }) = motions.first() else { return true };
        self.still = if (worth - self.best).abs() <= CHANGE * worth.abs() { self.still + 1 } else { 0 };
        self.best = *worth;
        self.growths += 1;
        self.shapes = parts.each_ref().map(|part| combined(&self.space.v, part)).into();
        if self.still == STILL || self.growths == LONGEST {
            return true;
        }
        let mut new: Vec<Vec<DVec3>> =
            motions.iter().take(2).flat_map(|motion| self.space.residual(motion)).collect();
        for i in 0..2 {
            let mut image = vec![DVec3::ZERO; n];
            spectrum.apply(1.0, 0.0, &new[i], &mut image);
            new.push(image);
        }
        if self.space.v.len() + new.len() > MOST {
            self.space.keep(&motions);
        }
        let before = self.space.v.len();
        new.into_iter().for_each(|vector| self.space.grow(spectrum, vector));
        // Nothing new: the space is whole.
        self.space.v.len() == before
    }
}

/// A motion of a space: its worth, its λ, and its shape as a combination of the vectors: real and imaginary parts.
struct Motion {
    worth: f64,
    rate: [f64; 2],
    parts: [Vec<f64>; 2],
}

/// An orthonormal set of vectors with their images under K and D, and both projected onto the set.
#[derive(Debug, Default)]
struct Space {
    v: Vec<Vec<DVec3>>,
    images: Vec<[Vec<DVec3>; 2]>,
    projected: Vec<Vec<[f64; 2]>>,
}

/// A combination of vectors.
fn combined(vectors: &[Vec<DVec3>], parts: &[f64]) -> Vec<DVec3> {
    let mut sum = vec![DVec3::ZERO; vectors.first().map_or(0, Vec::len)];
    vectors.iter().zip(parts).for_each(|(vector, part)| add(&mut sum, vector, *part));
    sum
}

impl Space {
    fn grow(&mut self, spectrum: &Spectrum, mut vector: Vec<DVec3>) {
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
        let images = [(1.0, 0.0), (0.0, 1.0)].map(|(a, b)| {
            let mut image = vec![DVec3::ZERO; vector.len()];
            spectrum.apply(a, b, &vector, &mut image);
            image
        });
        self.take(vector, images);
    }

    /// (λ² + λ D + K) x of a motion: real and imaginary parts.
    fn residual(&self, motion: &Motion) -> [Vec<DVec3>; 2] {
        let Motion { rate: [re, im], parts: [x_re, x_im], .. } = motion;
        let (square_re, square_im) = (re * re - im * im, 2.0 * re * im);
        let mut residual = [0, 1].map(|_| vec![DVec3::ZERO; self.v.first().map_or(0, Vec::len)]);
        let [r_re, r_im] = &mut residual;
        for (j, (v, [kv, dv])) in self.v.iter().zip(&self.images).enumerate() {
            let (a, b) = (x_re[j], x_im[j]);
            add(r_re, v, square_re * a - square_im * b);
            add(r_im, v, square_re * b + square_im * a);
            add(r_re, dv, re * a - im * b);
            add(r_im, dv, re * b + im * a);
            add(r_re, kv, a);
            add(r_im, kv, b);
        }
        residual
    }

    /// Takes a unit vector at right angles to the others.
    fn take(&mut self, vector: Vec<DVec3>, images: [Vec<DVec3>; 2]) {
        self.v.push(vector);
        self.projected.push(self.v.iter().map(|v| [dot(v, &images[0]), dot(v, &images[1])]).collect());
        self.images.push(images);
    }

    /// Shrinks to the shapes of the best motions.
    fn keep(&mut self, motions: &[Motion]) {
        let old = std::mem::take(self);
        let mut kept: Vec<Vec<f64>> = Vec::new();
        for part in motions.iter().take(KEPT).flat_map(|motion| &motion.parts) {
            let mut part = part.clone();
            let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            for _ in 0..2 {
                for other in &kept {
                    let along = product(&part, other);
                    part.iter_mut().zip(other).for_each(|(p, o)| *p -= along * o);
                }
            }
            let length = product(&part, &part).sqrt();
            if length > 1e-6 {
                part.iter_mut().for_each(|p| *p /= length);
                kept.push(part);
            }
        }
        let [k, d]: [Vec<Vec<DVec3>>; 2] = {
            let (k, d) = old.images.into_iter().map(|[k, d]| (k, d)).unzip();
            [k, d]
        };
        for part in kept {
            self.take(combined(&old.v, &part), [combined(&k, &part), combined(&d, &part)]);
        }
    }

    /// The motions of the space that decay, the smallest worth first.
    fn motions(&self, limit: &dyn Fn(Mode) -> f64) -> Vec<Motion> {
        let m = self.v.len();
        let of = |i: usize, j: usize| self.projected[i.max(j)][i.min(j)];
        // Time is scaled so that both blocks are of one size.
        let rate = (0..m).map(|i| of(i, i)).fold(0.0, |rate: f64, [k, d]| rate.max(k.max(0.0).sqrt()).max(d));
        if !rate.is_finite()
            || rate <= 0.0
            || self.projected.iter().flatten().flatten().any(|p| !p.is_finite())
        {
            return Vec::new();
        }
        let companion = Mat::from_fn(2 * m, 2 * m, |i, j| match (i < m, j < m) {
            (true, true) => 0.0,
            (true, false) => f64::from(u8::from(i == j - m)),
            (false, true) => -of(i - m, j)[0] / (rate * rate),
            (false, false) => -of(i - m, j - m)[1] / rate,
        });
        let Ok(eigen) = companion.eigen() else { return Vec::new() };
        let (values, vectors) = (eigen.S(), eigen.U());
        let decays = (0..2 * m).filter(|i| values[*i].re * rate < 0.0 && values[*i].im >= 0.0);
        let mut motions: Vec<Motion> = decays
            .map(|i| {
                let (re, im) = (values[i].re * rate, values[i].im * rate);
                let mode = if im > 0.0 {
                    Mode { omega_squared: re * re + im * im, damping: -2.0 * re }
                } else {
                    // A single exponential: the other one of its pair is slow beside it.
                    Mode { omega_squared: 1e-12 * re * re, damping: -re }
                };
                let shape = |part: &dyn Fn(usize) -> f64| (0..m).map(part).collect();
                let parts = [shape(&|j| vectors[(j, i)].re), shape(&|j| vectors[(j, i)].im)];
                Motion { worth: limit(mode), rate: [re, im], parts }
            })
            .collect();
        motions.sort_by(|a, b| a.worth.total_cmp(&b.worth));
        motions
    }
}
