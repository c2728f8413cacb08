//! What runs the lanes: takes orders, advances by wall-clock time, and tells its state. No thread, no clock of its own.
//!
//! Lanes are worlds on the same scene that differ in method, precision or dt. Time passes in beats, as long as the longest dt; at the
//! end of a beat every lane has reached the same simulated time, and only there commands are applied, the same to all.

use std::{
    collections::VecDeque,
    sync::Arc,
    time::{Duration, Instant},
};

use glam::DVec3;

use super::{geometry::Geometry, render::flag};
use crate::{
    scene::{Place, Refusal, Scene},
    target::ImportReport,
    world::{Clock, Command, Entry, Health, Measures, Recording, Snapshot, World},
};

/// What the interface can ask for.
#[derive(Clone, Debug)]
pub enum Order {
    /// Replaces everything by these lanes.
    Open(Vec<LaneSetup>),
    /// Adds a lane: the scene of the first one with another method, from the current state of the first.
    AddLane(Box<LaneSetup>),
    /// Removes a lane; the last one stays.
    RemoveLane(usize),
    /// Applies a command to one lane, or to all.
    Apply(Option<usize>, Command),
    /// Moves what is held to these points over the time of one frame, m.
    Drag(Vec<(u32, DVec3)>),
    /// Runs or pauses.
    Run(bool),
    /// Takes this many beats now; while running it pauses first.
    Step(u32),
    /// Simulated seconds for each second; 1 is real time.
    Speed(f64),
    /// Goes back by about this simulated time, s, as far as is remembered.
    GoBack(f64),
    /// Whether strain by particle is wanted with the state.
    Values(Values),
}

/// What the surface can be coloured by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Values {
    /// Nothing.
    #[default]
    None,
    /// Mean strain of the springs around each particle.
    Strain,
    /// Distance from the lane of this number, m.
    Distance(usize),
}

/// A lane to be opened.
#[derive(Clone, Debug)]
pub struct LaneSetup {
    /// What to call it.
    pub title: String,
    /// What it simulates.
    pub scene: Scene,
    /// Where its meshes are.
    pub place: Place,
}

/// What a lane looks like now.
#[derive(Clone, Debug)]
pub struct LaneState {
    /// What to call it.
    pub title: String,
    /// The scene as it is now, edits included.
    pub scene: Scene,
    /// What is drawn of it.
    pub geometry: Arc<Geometry>,
    /// Positions after the last step, m.
    pub positions: Arc<Vec<[f32; 3]>>,
    /// Positions one step before, where a step takes longer than a picture.
    pub previous: Option<Arc<Vec<[f32; 3]>>>,
    /// Pinned and grabbed bits by particle.
    pub flags: Arc<Vec<u32>>,
    /// Values by particle, if wanted.
    pub values: Option<Arc<Vec<f32>>>,
    /// Simulated time, s.
    pub time: f64,
    /// Steps taken.
    pub steps: u64,
    /// Whether it can be trusted.
    pub health: Health,
    /// Energies and strain.
    pub measures: Measures,
    /// Largest stable dt in theory, s.
    pub dt_limit: Option<f64>,
    /// Seconds of computing for each simulated second.
    pub cost: f64,
    /// Root mean square and largest distance from the reference lane, m.
    pub distance: Option<[f64; 2]>,
    /// Torn springs.
    pub broken: usize,
    /// What the import found.
    pub report: Arc<ImportReport>,
    /// What the user should know.
    pub warnings: Arc<Vec<String>>,
}

/// What the interface sees of the engine.
#[derive(Clone, Debug)]
pub struct State {
    /// Number of orders taken so far.
    pub orders: u64,
    /// Differs for any two states.
    pub version: u64,
    /// Whether time passes.
    pub running: bool,
    /// Simulated seconds for each second that are asked for.
    pub speed: f64,
    /// Simulated seconds for each second that are reached; `None` while paused.
    pub pace: Option<f64>,
    /// Wall-clock time of a beat at the speed asked for.
    pub beat: Duration,
    /// When the last beat was due.
    pub at: Instant,
    /// The lanes.
    pub lanes: Vec<Arc<LaneState>>,
    /// The last order that was refused, with its number and why.
    pub refusal: Option<(u64, String)>,
}

