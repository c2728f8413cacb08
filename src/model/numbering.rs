//! A numbering of the particles in which neighbours stand near each other, so that a pass over the springs reads what it
//! has read just before.
//!
//! Breadth first along the edges from a corner of the cloth, neighbours of few edges first (Cuthill and McKee, "Reducing
//! the bandwidth of sparse symmetric matrices", 1969), the corner found by going as far as one can (Gibbs, Poole,
//! Stockmeyer, "An algorithm for reducing the bandwidth and profile of a sparse matrix", 1976). In linear time.

use super::{Incidence, SpringKind, Topology};

/// Two names for every particle: that of its source, by which everybody knows it, and an inner one, by which it is stored.
#[derive(Clone, Debug, Default)]
pub struct Numbering {
    /// Inner numbers by source and source numbers by inner one; none where both are the same.
    maps: Option<[Vec<u32>; 2]>,
}

impl Numbering {
    /// A local numbering; the source's own where that is one already and goes along rows, as that of every grid.
    pub fn of(particles: usize, topology: &Topology) -> Self {
        let pairs = topology.pairs.iter().flatten();
        let springs = topology.pairs.iter().map(Vec::len).sum::<usize>();
        let span: u64 = pairs.map(|[a, b]| u64::from(b.abs_diff(*a))).sum();
        // A square sheet by rows has 5/6 of a row: what is near that can hardly be made nearer.
        let near = 2.0 * (particles as f64).sqrt();
        let edges = topology.of_kind(SpringKind::Stretch);
        if springs == 0 || (span as f64 <= near * springs as f64 && are_in_rows(edges)) {
            return Self::default();
        }
        let source = cuthill_mckee(particles, edges);
        let mut inner = vec![0; particles];
        for (i, &p) in source.iter().enumerate() {
            inner[p as usize] = i as u32;
        }
        Self { maps: Some([inner, source]) }
    }

    /// How many particles are renumbered; none where both numbers of every particle are the same.
    pub(super) fn len(&self) -> usize {
        self.maps.as_ref().map_or(0, |[inner, _]| inner.len())
    }

    /// Whether both numbers of every particle are the same.
    pub fn is_identity(&self) -> bool {
        self.maps.is_none()
    }

    /// The inner number of a particle known by its source's.
    pub fn inner(&self, particle: u32) -> u32 {
        self.maps.as_ref().map_or(particle, |[inner, _]| inner[particle as usize])
    }

    /// The source's number of a particle known by its inner one.
    pub fn source(&self, particle: u32) -> u32 {
        self.maps.as_ref().map_or(particle, |[_, source]| source[particle as usize])
    }

    /// What stands in the order of the source, in the inner one.
    pub fn to_inner<V: Copy>(&self, values: &[V]) -> Vec<V> {
        (0..values.len() as u32).map(|i| values[self.source(i) as usize]).collect()
    }

    /// What stands in the inner order, in that of the source.
    pub fn in_source_order<V: Copy>(&self, values: &[V]) -> impl Iterator<Item = V> {
        (0..values.len() as u32).map(|p| values[self.inner(p) as usize])
    }
}

/// Whether most edges are followed by one from the next particle to the next: eight of such are computed at once. Most are three
/// quarters: as many as of a sheet of three columns. Edges are sorted.
fn are_in_rows(edges: &[[u32; 2]]) -> bool {
    let mut followers = edges.iter().peekable();
    let is_followed = |[i, j]: &&[u32; 2]| {
        let next = [i + 1, j + 1];
        while followers.next_if(|edge| **edge < next).is_some() {}
        followers.peek() == Some(&&next)
    };
    4 * edges.iter().filter(is_followed).count() >= 3 * edges.len()
}

/// The particles of each piece from one of its corners on.
fn cuthill_mckee(particles: usize, edges: &[[u32; 2]]) -> Vec<u32> {
    let graph = Incidence::new(particles, edges);
    let mut walk =
        Walk { seen: vec![0; particles], walks: 0, order: Vec::with_capacity(particles), near: Vec::new() };
    let mut numbered = vec![false; particles];
    let mut order = Vec::with_capacity(particles);
    for first in 0..particles as u32 {
        if !numbered[first as usize] {
            let end = walk.from(first, &graph);
            let corner = walk.from(end, &graph);
            walk.from(corner, &graph);
            walk.order.iter().for_each(|p| numbered[*p as usize] = true);
            order.extend_from_slice(&walk.order);
        }
    }
    order
}

/// A walk over a piece, breadth first.
struct Walk {
    /// The last walk that has come by each particle.
    seen: Vec<u32>,
    walks: u32,
    order: Vec<u32>,
    near: Vec<u32>,
}

