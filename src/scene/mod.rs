//! The scene: everything that a simulation starts from, as one value that files, panels and the command line share.

pub mod builtin;
mod mass;
mod open;
mod pending;
mod pins;
mod target;

pub use mass::Mass;
pub use open::{Opened, Place, open, read_limited};
pub use pending::{Pending, UNFINISHED};
pub use pins::{Pin, Pins};
pub use target::{Built, GridTarget, MeshTarget, Plane, Target};

use crate::forces::gravity::Gravity;
use crate::forces::springs::SpringParams;
use crate::forces::wind::Wind;
use crate::params::{self, Params};
use crate::simulators::SimulatorSettings;
use glam::DVec3;
use std::fmt;

crate::choice! {
    /// The arithmetic of the whole simulation.
    pub enum Precision {
        /// 32 bits: about 7 digits.
        Single,
        /// 64 bits: about 16 digits.
        Double,
    }
}

crate::params! {
    /// Tearing: a spring longer than `max_ratio` x its rest length breaks, for good, between two steps.
    pub struct Tearing {
        /// Whether springs tear.
        enabled: bool = false;
        /// Length over rest length at which a spring breaks.
        max_ratio: f64 = 3.0, range 1f64.next_up()..=1e9, slider linear 1.05..=10.0;
    }
}

crate::params! {
    /// A scene. Every field has a default, so that `()` is one: a horizontal sheet of 25 x 25 particles hanging by
    /// three in each corner of its first row.
    pub struct Scene {
        /// What is simulated.
        target: Target = Target::default();
        /// The particles that do not move.
        #[serde(skip_serializing_if = "Pins::is_default")]
        pins: Pins = Pins::default();
        /// How mass is given to the particles.
        mass: Mass = Mass::default();
        /// The springs by kind.
        springs: SpringParams = SpringParams::default();
        /// Air damping c of every particle: F = -c v.
        air_damping: f64 = 1.0, unit "kg/s", range 0.0..=1e9, slider log 0.0..=100.0;
        /// Gravity.
        gravity: Gravity = Gravity::default();
        /// Wind.
        wind: Wind = Wind::default();
        /// Tearing.
        tearing: Tearing = Tearing::default();
        /// The method and its parameters.
        simulator: SimulatorSettings = SimulatorSettings::default();
        /// The arithmetic of the whole simulation.
        precision: Precision = Precision::Double;
        /// Time step: explicit methods burst where it is too long for the stiffness. At 0 nothing moves.
        dt: f64 = 0.02, unit "s", range 0.0..=100.0, slider log 1e-4..=0.1;
    }
}

/// An input that is refused: one line that says what is wrong and what would be accepted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// Line and column, both from 1, where the input is a text.
    position: Option<(usize, usize)>,
    text: String,
}

impl Refusal {
    /// A refusal. Line breaks and control characters are taken out, and what would fill a screen is cut: a file may hold
    /// a name of a million letters.
    pub fn new(text: impl AsRef<str>) -> Self {
        Self { position: None, text: params::brief(text.as_ref()) }
    }

    /// The same with the file, key or other place before it, unless it begins with that already.
    #[must_use]
    pub fn at(&self, place: impl fmt::Display) -> Self {
        let place = place.to_string();
        if self.position.is_none()
            && self.text.strip_prefix(&place).is_some_and(|rest| rest.starts_with(": "))
        {
            return self.clone();
        }
        let colon = if self.position.is_some() { ":" } else { ": " };
        Self::new(format!("{place}{colon}{self}"))
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((line, column)) = self.position {
            write!(f, "{line}:{column}: ")?;
        }
        f.write_str(&self.text)
    }
}

impl std::error::Error for Refusal {}

impl From<String> for Refusal {
    fn from(text: String) -> Self {
        Self::new(text)
    }
}

impl Scene {
    /// Reads a scene from RON text.
    ///
    /// # Errors
    /// `line:column: what is wrong and what would be accepted`.
    pub fn from_ron(text: &str) -> Result<Self, Refusal> {
        let scene: Self = params::ron_options().from_str(text)?;
        scene.check()?;
        Ok(scene)
    }

    /// The scene as RON text. Reading it back gives the same scene.
    ///
    /// # Errors
    /// Those of the writer; none are known.
    pub fn to_ron(&self) -> Result<String, Refusal> {
        to_ron(self)
    }

    /// Sets what a dotted path names, as in `springs.stretch.stiffness`, from RON text.
    ///
    /// # Errors
    /// An unknown path, text that does not parse, a value that is not accepted; the scene is then unchanged.
    pub fn set_key(&mut self, path: &str, text: &str) -> Result<(), Refusal> {
        let mut fresh = self.clone();
        fresh.set(path, text).map_err(|e| Refusal::new(e).at(path))?;
        fresh.check().map_err(|e| e.at(path))?;
        *self = fresh;
        Ok(())
    }

    /// What no single field can check.
    fn check(&self) -> Result<(), Refusal> {
        /// Shortest step besides 0, s: 1/dt and the speed of a hand stay finite in single precision.
        const SHORTEST: f64 = 1e-20;
        if self.dt > 0.0 && self.dt < SHORTEST {
            return Err(Refusal::new(format!(
                "dt is {}; accepted: 0, or {SHORTEST:e} to 100 s",
                params::Short(self.dt)
            )));
        }
        if self.wind.direction == DVec3::ZERO {
            return Err(Refusal::new("wind.direction is (0, 0, 0); accepted: any other vector"));
        }
        self.target.check()
    }
}

/// Any value as RON text, indented by four.
///
/// # Errors
/// Those of the writer.
pub fn to_ron<T: serde::Serialize>(value: &T) -> Result<String, Refusal> {
    let config = ron::ser::PrettyConfig::new().new_line("\n").compact_arrays(true).compact_maps(true);
    let mut text = params::ron_options()
        .to_string_pretty(value, config)
        .map_err(|e| Refusal::new(format!("cannot be written: {e}")))?;
    text.push('\n');
    Ok(text)
}

impl From<ron::error::SpannedError> for Refusal {
    fn from(error: ron::error::SpannedError) -> Self {
        let at = &error.span.start;
        Self { position: Some((at.line, at.col)), ..Self::new(params::plain(&error.code.to_string())) }
    }
}
