//! Which faces meet at each edge, found in linear time; and what that tells of a mesh: faces that are there twice, edges of three
//! faces or more, particles where pieces only touch.

use super::QuadMesh;
use super::mesh::Pieces;

/// The sides of the faces of a mesh, joined where they lie along one edge. A side has the number of the corner that it starts from;
/// it ends at the next corner of its face.
pub(super) struct Edges {
    /// For every side the next one along its edge, and after the last the first: itself where it is the only one.
    next: Vec<u32>,
    /// Edges of three sides or more.
    pub crowded: usize,
    /// Faces that are there before, wound either way, in their order.
    pub repeated: Vec<u32>,
}

impl Edges {
    pub(super) fn of(mesh: &QuadMesh) -> Self {
        let corners = mesh.corners();
        // By the lower end of their edges: where the sides there begin, and, once they have been put there, where they end.
        let mut ends = vec![0_u32; mesh.positions.len()];
        for_each_side(mesh, |_, [a, b]| ends[a.min(b) as usize] += 1);
        let mut start = 0;
        for end in &mut ends {
            start += std::mem::replace(end, start);
        }
        // The higher end of the edge, and the side, in one number.
        let mut sides = vec![0_u64; corners.len()];
        for_each_side(mesh, |side, [a, b]| {
            let end = &mut ends[a.min(b) as usize];
            sides[*end as usize] = u64::from(a.max(b)) << 32 | u64::from(side);
            *end += 1;
        });
        let leads = leads(mesh);
        let mut edges = Self { next: vec![0; corners.len()], crowded: 0, repeated: Vec::new() };
        let mut start = 0;
        for (lower, end) in (0..).zip(ends) {
            let around = &mut sides[start..end as usize];
            around.sort_unstable();
            for edge in around.chunk_by_mut(|a, b| *a >> 32 == *b >> 32) {
                edges.join(edge);
                edges.compare(edge, lower, &leads, mesh);
            }
            start = end as usize;
        }
        edges.repeated.sort_unstable();
        edges
    }

    fn join(&mut self, edge: &[u64]) {
        for pair in edge.windows(2) {
            self.next[side(pair[0]) as usize] = side(pair[1]);
        }
        self.next[side(edge[edge.len() - 1]) as usize] = side(edge[0]);
        self.crowded += usize::from(edge.len() > 2);
    }

    /// Looks for faces that are the same among those that an edge, of which `lower` is the lower end, leads: the same polygons share all
    /// their edges, so that it is enough to compare them at one.
    fn compare(&mut self, edge: &mut [u64], lower: u32, leads: &[bool], mesh: &QuadMesh) {
        let mut count = 0;
        for i in 0..edge.len() {
            if leads[side(edge[i]) as usize] {
                edge.swap(count, i);
                count += 1;
            }
        }
        let faces = &mut edge[..count];
        if count > 1 {
            let corners = |packed: &u64| walk(mesh, side(*packed), lower);
            faces.sort_by(|a, b| corners(a).cmp(corners(b)));
            let same = faces.windows(2).filter(|pair| corners(&pair[0]).eq(corners(&pair[1])));
            self.repeated.extend(same.map(|pair| mesh.face_at(side(pair[1])).0 as u32));
        }
    }

    /// The other side along the edge of this one, where there is one and no third.
    pub(super) fn across(&self, side: u32) -> Option<u32> {
        let other = self.next[side as usize];
        (other != side && self.next[other as usize] == side).then_some(other)
    }

    /// Particles where pieces touch that share no edge there.
    pub(super) fn pinched(&self, mesh: &QuadMesh) -> usize {
        // Corners at one particle belong together where their faces share an edge there; more than one group is a pinch.
        let mut fans = Pieces::new(mesh.corners().len());
        for_each_side(mesh, |side, [start, _]| {
            let other = self.next[side as usize];
            // From the last side along an edge back to the first there is nothing to add.
            if other > side {
                let [here, mut there] = [side, other].map(|side| [side, mesh.after(side)]);
                if mesh.corners()[other as usize] != start {
                    there.reverse();
                }
                fans.join(here[0], there[0]);
                fans.join(here[1], there[1]);
            }
        });
        let mut groups = vec![0_u32; mesh.positions.len()];
        for (i, corner) in mesh.corners().iter().enumerate() {
            groups[*corner as usize] += u32::from(fans.root(i as u32) == i as u32);
        }
        groups.iter().filter(|groups| **groups > 1).count()
    }
}

/// The side, of one that is packed with the higher end of its edge.
fn side(packed: u64) -> u32 {
    packed as u32
}

/// Calls back with each side and its two ends, face by face.
fn for_each_side(mesh: &QuadMesh, mut each: impl FnMut(u32, [u32; 2])) {
    let mut side = 0;
    for face in mesh.faces() {
        for ends in face.windows(2) {
            each(side, [ends[0], ends[1]]);
            side += 1;
        }
        each(side, [face[face.len() - 1], face[0]]);
        side += 1;
    }
}

