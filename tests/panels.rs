//! Every panel driven by its labels, and asserted on the commands and the world's state. No GPU, no window.

mod workbench;

use std::path::Path;

use egui::{Key, Modifiers, Role};
use egui_kittest::kittest::Queryable;
use tenter::app::engine::{LaneState, Order};
use tenter::scene::{Mass, Plane, Scene, Target};
use workbench::{Window, open};

#[path = "panels/recordings.rs"]
mod recordings;

fn lane(window: &Window, lane: usize) -> &LaneState {
    &window.state().session.state().lanes[lane]
}

fn scene(window: &Window) -> &Scene {
    &lane(window, 0).scene
}

/// Clicks what has this label, and waits for what comes of it.
fn click(window: &mut Window, label: &str) {
    window.get_by_label(label).scroll_to_me();
    window.run_steps(12);
    window.get_by_label(label).click();
    window.run_steps(4);
}

fn choose(window: &mut Window, combo: &str, choice: &str) {
    window.get_by_role_and_label(Role::ComboBox, combo).scroll_to_me();
    window.run_steps(12);
    window.get_by_role_and_label(Role::ComboBox, combo).click();
    window.run_steps(4);
    window.get_by_label(choice).click();
    window.run_steps(4);
}

fn press(window: &mut Window, modifiers: Modifiers, key: Key) {
    window.key_press_modifiers(modifiers, key);
    window.run_steps(4);
}

fn set(window: &mut Window, slider: &str, value: f64) {
    window.get_by_role_and_label(Role::Slider, slider).set_value_accesskit(value);
    window.run_steps(4);
}

fn step(window: &mut Window, steps: u32) {
    window.state_mut().session.order(Order::Step(steps));
    window.run_steps(3);
}

fn message(window: &Window) -> String {
    window.state().session.message.clone().unwrap_or_default()
}

