//! Turns the triangles of a glTF mesh back into the quads that they were exported from.
//!
//! Three ways, each using what the one before left open: the polygons that the file declares (`FB_ngon_encoding`), the order of the
//! triangles (exporters write a quad's two triangles one after the other), and geometry (two triangles that make a good rectangle).
//! Order and geometry are rivals where nothing is declared: what makes the more regular sheet is kept.

use std::cell::{Cell, OnceCell};
use std::cmp::Ordering;
use std::collections::{BinaryHeap, VecDeque};
use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde::Serialize;

use super::QuadMesh;
use super::edges::Edges;

/// How quads were brought back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RecoveryMethod {
    /// No quads were brought back: the file keeps polygons itself, or holds true triangles.
    #[default]
    None,
    /// The file says which triangles make a polygon.
    NgonEncoding,
    /// Consecutive triangles that share an edge.
    Order,
    /// Neighbouring triangles that make a good rectangle: a guess.
    Geometry,
}

/// What became of a file's triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct QuadRecovery {
    /// The way that was used; for several meshes the least certain one.
    pub method: RecoveryMethod,
    /// Quads that came back.
    pub quads: usize,
    /// Triangles of the file that stayed triangles.
    pub triangles_left: usize,
}

/// The quads of a mesh, and the triangles that stay.
pub(super) struct Recovered {
    /// These faces, without the particles.
    pub faces: QuadMesh,
    /// The triangle that each face is, or begins with, and the one that completes it to a quad (`u32::MAX` without).
    pub triangles: Vec<[u32; 2]>,
    pub recovery: QuadRecovery,
    /// The quads look like pairs of true triangles.
    pub is_suspicious: bool,
}

/// Order is believed where it pairs at least this share of the triangles. Exports of quads reach 0.94 to 1, true triangles 0.59.
const ORDER_SHARE: f64 = 0.8;
/// Order wins over geometry unless it leaves fewer regular vertices than this share of geometry's.
const ORDER_REGULAR: f64 = 0.99;
/// Where the corners of the quads are off a right angle by more than this on average, radians, they look like pairs of true triangles:
/// a guess by geometry is given up, and for the order the user is told. Rectangles are off by 0, pairs of equilateral triangles by
/// 30 degrees; halfway between would suspect strongly sheared cloth, so nearer to the latter.
const SUSPICIOUS: f64 = 25.0 / 180.0 * PI;
/// What starting anew costs against continuing a quad, as [`misfit`]. With this and the next two numbers geometry alone brings back
/// 0.999 of the quads of each of 18 garments and sheets (0.95 of a cape that is partly true triangles). Of the values that were tried
/// (0.1 to 1, 0 to 1 and 0.1 to 1) the worst bring back 0.98.
const NEW_START: f32 = 0.1;
/// What a continuation costs that bends by a right angle.
const BEND_COST: f32 = 0.1;
/// How many triangles a search for an alternating path may visit; bounds its time.
const PATH_VISITS: usize = 256;
/// An alternating path may make the quads along it worse by this much on average, as [`misfit`]: more would cut true triangles up.
const PATH_WORSE: f64 = 0.3;

const NONE: u32 = u32::MAX;

/// Pairs the triangles of `mesh`; `raw` are the same triangles by the vertex numbers of the file, before welding.
pub(super) fn recover(mesh: &QuadMesh, edges: &Edges, raw: &[[u32; 3]], ngon_encoding: bool) -> Recovered {
    let (triangles, _) = mesh.corners().as_chunks();
    let (mate, method) = pair(&mesh.positions, triangles, edges, raw, ngon_encoding);
    let pairs = mate.iter().filter(|mate| **mate != NONE).count() / 2;
    let mut faces = QuadMesh::default();
    faces.reserve(triangles.len() - pairs, mesh.corners().len() - 2 * pairs);
    let mut recovery = QuadRecovery::default();
    let mut sources = Vec::with_capacity(triangles.len() - pairs);
    for (t, triangle) in triangles.iter().enumerate() {
        if mate[t] == NONE {
            recovery.triangles_left += 1;
            faces.push_face(triangle);
            sources.push([t as u32, NONE]);
        } else if (mate[t] as usize) > t
            && let Some(quad) = quad(*triangle, triangles[mate[t] as usize])
        {
            recovery.quads += 1;
            faces.push_face(&quad);
            sources.push([t as u32, mate[t]]);
        }
    }
    if recovery.quads > 0 {
        recovery.method = method;
    }
    let is_suspicious = are_suspicious(&mesh.positions, triangles, &mate);
    Recovered { faces, triangles: sources, recovery, is_suspicious }
}

