//! The Export window driven by its labels. What is not drawn needs no GPU.

mod workbench;

use std::path::Path;

use egui::Role;
use egui_kittest::kittest::Queryable;
use tenter::app::panels::Action;
use workbench::Window;

/// A workbench with its Export window open.
fn open(ron: &str) -> Window {
    let mut window = workbench::open(ron);
    window.state_mut().perform(&Action::Export);
    window.run_steps(4);
    window
}

fn type_path(window: &mut Window, path: &Path) {
    window.get_by_role(Role::TextInput).focus();
    window.run_steps(2);
    window.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
    window.run_steps(2);
    window.get_by_role(Role::TextInput).type_text(&path.to_string_lossy());
    window.run_steps(3);
}

fn click(window: &mut Window, label: &str) {
    window.get_by_role_and_label(Role::Button, label).click();
    window.run_steps(4);
}

fn set(window: &mut Window, field: &str, value: f64) {
    window.get_by_role_and_label(Role::SpinButton, field).set_value_accesskit(value);
    window.run_steps(4);
}

/// Waits until the export has ended; what it told.
fn told(window: &mut Window) -> String {
    while window.query_by_role_and_label(Role::Button, "Cancel").is_some() {
        std::thread::sleep(std::time::Duration::from_millis(5));
        window.run_steps(1);
    }
    window.state().session.message.clone().unwrap_or_default()
}

#[test]
fn a_motion_is_exported_with_the_time_and_rate_that_were_set() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("motion.csv");
    let mut window = open("()");
    type_path(&mut window, &path);
    set(&mut window, "Simulated time", 0.5);
    set(&mut window, "Frames a second", 10.0);
    click(&mut window, "Export");
    assert_eq!(told(&mut window), format!("exported: {}", path.display()));
    let rows = std::fs::read_to_string(&path).expect("a table").lines().count();
    assert_eq!(rows, 1 + 6, "a heading, and frames from 0 to 0.5 s");
}

#[test]
fn what_the_format_cannot_show_is_told_before() {
    let mut window = open("(tearing: (enabled: true))");
    let told = |window: &Window| window.query_by_label_contains("Exported faces stay closed").is_some();
    assert!(told(&window), "glTF is proposed");
    assert!(window.query_by_role_and_label(Role::SpinButton, "Width").is_none(), "which has no pixels");
    window.get_by_role_and_label(Role::ComboBox, "Format").click();
    window.run_steps(4);
    window.get_by_label("gif: an animated picture").click();
    window.run_steps(4);
    assert!(!told(&window));
    let width =
        |window: &Window| window.get_by_role_and_label(Role::SpinButton, "Width").value().expect("a number");
    assert!(width(&window).starts_with("640"), "{}", width(&window));
    set(&mut window, "Width", 320.0);
    assert!(width(&window).starts_with("320"), "{}", width(&window));
}

#[test]
fn a_path_that_tells_no_format_is_refused() {
    let mut window = open("()");
    type_path(&mut window, Path::new("motion.xyz"));
    click(&mut window, "Export");
    assert!(window.query_by_label_contains("the extension 'xyz' is not known").is_some());
    window.get_by_role_and_label(Role::Button, "Browse…");
}

#[test]
fn cancel_leaves_nothing() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut window = open("()");
    type_path(&mut window, &dir.path().join("motion.pc2"));
    set(&mut window, "Simulated time", 1000.0);
    click(&mut window, "Export");
    click(&mut window, "Cancel");
    assert!(told(&mut window).contains("nothing is written"));
    assert_eq!(std::fs::read_dir(dir.path()).expect("a folder").count(), 0);
}
