//! A running simulation: it owns the state, applies commands, steps, tears, and watches its own health.

mod branch;
mod clock;
mod cloth;
mod command;
mod hand;
mod health;
mod log;
mod measure;
mod packed;
mod recording;
mod script;
mod stopping;
mod stored;
mod tearing;
mod telling;

pub use clock::{Clock, Tick};
pub use command::{Command, REACH, STIFFEST_PULL};
pub use health::{Cause, Health};
pub use measure::{Energy, Measures};
pub use packed::Packed;
pub use recording::{Entry, Recording};
pub use script::{Play, Script};
pub use stored::Stored;

use crate::forces::Cost;
use crate::math::{Real, Vector};
use crate::model::{Memory, Numbering, Particles};
use crate::scene::{Built, Place, Precision, Refusal, Scene};
use crate::target::ImportReport;
use cloth::{Cloth, Shape};
use glam::DVec3;
use hand::{Grip, Hand};
use health::{Jitter, Ledger};
use log::Log;
use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A cloth in the precision of its scene.
enum AnyCloth {
    Single(Cloth<f32>),
    Double(Cloth<f64>),
}

/// A state in the precision of its scene.
#[derive(Clone, Debug, PartialEq)]
enum AnyState {
    Single(Particles<f32>),
    Double(Particles<f64>),
}

/// Runs the same code on a cloth of either precision.
macro_rules! on {
    ($any:expr, $cloth:ident => $body:expr) => {
        match $any {
            AnyCloth::Single($cloth) => $body,
            AnyCloth::Double($cloth) => $body,
        }
    };
}

use on;

/// The threads that a world steps on, if they are several.
#[derive(Clone)]
pub struct Threads(Option<Arc<rayon::ThreadPool>>);

impl Threads {
    /// Does work on one of them. Until it is done the others stay awake: a step of a small cloth takes no longer than waking them.
    pub fn run<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        let Some(pool) = &self.0 else { return work() };
        pool.install(|| {
            let done = AtomicBool::new(false);
            let own = rayon::current_thread_index();
            rayon::scope(|scope| {
                scope.spawn_broadcast(|_, other| {
                    while Some(other.index()) != own && !done.load(Ordering::Acquire) {
                        if rayon::yield_now() != Some(rayon::Yield::Executed) {
                            // Whoever else has work for this processor goes first.
                            std::thread::yield_now();
                        }
                    }
                });
                // Done also where it panics.
                let _work = Work { done: &done };
                work()
            })
        })
    }
}

/// Says when it goes that the work is done.
struct Work<'a> {
    done: &'a AtomicBool,
}

impl Drop for Work<'_> {
    fn drop(&mut self) {
        self.done.store(true, Ordering::Release);
    }
}

/// A running simulation of one scene.
pub struct World {
    scene: Scene,
    place: Place,
    shape: Arc<Shape>,
    report: Arc<ImportReport>,
    pinned: Vec<bool>,
    /// By particle, so that the hand of one is found at once.
    hands: Vec<Hand>,
    cloth: AnyCloth,
    /// Steps taken since the world was made.
    step: u64,
    /// Simulated time at a step since which dt has not changed: time is counted from here, not added up.
    anchor: (u64, f64),
    cost: Cost,
    ledger: Ledger,
    jitter: Jitter,
    health: Health,
    log: Log,
    /// A state not far back from which the last good state is stepped again; none after a command.
    checkpoint: Option<Box<Snapshot>>,
    /// Several threads to step on; none where one does.
    threads: Option<Arc<rayon::ThreadPool>>,
    /// See [`World::heed`].
    stop: Option<Arc<AtomicBool>>,
}

/// Everything that a world's future depends on. Restoring it and stepping on gives the same bits.
#[derive(Clone)]
pub struct Snapshot {
    scene: Scene,
    shape: Arc<Shape>,
    report: Arc<ImportReport>,
    pinned: Vec<bool>,
    hands: Vec<Hand>,
    state: AnyState,
    step: u64,
    anchor: (u64, f64),
    cost: Cost,
    ledger: Ledger,
    log: Log,
}

impl Snapshot {
    /// The scene at that moment.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Steps taken until then.
    pub fn step(&self) -> u64 {
        self.step
    }

    /// Commands logged until then.
    pub fn logged(&self) -> usize {
        self.log.len()
    }

    /// These, but for the first `count`.
    pub fn commands_since(&self, count: usize) -> Vec<Entry> {
        self.log.since(count)
    }
}

