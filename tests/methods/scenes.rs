//! Scenes with known answers, and how a run is compared with them.

use glam::DVec3;
use std::sync::OnceLock;
use tenter::forces::springs::SpringParams;
use tenter::forces::{Problem, SpringSet};
use tenter::model::Topology;
use tenter::scene::{Place, Scene};
use tenter::simulators::{Build, Stepper};
use tenter::world::World;

/// 10 x 10, two corners pinned, light and stiff, without spring damping: error figures of many methods are known for
/// half a second of its fall.
pub const W1: &str = "(
    target: Grid(columns: 10, rows: 10, spacing: 0.1, plane: Horizontal),
    pins: [Particle(0), Particle(9)],
    mass: PerParticle(0.02),
    springs: (damping: 0.0),
    air_damping: 0.01,
    gravity: (enabled: true, magnitude: 9.81),
)";

/// How long W1 falls, s.
pub const T: f64 = 0.5;

/// The scene of some text with settings such as `dt=0.1`.
pub fn scene(text: &str, settings: &[&str]) -> Scene {
    let mut scene = Scene::from_ron(text).expect("the scene is accepted");
    for setting in settings {
        let (key, value) = setting.split_once('=').expect("key=value");
        scene.set_key(key, value).expect("the setting is accepted");
    }
    scene
}

/// Sets a method, `id` or `id(name=value,name=value)`.
fn set_method(scene: &mut Scene, method: &str) {
    let (id, params) = method.split_once('(').unwrap_or((method, ")"));
    scene.set_key("simulator.id", id).expect("a method");
    for param in params.trim_end_matches(')').split(',').filter(|p| !p.is_empty()) {
        let (key, value) = param.split_once('=').expect("key=value");
        scene.set_key(&format!("simulator.params.{key}"), value).expect("the parameter is accepted");
    }
}

/// A world of a method on some text with settings.
pub fn world(text: &str, method: &str, settings: &[&str]) -> World {
    let mut scene = scene(text, settings);
    set_method(&mut scene, method);
    World::new(scene, Place::default()).expect("the scene can be built")
}

/// A method by itself.
pub fn stepper(method: &str) -> Box<dyn Stepper<f64>> {
    let mut scene = Scene::default();
    set_method(&mut scene, method);
    <f64 as Build>::build(&scene.simulator).expect("a method")
}

/// Particles of some masses (kg) on undamped springs of one stiffness (N/m), and nothing else; rest lengths are those of
/// the shape times a factor.
pub fn bare(
    mass: &[f64],
    pairs: &[[u32; 2]],
    shape: &[DVec3],
    stiffness: f64,
    rest_scale: f64,
) -> Problem<f64> {
    let topology = Topology { pairs: [pairs.to_vec(), Vec::new(), Vec::new()] };
    let mut params = SpringParams { damping: 0.0, ..SpringParams::default() };
    params.stretch.stiffness = stiffness;
    params.stretch.rest_scale = rest_scale;
    let set = SpringSet { topology: &topology, rest_positions: shape, params: &params, broken: &[] };
    Problem::new(mass.to_vec(), &set)
}

/// Runs a world for some steps.
pub fn run(mut world: World, steps: u64) -> World {
    for _ in 0..steps {
        world.step();
    }
    world
}

/// Root of the mean square over particles that are free.
pub fn rms(world: &World, a: &[DVec3], b: &[DVec3]) -> f64 {
    let free = || (0..a.len()).filter(|i| !world.pinned()[*i]);
    (free().map(|i| a[i].distance_squared(b[i])).sum::<f64>() / free().count() as f64).sqrt()
}

/// The state of a scene in motion by the classical Runge-Kutta method, written here so as to share nothing with the methods
/// that it judges: positions and velocities of free particles under springs, damping, air and gravity.
pub struct Reference {
    pub positions: Vec<DVec3>,
    springs: Vec<(usize, usize, f64, f64)>,
    spring_damping: f64,
    air: f64,
    gravity: f64,
    mass: f64,
    fixed: Vec<bool>,
}

impl Reference {
    pub fn new(scene: &Scene) -> Self {
        let world = World::new(scene.clone(), Place::default()).expect("the scene can be built");
        let positions = world.positions();
        let kinds = scene.springs.kinds();
        let springs = world.topology().pairs.iter().zip(kinds).flat_map(|(pairs, kind)| {
            let positions = &positions;
            pairs.iter().map(move |&[i, j]| {
                let (i, j) = (i as usize, j as usize);
                (i, j, kind.stiffness, positions[i].distance(positions[j]) * kind.rest_scale)
            })
        });
        Self {
            springs: springs.collect(),
            spring_damping: scene.springs.damping,
            air: scene.air_damping,
            gravity: if scene.gravity.enabled { scene.gravity.magnitude } else { 0.0 },
            mass: scene.mass.of(world.mesh()).expect("a mass")[0],
            fixed: world.pinned().to_vec(),
            positions,
        }
    }

