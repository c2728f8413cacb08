//! A workbench for tests of its panels: no GPU, no window, and an engine that runs only when it is told to.

use egui_kittest::Harness;
use tenter::app::{
    engine::{Engine, LaneSetup, Origin},
    session::{Link, Session},
    workbench::Workbench,
};
use tenter::scene::{Place, Scene};

pub type Window = Harness<'static, Workbench>;

/// A workbench on a scene.
pub fn open(ron: &str) -> Window {
    let scene = Scene::from_ron(ron).expect("a scene");
    let setups = vec![LaneSetup {
        title: "test".to_owned(),
        scene,
        place: Place::default(),
        file: None,
        origin: Origin::Start,
    }];
    let mut engine = Engine::new(setups.clone()).expect("opens");
    let state = engine.state();
    let session = Session::new(Link::Here(Box::new(engine)), state, setups);
    let mut harness = Harness::builder()
        .with_size(egui::vec2(1280.0, 800.0))
        .build_ui_state(|ui, workbench: &mut Workbench| workbench.ui(ui), Workbench::new(session));
    harness.run_steps(3);
    harness
}
