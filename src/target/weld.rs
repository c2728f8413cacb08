//! Vertices at the same place become one particle.

use glam::DVec3;

use super::firsts::Firsts;

/// For every position the number of the first position that it coincides with (its own number where it is the first).
///
/// Equal positions always coincide, with -0 = 0. With a tolerance > 0 (in the unit of the positions), so does everything that
/// is within the tolerance of an earlier first one. First come, first kept: a chain of near neighbours does not collapse into one.
/// Time is linear: first ones are at least the tolerance apart, so only a few fit into the cells that are searched.
pub(super) fn weld(positions: &[DVec3], tolerance: f64) -> Vec<u32> {
    let exact = weld_exactly(positions);
    if tolerance > 0.0 { weld_nearby(positions, exact, tolerance) } else { exact }
}

fn weld_exactly(positions: &[DVec3]) -> Vec<u32> {
    let mut firsts = Firsts::new(positions.len());
    let first = |(i, p): (usize, &DVec3)| {
        // Adding +0.0 turns -0.0 into +0.0.
        let hash = firsts.hash((*p + DVec3::ZERO).to_array().map(f64::to_bits));
        firsts.find_or_add(hash, i as u32, |other| positions[other as usize] == *p)
    };
    positions.iter().enumerate().map(first).collect()
}

fn weld_nearby(positions: &[DVec3], exact: Vec<u32>, tolerance: f64) -> Vec<u32> {
    const NONE: u32 = u32::MAX;
    let low = positions.iter().copied().fold(DVec3::MAX, DVec3::min);
    let cell_of = |i: u32| ((positions[i as usize] - low) / tolerance).to_array().map(|x| x as i64);
    // Each cell, known by the first one that came into it, holds a list of first ones, each of which knows the next.
    let mut cells = Firsts::new(positions.len());
    let mut next = vec![NONE; positions.len()];
    let mut first = exact;
    for i in 0..positions.len() as u32 {
        let own = i as usize;
        if first[own] != i {
            first[own] = first[first[own] as usize];
            continue;
        }
        let cell = cell_of(i);
        let hash = |cells: &Firsts, cell: [i64; 3]| cells.hash(cell.map(i64::cast_unsigned));
        let mut nearest: Option<(f64, u32)> = None;
        for offset in 0..27 {
            let neighbour =
                [0, 1, 2].map(|axis| cell[axis] + [offset / 9, offset / 3 % 3, offset % 3][axis] - 1);
            let found = cells.find(hash(&cells, neighbour), |other| cell_of(other) == neighbour);
            let mut at = found.unwrap_or(NONE);
            while at != NONE {
                let distance = positions[own].distance(positions[at as usize]);
                if distance <= tolerance && nearest.is_none_or(|n| (distance, at) < n) {
                    nearest = Some((distance, at));
                }
                at = next[at as usize];
            }
        }
        if let Some((_, at)) = nearest {
            first[own] = at;
            continue;
        }
        let hash = hash(&cells, cell);
        let head = cells.find_or_add(hash, i, |other| cell_of(other) == cell);
        if head != i {
            next[own] = std::mem::replace(&mut next[head as usize], i);
        }
    }
    first
}
