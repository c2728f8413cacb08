//! The shape in which a cloth can rest: where the forces of springs and gravity cancel, by Newton's method.
//!
//! Minimises the potential energy U = Σ k (|d| - L)²/2 - Σ m g·x. Each step solves (H + λ I) p = F by conjugate gradients
//! (Hestenes, Stiefel, "Methods of conjugate gradients for solving linear systems", 1952), H being the Hessian or, where
//! that is not positive, the Hessian without what compressed springs make negative; λ grows until U falls (Levenberg, "A
//! method for the solution of certain non-linear problems in least squares", 1944).

use super::{Case, Event, Progress, Stop};
use crate::forces::{Problem, Spectrum};
use crate::model::Particles;
use crate::scene::Scene;
use glam::DVec3;

/// A shape at rest.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// Positions, m.
    pub positions: Vec<DVec3>,
    /// Largest force left on a free particle, N.
    pub residual: f64,
    /// Estimate of the smallest ω², 1/s²: where it is below 0 the shape is a saddle, which nothing settles to.
    pub smallest_eigenvalue: f64,
}

/// Newton steps at most, and conjugate gradients in each.
const MOST_STEPS: usize = 400;
const MOST_GRADIENTS: usize = 2000;
/// Force left over, as a part of the largest that acts.
const RESIDUAL: f64 = 1e-9;

/// The equilibrium that is downhill from the case's start; none where wind blows, nothing is pinned while gravity acts,
/// or the descent does not end.
///
/// # Errors
/// A scene that cannot be built; a listener that stops it.
pub fn find(case: &Case, scene: &Scene, progress: Progress) -> Result<Option<Equilibrium>, Stop> {
    let (problem, mut state) = case.start().problem(scene)?;
    let pinned = problem.inverse_mass.contains(&0.0);
    if problem.wind.is_some() || problem.springs.is_empty() || (problem.gravity.is_some() && !pinned) {
        return Ok(None);
    }
    let gravity = problem.gravity.unwrap_or_default();
    let stiffness = problem.springs.groups.iter().map(|g| g.stiffness).fold(0.0, f64::max);
    let scale = problem.mass.iter().map(|m| m * gravity.length()).fold(0.0, f64::max);
    let mean_rest = problem.springs.rest.iter().sum::<f64>() / problem.springs.len() as f64;
    let enough = RESIDUAL * scale.max(1e-3 * stiffness * mean_rest);

    let mut lambda = 1e-3 * stiffness;
    let mut energy = potential(&problem, &state.positions);
    let mut force = forces(&problem, &state.positions);
    for _ in 0..MOST_STEPS {
        if !progress(Event::Alive) {
            return Err(Stop::Cancelled);
        }
        let residual = force.iter().map(|f| f.length()).fold(0.0, f64::max);
        if residual <= enough {
            let smallest_eigenvalue = Spectrum::of(&problem, &state).extreme(-1.0, 0.0).omega_squared;
            return Ok(Some(Equilibrium { positions: state.positions, residual, smallest_eigenvalue }));
        }
        let part = (residual / scale.max(enough)).clamp(1e-10, 0.1);
        let whole = Hessian::of(&problem, &state, lambda, f64::NEG_INFINITY).solve(&force, part);
        let step = whole.or_else(|| Hessian::of(&problem, &state, lambda, 0.0).solve(&force, part));
        let Some(step) = step else { return Ok(None) };
        let there: Vec<DVec3> = state.positions.iter().zip(&step).map(|(x, p)| *x + *p).collect();
        let lower = potential(&problem, &there);
        // Near the end U no longer resolves what a step gains: the forces decide.
        let fresh = forces(&problem, &there);
        let eased = fresh.iter().map(|f| f.length()).fold(0.0, f64::max) < residual;
        if lower < energy || (eased && lower - energy <= 1e-12 * energy.abs()) {
            (energy, force) = (lower, fresh);
            state.positions = there;
            lambda /= 8.0;
        } else {
            lambda = (lambda * 4.0).max(1e-12 * stiffness);
        }
    }
    Ok(None)
}

/// Forces of springs and gravity where a particle is free, N.
fn forces(problem: &Problem<f64>, x: &[DVec3]) -> Vec<DVec3> {
    let gravity = problem.gravity.unwrap_or_default();
    let mut force: Vec<DVec3> = problem.mass.iter().map(|m| gravity * *m).collect();
    for (s, k) in springs(problem) {
        let [i, j] = problem.springs.pairs[s].map(|p| p as usize);
        let d = x[j] - x[i];
        let length = d.length();
        if length > 0.0 {
            let f = d * (k * (length - problem.springs.rest[s]) / length);
            force[i] += f;
            force[j] -= f;
        }
    }
    mask(problem, &mut force);
    force
}

