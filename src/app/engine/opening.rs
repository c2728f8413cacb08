//! Lanes that are built on a thread of their own, so that whoever waits for a large mesh can give it up.

use std::{
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc::{RecvTimeoutError, channel},
    },
    thread::Builder,
    time::Duration,
};

use super::{Lane, LaneSetup};
use crate::scene::Refusal;

/// How often it is asked whether the lanes are still wanted.
const LOOK: Duration = Duration::from_millis(20);

/// Tells the engine from another thread what need not be opened any more.
#[derive(Clone, Debug, Default)]
pub struct GivenUp(
    /// The first order that is still wanted.
    Arc<AtomicU64>,
);

impl GivenUp {
    /// Gives up whatever the orders up to this number are opening.
    pub fn until(&self, order: u64) {
        self.0.fetch_max(order.saturating_add(1), Ordering::Relaxed);
    }

    /// Whether this order is one of them.
    pub fn has(&self, order: u64) -> bool {
        self.0.load(Ordering::Relaxed) > order
    }
}

/// Builds lanes for an order, unless that is given up before. The thread then ends in its own time, and its lanes are dropped.
pub(super) fn build(
    setups: Vec<LaneSetup>,
    threads: Option<usize>,
    order: u64,
    given_up: &GivenUp,
) -> Result<Vec<Lane>, Refusal> {
    let (sender, receiver) = channel();
    let open = move |setup: LaneSetup| {
        let title = setup.title.clone();
        Lane::open(setup, threads).map_err(|refusal| refusal.at(title))
    };
    let work = move || {
        let lanes: Result<Vec<Lane>, Refusal> = setups.into_iter().map(open).collect();
        // Nobody waits any more: then nobody needs them.
        let _ = sender.send(lanes);
    };
    Builder::new()
        .name("opening".to_owned())
        .spawn(work)
        .map_err(|e| Refusal::new(format!("the system gives no thread to open it: {e}")))?;
    loop {
        match receiver.recv_timeout(LOOK) {
            Ok(lanes) => return lanes,
            Err(RecvTimeoutError::Timeout) if given_up.has(order) => {
                return Err(Refusal::new("opening it was given up"));
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(Refusal::new("it could not be opened")),
        }
    }
}
