//! Exports that the workbench starts: on a thread of their own, to be waited for or stopped.

use super::{folder, names};
use std::path::Path;
use std::sync::mpsc::channel;
use tenter::app::exporting::{Exporting, Wish};
use tenter::scene::{Place, Scene};

fn wish(folder: &Path, name: &str, seconds: f64) -> Wish {
    let scene = Scene::default();
    Wish { scene, place: Place::default(), path: folder.join(name), seconds, fps: 25.0, size: None }
}

/// What an export tells once it has ended.
fn told(exporting: &mut Exporting) -> String {
    std::iter::repeat_with(|| exporting.ended()).flatten().next().unwrap()
}

#[test]
fn an_export_runs_on_its_own_and_tells_when_it_has_ended() {
    let dir = folder();
    let (sender, ended) = channel();
    let wish = wish(dir.path(), "a.pc2", 0.4);
    let mut exporting = Exporting::start(wish, move || sender.send(()).unwrap()).unwrap();
    ended.recv().unwrap();
    assert!(told(&mut exporting).starts_with("exported: "));
    assert_eq!(exporting.progress(), 1.0);
    assert_eq!(names(dir.path()), ["a.pc2"]);
}

#[test]
fn an_export_that_is_stopped_or_dropped_leaves_nothing() {
    let dir = folder();
    for name in ["a.obj", "a.glb", "a.csv"] {
        let mut exporting = Exporting::start(wish(dir.path(), name, 300.0), || {}).unwrap();
        exporting.stop();
        assert!(told(&mut exporting).contains("nothing is written"));
        drop(Exporting::start(wish(dir.path(), name, 300.0), || {}).unwrap());
    }
    assert_eq!(names(dir.path()), [""; 0]);
}

#[test]
fn what_cannot_be_exported_is_refused_at_once() {
    let dir = folder();
    for (name, seconds) in [("a.xyz", 1.0), ("a", 1.0), ("a.obj", 1e12)] {
        assert!(Exporting::start(wish(dir.path(), name, seconds), || {}).is_err());
    }
}
