//! What a method solves: masses, springs and forces, all constant during a step.

use super::gravity;
use super::pull::{self, Pull};
use super::sliced::{Ahead, Linear, Loads, Means, Slices, Step, Stretched, Update, Window};
use super::springs::SpringParams;
use super::wind::Wind;
use crate::math::lanes::LANES;
use crate::math::parts::each_particle;
use crate::math::{Real, Vector};
use crate::model::{Incidence, Numbering, Particles, Springs, Topology};
use glam::DVec3;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// Revisions are numbered through the whole program; 0 is nobody's.
fn next_revision() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// Work in counts: the same on every machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Cost {
    /// How often the forces on all particles were computed.
    pub force_evaluations: u64,
    /// How often a spring was looked at, by a force or by a sweep of relaxation.
    pub spring_visits: u64,
    /// How often a solver of equations went over all particles: conjugate gradients, global and local sweeps.
    pub solver_iterations: u64,
    /// Steps whose equations were not solved to the method's tolerance.
    pub unsolved_steps: u64,
    /// Largest error that a solver left in a step, in units of the method's tolerance.
    pub residual: f64,
    /// Where, in the order of the state, the last of those steps was furthest from being solved.
    #[serde(skip)]
    pub unsolved_particle: u32,
}

impl Cost {
    /// Books what a solver left of its equations at the end of a step, in units of its tolerance, and at which particle it
    /// left most.
    pub fn solved(&mut self, residual: f64, particle: usize) {
        if residual.is_nan() || residual > 1.0 {
            self.unsolved_steps += 1;
            self.unsolved_particle = particle as u32;
        }
        self.residual = self.residual.max(residual);
    }
}

/// m a = F(t, x, v): everything that a method needs to know of the cloth and its surroundings.
///
/// A particle whose inverse mass is 0 is pinned or held by a hand: it feels no force and keeps its velocity (zero where
/// it is pinned) through a step.
#[derive(Debug)]
pub struct Problem<T: Real> {
    /// Mass of each particle, kg.
    pub mass: Vec<T>,
    /// 1/m, 1/kg; 0 where a particle is pinned or held.
    pub inverse_mass: Vec<T>,
    /// The springs that act.
    pub springs: Springs<T>,
    /// Damping k_d of every spring, kg/s.
    pub spring_damping: T,
    /// Air damping c of every particle, kg/s.
    pub air_damping: T,
    /// Gravity's acceleration, m/s²; none where it is switched off.
    pub gravity: Option<DVec3>,
    /// The wind; none where it is switched off.
    pub wind: Option<Wind>,
    /// Elongation, in rest lengths, at which springs tear after a step; none where they do not. A method tells how near they are
    /// ([`Seen`](crate::model::Seen)) where that costs it nothing.
    pub tearing: Option<T>,
    /// Threads of the current pool that forces may be shared among.
    pub threads: usize,
    /// Set by whoever does not want to wait for the step under way; see [`Problem::is_stopped`].
    pub stop: Option<Arc<AtomicBool>>,
    /// By particle.
    pulls: Vec<Pull<T>>,
    /// Made when first needed, as everything that is derived from the springs.
    incidence: OnceLock<Incidence>,
    slices: OnceLock<Slices<T>>,
    windows: Mutex<Vec<Window<T>>>,
    /// See [`Problem::revision`].
    revision: u64,
}

/// The springs' part of a scene, as [`Problem::new`] and [`Problem::set_springs`] need it.
pub struct SpringSet<'a, T: Real> {
    /// All springs.
    pub topology: &'a Topology,
    /// The shape that rest lengths are measured on, m.
    pub rest_positions: &'a [T::Vec3],
    /// Stiffness and switches.
    pub params: &'a SpringParams,
    /// Torn springs, sorted.
    pub broken: &'a [u32],
}

impl<T: Real> Problem<T> {
    /// Free particles of the given masses (kg) with springs, and nothing else acting on them.
    pub fn new(mass: Vec<T>, springs: &SpringSet<T>) -> Self {
        let inverse_mass = mass.iter().map(|&m| T::ONE / m).collect();
        let mut problem = Self {
            mass,
            inverse_mass,
            springs: Springs::default(),
            spring_damping: T::ZERO,
            air_damping: T::ZERO,
            gravity: None,
            wind: None,
            tearing: None,
            pulls: Vec::new(),
            threads: 1,
            stop: None,
            incidence: OnceLock::new(),
            slices: OnceLock::new(),
            windows: Mutex::default(),
            revision: 0,
        };
        problem.set_springs(springs);
        problem
    }

