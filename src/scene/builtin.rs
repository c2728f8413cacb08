//! The built-in scenes, as functions: the workbench, the command line, tests, benches and the lab all run these.

use super::{Mass, Pin, Pins, Plane, Precision, Refusal, Scene, Target, Tearing};
use crate::forces::gravity::Gravity;
use crate::forces::springs::{Kind, SpringParams};
use crate::forces::wind::Wind;
use crate::scene::GridTarget;
use crate::simulators::{SimulatorSettings, Value};
use glam::DVec3;

/// A scene that comes with Tenter.
#[derive(Debug)]
pub struct Builtin {
    /// Name on the command line.
    pub name: &'static str,
    /// One sentence: what it shows.
    pub about: &'static str,
    /// Makes it.
    pub make: fn() -> Scene,
}

/// All of them, the first one being what opens when nothing is named.
pub static ALL: &[Builtin] = &[
    Builtin {
        name: "sheet",
        about: "A sheet of 25 x 25 particles hangs by three in each upper corner.",
        make: Scene::default,
    },
    Builtin {
        name: "explicit_bursts",
        about: "Explicit Euler fails on stiff springs: the sheet hangs by one corner and bursts after about a second.",
        make: || one_corner("explicit_euler"),
    },
    Builtin {
        name: "symplectic_holds",
        about: "The same sheet with the same values, held by symplectic Euler.",
        make: || one_corner("symplectic_euler"),
    },
    Builtin {
        name: "verlet_2_sweeps",
        about: "Verlet with 2 sweeps of relaxation: the cloth looks elastic.",
        make: || verlet(2),
    },
    Builtin {
        name: "verlet_50_sweeps",
        about: "Verlet with 50 sweeps of relaxation: the same cloth looks stiff.",
        make: || verlet(50),
    },
    Builtin { name: "flag", about: "A flag held by its pole edge in gusts of wind.", make: flag },
    Builtin {
        name: "tearing",
        about: "A soft sheet in gusts of wind tears spring by spring where one passes three times its rest length.",
        make: tearing,
    },
    Builtin {
        name: "cylinder",
        about: "A cylinder of 20 x 5 quads from an OBJ file, hung by two particles of its upper edge.",
        make: || cylinder("asset:cylinder_20x5.obj"),
    },
    Builtin {
        name: "cylinder_gltf",
        about: "The same cylinder from a glTF file: its triangles become quads again.",
        make: || cylinder("asset:cylinder_20x5.gltf"),
    },
    Builtin { name: "skirt", about: "A skirt of 1800 particles, held at the waist.", make: skirt },
    Builtin {
        name: "cape",
        about: "A cape of quads and triangles, held at collar and shoulders, in a breeze.",
        make: cape,
    },
];

/// The scene of a name.
pub fn find(name: &str) -> Option<&'static Builtin> {
    ALL.iter().find(|scene| scene.name == name)
}

/// The meshes that come with Tenter.
static ASSETS: &[(&str, &[u8])] = &[
    ("cape_mixed.obj", include_bytes!("../../assets/meshes/cape_mixed.obj")),
    ("cylinder_20x5.gltf", include_bytes!("../../assets/meshes/cylinder_20x5.gltf")),
    ("cylinder_20x5.obj", include_bytes!("../../assets/meshes/cylinder_20x5.obj")),
    ("skirt_72x24.obj", include_bytes!("../../assets/meshes/skirt_72x24.obj")),
];

/// The bytes of a mesh that comes with Tenter.
///
/// # Errors
/// One line with the meshes there are.
pub fn asset(name: &str) -> Result<&'static [u8], Refusal> {
    ASSETS.iter().find(|(known, _)| *known == name).map(|(_, bytes)| *bytes).ok_or_else(|| {
        let known: Vec<_> = ASSETS.iter().map(|(known, _)| *known).collect();
        Refusal::new(format!(
            "asset:{}: there is no such mesh; accepted: {}",
            crate::params::excerpt(name),
            known.join(", ")
        ))
    })
}

/// The thesis' comparison of the two Euler methods: 25 x 25, one corner pinned, wind 10 N at 0.2 Hz.
fn one_corner(simulator: &str) -> Scene {
    Scene {
        pins: Pins::of([Pin::Particle(0)]),
        wind: Wind { enabled: true, ..Wind::default() },
        simulator: SimulatorSettings::new(simulator),
        ..Scene::default()
    }
}

fn verlet(sweeps: u64) -> Scene {
    Scene {
        simulator: SimulatorSettings::new("verlet").with("sweeps", Value::Count(sweeps)),
        ..Scene::default()
    }
}

fn flag() -> Scene {
    Scene {
        target: Target::Grid(GridTarget { columns: 40, rows: 25, spacing: 0.05, plane: Plane::Vertical }),
        pins: Pins::of([Pin::Column(0)]),
        mass: Mass::PerArea(0.2),
        springs: SpringParams {
            stretch: Kind { stiffness: 100.0, ..Kind::default() },
            shear: Kind { stiffness: 30.0, ..Kind::default() },
            bend: Kind { stiffness: 1.0, ..Kind::default() },
            damping: 0.002,
        },
        air_damping: 0.0005,
        wind: Wind { enabled: true, strength: 0.01, frequency: 0.6, direction: DVec3::new(0.9, 0.1, 0.4) },
        dt: 0.001,
        ..Scene::default()
    }
}

fn tearing() -> Scene {
    Scene {
        pins: Pins::of([Pin::Corners(6)]),
        springs: SpringParams {
            stretch: Kind { stiffness: 200.0, ..Kind::default() },
            ..SpringParams::default()
        },
        wind: Wind { enabled: true, strength: 20.0, ..Wind::default() },
        tearing: Tearing { enabled: true, max_ratio: 3.0 },
        ..Scene::default()
    }
}

fn cylinder(path: &str) -> Scene {
    Scene {
        target: Target::mesh(path),
        pins: Pins::of([Pin::Nearest(DVec3::new(4.0, 2.5, 0.0)), Pin::Nearest(DVec3::new(-4.0, 2.5, 0.0))]),
        ..Scene::default()
    }
}

/// Cloth of about 0.2 kg/m², as light cotton; stiffness such that it hangs with little stretch.
fn garment(path: &str, pins: Pins) -> Scene {
    Scene {
        target: Target::mesh(path),
        pins,
        mass: Mass::PerArea(0.2),
        springs: SpringParams {
            stretch: Kind { stiffness: 50.0, ..Kind::default() },
            shear: Kind { stiffness: 10.0, ..Kind::default() },
            bend: Kind { stiffness: 0.5, ..Kind::default() },
            damping: 0.001,
        },
        air_damping: 0.0002,
        gravity: Gravity { magnitude: 9.81, ..Gravity::default() },
        precision: Precision::Single,
        dt: 0.0005,
        ..Scene::default()
    }
}

fn skirt() -> Scene {
    garment("asset:skirt_72x24.obj", Pins::of([Pin::Top(0.02)]))
}

fn cape() -> Scene {
    let shoulder = |side: f64| Pin::Nearest(DVec3::new(side * 0.175, -0.299, -0.152));
    let pins = Pins::of([Pin::Top(0.03), shoulder(1.0), shoulder(-1.0)]);
    Scene {
        wind: Wind { enabled: true, strength: 0.004, frequency: 0.3, direction: DVec3::new(0.2, 0.1, -1.0) },
        ..garment("asset:cape_mixed.obj", pins)
    }
}
