//! Opening and saving: scenes and meshes are read and written on threads of their own, so that the interface never waits.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    sync::mpsc::{Receiver, TryRecvError, channel},
    time::{Duration, Instant},
};

use super::{
    order::{LaneSetup, Order, Origin},
    preferences::Preferences,
    session::Session,
};
use crate::{
    export::Format,
    scene::{self, Mass, Opened, Pending, Place, Refusal, Scene, Target, read_limited, to_ron},
    world::{Recording, Script, World},
};

/// Endings of files that can be opened.
const SCENES: [&str; 1] = ["ron"];
const MESHES: [&str; 3] = ["obj", "gltf", "glb"];

/// What a file dialog of the system is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A scene or mesh to open.
    Open,
    /// Where to save the scene.
    Save,
    /// Where to save the recording.
    Record,
    /// A recording to play.
    Replay,
    /// Where to export to.
    Export,
}

/// What comes after a question was answered, or a file was saved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Next {
    /// A new scene.
    New,
    /// Ask for a file to open.
    Ask,
    /// Open a file or a built-in scene.
    Open(String),
    /// Play a recording.
    Replay(PathBuf),
    /// Close the window.
    Quit,
}

/// What was read.
enum Loaded {
    Scene(Opened),
    Recording(LaneSetup),
}

/// Nobody cancels a dialog faster than this: there was none.
const HURRIED: Duration = Duration::from_millis(400);

/// Keys of a scene, with values.
type Settings = Vec<(String, String)>;

/// Work on a thread of its own.
pub(super) struct Job<T>(Receiver<T>);

impl<T: Send + 'static> Job<T> {
    /// Starts; without a window to wake, the work is done at once.
    pub(super) fn start(window: Option<&egui::Context>, work: impl FnOnce() -> T + Send + 'static) -> Self {
        let (sender, receiver) = channel();
        if let Some(window) = window.cloned() {
            // A thread that does not start drops the sender: the job then ends without an answer.
            let _ = std::thread::Builder::new().name("files".to_owned()).spawn(move || {
                // Nobody waits any more: then nobody needs the answer.
                let _ = sender.send(work());
                window.request_repaint();
            });
        } else {
            let _ = sender.send(work());
        }
        Self(receiver)
    }

    /// The answer, or why there is none: not yet, or never.
    fn answer(&self) -> Result<T, TryRecvError> {
        self.0.try_recv()
    }
}

/// Takes the answer of a job, and the job away once it has ended.
pub(super) fn take<T: Send + 'static>(job: &mut Option<Job<T>>) -> Option<T> {
    let answer = job.as_ref()?.answer();
    if !matches!(answer, Err(TryRecvError::Empty)) {
        *job = None;
    }
    answer.ok()
}

/// What is being opened and saved.
#[derive(Default)]
pub struct Files {
    /// What is remembered.
    pub preferences: Preferences,
    /// What was to be opened last.
    asked: String,
    /// What could not be opened, and why.
    pub refused: Option<(String, String)>,
    is_told: bool,
    /// The system was asked for a file dialog and has none.
    pub lacks_dialog: bool,
    window: Option<egui::Context>,
    loading: Option<(String, Job<Result<Loaded, Refusal>>)>,
    saving: Option<Job<(PathBuf, Result<(), Refusal>)>>,
    picking: Option<(Purpose, Instant, Job<Option<PathBuf>>)>,
    after_saving: Option<Next>,
    cotton: Option<(Target, Job<Result<Settings, Refusal>>)>,
}

impl Files {
    /// Files with what was remembered.
    pub fn new(preferences: Preferences) -> Self {
        Self { preferences, ..Self::default() }
    }

    /// Works on threads from now on, and wakes this window.
    pub fn attach(&mut self, window: &egui::Context) {
        self.window = Some(window.clone());
    }

    /// Opens a scene, a mesh or a built-in scene by name.
    pub fn open(&mut self, name: &str) {
        name.clone_into(&mut self.asked);
        self.refused = None;
        let meshes = self.preferences.meshes.clone();
        let wanted = name.to_owned();
        let job = Job::start(self.window.as_ref(), move || load(&wanted, &meshes).map(Loaded::Scene));
        self.loading = Some((name.to_owned(), job));
    }