    /// Replaces the springs.
    pub fn set_springs(&mut self, set: &SpringSet<T>) {
        self.springs = Springs::new(set.topology, set.rest_positions, &set.params.kinds(), set.broken);
        self.spring_damping = T::from_f64(set.params.damping);
        self.springs_changed();
    }

    /// Leads the springs, which were made for particles numbered as in their source, to particles in another numbering.
    pub fn renumber_springs(&mut self, numbering: &Numbering) {
        self.springs.renumber(numbering);
        self.springs_changed();
    }

    /// Takes springs out; `torn` are sorted indices among those that act.
    pub fn remove_springs(&mut self, torn: &[usize]) {
        self.springs.remove(torn);
        self.springs_changed();
    }

    /// Replaces the stiffness of every kind; the springs stay.
    pub fn set_stiffness(&mut self, params: &SpringParams) {
        let kinds = params.kinds();
        for group in &mut self.springs.groups {
            group.stiffness = T::from_f64(kinds[group.kind as usize].stiffness);
        }
        self.spring_damping = T::from_f64(params.damping);
        self.revision = next_revision();
    }

    fn springs_changed(&mut self) {
        self.incidence = OnceLock::new();
        self.slices = OnceLock::new();
        self.revision = next_revision();
    }

    /// A number that no other problem has, and that changes with the springs, their stiffness and their damping: what a
    /// method has worked out about them is good while it stays the same.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Makes a particle immovable (pinned or held), or free.
    pub fn set_fixed(&mut self, particle: usize, fixed: bool) {
        self.inverse_mass[particle] = if fixed { T::ZERO } else { T::ONE / self.mass[particle] };
    }

    /// The hands that pull at particles, by particle.
    pub fn pulls(&self) -> &[Pull<T>] {
        &self.pulls
    }

    /// Replaces the hands that pull: at which particle, where to (m), and how stiff (N/m).
    pub fn set_pulls(&mut self, hands: impl Iterator<Item = (u32, T::Vec3, f64)>) {
        let Self { pulls, mass, .. } = self;
        pulls.clear();
        pulls.extend(hands.map(|(p, to, stiffness)| Pull::new(p, to, stiffness, mass[p as usize])));
        pulls.sort_unstable_by_key(|pull| pull.particle);
    }

    /// Whether a hand pulls, or moves a particle that it holds: what it does next is not known before the step after.
    pub fn is_handled(&self, state: &Particles<T>) -> bool {
        // In each step, so first where no velocities need be read.
        const BLOCK: usize = 64;
        let blocks = self.inverse_mass.chunks(BLOCK).zip(state.velocities.chunks(BLOCK));
        let mut fixed = blocks.filter(|(weights, _)| weights.iter().filter(|w| **w <= T::ZERO).count() > 0);
        let moves = |(v, w): (&T::Vec3, &T)| *w <= T::ZERO && *v != T::Vec3::ZERO;
        !self.pulls.is_empty() || fixed.any(|(weights, velocities)| velocities.iter().zip(weights).any(moves))
    }

    /// Number of particles.
    pub fn particles(&self) -> usize {
        self.mass.len()
    }

    /// The springs around each particle.
    pub fn incidence(&self) -> &Incidence {
        self.incidence.get_or_init(|| Incidence::new(self.particles(), &self.springs.pairs))
    }

    /// The forces from outside the cloth in the state given, at its time: gravity, wind, hands. Overwrites `force` (N).
    pub fn external_forces(&self, state: &Particles<T>, force: &mut [T::Vec3]) {
        let Loads { mass, gravity, wind, .. } = self.loads(state);
        let particles = (&mut *force, mass);
        each_particle(particles, self.useful_threads(), |(force, mass): (&mut [T::Vec3], &[T])| {
            for (f, &m) in force.iter_mut().zip(mass) {
                *f = T::Vec3::ZERO + gravity::force(gravity, m) + wind;
            }
        });
        pull::add(&self.pulls, &state.positions, &state.velocities, force);
    }

    /// The accelerations of all particles by all forces in the state given, at its time; 0 where one is pinned or held.
    /// Overwrites `to` (m/s²); counts one evaluation.
    pub fn accelerations(&self, state: &Particles<T>, to: &mut Vec<T::Vec3>, cost: &mut Cost) {
        self.count_pass(cost);
        to.resize(state.len(), T::Vec3::ZERO);
        let (springs, means) = (self.stretched(), &mut self.windows());
        self.slices().accelerations(springs, state, self.loads(state), to, self.means(means));
    }

