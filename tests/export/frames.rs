//! The times that frames show, and what the tables and point caches say of them.

use super::common::{hanging, only_stretch, run, world};
use super::{exported, folder};
use glam::DVec3;
use tenter::export::{self, Frame, Sink, Span};
use tenter::scene::{Refusal, Scene};
use tenter::world::World;

/// Keeps what it is given.
#[derive(Default)]
struct Kept(Vec<(f64, Vec<DVec3>)>);

impl Sink for Kept {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), Refusal> {
        assert_eq!(frame.number, self.0.len() as u64);
        self.0.push((frame.time, frame.positions.to_vec()));
        Ok(())
    }
    fn finish(self: Box<Self>) -> Result<(), Refusal> {
        Ok(())
    }
}

fn kept(scene: &Scene, seconds: f64, fps: f64) -> (Vec<(f64, Vec<DVec3>)>, World) {
    let (mut world, mut kept) = (world(scene), Kept::default());
    let span = Span::new(seconds, fps).unwrap();
    assert_eq!(export::run(&mut world, span, &mut kept, &mut |_| true), Ok(span.frames()));
    (kept.0, world)
}

fn scene(dt: f64) -> Scene {
    Scene { target: hanging(3, 3, 0.5), springs: only_stretch(100.0), dt, ..Scene::default() }
}

#[test]
fn frames_at_the_time_of_a_step_are_that_step_to_the_bit() {
    // 0.02 s and 25 a second: every second step; 0.1 is not a binary number, so their times are rounded differently.
    for (dt, fps, every) in [(0.02, 25.0, 2), (0.1, 10.0, 1), (1.0 / 300.0, 30.0, 10)] {
        let (frames, _) = kept(&scene(dt), 2.0, fps);
        assert_eq!(frames.len() as f64, 2.0 * fps + 1.0);
        for (n, (time, positions)) in frames.iter().enumerate() {
            assert_eq!(*time, n as f64 / fps);
            assert_eq!(*positions, run(&scene(dt), n as u64 * every).positions(), "frame {n} of {fps}");
        }
    }
}

#[test]
fn frames_between_steps_are_blended() {
    // Three frames fall into every step, and none of 1/3 s on a step but every third.
    let scene = scene(0.1);
    let (frames, _) = kept(&scene, 1.0, 30.0);
    assert_eq!(frames.len(), 31);
    for (n, (_, positions)) in frames.iter().enumerate() {
        let (step, part) = (n as u64 / 3, (n % 3) as f64 / 3.0);
        let [from, to] = [step, step + 1].map(|step| run(&scene, step).positions());
        for ((x, from), to) in positions.iter().zip(&from).zip(&to) {
            // Rounding of times and of the blend.
            assert!(x.distance(*from + (*to - *from) * part) < 1e-14, "frame {n}");
        }
    }
}

#[test]
fn a_run_that_diverges_or_is_stopped_hands_over_what_it_had() {
    let bursting = Scene { springs: only_stretch(1e5), ..scene(0.1) };
    let (mut world, mut sink) = (world(&bursting), Kept::default());
    let span = Span::new(100.0, 10.0).unwrap();
    let frames = export::run(&mut world, span, &mut sink, &mut |_| true).unwrap();
    assert!(world.health().is_diverged());
    assert_eq!((frames, frames), (sink.0.len() as u64, world.steps() + 1));
    assert!(sink.0.iter().flat_map(|(_, positions)| positions).all(|p| p.is_finite()));

    let (mut world, mut sink) = (super::common::world(&scene(0.1)), Kept::default());
    assert_eq!(export::run(&mut world, span, &mut sink, &mut |frames| frames < 7), Ok(7));
    assert_eq!(sink.0.len(), 7);

    let still = Scene { dt: 0.0, ..scene(0.1) };
    let refused = export::run(&mut super::common::world(&still), span, &mut sink, &mut |_| true);
    assert!(refused.unwrap_err().to_string().contains("no time passes"));
}

#[test]
fn spans_count_the_frames_within_a_time() {
    // 0.29 * 100 is a little less than 29 in binary.
    for (seconds, fps, frames) in [(0.0, 25.0, 1), (0.29, 100.0, 30), (1.0, 24.0, 25), (0.99, 1.0, 1)] {
        assert_eq!(Span::new(seconds, fps).map(|s| s.frames()), Ok(frames));
    }
    for (seconds, fps) in [(1.0, 0.0), (1.0, -1.0), (1.0, f64::NAN), (1.0, f64::INFINITY), (1e9, 1e9)] {
        assert!(Span::new(seconds, fps).unwrap_err().to_string().contains("accepted"));
    }
}

#[test]
fn a_table_has_the_measures_of_the_steps() {
    let dir = folder();
    // Two frames a step: each step is listed once.
    exported(dir.path(), &["sheet", "--seconds", "0.2", "--fps", "100", "--out", "a.csv"]);
    let text = std::fs::read_to_string(dir.path().join("a.csv")).unwrap();
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 11);
    for (n, row) in rows.iter().enumerate() {
        let world = run(&Scene::default(), n as u64);
        let m = world.measures();
        let energy = [m.energy.kinetic, m.energy.gravitational, m.energy.elastic, m.energy.total()];
        let expected = [&[n as f64, world.time()], &energy[..], &[m.max_strain, m.mean_strain, 0.0]].concat();
        assert_eq!(*row, expected);
    }
}

#[test]
fn a_point_cache_has_the_vertices_in_single_precision() {
    let dir = folder();
    exported(dir.path(), &["sheet", "--seconds", "0.4", "--out", "a.pc2"]);
    let bytes = std::fs::read(dir.path().join("a.pc2")).unwrap();
    let (header, data) = bytes.split_at(32);
    let word = |at: usize| u32::from_le_bytes(header[at..at + 4].try_into().unwrap());
    assert_eq!(&header[..12], b"POINTCACHE2\0");
    let one = 1_f32.to_bits();
    assert_eq!([12, 16, 20, 24, 28].map(word), [1, 625, 0, one, 11]);
    let numbers: Vec<f32> = data.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    let last = run(&Scene::default(), 20).positions();
    let last: Vec<f32> = last.iter().flat_map(|p| p.as_vec3().to_array()).collect();
    assert_eq!(numbers.len(), 11 * 625 * 3);
    assert_eq!(numbers[10 * 625 * 3..], last);
}
