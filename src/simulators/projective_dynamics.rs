//! Projective dynamics of springs, or fast mass-spring (Liu, Bargteil, O'Brien, Kavan, "Fast simulation of mass-spring
//! systems", 2013): implicit Euler with one constant matrix, factorised once.
//!
//! Local step: each spring finds the vector of its rest length that is nearest to it, p = L d/|d|. Global step: with all p
//! fixed the energy of the step is quadratic, its matrix A = M̂ + (h² k + h k_d) over the springs' graph the same for x, y, z
//! and for every shape. Both together are x += A⁻¹ (M̂ (x̂ - x) + h² F(x)): Newton's method with A for the stiffness (Liu,
//! Bouaziz, Kavan, "Quasi-Newton methods for real-time simulation of hyperelastic materials", 2017). It is written so here,
//! because then what rounding does to A changes only how fast it converges, not whereto. A is never less than the true
//! stiffness, so that the energy falls in every iteration, whatever dt and stiffness are.
//!
//! A is factorised (sparse Cholesky, one thread, double precision) when springs, stiffness, masses, pins, hands or dt have
//! changed; that costs as much as some twenty to hundred iterations. A factorisation patched where springs tear would round
//! differently from a fresh one and so be a hidden state; tearing pays for a new one in each step in which springs tear.
//! An iteration costs one force evaluation and one solve.
//! Order 1, that of implicit Euler; iterations left out are an error besides: large and slow rotations converge last. Choose it
//! for a visually good picture in a fixed, small number of iterations of very stiff cloth at a long dt.

use super::chebyshev::Chebyshev;
use super::inertia::Inertia;
use super::{Model, Simulator};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::{Real, Vector};
use crate::model::Particles;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{LltRef, SymbolicCholesky, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, MatMut, Par, Side};

crate::params! {
    /// Projective dynamics.
    pub struct ProjectiveDynamics {
        /// Local and global steps in each time step: towards implicit Euler, not beyond.
        iterations: u32 = 10, range 1.0..=100_000.0, slider log 1.0..=200.0, effort [1.0, 10.0, 100.0];
        /// Chebyshev acceleration: the part of its error that an iteration is taken to leave. 0 is none; too much makes the
        /// iterations burst.
        acceleration: f64 = 0.0, range 0.0..=0.9999, slider linear 0.0..=0.99;
    }
}

/// Scratch of [`ProjectiveDynamics`].
#[derive(Default)]
pub struct Buffers<T: Real> {
    inertia: Inertia<T>,
    /// Positions at the start of the step, m.
    start: Vec<T::Vec3>,
    residual: Vec<T::Vec3>,
    factorised: Option<Factorised<T>>,
    chebyshev: Chebyshev<T>,
    /// Right-hand side and solution: all x, then all y, then all z.
    columns: Vec<f64>,
}

/// The matrix of a step, factorised, with all that it depends on.
struct Factorised<T> {
    revision: u64,
    h: T,
    mass: Vec<T>,
    inverse: Vec<T>,
    factors: Factors,
}

/// Cholesky factors, with the room that a solve needs.
struct Factors {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    room: MemBuffer,
}

impl Factors {
    /// Factorises a symmetric matrix of which the lower half is given; none where it is not positive definite.
    fn of(matrix: &SparseColMat<usize, f64>) -> Option<Self> {
        let symbolic =
            factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, <_>::default(), <_>::default()).ok()?;
        let mut values = vec![0.0; symbolic.len_val()];
        let mut room =
            MemBuffer::try_new(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, <_>::default())).ok()?;
        let done = symbolic.factorize_numeric_llt::<f64>(
            &mut values,
            matrix.as_ref(),
            Side::Lower,
            <_>::default(),
            Par::Seq,
            MemStack::new(&mut room),
            <_>::default(),
        );
        done.ok()?;
        let room = MemBuffer::try_new(symbolic.solve_in_place_scratch::<f64>(3, Par::Seq)).ok()?;
        Some(Self { symbolic, values, room })
    }

    /// Solves for three right-hand sides, one behind the other, in their place.
    fn solve(&mut self, columns: &mut [f64]) {
        let right = MatMut::from_column_major_slice_mut(columns, self.symbolic.nrows(), 3);
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            right,
            Par::Seq,
            MemStack::new(&mut self.room),
        );
    }
}

