//! The extreme motions of a cloth in its current shape: what limits an explicit step.
//!
//! For small motions around a shape, M x'' + D x' + K x = 0. K is the sum over springs of
//! k [(1 - L/l) I + (L/l) n nᵀ] (l the current length, n the direction); D is c I plus the graph Laplacian of the springs
//! times k_d. The largest eigenvalue of a combination of M⁻¹K and M⁻¹D is found on the symmetric M^-1/2 (…) M^-1/2 by the
//! locally optimal conjugate gradients of Knyazev ("Toward the optimal preconditioned eigensolver: LOBPCG", 2001) with a
//! block of one and no preconditioner: a handful of vectors whatever the number of iterations.
//!
//! Where nobody may wait, a spectrum can be asked [`in_parts`](Spectrum::in_parts): what is not found within some iterations
//! is looked for further when the same is asked again, and a later shape begins where an earlier one ended.

mod damped;

use super::Problem;
use crate::math::{Real, Vector, random::Xorshift};
use crate::model::Particles;
use glam::DVec3;
use std::sync::{Mutex, PoisonError};

/// Small motions of a cloth around its current shape, in double precision.
#[derive(Debug)]
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
    /// Whether it stands for every shape of the cloth.
    any_shape: bool,
    /// Where it is asked in parts.
    parts: Option<Mutex<Parts>>,
}

