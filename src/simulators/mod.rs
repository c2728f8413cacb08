//! Time-stepping methods, one a file. To add one, write its file and add its line to the registry below.
//!
//! A method advances m a = F(t, x, v) from t to t + dt. It owns parameters and scratch, never state: replaced by a fresh
//! one between two steps it changes no bit of the trajectory, so methods can be switched while a cloth moves. What a
//! method must carry from step to step stands in the [`Memory`](crate::model::Memory) of the state, which the caller
//! empties when anything of the method, dt or the problem changes, and which travels with every snapshot. Where hands go
//! from step to step is no such change: a method sees it by [`Problem::is_handled`].
//!
//! A method that asks for the forces at the start of a step and for no others writes its update down as an
//! [`Update`](crate::forces::Update): each particle is moved in the pass that sums up its forces.
//!
//! The README's "Which method for which scene" says which to choose, with figures; each method's own text says what it costs.

mod blocks;
mod chebyshev;
mod colouring;
mod conjugate_gradients;
mod inertia;
mod newton;
mod region;
mod registry;
mod settings;
mod sweep;

pub use registry::{Build, Entry, Stepper, find};
pub use settings::{SimulatorSettings, Value};

use crate::forces::{Cost, Problem, Spectrum};
use crate::math::Real;
use crate::model::Particles;
use crate::params::Params;

registry::registry! {
    explicit_euler::ExplicitEuler,
    symplectic_euler::SymplecticEuler,
    velocity_verlet::VelocityVerlet,
    rk4::Rk4,
    implicit_euler::ImplicitEuler,
    implicit_midpoint::ImplicitMidpoint,
    bdf2::Bdf2,
    verlet::Verlet,
    xpbd::Xpbd,
    vbd::Vbd,
    projective_dynamics::ProjectiveDynamics,
    rk45::Rk45,
}

/// A method: its parameters are the fields of the type (declared with [`params!`](crate::params!)), its update is
/// [`step`](Self::step).
pub trait Simulator: Params + Send + Sync + 'static {
    /// Name in scene files and on the command line.
    const ID: &'static str;
    /// One sentence: what it is and when to choose it.
    const SUMMARY: &'static str;
    /// Order of accuracy p: the error of a trajectory falls as dtᵖ.
    const ORDER: u32;
    /// What it solves.
    const MODEL: Model;
    /// Memory that a step uses and leaves without meaning: buffers, factorisations. May be replaced by a default one
    /// before any step.
    type Scratch<T: Real>: Default + Send;

    /// Advances positions (m) and velocities (m/s) by `dt` (s, above 0) from `state.time`, which the caller advances.
    /// A particle of inverse mass 0 keeps its velocity and moves by dt v. Work is counted in `cost`. Where
    /// [`Problem::is_stopped`] it may return at once: the caller then goes back to the state before.
    fn step<T: Real>(
        &self,
        problem: &Problem<T>,
        state: &mut Particles<T>,
        dt: T,
        scratch: &mut Self::Scratch<T>,
        cost: &mut Cost,
    );

    /// Largest stable dt in theory for small motions around the shape whose spectrum is given, s; 0 where no dt is
    /// stable, none where theory sets no limit.
    fn dt_limit(&self, spectrum: &Spectrum) -> Option<f64>;
}

/// What a method solves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// The springs of the scene: as dt goes to 0 its error does.
    Springs,
    /// Springs taken as rigid constraints: stiffness is ignored, how stiff it looks is a matter of dt and sweeps.
    RigidConstraints,
}
