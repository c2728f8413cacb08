//! The lab against independent numbers: errors, orders, energy, stability, ablation, advice. Counts and errors, never time.

use glam::DVec3;
use tenter::forces::Spectrum;
use tenter::forces::gravity::Gravity;
use tenter::forces::springs::SpringParams;
use tenter::forces::wind::Wind;
use tenter::lab::reference::References;
use tenter::lab::trial::Zone;
use tenter::lab::{
    Case, Effort, Event, Journal, Settings, ablation, advice, equilibrium, metrics, report, stability, trade,
    trial,
};
use tenter::scene::{self, GridTarget, Mass, Pin, Pins, Place, Plane, Precision, Scene, Target};
use tenter::simulators::{self, SimulatorSettings, Value};
use tenter::world::World;

/// W1: 10 x 10, horizontal, hung by two corners, no spring damping.
fn w1() -> Scene {
    Scene {
        target: Target::Grid(GridTarget { columns: 10, rows: 10, spacing: 0.1, plane: Plane::Horizontal }),
        pins: Pins::of([Pin::Particle(0), Pin::Particle(9)]),
        mass: Mass::PerParticle(0.02),
        springs: SpringParams { damping: 0.0, ..SpringParams::default() },
        air_damping: 0.01,
        gravity: Gravity { magnitude: 9.81, ..Gravity::default() },
        ..Scene::default()
    }
}

/// RMS distance over the free particles.
fn rms(world: &World, a: &[DVec3], b: &[DVec3]) -> f64 {
    let free = || world.pinned().iter().zip(a.iter().zip(b)).filter(|(pinned, _)| !**pinned);
    (free().map(|(_, (a, b))| a.distance_squared(*b)).sum::<f64>() / free().count() as f64).sqrt()
}

fn close(value: f64, expected: f64, part: f64, what: &str) {
    assert!((value / expected - 1.0).abs() < part, "{what}: {value:.4e}, expected {expected:.4e}");
}

/// Positions at five equally spaced times up to T = 0.5 s, as the figures were taken.
fn sampled(simulator: SimulatorSettings, steps: u32) -> (World, Vec<Vec<DVec3>>) {
    let scene = Scene { simulator, dt: 0.5 / f64::from(steps), ..w1() };
    let mut world = World::new(scene, Place::default()).expect("a scene");
    let samples = (0..5).map(|_| {
        (0..steps / 5).for_each(|_| world.step());
        world.positions()
    });
    let samples = samples.collect();
    (world, samples)
}

