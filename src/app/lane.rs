//! One simulation of the engine, with what is kept beside it for the interface.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::Arc,
    time::{Duration, Instant},
};

use glam::DVec3;

use super::{
    camera::Bounds,
    changes::changes,
    geometry::Geometry,
    order::{LaneSetup, LaneState, Limit, Moment, Origin, Values},
    render::flag,
};
use crate::{
    forces::Spectrum,
    scene::{Place, Refusal, Scene},
    target::ImportReport,
    world::{Command, Entry, Measures, Play, Snapshot, World},
};

/// Particles from which on several threads step a cloth: below, telling them costs more than they do.
const MANY: usize = 10_000;
/// Most steps of a lane in a beat: orders wait for its end, however much shorter than the longest a dt may be.
pub(super) const STEPS_OF_A_BEAT: u32 = 1000;
/// More threads than these only wait for memory.
const MOST_THREADS: usize = 8;

/// A simulation.
pub(super) struct Lane {
    pub title: String,
    pub world: World,
    /// The scene that the world's commands begin with.
    pub start: Scene,
    pub place: Place,
    pub geometry: Arc<Geometry>,
    /// Torn springs that `geometry` leaves out; none once the geometry is out of date.
    pub shape: Option<usize>,
    /// Where the beat that was taken last began.
    pub previous: Option<Moment>,
    /// What was told last, after how many steps; none once particles were put elsewhere without one.
    told: Option<(u64, Moment)>,
    /// What is done by itself, as it was to another cloth.
    pub play: Option<Play>,
    /// Computing time and simulated time since the last measurement.
    pub spent: (Duration, f64),
    measures: Measures,
    limit: Limit,
    /// What is being searched for a newer limit, or where the last search ended.
    spectrum: Option<Spectrum>,
    is_searching: bool,
    warnings: Arc<Vec<String>>,
    report: Arc<ImportReport>,
    mass: f64,
    cost: f64,
}

impl Lane {
    pub fn open(setup: LaneSetup, threads: Option<usize>) -> Result<Self, Refusal> {
        let LaneSetup { title, scene, place, origin, .. } = setup;
        let script = if let Origin::Script(script) = &origin { Some(Arc::clone(script)) } else { None };
        let (start, world) = match origin {
            Origin::Saved(saved) => saved.resume(),
            _ => World::new(scene.clone(), place.clone()).map(|world| (scene, world)),
        }
        .map_err(|e| e.at(&title))?;
        let mut lane = Self::of(title, start, world, place);
        if let Some(script) = script {
            lane.play = Some(Play::new(script, &lane.world, Vec::new()));
        }
        // Whoever held something is gone.
        lane.let_go();
        lane.begin(threads)?;
        Ok(lane)
    }

    /// A lane that goes on from this one's state.
    pub fn branch(
        &self,
        title: String,
        settings: Vec<(String, String)>,
        threads: Option<usize>,
    ) -> Result<Self, Refusal> {
        let world = World::resume(&self.world.snapshot(), self.place.clone())?;
        let mut lane = Self::of(title, self.start.clone(), world, self.place.clone());
        lane.play.clone_from(&self.play);
        lane.set(settings)?;
        lane.begin(threads)?;
        Ok(lane)
    }

    /// Makes settings by hand; a script that is played does not undo them.
    pub fn set(&mut self, settings: Vec<(String, String)>) -> Result<(), Refusal> {
        for (key, value) in settings {
            if let Some(play) = &mut self.play {
                play.choose(&key);
            }
            self.apply(&Command::Set { key, value })?;
        }
        Ok(())
    }

    fn begin(&mut self, threads: Option<usize>) -> Result<(), Refusal> {
        self.set_threads(threads)?;
        self.refresh();
        self.measure();
        Ok(())
    }

    fn of(title: String, start: Scene, world: World, place: Place) -> Self {
        Self {
            title,
            world,
            start,
            place,
            geometry: Arc::default(),
            shape: None,
            previous: None,
            told: None,
            play: None,
            spent: (Duration::ZERO, 0.0),
            measures: Measures::default(),
            limit: Limit::Unknown,
            spectrum: None,
            is_searching: false,
            warnings: Arc::default(),
            report: Arc::default(),
            mass: 0.0,
            cost: 0.0,
        }
    }

    fn set_threads(&mut self, wanted: Option<usize>) -> Result<(), Refusal> {
        if let Some(threads) = wanted {
            return self.world.set_threads(threads);
        }
        if self.world.mesh().positions.len() >= MANY {
            let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
            // Fewer threads give the same result, only later.
            let _ = self.world.set_threads((cores - 1).clamp(1, MOST_THREADS));
        }
        Ok(())
    }