    /// Opens a recording, to be played.
    pub fn replay(&mut self, path: &Path) {
        let (path, meshes) = (path.to_owned(), self.preferences.meshes.clone());
        let name = path.display().to_string();
        let job =
            Job::start(self.window.as_ref(), move || load_recording(&path, &meshes).map(Loaded::Recording));
        self.loading = Some((name, job));
    }

    /// What was opened last is no cloth.
    pub fn refuse(&mut self, why: &str) {
        self.refused = Some((self.asked.clone(), why.to_owned()));
        self.is_told = false;
    }

    /// What could not be opened, once.
    pub fn take_refused(&mut self) -> Option<String> {
        let (name, _) = self.refused.as_ref().filter(|_| !self.is_told)?;
        self.is_told = true;
        Some(name.clone())
    }

    /// What is being read.
    pub fn loading(&self) -> Option<&str> {
        self.loading.as_ref().map(|(name, _)| name.as_str())
    }

    /// Gives up what is being read.
    pub fn give_up_loading(&mut self) {
        self.loading = None;
    }

    /// Makes the open mesh light cotton, as one edit, once it is known which step holds then.
    pub fn make_cotton(&mut self, session: &Session) {
        let (scene, place) = (session.scene().clone(), session.place());
        let target = scene.target.clone();
        self.cotton = Some((target, Job::start(self.window.as_ref(), move || light_cotton(scene, place))));
    }

    /// Whether that is under way.
    pub fn is_making_cotton(&self) -> bool {
        self.cotton.is_some()
    }

    /// Writes the first lane's scene, and then does what comes next.
    pub fn save(&mut self, session: &Session, path: &Path, next: Option<Next>) {
        let Some(scene) = session.scenes().first() else { return };
        let path = with_ending(path);
        let scene = session.place().moved(scene, path.parent().unwrap_or(Path::new(".")));
        self.after_saving = next;
        self.saving = Some(Job::start(self.window.as_ref(), move || {
            let written = write(&scene, &path);
            (path, written)
        }));
    }

    /// Writes a recording.
    pub fn record(session: &mut Session, path: &Path) {
        let path = with_ending(path);
        session.message = Some(format!("recording saved: {}", path.display()));
        session.order(Order::Record(path));
    }

    /// Asks the system for a file. Where it has no dialog nothing comes of it: the path field is there too.
    pub fn pick(&mut self, purpose: Purpose, proposed: &Path) {
        let mut dialog = rfd::AsyncFileDialog::new();
        if let Some(folder) = proposed.parent().filter(|folder| folder.is_dir()) {
            dialog = dialog.set_directory(folder);
        }
        let name = proposed.file_name().unwrap_or_default().to_string_lossy();
        // Made here, as some systems want it, but waited for elsewhere.
        let job = match purpose {
            Purpose::Open => {
                let all: Vec<&str> = SCENES.iter().chain(&MESHES).copied().collect();
                self.wait_for(dialog.add_filter("Scenes and meshes", &all).pick_file())
            }
            Purpose::Replay => self.wait_for(dialog.add_filter("Recordings", &SCENES).pick_file()),
            Purpose::Save | Purpose::Record => {
                self.wait_for(dialog.add_filter("RON", &SCENES).set_file_name(name).save_file())
            }
            Purpose::Export => {
                let formats = Format::ALL.map(|(extension, _)| extension);
                self.wait_for(dialog.add_filter("Motion", &formats).set_file_name(name).save_file())
            }
        };
        self.picking = Some((purpose, Instant::now(), job));
    }

    fn wait_for(
        &self,
        answer: impl Future<Output = Option<rfd::FileHandle>> + Send + 'static,
    ) -> Job<Option<PathBuf>> {
        let work = move || pollster::block_on(answer).map(|file| file.path().to_owned());
        Job::start(self.window.as_ref(), work)
    }

    /// Whether a dialog of the system is open.
    pub fn is_picking(&self) -> bool {
        self.picking.is_some()
    }