#[test]
fn the_trade_of_w1_has_the_declared_orders_and_says_what_it_cannot_tell() {
    let case = case(w1(), 0.5);
    let simulators = ["symplectic_euler", "velocity_verlet", "rk4", "verlet"];
    let table = counted(&case, &simulators, &Journal::new());
    let reference = table.reference.as_ref().expect("a reference");
    assert!(reference.uncertainty < 2.4e-10, "{}", reference.uncertainty);
    assert!(reference.second_distance < 10.0 * reference.uncertainty, "{}", reference.second_distance);
    close(reference.displacement, 0.467, 0.002, "displacement");
    close(reference.valid_until, 0.5, 1e-9, "valid until");
    for (simulator, order) in [("symplectic_euler", 1.0), ("velocity_verlet", 2.0), ("rk4", 4.0)] {
        let found = table.orders.iter().find(|o| o.simulator == simulator).expect("an order");
        assert!((found.observed.expect("halvings") - order).abs() < 0.05 && !found.flagged, "{found:?}");
    }
    for row in &table.rows {
        let burst = row.health == Zone::Diverged;
        assert_eq!(row.rms_error.is_none(), burst, "{row:?}");
        assert_eq!(row.same_model, row.settings.simulator != "verlet");
        assert!(row.same_model || row.limit_error.is_some() && !row.pareto, "{row:?}");
        if row.same_model && !burst {
            // A shape at rest stays there, up to rounding.
            let single = row.settings.precision == Precision::Single;
            let moved = row.equilibrium_error.expect("W1 has an equilibrium");
            assert!(moved < if single { 1e-3 } else { 1e-9 }, "{row:?}");
        }
    }
    assert!(table.rows.iter().any(|row| row.health == Zone::Diverged), "the row above the limit stays");
    assert!(table.rows.iter().any(|row| row.below_reference), "rk4 at its finest is below the reference");
    assert!(table.rows.iter().any(|row| row.pareto));
    // What is compared after trajectories part comes to the same as dt goes to 0.
    for simulator in ["symplectic_euler", "velocity_verlet", "rk4"] {
        let rows = table.rows.iter().filter(|row| row.settings.simulator == simulator);
        let finest = rows.min_by(|a, b| a.settings.dt.total_cmp(&b.settings.dt)).expect("a row");
        let apart = finest.statistics.as_ref().expect("statistics").apart(&reference.statistics);
        assert!(apart.centre < 1e-3 && apart.energy < 1e-2, "{simulator} {apart:?}");
        assert!(apart.strain[0] < 1e-4 && apart.strain[1] < 1e-3, "{simulator} {apart:?}");
        assert_eq!(reference.statistics.strain.len(), 3);
    }
    // Relaxation: its stiffness is a matter of dt and sweeps, and the table says so with these figures.
    let told = report::trade(&table);
    assert!(
        told.contains(
            "a matter of dt and sweeps, not of stiffness. Its largest strain here, dt 2.500e-2 s: "
        )
    );
    let strain = |dt: f64, sweeps: u64| {
        let row = table.rows.iter().find(|row| {
            row.settings.dt == dt && row.settings.params.values().next() == Some(&Value::Count(sweeps))
        });
        row.and_then(|row| row.max_strain).expect("a row")
    };
    assert!(strain(0.025, 1) > 2.0 * strain(0.025, 4) && strain(0.025, 4) > 2.0 * strain(0.025, 16));
    assert!(strain(0.025, 4) > 2.0 * strain(0.0125, 4) && strain(0.0125, 4) > 2.0 * strain(0.00625, 4));
}

/// Errors on W1, relative to the motion, as functions of method and steps.
fn w1_error() -> impl Fn(&[Vec<DVec3>]) -> f64 {
    let (world, reference) = sampled(SimulatorSettings::new("rk4"), 6400);
    let start = vec![World::new(w1(), Place::default()).expect("a scene").positions(); 5];
    let over_all = move |a: &[Vec<DVec3>], b: &[Vec<DVec3>]| {
        (a.iter().zip(b).map(|(a, b)| rms(&world, a, b).powi(2)).sum::<f64>() / 5.0).sqrt()
    };
    let displacement = over_all(&start, &reference);
    close(displacement, 0.467, 0.002, "displacement");
    move |samples| over_all(samples, &reference) / displacement
}

#[test]
fn errors_on_w1_are_those_of_an_independent_implementation() {
    let error = w1_error();
    for (simulator, figures) in [
        ("symplectic_euler", &[(200, 6.15e-3), (400, 3.07e-3), (1600, 7.66e-4), (6400, 1.91e-4)][..]),
        ("velocity_verlet", &[(200, 9.21e-5), (400, 2.27e-5), (1600, 1.41e-6), (6400, 8.84e-8)]),
        ("rk4", &[(100, 3.80e-5), (200, 2.15e-6), (400, 1.32e-7)]),
        ("implicit_euler", &[(30, 4.05e-2), (120, 1.62e-2), (480, 5.60e-3)]),
        ("implicit_midpoint", &[(30, 6.43e-3), (120, 4.78e-4), (480, 3.16e-5)]),
    ] {
        for &(steps, expected) in figures {
            let own = error(&sampled(SimulatorSettings::new(simulator), steps).1);
            close(own, expected, 0.01, &format!("{simulator} {steps}"));
        }
    }
    // Springs one after the other: what their order does to it is told as 20 %.
    let small_steps = || SimulatorSettings::new("xpbd").with("substeps", Value::Count(1));
    for (steps, expected) in [(30, 2.1e-1), (120, 3.1e-2), (480, 5.9e-3), (1920, 1.6e-3), (7680, 4.1e-4)] {
        close(error(&sampled(small_steps(), steps).1), expected, 0.2, &format!("xpbd {steps}"));
    }
    assert!(sampled(SimulatorSettings::new("symplectic_euler"), 100).0.health().is_diverged());
}

