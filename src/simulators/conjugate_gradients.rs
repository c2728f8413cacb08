//! Preconditioned conjugate gradients for a symmetric positive definite system of 3x3 blocks (Hestenes and Stiefel, "Methods
//! of conjugate gradients for solving linear systems", 1952), with the inverses of the diagonal blocks as preconditioner.
//!
//! Vectors stand in eights, by component. Scalar products are added up lane by lane within blocks of particles, then in double
//! precision and in the order of the blocks, whatever the number of threads.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use super::blocks;
use crate::forces::PRODUCT_BLOCK;
use crate::math::lanes::{self, Kernel, LANES, Lanes};
use crate::math::parts::Parts;
use crate::math::{Real, Vector};

/// A vector of each particle, by component in eights, the last ones 0.
pub(super) type Eights<T> = Vec<[[T; LANES]; 3]>;

/// Eights in a block of particles.
const BLOCK: usize = PRODUCT_BLOCK / LANES;

/// The vectors that the iteration works on.
#[derive(Clone, Debug)]
pub(super) struct ConjugateGradients<T: Real> {
    /// The diagonal blocks, filled in by the caller: xx, yy, zz and xy, xz, yz. Once they are inverted, the preconditioner, zero
    /// for a particle whose unknown is fixed at 0.
    pub blocks: [Eights<T>; 2],
    solution: Eights<T>,
    /// What remains of the right-hand side.
    residual: Eights<T>,
    direction: Eights<T>,
    image: Eights<T>,
    /// Parts of a scalar product, one a block of particles.
    products: Vec<[T; LANES]>,
}

impl<T: Real> Default for ConjugateGradients<T> {
    fn default() -> Self {
        Self {
            blocks: <_>::default(),
            solution: Vec::new(),
            residual: Vec::new(),
            direction: Vec::new(),
            image: Vec::new(),
            products: Vec::new(),
        }
    }
}

/// When a solve may end. Residuals are parts of the right-hand side, in the norm of the preconditioner.
pub(super) struct Enough<F, S> {
    /// With this residual,
    pub residual: f64,
    /// after so many iterations,
    pub iterations: u32,
    /// or with this residual already,
    pub loose: f64,
    /// where the longest vector of the solution so far is far off anyway, given its square;
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
    /// Makes room for so many particles.
    pub fn hold(&mut self, particles: usize) {
        let none = [[T::ZERO; LANES]; 3];
        let Self { blocks, solution, residual, direction, image, products } = self;
        for vector in blocks.iter_mut().chain([solution, residual, direction, image]) {
            vector.resize(particles.div_ceil(LANES), none);
        }
        products.resize(particles.div_ceil(PRODUCT_BLOCK), [T::ZERO; LANES]);
    }

    /// Makes the diagonal blocks their inverses, where the inverse masses given are not 0.
    pub fn precondition(&mut self, inverse_mass: &[T], threads: usize) {
        let [diagonal, off] = &mut self.blocks;
        lanes::share(Invert { diagonal, off, free: inverse_mass }, BLOCK, threads);
    }

