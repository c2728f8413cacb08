//! The lit surface: one indexed draw call a cloth.

use super::{
    Cloth,
    pipeline::{Layouts, Recipe, Target, build, shader},
};

pub(super) struct Surface {
    pipeline: wgpu::RenderPipeline,
}

impl Surface {
    pub(super) fn new(device: &wgpu::Device, layouts: &Layouts, target: Target) -> Self {
        let module = shader!(device, "common", "cloth", "surface");
        let recipe = Recipe {
            label: "surface",
            module: &module,
            vertex: "vertex",
            fragment: "fragment",
            groups: &[&layouts.view, &layouts.cloth],
            depth: (true, wgpu::CompareFunction::Greater),
            // Reversed depth: negative is away from the eye; lines in the surface stay in front of it.
            bias: (-4, -1.5),
            blend: false,
        };
        Self { pipeline: build(device, target, &recipe) }
    }

    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, cloth: &Cloth) {
        if cloth.triangle_count > 0 {
            pass.set_pipeline(&self.pipeline);
            pass.set_index_buffer(cloth.triangles.inner.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..3 * cloth.triangle_count, 0, 0..1);
        }
    }
}