impl Walk {
    /// Walks over the piece of `first`; answers with the particle of fewest edges among the farthest.
    fn from(&mut self, first: u32, graph: &Incidence) -> u32 {
        let edges = |p: u32| graph.around(p as usize).len();
        self.walks += 1;
        self.order.clear();
        self.order.push(first);
        self.seen[first as usize] = self.walks;
        // Where the particles begin that are as far away as the one at hand, and where those end.
        let (mut next, mut farthest, mut end) = (0, 0, 1);
        while let Some(&p) = self.order.get(next) {
            if next == end {
                (farthest, end) = (end, self.order.len());
            }
            self.near.clear();
            for [other, _] in graph.around(p as usize) {
                if std::mem::replace(&mut self.seen[*other as usize], self.walks) != self.walks {
                    self.near.push(*other);
                }
            }
            self.near.sort_by_key(|p| edges(*p));
            self.order.append(&mut self.near);
            next += 1;
        }
        self.order[farthest..].iter().copied().min_by_key(|p| edges(*p)).unwrap_or(first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::{QuadMesh, grid};

    /// A sheet whose particles stand in an order without sense.
    fn shuffled(side: u32) -> Topology {
        let mesh = grid(side, side, 1.0, false);
        let count = side * side;
        // A step without a divisor in common with the count comes by every particle.
        let name = |p: u32| (u64::from(p) * 7919 % u64::from(count)) as u32;
        let mut other = QuadMesh::new(mesh.positions.clone());
        for face in mesh.faces() {
            other.push_face(&face.iter().map(|p| name(*p)).collect::<Vec<_>>());
        }
        Topology::of(&other)
    }

    #[test]
    fn grids_keep_their_numbers_and_shuffled_ones_come_as_near_as_grids() {
        let side = 60;
        let sheet = Topology::of(&grid(side, side, 1.0, false));
        assert!(Numbering::of(3600, &sheet).is_identity());
        let shuffled = shuffled(side);
        let numbering = Numbering::of(3600, &shuffled);
        let span = |topology: &Topology, number: &dyn Fn(u32) -> u32| {
            let pairs = topology.pairs.iter().flatten();
            pairs.map(|[a, b]| u64::from(number(*a).abs_diff(number(*b)))).sum::<u64>()
        };
        let inner = span(&shuffled, &|p| numbering.inner(p));
        // Rows have one length, diagonals are longer in the middle; across and along both of them lead on by one diagonal.
        assert!(inner < 2 * span(&sheet, &|p| p), "{inner}");
        let mut all: Vec<u32> = (0..3600).map(|p| numbering.inner(p)).collect();
        assert!((0..3600).all(|p| numbering.source(numbering.inner(p)) == p));
        all.sort_unstable();
        assert!(all.into_iter().eq(0..3600));
    }

    #[test]
    fn what_is_near_but_in_no_row_is_renumbered_into_rows() {
        let side = 64;
        let mesh = grid(side, side, 1.0, false);
        // Each row by steps of one, two, three and so on.
        let name = |p: &u32| p / side * side + (p % side) * (p % side + 1) / 2 % side;
        let mut other = QuadMesh::new(mesh.positions.clone());
        for face in mesh.faces() {
            other.push_face(&face.iter().map(name).collect::<Vec<_>>());
        }
        let topology = Topology::of(&other);
        let edges = topology.of_kind(SpringKind::Stretch);
        assert!(are_in_rows(Topology::of(&mesh).of_kind(SpringKind::Stretch)) && !are_in_rows(edges));
        let numbering = Numbering::of(mesh.positions.len(), &topology);
        let mut renumbered: Vec<[u32; 2]> =
            edges.iter().map(|pair| pair.map(|p| numbering.inner(p))).collect();
        renumbered.iter_mut().for_each(|pair| pair.sort_unstable());
        renumbered.sort_unstable();
        assert!(are_in_rows(&renumbered));
    }

    #[test]
    fn pieces_and_lone_particles_are_all_numbered() {
        let pairs = vec![[0, 90], [3, 95], [90, 95], [10, 80]];
        let topology = Topology { pairs: [pairs, Vec::new(), Vec::new()] };
        let numbering = Numbering::of(100, &topology);
        assert!(!numbering.is_identity());
        let mut all: Vec<u32> = (0..100).map(|p| numbering.inner(p)).collect();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..100));
        let values: Vec<u32> = (0..100).map(|p| p * p).collect();
        assert!(numbering.in_source_order(&numbering.to_inner(&values)).eq(values));
    }
}