    /// Takes what the threads have done. Returns what was picked, and what comes next.
    pub fn poll(&mut self, session: &mut Session) -> (Option<(Purpose, PathBuf)>, Option<Next>) {
        if let Some((_, job)) = &self.loading {
            match job.answer() {
                Ok(Ok(Loaded::Scene(opened))) => self.has_loaded(session, opened),
                Ok(Ok(Loaded::Recording(setup))) => {
                    self.loading = None;
                    session.open(vec![setup]);
                }
                Ok(Err(refusal)) => {
                    let why = refusal.to_string();
                    if self.loading.take().is_some_and(|(name, _)| name == self.asked) {
                        self.refuse(&why);
                    }
                    session.message = Some(why);
                }
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Disconnected) => {
                    session.message = Some("the system gives no thread to read files".to_owned());
                    self.loading = None;
                }
            }
        }
        if let Some((target, job)) = self.cotton.take() {
            match job.answer() {
                Err(TryRecvError::Empty) => self.cotton = Some((target, job)),
                // Another target has been opened meanwhile: then nobody wants it any more.
                Ok(Ok(settings)) if session.scene().target == target => {
                    if let Ok(changes) = values_in(session.scene(), settings) {
                        session.set_all(None, "light cotton", &changes);
                        session.end_edit();
                    }
                }
                Ok(Err(refusal)) => session.message = Some(refusal.to_string()),
                Ok(Ok(_)) | Err(TryRecvError::Disconnected) => {}
            }
        }
        let mut next = None;
        match take(&mut self.saving) {
            Some((path, Ok(()))) => {
                self.preferences.remember(&path);
                session.has_saved(path);
                next = self.after_saving.take();
            }
            Some((_, Err(refusal))) => {
                session.message = Some(refusal.to_string());
                self.after_saving = None;
            }
            None => {}
        }
        let answer = self.picking.as_ref().map(|(purpose, since, job)| (*purpose, *since, job.answer()));
        let picked = match answer {
            Some((.., Err(TryRecvError::Empty))) | None => None,
            Some((purpose, since, answer)) => {
                self.picking = None;
                let picked = answer.ok().flatten().map(|path| (purpose, path));
                self.lacks_dialog = picked.is_none() && since.elapsed() < HURRIED;
                picked
            }
        };
        (picked, next)
    }

    fn has_loaded(&mut self, session: &mut Session, opened: Opened) {
        self.loading = None;
        if let Some(file) = &opened.file {
            self.preferences.remember(file);
        } else if let Target::Mesh(mesh) = &opened.scene.target
            && mesh.asset().is_none()
        {
            self.preferences.remember(Path::new(&mesh.path));
            self.preferences.allow(Path::new(&mesh.path));
        }
        session.open(vec![opened.into()]);
    }
}

/// Reads what a name means. A scene may open the meshes that the user has opened himself.
fn load(name: &str, meshes: &[PathBuf]) -> Result<Opened, Refusal> {
    let path = Path::new(name);
    let name = if path.extension().is_some() {
        let full = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        full.to_string_lossy().into_owned()
    } else {
        name.to_owned()
    };
    let mut opened = scene::open(&name)?;
    if let Target::Mesh(mesh) = &opened.scene.target
        && opened.file.is_none()
        && mesh.asset().is_none()
    {
        // What is not there shall not be among the recent files.
        std::fs::File::open(&mesh.path).map_err(|e| Refusal::new(format!("{}: {e}", mesh.path)))?;
    }
    if opened.file.is_some() {
        meshes.iter().for_each(|mesh| opened.place.allow(mesh));
    }
    if let Some(short) = Path::new(&opened.title).file_name() {
        opened.title = short.to_string_lossy().into_owned();
    }
    Ok(opened)
}

/// Reads a recording. It opens meshes as the scene in its place would.
fn load_recording(path: &Path, meshes: &[PathBuf]) -> Result<LaneSetup, Refusal> {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let recording =
        read_limited(&path).and_then(|text| Recording::from_ron(&text).map_err(|e| e.at(path.display())))?;
    let mut place = Place::folder(path.parent().unwrap_or(Path::new(".")));
    meshes.iter().for_each(|mesh| place.allow(mesh));
    let origin = Origin::Script(Arc::new(Script::from(&recording)));
    let title = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(LaneSetup { title, scene: recording.scene, place, file: None, origin })
}

