//! Lanes that are added, removed, and brought back.

use super::{Edit, Order, Session};
use crate::scene::to_ron;

impl Session {
    /// Adds a lane that goes on from the lane of this number with another method, or with the same.
    pub fn add_lane(&mut self, method: Option<&str>) {
        let Some(setup) = self.setups.first() else { return };
        let settings: Vec<_> =
            method.map(|id| ("simulator.id".to_owned(), format!("{id:?}"))).into_iter().collect();
        let (from, at, title) = (self.lane, self.drafts.len(), setup.title.clone());
        self.kept += 1;
        let number = self.kept;
        let add = Order::AddLane { from, at, title, settings: settings.clone(), back: None };
        let again = Order::AddLane { from, at, title: setup.title.clone(), settings, back: Some(number) };
        let undo = vec![Order::RemoveLane { lane: at, number }];
        self.message = None;
        self.send(&[add]);
        self.history.push(Edit { label: "add lane".to_owned(), lane: None, undo, redo: vec![again] });
        self.history.seal();
        self.lane = at;
    }

    /// Removes a lane; the last one stays.
    pub fn remove_lane(&mut self, lane: usize) {
        let (Some(setup), Some(scene)) = (self.setups.get(lane), self.drafts.get(lane)) else { return };
        if self.drafts.len() == 1 {
            return;
        }
        self.kept += 1;
        let number = self.kept;
        // What lanes differ in, should the lane itself not be remembered any more.
        let own = [
            ("simulator", to_ron(&scene.simulator)),
            ("precision", to_ron(&scene.precision)),
            ("dt", to_ron(&scene.dt)),
        ];
        let settings =
            own.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value.ok()?))).collect();
        let title = setup.title.clone();
        let undo = vec![Order::AddLane { from: 0, at: lane, title, settings, back: Some(number) }];
        let redo = vec![Order::RemoveLane { lane, number }];
        self.message = None;
        self.send(&redo);
        self.history.push(Edit { label: "remove lane".to_owned(), lane: None, undo, redo });
        self.history.seal();
    }

    /// Whether the lane can be as it is asked for, the engine will tell.
    pub(super) fn foresee_lane(&mut self, from: usize, at: usize, settings: &[(String, String)]) {
        let (Some(mut draft), Some(setup)) = (self.drafts.get(from).cloned(), self.setups.first().cloned())
        else {
            return;
        };
        for (key, value) in settings {
            let _ = draft.set_key(key, value);
        }
        self.drafts.insert(at.min(self.drafts.len()), draft);
        // Lanes share the scene, and so its file.
        self.setups.push(setup);
        if self.lane >= at {
            self.lane += 1;
        }
    }
}
