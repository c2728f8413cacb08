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
use crate::math::lanes::{self, Kernel, LANES, Lanes};
use crate::math::parts::Parts;
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
                let ([px, py, pz], _) = pull::<L, DAMPED>([x, there], [way, other], stiffness, rest, damping);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forces::SpringSet;
    use crate::forces::springs::SpringParams;
    use crate::math::lanes::Plain;
    use crate::model::{Particles, Topology};
    use glam::{DMat3, DVec3};

    /// A crumpled sheet, its first row pinned, some of its springs without length.
    fn sheet<T: Real>(damping: f64) -> (Problem<T>, Particles<T>) {
        let mesh = crate::target::grid(101, 41, 1.0, false);
        let topology = Topology::of(&mesh);
        let rest: Vec<T::Vec3> = mesh.positions.iter().map(|p| T::Vec3::from_f64(*p)).collect();
        let params = SpringParams { damping, ..SpringParams::default() };
        let set = SpringSet { topology: &topology, rest_positions: &rest, params: &params, broken: &[] };
        let mut problem = Problem::new((0..rest.len()).map(|i| T::from_f64(1.0 + (i % 3) as f64)).collect(), &set);
        problem.gravity = Some(DVec3::new(0.0, -10.0, 0.0));
        (0..101).for_each(|i| problem.set_fixed(i, true));
        let crumpled = |i: usize| {
            let t = if i % 9 == 8 { i - 1 } else { i } as f64;
            let place = mesh.positions[if i % 9 == 8 { i - 1 } else { i }];
            T::Vec3::from_f64(place + DVec3::new((t * 0.7).sin(), (t * 1.3).cos(), (t * 2.1).sin()) * 0.4)
        };
        let mut state = Particles::at_rest((0..rest.len()).map(crumpled).collect());
        state.velocities = (0..rest.len()).map(|i| crumpled(i - i % 4) * T::from_f64(0.1)).collect();
        (problem, state)
    }

    /// Where a particle goes, by the formula in doubles, and how far off rounding in the precision of the simulation may be:
    /// some thirty operations, each of what it adds up, times the condition of the block, whose eigenvalues are at least the mass.
    fn descend<T: Real>(problem: &Problem<T>, positions: &[T::Vec3], step: Step<T>, i: usize) -> (DVec3, f64) {
        let (x, h) = (positions[i].to_f64(), step.h.to_f64());
        let (mass, damping) = (step.inertia.mass[i].to_f64(), h * problem.spring_damping.to_f64());
        if step.inertia.inverse[i] <= T::ZERO {
            return (x, 0.0);
        }
        let free = step.free[i].to_f64();
        let mut right = (free - x) * mass;
        let mut left = DMat3::from_diagonal(DVec3::splat(mass));
        let moved = |i: usize| positions[i].to_f64().distance(step.start[i].to_f64());
        let mut terms = mass * free.distance(x);
        for &[other, spring] in problem.incidence().around(i) {
            let (other, spring) = (other as usize, spring as usize);
            let group = problem.springs.groups.iter().find(|group| group.range.contains(&spring)).unwrap();
            let (k, rest) = (h * h * group.stiffness.to_f64(), problem.springs.rest[spring].to_f64());
            let d = positions[other].to_f64() - x;
            let way = d - (step.start[other].to_f64() - step.start[i].to_f64());
            right += way * damping;
            left += DMat3::IDENTITY * damping;
            let length = d.length();
            if length > 0.0 {
                let n = d / length;
                let along = DMat3::from_cols(n * n.x, n * n.y, n * n.z);
                right += n * (k * (length - rest));
                left += (along + (DMat3::IDENTITY - along) * (1.0 - rest / length).max(0.0)) * k;
            }
            terms += k * (length + rest) + damping * (moved(i) + moved(other));
        }
        let condition = (left.x_axis.x + left.y_axis.y + left.z_axis.z) / mass;
        (x + left.inverse() * right, 32.0 * T::EPSILON.to_f64() * (condition * terms / mass + x.length()))
    }

    fn agree<T: Real>(damping: f64) {
        let (mut problem, state) = sheet::<T>(damping);
        let h = T::from_f64(0.02);
        let mut inertia = Inertia::default();
        inertia.begin(&problem, &state, h);
        let start = state.positions.clone();
        let free: Vec<T::Vec3> = start.iter().zip(&inertia.velocity).map(|(&x, &v)| x + v * h).collect();
        let step = Step { inertia: &inertia, start: &start, free: &free, h };
        let sweeps = [1, 2, 3].map(|threads| {
            problem.threads = threads;
            let (mut descent, mut positions) = (Descent::default(), free.clone());
            descent.prepare(&problem);
            descent.sweep(&problem, &mut positions, step);
            positions
        });
        assert!(sweeps[0] == sweeps[1] && sweeps[0] == sweeps[2]);
        let mut positions = free.clone();
        for colour in Colours::of_particles(problem.particles(), problem.incidence()).groups() {
            for &i in colour {
                let i = i as usize;
                let (expected, most) = descend(&problem, &positions, step, i);
                let off = sweeps[0][i].to_f64().distance(expected);
                assert!(off <= most, "{i}: {off:e}, {most:e}");
                // From what the sweep found, or errors would add up.
                positions[i] = sweeps[0][i];
            }
        }
        let mut descent = Descent::default();
        descent.prepare(&problem);
        let mut moved = vec![[[T::ZERO; LANES]; 3]; descent.ends[0]];
        let kernel = Descend::<T, true> {
            step,
            positions: &free,
            square: h * h,
            damping: h * problem.spring_damping,
            springs: &descent.springs,
            eights: &descent.eights[..descent.ends[0]],
            moved: &mut moved,
        };
        kernel.run::<Plain<T>>(());
        for (eight, [x, y, z]) in descent.eights.iter().zip(&moved) {
            for (lane, &i) in eight.own[..eight.count].iter().enumerate() {
                assert_eq!(sweeps[0][i as usize], T::Vec3::from_array([x[lane], y[lane], z[lane]]));
            }
        }
    }

    #[test]
    fn a_sweep_takes_newtons_step_of_each_particle_on_any_machine_and_number_of_threads() {
        for damping in [0.0, 2.0] {
            agree::<f32>(damping);
            agree::<f64>(damping);
        }
    }
}
