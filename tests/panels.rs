//! Every panel driven by its labels, and asserted on the commands and the world's state. No GPU, no window.

use egui_kittest::{Harness, kittest::Queryable};
use tenter::app::{
    engine::{Engine, LaneSetup},
    session::{Link, Session},
    workbench::Workbench,
};
use tenter::scene::{Place, Scene};

/// A workbench on a scene, whose engine runs only when told to.
fn open(ron: &str) -> Harness<'static, Workbench> {
    let scene = Scene::from_ron(ron).expect("a scene");
    let setups = vec![LaneSetup { title: "test".to_owned(), scene, place: Place::default(), file: None }];
    let mut engine = Engine::new(setups.clone()).expect("opens");
    let state = engine.state();
    let session = Session::new(Link::Here(Box::new(engine)), state, setups);
    let mut harness = Harness::builder()
        .with_size(egui::vec2(1280.0, 800.0))
        .build_ui_state(|ui, workbench: &mut Workbench| workbench.ui(ui), Workbench::new(session));
    harness.run_steps(2);
    harness
}

fn scene<'a>(harness: &'a Harness<'_, Workbench>) -> &'a Scene {
    &harness.state().session.state().lanes[0].scene
}

#[test]
fn a_switch_changes_the_scene_and_undo_puts_it_back() {
    let mut harness = open("()");
    harness.get_by_label("Wind enabled").click();
    harness.run_steps(3);
    assert!(scene(&harness).wind.enabled);
    harness.get_by_label("Wind strength");
    harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::Z);
    harness.run_steps(3);
    assert!(!scene(&harness).wind.enabled);
    assert!(harness.query_by_label("Wind strength").is_none(), "what is switched off hides its fields");
}

#[test]
fn the_method_is_chosen_from_the_registry() {
    let mut harness = open("()");
    harness.get_by_role_and_label(egui::Role::ComboBox, "Method").click();
    harness.run_steps(3);
    harness.get_by_label("Verlet").click();
    harness.run_steps(3);
    assert_eq!(scene(&harness).simulator.id, "verlet");
    assert!(harness.query_by_label("Springs stretch stiffness").is_none(), "Verlet ignores the stiffness");
}

#[test]
fn step_and_reset_move_time() {
    let mut harness = open("()");
    harness.get_by_label("Step").click();
    harness.run_steps(3);
    assert_eq!(harness.state().session.state().lanes[0].steps, 1);
    harness.get_by_label("Reset").click();
    harness.run_steps(3);
    assert_eq!(harness.state().session.state().lanes[0].time, 0.0);
}