/// For every triangle the one that it makes a quad with, or `NONE`.
fn pair(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    edges: &Edges,
    raw: &[[u32; 3]],
    ngon_encoding: bool,
) -> (Vec<u32>, RecoveryMethod) {
    if ngon_encoding && let Some(mate) = by_ngon_encoding(triangles, raw) {
        return (mate, RecoveryMethod::NgonEncoding);
    }
    let (mut by_order, neighbours) =
        rayon::join(|| by_order(positions, triangles, raw), || Neighbours::of(positions, triangles, edges));
    let regular = |mate: &[u32]| neighbours.regular_vertices(mate) as f64;
    let paired = by_order.iter().filter(|m| **m != NONE).count();
    let is_covered = paired as f64 >= ORDER_SHARE * triangles.len() as f64;
    if is_covered {
        neighbours.pair_best_first(&mut by_order);
        // No rival can make more vertices regular than there are inside.
        if regular(&by_order) >= ORDER_REGULAR * neighbours.interior_vertices() as f64 {
            return (by_order, RecoveryMethod::Order);
        }
    }
    let mut by_geometry = vec![NONE; triangles.len()];
    neighbours.pair_best_first(&mut by_geometry);
    neighbours.pair_along_paths(&mut by_geometry);
    if is_covered && regular(&by_order) >= ORDER_REGULAR * regular(&by_geometry) {
        return (by_order, RecoveryMethod::Order);
    }
    if are_suspicious(positions, triangles, &by_geometry) {
        by_geometry.fill(NONE);
    }
    (by_geometry, RecoveryMethod::Geometry)
}

/// Runs of triangles with the same first index that chain over an edge: one is a triangle, two are a quad, longer ones are paired
/// in steps. `None` where that yields no quad at all. A run may hold several polygons, because some writers fuse neighbours.
///
/// Source: glTF extension `FB_ngon_encoding`, Khronos glTF registry.
fn by_ngon_encoding(triangles: &[[u32; 3]], raw: &[[u32; 3]]) -> Option<Vec<u32>> {
    let chained = |t: usize| raw[t][0] == raw[t + 1][0] && shared_corners(raw[t], raw[t + 1]) == 2;
    let mut mate = vec![NONE; triangles.len()];
    let mut found = false;
    let mut t = 0;
    while t + 1 < triangles.len() {
        if chained(t) && quad(triangles[t], triangles[t + 1]).is_some() {
            marry(&mut mate, t, t + 1);
            found = true;
            t += 2;
        } else {
            t += 1;
        }
    }
    found.then_some(mate)
}

/// The largest set of pairs (t, t + 1) that share an edge, and of those sets the one with the best rectangles (dynamic programming).
///
/// An edge is shared by raw vertex number, as a quad's diagonal is never a seam; where no triangles share any vertex
/// (files without indices) by particle.
fn by_order(positions: &[DVec3], triangles: &[[u32; 3]], raw: &[[u32; 3]]) -> Vec<u32> {
    let by = if shares_corners(raw) { raw } else { triangles };
    let next = |t: usize| {
        (shared_corners(by[t], by[t + 1]) == 2).then(|| quad(triangles[t], triangles[t + 1])).flatten()
    };
    let mut mate = vec![NONE; triangles.len()];
    let mut start = 0;
    while start < triangles.len() {
        // Each of a run of triangles makes a quad with the next.
        let quads: Vec<_> = (start..triangles.len() - 1).map_while(next).collect();
        let end = start + quads.len() + 1;
        if quads.len() % 2 == 1 {
            // All of them find a mate in one way only.
            (start..end).step_by(2).for_each(|t| marry(&mut mate, t, t + 1));
        } else if !quads.is_empty() {
            marry_best(
                &mut mate,
                start,
                &quads.iter().map(|quad| misfit(positions, *quad)).collect::<Vec<_>>(),
            );
        }
        start = end;
    }
    mate
}