impl World {
    /// A world at the start of a scene, whose meshes are looked for in `place`.
    ///
    /// # Errors
    /// A target that cannot be read or does not fit into memory; pins, mass or a method that do not fit the target.
    pub fn new(scene: Scene, place: Place) -> Result<Self, Refusal> {
        let (shape, report) = build_shape(&scene, &place)?;
        let pinned = scene.pins.select(&scene.target, &shape.mesh)?;
        let cloth = build_cloth(&scene, &shape, None)?;
        let mut world = Self { pinned, ..Self::of(scene, place, (shape, report), cloth) };
        world.prepare();
        world.open_ledger();
        Ok(world)
    }

    /// A world of these parts that has done nothing yet.
    fn of(
        scene: Scene,
        place: Place,
        (shape, report): (Arc<Shape>, Arc<ImportReport>),
        cloth: AnyCloth,
    ) -> Self {
        Self {
            scene,
            place,
            shape,
            report,
            pinned: Vec::new(),
            hands: Vec::new(),
            cloth,
            step: 0,
            anchor: (0, 0.0),
            cost: Cost::default(),
            ledger: Ledger::default(),
            jitter: Jitter::default(),
            health: Health::default(),
            log: Log::default(),
            checkpoint: None,
            threads: None,
            stop: None,
        }
    }

    /// Steps on this many threads from now on, one at first. The result does not depend on it.
    ///
    /// # Errors
    /// The system gives no more threads.
    pub fn set_threads(&mut self, threads: usize) -> Result<(), Refusal> {
        self.threads = if threads > 1 {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            Some(Arc::new(pool.map_err(|e| Refusal::new(format!("{threads} threads: {e}")))?))
        } else {
            None
        };
        self.prepare();
        Ok(())
    }

    /// The threads that it steps on.
    pub fn threads(&self) -> Threads {
        // Handing a small cloth over would take longer than its step.
        Threads(self.threads.clone().filter(|_| on!(&self.cloth, c => c.problem.parallel())))
    }

    /// Applies a command before the next step, and logs it.
    ///
    /// # Errors
    /// A particle that is not there or not held, a point out of reach, a setting that is refused. Nothing has changed then.
    pub fn apply(&mut self, command: Command) -> Result<(), Refusal> {
        self.act(&command)?;
        if !matches!(command, Command::Drag { .. }) {
            on!(&mut self.cloth, c => c.state.memory.forget());
        }
        self.log.push(Entry { step: self.step, command });
        self.health = Health::Ok;
        self.checkpoint = None;
        Ok(())
    }

    fn act(&mut self, command: &Command) -> Result<(), Refusal> {
        match command {
            Command::Grab { particles } => self.take(particles, Grip::Hold)?,
            Command::Pull { particles, stiffness } => {
                if !(0.0..=STIFFEST_PULL).contains(stiffness) {
                    return Err(Refusal::new(format!(
                        "pull with {stiffness} N/m; accepted: 0 to {STIFFEST_PULL:e} N/m"
                    )));
                }
                self.take(particles, Grip::Pull(*stiffness))?;
            }
            Command::Drag { particle, to, steps } => {
                if !to.to_array().iter().all(|c| c.abs() <= REACH) {
                    return Err(Refusal::new(format!(
                        "drag to ({}, {}, {}); accepted: coordinates from -1e12 to 1e12 m",
                        to.x, to.y, to.z
                    )));
                }
                let found = self.hand_of(*particle).map(|i| &mut self.hands[i]);
                let hand = found.ok_or_else(|| {
                    Refusal::new(format!(
                        "drag of particle {particle}, which no hand holds; accepted: one grabbed before"
                    ))
                })?;
                // Adding +0 turns -0 into +0, which later steps leave alone to the bit.
                hand.drag(*to + DVec3::ZERO, *steps);
            }
            Command::Release { particles } => {
                self.check_particles(particles)?;
                let time = self.time();
                let released: HashSet<u32> = particles.iter().copied().collect();
                let hands = std::mem::take(&mut self.hands);
                let (gone, kept): (Vec<_>, _) =
                    hands.into_iter().partition(|h| released.contains(&h.particle));
                self.hands = kept;
                for hand in gone.iter().filter(|h| h.holds()) {
                    let pinned = self.pinned[hand.particle as usize];
                    let velocity = if pinned { DVec3::ZERO } else { hand.velocity(time) };
                    on!(&mut self.cloth, c => c.set_velocity(hand.particle, velocity));
                }
                self.prepare();
                self.open_ledger();
            }
            Command::Pin { particles } => self.set_pinned(particles, true)?,
            Command::Free { particles } => self.set_pinned(particles, false)?,
            Command::Set { key, value } => {
                let mut scene = self.scene.clone();
                scene.set_key(key, value)?;
                self.adopt(scene)?;
            }
            Command::Reset => {
                self.hands.clear();
                self.cloth = build_cloth(&self.scene, &self.shape, None)?;
                self.anchor = (self.step, 0.0);
                self.pinned = self.scene.pins.select(&self.scene.target, &self.shape.mesh)?;
                self.prepare();
                self.open_ledger();
            }
        }
        Ok(())
    }