    /// Solves for `x` from 0; `multiply` writes the product of the matrix with its first argument over its second, and the
    /// scalar products of both over the third, lane by lane for each block of [`PRODUCT_BLOCK`] particles.
    pub fn solve(
        &mut self,
        right: &[T::Vec3],
        x: &mut Vec<T::Vec3>,
        enough: &Enough<impl Fn(f64) -> bool, impl Fn() -> bool>,
        multiply: impl Fn(&[[[T; LANES]; 3]], &mut [[[T; LANES]; 3]], &mut [[T; LANES]]),
        threads: usize,
    ) -> Solved {
        for (eight, vectors) in self.residual.iter_mut().zip(right.chunks(LANES)) {
            for (lane, v) in vectors.iter().enumerate() {
                v.to_array().into_iter().zip(&mut *eight).for_each(|(v, to)| to[lane] = v);
            }
        }
        self.solution.fill([[T::ZERO; LANES]; 3]);
        self.direction.fill([[T::ZERO; LANES]; 3]);
        self.image.fill([[T::ZERO; LANES]; 3]);
        // No way along no direction, only to have the preconditioned residual.
        let start = self.advance(T::ZERO, threads);
        let mut size = start;
        self.turn(T::ZERO, threads);
        let (mut iterations, mut loosely) = (0, false);
        let [tight, loose] = [enough.residual, enough.loose].map(|part| part * part * start);
        // Also ends where nothing is to be done, and where numbers are no longer finite.
        while size > tight && size.is_finite() && iterations < enough.iterations && !(enough.stopped)() {
            if size <= loose && (enough.far_off)(longest_square(&self.solution)) {
                loosely = true;
                break;
            }
            multiply(&self.direction, &mut self.image, &mut self.products);
            iterations += 1;
            let curvature = sum(&self.products);
            if curvature <= 0.0 {
                break;
            }
            let before = size;
            size = self.advance(T::from_f64(size / curvature), threads);
            self.turn(T::from_f64(size / before), threads);
        }
        x.clear();
        let vectors = self.solution.iter().flat_map(|[x, y, z]| {
            (0..LANES).map(move |lane| T::Vec3::from_array([x[lane], y[lane], z[lane]]))
        });
        x.extend(vectors.take(right.len()));
        Solved { iterations, loosely, residual: if start > 0.0 { (size / start).sqrt() } else { start } }
    }

    /// Goes a stride in the direction. The image is no longer needed then: it takes the preconditioned residual. Answers with
    /// the square of the residual's norm.
    fn advance(&mut self, stride: T, threads: usize) -> f64 {
        let Self { blocks: [diagonal, off], solution: x, residual, direction, image, products, .. } = self;
        let inverse = [&diagonal[..], off];
        lanes::share(Advance { stride, x, residual, image, products, direction, inverse }, BLOCK, threads);
        sum(&self.products)
    }

    /// Turns to the preconditioned residual, of the direction before keeping a part.
    fn turn(&mut self, keep: T, threads: usize) {
        let Self { direction, image, .. } = self;
        lanes::share(Turn { keep, direction, image }, BLOCK, threads);
    }
}

/// The sum of parts of a scalar product.
fn sum<T: Real>(products: &[[T; LANES]]) -> f64 {
    products.as_flattened().iter().map(|part| part.to_f64()).sum()
}

/// The square of the longest vector.
fn longest_square<T: Real>(vectors: &Eights<T>) -> f64 {
    struct Longest<'a, T>(&'a [[[T; LANES]; 3]]);
    impl<T: Real> Kernel<T> for Longest<'_, T> {
        type Output = [T; LANES];

        #[inline(always)]
        fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) -> [T; LANES] {
            let mut longest = L::splat(with, T::ZERO);
            for eight in self.0 {
                let v = load::<T, L>(with, eight);
                longest = dot(v, v).max(longest);
            }
            longest.to_array()
        }
    }
    lanes::run(Longest(vectors)).into_iter().map(T::to_f64).fold(0.0, f64::max)
}

#[inline(always)]
fn load<T: Real, L: Lanes<Scalar = T>>(with: L::Proof, [x, y, z]: &[[T; LANES]; 3]) -> [L; 3] {
    [L::of(with, *x), L::of(with, *y), L::of(with, *z)]
}

#[inline(always)]
fn store<L: Lanes>([x, y, z]: [L; 3]) -> [[L::Scalar; LANES]; 3] {
    [x.to_array(), y.to_array(), z.to_array()]
}

#[inline(always)]
fn add<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn subtract<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn scale<L: Lanes>([x, y, z]: [L; 3], factor: L) -> [L; 3] {
    [x * factor, y * factor, z * factor]
}

#[inline(always)]
fn where_positive<L: Lanes>([x, y, z]: [L; 3], of: L) -> [L; 3] {
    [x.where_positive(of), y.where_positive(of), z.where_positive(of)]
}

