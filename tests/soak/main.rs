//! A user who tries everything: parameters at their extremes, drags, pins, methods, scenes, undo, the past, windows of any size, lost
//! devices, all drawn from one seed and driven through the panels and the commands behind them. Nothing may panic, every burst
//! must be told and be left again, and what is shown stays finite.
//!
//! `TENTER_SOAK_MINUTES=30 cargo test --features app-test --test soak -- --nocapture` goes on for so long and asserts that the
//! memory in use stays level; without the variable it is a short walk.

#![allow(clippy::unwrap_used)]

mod knobs;
#[path = "../machine/mod.rs"]
mod machine;
#[path = "../memory/mod.rs"]
mod memory;

use egui::{Event, Modifiers, PointerButton, Role};
use egui_kittest::{Harness, kittest::Queryable};
use glam::DVec3;
use knobs::{Chance, Knobs, spoken};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tenter::app::{
    camera::Side,
    engine::{Engine, LaneSetup, Order, Origin},
    files::Files,
    gpu::{Attachments, Gpu, PICTURE_FORMAT, Picture},
    panels::Action,
    session::{Link, Session},
    shell::{Canvas, Content, Stage},
    workbench::Workbench,
};
use tenter::scene::{Place, Scene, builtin};
use tenter::simulators;

/// What the short walk does, acts, and a lap: after each the first scene is opened again, so that laps compare.
const ACTS: u32 = 300;
const LAP: u32 = 150;
/// How long this user waits for a step.
const PATIENCE: Duration = Duration::from_secs(2);
/// The window, points.
const SIZE: egui::Vec2 = egui::vec2(1280.0, 800.0);
/// A picture, pixels.
const PIXELS: [u32; 2] = [320, 200];

/// The workbench under test, and what it draws on.
struct Soak {
    window: Harness<'static, Workbench>,
    gpu: Gpu,
    chance: Chance,
    folder: tempfile::TempDir,
    /// Breaks off the step under way.
    stop: Arc<AtomicBool>,
    /// Since when an act lasts.
    since: Arc<Mutex<Option<Instant>>>,
    /// Bursts that were told and left, devices that were lost, and steps that were broken off.
    bursts: u32,
    losses: u32,
    broken_off: u32,
}

