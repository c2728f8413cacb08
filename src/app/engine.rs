//! What runs the lanes: takes orders, advances by wall-clock time, and tells its state. No thread, no clock of its own.
//!
//! Lanes are worlds on the same scene that differ in method, precision or dt. Time passes in beats, as long as the longest dt; at the
//! end of a beat every lane has reached the same simulated time, and only there commands are applied, the same to all.

mod grips;
mod kept;
mod pace;

use std::{
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use glam::DVec3;

use super::lane::Lane;
pub use super::order::{LaneSetup, LaneState, Limit, Order, State, Studied, Values};
use crate::{
    scene::{Pending, Place, Refusal},
    world::{Clock, Command, Entry, Recording},
};
use grips::Grips;
use kept::Memory;
use pace::Pace;

/// Longest time that orders wait while steps are taken.
const PATIENCE: Duration = Duration::from_millis(12);
/// The part of the time that may go into measuring; into following the limit of stability; and into its first search.
const MEASURING_SHARE: f64 = 0.1;
const LIMIT_SHARE: f64 = 0.02;
const FIRST_LIMIT_SHARE: f64 = 0.25;
/// States remembered for going back, and the particles of all of them: memory, not time, is the limit.
const REMEMBERED: usize = 40;
const REMEMBERED_PARTICLES: usize = 4_000_000;
/// Most steps of a lane in a beat: orders wait for its end, however much shorter than the longest a dt may be.
const STEPS_OF_A_BEAT: u32 = 1000;
/// A picture's time: steps longer than this are blended.
const PICTURE: Duration = Duration::from_millis(12);
/// Runs the lanes.
pub struct Engine {
    lanes: Vec<Lane>,
    reference: usize,
    clock: Clock,
    running: bool,
    values: Values,
    orders: u64,
    version: u64,
    geometries: u64,
    refusal: Option<(u64, String)>,
    /// Simulated time that all lanes have reached since they were opened together, s.
    time: f64,
    /// Beats that were due but not taken, because orders waited.
    owed: u64,
    pace: Pace,
    measure_at: Instant,
    limit_at: Instant,
    /// The limits are those of an earlier state.
    stale: bool,
    at: Instant,
    memory: Memory,
    grips: Grips,
    /// Threads that each lane steps on, where the user has said so.
    threads: Option<usize>,
    /// The state that was handed out last.
    studied: Option<Studied>,
}

impl Engine {
    /// Opens lanes, paused.
    ///
    /// # Errors
    /// A scene that cannot be built.
    pub fn new(setups: Vec<LaneSetup>) -> Result<Self, Refusal> {
        Self::on_threads(setups, None)
    }

    /// Opens lanes, paused, that step on so many threads each; where nothing is said, large cloths on several.
    ///
    /// # Errors
    /// A scene that cannot be built.
    pub fn on_threads(setups: Vec<LaneSetup>, threads: Option<usize>) -> Result<Self, Refusal> {
        let now = Instant::now();
        let mut engine = Self {
            lanes: Vec::new(),
            reference: 0,
            clock: Clock::default(),
            running: false,
            values: Values::None,
            orders: 0,
            version: 0,
            geometries: 0,
            refusal: None,
            time: 0.0,
            owed: 0,
            pace: Pace::default(),
            measure_at: now,
            limit_at: now,
            stale: false,
            at: now,
            memory: Memory::default(),
            grips: Grips::default(),
            threads,
            studied: None,
        };
        engine.open(setups)?;
        Ok(engine)
    }

    /// Takes one order; what is refused is told with the state and changes nothing.
    pub fn take(&mut self, order: Order) {
        self.orders += 1;
        if let Err(refusal) = self.act(order) {
            self.refusal = Some((self.orders, refusal.to_string()));
        }
    }

    /// Counts an order that a later one makes needless.
    pub fn skip(&mut self) {
        self.orders += 1;
    }

    fn act(&mut self, order: Order) -> Result<(), Refusal> {
        match order {
            Order::Open(setups) => self.open(setups)?,
            Order::AddLane { from, at, title, settings, back } => {
                let at = at.min(self.lanes.len());
                if back.is_some_and(|number| self.memory.put_back(number, at, &mut self.lanes)) {
                    self.has_jumped();
                } else if let Some(lane) = self.lanes.get(from) {
                    let lane = lane.branch(title, settings, self.threads)?;
                    self.lanes.insert(at, lane);
                }
                if at <= self.reference && at + 1 < self.lanes.len() {
                    self.reference += 1;
                }
            }
            Order::RemoveLane { lane, number } => {
                if self.lanes.len() > 1 && lane < self.lanes.len() {
                    self.memory.put_away(number, lane, &mut self.lanes);
                    if self.reference >= lane {
                        self.reference = self.reference.saturating_sub(1);
                    }
                }
            }
            Order::Apply(lane, command) => self.apply(lane, &command)?,
            Order::Drag(to) => self.drag(&to)?,
            Order::Run(running) => {
                self.running = running;
                self.rest();
            }
            Order::Step(beats) => {
                self.running = false;
                self.rest();
                for _ in 0..beats {
                    self.beat();
                }
                self.measure_at = Instant::now();
            }
            Order::Speed(speed) => self.clock.speed = speed.clamp(1e-3, 1e3),
            Order::GoBack(seconds) => {
                for lane in &mut self.lanes {
                    lane.go_back(seconds);
                }
                self.has_jumped();
                self.running = false;
            }
            Order::Keep(number) => self.memory.keep(number, &self.lanes),
            Order::Exchange { number, otherwise } => self.exchange(number, &otherwise)?,
            Order::Values(values) => self.values = values,
            Order::Reference(lane) => self.reference = lane.min(self.lanes.len().saturating_sub(1)),
            Order::Record(path) => self.record(&path)?,
            Order::Study(lane) => {
                let lane = self.lanes.get(lane);
                let snapshot = lane.map(|lane| Arc::new(lane.world.snapshot()));
                self.studied = snapshot.map(|snapshot| Studied { order: self.orders, snapshot });
            }
        }
        Ok(())
    }

    fn open(&mut self, setups: Vec<LaneSetup>) -> Result<(), Refusal> {
        // Built before the old ones go: a refused scene leaves everything as it was.
        let open = |setup: LaneSetup| {
            let title = setup.title.clone();
            Lane::open(setup, self.threads).map_err(|refusal| refusal.at(title))
        };
        let lanes = setups.into_iter().map(open).collect::<Result<Vec<_>, _>>()?;
        if lanes.is_empty() {
            return Err(Refusal::new("there is no scene to open"));
        }
        self.lanes = lanes;
        self.reference = 0;
        self.running = false;
        self.has_jumped();
        Ok(())
    }

    fn apply(&mut self, only: Option<usize>, command: &Command) -> Result<(), Refusal> {
        if !self.grips.mind(command, self.time) {
            return Ok(());
        }
        let mut result = Ok(());
        let mut has_jumped = false;
        for (i, lane) in self.lanes.iter_mut().enumerate() {
            if only.is_some_and(|only| only != i) {
                continue;
            }
            let before = lane.world.time();
            let done = lane.world.apply(command.clone());
            let is_setting =
                matches!(command, Command::Set { .. } | Command::Pin { .. } | Command::Free { .. });
            if is_setting && done.is_ok() {
                lane.refresh();
            }
            if let Command::Set { key, .. } = command {
                lane.restart_search(key);
            }
            match command {
                Command::Set { key, .. } if key.starts_with("target") => lane.shape = None,
                Command::Reset => lane.shape = None,
                _ => {}
            }
            if lane.world.time() < before {
                lane.remembered.clear();
                has_jumped = true;
            }
            result = result.and(done);
        }
        if has_jumped {
            self.has_jumped();
        }
        self.measure_at = Instant::now();
        self.stale = true;
        result
    }

    fn drag(&mut self, to: &[(u32, DVec3)]) -> Result<(), Refusal> {
        let frame = self.clock.speed / 60.0;
        for lane in &mut self.lanes {
            let dt = lane.world.scene().dt;
            let steps = if dt > 0.0 && self.running { (frame / dt).round().max(1.0) as u32 } else { 1 };
            for &(particle, to) in to {
                lane.world.apply(Command::Drag { particle, to, steps })?;
            }
        }
        if !self.running {
            self.grips.pose(to);
        }
        Ok(())
    }

    /// Time has jumped in some lane: hands, owed time and the beat begin anew.
    fn has_jumped(&mut self) {
        self.time = self.lanes.iter().map(|lane| lane.world.time()).fold(0.0, f64::max);
        self.grips = Grips::default();
        self.rest();
        let now = Instant::now();
        self.measure_at = now;
        self.limit_at = now;
        self.stale = true;
    }

    fn exchange(&mut self, number: u64, otherwise: &[(Option<usize>, Command)]) -> Result<(), Refusal> {
        let replaces = |(_, command): &(_, Command)| matches!(command, Command::Set { key, .. } if key.starts_with("target"));
        let commands_do = !otherwise.is_empty() && !otherwise.iter().any(replaces);
        if self.memory.exchange(number, commands_do, &mut self.lanes) {
            self.has_jumped();
            return Ok(());
        }
        if otherwise.is_empty() {
            return Err(Refusal::new("the cloth of that moment is no longer remembered"));
        }
        otherwise.iter().try_for_each(|(lane, command)| self.apply(*lane, command))
    }

    fn record(&self, path: &Path) -> Result<(), Refusal> {
        let Some((recording, place)) = self.recording(0) else {
            return Err(Refusal::new(
                "this lane was added while time passed: it has no start to record from",
            ));
        };
        let scene = place.moved(&recording.scene, path.parent().unwrap_or(Path::new(".")));
        let text = Recording { scene, ..recording }.to_ron()?;
        Pending::new(path)?.finish(text.as_bytes())
    }

    /// Forgets the time that is owed.
    fn rest(&mut self) {
        self.clock.restart();
        self.owed = 0;
        self.pace = Pace::default();
        self.at = Instant::now();
        for lane in &mut self.lanes {
            lane.previous.clear();
        }
    }

    /// Length of a beat, s: the longest dt, unless another lane would need too many steps for that. The longest then comes
    /// every few beats.
    fn beat_time(&self) -> f64 {
        let dts = || self.lanes.iter().map(|lane| lane.world.scene().dt).filter(|dt| *dt > 0.0);
        let longest = dts().fold(0.0, f64::max);
        dts().fold(longest, |beat, dt| beat.min(f64::from(STEPS_OF_A_BEAT) * dt))
    }

    /// Takes the steps that are due after `elapsed`, but returns early for orders that `wait`. True if there is news.
    pub fn advance(&mut self, elapsed: Duration, wait: impl Fn() -> bool) -> bool {
        if !self.running {
            return self.stale && Instant::now() >= self.limit_at;
        }
        let beat = self.beat_time();
        let tick = self.clock.advance(elapsed.as_secs_f64(), beat);
        // What was owed from before is part of the longest frame: else a slow machine would fall ever farther behind.
        let most = (self.clock.longest_frame / beat).max(1.0) as u64;
        self.owed = (self.owed + tick.steps).min(most);
        let start = Instant::now();
        let mut taken = 0;
        while self.owed > 0 && self.running {
            self.beat();
            self.owed -= 1;
            taken += 1;
            if start.elapsed() > PATIENCE || wait() {
                break;
            }
        }
        self.pace.count(elapsed, taken as f64 * beat);
        if taken > 0 {
            self.at = Instant::now();
        }
        taken > 0
    }

    /// Time until the next beat is due.
    pub fn idle(&self) -> Duration {
        let second = Duration::from_secs(1);
        if !self.running {
            return if self.stale { self.limit_at.saturating_duration_since(Instant::now()) } else { second };
        }
        let wall = self.beat_time() / self.clock.speed;
        if self.owed > 0 { Duration::ZERO } else { Duration::from_secs_f64(wall.clamp(0.0005, 0.05) / 2.0) }
    }

    fn beat(&mut self) {
        self.time += self.beat_time();
        let (time, blends) = (self.time, self.blends());
        let keep = (REMEMBERED_PARTICLES / kept::particles(&self.lanes)).clamp(1, REMEMBERED);
        for lane in &mut self.lanes {
            let start = Instant::now();
            let before = lane.world.time();
            let dt = lane.world.scene().dt;
            if blends {
                lane.world.positions_f32(&mut lane.previous);
            }
            // Both times are rounded, and a dt far below their last digit moves neither.
            let due = time * (1.0 + 1e-12) + 1e-6 * dt;
            for _ in 0..STEPS_OF_A_BEAT {
                let steps = lane.world.steps();
                if dt == 0.0 || lane.world.time() + dt > due {
                    break;
                }
                lane.world.step();
                if lane.world.steps() == steps {
                    break;
                }
            }
            lane.spent.0 += start.elapsed();
            lane.spent.1 += lane.world.time() - before;
            lane.remember(keep);
        }
        self.stale = true;
        for particles in self.grips.let_go(self.time) {
            for lane in &mut self.lanes {
                // Particles of a scene that is gone are refused, rightly.
                let _ = lane.world.apply(Command::Release { particles: particles.clone() });
            }
        }
        if self.lanes.iter().any(|lane| lane.world.health().is_diverged()) {
            self.running = false;
            self.measure_at = Instant::now();
            self.limit_at = self.measure_at;
        }
    }

    fn blends(&self) -> bool {
        Duration::from_secs_f64((self.beat_time() / self.clock.speed).clamp(0.0, 1e6)) > PICTURE
    }

    /// What the interface is to see now.
    pub fn state(&mut self) -> State {
        self.version += 1;
        self.measure();
        let compared = (self.lanes.len() > 1)
            .then(|| self.lanes.get(self.reference).map(|lane| lane.world.positions()))
            .flatten();
        let (values, posed, geometries) = (self.values, self.grips.posed(), &mut self.geometries);
        let lanes = self.lanes.iter_mut();
        let lanes =
            lanes.map(|lane| Arc::new(lane.state(values, compared.as_deref(), posed, geometries))).collect();
        let wall = (self.beat_time() / self.clock.speed).clamp(0.0, 1e6);
        State {
            orders: self.orders,
            version: self.version,
            running: self.running,
            speed: self.clock.speed,
            pace: self.running.then(|| self.pace.value()).flatten(),
            beat: Duration::from_secs_f64(wall),
            at: self.at,
            reference: self.reference,
            lanes,
            refusal: self.refusal.clone(),
            is_still: false,
            studied: self.studied.clone(),
        }
    }

    /// Energies and limits cost a pass over the springs or many: they are refreshed as seldom as keeps their share small.
    fn measure(&mut self) {
        let pause = |start: Instant, share: f64, most: f64| {
            let pause = start.elapsed().as_secs_f64() / share;
            Instant::now() + Duration::from_secs_f64(pause.clamp(0.03, most))
        };
        let start = Instant::now();
        if start >= self.measure_at {
            self.lanes.iter_mut().for_each(Lane::measure);
            self.measure_at = pause(start, MEASURING_SHARE, 5.0);
        }
        let start = Instant::now();
        if self.stale && start >= self.limit_at {
            let first = self.lanes.iter().any(Lane::lacks_limit);
            self.stale = false;
            for lane in &mut self.lanes {
                self.stale |= !lane.search_limit();
            }
            self.limit_at = pause(start, if first { FIRST_LIMIT_SHARE } else { LIMIT_SHARE }, 60.0);
        }
    }

    /// What was done to a lane since it was opened, and where its scene's meshes are; none where it has no start to
    /// record from, because it was added while time passed.
    pub fn recording(&self, lane: usize) -> Option<(Recording, Place)> {
        let lane = self.lanes.get(lane)?;
        Some((Recording::of(lane.start.clone()?, &lane.world), lane.place.clone()))
    }

    /// The commands that a lane has taken, with their steps.
    pub fn log(&self, lane: usize) -> &[Entry] {
        self.lanes.get(lane).map_or(&[], |lane| lane.world.log())
    }
}

#[cfg(test)]
mod tests;