    /// Lays hands on particles that no hand is on yet.
    fn take(&mut self, particles: &[u32], grip: Grip) -> Result<(), Refusal> {
        self.check_particles(particles)?;
        let (time, taken) = (self.time(), self.hands.len());
        for &p in particles {
            if self.hands[..taken].binary_search_by_key(&p, |h| h.particle).is_err() {
                let at = on!(&mut self.cloth, c => {
                    if grip == Grip::Hold {
                        c.set_velocity(p, DVec3::ZERO);
                    }
                    c.position(p)
                });
                self.hands.push(Hand::new(p, grip, at, time));
            }
        }
        self.hands.sort_by_key(|h| h.particle);
        self.hands.dedup_by_key(|h| h.particle);
        self.prepare();
        Ok(())
    }

    fn check_particles(&self, particles: &[u32]) -> Result<(), Refusal> {
        let count = self.pinned.len();
        match particles.iter().find(|p| **p as usize >= count) {
            None => Ok(()),
            Some(p) => Err(Refusal::new(format!(
                "there is no particle {p}; accepted: 0 to {}",
                count.saturating_sub(1)
            ))),
        }
    }

    fn set_pinned(&mut self, particles: &[u32], pinned: bool) -> Result<(), Refusal> {
        self.check_particles(particles)?;
        for &p in particles {
            self.pinned[p as usize] = pinned;
            if !self.is_held(p) {
                on!(&mut self.cloth, c => c.set_velocity(p, DVec3::ZERO));
            }
        }
        self.scene.pins.edit(&self.scene.target, &self.pinned, particles, pinned);
        self.prepare();
        self.open_ledger();
        Ok(())
    }

    /// Takes over an edited scene: from the next step on, everything is as if the simulation had started from this state
    /// with these settings. A new target keeps the shape where its particles are as many as before.
    fn adopt(&mut self, scene: Scene) -> Result<(), Refusal> {
        let old = &self.scene;
        let new_target = scene.target != old.target;
        let (shape, report) = if new_target {
            build_shape(&scene, &self.place)?
        } else {
            (Arc::clone(&self.shape), Arc::clone(&self.report))
        };
        let count_changes = shape.mesh.positions.len() != self.shape.mesh.positions.len();
        let pinned = if new_target || scene.pins != old.pins {
            scene.pins.select(&scene.target, &shape.mesh)?
        } else {
            self.pinned.clone()
        };
        if new_target || scene.mass != old.mass || scene.precision != old.precision {
            let state = if count_changes {
                None
            } else {
                let mut state = self.state();
                if new_target {
                    state.forget_torn();
                    state.renumber(&self.shape.numbering, &shape.numbering);
                }
                Some(state)
            };
            self.cloth = build_cloth(&scene, &shape, state)?;
        } else {
            let (params, before) = (&scene.springs, &old.springs);
            let rebuild = params
                .kinds()
                .iter()
                .zip(&before.kinds())
                .any(|(a, b)| (a.enabled, a.rest_scale) != (b.enabled, b.rest_scale));
            on!(&mut self.cloth, c => {
                if scene.simulator != old.simulator {
                    c.set_simulator(&scene)?;
                }
                if rebuild {
                    c.set_springs(params, &shape.topology);
                } else if params != before {
                    c.problem.set_stiffness(params);
                }
                c.set_environment(&scene);
            });
        }
        if count_changes {
            self.hands.clear();
            self.anchor = (self.step, 0.0);
        } else if scene.dt != old.dt {
            self.anchor = (self.step, self.time());
        }
        for (p, (now, before)) in pinned.iter().zip(&self.pinned).enumerate() {
            if *now && !before && !self.is_held(p as u32) {
                on!(&mut self.cloth, c => c.set_velocity(p as u32, DVec3::ZERO));
            }
        }
        self.scene = scene;
        self.shape = shape;
        self.report = report;
        self.pinned = pinned;
        self.prepare();
        self.open_ledger();
        Ok(())
    }