    /// Where the particles are now: what was told last, as long as no step has moved them since.
    fn now(&mut self, numbers: &mut u64) -> Moment {
        let steps = self.world.steps();
        if let Some((told, moment)) = &self.told
            && *told == steps
        {
            return moment.clone();
        }
        let moment = Moment::new(&self.world, &BTreeMap::new(), numbers);
        self.told = Some((steps, moment.clone()));
        moment
    }

    /// Keeps where the particles are before a beat.
    pub fn begin_beat(&mut self, numbers: &mut u64) {
        self.previous = Some(self.now(numbers));
    }

    /// Forgets where the particles were: they have not come from there.
    pub fn forget_moments(&mut self) {
        (self.previous, self.told) = (None, None);
    }

    /// Takes over what changes with commands only.
    pub fn refresh(&mut self) {
        self.warnings = Arc::new(self.world.warnings());
        self.report = Arc::new(self.world.report().clone());
        let masses = self.world.scene().mass.of(self.world.mesh());
        self.mass = masses.map_or(0.0, |masses| masses.iter().sum());
    }

    /// A pass over the springs: energies, strain, cost.
    pub fn measure(&mut self) {
        self.measures = self.world.measures();
        if self.spent.1 > 0.0 {
            let now = self.spent.0.as_secs_f64() / self.spent.1;
            self.cost = if self.cost == 0.0 { now } else { 0.7 * self.cost + 0.3 * now };
            self.spent = (Duration::ZERO, 0.0);
        }
    }

    /// Looks for the largest stable dt, a few passes over the springs at a time; true once it is found.
    pub fn search_limit(&mut self) -> bool {
        /// Particles that are passed over before the search is put off.
        const PARTICLES: usize = 100_000;
        if !self.is_searching {
            self.spectrum = Some(self.world.spectrum().in_parts(self.spectrum.take()));
            self.is_searching = true;
        }
        let Some(spectrum) = &self.spectrum else { return true };
        spectrum.allow((PARTICLES / self.world.pinned().len().max(1)).clamp(1, 1000));
        let limit = self.world.dt_limit(spectrum);
        if spectrum.is_settled() {
            self.limit = limit.map_or(Limit::None, Limit::At);
            self.is_searching = false;
        }
        !self.is_searching
    }

    /// Forgets a search whose question has changed. Where the method is another one, so is its limit.
    pub fn restart_search(&mut self, key: &str) {
        self.is_searching = false;
        if key.starts_with("simulator") {
            self.limit = Limit::Unknown;
        }
    }

    /// Whether nothing is known of the limit yet.
    pub fn lacks_limit(&self) -> bool {
        self.limit == Limit::Unknown
    }

    /// Takes a command, and takes over what it changes. True if its time has gone back.
    pub fn apply(&mut self, command: &Command) -> Result<bool, Refusal> {
        let before = self.world.time();
        let done = self.world.apply(command.clone());
        if !matches!(command, Command::Drag { .. }) {
            self.told = None;
        }
        match command {
            Command::Set { key, .. } => {
                self.restart_search(key);
                if key.starts_with("target") {
                    self.shape = None;
                }
            }
            Command::Reset => self.shape = None,
            _ => {}
        }
        done?;
        if matches!(command, Command::Set { .. } | Command::Pin { .. } | Command::Free { .. }) {
            self.refresh();
        }
        Ok(self.world.time() < before)
    }

    /// The time that a beat compares: that of the script while one is played, since a reset does not turn it back.
    pub fn clock(&self) -> f64 {
        self.play.as_ref().map_or(self.world.time(), |play| play.time(&self.world))
    }

    /// Whether another step would not pass a time.
    fn has_room(&self, time: f64) -> bool {
        let dt = self.world.scene().dt;
        // Both times are rounded, and a dt far below their last digit moves neither.
        dt > 0.0 && self.clock() + dt <= time * (1.0 + 1e-12) + 1e-6 * dt
    }

    /// Takes the steps of a beat, up to a time. `act` does before each what is to be done, and says whether there is to be one.
    fn steps_to(&mut self, time: f64, mut act: impl FnMut(&mut Self) -> bool + Send) {
        self.world.threads().run(|| {
            for _ in 0..STEPS_OF_A_BEAT {
                if !(self.has_room(time) && act(self) && self.has_room(time)) {
                    break;
                }
                let steps = self.world.steps();
                self.world.step();
                if self.world.steps() == steps {
                    break;
                }
            }
        });
    }

