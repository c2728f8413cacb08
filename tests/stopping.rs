//! A step that takes long can be broken off.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tenter::scene::{Place, Scene};
use tenter::world::{Command, World};

fn world(ron: &str) -> World {
    World::new(Scene::from_ron(ron).unwrap(), Place::default()).unwrap()
}

/// What it leaves is the state before, and all that follows is as if nobody had begun it.
#[test]
fn a_step_that_is_broken_off_was_never_taken() {
    // Some hours of it.
    let endless = [
        "(id: \"bdf2\", params: {\"tolerance\": 1e-14, \"newton_steps\": 1000, \"iterations\": 1000000})",
        "(id: \"rk45\", params: {\"tolerance\": 1e-14, \"most_steps\": 100000000})",
        "(id: \"xpbd\", params: {\"substeps\": 100000, \"iterations\": 100000})",
    ];
    for settings in endless {
        let set = |world: &mut World, key: &str, value: &str| {
            world.apply(Command::Set { key: key.to_owned(), value: value.to_owned() }).unwrap();
        };
        let mut worlds = [(); 2].map(|()| world("(simulator: (id: \"bdf2\"))"));
        for world in &mut worlds {
            (0..10).for_each(|_| world.step());
            set(world, "dt", "100.0");
            set(world, "simulator", settings);
        }
        let [stopped, other] = &mut worlds;
        let stop = Arc::new(AtomicBool::new(false));
        stopped.heed(Some(Arc::clone(&stop)));
        let before = (stopped.digest(), stopped.cost(), stopped.time());
        let flag = Arc::clone(&stop);
        let waits = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(50));
            flag.store(true, Ordering::Relaxed);
        });
        stopped.step();
        waits.join().unwrap();
        assert_eq!((stopped.digest(), stopped.cost(), stopped.time()), before, "{settings}");
        stopped.step();
        assert_eq!(stopped.steps(), 10, "no step while it is set");
        stop.store(false, Ordering::Relaxed);
        for world in [stopped, other] {
            set(world, "simulator.id", "\"symplectic_euler\"");
            set(world, "dt", "0.02");
            (0..10).for_each(|_| world.step());
        }
        assert_eq!(worlds[0].digest(), worlds[1].digest(), "{settings}");
    }
}
