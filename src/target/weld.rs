//! Vertices at the same place become one particle.

use std::collections::HashMap;

use glam::DVec3;

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
    let mut first_at = HashMap::new();
    let first = |(i, p): (usize, &DVec3)| {
        // Adding +0.0 turns -0.0 into +0.0.
        let bits = (*p + DVec3::ZERO).to_array().map(f64::to_bits);
        *first_at.entry(bits).or_insert(i as u32)
    };
    positions.iter().enumerate().map(first).collect()
}

fn weld_nearby(positions: &[DVec3], exact: Vec<u32>, tolerance: f64) -> Vec<u32> {
    const NONE: u32 = u32::MAX;
    let low = positions.iter().copied().fold(DVec3::MAX, DVec3::min);
    // Each cell holds a list of first ones: its latest, and for each of them the one before.
    let mut latest: HashMap<[i64; 3], u32> = HashMap::new();
    let mut before = vec![NONE; positions.len()];
    let mut first = exact;
    for i in 0..positions.len() {
        if first[i] as usize != i {
            first[i] = first[first[i] as usize];
            continue;
        }
        let cell = ((positions[i] - low) / tolerance).to_array().map(|x| x as i64);
        let mut nearest: Option<(f64, u32)> = None;
        for offset in 0..27 {
            let neighbour =
                [0, 1, 2].map(|axis| cell[axis] + [offset / 9, offset / 3 % 3, offset % 3][axis] - 1);
            let mut at = latest.get(&neighbour).copied().unwrap_or(NONE);
            while at != NONE {
                let distance = positions[i].distance(positions[at as usize]);
                if distance <= tolerance && nearest.is_none_or(|n| (distance, at) < n) {
                    nearest = Some((distance, at));
                }
                at = before[at as usize];
            }
        }
        if let Some((_, at)) = nearest {
            first[i] = at;
        } else if let Some(earlier) = latest.insert(cell, i as u32) {
            before[i] = earlier;
        }
    }
    first
}
