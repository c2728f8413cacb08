//! The lab's dock driven by its labels, and asserted on the scene that its clicks lead to. No GPU, no window.

mod workbench;

use std::time::{Duration, Instant};

use egui::{Key, Modifiers, Role};
use egui_kittest::kittest::{NodeT, Queryable};
use tenter::app::engine::Order;
use tenter::scene::{Precision, Scene};
use workbench::{Window, open};

/// Four by four particles that hang by two corners and move little: studies of it are short.
const SMALL: &str = "(target: Grid(columns: 4, rows: 4, spacing: 0.25, plane: Horizontal), pins: [Particle(0), Particle(3)],
    mass: PerParticle(0.05), springs: (stretch: (stiffness: 100.0), shear: (stiffness: 30.0), bend: (stiffness: 0.1),
    damping: 0.05), air_damping: 1e-5, dt: 0.005)";

fn scene(window: &Window) -> &Scene {
    &window.state().session.state().lanes[0].scene
}

fn click(window: &mut Window, label: &str) {
    window.get_by_label(label).click();
    window.run_steps(4);
}

fn press(window: &mut Window, modifiers: Modifiers, key: Key) {
    window.key_press_modifiers(modifiers, key);
    window.run_steps(4);
}

/// Sets the simulated time of studies.
fn over(window: &mut Window, seconds: f64) {
    window.get_by_label("Simulated time").set_value_accesskit(seconds);
    window.run_steps(4);
}

/// Leaves all methods out but these.
fn only(window: &mut Window, methods: &[&str]) {
    click(window, "Methods to study");
    click(window, "None");
    for method in methods {
        click(window, &format!("Study {method}"));
    }
    press(window, Modifiers::NONE, Key::Escape);
    assert!(window.query_by_label("None").is_none(), "the menu is closed");
}

/// Draws until no study is under way.
fn wait(window: &mut Window) {
    let start = Instant::now();
    while window.state().lab.is_busy() {
        assert!(start.elapsed() < Duration::from_secs(100), "no end of the study");
        window.run_steps(1);
        std::thread::sleep(Duration::from_millis(5));
    }
    window.run_steps(4);
}

/// A small trade that counts only.
fn traded() -> Window {
    let mut window = open(SMALL);
    click(&mut window, "Lab");
    window.get_by_label_contains("Show or hide the lab").click();
    window.run_steps(4);
    over(&mut window, 0.2);
    only(&mut window, &["RK4", "Symplectic Euler"]);
    click(&mut window, "Measure time");
    click(&mut window, "Measure");
    wait(&mut window);
    window
}

#[test]
fn a_click_on_a_row_of_the_trade_uses_its_settings_and_undo_takes_it_back() {
    let mut window = traded();
    let before = scene(&window).clone();
    window.get_by_label_contains("test, from its state at 0.00 s, over 0.2 s");
    window.get_by_label_contains("Reference: rk4");
    let marks: Vec<String> = window
        .query_all_by_label_contains("RK4, Double, dt")
        .filter_map(|node| node.accesskit_node().label())
        .collect();
    assert!(marks.len() >= 5, "{marks:?}");
    click(&mut window, &marks[1]);
    assert_eq!(scene(&window).simulator.id, "rk4");
    assert_ne!(scene(&window).dt, before.dt);
    let rounded: f64 = format!("{:.2e}", scene(&window).dt).parse().expect("a number");
    assert_eq!(marks[1], format!("RK4, Double, dt {} s", tenter::params::Short(rounded)));
    assert!(
        window.query_by_label_contains("edited since").is_none(),
        "settings are what a trade varies itself"
    );
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!(*scene(&window), before);
    window.get_by_label("Gravity enabled").scroll_to_me();
    window.run_steps(12);
    click(&mut window, "Gravity enabled");
    window.get_by_label_contains("The scene was edited since");
    press(&mut window, Modifiers::COMMAND, Key::Z);
    // Switched off in the legend, a method's marks are gone.
    click(&mut window, "Show RK4");
    assert_eq!(window.query_all_by_label_contains("RK4, Double, dt").count(), 0);
    assert!(window.query_all_by_label_contains("Symplectic Euler, Double, dt").count() >= 5);
    // Another scene: the figures stay, but nothing of them can be used.
    press(&mut window, Modifiers::COMMAND, Key::N);
    window.get_by_label_contains("These are figures of another scene");
    let now = scene(&window).clone();
    window.query_all_by_label_contains("Symplectic Euler, Double, dt").nth(2).expect("a mark").click();
    window.run_steps(4);
    assert_eq!(*scene(&window), now);
}

