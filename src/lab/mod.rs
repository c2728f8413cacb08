//! The lab: what a scene's methods cost and how far they are off, measured on the scene itself.
//!
//! A [`Case`] is what is studied: a scene in a state, and the simulated time that is compared. Everything is made of
//! trials of it ([`trial`]), compared with a converged solution of the same springs ([`reference`](mod@reference)):
//! [`trade`] (error against cost), [`stability`] (limits and zones), [`ablation`] (what the scene requires) and
//! [`advice`] (the cheapest settings that keep an error). [`report`] writes what they found.
//!
//! Two kinds of error are never mixed: that of the time stepping (against the converged solution) and that of the model
//! (with an ingredient left out). Work is told in counts first, which are the same on every machine, then in time.

pub mod ablation;
pub mod advice;
mod case;
mod effort;
pub mod equilibrium;
pub mod journal;
pub mod metrics;
pub mod reference;
pub mod report;
pub mod stability;
pub mod statistics;
pub mod timing;
pub mod trade;
pub mod trial;

pub use case::{Case, Settings, hash};
pub use effort::{Effort, adaptive, variants};
pub use journal::Journal;

use crate::scene::Refusal;

/// What a study tells while it works. The answer says whether to go on.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// Work goes on: asked often, so that stopping is prompt.
    Alive,
    /// What the next parts are about.
    Stage(&'a str),
    /// So many of the stage's parts are done.
    Done(usize, usize),
}

/// Hears what a study tells, from any thread, and answers whether to go on.
pub type Progress<'a> = &'a (dyn Fn(Event) -> bool + Sync);

/// Why a trial has no result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The listener said so.
    Cancelled,
    /// Something that cannot be run.
    Refused(Refusal),
}

impl From<Refusal> for Stop {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

impl Stop {
    /// The refusal; being cancelled has its own words.
    pub fn into_refusal(self) -> Refusal {
        match self {
            Self::Cancelled => Refusal::new("stopped before there was anything to tell"),
            Self::Refused(refusal) => refusal,
        }
    }
}