/// Pairs a run of triangles, each of which fits so badly to the next, so that one is left over and the others fit best.
fn marry_best(mate: &mut [u32], start: usize, misfits: &[f64]) {
    // Best (number of pairs, negative misfit) of the triangles before t, and whether t - 2 and t - 1 are one of them.
    let mut best = [(0_u32, 0.0_f64); 2];
    let mut takes = vec![false; misfits.len() + 2];
    for (t, misfit) in (2..).zip(misfits) {
        let [before, last] = best;
        best = [last, last];
        let with = (before.0 + 1, before.1 - misfit);
        if with > last {
            best[1] = with;
            takes[t] = true;
        }
    }
    let mut t = takes.len() - 1;
    while t >= 2 {
        if takes[t] {
            marry(mate, start + t - 2, start + t - 1);
            t -= 1;
        }
        t -= 1;
    }
}

/// Whether any two triangles have a corner in common.
fn shares_corners(triangles: &[[u32; 3]]) -> bool {
    let corners = triangles.as_flattened();
    let mut used = vec![false; corners.iter().max().map_or(0, |most| *most as usize + 1)];
    corners.iter().any(|corner| std::mem::replace(&mut used[*corner as usize], true))
}

fn marry(mate: &mut [u32], one: usize, two: usize) {
    mate[one] = two as u32;
    mate[two] = one as u32;
}

fn shared_corners(one: [u32; 3], two: [u32; 3]) -> usize {
    one.iter().filter(|corner| two.contains(corner)).count()
}

/// The quad of two triangles that share exactly two corners, wound like the first one.
fn quad(one: [u32; 3], two: [u32; 3]) -> Option<[u32; 4]> {
    let apex = (0..3).find(|i| !two.contains(&one[*i]))?;
    let [from, to] = [one[(apex + 1) % 3], one[(apex + 2) % 3]];
    let opposite = two.into_iter().find(|corner| !one.contains(corner))?;
    (two.contains(&from) && two.contains(&to)).then_some([one[apex], from, opposite, to])
}

/// Corners of a quad [apex, end, apex, end] of two triangles, unfolded around the edge between its ends: of each, (cosine, sine) of
/// its angle, which may go all around, times anything above 0.
fn corners(positions: &[DVec3], quad: [u32; 4]) -> [DVec2; 4] {
    let [a, p, b, q] = quad.map(|corner| positions[corner as usize]);
    // Scaled to about 1, or the products of tiny lengths would vanish.
    let scale =
        1.0 / (a - p).abs().max((b - p).abs()).max((q - p).abs()).max_element().max(f64::MIN_POSITIVE);
    let corner = |at: DVec3, one: DVec3, two: DVec3| {
        let (one, two) = ((one - at) * scale, (two - at) * scale);
        DVec2::new(one.dot(two), one.cross(two).length())
    };
    // The product of complex numbers turns by the sum of their angles.
    let ends = [corner(p, a, q).rotate(corner(p, b, q)), corner(q, a, p).rotate(corner(q, b, p))];
    [corner(a, p, q), ends[0], corner(b, p, q), ends[1]]
}

/// Radians, 0 to a whole turn.
fn angle(corner: DVec2) -> f64 {
    corner.y.atan2(corner.x).rem_euclid(2.0 * PI)
}