#[test]
fn a_switch_changes_the_scene_and_undo_puts_it_back() {
    let mut window = open("()");
    click(&mut window, "Wind enabled");
    assert!(scene(&window).wind.enabled);
    window.get_by_label("Wind strength");
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert!(!scene(&window).wind.enabled);
    assert!(window.query_by_label("Wind strength").is_none(), "what is switched off hides its fields");
    press(&mut window, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert!(scene(&window).wind.enabled);
}

#[test]
fn a_slider_changes_the_scene_and_its_arrow_puts_the_default_back() {
    let mut window = open("()");
    set(&mut window, "Springs stretch stiffness", 500.0);
    assert_eq!(scene(&window).springs.stretch.stiffness, 500.0);
    click(&mut window, "Default of Springs stretch stiffness");
    assert_eq!(scene(&window).springs.stretch.stiffness, 1000.0);
}

#[test]
fn one_button_gives_all_springs_the_same_stiffness_as_one_edit() {
    let mut window = open("()");
    click(&mut window, "Same for all");
    let springs = &scene(&window).springs;
    assert_eq!((springs.shear.stiffness, springs.bend.stiffness), (1000.0, 1000.0));
    press(&mut window, Modifiers::COMMAND, Key::Z);
    let springs = &scene(&window).springs;
    assert_eq!((springs.shear.stiffness, springs.bend.stiffness), (300.0, 100.0));
}

#[test]
fn the_method_is_chosen_from_the_registry() {
    let mut window = open("()");
    choose(&mut window, "Method", "Verlet");
    assert_eq!(scene(&window).simulator.id, "verlet");
    assert!(window.query_by_label("Springs stretch stiffness").is_none(), "Verlet ignores the stiffness");
    assert!(window.query_by_label("Springs damping").is_none(), "and the springs' damping");
    window.get_by_label("Simulator params sweeps");
    let ratio = "Simulator params damping ratio";
    assert!(window.query_by_label(ratio).is_none(), "a ratio that the law of damping does not use");
    choose(&mut window, "Simulator params damping law", "Per step");
    window.get_by_label(ratio);
}

#[test]
fn step_and_reset_move_time() {
    let mut window = open("()");
    click(&mut window, "Step");
    assert_eq!(lane(&window, 0).steps, 1);
    click(&mut window, "Reset");
    assert_eq!(lane(&window, 0).time, 0.0);
    press(&mut window, Modifiers::NONE, Key::Period);
    assert_eq!(lane(&window, 0).steps, 2);
    press(&mut window, Modifiers::NONE, Key::Space);
    assert!(window.state().session.state().running);
    click(&mut window, "Pause");
    assert!(!window.state().session.state().running);
    press(&mut window, Modifiers::NONE, Key::CloseBracket);
    assert_eq!(window.state().session.state().speed, 2.0);
}

#[test]
fn the_target_is_edited_and_undone_with_its_shape() {
    let mut window = open("()");
    step(&mut window, 30);
    let before = lane(&window, 0).positions.clone();
    set(&mut window, "Target columns", 12.0);
    assert_eq!(lane(&window, 0).positions.len(), 12 * 25);
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!(lane(&window, 0).positions, before, "the hanging shape is there again");
    choose(&mut window, "Target plane", "Vertical");
    let Target::Grid(grid) = &scene(&window).target else { panic!("a grid") };
    assert_eq!(grid.plane, Plane::Vertical);
    choose(&mut window, "Mass kind", "per area");
    assert!(scene(&window).to_ron().expect("text").contains("PerArea"));
}

#[test]
fn the_selection_is_pinned_and_freed() {
    let mut window = open("()");
    window.state_mut().session.selection = [300, 301].into();
    window.run_steps(2);
    press(&mut window, Modifiers::NONE, Key::P);
    assert_eq!(lane(&window, 0).pinned, 8);
    press(&mut window, Modifiers::NONE, Key::P);
    assert_eq!(lane(&window, 0).pinned, 6);
    step(&mut window, 20);
    let before = lane(&window, 0).positions.clone();
    click(&mut window, "Free all");
    assert_eq!(lane(&window, 0).pinned, 0);
    step(&mut window, 20);
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!(lane(&window, 0).pinned, 6);
    assert_eq!(lane(&window, 0).positions, before, "what has fallen hangs where it hung");
}

#[test]
fn a_scene_opens_from_the_gallery_and_undo_brings_the_old_one_back() {
    let mut window = open("(dt: 0.01)");
    press(&mut window, Modifiers::COMMAND, Key::G);
    click(&mut window, "Open flag");
    assert_eq!(window.state().session.title(), "flag");
    assert_eq!(lane(&window, 0).positions.len(), 1000);
    assert!(!window.state().session.is_unsaved());
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!(window.state().session.title(), "flag", "leaving a scene is told first: {}", message(&window));
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!((window.state().session.title(), scene(&window).dt), ("test", 0.01));
}

#[test]
fn unsaved_changes_are_asked_for_once() {
    let mut window = open("()");
    click(&mut window, "Gravity enabled");
    press(&mut window, Modifiers::COMMAND, Key::G);
    click(&mut window, "Open flag");
    assert_eq!(window.state().session.title(), "test");
    click(&mut window, "Cancel");
    assert_eq!(window.state().session.title(), "test");
    press(&mut window, Modifiers::COMMAND, Key::G);
    click(&mut window, "Open flag");
    click(&mut window, "Do not save");
    assert_eq!(window.state().session.title(), "flag");
}

fn type_path(window: &mut Window, path: &Path, button: &str) {
    let field = window.get_by_role(Role::TextInput);
    field.focus();
    window.run_steps(2);
    press(window, Modifiers::COMMAND, Key::A);
    window.get_by_role(Role::TextInput).type_text(&path.to_string_lossy());
    window.run_steps(3);
    click(window, button);
}

#[test]
fn a_scene_is_saved_and_opened_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("mine.ron");
    let mut window = open("()");
    click(&mut window, "Tearing enabled");
    press(&mut window, Modifiers::COMMAND, Key::S);
    type_path(&mut window, &file, "Save");
    assert!(!window.state().session.is_unsaved(), "{}", message(&window));
    let saved = Scene::from_ron(&std::fs::read_to_string(&file).expect("a file")).expect("a scene");
    assert!(saved.tearing.enabled);
    press(&mut window, Modifiers::COMMAND, Key::N);
    assert!(!scene(&window).tearing.enabled);
    press(&mut window, Modifiers::COMMAND, Key::O);
    type_path(&mut window, &file, "Open");
    assert!(scene(&window).tearing.enabled, "{}", message(&window));
    assert_eq!(window.state().session.title(), "mine.ron");
    press(&mut window, Modifiers::COMMAND, Key::O);
    window.get_by_label_contains("mine.ron");
}