    /// Takes a step of `dt` (s) by the forces in the state given, at its time: a method that asks for no others moves each
    /// particle in the pass that sums up what acts on it. Counts one evaluation; `ahead` is scratch.
    pub fn advance<U: Update>(&self, state: &mut Particles<T>, dt: T, ahead: &mut Ahead<T>, cost: &mut Cost) {
        self.count_pass(cost);
        let springs = Stretched { limit: self.tearing, ..self.stretched() };
        let (loads, means) = (self.loads(state), &mut self.windows());
        self.slices().advance::<U>(springs, state, loads, dt, ahead, self.means(means));
    }

    /// Adds the forces of the springs to `force` (N); counts one evaluation.
    pub fn add_spring_forces(&self, state: &Particles<T>, force: &mut [T::Vec3], cost: &mut Cost) {
        self.count_pass(cost);
        self.slices().add_forces(self.stretched(), state, force, self.means(&mut self.windows()));
    }

    /// What acts besides springs in the state given, at its time.
    pub(crate) fn loads(&self, state: &Particles<T>) -> Loads<'_, T> {
        Loads {
            mass: &self.mass,
            inverse_mass: &self.inverse_mass,
            gravity: T::Vec3::from_f64(self.gravity.unwrap_or_default()),
            wind: T::Vec3::from_f64(self.wind.as_ref().map_or(DVec3::ZERO, |wind| wind.force(state.time))),
            air_damping: self.air_damping,
            pulls: &self.pulls,
        }
    }

    fn count_pass(&self, cost: &mut Cost) {
        cost.force_evaluations += 1;
        cost.spring_visits += self.springs.len() as u64;
    }

    fn stretched(&self) -> Stretched<'_, T> {
        Stretched { springs: &self.springs, damping: self.spring_damping, limit: None }
    }

    fn means<'a>(&self, windows: &'a mut Vec<Window<T>>) -> Means<'a, T> {
        Means { windows, threads: self.useful_threads() }
    }

    fn slices(&self) -> &Slices<T> {
        self.slices.get_or_init(|| Slices::new(self.particles(), &self.springs))
    }

    /// Scratch: whoever held it may have panicked, which does no harm.
    fn windows(&self) -> MutexGuard<'_, Vec<Window<T>>> {
        self.windows.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes the springs linear for an implicit step of `h` (s), at these positions (m).
    pub fn linearise(&self, positions: &[T::Vec3], h: T, linear: &mut Linear<T>) {
        let step = Step { springs: &self.springs, damping: self.spring_damping, positions, h };
        self.slices().linearise(step, linear, self.useful_threads());
    }

    /// Writes (M + springs) `from` over `image`, M the masses given (kg), and the scalar products of both over `products`: one for
    /// each block of [`PRODUCT_BLOCK`](super::PRODUCT_BLOCK) particles, lane by lane. Vectors stand in eights, by component.
    pub fn multiply(
        &self,
        linear: &Linear<T>,
        mass: &[T],
        from: &[[[T; LANES]; 3]],
        image: &mut [[[T; LANES]; 3]],
        products: &mut [[T; LANES]],
    ) {
        self.slices().multiply(linear, mass, from, image, products, self.means(&mut self.windows()));
    }

    /// Writes the blocks that particles have with themselves in M + springs over these: xx, yy, zz and xy, xz, yz.
    pub fn own_blocks(&self, linear: &Linear<T>, mass: &[T], blocks: [&mut [[[T; LANES]; 3]]; 2]) {
        self.slices().own_blocks(linear, mass, blocks, self.means(&mut self.windows()));
    }

    /// Whether the step under way is to be broken off, wherever it is: whoever asked for it will not use what it leaves. A
    /// method looks between iterations of which there can be many.
    pub fn is_stopped(&self) -> bool {
        self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed))
    }

    /// How many threads are worth using.
    pub fn useful_threads(&self) -> usize {
        if self.parallel() { self.threads } else { 1 }
    }

    /// Whether several threads are at hand and the cloth is large enough to share among them.
    pub fn parallel(&self) -> bool {
        /// Below this, waking threads costs more than they save.
        const SMALLEST: usize = 4096;
        self.threads > 1 && self.particles() >= SMALLEST
    }
}