fn potential(problem: &Problem<f64>, x: &[DVec3]) -> f64 {
    let gravity = problem.gravity.unwrap_or_default();
    let weight: f64 = problem.mass.iter().zip(x).map(|(m, x)| m * gravity.dot(*x)).sum();
    let elastic: f64 = springs(problem)
        .map(|(s, k)| {
            let [i, j] = problem.springs.pairs[s].map(|p| p as usize);
            0.5 * k * (x[j].distance(x[i]) - problem.springs.rest[s]).powi(2)
        })
        .sum();
    elastic - weight
}

/// Every acting spring with its stiffness.
fn springs(problem: &Problem<f64>) -> impl Iterator<Item = (usize, f64)> + '_ {
    problem.springs.groups.iter().flat_map(|group| group.range.clone().map(|s| (s, group.stiffness)))
}

fn mask(problem: &Problem<f64>, vectors: &mut [DVec3]) {
    for (v, w) in vectors.iter_mut().zip(&problem.inverse_mass) {
        if *w == 0.0 {
            *v = DVec3::ZERO;
        }
    }
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// The Hessian of U, plus λ.
struct Hessian<'a> {
    problem: &'a Problem<f64>,
    /// Direction, stiffness along it and across it, of each spring.
    springs: Vec<(DVec3, f64, f64)>,
    lambda: f64,
    /// Its diagonal, for preconditioning.
    diagonal: Vec<DVec3>,
}

impl<'a> Hessian<'a> {
    /// `least` is the least stiffness across a spring that is taken: 0 leaves out what compression makes negative.
    fn of(problem: &'a Problem<f64>, state: &Particles<f64>, lambda: f64, least: f64) -> Self {
        let mut diagonal = vec![DVec3::splat(lambda.max(f64::MIN_POSITIVE)); state.len()];
        let springs = springs(problem)
            .map(|(s, k)| {
                let [i, j] = problem.springs.pairs[s].map(|p| p as usize);
                let d = state.positions[j] - state.positions[i];
                let length = d.length();
                if length <= 0.0 {
                    return (DVec3::ZERO, 0.0, 0.0);
                }
                let (n, across) = (d / length, (k * (1.0 - problem.springs.rest[s] / length)).max(least));
                let own = n * n * (k - across) + DVec3::splat(across);
                diagonal[i] += own;
                diagonal[j] += own;
                (n, k, across)
            })
            .collect();
        Self { problem, springs, lambda, diagonal }
    }

    fn apply(&self, from: &[DVec3], to: &mut [DVec3]) {
        to.iter_mut().zip(from).for_each(|(t, f)| *t = *f * self.lambda);
        for (pair, (n, along, across)) in self.problem.springs.pairs.iter().zip(&self.springs) {
            let [i, j] = pair.map(|p| p as usize);
            let d = from[j] - from[i];
            let f = d * *across + *n * ((along - across) * n.dot(d));
            to[i] -= f;
            to[j] += f;
        }
        mask(self.problem, to);
    }

    /// Conjugate gradients down to a part of the right side; none where the Hessian turns out not to be positive.
    fn solve(&self, right: &[DVec3], part: f64) -> Option<Vec<DVec3>> {
        let precondition = |r: &[DVec3]| -> Vec<DVec3> {
            r.iter()
                .zip(&self.diagonal)
                .map(|(r, d)| *r / d.abs().max(DVec3::splat(f64::MIN_POSITIVE)))
                .collect()
        };
        let mut x = vec![DVec3::ZERO; right.len()];
        let mut r = right.to_vec();
        let mut z = precondition(&r);
        let mut p = z.clone();
        let mut image = x.clone();
        let mut rz = dot(&r, &z);
        let stop = part * part * dot(right, right);
        for _ in 0..MOST_GRADIENTS {
            self.apply(&p, &mut image);
            let curvature = dot(&p, &image);
            if dot(&r, &r) <= stop {
                break;
            }
            if curvature <= 0.0 {
                return None;
            }
            let a = rz / curvature;
            for (((x, r), p), image) in x.iter_mut().zip(&mut r).zip(&p).zip(&image) {
                *x += *p * a;
                *r -= *image * a;
            }
            z = precondition(&r);
            let next = dot(&r, &z);
            p.iter_mut().zip(&z).for_each(|(p, z)| *p = *z + *p * (next / rz));
            rz = next;
        }
        Some(x)
    }
}
