//! What differs between two scenes, as settings that lead from the one to the other.

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