impl Soak {
    fn start(seed: u64, gpu: Gpu) -> Self {
        let setup = LaneSetup {
            title: "sheet".to_owned(),
            scene: Scene::default(),
            place: Place::default(),
            file: None,
            origin: Origin::Start,
        };
        let mut engine = Engine::new(vec![setup.clone()]).unwrap();
        let (state, stop) = (engine.state(), engine.stop());
        let session = Session::new(Link::Here(Box::new(engine)), state, vec![setup]);
        let window = Harness::builder()
            .with_size(SIZE)
            .build_ui_state(|ui, workbench: &mut Workbench| workbench.ui(ui), Workbench::new(session));
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in [
            ("broken.ron", "(dt: "),
            ("lost_mesh.ron", "(target: Mesh(path: \"nowhere.obj\"))"),
            ("empty.obj", ""),
            ("triangle.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
            ("bursts.ron", "(springs: (stretch: (stiffness: 1e9)), pins: [Corners(1)])"),
        ] {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let (chance, since) = (Chance(seed), Arc::default());
        let [bursts, losses, broken_off] = [0; 3];
        let mut soak = Self { window, gpu, chance, folder, stop, since, bursts, losses, broken_off };
        soak.watch();
        soak.attach();
        soak.frames(2);
        soak
    }

    fn attach(&mut self) {
        let egui = self.window.ctx.clone();
        let stage = Stage { gpu: &self.gpu, format: PICTURE_FORMAT, samples: 1, egui: &egui };
        self.window.state_mut().attach(&stage);
    }

    /// A thread that breaks off the steps of an act that lasts too long.
    fn watch(&self) {
        let (stop, since) = (Arc::clone(&self.stop), Arc::downgrade(&self.since));
        std::thread::spawn(move || {
            while let Some(since) = since.upgrade() {
                // Under the lock, so that no act is stopped that has begun meanwhile.
                let since = since.lock().unwrap();
                if since.is_some_and(|since| since.elapsed() > PATIENCE) {
                    stop.store(true, Ordering::Relaxed);
                }
                drop(since);
                std::thread::sleep(PATIENCE / 20);
            }
        });
    }

    /// Does something with that thread at its side. A step that was broken off is told, and the cloth stands still.
    fn impatiently<T>(&mut self, act: impl FnOnce(&mut Self) -> T) -> T {
        *self.since.lock().unwrap() = Some(Instant::now());
        let done = act(self);
        *self.since.lock().unwrap() = None;
        if self.stop.load(Ordering::Relaxed) {
            self.broken_off += 1;
            self.session().run(false);
            self.frames(1);
            let told = self.session().message.clone();
            assert!(told.as_ref().is_some_and(|told| told.contains("broken off")), "{told:?}");
        }
        done
    }

    fn frames(&mut self, count: usize) {
        self.window.run_steps(count);
    }

    fn session(&mut self) -> &mut Session {
        &mut self.window.state_mut().session
    }

    /// Does one thing; its name.
    fn act(&mut self) -> String {
        match self.chance.below(100) {
            0..30 => self.turn_a_knob(),
            30..45 => self.step(),
            45..55 => self.drag(),
            55..60 => self.pin(),
            60..66 => self.choose_a_method(),
            66..69 => self.open(),
            69..73 => self.take_back(),
            73..75 => self.look_back(),
            75..79 => self.change_lanes(),
            79..80 => self.save(),
            80..85 => self.press(),
            85..92 => self.point(),
            92..95 => self.resize(),
            95..99 => self.draw(),
            _ => self.lose_the_device(),
        }
    }

    fn turn_a_knob(&mut self) -> String {
        let scene = self.session().scene().clone();
        let knobs = Knobs::of(&scene);
        let knob = self.chance.one(&knobs);
        let value = self.chance.one(&knob.values).clone();
        let slider = spoken(&knob.key);
        if let Ok(number) = value.parse::<f64>()
            && self.chance.below(3) == 0
            && let Some(slider) = self.window.query_by_role_and_label(Role::Slider, &slider)
        {
            slider.set_value_accesskit(number);
            return format!("slide {} to {value}", knob.key);
        }
        let only = (self.chance.below(4) == 0).then_some(self.session().lane);
        self.session().set(only, &knob.key, &value, &value);
        if self.chance.below(2) == 0 {
            self.session().end_edit();
        }
        format!("set {} to {value} in {only:?}", knob.key)
    }

    fn step(&mut self) -> String {
        let steps = 1 + self.chance.below(8) as u32;
        self.session().order(Order::Step(steps));
        format!("{steps} steps")
    }

    fn drag(&mut self) -> String {
        let particles = self.session().lane_state().map_or(0, |lane| lane.positions.len());
        let particle = self.chance.below(particles.max(1)) as u32;
        let far = *self.chance.one(&[0.0, 0.1, 1.0, 30.0, 1e6, 1e13]);
        let soft = self.chance.below(2) == 0;
        let stiffness = *self.chance.one(&[0.01, 100.0, 1e9]);
        let to = DVec3::new(self.chance.part() - 0.5, self.chance.part(), self.chance.part() - 0.5) * far;
        let lets_go = self.chance.below(4) > 0;
        let session = self.session();
        (session.grip.soft, session.grip.stiffness) = (soft, stiffness);
        session.grab(particle);
        for part in [0.3, 0.7, 1.0] {
            session.drag(to * part);
            session.order(Order::Step(1));
        }
        if lets_go {
            session.release();
        } else {
            session.cancel_drag();
        }
        format!("drag {particle} by {to}, soft {soft}, {stiffness} N/m, let go {lets_go}")
    }

    fn pin(&mut self) -> String {
        let particles = self.session().lane_state().map_or(0, |lane| lane.positions.len());
        let count = *self.chance.one(&[1, 3, particles]);
        let chosen: Vec<u32> = (0..count).map(|_| self.chance.below(particles.max(1)) as u32).collect();
        let pinned = self.chance.below(3) > 0;
        let session = self.session();
        session.selection = chosen.iter().copied().collect();
        if pinned {
            session.pin_selection();
        } else {
            session.pin(&chosen, false);
        }
        format!("pin or free {count}")
    }

    fn choose_a_method(&mut self) -> String {
        let method = self.chance.one(simulators::ALL).id;
        let before = self.session().scene().simulator.id.clone();
        self.session().set(None, "simulator.id", method, &before);
        self.session().end_edit();
        format!("method {method}")
    }

    fn open(&mut self) -> String {
        let files: Vec<_> =
            std::fs::read_dir(self.folder.path()).unwrap().map(|f| f.unwrap().path()).collect();
        let name = match self.chance.below(3) {
            0 => self.chance.one(&files).to_string_lossy().into_owned(),
            _ => self.chance.one(builtin::ALL).name.to_owned(),
        };
        self.open_named(&name);
        format!("open {name}")
    }

    fn open_named(&mut self, name: &str) {
        self.window.state_mut().files.open(name);
        while self.window.state().files.loading().is_some() || self.session().opening().is_some() {
            self.frames(1);
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn take_back(&mut self) -> String {
        let back = self.chance.below(3) > 0;
        if back {
            self.session().undo();
        } else {
            self.session().redo();
        }
        if back { "undo".to_owned() } else { "redo".to_owned() }
    }

    /// A moment of the past, or all of it once more.
    fn look_back(&mut self) -> String {
        let part = self.chance.part();
        let again = self.chance.below(4) == 0;
        let session = self.session();
        if again {
            session.play_again();
            return "play again".to_owned();
        }
        let remembered = session.state().timeline;
        let to = remembered.from + part * (remembered.to - remembered.from);
        session.scrub(to);
        format!("look back to {to} s")
    }

    /// What is saved may be opened later.
    fn save(&mut self) -> String {
        let folder = self.folder.path().to_owned();
        let Workbench { session, files, .. } = self.window.state_mut();
        if self.chance.below(2) == 0 {
            files.save(session, &folder.join("saved.ron"), None);
            "save".to_owned()
        } else {
            Files::record(session, &folder.join("recording.ron"));
            "save a recording".to_owned()
        }
    }

    fn change_lanes(&mut self) -> String {
        let lanes = self.session().scenes().len();
        if lanes < 3 && self.chance.below(2) == 0 {
            let method = self.chance.one(simulators::ALL).id;
            self.session().add_lane(Some(method));
            format!("add a lane of {method}")
        } else {
            let lane = self.chance.below(lanes);
            self.session().remove_lane(lane);
            format!("remove lane {lane}")
        }
    }

    /// What keys and menus ask for, but for what opens files, asks the system, measures for minutes or ends the program.
    fn press(&mut self) -> String {
        let actions = [
            Action::SelectAll,
            Action::SelectNone,
            Action::SelectPinned,
            Action::Pin,
            Action::Step,
            Action::Reset,
            Action::Slower,
            Action::Faster,
            Action::Focus,
            Action::Look(Side::Top),
            Action::Projection,
            Action::Grip,
            Action::Theme,
            Action::Lab,
            Action::Help,
            Action::Export,
            Action::Undo,
            Action::Redo,
        ];
        let action = self.chance.one(&actions).clone();
        self.window.state_mut().perform(&action);
        format!("{action:?}")
    }

    /// A drag, a click or a turn of the wheel somewhere in the viewport.
    fn point(&mut self) -> String {
        let mut place = || {
            egui::pos2(340.0 + 560.0 * self.chance.part() as f32, 120.0 + 560.0 * self.chance.part() as f32)
        };
        let (from, to) = (place(), place());
        let modifiers =
            *self.chance.one(&[Modifiers::NONE, Modifiers::SHIFT, Modifiers::CTRL, Modifiers::ALT]);
        let button =
            *self.chance.one(&[PointerButton::Primary, PointerButton::Secondary, PointerButton::Middle]);
        let press = |pos, pressed| Event::PointerButton { pos, button, pressed, modifiers };
        let events = [
            vec![Event::PointerMoved(from), press(from, true)],
            vec![Event::PointerMoved(to)],
            vec![press(to, false)],
        ];
        for events in events {
            events.into_iter().for_each(|event| self.window.event_modifiers(event, modifiers));
            self.frames(1);
        }
        format!("{button:?} from {from} to {to} with {modifiers:?}")
    }

    /// A window of nothing, of one point, of the most that a texture can hold; and none at all for a while.
    fn resize(&mut self) -> String {
        let size = *self.chance.one(&[
            egui::vec2(1.0, 1.0),
            egui::vec2(0.0, 0.0),
            egui::vec2(16384.0, 16384.0),
            egui::vec2(16384.0, 1.0),
            egui::vec2(640.0, 400.0),
        ]);
        let scale = *self.chance.one(&[1.0, 0.5, 3.0]);
        self.window.set_size(size);
        self.window.set_pixels_per_point(scale);
        self.frames(2);
        // Minimised, nothing is drawn while the simulation goes on.
        self.session().order(Order::Step(2));
        self.window.set_size(SIZE);
        self.window.set_pixels_per_point(1.0);
        self.frames(2);
        format!("size {size} at {scale}")
    }

    fn draw(&mut self) -> String {
        let size = *self.chance.one(&[PIXELS, PIXELS, [1, 1]]);
        let attachments = Attachments::new(&self.gpu.device, PICTURE_FORMAT, size, 1);
        let picture = Picture::new(&self.gpu, size).unwrap();
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.window.state_mut().draw(&mut Canvas {
            gpu: &self.gpu,
            encoder: &mut encoder,
            target: &picture.view(),
            attachments: &attachments,
            pixels_per_point: 1.0,
        });
        self.gpu.queue.submit([encoder.finish()]);
        let failed = self.gpu.check().err();
        let read = picture.read(&self.gpu);
        assert!(failed.is_some() || read.is_ok(), "{:?}", read.err());
        format!("draw {size:?}, failed: {failed:?}")
    }

    fn lose_the_device(&mut self) -> String {
        let before = self.lanes();
        self.gpu.device.destroy();
        let told = self.draw();
        assert!(self.gpu.check().is_err(), "nobody was told that the device is gone");
        self.gpu = Gpu::offscreen().unwrap();
        self.attach();
        self.draw();
        self.gpu.check().unwrap();
        assert_eq!(self.lanes(), before, "the simulation does not depend on what draws it");
        self.losses += 1;
        format!("lose the device; {told}")
    }

    /// Steps of every lane.
    fn lanes(&self) -> Vec<u64> {
        self.window.state().session.state().lanes.iter().map(|lane| lane.steps).collect()
    }

    fn is_burst(&self) -> bool {
        self.window.state().session.state().lanes.iter().any(|lane| lane.health.is_diverged())
    }

    /// What must hold after every act; a burst is left by what the banner offers.
    fn check(&mut self) {
        self.frames(1);
        for lane in &self.window.state().session.state().lanes {
            assert!(lane.positions.iter().flatten().all(|c| !c.is_nan()), "{:?}", lane.health);
        }
        if let Some(message) = &self.window.state().session.message {
            assert!(!message.contains('\n') && message.len() < 700, "{message}");
        }
        // One lane after the other may have burst, and what was set since the state that one goes back to stays set.
        for way in ["Go back 2 s", "Reset", "Reset"] {
            if !self.is_burst() {
                return;
            }
            self.bursts += 1;
            self.frames(2);
            assert!(self.window.query_by_label_contains("Paused at the last good state").is_some());
            let buttons: Vec<_> = self.window.query_all_by_role_and_label(Role::Button, way).collect();
            let lowest = buttons.iter().max_by(|a, b| a.rect().top().total_cmp(&b.rect().top()));
            match lowest {
                Some(button) => button.click_accesskit(),
                None => panic!("the banner does not offer {way}"),
            }
            drop(buttons);
            self.frames(3);
        }
        assert!(!self.is_burst(), "a burst was not left by a reset");
    }
}

/// Memory of this process, kB, but for what its heap keeps free for later.
fn resident() -> f64 {
    memory::trim();
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").trim().parse().ok()).unwrap_or(0.0)
}

fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn nothing_that_a_user_does_breaks_it() {
    tenter::app::heap::share();
    let gpu = match Gpu::offscreen() {
        Ok(gpu) => gpu,
        Err(e) => return machine::lacks("nothing_that_a_user_does_breaks_it", &e.to_string()),
    };
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<f64>().ok());
    let long = number("TENTER_SOAK_MINUTES").map(|minutes| Duration::from_secs_f64(60.0 * minutes));
    let seed = number("TENTER_SOAK_SEED").unwrap_or(20_261_123.0) as u64;
    let start = Instant::now();
    let mut soak = Soak::start(seed, gpu);
    let mut laps = Vec::new();
    for number in 1.. {
        if long.map_or(number > ACTS, |long| start.elapsed() > long) {
            break;
        }
        print!("{number}: ");
        soak.impatiently(|soak| {
            println!("{}", soak.act());
            soak.check();
        });
        if number % LAP == 0 {
            soak.open_named("sheet");
            soak.frames(3);
            let (seconds, resident, own) = (start.elapsed().as_secs_f64(), resident(), memory::held() / 1000);
            laps.push(resident);
            let Soak { bursts, losses, broken_off, .. } = soak;
            println!(
                "{seconds:.0} s, {number} acts, {bursts} bursts left, {losses} devices lost, {broken_off} steps broken off, \
                 {resident:.0} kB resident, {own} kB of them our own"
            );
        }
    }
    assert!(soak.bursts > 0 && soak.losses > 0, "{} bursts, {} losses", soak.bursts, soak.losses);
    if long.is_some() && Path::new("/proc/self/status").exists() {
        assert!(laps.len() >= 8, "too short to compare: {} laps of {LAP} acts", laps.len());
        let (warm, end) = (&laps[laps.len() / 4..laps.len() / 2], &laps[3 * laps.len() / 4..]);
        let growth = median(end) / median(warm);
        println!("memory from the second quarter to the last: x {growth:.4}");
        assert!(growth < 1.05, "{warm:?} kB became {end:?} kB");
    }
}