    /// Takes the steps up to a time, with what the script says.
    pub fn advance_to(&mut self, time: f64) {
        let (start, before) = (Instant::now(), self.world.time());
        self.steps_to(time, |lane| {
            lane.follow_script();
            !lane.has_played()
        });
        self.spent.0 += start.elapsed();
        self.spent.1 += (self.world.time() - before).max(0.0);
    }

    fn follow_script(&mut self) {
        while let Some(command) = self.play.as_mut().and_then(|play| play.due(&self.world)) {
            // What does not fit this cloth is left out: a hand on a particle that is not there.
            let _ = self.apply(&command);
        }
    }

    /// Whether its script has come to its end.
    pub fn has_played(&self) -> bool {
        self.play.as_ref().is_some_and(|play| play.is_over(&self.world))
    }

    /// Takes the steps up to a time as they were taken once, with the commands that were logged.
    pub fn repeat_to(&mut self, time: f64, logged: &mut VecDeque<Entry>) {
        self.steps_to(time, |lane| {
            lane.repeat_commands(logged);
            !lane.has_played()
        });
    }

    /// Does again what was logged before the next step.
    pub fn repeat_commands(&mut self, logged: &mut VecDeque<Entry>) {
        while let Some(entry) = logged.pop_front_if(|entry| entry.step <= self.world.steps()) {
            // Whatever of it the script did goes on in the script.
            if let Some(mut ahead) = self.play.clone()
                && ahead.due(&self.world).as_ref() == Some(&entry.command)
            {
                self.play = Some(ahead);
            }
            // Accepted once, it is accepted again.
            let _ = self.apply(&entry.command);
        }
    }

    /// Opens all hands.
    pub fn let_go(&mut self) {
        let particles: Vec<u32> = self.world.held().collect();
        if !particles.is_empty() {
            // Only particles that are held are named.
            let _ = self.world.apply(Command::Release { particles });
        }
    }

    /// Goes to a state.
    pub fn restore(&mut self, snapshot: &Snapshot, play: Option<Play>) {
        self.world.restore(snapshot);
        self.play = play;
        self.shape = None;
        self.forget_moments();
        self.restart_search("simulator");
        self.refresh();
    }

    /// Sets what a newer scene of the same target has set.
    pub fn adopt(&mut self, scene: &Scene) {
        for (key, value, _) in changes(self.world.scene(), scene).unwrap_or_default() {
            // Accepted once, it is accepted again.
            let _ = self.world.apply(Command::Set { key, value });
        }
    }

    /// What the interface sees. `posed` are held particles whose hand has moved while no time passed.
    pub fn state(
        &mut self,
        values: Values,
        reference: Option<&[DVec3]>,
        posed: &BTreeMap<u32, DVec3>,
        numbers: &mut u64,
    ) -> LaneState {
        let moment =
            if posed.is_empty() { self.now(numbers) } else { Moment::new(&self.world, posed, numbers) };
        let Moment { version, positions, bounds } = moment;
        let world = &self.world;
        // Between commands springs only tear: their number tells.
        let shape = Some(world.broken().len());
        if shape != self.shape {
            *numbers += 1;
            self.geometry = Arc::new(Geometry::of(world, *numbers));
            self.shape = shape;
        }
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
            Values::Distance => apart.map(|apart| Arc::new(apart.iter().map(|d| *d as f32).collect())),
        };
        let previous = self.previous.clone().filter(|before| before.positions.len() == positions.len());
        LaneState {
            title: self.title.clone(),
            scene: world.scene().clone(),
            geometry: Arc::clone(&self.geometry),
            previous,
            pinned: world.pinned().iter().filter(|pinned| **pinned).count(),
            flags: Arc::new(flags),
            values,
            time: world.time(),
            steps: world.steps(),
            health: world.health(),
            measures: self.measures,
            limit: self.limit,
            cost: self.cost,
            distance,
            broken: world.broken().len(),
            mass: self.mass,
            report: Arc::clone(&self.report),
            warnings: Arc::clone(&self.warnings),
            version,
            positions,
            bounds,
        }
    }
}

impl Moment {
    /// Where a world's particles are now, those that a hand has moved meanwhile where it holds them.
    fn new(world: &World, posed: &BTreeMap<u32, DVec3>, numbers: &mut u64) -> Self {
        *numbers += 1;
        let mut positions = Vec::new();
        world.positions_f32(&mut positions);
        for (particle, to) in posed {
            if let Some(position) = positions.get_mut(*particle as usize) {
                *position = to.as_vec3().to_array();
            }
        }
        let bounds = Bounds::of(positions.iter());
        Self { version: *numbers, positions: Arc::new(positions), bounds }
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
