//! The list of methods, and how one is built from its name and parameters.

use super::{Model, SimulatorSettings, Value};
use crate::forces::{Cost, Problem, Spectrum};
use crate::math::Real;
use crate::model::Particles;
use crate::params::Visitor;
use std::collections::BTreeMap;

/// A method with its parameters and scratch, of one precision, ready to step.
pub trait Stepper<T: Real>: Send {
    /// Advances the state by `dt` (s, above 0); see [`Simulator::step`](super::Simulator::step).
    fn step(&mut self, problem: &Problem<T>, state: &mut Particles<T>, dt: T, cost: &mut Cost);
    /// Largest stable dt in theory, s; see [`Simulator::dt_limit`](super::Simulator::dt_limit).
    fn dt_limit(&self, spectrum: &Spectrum) -> Option<f64>;
}

struct Built<S: super::Simulator, T: Real> {
    simulator: S,
    scratch: S::Scratch<T>,
}

impl<S: super::Simulator, T: Real> Stepper<T> for Built<S, T> {
    fn step(&mut self, problem: &Problem<T>, state: &mut Particles<T>, dt: T, cost: &mut Cost) {
        self.simulator.step(problem, state, dt, &mut self.scratch, cost);
    }
    fn dt_limit(&self, spectrum: &Spectrum) -> Option<f64> {
        self.simulator.dt_limit(spectrum)
    }
}

type ParamValues = BTreeMap<String, Value>;
type BuildFn<T> = fn(&ParamValues) -> Result<Box<dyn Stepper<T>>, String>;

/// A registered method.
#[derive(Debug)]
pub struct Entry {
    /// Name in scene files and on the command line.
    pub id: &'static str,
    /// One sentence: what it is and when to choose it.
    pub summary: &'static str,
    /// Order of accuracy.
    pub order: u32,
    /// What it solves.
    pub model: Model,
    /// Names of its parameters.
    pub params: &'static [&'static str],
    visit: fn(&ParamValues, &mut dyn Visitor),
    single: BuildFn<f32>,
    double: BuildFn<f64>,
}

impl Entry {
    /// The entry of a method.
    pub const fn of<S: super::Simulator>() -> Self {
        Self {
            id: S::ID,
            summary: S::SUMMARY,
            order: S::ORDER,
            model: S::MODEL,
            params: S::FIELDS,
            visit: |values, visitor| {
                if let Ok(mut simulator) = configure::<S>(values) {
                    simulator.visit(visitor);
                }
            },
            single: build::<S, f32>,
            double: build::<S, f64>,
        }
    }

    /// Shows the method's parameters to a visitor, as set by `values`.
    pub fn visit(&self, values: &BTreeMap<String, Value>, visitor: &mut dyn Visitor) {
        (self.visit)(values, visitor);
    }

    /// Checks parameters.
    ///
    /// # Errors
    /// One line: an unknown name, a wrong type, or a value outside the declared range.
    pub fn check(&self, values: &BTreeMap<String, Value>) -> Result<(), String> {
        (self.double)(values).map(|_| ())
    }
}

fn configure<S: super::Simulator>(values: &ParamValues) -> Result<S, String> {
    let mut simulator = S::default();
    for (name, value) in values {
        simulator.set(name, &value.to_string()).map_err(|e| format!("{}: {e}", S::ID))?;
    }
    Ok(simulator)
}

fn build<S: super::Simulator, T: Real>(values: &ParamValues) -> Result<Box<dyn Stepper<T>>, String> {
    Ok(Box::new(Built::<S, T> { simulator: configure(values)?, scratch: S::Scratch::default() }))
}

/// The entry of a method by name.
///
/// # Errors
/// One line with the methods there are.
pub fn find(id: &str) -> Result<&'static Entry, String> {
    super::ALL.iter().find(|entry| entry.id == id).ok_or_else(|| {
        let known: Vec<_> = super::ALL.iter().map(|entry| entry.id).collect();
        format!("unknown simulator '{}'; known: {}", crate::params::excerpt(id), known.join(", "))
    })
}

/// A precision that methods are built in.
pub trait Build: Real {
    /// The method that the settings name, in this precision.
    ///
    /// # Errors
    /// One line: an unknown method, or a parameter that it refuses.
    fn build(settings: &SimulatorSettings) -> Result<Box<dyn Stepper<Self>>, String>;
}

impl Build for f32 {
    fn build(settings: &SimulatorSettings) -> Result<Box<dyn Stepper<Self>>, String> {
        (find(&settings.id)?.single)(&settings.params)
    }
}

impl Build for f64 {
    fn build(settings: &SimulatorSettings) -> Result<Box<dyn Stepper<Self>>, String> {
        (find(&settings.id)?.double)(&settings.params)
    }
}

/// Declares the methods: a module and its type a line.
macro_rules! registry {
    ($($module:ident::$simulator:ident,)*) => {
        $(mod $module; pub use $module::$simulator;)*

        /// Every method, in the order in which they are listed everywhere.
        pub static ALL: &[Entry] = &[$(Entry::of::<$simulator>()),*];
    };
}
pub(super) use registry;