#[test]
fn a_mesh_opens_tells_what_was_found_and_saves_beside_itself() {
    let folder = tempfile::tempdir().expect("a folder");
    let mesh = folder.path().join("cape.obj");
    std::fs::copy("assets/meshes/cape_mixed.obj", &mesh).expect("a copy");
    let mut window = open("()");
    press(&mut window, Modifiers::COMMAND, Key::O);
    type_path(&mut window, &mesh, "Open");
    assert_eq!(window.state().session.title(), "cape.obj", "{}", message(&window));
    assert!(!window.state().session.running(), "nothing is pinned: it would fall out of sight");
    window.get_by_label_contains("quads");
    window.get_by_label("Target scale");
    press(&mut window, Modifiers::COMMAND, Key::S);
    click(&mut window, "Save");
    let text = std::fs::read_to_string(folder.path().join("cape.ron")).expect("beside the mesh");
    assert!(text.contains("\"cape.obj\""), "{text}");
}

#[test]
fn a_bare_mesh_has_the_defaults_and_is_offered_to_be_cotton() {
    let own = open("(target: Mesh(path: \"asset:cylinder_20x5.obj\"))");
    assert!(own.query_by_label("Make it light cotton").is_none(), "a built-in scene means its values");
    let mut window = open("()");
    press(&mut window, Modifiers::COMMAND, Key::O);
    type_path(&mut window, Path::new("assets/meshes/cape_mixed.obj"), "Open");
    let plain = scene(&window).clone();
    assert_eq!(plain, Scene { target: plain.target.clone(), ..Scene::default() }, "{}", message(&window));
    window.run_steps(2);
    click(&mut window, "Make it light cotton");
    assert_eq!(scene(&window).mass, Mass::PerArea(0.2));
    assert!(scene(&window).dt < 0.001);
    assert!(window.query_by_label("Make it light cotton").is_none());
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!(*scene(&window), plain, "one edit");
    click(&mut window, "Keep these values");
    assert!(window.query_by_label("Make it light cotton").is_none());
    assert_eq!(*scene(&window), plain);
}

#[test]
fn what_cannot_be_opened_is_told_and_changes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("bad.ron");
    std::fs::write(&file, "(dt: -1)").expect("writes");
    let mut window = open("()");
    for path in [file.as_path(), Path::new("nothing.obj")] {
        press(&mut window, Modifiers::COMMAND, Key::O);
        type_path(&mut window, path, "Open");
        assert_eq!(window.state().session.title(), "test");
        assert!(!message(&window).is_empty());
        assert_eq!(
            window.get_all_by_label(&message(&window)).count(),
            2,
            "in the status bar and in the question"
        );
        assert!(window.state().files.preferences.recent.is_empty());
    }
    assert_eq!(lane(&window, 0).positions.len(), 625);
}

const BURSTS: &str = "(simulator: (id: \"symplectic_euler\", params: {}), dt: 0.05)";

fn burst() -> Window {
    let mut window = open(BURSTS);
    step(&mut window, 400);
    assert!(lane(&window, 0).health.is_diverged());
    window
}

