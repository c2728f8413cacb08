//! What runs the lanes: takes orders, advances by wall-clock time, and tells its state. No thread, no clock of its own.
//!
//! Lanes are worlds on the same scene that differ in method, precision or dt. Time passes in beats, as long as the longest dt; at the
//! end of a beat every lane has reached the same simulated time, and only there commands are applied, the same to all.

mod grips;
mod kept;
mod lanes;
mod opening;
mod pace;
mod past;
mod timeline;

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use glam::DVec3;

pub use super::order::{
    LaneSetup, LaneState, Limit, Moment, Order, Origin, Remembered, State, Studied, Values,
};
use super::{
    autosave::{Draft, DraftLane},
    lane::{Lane, STEPS_OF_A_BEAT},
};
use crate::{
    scene::{Pending, Place, Refusal},
    world::{Clock, Command, Entry, Recording},
};
use grips::Grips;
use kept::Memory;
pub use opening::GivenUp;
use pace::Pace;
use timeline::Timeline;

/// Longest time that orders wait while steps are taken.
const PATIENCE: Duration = Duration::from_millis(12);
/// The part of the time that may go into measuring; into following the limit of stability; and into its first search.
const MEASURING_SHARE: f64 = 0.1;
const LIMIT_SHARE: f64 = 0.02;
const FIRST_LIMIT_SHARE: f64 = 0.25;
/// A picture's time: steps longer than this are blended.
const PICTURE: Duration = Duration::from_millis(12);
/// Runs the lanes.
pub struct Engine {
    lanes: Vec<Lane>,
    reference: usize,
    clock: Clock,
    running: bool,
    /// It ran when it burst: once something is set it goes on.
    goes_on_once_set: bool,
    values: Values,
    orders: u64,
    version: u64,
    numbers: u64,
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
    timeline: Timeline,
    grips: Grips,
    /// Threads that each lane steps on, where the user has said so.
    threads: Option<usize>,
    /// Set from outside where a step takes too long: it is broken off, and none is taken until [`Order::Run`] says that time
    /// stands still.
    stop: Arc<AtomicBool>,
    given_up: GivenUp,
    /// The state that was handed out last.
    studied: Option<Studied>,
    /// The last thing that happened by itself, with its number.
    news: Option<(u64, String)>,
    /// The first lane's file.
    file: Option<PathBuf>,
    /// Steps and commands of the lanes that were written down last.
    drafted: Vec<(u64, usize)>,
}

impl Engine {
    /// Opens lanes, paused.
    ///
    /// # Errors
    /// A scene that cannot be built.
    pub fn new(setups: Vec<LaneSetup>) -> Result<Self, Refusal> {
        let mut engine = Self::empty(None);
        engine.open(setups)?;
        Ok(engine)
    }

    /// An engine without lanes yet. Those that it opens step on so many threads each; where nothing is said, large cloths on several.
    pub fn empty(threads: Option<usize>) -> Self {
        let now = Instant::now();
        Self {
            lanes: Vec::new(),
            reference: 0,
            clock: Clock::default(),
            running: false,
            goes_on_once_set: false,
            values: Values::None,
            orders: 0,
            version: 0,
            numbers: 0,
            refusal: None,
            time: 0.0,
            owed: 0,
            pace: Pace::default(),
            measure_at: now,
            limit_at: now,
            stale: false,
            at: now,
            memory: Memory::default(),
            timeline: Timeline::default(),
            grips: Grips::default(),
            threads,
            stop: Arc::default(),
            given_up: GivenUp::default(),
            studied: None,
            news: None,
            file: None,
            drafted: Vec::new(),
        }
    }

    /// What gives up, from any thread, the lanes that an order is opening.
    pub fn given_up(&self) -> GivenUp {
        self.given_up.clone()
    }

