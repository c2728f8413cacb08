//! Steps that take too long: they can be broken off, and the way back to the state before is short.

use super::{AnyCloth, Snapshot, World, on};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Steps between checkpoints, and passes over the springs: copying the state so seldom costs next to nothing, and so little is
/// soon done again.
const CHECKPOINT: u64 = 64;

impl World {
    /// While this is set no step is taken: one that is under way is broken off, and the state is that before it. Whoever
    /// clears it does so between steps.
    pub fn heed(&mut self, stop: Option<Arc<AtomicBool>>) {
        self.stop = stop;
        self.prepare();
    }

    pub(super) fn is_stopped(&self) -> bool {
        self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed))
    }

    /// Whether stepping from there to here again would take long.
    pub(super) fn is_far_from(&self, checkpoint: &Snapshot) -> bool {
        let springs = on!(&self.cloth, c => c.problem.springs.len()) as u64;
        self.step - checkpoint.step >= CHECKPOINT
            || self.cost.spring_visits - checkpoint.cost.spring_visits > CHECKPOINT * springs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Place, Scene};

    fn world(ron: &str) -> World {
        World::new(Scene::from_ron(ron).unwrap(), Place::default()).unwrap()
    }

    #[test]
    fn the_way_back_is_short_where_steps_are_long() {
        for method in ["symplectic_euler", "bdf2"] {
            let mut world = world(&format!("(simulator: (id: {method:?}))"));
            let springs = world.topology().pairs.iter().map(Vec::len).sum::<usize>() as u64;
            for _ in 0..100 {
                let visits = world.cost.spring_visits;
                world.step();
                // Up to the step that was just taken.
                let checkpoint = world.checkpoint.as_ref().unwrap();
                let again = visits - checkpoint.cost.spring_visits;
                assert!(again <= 64 * springs, "{method}: {} steps", world.step - checkpoint.step);
            }
        }
    }
}
