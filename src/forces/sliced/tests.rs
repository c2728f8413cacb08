//! Springs for the tests of what goes over them, and where those of a sheet stand.

use super::*;
use crate::math::Vector;
use crate::model::{KindSettings, Particles, Topology};
use glam::DVec3;

/// Sheets, one so wide that the window has to move on, and springs in no order, each with its number of particles.
pub fn cloths() -> Vec<(Topology, usize)> {
    let sheet = |columns, rows| Topology::of(&crate::target::grid(columns, rows, 0.1, false));
    let mut cloths = vec![(sheet(70, 41), 70 * 41), (sheet(2500, 9), 2500 * 9)];
    cloths.extend([2, 7, 8, 9, 1025, 9001].map(|particles| (irregular(particles), particles as usize)));
    cloths
}

/// Pairs without rows: rings through all particles with strides of their own, so that degrees and distances differ.
fn irregular(particles: u32) -> Topology {
    let ring = |stride: u32, every: u32| -> Vec<[u32; 2]> {
        let ends = (0..particles).step_by(every as usize).map(|i| [i, (i * stride + 1) % particles]);
        let mut pairs: Vec<_> = ends.filter(|[i, j]| i != j).map(|[i, j]| [i.min(j), i.max(j)]).collect();
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    };
    Topology { pairs: [ring(7, 1), ring(13, 3), ring(1, 2)] }
}

/// A crumpled state with the springs of three kinds, two of them torn.
pub fn crumpled<T: Real>(topology: &Topology, particles: usize) -> (Springs<T>, Particles<T>) {
    let rest: Vec<T::Vec3> = (0..particles).map(|i| place::<T>(i, 1.0)).collect();
    let kinds =
        [1000.0, 300.0, 100.0].map(|stiffness| KindSettings { enabled: true, stiffness, rest_scale: 0.9 });
    let springs = Springs::<T>::new(topology, &rest, &kinds, &[3, 5]);
    let mut state = Particles::<T>::at_rest((0..particles).map(|i| place::<T>(i, 1.1)).collect());
    state.velocities = (0..particles).map(|i| place::<T>(i + 5, 2.0)).collect();
    (springs, state)
}

/// Something else for every particle, but that every ninth stands where the one before it stands: springs without length.
pub fn place<T: Real>(i: usize, scale: f64) -> T::Vec3 {
    let t = if i % 9 == 8 { i - 1 } else { i } as f64;
    T::Vec3::from_f64(DVec3::new((t * 0.7).sin(), (t * 1.3).cos(), (t * 2.1).sin()) * scale)
}

#[test]
fn the_springs_of_a_sheet_stand_in_rows() {
    let mesh = crate::target::grid(70, 41, 0.1, false);
    let kinds = [KindSettings { enabled: true, stiffness: 1.0, rest_scale: 1.0 }; 3];
    let topology = Topology::of(&mesh);
    let springs = Springs::<f64>::new(&topology, &mesh.positions, &kinds, &[]);
    let slices = Slices::new(mesh.positions.len(), &springs);
    let in_rows: u32 = slices.rows.iter().map(|row| row.lanes.count_ones()).sum();
    // A loose spring is one of a way that at most two particles of a slice share: at the ends of the sheet's rows and in
    // the last slice.
    assert!(springs.len() - in_rows as usize <= 41 * 6 * 2, "{in_rows} of {}", springs.len());
}