/// Whether a side leads its face: of each face the one from the lowest corner to the lower of its neighbours.
fn leads(mesh: &QuadMesh) -> Vec<bool> {
    let mut leads = vec![false; mesh.corners().len()];
    let mut start = 0;
    for face in mesh.faces() {
        let last = face.len() - 1;
        let lowest = (0..face.len()).min_by_key(|i| face[*i]).unwrap_or(0);
        let before = if lowest == 0 { last } else { lowest - 1 };
        let after = if lowest == last { 0 } else { lowest + 1 };
        leads[start + if face[after] < face[before] { lowest } else { before }] = true;
        start += face.len();
    }
    leads
}

/// The corners of a face from one end of a side over the other.
fn walk(mesh: &QuadMesh, side: u32, from: u32) -> impl Iterator<Item = u32> {
    let (face, at) = mesh.face_at(side);
    let face = mesh.face(face);
    let is_forward = face[at] == from;
    let after = |at: usize| if at + 1 == face.len() { 0 } else { at + 1 };
    let before = |at: usize| if at == 0 { face.len() - 1 } else { at - 1 };
    let mut next = if is_forward { at } else { after(at) };
    face.iter().map(move |_| {
        let at = next;
        next = if is_forward { after(at) } else { before(at) };
        face[at]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    fn mesh(particles: usize, faces: &[Vec<u32>]) -> QuadMesh {
        let mut mesh = QuadMesh::new(vec![DVec3::ZERO; particles]);
        faces.iter().for_each(|face| mesh.push_face(face));
        mesh
    }

    /// Turned and wound so that the lowest corner comes first and the lower of its neighbours next.
    fn canonical(face: &[u32]) -> Vec<u32> {
        let turns = (0..face.len()).map(|turn| [&face[turn..], &face[..turn]].concat());
        let both = turns.flat_map(|one| [one.clone(), one.into_iter().rev().collect()]);
        both.min().unwrap_or_default()
    }

    fn ends(mesh: &QuadMesh, side: u32) -> [u32; 2] {
        let mut ends = [side, mesh.after(side)].map(|corner| mesh.corners()[corner as usize]);
        ends.sort_unstable();
        ends
    }

    #[test]
    fn two_squares_share_a_side_and_two_cones_a_tip() {
        let squares = mesh(6, &[vec![0, 1, 4, 3], vec![2, 5, 4, 1]]);
        let edges = Edges::of(&squares);
        assert_eq!((0..8).map(|side| edges.across(side)).collect::<Vec<_>>(), {
            let [none, one, six] = [None, Some(1), Some(6)];
            [none, six, none, none, none, none, one, none]
        });
        assert_eq!((edges.crowded, edges.repeated.len(), edges.pinched(&squares)), (0, 0, 0));
        // Both close around the same particle, so that all edges there have two sides.
        let cone = |rim: [u32; 3]| (0..3).map(move |i| vec![0, rim[i], rim[(i + 1) % 3]]);
        let cones = mesh(7, &cone([1, 2, 3]).chain(cone([4, 5, 6])).collect::<Vec<_>>());
        assert_eq!(Edges::of(&cones).pinched(&cones), 1);
    }

    proptest! {
        /// Against looking at all sides and all faces by name.
        #[test]
        fn the_plain_way_finds_the_same(
            picks in prop::collection::vec((prop::sample::subsequence((0..9_u32).collect::<Vec<_>>(), 3..=6), 0..6_usize, any::<bool>()), 0..24),
        ) {
            let faces: Vec<Vec<u32>> = picks
                .into_iter()
                .map(|(mut face, turn, is_reversed)| {
                    let by = turn % face.len();
                    face.rotate_left(by);
                    if is_reversed {
                        face.reverse();
                    }
                    face
                })
                .collect();
            let mesh = mesh(9, &faces);
            let edges = Edges::of(&mesh);
            let mut along: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
            for side in 0..mesh.corners().len() as u32 {
                along.entry(ends(&mesh, side)).or_default().push(side);
            }
            prop_assert_eq!(edges.crowded, along.values().filter(|sides| sides.len() > 2).count());
            for sides in along.values() {
                for (i, side) in sides.iter().enumerate() {
                    let across = if sides.len() == 2 { Some(sides[1 - i]) } else { None };
                    prop_assert_eq!(edges.across(*side), across);
                }
            }
            let is_repeated = |f: &usize| faces[..*f].iter().any(|one| canonical(one) == canonical(&faces[*f]));
            let repeated: Vec<u32> = (0..faces.len()).filter(is_repeated).map(|f| f as u32).collect();
            prop_assert_eq!(&edges.repeated, &repeated);
            // Faces around a particle are one group if one can go from each to each over edges that end there.
            let is_pinched = |p: &u32| {
                let here: Vec<usize> = (0..faces.len()).filter(|f| faces[*f].contains(p)).collect();
                let mut reached = vec![false; faces.len()];
                let mut way: Vec<usize> = here.first().copied().into_iter().collect();
                while let Some(f) = way.pop() {
                    if std::mem::replace(&mut reached[f], true) {
                        continue;
                    }
                    let sides = along.iter().filter(|(ends, _)| ends.contains(p)).map(|(_, sides)| sides);
                    for sides in sides {
                        let of: Vec<usize> = sides.iter().map(|side| mesh.face_at(*side).0).collect();
                        if of.contains(&f) {
                            way.extend(of);
                        }
                    }
                }
                here.iter().any(|f| !reached[*f])
            };
            prop_assert_eq!(edges.pinched(&mesh), (0..9).filter(is_pinched).count());
        }
    }
}