#[test]
fn the_banner_names_particle_time_and_cause() {
    let window = burst();
    window.get_by_label_contains("Paused at the last good state");
    window.get_by_label_contains("Symplectic Euler in this shape");
    window.get_by_label("Go back 2 s");
}

#[test]
fn the_banner_halves_dt_sets_a_step_that_holds_goes_back_and_resets() {
    let mut window = burst();
    click(&mut window, "Halve dt");
    assert_eq!(scene(&window).dt, 0.025);
    assert!(!lane(&window, 0).health.is_diverged());
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!(scene(&window).dt, 0.05);
    let mut window = burst();
    window.get_by_label_contains("Set dt to").click();
    window.run_steps(4);
    let dt = scene(&window).dt;
    assert!(dt < 0.05 && dt > 0.001, "{dt}");
    press(&mut window, Modifiers::NONE, Key::R);
    step(&mut window, (4.0 / dt) as u32);
    assert!(!lane(&window, 0).health.is_diverged(), "0.9 of the limit holds");
    let mut window = burst();
    let time = lane(&window, 0).time;
    click(&mut window, "Go back 2 s");
    assert!(lane(&window, 0).time < time);
    assert!(!lane(&window, 0).health.is_diverged());
}

#[test]
fn lanes_are_added_compared_and_removed() {
    let mut window = open("()");
    step(&mut window, 10);
    press(&mut window, Modifiers::COMMAND, Key::L);
    assert_eq!(window.state().session.state().lanes.len(), 2);
    window.state_mut().session.grab(300);
    for i in 0..20 {
        window.state_mut().session.drag(glam::DVec3::new(0.0, 0.1 * f64::from(i), 0.05 * f64::from(i)));
        step(&mut window, 2);
    }
    assert!(lane(&window, 0).positions[300][1] > 0.5);
    window.state_mut().session.release();
    step(&mut window, 20);
    assert_eq!(lane(&window, 1).distance, Some([0.0, 0.0]), "identical lanes stay equal to the bit");
    // The new lane is the chosen one: only its method changes.
    choose(&mut window, "Method", "Verlet");
    assert_eq!(scene(&window).simulator.id, "symplectic_euler");
    assert_eq!(lane(&window, 1).scene.simulator.id, "verlet");
    click(&mut window, "Gravity enabled");
    assert!(!scene(&window).gravity.enabled && !lane(&window, 1).scene.gravity.enabled);
    step(&mut window, 20);
    assert!(lane(&window, 1).distance.is_some_and(|[rms, most]| rms > 0.0 && most >= rms));
    click(&mut window, "Reference lane 2");
    assert_eq!(lane(&window, 1).distance, Some([0.0, 0.0]));
    click(&mut window, "Colour by distance");
    assert!(lane(&window, 0).values.as_ref().is_some_and(|values| values.iter().any(|d| *d > 0.0)));
    click(&mut window, "Overlaid");
    click(&mut window, "Remove lane 1");
    assert_eq!(window.state().session.state().lanes.len(), 1);
    assert_eq!(scene(&window).simulator.id, "verlet");
}

#[test]
fn a_click_within_one_picture_selects() {
    let mut window = open("()");
    press(&mut window, Modifiers::NONE, Key::F);
    let middle = window.get_by_label("Viewport").rect().center();
    window.hover_at(middle);
    window.run_steps(2);
    for pressed in [true, false] {
        window.event(egui::Event::PointerButton {
            pos: middle,
            button: egui::PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        });
    }
    window.run_steps(2);
    assert_eq!(window.state().session.selection.len(), 1, "the sheet is in the middle");
}

