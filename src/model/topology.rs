//! The spring pairs of a mesh: which particles are joined, by which kind of spring.

use super::sorting::sort_by_particle;
use crate::target::QuadMesh;

/// The three kinds of springs (Provot, "Deformation constraints in a mass-spring model to describe rigid cloth behavior", 1995).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SpringKind {
    /// Along the edges of the faces.
    Stretch,
    /// Along both diagonals of every quad.
    Shear,
    /// Straight across a regular vertex, or between the corners opposite an interior edge of a triangle mesh.
    Bend,
}

impl SpringKind {
    /// All kinds, in the order in which springs are stored.
    pub const ALL: [Self; 3] = [Self::Stretch, Self::Shear, Self::Bend];
}

/// Unique pairs of particles by kind; each pair has the lower index first and each list is sorted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Topology {
    /// Pairs by kind, in the order of [`SpringKind::ALL`].
    pub pairs: [Vec<[u32; 2]>; 3],
}

impl Topology {
    /// Finds the springs of a mesh, in time linear in its size.
    ///
    /// Stretch: the edges of the faces and the edges without a face. Shear: both diagonals of every quad. Bend: the two pairs
    /// straight across a vertex inside exactly four quads; the two border neighbours of a vertex between exactly two quads; the two
    /// neighbours of a particle inside a chain; and in a mesh without any quad the corners opposite an edge between two triangles.
    pub fn of(mesh: &QuadMesh) -> Self {
        let unique = |pairs: Pairs| pairs.unique(mesh.positions.len());
        let (stretch, (shear, bend)) = rayon::join(
            || unique(along_edges(mesh)),
            || {
                let has_quads = mesh.faces().any(|face| face.len() == 4);
                let bend = || if has_quads { across_vertices(mesh) } else { across_edges(mesh) };
                rayon::join(|| unique(across_quads(mesh)), || unique(bend()))
            },
        );
        Self { pairs: [stretch, shear, bend] }
    }

    /// The pairs of one kind.
    pub fn of_kind(&self, kind: SpringKind) -> &[[u32; 2]] {
        &self.pairs[kind as usize]
    }
}

/// Pairs while they are collected, each with its lower end first.
#[derive(Default)]
struct Pairs(Vec<[u32; 2]>);

impl Pairs {
    fn with_capacity(capacity: usize) -> Self {
        Self(Vec::with_capacity(capacity))
    }

    fn push(&mut self, a: u32, b: u32) {
        self.0.push([a.min(b), a.max(b)]);
    }

    fn unique(self, particles: usize) -> Vec<[u32; 2]> {
        let mut pairs = sort_by_particle(self.0, particles, |pair| pair[0]);
        pairs.dedup();
        pairs.shrink_to_fit();
        pairs
    }
}

/// The two neighbours of a particle along one face (or its one neighbour along a chain's edge), listed by particle.
struct Wedges {
    /// Start of each particle's wedges, with one more entry at the end.
    starts: Vec<u32>,
    wedges: Vec<Wedge>,
}

#[derive(Clone, Copy, Default)]
struct Wedge {
    ends: [u32; 2],
    corners: u32,
}

impl Wedges {
    fn of(mesh: &QuadMesh) -> Self {
        let mut starts = vec![0; mesh.positions.len() + 1];
        for corner in mesh.corners().iter().chain(mesh.edges().as_flattened()) {
            starts[*corner as usize] += 1;
        }
        let mut end = 0;
        for start in &mut starts {
            end += *start;
            *start = end;
        }
        // Every start now stands at the end of its list and walks back as the list is filled.
        let mut wedges = vec![Wedge::default(); end as usize];
        let mut put = |at: u32, wedge| {
            starts[at as usize] -= 1;
            wedges[starts[at as usize] as usize] = wedge;
        };
        for face in mesh.faces() {
            for (i, at) in face.iter().enumerate() {
                let ends = [face[(i + face.len() - 1) % face.len()], face[(i + 1) % face.len()]];
                put(*at, Wedge { ends, corners: face.len() as u32 });
            }
        }
        for [a, b] in mesh.edges() {
            put(*a, Wedge { ends: [*b; 2], corners: 2 });
            put(*b, Wedge { ends: [*a; 2], corners: 2 });
        }
        Self { starts, wedges }
    }