/// A listener that lets everything go on.
fn on(_: Event) -> bool {
    true
}

fn case(scene: Scene, seconds: f64) -> Case {
    Case::new(scene, Place::default(), seconds).expect("a case")
}

fn counted(case: &Case, simulators: &[&str], journal: &Journal) -> trade::Trade {
    let simulators = simulators.iter().map(|&name| name.to_owned()).collect();
    let options = trade::Options { simulators, time: false };
    trade::run(case, &options, &References::default(), journal, &on).expect("a table")
}

#[test]
fn every_method_is_tried_at_five_steps_and_with_every_effort_it_declares() {
    let plan = trade::plan(&case(w1(), 0.5), &[]).expect("a plan");
    for entry in simulators::ALL {
        for params in tenter::lab::variants(entry) {
            for precision in [Precision::Double, Precision::Single] {
                let rows = plan
                    .iter()
                    .filter(|s| s.simulator == entry.id && s.params == params && s.precision == precision);
                let steps: Vec<f64> = rows.map(|s| s.dt).collect();
                assert!(steps.len() >= 5, "{} {steps:?}", entry.id);
                assert!(
                    steps.windows(2).all(|dt| (dt[0] / dt[1] - 2.0).abs() < 1e-9),
                    "{} {steps:?}",
                    entry.id
                );
            }
        }
        let efforts = Effort::of(entry, &std::collections::BTreeMap::new());
        let spends =
            entry.params.iter().any(|p| ["sweeps", "iterations", "substeps", "tolerance"].contains(p));
        assert_eq!(spends, !efforts.is_empty(), "{}", entry.id);
    }
}

#[test]
fn a_run_that_would_cost_too_much_is_given_up_by_counts() {
    let case = case(w1(), 0.5);
    let scene = Scene { dt: 0.001, ..w1() };
    let whole = trial::run_scene(&case, scene.clone(), &on).expect("a trial").cost.spring_visits;
    let within = |most_visits| {
        let keep = trial::Keep { most_visits: Some(most_visits), ..trial::Keep::default() };
        trial::run(&case, scene.clone(), keep, &on).expect("a trial")
    };
    assert!(!within(whole).given_up);
    let almost = within(whole * 9 / 10);
    assert!(almost.given_up && almost.cost.spring_visits < whole, "it stops where the cap is");
    // One that plainly cannot end is not run up to the cap.
    let far = within(whole / 10);
    assert!(far.given_up && far.cost.spring_visits < whole / 10, "{:?}", far.cost);
}

/// A 10 x 10 sheet hung by one corner, as in the table of damped limits.
fn corner(damping: f64, air_damping: f64) -> Scene {
    Scene {
        target: Target::Grid(GridTarget { columns: 10, rows: 10, ..GridTarget::default() }),
        pins: Pins::of([Pin::Particle(0)]),
        springs: SpringParams { damping, ..SpringParams::default() },
        air_damping,
        ..Scene::default()
    }
}

fn limit(case: &Case, simulator: &str) -> stability::Limit {
    let (problem, state) = case.start().problem(case.scene()).expect("a problem");
    stability::limit(&problem, &state, &Settings::double(simulator, 0.01), &on).expect("limits")
}

/// Measured over theory.
fn ratio(limit: &stability::Limit) -> f64 {
    limit.dt_measured.expect("a limit") / limit.dt_theory.expect("a limit")
}

/// A scene in the shape in which it hangs still.
fn hanging(scene: Scene) -> Case {
    let case = case(scene, 1.0);
    let rest = equilibrium::find(&case, case.scene(), &on).expect("a search").expect("a shape at rest");
    assert!(rest.smallest_eigenvalue > 0.0);
    let still = vec![DVec3::ZERO; rest.positions.len()];
    case.from(case.start().moved(&rest.positions, &still))
}