/// What is known of the motions that were asked for, and how far the search for the next one has come.
#[derive(Debug, Default)]
struct Parts {
    known: Vec<([f64; 2], Mode, Vec<DVec3>)>,
    current: Option<([f64; 2], Search)>,
    damped: damped::Progress,
    /// Iterations that may still be taken.
    left: usize,
    /// The last motion that was found, where the next search begins.
    found: Vec<DVec3>,
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
                .pulls()
                .iter()
                .map(|p| (p.particle as usize, p.stiffness.to_f64(), p.damping.to_f64()))
                .collect(),
            spring_damping: problem.spring_damping.to_f64(),
            air_damping: problem.air_damping.to_f64(),
            any_shape: false,
            parts: None,
        }
    }

    /// From now on [`extreme`](Self::extreme) iterates only as far as [`allow`](Self::allow) lets it, begins where an earlier
    /// spectrum of the same cloth has ended, and is content with four digits.
    #[must_use]
    pub fn in_parts(mut self, earlier: Option<Self>) -> Self {
        let found = earlier
            .and_then(|e| e.parts)
            .map(|parts| parts.into_inner().unwrap_or_else(PoisonError::into_inner));
        let n = self.inverse_root.len();
        let (found, damped) = found.map(|parts| (parts.found, parts.damped.found())).unwrap_or_default();
        let fits = |shape: &Vec<DVec3>| shape.len() == n;
        self.parts = Some(Mutex::new(Parts {
            found: Some(found).filter(fits).unwrap_or_default(),
            damped: damped::Progress::near(damped.into_iter().filter(fits).collect()),
            ..Parts::default()
        }));
        self
    }

    /// Allows this many iterations more.
    pub fn allow(&self, iterations: usize) {
        if let Some(parts) = &self.parts {
            parts.lock().unwrap_or_else(PoisonError::into_inner).left = iterations;
        }
    }

    /// Whether everything that was asked for since iterations were last allowed has been found.
    pub fn is_settled(&self) -> bool {
        let unsettled = |parts: &Mutex<Parts>| {
            let parts = parts.lock().unwrap_or_else(PoisonError::into_inner);
            parts.current.is_some() || parts.damped.is_under_way()
        };
        !self.parts.as_ref().is_some_and(unsettled)
    }

    /// A cloth that is stiffer than this one in any shape: each spring resists with k in every direction, so that K is k
    /// times the graph Laplacian, which no stretched or turned spring exceeds.
    pub fn stiffest<T: Real>(problem: &Problem<T>) -> Self {
        let at_once = Particles::<T>::at_rest(vec![T::Vec3::default(); problem.particles()]);
        let mut spectrum = Self { any_shape: true, ..Self::of(problem, &at_once) };
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
        let apply = |from: &[DVec3], to: &mut [DVec3]| self.apply(a, b, from, to);
        let Some(parts) = &self.parts else {
            return self.mode(&top_eigenvector(&self.inverse_root, &apply));
        };
        let mut parts = parts.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, mode, _)) = parts.known.iter().find(|(known, ..)| *known == [a, b]) {
            return *mode;
        }
        let begun = parts.current.take();
        if parts.left == 0 && begun.as_ref().is_some_and(|(other, _)| *other != [a, b]) {
            // Another motion is still being looked for: what is asked now rests on a guess, and will be asked again.
            parts.current = begun;
            return Mode::default();
        }
        let begun = begun.filter(|(known, _)| *known == [a, b]).map(|(_, search)| search);
        let mut search = begun.unwrap_or_else(|| Search::from(self.guess(&parts.found), &apply));
        let mut found = false;
        while parts.left > 0 && !found {
            parts.left -= 1;
            found = search.iterate(&apply, LEAST / 2, COARSE) || search.iterations >= MOST;
        }
        let mode = self.mode(&search.x);
        if found {
            parts.found.clone_from(&search.x);
            parts.known.push(([a, b], mode, search.x));
        } else {
            parts.current = Some(([a, b], search));
        }
        mode
    }

    fn mode(&self, x: &[DVec3]) -> Mode {
        let rayleigh = |a: f64, b: f64| {
            let mut image = vec![DVec3::ZERO; x.len()];
            self.apply(a, b, x, &mut image);
            dot(x, &image)
        };
        Mode { omega_squared: rayleigh(1.0, 0.0), damping: rayleigh(0.0, 1.0) }
    }

    /// A unit vector near what was found, with all other motions in it too, so that none is overlooked.
    fn guess(&self, found: &[DVec3]) -> Vec<DVec3> {
        /// The part of the others.
        const OTHERS: f64 = 0.3;
        let mut guess = random_vector(&self.inverse_root);
        if found.len() == guess.len() {
            scale(&mut guess, OTHERS);
            let fixed = guess.iter_mut().zip(found).zip(&self.inverse_root);
            fixed.filter(|(_, w)| **w > 0.0).for_each(|((g, f), _)| *g += *f);
            let length = dot(&guess, &guess).sqrt();
            scale(&mut guess, 1.0 / length);
        }
        guess
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

/// Iterations at most, and at least, and the relative change of the eigenvalue at which they end.
const MOST: usize = 100;
const LEAST: usize = 13;
const CHANGE: f64 = 1e-7;
/// The same change where four digits will do.
const COARSE: f64 = 1e-5;

/// The search for an eigenvector of a symmetric operator for its largest eigenvalue.
#[derive(Debug)]
struct Search {
    /// A unit vector, and its image.
    x: Vec<DVec3>,
    ax: Vec<DVec3>,
    value: f64,
    /// Its residual, and the image of that.
    w: Vec<DVec3>,
    aw: Vec<DVec3>,
    /// The direction of the last step, with its image; none at first.
    p: Option<[Vec<DVec3>; 2]>,
    iterations: usize,
}

impl Search {
    fn from(x: Vec<DVec3>, apply: &dyn Fn(&[DVec3], &mut [DVec3])) -> Self {
        let [mut ax, w, aw] = std::array::from_fn(|_| vec![DVec3::ZERO; x.len()]);
        apply(&x, &mut ax);
        let value = dot(&x, &ax);
        Self { x, ax, value, w, aw, p: None, iterations: 0 }
    }

    /// One iteration; true once `least` of them were taken and the eigenvalue changes by less than `change` of itself.
    fn iterate(&mut self, apply: &dyn Fn(&[DVec3], &mut [DVec3]), least: usize, change: f64) -> bool {
        let Self { x, ax, value, w, aw, p, iterations } = self;
        w.iter_mut().zip(x.iter().zip(ax.iter())).for_each(|(w, (x, ax))| *w = *ax - *x * *value);
        let residual = dot(w, w).sqrt();
        if residual.is_nan() || residual <= 1e-12 * value.abs() {
            return true;
        }
        scale(w, 1.0 / residual);
        // The residual stands at right angles to x up to rounding, which grows as it shrinks.
        let along = dot(w, x);
        add(w, x, -along);
        apply(w, aw);
        if let Some([p, ap]) = p {
            for (other, image) in [(&*x, &*ax), (&*w, &*aw)] {
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
        let mut ritz = [[*value, dot(x, aw), 0.0], [0.0, dot(w, aw), 0.0], [0.0, 0.0, f64::MIN / 4.0]];
        if let Some([p, ap]) = p
            && dot(p, p) > 0.5
        {
            (ritz[0][2], ritz[1][2], ritz[2][2]) = (dot(x, ap), dot(w, ap), dot(p, ap));
        }
        for (row, column) in [(1, 0), (2, 0), (2, 1)] {
            ritz[row][column] = ritz[column][row];
        }
        let [cx, cw, cp] = top_of_three(ritz);
        let [mut step, mut image] =
            p.take().unwrap_or_else(|| std::array::from_fn(|_| vec![DVec3::ZERO; x.len()]));
        for (direction, part) in [(&mut step, &*w), (&mut image, &*aw)] {
            scale(direction, cp);
            add(direction, part, cw);
        }
        for (vector, direction) in [(&mut *x, &step), (&mut *ax, &image)] {
            scale(vector, cx);
            add(vector, direction, 1.0);
        }
        let length = dot(x, x).sqrt();
        scale(x, 1.0 / length);
        scale(ax, 1.0 / length);
        *p = Some([step, image]);
        *iterations += 1;
        let before = std::mem::replace(value, dot(x, ax));
        *iterations >= least && (*value - before).abs() <= change * value.abs()
    }
}

/// A unit eigenvector of a symmetric operator for its largest eigenvalue; `mask` is 0 where a particle cannot move.
fn top_eigenvector(mask: &[f64], apply: &dyn Fn(&[DVec3], &mut [DVec3])) -> Vec<DVec3> {
    let mut search = Search::from(random_vector(mask), apply);
    while search.iterations < MOST && !search.iterate(apply, LEAST, CHANGE) {}
    search.x
}

/// A fixed unit vector with all frequencies in it.
fn random_vector(mask: &[f64]) -> Vec<DVec3> {
    let mut numbers = Xorshift::new(0x9e37_79b9_7f4a_7c15);
    let mut random = || numbers.centred();
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
