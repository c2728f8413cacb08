//! A method that has run for a few steps takes no more memory, whatever it solves.
#![allow(clippy::unwrap_used)]

mod common;
mod memory;

use common::{PRECISIONS, method, problem, sheet};
use tenter::forces::Cost;
use tenter::scene::{Precision, Scene};
use tenter::simulators::{self, Build, Entry};

/// Every force on a sheet.
fn scene(entry: &Entry) -> Scene {
    let mut scene =
        Scene { target: sheet(8, 8, 1.0), simulator: method(entry), dt: 2e-3, ..Scene::default() };
    scene.wind.enabled = true;
    scene
}

/// How often memory was asked for in `steps` steps, after some to start with.
fn requests<T: Build>(entry: &Entry, steps: u32) -> usize {
    let (problem, mut state) = problem::<T>(&scene(entry));
    let mut stepper = T::build(&method(entry)).unwrap();
    let mut advance = |steps: u32| {
        for _ in 0..steps {
            stepper.step(&problem, &mut state, T::from_f64(2e-3), &mut Cost::default());
            state.time += 2e-3;
        }
    };
    advance(20);
    memory::requests(|| advance(steps))
}

#[test]
fn no_method_allocates_over_a_thousand_steps() {
    for entry in simulators::ALL {
        // Solvers of equations do as much in a hundred.
        let steps = if entry.params.contains(&"iterations") { 100 } else { 1000 };
        for precision in PRECISIONS {
            let requests = match precision {
                Precision::Single => requests::<f32>(entry, steps),
                Precision::Double => requests::<f64>(entry, steps),
            };
            assert_eq!(requests, 0, "{}, {precision:?}", entry.id);
        }
    }
}

#[test]
fn what_is_counted_is_what_is_held() {
    let elsewhere = || std::thread::spawn(|| vec![1_u8; 1 << 20]).join().unwrap();
    let ((kept, requests), most) = memory::measured(|| {
        let mut kept = Vec::with_capacity(1000);
        let requests = memory::requests(|| {
            kept.resize(5000, 1_u8); // held twice while it moves
            drop(std::hint::black_box(vec![0_u8; 2000]));
        });
        (kept, requests)
    });
    assert_eq!((kept.capacity(), requests, most), (5000, 2, 7000));
    // The whole process: other tests run beside this one, and hold less.
    let before = memory::held();
    let far = elsewhere();
    assert!(memory::held() > before + far.len() / 2);
}