    /// Forces on all particles, N; zero where they cannot move.
    pub fn forces(&self, x: &[DVec3], v: &[DVec3]) -> Vec<DVec3> {
        let weight = DVec3::new(0.0, -self.gravity * self.mass, 0.0);
        let mut forces: Vec<DVec3> = v.iter().map(|v| weight - *v * self.air).collect();
        for &(i, j, k, rest) in &self.springs {
            let d = x[j] - x[i];
            let f = d.normalize_or_zero() * (k * (d.length() - rest)) + (v[j] - v[i]) * self.spring_damping;
            forces[i] += f;
            forces[j] -= f;
        }
        forces.iter_mut().zip(&self.fixed).filter(|(_, fixed)| **fixed).for_each(|(f, _)| *f = DVec3::ZERO);
        forces
    }

    /// Positions at even times up to `seconds`, in `steps` steps from rest.
    pub fn samples(&self, seconds: f64, samples: u32, steps: u32) -> Vec<Vec<DVec3>> {
        let dt = seconds / f64::from(steps);
        let (mut x, mut v) = (self.positions.clone(), vec![DVec3::ZERO; self.positions.len()]);
        let moved = |a: &[DVec3], b: &[DVec3], h: f64| -> Vec<DVec3> {
            a.iter().zip(b).map(|(a, b)| *a + *b * h).collect()
        };
        let mut seen = Vec::new();
        for step in 1..=steps {
            let acceleration = |x: &[DVec3], v: &[DVec3]| -> Vec<DVec3> {
                self.forces(x, v).iter().map(|f| *f / self.mass).collect()
            };
            let (v1, a1) = (v.clone(), acceleration(&x, &v));
            let (v2, x2) = (moved(&v, &a1, dt / 2.0), moved(&x, &v1, dt / 2.0));
            let a2 = acceleration(&x2, &v2);
            let (v3, x3) = (moved(&v, &a2, dt / 2.0), moved(&x, &v2, dt / 2.0));
            let a3 = acceleration(&x3, &v3);
            let (v4, x4) = (moved(&v, &a3, dt), moved(&x, &v3, dt));
            let a4 = acceleration(&x4, &v4);
            for i in 0..x.len() {
                x[i] += (v1[i] + (v2[i] + v3[i]) * 2.0 + v4[i]) * (dt / 6.0);
                v[i] += (a1[i] + (a2[i] + a3[i]) * 2.0 + a4[i]) * (dt / 6.0);
            }
            if step % (steps / samples) == 0 {
                seen.push(x.clone());
            }
        }
        seen
    }
}

/// How often W1 is looked at while it falls.
const SAMPLES: u32 = 5;

/// W1 in even samples over its fall, to 1e-9 of the way.
fn w1_reference() -> &'static [Vec<DVec3>] {
    static POSITIONS: OnceLock<Vec<Vec<DVec3>>> = OnceLock::new();
    POSITIONS.get_or_init(|| Reference::new(&scene(W1, &[])).samples(T, SAMPLES, 1600))
}

/// Error of a method on W1 in some number of steps: RMS over particles and samples, over that of the way from the start.
pub fn w1_error(method: &str, steps: u64) -> f64 {
    let mut world = world(W1, method, &[&format!("dt={}", T / steps as f64)]);
    let start = world.positions();
    let (mut error, mut way) = (0.0, 0.0);
    for sample in w1_reference() {
        world = run(world, steps / u64::from(SAMPLES));
        error += rms(&world, &world.positions(), sample).powi(2);
        way += rms(&world, sample, &start).powi(2);
    }
    (error / way).sqrt()
}

/// Observed orders of a method on W1 (a quarter of a second) with spring damping k_d = 0.02, over some halvings of dt.
pub fn halvings(method: &str, first: u64, halvings: u32) -> Vec<f64> {
    static TRUTH: OnceLock<Vec<DVec3>> = OnceLock::new();
    orders(method, first, halvings, &["springs.damping=0.02"], &TRUTH)
}

/// The same without spring damping.
pub fn halvings_undamped(method: &str, first: u64, halvings: u32) -> Vec<f64> {
    static TRUTH: OnceLock<Vec<DVec3>> = OnceLock::new();
    orders(method, first, halvings, &[], &TRUTH)
}

fn orders(
    method: &str,
    first: u64,
    halvings: u32,
    settings: &[&str],
    truth: &OnceLock<Vec<DVec3>>,
) -> Vec<f64> {
    let seconds = T / 2.0;
    let truth =
        truth.get_or_init(|| Reference::new(&scene(W1, settings)).samples(seconds, 1, 1600).remove(0));
    let errors: Vec<f64> = (0..=halvings)
        .map(|halving| {
            let steps = first << halving;
            let dt = format!("dt={}", seconds / steps as f64);
            let world = run(world(W1, method, &[settings, &[&dt]].concat()), steps);
            rms(&world, &world.positions(), truth)
        })
        .collect();
    errors.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect()
}

/// Asserts that a figure lies within a share of what is expected.
pub fn near(what: &str, found: f64, expected: f64, share: f64) {
    println!("{what}: {found:.3e}, expected {expected:.3e}");
    assert!((found - expected).abs() <= share * expected, "{what}: {found:.4e}, expected {expected:.4e}");
}