/// Longest time that orders wait while steps are taken.
const PATIENCE: Duration = Duration::from_millis(12);
/// The part of the computing time that may go into measuring.
const MEASURING_SHARE: f64 = 0.1;
/// States remembered for going back, and the simulated time between them, s.
const REMEMBERED: usize = 40;
const REMEMBER_EVERY: f64 = 0.1;
/// Particles above which fewer states are remembered: memory, not time, is the limit.
const REMEMBERED_PARTICLES: usize = 4_000_000;
/// A picture's time: steps longer than this are blended.
const PICTURE: Duration = Duration::from_millis(12);

/// One simulation with what is kept beside it.
struct Lane {
    start: LaneSetup,
    world: World,
    geometry: Arc<Geometry>,
    /// Torn springs that `geometry` leaves out; none once the geometry is out of date.
    shape: Option<usize>,
    previous: Vec<[f32; 3]>,
    measures: Measures,
    dt_limit: Option<f64>,
    warnings: Arc<Vec<String>>,
    remembered: VecDeque<Snapshot>,
    /// Computing time and simulated time since the last state.
    spent: (Duration, f64),
    cost: f64,
}

/// Runs the lanes.
pub struct Engine {
    lanes: Vec<Lane>,
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
    at: Instant,
}

impl Engine {
    /// Opens lanes, paused.
    ///
    /// # Errors
    /// A scene that cannot be built.
    pub fn new(setups: Vec<LaneSetup>) -> Result<Self, Refusal> {
        let now = Instant::now();
        let mut engine = Self {
            lanes: Vec::new(),
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
            at: now,
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

    fn act(&mut self, order: Order) -> Result<(), Refusal> {
        match order {
            Order::Open(setups) => self.open(setups)?,
            Order::AddLane(setup) => {
                let lane = Lane::open(*setup)?;
                self.lanes.push(lane);
                self.time = 0.0;
                self.restart_all()?;
            }
            Order::RemoveLane(lane) => {
                if self.lanes.len() > 1 && lane < self.lanes.len() {
                    self.lanes.remove(lane);
                }
            }
            Order::Apply(lane, command) => self.apply(lane, &command)?,
            Order::Drag(to) => {
                let frame = self.clock.speed / 60.0;
                for lane in &mut self.lanes {
                    let dt = lane.world.scene().dt;
                    let steps = if dt > 0.0 { (frame / dt).round().max(1.0) as u32 } else { 1 };
                    for &(particle, to) in &to {
                        lane.world.apply(Command::Drag { particle, to, steps })?;
                    }
                }
            }
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
            Order::GoBack(seconds) => self.go_back(seconds),
            Order::Values(values) => self.values = values,
        }
        Ok(())
    }

    fn open(&mut self, setups: Vec<LaneSetup>) -> Result<(), Refusal> {
        // Built before the old ones go: a refused scene leaves everything as it was.
        self.lanes = setups.into_iter().map(Lane::open).collect::<Result<_, _>>()?;
        self.time = 0.0;
        self.rest();
        Ok(())
    }

    fn apply(&mut self, only: Option<usize>, command: &Command) -> Result<(), Refusal> {
        let chosen = |lane: usize| only.is_none_or(|only| only == lane);
        let mut result = Ok(());
        for (_, lane) in self.lanes.iter_mut().enumerate().filter(|(i, _)| chosen(*i)) {
            result = result.and(lane.world.apply(command.clone()));
            lane.warnings = Arc::new(lane.world.warnings());
            match command {
                Command::Reset => {
                    lane.remembered.clear();
                    lane.shape = None;
                }
                Command::Set { key, .. } if key.starts_with("target") => lane.shape = None,
                _ => {}
            }
        }
        if *command == Command::Reset {
            self.time = 0.0;
            self.rest();
        }
        self.measure_at = Instant::now();
        result
    }

    /// Puts every lane to its start, so that they run side by side.
    fn restart_all(&mut self) -> Result<(), Refusal> {
        self.apply(None, &Command::Reset)
    }

    fn go_back(&mut self, seconds: f64) {
        for lane in &mut self.lanes {
            let steps =
                if lane.world.scene().dt > 0.0 { (seconds / lane.world.scene().dt) as u64 } else { 0 };
            let wanted = lane.world.steps().saturating_sub(steps);
            while lane.remembered.len() > 1 && lane.remembered.back().is_some_and(|s| s.step() > wanted) {
                lane.remembered.pop_back();
            }
            if let Some(snapshot) = lane.remembered.back() {
                lane.world.restore(snapshot);
                lane.shape = None;
            }
        }
        self.time = self.lanes.iter().map(|lane| lane.world.time()).fold(0.0, f64::max);
        self.running = false;
        self.rest();
        self.measure_at = Instant::now();
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

    /// Length of a beat: the longest dt, s.
    fn beat_time(&self) -> f64 {
        self.lanes.iter().map(|lane| lane.world.scene().dt).fold(0.0, f64::max)
    }

    /// Takes the steps that are due after `elapsed`, but returns early for orders that `wait`. True if anything moved.
    pub fn advance(&mut self, elapsed: Duration, wait: impl Fn() -> bool) -> bool {
        if !self.running {
            return false;
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
        if !self.running {
            return Duration::from_secs(1);
        }
        let wall = self.beat_time() / self.clock.speed;
        if self.owed > 0 { Duration::ZERO } else { Duration::from_secs_f64(wall.clamp(0.0005, 0.05) / 2.0) }
    }

    fn beat(&mut self) {
        self.time += self.beat_time();
        let (time, blends) = (self.time, self.blends());
        let particles: usize = self.lanes.iter().map(|lane| lane.geometry.particles as usize).sum();
        let keep = (REMEMBERED_PARTICLES / particles.max(1)).clamp(1, REMEMBERED);
        for lane in &mut self.lanes {
            let start = Instant::now();
            let before = lane.world.time();
            let dt = lane.world.scene().dt;
            if blends {
                lane.world.positions_f32(&mut lane.previous);
            }
            while dt > 0.0 && lane.world.time() + dt <= time * (1.0 + 1e-12) + 1e-12 {
                let steps = lane.world.steps();
                lane.world.step();
                if lane.world.steps() == steps {
                    break;
                }
            }
            lane.spent.0 += start.elapsed();
            lane.spent.1 += lane.world.time() - before;
            lane.remember(keep);
        }
        if self.lanes.iter().any(|lane| lane.world.health().is_diverged()) {
            self.running = false;
            self.measure_at = Instant::now();
        }
    }

    fn blends(&self) -> bool {
        Duration::from_secs_f64((self.beat_time() / self.clock.speed).clamp(0.0, 1e6)) > PICTURE
    }

    /// What the interface is to see now.
    pub fn state(&mut self) -> State {
        self.version += 1;
        self.measure();
        let reference = match self.values {
            Values::Distance(lane) => lane,
            _ => 0,
        };
        let compared = (self.lanes.len() > 1 || matches!(self.values, Values::Distance(_)))
            .then(|| self.lanes.get(reference).map(|lane| lane.world.positions()))
            .flatten();
        let (values, geometries) = (self.values, &mut self.geometries);
        let lanes = self.lanes.iter_mut();
        let lanes = lanes.map(|lane| Arc::new(lane.state(values, compared.as_deref(), geometries))).collect();
        let wall = (self.beat_time() / self.clock.speed).clamp(0.0, 1e6);
        State {
            orders: self.orders,
            version: self.version,
            running: self.running,
            speed: self.clock.speed,
            pace: self.running.then(|| self.pace.value()).flatten(),
            beat: Duration::from_secs_f64(wall),
            at: self.at,
            lanes,
            refusal: self.refusal.clone(),
        }
    }

    /// Energies and limits cost a pass over the springs or more: they are refreshed as seldom as keeps their share small.
    fn measure(&mut self) {
        let start = Instant::now();
        if start < self.measure_at {
            return;
        }
        for lane in &mut self.lanes {
            lane.measure();
        }
        let pause = start.elapsed().as_secs_f64() / MEASURING_SHARE;
        self.measure_at = Instant::now() + Duration::from_secs_f64(pause.clamp(0.03, 5.0));
    }

    /// What was done to a lane since it was opened, and where its scene's meshes are.
    pub fn recording(&self, lane: usize) -> Option<(Recording, Place)> {
        let Lane { start, world, .. } = self.lanes.get(lane)?;
        Some((Recording::of(start.scene.clone(), world), start.place.clone()))
    }

    /// The commands that a lane has taken, with their steps.
    pub fn log(&self, lane: usize) -> &[Entry] {
        self.lanes.get(lane).map_or(&[], |lane| lane.world.log())
    }
}

impl Lane {
    fn open(setup: LaneSetup) -> Result<Self, Refusal> {
        let world = World::new(setup.scene.clone(), setup.place.clone()).map_err(|e| e.at(&setup.title))?;
        let mut lane = Self {
            start: setup,
            geometry: Arc::default(),
            shape: None,
            previous: Vec::new(),
            measures: Measures::default(),
            dt_limit: None,
            warnings: Arc::new(world.warnings()),
            remembered: VecDeque::new(),
            spent: (Duration::ZERO, 0.0),
            cost: 0.0,
            world,
        };
        lane.measure();
        lane.remember(usize::MAX);
        Ok(lane)
    }

    fn measure(&mut self) {
        self.measures = self.world.measures();
        self.dt_limit = self.world.dt_limit(&self.world.spectrum());
        if self.spent.1 > 0.0 {
            let now = self.spent.0.as_secs_f64() / self.spent.1;
            self.cost = if self.cost == 0.0 { now } else { 0.7 * self.cost + 0.3 * now };
            self.spent = (Duration::ZERO, 0.0);
        }
    }

    fn remember(&mut self, most: usize) {
        let dt = self.world.scene().dt.max(1e-9);
        let apart = (REMEMBER_EVERY / dt).max(1.0) as u64;
        if self.remembered.back().is_none_or(|last| self.world.steps() >= last.step() + apart) {
            self.remembered.push_back(self.world.snapshot());
            while self.remembered.len() > most {
                self.remembered.pop_front();
            }
        }
    }

    fn state(&mut self, values: Values, reference: Option<&[DVec3]>, geometries: &mut u64) -> LaneState {
        let world = &self.world;
        // Between commands springs only tear: their number tells.
        let shape = Some(world.broken().len());
        if shape != self.shape {
            *geometries += 1;
            self.geometry = Arc::new(Geometry::of(world, *geometries));
            self.shape = shape;
        }
        let mut positions = Vec::new();
        world.positions_f32(&mut positions);
        let mut flags: Vec<u32> =
            world.pinned().iter().map(|pinned| if *pinned { flag::PINNED } else { 0 }).collect();
        for particle in world.held() {
            flags[particle as usize] |= flag::GRABBED;
        }
        let apart = reference.filter(|r| r.len() == positions.len()).map(|reference| {
            let own = world.positions();
            own.iter().zip(reference).map(|(a, b)| a.distance(*b)).collect::<Vec<f64>>()
        });
        let distance = apart.as_ref().map(|apart| {
            let square = apart.iter().map(|d| d * d).sum::<f64>() / apart.len().max(1) as f64;
            [square.sqrt(), apart.iter().copied().fold(0.0, f64::max)]
        });
        let values = match values {
            Values::None => None,
            Values::Strain => Some(Arc::new(strain_by_particle(world))),
            Values::Distance(_) => apart.map(|apart| Arc::new(apart.iter().map(|d| *d as f32).collect())),
        };
        let previous = (self.previous.len() == positions.len()).then(|| Arc::new(self.previous.clone()));
        LaneState {
            title: self.start.title.clone(),
            scene: world.scene().clone(),
            geometry: Arc::clone(&self.geometry),
            positions: Arc::new(positions),
            previous,
            flags: Arc::new(flags),
            values,
            time: world.time(),
            steps: world.steps(),
            health: world.health(),
            measures: self.measures,
            dt_limit: self.dt_limit,
            cost: self.cost,
            distance,
            broken: world.broken().len(),
            report: Arc::new(world.report().clone()),
            warnings: Arc::clone(&self.warnings),
        }
    }
}

/// The mean strain of the acting springs around each particle.
fn strain_by_particle(world: &World) -> Vec<f32> {
    let mut strains = Vec::new();
    world.strains(&mut strains);
    let pairs = &world.topology().pairs;
    let starts = [0, pairs[0].len(), pairs[0].len() + pairs[1].len()];
    let pair_of = |id: usize| {
        let kind = starts.iter().rposition(|start| id >= *start).unwrap_or(0);
        pairs[kind][id - starts[kind]]
    };
    let mut sums = vec![(0.0_f32, 0_u32); world.mesh().positions.len()];
    for &(id, strain) in &strains {
        for particle in pair_of(id as usize) {
            let sum = &mut sums[particle as usize];
            *sum = (sum.0 + strain, sum.1 + 1);
        }
    }
    sums.into_iter().map(|(sum, count)| if count > 0 { sum / count as f32 } else { 0.0 }).collect()
}

/// How much simulated time passes in a second, over the last moments.
#[derive(Clone, Copy, Debug, Default)]
struct Pace {
    wall: f64,
    simulated: f64,
}

impl Pace {
    fn count(&mut self, wall: Duration, simulated: f64) {
        self.wall += wall.as_secs_f64();
        self.simulated += simulated;
        // A window that forgets: about the last second.
        if self.wall > 1.0 {
            self.wall *= 0.5;
            self.simulated *= 0.5;
        }
    }

    fn value(self) -> Option<f64> {
        (self.wall > 0.2).then(|| self.simulated / self.wall)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setup(ron: &str) -> LaneSetup {
        let scene = Scene::from_ron(ron).expect("a scene");
        LaneSetup { title: "test".to_owned(), scene, place: Place::default() }
    }

    fn engine(scenes: &[&str]) -> Engine {
        Engine::new(scenes.iter().map(|ron| setup(ron)).collect()).expect("opens")
    }

    #[test]
    fn two_identical_lanes_stay_equal_while_dragged() {
        let mut engine = engine(&["()", "()"]);
        engine.take(Order::Values(Values::Distance(0)));
        engine.take(Order::Apply(None, Command::Grab { particles: vec![312] }));
        for i in 0..20 {
            engine.take(Order::Drag(vec![(312, DVec3::new(0.1 * f64::from(i), 2.0, 0.0))]));
            engine.take(Order::Step(3));
        }
        let state = engine.state();
        assert_eq!(state.lanes[1].distance, Some([0.0, 0.0]));
        assert!(state.lanes[0].positions[312][1] > 1.0);
        assert_eq!(state.refusal, None);
    }

    #[test]
    fn lanes_of_different_dt_reach_the_same_times() {
        let mut engine = engine(&["(dt: 0.01)", "(dt: 0.002)", "(dt: 0.003)"]);
        engine.take(Order::Step(30));
        let times = engine.state().lanes.iter().map(|lane| lane.time).collect::<Vec<_>>();
        assert!((times[0] - 0.3).abs() < 1e-9 && (times[1] - 0.3).abs() < 1e-9, "{times:?}");
        assert!((times[2] - 0.3).abs() < 0.003, "{times:?}");
    }

    #[test]
    fn a_refused_order_changes_nothing_and_is_told() {
        let mut engine = engine(&["()"]);
        engine.take(Order::Apply(None, Command::Set { key: "dt".to_owned(), value: "-1".to_owned() }));
        let state = engine.state();
        assert_eq!(state.lanes[0].scene, Scene::default());
        assert_eq!(state.refusal.map(|(order, _)| order), Some(1));
    }

    #[test]
    fn time_passes_only_while_running_and_at_the_speed_asked_for() {
        let mut engine = engine(&["()"]);
        assert!(!engine.advance(Duration::from_millis(100), || false));
        engine.take(Order::Run(true));
        engine.take(Order::Speed(0.5));
        for _ in 0..10 {
            engine.advance(Duration::from_millis(100), || false);
        }
        let time = engine.state().lanes[0].time;
        assert!((time - 0.5).abs() < 0.021, "{time}");
    }

    #[test]
    fn a_burst_pauses_and_going_back_gives_a_good_state() {
        let mut engine = engine(&["(simulator: (id: \"explicit_euler\", params: {}), dt: 0.05)"]);
        engine.take(Order::Run(true));
        for _ in 0..2000 {
            engine.advance(Duration::from_millis(50), || false);
            if !engine.running {
                break;
            }
        }
        let burst = engine.state();
        assert!(burst.lanes[0].health.is_diverged() && !burst.running);
        engine.take(Order::GoBack(0.5));
        let back = engine.state();
        assert!(back.lanes[0].time < burst.lanes[0].time && !back.lanes[0].health.is_diverged());
    }
}
