//! Particles: all free ones in one draw call, thinned when there are many, and the marked ones in another.

use super::{
    Cloth, Style,
    pipeline::{Layouts, Recipe, Target, build, shader},
};

pub(super) struct Spheres {
    free: wgpu::RenderPipeline,
    marked: wgpu::RenderPipeline,
}

impl Spheres {
    pub(super) fn new(device: &wgpu::Device, layouts: &Layouts, target: Target) -> Self {
        let module = shader!(device, "common", "cloth", "spheres");
        let pipeline = |vertex| {
            let recipe = Recipe {
                label: vertex,
                module: &module,
                vertex,
                fragment: "fragment",
                groups: &[&layouts.view, &layouts.cloth, &layouts.marked],
                depth: (true, wgpu::CompareFunction::Greater),
                bias: (0, 0.0),
                blend: true,
            };
            build(device, target, &recipe)
        };
        Self { free: pipeline("free_vertex"), marked: pipeline("marked_vertex") }
    }

    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, cloth: &Cloth, style: &Style) {
        pass.set_bind_group(2, &cloth.marked_group, &[]);
        let free = cloth.particle_count / cloth.particle_stride(style);
        if style.particles && free > 0 {
            pass.set_pipeline(&self.free);
            pass.draw(0..6 * free, 0..1);
        }
        if cloth.marked_count > 0 {
            pass.set_pipeline(&self.marked);
            pass.draw(0..6 * cloth.marked_count, 0..1);
        }
    }
}