#[inline(always)]
fn dot<L: Lanes>(a: [L; 3], b: [L; 3]) -> L {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// x += stride d, r -= stride A d, z = P r over A d, and r · z.
struct Advance<'a, T> {
    stride: T,
    x: &'a mut [[[T; LANES]; 3]],
    residual: &'a mut [[[T; LANES]; 3]],
    image: &'a mut [[[T; LANES]; 3]],
    products: &'a mut [[T; LANES]],
    direction: &'a [[[T; LANES]; 3]],
    /// P.
    inverse: [&'a [[[T; LANES]; 3]]; 2],
}

impl<T: Real> Parts for Advance<'_, T> {
    fn count(&self) -> usize {
        self.x.len()
    }

    fn split_at(self, at: usize) -> (Self, Self) {
        let Self { stride, x, residual, image, products, direction, inverse } = self;
        let [(x, more_x), (residual, more_residual), (image, more_image)] =
            [x, residual, image].map(|vectors| vectors.split_at_mut(at));
        let (products, more_products) = products.split_at_mut(at / BLOCK);
        let (direction, more_direction) = direction.split_at(at);
        let [(diagonal, more_diagonal), (off, more_off)] = inverse.map(|blocks| blocks.split_at(at));
        (
            Self { stride, x, residual, image, products, direction, inverse: [diagonal, off] },
            Self {
                stride,
                x: more_x,
                residual: more_residual,
                image: more_image,
                products: more_products,
                direction: more_direction,
                inverse: [more_diagonal, more_off],
            },
        )
    }
}

impl<T: Real> Kernel<T> for Advance<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let stride = L::splat(with, self.stride);
        let blocks = self.x.chunks_mut(BLOCK).zip(self.residual.chunks_mut(BLOCK));
        let blocks = blocks.zip(self.image.chunks_mut(BLOCK).zip(self.products));
        let inverse = self.inverse[0].chunks(BLOCK).zip(self.inverse[1].chunks(BLOCK));
        let blocks = blocks.zip(self.direction.chunks(BLOCK).zip(inverse));
        for (((x, residual), (image, product)), (direction, (diagonal, off))) in blocks {
            let mut square = L::splat(with, T::ZERO);
            let particles = x.iter_mut().zip(residual).zip(image);
            for (((x, residual), image), (d, (diagonal, off))) in
                particles.zip(direction.iter().zip(diagonal.iter().zip(off)))
            {
                let (d, i) = (load::<T, L>(with, d), load::<T, L>(with, image));
                let (old, r) = (load::<T, L>(with, x), load::<T, L>(with, residual));
                *x = store(add(old, scale(d, stride)));
                let r = subtract(r, scale(i, stride));
                *residual = store(r);
                let z = blocks::times(load(with, diagonal), load(with, off), r);
                *image = store(z);
                square = square + dot(z, r);
            }
            *product = square.to_array();
        }
    }
}

/// d = z + keep d.
struct Turn<'a, T> {
    keep: T,
    direction: &'a mut [[[T; LANES]; 3]],
    image: &'a [[[T; LANES]; 3]],
}

impl<T: Real> Parts for Turn<'_, T> {
    fn count(&self) -> usize {
        self.image.len()
    }

    fn split_at(self, at: usize) -> (Self, Self) {
        let Self { keep, direction, image } = self;
        let (direction, more) = direction.split_at_mut(at);
        let (image, rest) = image.split_at(at);
        (Self { keep, direction, image }, Self { keep, direction: more, image: rest })
    }
}

impl<T: Real> Kernel<T> for Turn<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let keep = L::splat(with, self.keep);
        for (direction, z) in self.direction.iter_mut().zip(self.image) {
            let (d, z) = (load::<T, L>(with, direction), load::<T, L>(with, z));
            *direction = store(add(z, scale(d, keep)));
        }
    }
}

/// Inverts blocks where they stand.
struct Invert<'a, T> {
    diagonal: &'a mut [[[T; LANES]; 3]],
    off: &'a mut [[[T; LANES]; 3]],
    /// Above 0 where there is an unknown.
    free: &'a [T],
}

