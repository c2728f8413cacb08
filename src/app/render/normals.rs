//! Smooth normals, computed on the device from the positions that are there anyway: nothing more is uploaded.

use super::{
    Cloth,
    pipeline::{Compute, Layouts, shader},
};

pub(super) struct Normals(Compute);

impl Normals {
    pub(super) fn new(device: &wgpu::Device, layouts: &Layouts) -> Self {
        Self(Compute::new(device, "normals", &layouts.normals, &shader!(device, "normals")))
    }

    pub(super) fn compute(&self, encoder: &mut wgpu::CommandEncoder, cloth: &mut Cloth) {
        let version = Some(cloth.motion.version());
        if cloth.normals_of != version && cloth.triangle_count > 0 {
            cloth.normals_of = version;
            self.0.run(encoder, &cloth.normals_group, cloth.particle_count);
        }
    }
}

/// For each particle the triangles around it, as one list and where each particle's part of it starts.
pub(super) fn triangles_around(particles: u32, triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0_u32; particles as usize + 1];
    for &corner in triangles.iter().flatten() {
        starts[corner as usize + 1] += 1;
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    let mut next = starts.clone();
    let mut around = vec![0; triangles.len() * 3];
    for (t, triangle) in triangles.iter().enumerate() {
        for &corner in triangle {
            let place = &mut next[corner as usize];
            around[*place as usize] = t as u32;
            *place += 1;
        }
    }
    (starts, around)
}

#[cfg(test)]
mod tests {
    use super::triangles_around;

    #[test]
    fn every_corner_finds_its_triangles() {
        let (starts, around) = triangles_around(5, &[[0, 1, 2], [2, 1, 3]]);
        assert_eq!(starts, [0, 1, 3, 5, 6, 6]);
        assert_eq!(around, [0, 0, 1, 0, 1, 1]);
    }
}