/// How much the sides of two quads bend where one continues the other: 0 straight on, 1 at right angles. Quads that do not lie
/// side by side bend by 1.
fn bend(positions: &[DVec3], here: [u32; 4], next: [u32; 4]) -> f64 {
    let mut sum = 0.0;
    let mut shared = 0;
    for (i, corner) in here.iter().enumerate() {
        let Some(j) = next.iter().position(|n| n == corner) else { continue };
        let before = [here[(i + 1) % 4], here[(i + 3) % 4]].into_iter().find(|c| !next.contains(c));
        let after = [next[(j + 1) % 4], next[(j + 3) % 4]].into_iter().find(|c| !here.contains(c));
        let (Some(before), Some(after)) = (before, after) else { return 1.0 };
        let [before, at, after] = [before, *corner, after].map(|c| positions[c as usize]);
        sum += 1.0 - (at - before).normalize_or_zero().dot((after - at).normalize_or_zero());
        shared += 1;
    }
    if shared == 2 { sum / 2.0 } else { 1.0 }
}

/// How far two triangles are from a flat rectangle, 0 for the perfect one: mean square of the corners' difference from a right
/// angle (as a share of it), unequal opposite sides, and a little for the fold between them, as cloth does fold.
fn misfit(positions: &[DVec3], quad: [u32; 4]) -> f64 {
    let [a, p, b, q] = quad.map(|corner| positions[corner as usize]);
    let corners = corners(positions, quad).map(|corner| (angle(corner) / FRAC_PI_2 - 1.0).powi(2));
    let unequal = |one: f64, two: f64| {
        let sum = one + two;
        if sum > 0.0 { ((one - two) / sum).powi(2) } else { 0.0 }
    };
    let sides = unequal(a.distance(p), b.distance(q)) + unequal(a.distance(q), b.distance(p));
    let normals = [(p - a).cross(q - a).normalize_or_zero(), (q - b).cross(p - b).normalize_or_zero()];
    let fold = 1.0 - normals[0].dot(normals[1]);
    corners.iter().sum::<f64>() / 4.0 + sides / 2.0 + 0.02 * fold
}

/// Whether the corners of the quads are off a right angle by more than [`SUSPICIOUS`] on average.
fn are_suspicious(positions: &[DVec3], triangles: &[[u32; 3]], mate: &[u32]) -> bool {
    // No angle is larger than its tangent, which takes a fraction of the time and nearly always decides.
    let tangent = |corner: DVec2| if corner.y > 0.0 { (corner.x / corner.y).abs() } else { f64::INFINITY };
    let angle = |corner| (angle(corner) - FRAC_PI_2).abs();
    mean_of_corners(positions, triangles, mate, tangent) > SUSPICIOUS
        && mean_of_corners(positions, triangles, mate, angle) > SUSPICIOUS
}

/// The mean over all corners of all quads.
fn mean_of_corners(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    mate: &[u32],
    of: impl Fn(DVec2) -> f64 + Sync,
) -> f64 {
    // Pieces of one size whatever the number of threads, so that the sum has the same bits.
    const PIECE: usize = 1 << 12;
    let sums: Vec<[f64; 2]> = (mate.par_chunks(PIECE).enumerate())
        .map(|(piece, mates)| {
            let mut sum = [0.0; 2];
            for (t, mate) in (piece * PIECE..).zip(mates) {
                if *mate != NONE
                    && *mate as usize > t
                    && let Some(quad) = quad(triangles[t], triangles[*mate as usize])
                {
                    let [a, b, c, d] = corners(positions, quad).map(&of);
                    sum = [sum[0] + (a + b + c + d), sum[1] + 4.0];
                }
            }
            sum
        })
        .collect();
    let [sum, count] = sums.into_iter().fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
    sum / f64::max(count, 1.0)
}