impl<T: Real> Parts for Invert<'_, T> {
    fn count(&self) -> usize {
        self.diagonal.len()
    }

    fn split_at(self, at: usize) -> (Self, Self) {
        let Self { diagonal, off, free } = self;
        let (diagonal, more_diagonal) = diagonal.split_at_mut(at);
        let (off, more_off) = off.split_at_mut(at);
        let (free, more) = free.split_at(at * LANES);
        (Self { diagonal, off, free }, Self { diagonal: more_diagonal, off: more_off, free: more })
    }
}

impl<T: Real> Kernel<T> for Invert<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let blocks = self.diagonal.iter_mut().zip(self.off);
        for ((diagonal, off), free) in blocks.zip(self.free.chunks(LANES)) {
            let mut some = [T::ZERO; LANES];
            some[..free.len()].copy_from_slice(free);
            let some = L::of(with, some);
            let (inverse, inverse_off) = blocks::inverse::<T, L>(with, load(with, diagonal), load(with, off));
            *diagonal = store(where_positive(inverse, some));
            *off = store(where_positive(inverse_off, some));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forces::springs::SpringParams;
    use crate::forces::{Linear, Problem, SpringSet};
    use crate::model::Topology;
    use glam::DVec3;

    /// A sheet with its first row pinned.
    fn sheet() -> (Problem<f64>, Vec<DVec3>) {
        let mesh = crate::target::grid(101, 41, 1.0, false);
        let topology = Topology::of(&mesh);
        let params = SpringParams::default();
        let set =
            SpringSet { topology: &topology, rest_positions: &mesh.positions, params: &params, broken: &[] };
        let mut problem = Problem::new(vec![1.0; mesh.positions.len()], &set);
        (0..101).for_each(|i| problem.set_fixed(i, true));
        (problem, mesh.positions)
    }

    #[test]
    fn the_solution_solves_the_system_on_any_number_of_threads() {
        const TOLERANCE: f64 = 1e-10;
        let (mut problem, positions) = sheet();
        let free = |i: usize| f64::from(problem.inverse_mass[i] > 0.0);
        let push = |i: usize| DVec3::new((i as f64).sin(), 1.0, (i as f64 * 0.1).cos()) * free(i);
        let right: Vec<DVec3> = (0..positions.len()).map(push).collect();
        let mut solutions = Vec::new();
        for threads in [1, 2, 3] {
            problem.threads = threads;
            let (mut gradients, mut linear) = (ConjugateGradients::default(), Linear::default());
            problem.linearise(&positions, 0.1, &mut linear);
            gradients.hold(positions.len());
            let [diagonal, off] = &mut gradients.blocks;
            problem.own_blocks(&linear, &problem.mass, [diagonal, off]);
            gradients.precondition(&problem.inverse_mass, threads);
            let enough = Enough {
                residual: TOLERANCE,
                iterations: 1000,
                loose: 0.0,
                far_off: |_| false,
                stopped: || false,
            };
            let mut x = Vec::new();
            let multiply = |from: &[_], to: &mut [_], products: &mut [_]| {
                problem.multiply(&linear, &problem.mass, from, to, products);
            };
            let solved = gradients.solve(&right, &mut x, &enough, multiply, threads);
            assert!(solved.residual <= TOLERANCE && !solved.loosely && solved.iterations > 5);
            let mut image = gradients.image.clone();
            problem.multiply(
                &linear,
                &problem.mass,
                &gradients.solution,
                &mut image,
                &mut gradients.products,
            );
            // What rounding adds is far less: the condition is some ten thousand. The norms of the preconditioner and of
            // Euclid differ at most by the blocks' condition, below a hundred.
            let (mut left, mut whole) = (0.0, 0.0);
            for (i, b) in right.iter().enumerate() {
                let product = DVec3::from_array(image[i / LANES].map(|c| c[i % LANES]));
                if problem.inverse_mass[i] > 0.0 {
                    left += (product - *b).length_squared();
                    whole += b.length_squared();
                } else {
                    assert_eq!(x[i], DVec3::ZERO, "pinned");
                }
            }
            assert!(left.sqrt() <= 100.0 * TOLERANCE * whole.sqrt(), "{left:e} of {whole:e}");
            solutions.push(x);
        }
        assert!(solutions[0] == solutions[1] && solutions[0] == solutions[2]);
    }
}
