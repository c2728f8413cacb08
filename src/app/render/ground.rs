//! The backdrop, and the ground with its grid, axes and the cloth's shadow: each one triangle over the whole viewport.

use super::{
    View,
    pipeline::{Layouts, Recipe, Target, build, shader},
};

pub(super) struct Ground {
    backdrop: wgpu::RenderPipeline,
    ground: wgpu::RenderPipeline,
}

impl Ground {
    pub(super) fn new(device: &wgpu::Device, layouts: &Layouts, target: Target) -> Self {
        let module = shader!(device, "common", "ground");
        let pipeline = |fragment, compare, blend| {
            let recipe = Recipe {
                label: fragment,
                module: &module,
                vertex: "vertex",
                fragment,
                groups: &[&layouts.view, &layouts.shadow_map],
                depth: (false, compare),
                bias: (0, 0.0),
                blend,
            };
            build(device, target, &recipe)
        };
        Self {
            backdrop: pipeline("backdrop", wgpu::CompareFunction::Always, false),
            ground: pipeline("ground", wgpu::CompareFunction::Greater, true),
        }
    }

    pub(super) fn draw_backdrop(&self, pass: &mut wgpu::RenderPass<'_>, view: &View) {
        pass.set_pipeline(&self.backdrop);
        pass.set_bind_group(1, &view.shadow_group, &[]);
        pass.draw(0..3, 0..1);
    }

    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, view: &View) {
        pass.set_pipeline(&self.ground);
        pass.set_bind_group(1, &view.shadow_group, &[]);
        pass.draw(0..3, 0..1);
    }
}
