//! The soft shadow on the ground: the cloth from above, drawn into a small map that the ground blurs.

use super::{
    Cloth, View,
    pipeline::{Layouts, shader},
};

/// Side of the map, pixels; it is blurred over a tenth of it.
pub(super) const SIDE: u32 = 256;
pub(super) const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R8Unorm;

pub(super) struct Shadow {
    pipeline: wgpu::RenderPipeline,
}

impl Shadow {
    pub(super) fn new(device: &wgpu::Device, layouts: &Layouts) -> Self {
        let module = shader!(device, "common", "cloth", "shadow");
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("shadow"),
            bind_group_layouts: &[Some(&layouts.view), Some(&layouts.cloth)],
            immediate_size: 0,
        });
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("shadow"),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(FORMAT.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self { pipeline }
    }

    pub(super) fn draw<'c>(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        view: &View,
        cloths: impl Iterator<Item = &'c Cloth>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shadow"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view.shadow_map,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &view.bind_group, &[]);
        for cloth in cloths.filter(|cloth| cloth.triangle_count > 0) {
            pass.set_bind_group(1, &cloth.bind_group, &[]);
            pass.set_index_buffer(cloth.triangles.inner.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..3 * cloth.triangle_count, 0, 0..1);
        }
    }
}