#[test]
fn adding_and_removing_lanes_is_undone_with_their_states() {
    let mut window = open("()");
    step(&mut window, 10);
    press(&mut window, Modifiers::COMMAND, Key::L);
    choose(&mut window, "Method", "RK4");
    step(&mut window, 50);
    let [first, second] = [0, 1].map(|i| lane(&window, i).positions.clone());
    assert_ne!(first, second);
    click(&mut window, "Remove lane 2");
    assert_eq!(window.state().session.state().lanes.len(), 1);
    step(&mut window, 20);
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!(window.state().session.state().lanes.len(), 2, "{}", message(&window));
    assert_eq!([0, 1].map(|i| lane(&window, i).positions.clone()), [first, second]);
    assert_eq!(lane(&window, 1).scene.simulator.id, "rk4");
    // Back through the method of the lane to before there was one, and forth again.
    for lanes in [2, 1] {
        press(&mut window, Modifiers::COMMAND, Key::Z);
        assert_eq!(window.state().session.state().lanes.len(), lanes);
    }
    for (lanes, method) in [(2, "symplectic_euler"), (2, "rk4"), (1, "symplectic_euler")] {
        press(&mut window, Modifiers::COMMAND, Key::Y);
        let state = window.state().session.state();
        assert_eq!(state.lanes.len(), lanes);
        assert_eq!(state.lanes[lanes - 1].scene.simulator.id, method);
        assert_eq!(window.state().session.scenes().len(), lanes);
    }
}

#[test]
fn the_first_lane_comes_back_too() {
    let mut window = open("()");
    press(&mut window, Modifiers::COMMAND, Key::L);
    choose(&mut window, "Method", "Verlet");
    click(&mut window, "Remove lane 1");
    assert_eq!(scene(&window).simulator.id, "verlet");
    press(&mut window, Modifiers::COMMAND, Key::Z);
    let methods = [0, 1].map(|i| lane(&window, i).scene.simulator.id.clone());
    assert_eq!(methods, ["symplectic_euler", "verlet"]);
}

#[test]
fn the_ramp_of_distances_follows_the_largest() {
    let mut window = open("()");
    press(&mut window, Modifiers::COMMAND, Key::L);
    choose(&mut window, "Method", "RK4");
    click(&mut window, "Colour by distance");
    step(&mut window, 50);
    let [_, most] = lane(&window, 1).distance.expect("a distance");
    let range = f64::from(window.state().display.distance_range);
    assert!(range >= most * (1.0 - 1e-6) && range <= 2.5 * most, "{range} m for {most} m");
}

#[test]
fn after_a_burst_the_view_shows_the_cloth_and_goes_back() {
    let mut window = open(BURSTS);
    let before = window.state().viewport.camera;
    step(&mut window, 400);
    window.run_steps(3);
    let shown = window.state().viewport.camera;
    assert_ne!(before, shown);
    let lane = lane(&window, 0).clone();
    let projector = shown.projector(glam::Vec2::new(600.0, 600.0));
    let is_inside = |p: &&[f32; 3]| {
        projector
            .pixel(glam::Vec3::from(**p))
            .is_some_and(|p| p.pixel.min_element() >= 0.0 && p.pixel.max_element() <= 600.0)
    };
    let inside = lane.positions.iter().filter(is_inside).count();
    assert_eq!(inside, lane.positions.len());
    press(&mut window, Modifiers::NONE, Key::R);
    assert_eq!(window.state().viewport.camera, before);
}

#[test]
fn a_drag_is_cancelled_or_taken_back_as_a_whole() {
    let mut window = open("()");
    step(&mut window, 20);
    let before = lane(&window, 0).positions.clone();
    let drag = |window: &mut Window| {
        window.state_mut().session.grab(312);
        window.state_mut().session.drag(glam::DVec3::new(0.0, 3.0, 0.0));
        step(window, 10);
        assert_ne!(lane(window, 0).positions, before);
    };
    drag(&mut window);
    window.state_mut().session.cancel_drag();
    window.run_steps(2);
    assert_eq!(lane(&window, 0).positions, before);
    drag(&mut window);
    window.state_mut().session.release();
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!(lane(&window, 0).positions, before);
}

#[test]
fn undo_mends_what_has_torn() {
    let mut window = open("(tearing: (max_ratio: 1.05))");
    click(&mut window, "Tearing enabled");
    step(&mut window, 150);
    assert!(lane(&window, 0).broken > 0);
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!(lane(&window, 0).broken, 0);
    assert!(!scene(&window).tearing.enabled);
}