impl<T: Real> Buffers<T> {
    /// Factorises the matrix of this step, unless it is that of the last one.
    fn prepare(&mut self, problem: &Problem<T>, h: T) {
        let inertia = &self.inertia;
        let good = self.factorised.as_ref().is_some_and(|f| {
            f.revision == problem.revision() && f.h == h && f.mass == inertia.mass && f.inverse == inertia.inverse
        });
        if good {
            return;
        }
        // Where the mass is lost beside the stiffness a pivot can vanish: a little more on the diagonal makes up for it.
        let shifts = [0.0, 1e-14, 1e-12, 1e-10, 1e-8];
        self.factorised = shifts.into_iter().find_map(|shift| factorise(problem, inertia, h, shift)).map(|factors| {
            let (mass, inverse) = (inertia.mass.clone(), inertia.inverse.clone());
            Factorised { revision: problem.revision(), h, mass, inverse, factors }
        });
    }
}

/// The Cholesky factors of M̂ + (h² k + h k_d) over the springs, rows of the identity where a particle is pinned or held; every
/// diagonal element is larger by a part `shift` of itself. None where rounding has made it indefinite.
fn factorise<T: Real>(problem: &Problem<T>, inertia: &Inertia<T>, h: T, shift: f64) -> Option<Factors> {
    let n = problem.particles();
    let free = |i: usize| inertia.inverse[i] > T::ZERO;
    let mut diagonal: Vec<f64> =
        (0..n).map(|i| if free(i) { inertia.mass[i].to_f64() } else { 1.0 }).collect();
    let mut entries = Vec::with_capacity(n + problem.springs.len());
    let (h, damping) = (h.to_f64(), problem.spring_damping.to_f64());
    for group in &problem.springs.groups {
        let weight = h * h * group.stiffness.to_f64() + h * damping;
        for pair in &problem.springs.pairs[group.range.clone()] {
            let [i, j] = pair.map(|p| p as usize);
            for end in [i, j] {
                if free(end) {
                    diagonal[end] += weight;
                }
            }
            if free(i) && free(j) {
                entries.push(Triplet::new(i.max(j), i.min(j), -weight));
            }
        }
    }
    let diagonal = diagonal.into_iter().enumerate();
    entries.extend(diagonal.map(|(i, d)| Triplet::new(i, i, d * (1.0 + shift))));
    let matrix = SparseColMat::try_new_from_triplets(n, n, &entries).ok()?;
    Factors::of(&matrix)
}

impl Simulator for ProjectiveDynamics {
    const ID: &'static str = "projective_dynamics";
    const SUMMARY: &'static str =
        "Projective dynamics: implicit Euler with a constant matrix; stiff cloth at a long dt in few iterations.";
    const ORDER: u32 = 1;
    const MODEL: Model = Model::Springs;
    type Scratch<T: Real> = Buffers<T>;

    fn step<T: Real>(
        &self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        dt: T,
        scratch: &mut Buffers<T>,
        cost: &mut Cost,
    ) {
        let beginning = state.time;
        state.time += dt.to_f64();
        scratch.inertia.begin(problem, state, dt);
        state.time = beginning;
        scratch.prepare(problem, dt);
        let Buffers { inertia, start, residual, factorised, chebyshev, columns } = scratch;
        start.clone_from(&state.positions);
        let n = state.len();
        columns.resize(3 * n, 0.0);
        let place = |state: &mut Particles<T>| {
            for ((x, &start), &v) in state.positions.iter_mut().zip(&*start).zip(&state.velocities) {
                *x = start + v * dt;
            }
        };
        state.velocities.clone_from(&inertia.velocity);
        place(state);
        chebyshev.begin(self.acceleration, &state.velocities);
        for _ in 0..self.iterations {
            if problem.is_stopped() {
                return;
            }
            inertia.residual(problem, state, dt, residual, cost);
            for (i, r) in residual.iter().enumerate() {
                let r = r.to_f64().to_array();
                (0..3).for_each(|c| columns[c * n + i] = r[c]);
            }
            match factorised {
                Some(matrix) => matrix.factors.solve(columns),
                None => columns.fill(0.0),
            }
            for (i, v) in state.velocities.iter_mut().enumerate() {
                let [x, y, z] = [0, 1, 2].map(|c| T::from_f64(columns[c * n + i]));
                *v += T::Vec3::from_array([x, y, z]);
            }
            chebyshev.accelerate(self.acceleration, &mut state.velocities);
            place(state);
        }
        cost.solver_iterations += u64::from(self.iterations);
        if factorised.is_none() {
            cost.solved(f64::INFINITY, 0);
        }
        let shift = inertia.keep_momentum(&mut state.velocities);
        state.positions.iter_mut().for_each(|x| *x += shift * dt);
    }

    /// Backward Euler sets no limit.
    fn dt_limit(&self, _: &Spectrum) -> Option<f64> {
        None
    }
}