/// Keys and values that make a mesh light cotton, with a step that is stable for it: with the values of the 25 m sheet a garment
/// would stretch to several times its length.
fn light_cotton(mut scene: Scene, place: Place) -> Result<Settings, Refusal> {
    scene.mass = Mass::PerArea(0.2);
    scene.air_damping = 2e-4;
    scene.dt = 1e-3;
    let springs = &mut scene.springs;
    springs.damping = 1e-3;
    springs.stretch.stiffness = 50.0;
    springs.shear.stiffness = 10.0;
    springs.bend.stiffness = 0.5;
    let world = World::new(scene.clone(), place)?;
    let masses = scene.mass.of(world.mesh())?;
    let weight = scene.gravity.magnitude * masses.iter().sum::<f64>() / masses.len().max(1) as f64;
    let limit = world.dt_limit(&world.spectrum()).filter(|limit| *limit > 0.0).unwrap_or(f64::INFINITY);
    scene.dt = readable(0.7 * limit.min(0.02));
    // A wind that lifts it, and does not tear it away.
    scene.wind.strength = readable(weight.max(1e-9));
    let settings = [
        ("mass", to_ron(&scene.mass)),
        ("springs", to_ron(&scene.springs)),
        ("air_damping", to_ron(&scene.air_damping)),
        ("wind.strength", to_ron(&scene.wind.strength)),
        ("dt", to_ron(&scene.dt)),
    ];
    settings.into_iter().map(|(key, value)| Ok((key.to_owned(), value?))).collect()
}

/// The same keys with the values that they have in a scene.
fn values_in(
    scene: &Scene,
    settings: Vec<(String, String)>,
) -> Result<Vec<(String, String, String)>, Refusal> {
    let before = |key: &str| match key {
        "mass" => to_ron(&scene.mass),
        "springs" => to_ron(&scene.springs),
        "air_damping" => to_ron(&scene.air_damping),
        "wind.strength" => to_ron(&scene.wind.strength),
        _ => to_ron(&scene.dt),
    };
    settings.into_iter().map(|(key, value)| Ok((key.clone(), value, before(&key)?))).collect()
}

/// The largest number of one digit that is not above `value`.
fn readable(value: f64) -> f64 {
    let power = value.log10().floor();
    let digit = (value / 10_f64.powf(power) * (1.0 + 1e-9)).floor();
    // Through text, which has no rounding error.
    format!("{digit}e{power}").parse().unwrap_or(value)
}

fn write(scene: &Scene, path: &Path) -> Result<(), Refusal> {
    Pending::new(path)?.finish(scene.to_ron()?.as_bytes())
}

/// A file without an ending is a scene.
fn with_ending(path: &Path) -> PathBuf {
    if path.extension().is_some() { path.to_owned() } else { path.with_extension("ron") }
}

/// Where the open scene would be saved: in its file, beside its mesh, or in the working folder.
pub fn proposal(session: &Session) -> PathBuf {
    if let Some(file) = session.file() {
        return file.clone();
    }
    let stem = Path::new(session.title()).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let name = format!("{}.ron", if stem.is_empty() { "scene" } else { &stem });
    let folder = match &session.scene().target {
        Target::Mesh(mesh) if mesh.asset().is_none() => Path::new(&mesh.path).parent(),
        _ => None,
    };
    let folder = folder.filter(|folder| folder.is_absolute()).map(Path::to_owned);
    folder.or_else(|| std::env::current_dir().ok()).unwrap_or_default().join(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_readable() {
        for (value, expected) in [(0.0123, 0.01), (0.02, 0.02), (0.00056, 0.0005), (0.1, 0.1), (3.9e-5, 3e-5)]
        {
            assert_eq!(readable(value), expected);
        }
    }

    #[test]
    fn light_cotton_has_a_stable_step() {
        let Opened { mut scene, place, .. } = scene::open("assets/meshes/cape_mixed.obj").expect("a mesh");
        for (key, value) in light_cotton(scene.clone(), place.clone()).expect("settings") {
            scene.set_key(&key, &value).expect("accepted");
        }
        assert_eq!(scene.mass, Mass::PerArea(0.2));
        let world = World::new(scene.clone(), place).expect("a world");
        let limit = world.dt_limit(&world.spectrum()).expect("a limit");
        assert!(scene.dt <= 0.7 * limit && scene.dt > 0.07 * limit);
    }
}