    /// What breaks off a step that takes too long, once it is set; the next order is to be that time stands still.
    pub fn stop(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.stop)
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
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
        if matches!(order, Order::Open(_) | Order::Run(_) | Order::Step(_) | Order::Scrub(_) | Order::Again) {
            self.goes_on_once_set = false;
        }
        match order {
            Order::Open(setups) => self.open(setups)?,
            Order::AddLane { from, at, title, settings, back } => {
                self.add_lane(from, at, title, &settings, back)?;
            }
            Order::RemoveLane { lane, number } => self.remove_lane(lane, number),
            Order::Apply(lane, command) => self.apply(lane, &command)?,
            Order::Drag(to) => self.drag(&to)?,
            Order::Run(running) => {
                self.running = running;
                self.rest();
                if !running && self.stop.swap(false, Ordering::Relaxed) {
                    self.tell("broken off: the cloth is as it was after its last whole step".to_owned());
                }
            }
            Order::Step(beats) => {
                self.running = false;
                self.rest();
                for _ in 0..beats {
                    let plays = self.replay().is_some();
                    self.beat();
                    if self.is_stopped() || (plays && self.replay().is_none()) {
                        break;
                    }
                }
                self.measure_at = Instant::now();
            }
            Order::Speed(speed) => self.clock.speed = speed.clamp(1e-3, 1e3),
            Order::GoBack(seconds) => self.go_back(seconds),
            Order::Scrub(to) => self.scrub(to),
            Order::Remember(bytes) => self.timeline.allow(bytes),
            Order::Again => self.again()?,
            Order::Rename(title, file) => {
                self.file = Some(file);
                if let Some(lane) = self.lanes.first_mut() {
                    lane.title = title;
                }
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
        let file = setups.first().and_then(|setup| setup.file.clone());
        self.lanes = self.build(setups)?;
        self.file = file;
        self.reference = 0;
        self.running = false;
        self.timeline.clear();
        self.has_jumped();
        Ok(())
    }

    fn apply(&mut self, only: Option<usize>, command: &Command) -> Result<(), Refusal> {
        self.go_on();
        self.take_over(command);
        if !self.grips.mind(command, self.time) {
            return Ok(());
        }
        if matches!(command, Command::Reset)
            || matches!(command, Command::Set { key, .. } if key.starts_with("target"))
        {
            self.keep();
        }
        let mut result = Ok(());
        let mut has_jumped = false;
        for (i, lane) in self.lanes.iter_mut().enumerate() {
            if only.is_some_and(|only| only != i) {
                continue;
            }
            if let (Command::Set { key, .. }, Some(play)) = (command, &mut lane.play) {
                play.choose(key);
            }
            let done = lane.apply(command);
            has_jumped |= *done.as_ref().unwrap_or(&false);
            result = result.and(done.map(|_| ()));
        }
        if has_jumped {
            self.has_jumped();
        }
        self.measure_at = Instant::now();
        self.stale = true;
        if result.is_ok() && matches!(command, Command::Set { .. }) && self.goes_on_once_set {
            self.goes_on_once_set = false;
            self.running = true;
            self.rest();
        }
        result
    }

    fn drag(&mut self, to: &[(u32, DVec3)]) -> Result<(), Refusal> {
        self.go_on();
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
        self.time = self.lanes.iter().map(Lane::clock).fold(0.0, f64::max);
        self.start_anew();
        self.timeline.jump();
        self.keep();
    }

    /// Keeps the present state on the timeline.
    fn keep(&mut self) {
        self.timeline.keep(&self.lanes, self.time);
    }

    fn start_anew(&mut self) {
        self.grips = Grips::default();
        self.rest();
        let now = Instant::now();
        self.measure_at = now;
        self.limit_at = now;
        self.stale = true;
    }

    fn exchange(&mut self, number: u64, otherwise: &[(Option<usize>, Command)]) -> Result<(), Refusal> {
        // Another target, or pins of what has fallen since: the state is part of what is taken back.
        let replaces = |(_, command): &(_, Command)| match command {
            Command::Set { key, .. } => key.starts_with("target"),
            Command::Pin { .. } => true,
            _ => false,
        };
        let commands_do = !otherwise.is_empty() && !otherwise.iter().any(replaces);
        self.go_on();
        self.keep();
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
        let Some((recording, place)) = self.recording(0) else { return Ok(()) };
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
            lane.forget_moments();
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
        while self.owed > 0 && self.running && !self.is_stopped() {
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
        self.go_on();
        let (beat, before) = (self.beat_time(), self.steps());
        let (time, blends, start) = (self.time + beat, self.blends(), Instant::now());
        for lane in &mut self.lanes {
            if blends {
                lane.begin_beat(&mut self.numbers);
            }
            lane.advance_to(time);
        }
        self.stale = true;
        // Where nothing moves, because it has burst, no time has passed.
        let has_moved = self.steps() != before;
        if has_moved {
            self.time = time;
        }
        let is_due = has_moved && self.timeline.pass(beat, start.elapsed());
        for particles in self.grips.let_go(self.time) {
            for lane in &mut self.lanes {
                // Particles of a scene that is gone are refused, rightly.
                let _ = lane.world.apply(Command::Release { particles: particles.clone() });
            }
        }
        let has_burst = self.lanes.iter().any(|lane| lane.world.health().is_diverged());
        if has_burst {
            self.goes_on_once_set = self.running;
            self.running = false;
            self.measure_at = Instant::now();
            self.limit_at = self.measure_at;
        }
        if has_burst || self.is_stopped() {
            if has_moved {
                // No steps lead beyond.
                self.timeline.jump();
                self.keep();
            }
        } else if is_due {
            self.keep();
        }
        self.end_script();
    }

    /// Steps of all lanes.
    fn steps(&self) -> u64 {
        self.lanes.iter().map(|lane| lane.world.steps()).sum()
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
        let (values, posed, numbers) = (self.values, self.grips.posed(), &mut self.numbers);
        let lanes = self.lanes.iter_mut();
        let lanes =
            lanes.map(|lane| Arc::new(lane.state(values, compared.as_deref(), posed, numbers))).collect();
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
            timeline: self.timeline.remembered(),
            replay: self.replay(),
            news: self.news.clone(),
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

    /// What was done to a lane since its start, and where its scene's meshes are.
    pub fn recording(&self, lane: usize) -> Option<(Recording, Place)> {
        let lane = self.lanes.get(lane)?;
        Some((Recording::of(lane.start.clone(), &lane.world), lane.place.clone()))
    }

    /// What is to be written down, should anything have been done since the last time.
    pub fn draft(&mut self) -> Option<Draft> {
        let now: Vec<_> = self.lanes.iter().map(|lane| (lane.world.steps(), lane.world.logged())).collect();
        if now == self.drafted || now.iter().all(|(_, logged)| *logged == 0) {
            return None;
        }
        self.drafted = now;
        let lanes = self.lanes.iter().map(|lane| DraftLane {
            title: lane.title.clone(),
            start: lane.start.clone(),
            place: lane.place.clone(),
            snapshot: lane.world.snapshot(),
        });
        Some(Draft { file: self.file.clone(), lanes: lanes.collect() })
    }

    /// The commands that a lane has taken, with their steps.
    pub fn log(&self, lane: usize) -> Vec<Entry> {
        self.lanes.get(lane).map_or(Vec::new(), |lane| lane.world.log())
    }
}

#[cfg(test)]
mod tests;