/// A scene after it has run for a while: stretched, in motion, and somewhere compressed, so that it buckles by itself.
fn running(scene: Scene, seconds: f64) -> Case {
    let mut world = World::new(Scene { dt: 0.005, ..scene }, Place::default()).expect("a scene");
    while world.time() < seconds {
        world.step();
    }
    assert!(world.spectrum().extreme(-1.0, 0.0).omega_squared < -1.0, "nothing buckles");
    Case::at(world.snapshot(), Place::default(), 1.0)
}

#[test]
fn limits_of_a_shape_in_motion_are_those_of_theory_too() {
    let undamped = limit(&running(corner(0.0, 1.0), 2.0), "symplectic_euler");
    assert!((ratio(&undamped) - 1.0).abs() < 0.02, "{undamped:?}");
    for (seconds, methods) in [(1.0, 1), (2.0, 4)] {
        let damped = running(corner(2.0, 1.0), seconds);
        for simulator in &["explicit_euler", "symplectic_euler", "velocity_verlet", "rk4"][..methods] {
            let limit = limit(&damped, simulator);
            assert!((ratio(&limit) - 1.0).abs() < 0.05, "{seconds} s {limit:?}");
        }
    }
}

/// A strip of quads whose areas grow to a thousandfold, mass by area.
fn uneven(folder: &std::path::Path, damping: f64) -> Case {
    let mut text = String::new();
    let mut x = 0.0;
    for i in 0..=8 {
        text += &format!("v {x} 0 0\nv {x} 1 0\n");
        x += 0.01 * 1000f64.powf(f64::from(i) / 7.0);
    }
    for i in 0..8 {
        let a = 2 * i + 1;
        text += &format!("f {} {} {} {}\n", a, a + 2, a + 3, a + 1);
    }
    std::fs::write(folder.join("strip.obj"), text).expect("a file");
    let scene = Scene {
        target: Target::mesh("strip.obj"),
        mass: Mass::PerArea(1.0),
        springs: SpringParams { damping, ..SpringParams::default() },
        air_damping: 0.0,
        ..Scene::default()
    };
    Case::new(scene, Place::folder(folder), 1.0).expect("a case")
}

#[test]
fn measured_limits_are_those_of_theory() {
    let folder = tempfile::tempdir().expect("a folder");
    let damped =
        |scene: Scene, damping| Scene { springs: SpringParams { damping, ..scene.springs.clone() }, ..scene };
    let cylinder = scene::builtin::find("cylinder").expect("built in").make;
    for (name, plain, with_damping) in [
        ("flat", case(corner(0.0, 0.0), 1.0), case(corner(20.0, 1.0), 1.0)),
        // Hanging still: a shape that buckles grows by itself, whatever the method.
        ("stretched", hanging(corner(0.0, 1.0)), hanging(corner(2.0, 1.0))),
        ("mesh", case(damped(cylinder(), 0.0), 1.0), case(cylinder(), 1.0)),
        ("masses", uneven(folder.path(), 0.0), uneven(folder.path(), 0.5)),
        // Light damping of all springs alike has not the shapes of stiffnesses that differ: its motions decide.
        ("damped", case(corner(0.0, 1.0), 1.0), case(corner(2.0, 1.0), 1.0)),
    ] {
        for simulator in ["symplectic_euler", "velocity_verlet"] {
            let undamped = limit(&plain, simulator);
            assert!((ratio(&undamped) - 1.0).abs() < 0.02, "{name} {undamped:?}");
        }
        for simulator in ["explicit_euler", "symplectic_euler", "velocity_verlet"] {
            let damped = limit(&with_damping, simulator);
            assert!((ratio(&damped) - 1.0).abs() < 0.05, "{name} {damped:?}");
            assert!(damped.dt_guaranteed <= damped.dt_measured.map(|dt| 1.01 * dt), "{name} {damped:?}");
        }
    }
}

