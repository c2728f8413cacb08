//! Sweeps: springs that are put right one after the other, each seeing what those before it did, as rigid or as compliant
//! constraints.
//!
//! [`Chain`] takes them as they were made; [`Tiles`], in an order of its own, eight at once and on all threads.

mod chain;
mod components;
mod order;
mod tiles;
mod wide;

pub(super) use chain::Chain;
pub(super) use tiles::Tiles;

use crate::forces::Problem;
use crate::math::Real;
use crate::model::Particles;

/// A sweep over all springs, and the particles that it moves. A particle of weight 0 does not give way.
pub(super) trait Sweep<T: Real> {
    /// Takes the springs of a problem, unless they are here already.
    fn take(&mut self, problem: &Problem<T>);

    /// Begins a step of `h` (s) at these positions (m), from where particles move on their own with these velocities (m/s).
    fn set_out(&mut self, positions: &[T::Vec3], velocities: &[T::Vec3], weights: &[T], h: T, threads: usize);

    /// Puts every spring to its rest length; of the correction each end makes the share w_i / (w_i + w_j).
    fn relax(&mut self, weights: &[T], parallel: bool);

    /// Takes the particles of a step of `h` (s) to where they got: v = (x - start) / h, or the velocity with which they set out
    /// where their weight is 0.
    fn arrive(&self, state: &mut Particles<T>, velocities: &[T::Vec3], weights: &[T], h: T, threads: usize);
}

/// What compliant springs are in a step of h.
#[derive(Clone, Copy, Debug)]
pub(super) struct Compliance<T> {
    /// h², s².
    pub square: T,
    /// h k_d of damping along the spring, kg.
    pub along: T,
    /// h k_d of damping in all directions, kg.
    pub all: T,
}

/// Which of the sweeps of a step it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    /// No spring has exerted anything yet.
    pub is_first: bool,
    /// Nobody asks any more what springs have exerted.
    pub is_last: bool,
}
