//! A sweep of vertex block descent: eight particles of a colour at once, each by one Newton step in its three coordinates.
//!
//! They share no spring, so what one does none of the others sees, whatever the threads. Springs stand as each particle sees
//! them, first ones side by side, then second ones; a lane without one leads to the particle itself.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions of the function that calls it"
)]

use crate::forces::Problem;
use crate::forces::springs::{pull, resistance};
use crate::math::lanes::{self, Kernel, LANES, Lanes, Parts};
use crate::math::{Real, Vector};
use crate::simulators::blocks;
use crate::simulators::colouring::Colours;
use crate::simulators::inertia::Inertia;

/// Particles in eights by colour, with their springs.
#[derive(Debug, Default)]
pub struct Descent<T: Real> {
    eights: Vec<Eight>,
    /// End of each colour in `eights`.
    ends: Vec<usize>,
    springs: Vec<Springs<T>>,
    /// New positions of a colour, m.
    moved: Vec<[[T; LANES]; 3]>,
    /// The problem's revision that all that was taken from.
    revision: u64,
}

/// Eight particles of a colour; where there are no more, the last one stands for them.
#[derive(Clone, Copy, Debug)]
struct Eight {
    own: [u32; LANES],
    /// How many there are.
    count: usize,
    /// First and behind the last of `springs`.
    springs: [u32; 2],
}

/// One spring of each of eight particles.
#[derive(Clone, Copy, Debug)]
struct Springs<T> {
    to: [u32; LANES],
    /// m.
    rest: [T; LANES],
    /// N/m.
    stiffness: [T; LANES],
    /// A bit for each lane that has a spring.
    lanes: u32,
}

/// What a step starts from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step<'a, T: Real> {
    pub inertia: &'a Inertia<T>,
    /// Positions at its start, m.
    pub start: &'a [T::Vec3],
    /// Where particles would go without springs, m.
    pub free: &'a [T::Vec3],
    /// s.
    pub h: T,
}

impl<T: Real> Descent<T> {
    /// Takes particles and springs from a problem, unless it has done so.
    pub fn prepare(&mut self, problem: &Problem<T>) {
        if self.revision == problem.revision() {
            return;
        }
        self.revision = problem.revision();
        self.eights.clear();
        self.ends.clear();
        self.springs.clear();
        let incidence = problem.incidence();
        let stiffness = problem.springs.stiffness_of_each();
        for colour in Colours::of_particles(problem.particles(), incidence).groups() {
            for particles in colour.chunks(LANES) {
                let own = |lane: usize| particles[lane.min(particles.len() - 1)];
                let around =
                    |lane: usize| particles.get(lane).map_or(&[][..], |i| incidence.around(*i as usize));
                let begin = self.springs.len() as u32;
                let most = (0..LANES).map(|lane| around(lane).len()).max().unwrap_or(0);
                for number in 0..most {
                    let mut springs = Springs {
                        to: std::array::from_fn(own),
                        rest: [T::ONE; LANES],
                        stiffness: [T::ZERO; LANES],
                        lanes: 0,
                    };
                    for lane in 0..LANES {
                        if let Some(&[other, spring]) = around(lane).get(number) {
                            springs.to[lane] = other;
                            springs.rest[lane] = problem.springs.rest[spring as usize];
                            springs.stiffness[lane] = stiffness[spring as usize];
                            springs.lanes |= 1 << lane;
                        }
                    }
                    self.springs.push(springs);
                }
                let springs = [begin, self.springs.len() as u32];
                self.eights.push(Eight { own: std::array::from_fn(own), count: particles.len(), springs });
            }
            self.ends.push(self.eights.len());
        }
    }

    /// Moves each particle once, colour by colour.
    pub fn sweep(&mut self, problem: &Problem<T>, positions: &mut [T::Vec3], step: Step<T>) {
        if problem.spring_damping > T::ZERO {
            self.go::<true>(problem, positions, step);
        } else {
            self.go::<false>(problem, positions, step);
        }
    }

