//! Time of a frame of the workbench outside of the GPU: panels, upload, recording and submitting the passes, at four sizes;
//! and the bytes uploaded for it. Frames on the way between two states, and frames that show a new one.

use criterion::{Criterion, SamplingMode, criterion_group, criterion_main};
use std::time::{Duration, Instant};
use tenter::app::{
    engine::{Engine, LaneSetup, Order, Origin},
    gpu::{Attachments, Gpu, PICTURE_FORMAT, Picture},
    session::{Link, Session},
    shell::{Canvas, Content, Stage},
    simulation::Simulation,
    workbench::Workbench,
};
use tenter::scene::{GridTarget, Place, Scene, Target};

const SIZE: [u32; 2] = [1280, 800];
const SAMPLES: u32 = 1;

/// The workbench and a canvas in memory in place of the window's.
struct Frames {
    gpu: Gpu,
    egui: egui::Context,
    workbench: Workbench,
    attachments: Attachments,
    picture: Picture,
}

impl Frames {
    fn open(gpu: Gpu, n: u32) -> Self {
        let scene = Scene {
            target: Target::Grid(GridTarget { columns: n, rows: n, ..GridTarget::default() }),
            ..Scene::default()
        };
        let setups = vec![LaneSetup {
            title: "sheet".to_owned(),
            scene,
            place: Place::default(),
            file: None,
            origin: Origin::Start,
        }];
        let mut engine = Engine::new(setups.clone()).expect("a sheet");
        let state = engine.state();
        let simulation = Simulation::start(engine, None, || {}).expect("a thread");
        let mut workbench = Workbench::new(Session::new(Link::Thread(simulation), state, setups));
        let egui = egui::Context::default();
        workbench.attach(&Stage { gpu: &gpu, format: PICTURE_FORMAT, samples: SAMPLES, egui: &egui });
        let attachments = Attachments::new(&gpu.device, PICTURE_FORMAT, SIZE, SAMPLES);
        let picture = Picture::new(&gpu, SIZE).expect("a picture");
        let mut frames = Self { gpu, egui, workbench, attachments, picture };
        // One beat in real time, then so slowly that no other follows: frames blend between its two states for long,
        // and the simulation takes no time from them.
        frames.workbench.session.run(true);
        while frames.workbench.session.state().lanes[0].previous.is_none() {
            frames.frame();
        }
        frames.workbench.session.order(Order::Speed(1e-3));
        for _ in 0..3 {
            frames.frame();
        }
        frames
    }

    /// Takes a step, and waits for it.
    fn step(&mut self) {
        let session = &mut self.workbench.session;
        let before = session.state().lanes[0].steps;
        session.order(Order::Step(1));
        while session.state().lanes[0].steps == before {
            std::thread::sleep(Duration::from_millis(1));
            session.refresh();
        }
    }

    /// One frame; the time that it took outside of the GPU.
    fn frame(&mut self) -> Duration {
        let start = Instant::now();
        let size = egui::vec2(SIZE[0] as f32, SIZE[1] as f32);
        let input = egui::RawInput {
            screen_rect: Some(egui::Rect::from_min_size(egui::Pos2::ZERO, size)),
            ..egui::RawInput::default()
        };
        let mut output = self.egui.run_ui(input, |ui| self.workbench.ui(ui));
        // egui insists that its textures are taken; nothing paints them here.
        output.textures_delta.set.clear();
        output.textures_delta.free.clear();
        std::hint::black_box(self.egui.tessellate(output.shapes, output.pixels_per_point));
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.workbench.draw(&mut Canvas {
            gpu: &self.gpu,
            encoder: &mut encoder,
            target: &self.picture.view(),
            attachments: &self.attachments,
            pixels_per_point: 1.0,
        });
        self.gpu.queue.submit([encoder.finish()]);
        let time = start.elapsed();
        self.gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("drawn");
        time
    }
}

fn frame(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
    for n in [25, 100, 316, 1000] {
        let gpu = match Gpu::offscreen() {
            Ok(gpu) => gpu,
            Err(e) => return eprintln!("skipped frame: {e}"),
        };
        let mut frames = Frames::open(gpu, n);
        let name = format!("{n}x{n}");
        let positions = 12 * u64::from(n) * u64::from(n);
        frames.frame();
        println!("frame/on the way/{name}: {} bytes uploaded", frames.workbench.uploaded());
        group.bench_function(format!("on the way/{name}"), |bencher| {
            bencher.iter_custom(|times| (0..times).map(|_| frames.frame()).sum());
        });
        frames.step();
        frames.frame();
        let uploaded = frames.workbench.uploaded();
        println!("frame/new state/{name}: {uploaded} bytes uploaded, {positions} of them positions");
        group.bench_function(format!("new state/{name}"), |bencher| {
            bencher.iter_custom(|times| {
                let mut one = || {
                    frames.step();
                    frames.frame()
                };
                (0..times).map(|_| one()).sum()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, frame);
criterion_main!(benches);