#[test]
fn the_trade_button_measures_the_scene_as_it_stands_and_a_study_can_be_cancelled() {
    let mut window = open("()");
    window.state_mut().session.order(Order::Step(10));
    window.run_steps(3);
    click(&mut window, "Trade");
    assert!(window.state().lab.is_open && window.state().lab.is_busy());
    window.get_by_label("Progress of the study");
    // The interface goes on.
    press(&mut window, Modifiers::NONE, Key::Period);
    assert_eq!(window.state().session.state().lanes[0].steps, 11);
    click(&mut window, "Cancel study");
    wait(&mut window);
    window.get_by_label_contains("cancelled");
    click(&mut window, "Trade");
    assert!(window.state().lab.is_busy(), "nothing whole is known");
    press(&mut window, Modifiers::COMMAND, Key::N);
    wait(&mut window);
    assert_eq!(window.state().session.title(), "sheet");
}

#[test]
fn rows_appear_while_the_trade_is_under_way() {
    let mut window =
        open("(target: Grid(columns: 12, rows: 12, spacing: 0.1, plane: Horizontal), dt: 0.005)");
    press(&mut window, Modifiers::NONE, Key::M);
    over(&mut window, 0.5);
    only(&mut window, &["RK4", "Velocity Verlet", "BDF2"]);
    click(&mut window, "Measure");
    let start = Instant::now();
    while window.query_all_by_label_contains(", Double, dt").count() == 0 {
        assert!(window.state().lab.is_busy(), "rows came before the end");
        assert!(start.elapsed() < Duration::from_secs(100), "no rows");
        window.run_steps(1);
        std::thread::sleep(Duration::from_millis(5));
    }
    click(&mut window, "Cancel study");
    wait(&mut window);
    assert!(window.query_all_by_label_contains(", Double, dt").count() > 0, "what there was stays");
    window.get_by_label_contains("Not whole");
}

#[test]
fn time_is_measured_while_the_simulation_pauses() {
    let mut window = open(SMALL);
    press(&mut window, Modifiers::NONE, Key::M);
    over(&mut window, 0.1);
    only(&mut window, &["RK4"]);
    press(&mut window, Modifiers::NONE, Key::Space);
    click(&mut window, "Measure");
    let (start, mut has_paused) = (Instant::now(), false);
    while window.state().lab.is_busy() {
        assert!(start.elapsed() < Duration::from_secs(100), "no end of the study");
        window.run_steps(1);
        has_paused |= !window.state().session.running();
        std::thread::sleep(Duration::from_millis(1));
    }
    window.run_steps(4);
    assert!(has_paused && window.state().session.running(), "it runs again");
    assert!(window.query_by_label_contains("disturbed").is_none());
    click(&mut window, "Time");
    assert!(window.query_all_by_label_contains("RK4, Double, dt").count() >= 5);
}

