//! Smooth normals, computed on the device from the positions that are there anyway: nothing more is uploaded.

use super::{
    Cloth,
    pipeline::{Layouts, shader},
};

const GROUP: u32 = 64;
/// Most workgroups along one dimension that every adapter allows.
const MOST_GROUPS: u32 = 65_535;

pub(super) struct Normals {
    pipeline: wgpu::ComputePipeline,
}

impl Normals {
    pub(super) fn new(device: &wgpu::Device, layouts: &Layouts) -> Self {
        let module = shader!(device, "normals");
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("normals"),
            bind_group_layouts: &[Some(&layouts.normals)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("normals"),
            layout: Some(&layout),
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        Self { pipeline }
    }

    pub(super) fn compute(&self, encoder: &mut wgpu::CommandEncoder, cloth: &mut Cloth) {
        if !std::mem::take(&mut cloth.normals_are_old) || cloth.triangle_count == 0 {
            return;
        }
        let groups = cloth.particle_count.div_ceil(GROUP);
        let rows = groups.div_ceil(MOST_GROUPS);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &cloth.normals_group, &[]);
        pass.dispatch_workgroups(groups.div_ceil(rows), rows, 1);
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
