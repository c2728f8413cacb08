//! What of a world's topology is drawn: its faces as triangles and the springs, without what is torn.

use std::collections::HashSet;

use crate::{
    app::render::{Springs, Topology},
    world::World,
};

/// Indices and rest lengths, in the form the renderer takes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Geometry {
    /// Differs for any two geometries of one simulation.
    pub version: u64,
    /// Number of particles.
    pub particles: u32,
    /// The surface.
    pub triangles: Vec<[u32; 3]>,
    /// Whole springs by kind: stretch, which are the edges of the faces; shear; bend.
    pub springs: [Vec<[u32; 2]>; 3],
    /// Length of each in the undeformed shape, m.
    pub rest_lengths: [Vec<f32>; 3],
}

impl Geometry {
    /// What is to be drawn of a world now.
    pub fn of(world: &World, version: u64) -> Self {
        let mesh = world.mesh();
        let torn = Torn::of(world);
        let mut geometry = Self { version, particles: mesh.positions.len() as u32, ..Self::default() };
        for face in mesh.faces() {
            if torn.opens(face) {
                continue;
            }
            for side in face.windows(2) {
                if side[0] != face[0] {
                    geometry.triangles.push([face[0], side[0], side[1]]);
                }
            }
        }
        let mut id = 0;
        for (kind, pairs) in world.topology().pairs.iter().enumerate() {
            for pair in pairs {
                if !torn.ids.contains(&id) {
                    let [a, b] = pair.map(|p| mesh.positions[p as usize]);
                    geometry.springs[kind].push(*pair);
                    geometry.rest_lengths[kind].push(a.distance(b) as f32);
                }
                id += 1;
            }
        }
        geometry
    }

    /// The renderer's view of it.
    pub fn topology(&self) -> Topology<'_> {
        Topology {
            version: self.version,
            particles: self.particles,
            triangles: &self.triangles,
            springs: std::array::from_fn(|kind| Springs {
                pairs: &self.springs[kind],
                rest_lengths: &self.rest_lengths[kind],
            }),
        }
    }
}

/// The torn springs, for asking whether a face still holds together.
struct Torn {
    ids: HashSet<u32>,
    edges: HashSet<[u32; 2]>,
    diagonals: HashSet<[u32; 2]>,
}

impl Torn {
    fn of(world: &World) -> Self {
        let [stretch, shear, _] = &world.topology().pairs;
        let ids = world.broken().iter().copied().collect();
        let mut torn = Self { ids, edges: HashSet::new(), diagonals: HashSet::new() };
        for &id in world.broken() {
            let id = id as usize;
            if let Some(pair) = stretch.get(id) {
                torn.edges.insert(*pair);
            } else if let Some(pair) = shear.get(id - stretch.len()) {
                torn.diagonals.insert(*pair);
            }
        }
        torn
    }

    /// A face is open once an edge or both diagonals are torn.
    fn opens(&self, face: &[u32]) -> bool {
        if self.ids.is_empty() {
            return false;
        }
        let sorted = |a: u32, b: u32| [a.min(b), a.max(b)];
        let next = face.iter().cycle().skip(1);
        let edge = face.iter().zip(next).any(|(a, b)| self.edges.contains(&sorted(*a, *b)));
        let crossed = matches!(*face, [a, b, c, d]
            if self.diagonals.contains(&sorted(a, c)) && self.diagonals.contains(&sorted(b, d)));
        edge || crossed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Place, Scene};

    #[test]
    fn a_sheet_has_two_triangles_a_quad_and_all_its_springs() {
        let world = World::new(Scene::default(), Place::default()).expect("the default scene");
        let geometry = Geometry::of(&world, 1);
        assert_eq!(geometry.triangles.len(), 2 * 24 * 24);
        assert_eq!(geometry.springs.each_ref().map(Vec::len), [1200, 1152, 1150]);
        assert!((geometry.rest_lengths[1][0] - 2_f32.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn tearing_opens_a_hole() {
        let scene =
            Scene::from_ron("(tearing: (enabled: true, max_ratio: 1.01), gravity: (magnitude: 500.0))");
        let mut world = World::new(scene.expect("a scene"), Place::default()).expect("a world");
        while world.broken().is_empty() && world.steps() < 100 {
            world.step();
        }
        let geometry = Geometry::of(&world, 2);
        assert!(!world.broken().is_empty());
        assert!(geometry.triangles.len() < 2 * 24 * 24);
        let springs: usize = geometry.springs.iter().map(Vec::len).sum();
        assert_eq!(springs + world.broken().len(), 1200 + 1152 + 1150);
    }
}