/// Two triangles that may become a quad; the queue gives the cheapest first, and of equal ones the first.
struct Candidate {
    cost: f32,
    one: u32,
    two: u32,
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        let order = self.cost.total_cmp(&other.cost).then((self.one, self.two).cmp(&(other.one, other.two)));
        order.reverse()
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Candidate {}

/// Which triangles share an edge that no third one uses, and how good a quad each two of them make.
struct Neighbours<'a> {
    positions: &'a [DVec3],
    triangles: &'a [[u32; 3]],
    edges: &'a Edges,
    /// The misfit of the quad across each side; not a number until somebody has asked for it.
    misfits: OnceCell<Vec<Cell<f32>>>,
    /// Whether a particle is at an edge of one triangle, or of more than two.
    is_at_border: Vec<bool>,
}

impl<'a> Neighbours<'a> {
    fn of(positions: &'a [DVec3], triangles: &'a [[u32; 3]], edges: &'a Edges) -> Self {
        let mut is_at_border = vec![false; positions.len()];
        for (side, [a, b, c]) in (0..).step_by(3).zip(triangles) {
            for (i, ends) in [[a, b], [b, c], [c, a]].into_iter().enumerate() {
                if edges.across(side + i as u32).is_none() {
                    ends.into_iter().for_each(|end| is_at_border[*end as usize] = true);
                }
            }
        }
        Self { positions, triangles, edges, misfits: OnceCell::new(), is_at_border }
    }

    /// The neighbours of a triangle. No two triangles have the same corners, so that it makes a quad with each.
    fn around(&self, t: u32) -> impl Iterator<Item = u32> {
        (3 * t..3 * t + 3).filter_map(|side| self.edges.across(side)).map(|side| side / 3)
    }

    /// How badly a triangle fits to its neighbour.
    fn misfit(&self, t: u32, neighbour: u32) -> f32 {
        let sides = 3 * t..3 * t + 3;
        let Some(side) =
            sides.into_iter().find(|s| self.edges.across(*s).is_some_and(|s| s / 3 == neighbour))
        else {
            return 0.0;
        };
        let misfits = || vec![const { Cell::new(f32::NAN) }; 3 * self.triangles.len()];
        let known = &self.misfits.get_or_init(misfits)[side as usize];
        if known.get().is_nan() {
            // The same number from either side.
            let quad = self.quad(t.min(neighbour), t.max(neighbour));
            known.set(quad.map_or(0.0, |quad| misfit(self.positions, quad) as f32));
        }
        known.get()
    }

    fn quad(&self, one: u32, two: u32) -> Option<[u32; 4]> {
        quad(self.triangles[one as usize], self.triangles[two as usize])
    }

    /// Pairs what is free, the best quads first; a quad that continues one that is there already comes before one that starts anew.
    fn pair_best_first(&self, mate: &mut [u32]) {
        let free: Vec<u32> = (0..mate.len() as u32).filter(|t| mate[*t as usize] == NONE).collect();
        if free.is_empty() {
            return;
        }
        let mut queue = BinaryHeap::new();
        for one in free {
            for two in self.around(one).filter(|two| one < *two && mate[*two as usize] == NONE) {
                queue.push(Candidate { cost: self.misfit(one, two) + NEW_START, one, two });
            }
        }
        for t in 0..mate.len() as u32 {
            if mate[t as usize] > t {
                self.queue_continuations(mate, t, &mut queue);
            }
        }
        while let Some(Candidate { one, two, .. }) = queue.pop() {
            if mate[one as usize] == NONE && mate[two as usize] == NONE {
                marry(mate, one as usize, two as usize);
                self.queue_continuations(mate, one, &mut queue);
            }
        }
    }

    /// Queues the free quads across the four sides of the one that triangle `t` belongs to, the straighter the sooner.
    fn queue_continuations(&self, mate: &[u32], t: u32, queue: &mut BinaryHeap<Candidate>) {
        let partner = mate[t as usize];
        if partner == NONE {
            return;
        }
        let Some(here) = self.quad(t, partner) else { return };
        for one in self.around(t).chain(self.around(partner)) {
            for two in self.around(one) {
                if mate[one as usize] == NONE && mate[two as usize] == NONE {
                    let bend = self.quad(one, two).map_or(1.0, |next| bend(self.positions, here, next));
                    let cost = self.misfit(one, two) + BEND_COST * bend as f32;
                    queue.push(Candidate { cost, one, two });
                }
            }
        }
    }