    fn hand_of(&self, particle: u32) -> Option<usize> {
        self.hands.binary_search_by_key(&particle, |h| h.particle).ok()
    }

    fn is_held(&self, particle: u32) -> bool {
        self.hand_of(particle).is_some_and(|i| self.hands[i].holds())
    }

    /// Makes exactly the pinned and the held particles immovable, and says how many threads there are.
    fn prepare(&mut self) {
        let threads = self.threads.as_ref().map_or(1, |pool| pool.current_num_threads());
        on!(&mut self.cloth, c => {
            c.problem.threads = threads;
            c.problem.stop.clone_from(&self.stop);
            let pinned = (0..).zip(&self.pinned).filter(|(_, pinned)| **pinned).map(|(particle, _)| particle);
            let held = self.hands.iter().filter(|hand| hand.holds()).map(|hand| hand.particle);
            c.set_fixed(pinned.chain(held));
            c.set_pulls(&self.hands);
        });
    }

    fn open_ledger(&mut self) {
        self.ledger = on!(&self.cloth, c => Ledger::open(c));
        self.jitter = Jitter::default();
    }

    /// Takes one step. A state that diverges is taken back to the last good one, named in [`health`](Self::health), and
    /// further steps do nothing until a command changes something. At dt = 0 nothing moves.
    pub fn step(&mut self) {
        if self.health.is_diverged() || self.is_stopped() {
            return;
        }
        if self.checkpoint.as_ref().is_none_or(|c| self.is_far_from(c)) {
            self.checkpoint = Some(Box::new(self.snapshot()));
        }
        let (dt, unsolved) = (self.scene.dt, self.cost.unsolved_steps);
        self.advance();
        if self.is_stopped() {
            self.return_to(self.step - 1);
            return;
        }
        if dt > 0.0 {
            let blamed = on!(&self.cloth, c => self.ledger.step(c, dt));
            if let Some(particle) = blamed {
                self.health = Health::Diverged { step: self.step, time: self.time(), particle };
                self.return_to(self.step - 1);
                return;
            }
            let shaking = on!(&self.cloth, c => self.jitter.step(c, self.step, dt));
            let unsettled = if self.cost.unsolved_steps > unsolved {
                Some((on!(&self.cloth, c => c.particle(self.cost.unsolved_particle)), Cause::Unsolved))
            } else {
                shaking.map(|particle| (particle, Cause::Shaking))
            };
            if let (Some((particle, cause)), Health::Ok) = (unsettled, self.health) {
                self.health = Health::Unsettled { step: self.step, time: self.time(), particle, cause };
            }
        }
    }

    /// Goes back to the checkpoint and steps up to `step` again, which gives the same states.
    fn return_to(&mut self, step: u64) {
        let Some(checkpoint) = self.checkpoint.take() else { return };
        // Nothing stops the way back.
        let stop = self.stop.take();
        self.put_back(&checkpoint);
        while self.step < step {
            self.advance();
            on!(&self.cloth, c => self.ledger.step(c, self.scene.dt));
        }
        self.heed(stop);
        self.checkpoint = Some(checkpoint);
    }

    /// One step of the method with hands and tearing, unwatched.
    fn advance(&mut self) {
        self.step += 1;
        let (dt, time) = (self.scene.dt, self.time());
        if dt == 0.0 {
            return;
        }
        let Self { hands, cloth, ledger, cost, threads, scene, .. } = self;
        on!(cloth, c => {
            ledger.hands(c, hands, dt);
            for hand in hands.iter().filter(|h| h.holds()) {
                // From where the hand is, not the particle: rounded to single precision that would be a phantom velocity.
                c.set_velocity(hand.particle, (hand.next() - hand.at()) / dt);
            }
            c.set_pulls(hands);
            match threads {
                Some(pool) if c.problem.parallel() => pool.install(|| c.step(dt, cost)),
                _ => c.step(dt, cost),
            }
            c.state.time = time;
            for hand in hands.iter_mut() {
                hand.advance(time);
                if hand.holds() {
                    // The method moved it by dt v; here it arrives to the last bit.
                    c.set_position(hand.particle, hand.at());
                }
            }
            if scene.tearing.enabled {
                c.tear(scene.tearing.max_ratio);
            }
        });
    }

