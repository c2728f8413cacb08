//! Preconditioned conjugate gradients for a symmetric positive definite system of 3x3 blocks (Hestenes and Stiefel, "Methods
//! of conjugate gradients for solving linear systems", 1952), with the inverses of the diagonal blocks as preconditioner.
//!
//! Scalar products are added up in double precision and in the order of the particles, whatever the number of threads.

use super::blocks::Block;
use crate::math::{Real, Vector};

/// The vectors that the iteration works on.
#[derive(Clone, Debug, Default)]
pub(super) struct ConjugateGradients<T: Real> {
    /// Inverses of the diagonal blocks, filled in by the caller; zero for a particle whose unknown is fixed at 0.
    pub preconditioner: Vec<Block<T>>,
    /// What remains of the right-hand side.
    residual: Vec<T::Vec3>,
    direction: Vec<T::Vec3>,
    image: Vec<T::Vec3>,
}

/// When a solve may end. Residuals are parts of the right-hand side, in the norm of the preconditioner.
pub(super) struct Enough<F, S> {
    /// With this residual,
    pub residual: f64,
    /// after so many iterations,
    pub iterations: u32,
    /// or with this residual already,
    pub loose: f64,
    /// where the solution so far is far off anyway;
    pub far_off: F,
    /// or where nobody waits for it any more.
    pub stopped: S,
}

/// What a solve took, and what it left.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solved {
    /// Products with the matrix.
    pub iterations: u32,
    /// Whether it ended loosely.
    pub loosely: bool,
    /// Size of the residual over that of the right-hand side, in the norm of the preconditioner.
    pub residual: f64,
}

impl<T: Real> ConjugateGradients<T> {
    /// Solves for `x` from 0; `multiply` writes the product of the matrix with its first argument over its second.
    pub fn solve(
        &mut self,
        right: &[T::Vec3],
        x: &mut Vec<T::Vec3>,
        enough: &Enough<impl Fn(&[T::Vec3]) -> bool, impl Fn() -> bool>,
        multiply: impl Fn(&[T::Vec3], &mut [T::Vec3]),
    ) -> Solved {
        let Self { preconditioner, residual, direction, image } = self;
        x.clear();
        x.resize(right.len(), T::Vec3::ZERO);
        image.resize(right.len(), T::Vec3::ZERO);
        residual.clear();
        residual.extend_from_slice(right);
        direction.clear();
        direction.extend(preconditioner.iter().zip(&*residual).map(|(p, &r)| p.times(r)));

        let start = dot::<T>(direction, residual);
        let mut size = start;
        let (mut iterations, mut loosely) = (0, false);
        let [tight, loose] = [enough.residual, enough.loose].map(|part| part * part * start);
        // Also ends where nothing is to be done, and where numbers are no longer finite.
        while size > tight && size.is_finite() && iterations < enough.iterations && !(enough.stopped)() {
            if size <= loose && (enough.far_off)(x) {
                loosely = true;
                break;
            }
            multiply(direction, image);
            iterations += 1;
            let curvature = dot::<T>(direction, image);
            if curvature <= 0.0 {
                break;
            }
            let stride = T::from_f64(size / curvature);
            for (((x, r), &d), &i) in x.iter_mut().zip(&mut *residual).zip(&*direction).zip(&*image) {
                *x += d * stride;
                *r -= i * stride;
            }
            // The image is no longer needed: it takes the preconditioned residual.
            let before = size;
            size = 0.0;
            for ((z, p), &r) in image.iter_mut().zip(&*preconditioner).zip(&*residual) {
                *z = p.times(r);
                size += z.dot(r).to_f64();
            }
            let keep = T::from_f64(size / before);
            for (d, &z) in direction.iter_mut().zip(&*image) {
                *d = z + *d * keep;
            }
        }
        Solved { iterations, loosely, residual: if start > 0.0 { (size / start).sqrt() } else { start } }
    }
}

/// Scalar product.
pub(super) fn dot<T: Real>(a: &[T::Vec3], b: &[T::Vec3]) -> f64 {
    a.iter().zip(b).map(|(a, &b)| a.dot(b).to_f64()).sum()
}