    /// Joins two free triangles over a chain of quads between them, each of which is cut along its other side, if the quads stay good.
    fn pair_along_paths(&self, mate: &mut [u32]) {
        let mut came_from = vec![NONE; mate.len()];
        let mut seen = Vec::new();
        for start in 0..mate.len() as u32 {
            if mate[start as usize] == NONE {
                if let Some(end) = self.path(start, mate, &mut came_from, &mut seen)
                    && self.worsening(end, start, mate, &came_from) <= PATH_WORSE
                {
                    flip(end, start, mate, &came_from);
                }
                for t in seen.drain(..) {
                    came_from[t as usize] = NONE;
                }
            }
        }
    }

    /// A free triangle that is reached from `start` over edges that are in turn not inside a quad and inside one; breadth first.
    /// `came_from` says for a triangle reached over a quad's outer edge from which triangle.
    fn path(&self, start: u32, mate: &[u32], came_from: &mut [u32], seen: &mut Vec<u32>) -> Option<u32> {
        let mut queue = VecDeque::from([start]);
        while let Some(t) = queue.pop_front() {
            for next in self.around(t) {
                let partner = mate[next as usize];
                let new = next != start && partner != t && came_from[next as usize] == NONE;
                // A partner that was reached itself would make the path cross itself.
                if !new || (partner != NONE && came_from[partner as usize] != NONE) {
                    continue;
                }
                came_from[next as usize] = t;
                seen.push(next);
                if partner == NONE {
                    return Some(next);
                }
                if seen.len() > PATH_VISITS {
                    return None;
                }
                queue.push_back(partner);
            }
        }
        None
    }

    /// By how much the misfit of the quads along a path grows on average when they are cut along their other sides.
    fn worsening(&self, end: u32, start: u32, mate: &[u32], came_from: &[u32]) -> f64 {
        let misfit = |one: u32, two: u32| f64::from(self.misfit(one, two));
        let (mut sum, mut quads, mut at) = (0.0, 0.0, end);
        loop {
            let from = came_from[at as usize];
            sum += misfit(at, from);
            quads += 1.0;
            if from == start {
                return sum / quads;
            }
            sum -= misfit(from, mate[from as usize]);
            at = mate[from as usize];
        }
    }

    /// Vertices that are not on the border.
    fn interior_vertices(&self) -> usize {
        self.is_at_border.iter().filter(|border| !**border).count()
    }

    /// Interior vertices with exactly four quads around them.
    fn regular_vertices(&self, mate: &[u32]) -> usize {
        // Quads around each vertex; a triangle or the border spoils it.
        const SPOILT: u32 = u32::MAX / 2;
        let mut quads: Vec<u32> =
            self.is_at_border.iter().map(|border| u32::from(*border) * SPOILT).collect();
        for (t, triangle) in self.triangles.iter().enumerate() {
            let other = mate[t];
            if other == NONE {
                for corner in triangle {
                    quads[*corner as usize] = SPOILT;
                }
            } else if other as usize > t
                && let Some(quad) = self.quad(t as u32, other)
            {
                for corner in quad {
                    quads[corner as usize] = (quads[corner as usize] + 1).min(SPOILT);
                }
            }
        }
        quads.iter().filter(|count| **count == 4).count()
    }
}

/// Makes every triangle on a path to `end` a quad with the one that it was reached from.
fn flip(end: u32, start: u32, mate: &mut [u32], came_from: &[u32]) {
    let mut at = end;
    loop {
        let from = came_from[at as usize];
        let partner = mate[from as usize];
        marry(mate, at as usize, from as usize);
        if from == start {
            return;
        }
        at = partner;
    }
}
