//! What differs between two scenes, as settings that lead from the one to the other, and as an edit.

use super::session::Session;
use crate::scene::{Refusal, Scene, to_ron};

/// Keys, values and the values before, in an order in which they can be set one after the other.
///
/// # Errors
/// Those of the writer.
pub fn changes(from: &Scene, to: &Scene) -> Result<Vec<(String, String, String)>, Refusal> {
    let mut changes = Vec::new();
    let mut set = |key: &str, differs: bool, [from, to]: [Result<String, Refusal>; 2]| {
        if differs {
            let text = |value: Result<String, Refusal>| value.map(|text| text.trim_end().to_owned());
            changes.push((key.to_owned(), text(to)?, text(from)?));
        }
        Ok::<_, Refusal>(())
    };
    macro_rules! each {
        ($($field:ident),*) => {
            $(set(stringify!($field), from.$field != to.$field, [from, to].map(|s| to_ron(&s.$field)))?;)*
        };
    }
    // Before the target: particles of a coarser one are there in the finer one too.
    set("pins", from.pins != to.pins, [from, to].map(|s| to_ron(&s.pins.list(&s.target))))?;
    each!(mass, springs, air_damping, gravity, wind, tearing, simulator, precision, dt, target);
    Ok(changes)
}

impl Session {
    /// Makes the scene of the lane that is edited into another: one edit that can be taken back. With several lanes, what they
    /// share and what is the lane's own are two.
    pub fn become_scene(&mut self, label: &str, scene: &Scene) {
        let changes = match changes(self.scene(), scene) {
            Ok(changes) => changes,
            Err(refusal) => {
                self.message = Some(refusal.to_string());
                return;
            }
        };
        let only = (self.scenes().len() > 1).then_some(self.lane);
        let is_own = |change: &(String, String, String)| {
            only.is_some() && ["simulator", "precision", "dt"].contains(&change.0.as_str())
        };
        let (own, shared): (Vec<_>, Vec<_>) = changes.into_iter().partition(is_own);
        for (lane, changes) in [(None, shared), (only, own)] {
            if !changes.is_empty() {
                self.end_edit();
                self.set_all(lane, label, &changes);
            }
        }
        self.end_edit();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_lead_from_one_scene_to_another() {
        let from = Scene::from_ron("(pins: [Corners(3)])").expect("a scene");
        let to = "(simulator: (id: \"verlet\", params: {\"sweeps\": 20}), precision: Single, dt: 0.01, wind: (enabled: true),
            springs: (bend: (enabled: false)), target: Grid(columns: 13, rows: 13, spacing: 2.0, plane: Horizontal),
            pins: [Particle(3)])";
        let to = Scene::from_ron(to).expect("a scene");
        let (mut there, mut back) = (from.clone(), to.clone());
        let changes = changes(&from, &to).expect("settings");
        for (key, value, _) in &changes {
            there.set_key(key, value).expect("a setting");
        }
        for (key, _, before) in changes.iter().rev() {
            back.set_key(key, before).expect("a setting");
        }
        assert_eq!((there, back), (to, from));
    }
}