#[test]
fn undo_of_any_edit_mends_what_has_torn_since() {
    let mut window = open("(tearing: (enabled: true, max_ratio: 1.9), dt: 0.01)");
    step(&mut window, 10);
    set(&mut window, "Gravity magnitude", 20.0);
    let time = lane(&window, 0).time;
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!((scene(&window).gravity.magnitude, lane(&window, 0).time), (10.0, time));
    set(&mut window, "Gravity magnitude", 80.0);
    step(&mut window, 200);
    assert!(lane(&window, 0).broken > 0);
    press(&mut window, Modifiers::COMMAND, Key::Z);
    assert_eq!((scene(&window).gravity.magnitude, lane(&window, 0).broken), (10.0, 0));
    press(&mut window, Modifiers::COMMAND, Key::Y);
    assert!(lane(&window, 0).broken > 0 && scene(&window).gravity.magnitude == 80.0);
}

#[test]
fn a_spring_pulls_instead_of_holding() {
    let mut window = open("(gravity: (enabled: false))");
    click(&mut window, "Pull");
    window.state_mut().session.grab(312);
    window.state_mut().session.drag(glam::DVec3::new(0.0, 2.0, 0.0));
    step(&mut window, 20);
    let height = lane(&window, 0).positions[312][1];
    assert!(height > 0.05 && height < 1.9, "{height}");
    assert!(message(&window).is_empty(), "{}", message(&window));
}

#[test]
fn display_changes_the_picture_and_not_the_scene() {
    let mut window = open("()");
    let before = scene(&window).clone();
    click(&mut window, "Surface by strain");
    assert!(lane(&window, 0).values.is_some());
    window.get_by_label("Shear springs").scroll_to_me();
    window.run_steps(3);
    click(&mut window, "Shear springs");
    assert!(window.state().style.springs[1]);
    assert_eq!(*scene(&window), before);
    assert!(!window.state().session.is_unsaved());
    press(&mut window, Modifiers::NONE, Key::T);
    assert_eq!(window.state().style.theme, tenter::app::render::Theme::Light);
}

#[test]
fn help_lists_every_key() {
    let mut window = open("()");
    press(&mut window, Modifiers::NONE, Key::F1);
    window.get_by_label("Pin or free the selection");
    window.get_by_label("Ctrl drag beside it");
    press(&mut window, Modifiers::NONE, Key::Escape);
    assert!(window.query_by_label("Ctrl drag beside it").is_none());
}

#[test]
fn typed_text_is_no_command() {
    let mut window = open("()");
    press(&mut window, Modifiers::COMMAND, Key::O);
    window.get_by_role(Role::TextInput).type_text("r.p");
    press(&mut window, Modifiers::NONE, Key::Period);
    assert_eq!(lane(&window, 0).steps, 0);
}

#[test]
fn the_view_follows_the_cloth_until_the_mouse_takes_over() {
    let mut window = open("()");
    let off = |window: &Window| {
        let viewport = &window.state().viewport;
        let centre = lane(window, 0).bounds.expect("a box").centre();
        let seen = viewport.camera.projector(viewport.size()).pixel(centre).expect("before the eye").pixel;
        seen.distance(viewport.size() / 2.0) / viewport.size().y
    };
    // It falls from its start to where it hangs.
    step(&mut window, 500);
    let before = off(&window);
    window.state_mut().session.run(true);
    window.run_steps(100);
    assert!(off(&window) < 0.1 && before > 0.1, "{before} then {}", off(&window));
    // A second fall, after the mouse has turned the view.
    window.get_by_label("Viewport").click();
    window.run_steps(3);
    let camera = window.state().viewport.camera;
    window.state_mut().session.reset();
    window.run_steps(30);
    assert_eq!(window.state().viewport.camera, camera);
    press(&mut window, Modifiers::NONE, Key::F);
    assert!(off(&window) < 0.1);
}