    fn go<const DAMPED: bool>(&mut self, problem: &Problem<T>, positions: &mut [T::Vec3], step: Step<T>) {
        let (h, mut begin) = (step.h, 0);
        for &end in &self.ends {
            let eights = &self.eights[begin..end];
            begin = end;
            self.moved.resize(eights.len(), [[T::ZERO; LANES]; 3]);
            let kernel = Descend::<T, DAMPED> {
                step,
                positions,
                square: h * h,
                damping: h * problem.spring_damping,
                springs: &self.springs,
                eights,
                moved: &mut self.moved,
            };
            lanes::share(kernel, 1, problem.useful_threads());
            for (eight, [x, y, z]) in eights.iter().zip(&self.moved) {
                for (lane, &i) in eight.own[..eight.count].iter().enumerate() {
                    positions[i as usize] = T::Vec3::from_array([x[lane], y[lane], z[lane]]);
                }
            }
        }
    }
}

struct Descend<'a, T: Real, const DAMPED: bool> {
    step: Step<'a, T>,
    positions: &'a [T::Vec3],
    /// h², s².
    square: T,
    /// h k_d, kg.
    damping: T,
    springs: &'a [Springs<T>],
    eights: &'a [Eight],
    moved: &'a mut [[[T; LANES]; 3]],
}

impl<T: Real, const DAMPED: bool> Parts for Descend<'_, T, DAMPED> {
    fn count(&self) -> usize {
        self.eights.len()
    }

    fn split_at(self, at: usize) -> (Self, Self) {
        let Self { step, positions, square, damping, springs, eights, moved } = self;
        let (eights, more) = eights.split_at(at);
        let (moved, rest) = moved.split_at_mut(at);
        (
            Self { step, positions, square, damping, springs, eights, moved },
            Self { step, positions, square, damping, springs, eights: more, moved: rest },
        )
    }
}

impl<T: Real, const DAMPED: bool> Kernel<T> for Descend<'_, T, DAMPED> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Scalar = T>>(self, with: L::Proof) {
        let Self { step, positions, square, damping, springs, eights, moved } = self;
        let Step { inertia, start, free, .. } = step;
        let (square, damping) = (L::splat(with, square), L::splat(with, damping));
        let zero = L::splat(with, T::ZERO);
        for (Eight { own, springs: [begin, end], .. }, moved) in eights.iter().zip(moved) {
            let x = L::components(with, positions, own);
            let free = L::components(with, free, own);
            let way = if DAMPED { subtract(x, L::components(with, start, own)) } else { x };
            let mass = L::of(with, own.map(|i| inertia.mass[i as usize]));
            let can_move = L::of(with, own.map(|i| inertia.inverse[i as usize]));
            let mut right = [(free[0] - x[0]) * mass, (free[1] - x[1]) * mass, (free[2] - x[2]) * mass];
            let (mut diagonal, mut off) = ([mass; 3], [zero; 3]);
            for Springs { to, rest, stiffness, lanes } in &springs[*begin as usize..*end as usize] {
                let there = L::components(with, positions, to);
                let other = if DAMPED { subtract(there, L::components(with, start, to)) } else { there };
                let (rest, stiffness) = (L::of(with, *rest), L::of(with, *stiffness) * square);
                let [px, py, pz] = pull::<L, DAMPED>([x, there], [way, other], stiffness, rest, damping);
                let [a, ux, uy, uz] = resistance(with, [x, there], stiffness, rest);
                let a = if DAMPED { a + damping } else { a }.only(*lanes);
                right = [right[0] + px, right[1] + py, right[2] + pz];
                diagonal = [
                    diagonal[0] + (a + ux * ux),
                    diagonal[1] + (a + uy * uy),
                    diagonal[2] + (a + uz * uz),
                ];
                off = [off[0] + ux * uy, off[1] + ux * uz, off[2] + uy * uz];
            }
            let (inverse, inverse_off) = blocks::inverse::<T, L>(with, diagonal, off);
            let [dx, dy, dz] = blocks::times(inverse, inverse_off, right);
            *moved = [
                (x[0] + dx.where_positive(can_move)).to_array(),
                (x[1] + dy.where_positive(can_move)).to_array(),
                (x[2] + dz.where_positive(can_move)).to_array(),
            ];
        }
    }
}

#[inline(always)]
fn subtract<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