    /// Everything that the future depends on.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            scene: self.scene.clone(),
            shape: Arc::clone(&self.shape),
            report: Arc::clone(&self.report),
            pinned: self.pinned.clone(),
            hands: self.hands.clone(),
            state: self.state(),
            step: self.step,
            anchor: self.anchor,
            cost: self.cost,
            ledger: self.ledger,
            log: self.log.clone(),
        }
    }

    /// Goes to a snapshot, the commands that led there included.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.put_back(snapshot);
        self.log = snapshot.log.clone();
        self.health = Health::Ok;
        self.checkpoint = None;
    }

    fn put_back(&mut self, snapshot: &Snapshot) {
        let same_problem = self.scene == snapshot.scene && Arc::ptr_eq(&self.shape, &snapshot.shape);
        let state = snapshot.state.clone();
        match (&mut self.cloth, state) {
            (AnyCloth::Single(c), AnyState::Single(s)) if same_problem => {
                c.put_back(s, &self.scene.springs, &self.shape.topology);
            }
            (AnyCloth::Double(c), AnyState::Double(s)) if same_problem => {
                c.put_back(s, &self.scene.springs, &self.shape.topology);
            }
            (_, state) => {
                // The snapshot was taken of a world that had been built from this very scene.
                if let Ok(cloth) = build_cloth(&snapshot.scene, &snapshot.shape, Some(state)) {
                    self.cloth = cloth;
                }
            }
        }
        self.scene.clone_from(&snapshot.scene);
        self.shape = Arc::clone(&snapshot.shape);
        self.report = Arc::clone(&snapshot.report);
        self.pinned.clone_from(&snapshot.pinned);
        self.hands.clone_from(&snapshot.hands);
        self.step = snapshot.step;
        self.anchor = snapshot.anchor;
        self.cost = snapshot.cost;
        self.ledger = snapshot.ledger;
        self.jitter = Jitter::default();
        self.prepare();
    }

    fn state(&self) -> AnyState {
        match &self.cloth {
            AnyCloth::Single(c) => AnyState::Single(c.state.clone()),
            AnyCloth::Double(c) => AnyState::Double(c.state.clone()),
        }
    }
}

impl AnyState {
    fn converted(self, precision: Precision) -> Self {
        match (self, precision) {
            (Self::Double(s), Precision::Single) => Self::Single(convert(&s)),
            (Self::Single(s), Precision::Double) => Self::Double(convert(&s)),
            (same, _) => same,
        }
    }

    /// Leads a state from one inner numbering to another of as many particles.
    fn renumber(&mut self, from: &Numbering, to: &Numbering) {
        fn lead<T: Real>(state: &mut Particles<T>, from: &Numbering, to: &Numbering) {
            for values in [&mut state.positions, &mut state.velocities] {
                let in_source_order: Vec<_> = from.in_source_order(values).collect();
                *values = to.to_inner(&in_source_order);
            }
            state.memory.forget();
        }
        match self {
            Self::Single(s) => lead(s, from, to),
            Self::Double(s) => lead(s, from, to),
        }
    }

    fn forget_torn(&mut self) {
        match self {
            Self::Single(s) => s.broken.clear(),
            Self::Double(s) => s.broken.clear(),
        }
    }
}

fn convert<A: Real, B: Real>(state: &Particles<A>) -> Particles<B> {
    let all = |from: &[A::Vec3]| from.iter().map(|v| B::Vec3::from_f64(v.to_f64())).collect();
    Particles {
        time: state.time,
        positions: all(&state.positions),
        velocities: all(&state.velocities),
        broken: state.broken.clone(),
        memory: Memory::default(),
        seen: None,
    }
}

fn build_shape(scene: &Scene, place: &Place) -> Result<(Arc<Shape>, Arc<ImportReport>), Refusal> {
    let Built { mesh, report } = scene.target.build(place)?;
    Ok((Arc::new(Shape::of(mesh)), Arc::new(report)))
}

fn build_cloth(scene: &Scene, shape: &Shape, state: Option<AnyState>) -> Result<AnyCloth, Refusal> {
    let mass = scene.mass.of(&shape.mesh)?;
    Ok(match (scene.precision, state.map(|s| s.converted(scene.precision))) {
        (Precision::Single, Some(AnyState::Single(s))) => {
            AnyCloth::Single(Cloth::new(scene, shape, &mass, Some(s))?)
        }
        (Precision::Double, Some(AnyState::Double(s))) => {
            AnyCloth::Double(Cloth::new(scene, shape, &mass, Some(s))?)
        }
        (Precision::Single, _) => AnyCloth::Single(Cloth::new(scene, shape, &mass, None)?),
        (Precision::Double, _) => AnyCloth::Double(Cloth::new(scene, shape, &mass, None)?),
    })
}