    fn each(&self) -> impl Iterator<Item = &[Wedge]> {
        self.starts.windows(2).map(|w| &self.wedges[w[0] as usize..w[1] as usize])
    }
}

fn along_edges(mesh: &QuadMesh) -> Pairs {
    let mut stretch = Pairs::with_capacity(mesh.corners().len() + mesh.edges().len());
    for face in mesh.faces() {
        stretch.push(face[face.len() - 1], face[0]);
        for side in face.windows(2) {
            stretch.push(side[0], side[1]);
        }
    }
    for [a, b] in mesh.edges() {
        stretch.push(*a, *b);
    }
    stretch
}

fn across_quads(mesh: &QuadMesh) -> Pairs {
    let mut shear = Pairs::default();
    for face in mesh.faces() {
        if let [a, b, c, d] = *face {
            shear.push(a, c);
            shear.push(b, d);
        }
    }
    shear
}

fn across_vertices(mesh: &QuadMesh) -> Pairs {
    let mut bend = Pairs::with_capacity(2 * mesh.positions.len());
    for around in Wedges::of(mesh).each() {
        if around.iter().all(|w| w.corners == 4) {
            match *around {
                [one, two] => {
                    if let Some((a, b)) = border_ends(one.ends, two.ends) {
                        bend.push(a, b);
                    }
                }
                [first, ref rest @ ..] if rest.len() == 3 => {
                    if let Some([right, opposite, left]) = ring(first.ends, rest) {
                        bend.push(first.ends[0], opposite);
                        bend.push(right, left);
                    }
                }
                _ => {}
            }
        } else if let [Wedge { ends: [a, _], corners: 2 }, Wedge { ends: [b, _], corners: 2 }] = *around
            && a != b
        {
            bend.push(a, b);
        }
    }
    bend
}

/// What two wedges that share exactly one end do not share.
fn border_ends(one: [u32; 2], two: [u32; 2]) -> Option<(u32, u32)> {
    let other = |wedge: [u32; 2], end| if wedge[0] == end { wedge[1] } else { wedge[0] };
    let mut shared = one.into_iter().filter(|end| two.contains(end));
    match (shared.next(), shared.next()) {
        (Some(end), None) => Some((other(one, end), other(two, end))),
        _ => None,
    }
}

/// Walks from wedge to wedge over shared ends: the second, third and fourth neighbour, if four wedges close one ring.
fn ring(first: [u32; 2], rest: &[Wedge]) -> Option<[u32; 3]> {
    let mut at = first[1];
    let mut walked = [at; 3];
    let mut used = [false; 3];
    for step in 0..3 {
        let next = (0..3).find(|i| !used[*i] && rest[*i].ends.contains(&at))?;
        used[next] = true;
        let [a, b] = rest[next].ends;
        at = if a == at { b } else { a };
        if step < 2 {
            walked[step + 1] = at;
        }
    }
    let distinct = walked[0] != walked[2] && first[0] != walked[1];
    (at == first[0] && distinct).then_some(walked)
}

/// Corners opposite an edge between exactly two triangles; inside a chain, the two neighbours.
fn across_edges(mesh: &QuadMesh) -> Pairs {
    let mut bend = Pairs::default();
    let mut sides = Vec::with_capacity(mesh.corners().len());
    for face in mesh.faces() {
        for (i, a) in face.iter().enumerate() {
            let b = face[(i + 1) % face.len()];
            let opposite = if face.len() == 3 { face[(i + 2) % 3] } else { u32::MAX };
            sides.push(([*a.min(&b), *a.max(&b)], opposite));
        }
    }
    let sides = sort_by_particle(sides, mesh.positions.len(), |(ends, _)| ends[0]);
    for edge in sides.chunk_by(|one, two| one.0 == two.0) {
        if let [(_, one), (_, two)] = *edge
            && one != two
            && one.max(two) != u32::MAX
        {
            bend.push(one, two);
        }
    }
    for around in Wedges::of(mesh).each() {
        if let [Wedge { ends: [a, _], corners: 2 }, Wedge { ends: [b, _], corners: 2 }] = *around
            && a != b
        {
            bend.push(a, b);
        }
    }
    bend
}