#[test]
fn damped_limits_are_those_of_an_independent_implementation() {
    for (damping, symplectic, explicit) in
        [(2.0, 0.0234, 4.1e-3), (20.0, 0.0062, 6.4e-3), (200.0, 0.00064, 6.4e-4)]
    {
        let case = case(corner(damping, 1.0), 1.0);
        for (name, expected) in [("symplectic_euler", symplectic), ("explicit_euler", explicit)] {
            let limit = limit(&case, name);
            // The independent figures have two digits.
            close(limit.dt_measured.expect("a limit"), expected, 0.01, &format!("{name} {damping}"));
            assert!((ratio(&limit) - 1.0).abs() < 0.05, "{name} {damping} {limit:?}");
        }
    }
    // Undamped, explicit Euler has no stable step: its growth is told down to a fiftieth of the others' limit.
    let undamped = limit(&case(corner(0.0, 0.0), 1.0), "explicit_euler");
    assert_eq!(undamped.dt_theory, Some(0.0));
    assert!(undamped.dt_measured.expect("a limit") < 0.001, "{undamped:?}");
}

#[test]
fn the_unsettled_band_lies_where_an_independent_implementation_has_it() {
    let sheet = case(Scene::default(), 60.0);
    let zone = |dt: f64, stiffness: f64| {
        let mut scene = Scene { dt, ..Scene::default() };
        scene.springs.stretch.stiffness = stiffness;
        stability::zone(&sheet, scene, &on).expect("a zone")
    };
    for (dt, stiffness, expected) in [
        (0.0215, 1000.0, Zone::Quiet),
        (0.022, 1000.0, Zone::Quiet),
        (0.0225, 1000.0, Zone::Unsettled),
        (0.0235, 1000.0, Zone::Unsettled),
        (0.0245, 1000.0, Zone::Unsettled),
        (0.0255, 1000.0, Zone::Diverged),
        (0.02, 1300.0, Zone::Quiet),
        (0.02, 1400.0, Zone::Unsettled),
        (0.02, 1700.0, Zone::Unsettled),
        (0.02, 1800.0, Zone::Diverged),
    ] {
        assert_eq!(zone(dt, stiffness), expected, "dt {dt}, k {stiffness}");
    }
}

fn advised(case: &Case, wanted: f64, references: &References) -> advice::Advice {
    let goal = advice::Goal::MaxError(wanted);
    let options = advice::Options { simulators: Vec::new(), goal, time: false };
    advice::run(case, &options, references, &Journal::new(), &on).expect("advice")
}

/// Ten small scenes, each with an error that is asked for, m.
fn ten() -> Vec<(&'static str, Scene, f64)> {
    let small = |columns, rows| Target::Grid(GridTarget { columns, rows, ..GridTarget::default() });
    let stiff = |scene: Scene, factor: f64| {
        let mut scene = scene;
        for kind in [&mut scene.springs.stretch, &mut scene.springs.shear, &mut scene.springs.bend] {
            kind.stiffness *= factor;
        }
        scene
    };
    let windy = Wind { enabled: true, ..Wind::default() };
    let sheet = Scene { target: small(8, 8), ..Scene::default() };
    let cylinder = scene::builtin::find("cylinder").expect("built in").make;
    vec![
        ("sheet, rough", sheet.clone(), 0.05),
        ("sheet, fine", sheet.clone(), 1e-4),
        ("sheet, finer", sheet.clone(), 1e-7),
        ("W1, rough", w1(), 3e-3),
        ("W1, fine", w1(), 1e-5),
        ("soft", stiff(sheet.clone(), 0.05), 1e-3),
        ("stiff", stiff(sheet.clone(), 20.0), 1e-3),
        ("wind", Scene { wind: windy, ..sheet }, 1e-2),
        ("corner", corner(20.0, 1.0), 1e-3),
        ("cylinder", cylinder(), 1e-3),
    ]
}