#[test]
fn a_click_on_the_map_sets_dt_and_stiffness() {
    let mut window = open(SMALL);
    press(&mut window, Modifiers::NONE, Key::M);
    click(&mut window, "Stability tab");
    over(&mut window, 0.1);
    click(&mut window, "Measure");
    wait(&mut window);
    window.get_by_label_contains("limit in theory");
    let before = scene(&window).clone();
    let marks: Vec<String> =
        window.query_all_by_label_contains("N/m: quiet").filter_map(|n| n.accesskit_node().label()).collect();
    assert!(marks.len() > 10, "{marks:?}");
    let mark = marks
        .iter()
        .find(|mark| mark.contains(", 300 N/m") && marks.iter().filter(|m| m == mark).count() == 1);
    click(&mut window, mark.expect("three times the stiffness"));
    assert!((scene(&window).springs.stretch.stiffness / 300.0 - 1.0).abs() < 1e-9);
    assert_ne!(scene(&window).dt, before.dt);
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!(*scene(&window), before);
    // A place between the runs.
    let rect = window.get_by_label("Map of zones").rect();
    window.hover_at(rect.left_top() + rect.size() * egui::vec2(0.9, 0.13));
    window.run_steps(2);
    window.get_by_label("Map of zones").click();
    window.run_steps(4);
    assert_ne!(*scene(&window), before);
}

#[test]
fn what_is_not_needed_is_left_out_in_one_edit() {
    let mut window = open(SMALL);
    press(&mut window, Modifiers::NONE, Key::M);
    click(&mut window, "Ablation tab");
    over(&mut window, 0.3);
    click(&mut window, "Measure time");
    click(&mut window, "Measure");
    wait(&mut window);
    window.get_by_label("Verdict");
    let before = scene(&window).clone();
    click(&mut window, "Leave out");
    assert_eq!(scene(&window).air_damping, 0.0, "so little of it matters not");
    assert_eq!(scene(&window).precision, Precision::Single);
    assert!(scene(&window).gravity.enabled && scene(&window).springs.stretch.enabled);
    window.get_by_label_contains("The scene was edited since");
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!(*scene(&window), before);
}

#[test]
fn advice_is_applied_and_says_where_nothing_meets_it() {
    let mut window = open(SMALL);
    press(&mut window, Modifiers::NONE, Key::M);
    click(&mut window, "Advice tab");
    over(&mut window, 0.2);
    only(&mut window, &["Symplectic Euler", "Velocity Verlet"]);
    click(&mut window, "Measure time");
    window.get_by_label("Tolerance").set_value_accesskit(1e-3);
    window.run_steps(4);
    click(&mut window, "Search");
    wait(&mut window);
    window.get_by_label_contains("Seen quiet for 60 simulated seconds");
    let before = scene(&window).clone();
    click(&mut window, "Apply");
    assert_ne!(*scene(&window), before);
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!(*scene(&window), before);
    // No step is as cheap as a microsecond a frame asks for.
    click(&mut window, "Keep a budget");
    window.get_by_label("Budget").set_value_accesskit(1e-3);
    window.run_steps(4);
    click(&mut window, "Search");
    wait(&mut window);
    window.get_by_label_contains("Nothing meets this; the closest is");
}

#[test]
fn what_was_found_is_exported() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut window = traded();
    click(&mut window, "Export…");
    let path = folder.path().join("found");
    let field = window.get_by_role(Role::TextInput);
    field.focus();
    window.run_steps(2);
    press(&mut window, Modifiers::COMMAND, Key::A);
    window.get_by_role(Role::TextInput).type_text(&path.to_string_lossy());
    window.run_steps(3);
    click(&mut window, "Write");
    let page = path.join("report.html");
    let start = Instant::now();
    while !page.exists() && start.elapsed() < Duration::from_secs(20) {
        window.run_steps(1);
        std::thread::sleep(Duration::from_millis(5));
    }
    for name in ["trade.csv", "trade.json", "trade.svg", "trade.txt", "trade.ron"] {
        let text = std::fs::read_to_string(path.join(name)).expect(name);
        assert!(text.len() > 100, "{name}: {text}");
    }
    let page = std::fs::read_to_string(page).expect("a page");
    assert!(page.contains("<svg") && page.contains("tenter trade trade.ron --seconds 0.2"), "{page}");
    let saved =
        Scene::from_ron(&std::fs::read_to_string(path.join("trade.ron")).expect("text")).expect("a scene");
    assert_eq!(saved, *scene(&window));
}