#[test]
fn advice_costs_little_more_than_the_best_of_a_brute_force_search() {
    for (name, scene, wanted) in ten() {
        let case = case(scene, 0.4);
        let references = References::default();
        let advice = advised(&case, wanted, &references);
        assert!(advice.met && advice.error.expect("an error") <= wanted, "{name} {advice:?}");
        assert!(
            advice.quiet_seconds == 60.0 && advice.trials < 10 * advice.candidates.len() as u64,
            "{name} {advice:?}"
        );
        let reference = references.of(&case, &on).expect("a reference");
        let free = case.free();
        let (problem, state) = case.start().problem(case.scene()).expect("a problem");
        let spectrum = Spectrum::of(&problem, &state);
        for own in simulators::ALL.iter().flat_map(|entry| {
            let all = tenter::lab::variants(entry).into_iter();
            all.map(|params| Settings { params, ..Settings::double(entry.id, 1.0) })
        }) {
            // Advice keeps a tenth in hand to the limit of stability.
            let limit =
                trade::theory(&own, &spectrum).expect("a method").map_or(f64::INFINITY, |dt| 0.9 * dt);
            let mut steps = (case.seconds / limit / 5.0).ceil().clamp(1.0, 1e9) as u64 * 5;
            loop {
                let own = Settings { dt: case.dt(steps), ..own.clone() };
                let most = advice.spring_visits / 1.2 * case.seconds;
                // No method looks at fewer springs in a step than there are.
                if steps as f64 * problem.springs.len() as f64 > most {
                    break;
                }
                let keep = trial::Keep { most_visits: Some(most as u64), ..trial::Keep::default() };
                let trial = trial::run(&case, own.apply(case.scene()), keep, &on).expect("a trial");
                let error = metrics::errors(&free, &reference, &trial.samples).map(|e| e.rms);
                if trial.cost.spring_visits as f64 <= most
                    && Zone::from(trial.health) == Zone::Quiet
                    && error.is_some_and(|e| e <= wanted)
                {
                    let zone = stability::zone(&case.lasting(60.0), own.apply(case.scene()), &on);
                    assert_ne!(
                        zone.expect("a zone"),
                        Zone::Quiet,
                        "{name}: {own:?} is cheaper than {advice:?}"
                    );
                }
                steps = (steps + 5).max(steps * 11 / 10 / 5 * 5);
            }
        }
    }
}

#[test]
fn advice_says_when_nothing_meets_it_and_what_comes_closest() {
    let goal = advice::Goal::MaxError(1e-6);
    let options = advice::Options { simulators: vec!["verlet".to_owned()], goal, time: false };
    let (case, references) = (case(w1(), 0.2), References::default());
    let advice = advice::run(&case, &options, &references, &Journal::new(), &on).expect("advice");
    assert!(!advice.met && advice.error.expect("the closest") > 1e-6, "{advice:?}");
    let goal = advice::Goal::MaxError(1e-15);
    let too_fine = advice::Options { goal, ..options };
    assert!(advice::run(&case, &too_fine, &references, &Journal::new(), &on).is_err());
}

#[test]
fn ablation_finds_what_a_scene_needs_and_what_not_and_verifies_it() {
    for builtin in scene::builtin::ALL {
        let name = builtin.name;
        // That one bursts after about a second, on purpose.
        let case = case((builtin.make)(), if name == "explicit_bursts" { 0.5 } else { 1.0 });
        let options = ablation::Options { tolerance: 0.01, time: false };
        let table = ablation::run(&case, &options, &Journal::new(), &on).expect("a table");
        let changes: Vec<f64> = table.rows.iter().map(|row| row.change.unwrap_or(f64::INFINITY)).collect();
        assert!(changes.is_sorted_by(|a, b| a >= b), "{name} {changes:?}");
        assert!(
            table.rows.iter().any(|row| row.needed) && table.rows.iter().any(|row| !row.needed),
            "{name}"
        );
        let free = table.rows.iter().filter(|row| !row.needed && !row.absent).count();
        // Nothing that the scene has can be left out of a garment: it does without double precision already.
        let Some(proposal) = table.proposal else {
            assert_eq!(free, 0, "{name}");
            continue;
        };
        assert!(proposal.change <= 0.01, "{name} {proposal:?}");
        let scene = proposal
            .leave_out
            .iter()
            .fold(case.scene().clone(), |scene, ingredient| ablation::without(&case, &scene, ingredient));
        assert_ne!(&scene, case.scene());
    }
}
