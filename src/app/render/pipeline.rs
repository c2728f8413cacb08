//! Bind group layouts that the primitives share, and the making of their pipelines.

use super::{super::gpu::DEPTH_FORMAT, buffer::Buffer};

/// What a pipeline draws into.
#[derive(Clone, Copy)]
pub(super) struct Target {
    pub(super) format: wgpu::TextureFormat,
    pub(super) samples: u32,
}

/// The bind groups' layouts: 0 the view, 1 the cloth or the ground's shadow map, 2 what one primitive needs beside them.
pub(super) struct Layouts {
    pub(super) view: wgpu::BindGroupLayout,
    pub(super) cloth: wgpu::BindGroupLayout,
    pub(super) shadow_map: wgpu::BindGroupLayout,
    pub(super) lines: wgpu::BindGroupLayout,
    pub(super) marked: wgpu::BindGroupLayout,
    pub(super) blend: wgpu::BindGroupLayout,
    pub(super) normals: wgpu::BindGroupLayout,
}

const UNIFORM: wgpu::BufferBindingType = wgpu::BufferBindingType::Uniform;
const READ: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: true };
const WRITE: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: false };

impl Layouts {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let both = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let vertex = wgpu::ShaderStages::VERTEX;
        let compute = wgpu::ShaderStages::COMPUTE;
        let buffers = |label, entries: &[(wgpu::ShaderStages, wgpu::BufferBindingType)]| {
            let entries: Vec<_> = entries
                .iter()
                .enumerate()
                .map(|(binding, &(visibility, ty))| wgpu::BindGroupLayoutEntry {
                    binding: binding as u32,
                    visibility,
                    ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
                    count: None,
                })
                .collect();
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(label),
                entries: &entries,
            })
        };
        let fragment_entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty,
            count: None,
        };
        Self {
            view: buffers("view", &[(both, UNIFORM)]),
            cloth: buffers(
                "cloth",
                &[(both, UNIFORM), (vertex, READ), (vertex, READ), (vertex, READ), (vertex, READ)],
            ),
            shadow_map: device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some("shadow map"),
                entries: &[
                    fragment_entry(
                        0,
                        wgpu::BindingType::Texture {
                            sample_type: wgpu::TextureSampleType::Float { filterable: true },
                            view_dimension: wgpu::TextureViewDimension::D2,
                            multisampled: false,
                        },
                    ),
                    fragment_entry(1, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
                ],
            }),
            lines: buffers("lines", &[(vertex, UNIFORM), (vertex, READ), (vertex, READ)]),
            marked: buffers("marked particles", &[(vertex, READ)]),
            blend: buffers(
                "blend",
                &[(compute, READ), (compute, READ), (compute, UNIFORM), (compute, WRITE)],
            ),
            normals: buffers(
                "normals",
                &[(compute, READ), (compute, READ), (compute, READ), (compute, READ), (compute, WRITE)],
            ),
        }
    }
}

/// A shader of the folder `shaders` with what it shares in front of it.
macro_rules! shader {
    ($device:expr, $($stem:literal),+) => {
        $device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(concat!($($stem, " "),+)),
            source: wgpu::ShaderSource::Wgsl(
                concat!($(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $stem, ".wgsl"))),+).into(),
            ),
        })
    };
}
pub(super) use shader;

/// A bind group of whole buffers, in the order of their bindings.
pub(super) fn bind(
    device: &wgpu::Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    buffers: &[&Buffer],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..).zip(buffers).map(|(binding, buffer)| buffer.binding(binding)).collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
}

/// Work for each element of an array.
pub(super) struct Compute(wgpu::ComputePipeline);

impl Compute {
    pub(super) fn new(
        device: &wgpu::Device,
        label: &str,
        group: &wgpu::BindGroupLayout,
        module: &wgpu::ShaderModule,
    ) -> Self {
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: &[Some(group)],
            immediate_size: 0,
        });
        Self(device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout: Some(&layout),
            module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        }))
    }

    /// Runs the shader, of 64 elements a group, over so many elements.
    pub(super) fn run(&self, encoder: &mut wgpu::CommandEncoder, group: &wgpu::BindGroup, elements: u32) {
        /// Most groups along one dimension that every adapter allows.
        const MOST: u32 = 65_535;
        let groups = elements.div_ceil(64);
        let rows = groups.div_ceil(MOST);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.0);
        pass.set_bind_group(0, group, &[]);
        pass.dispatch_workgroups(groups.div_ceil(rows), rows, 1);
    }
}

/// What differs from one primitive to the next.
pub(super) struct Recipe<'a> {
    pub(super) label: &'a str,
    pub(super) module: &'a wgpu::ShaderModule,
    pub(super) vertex: &'a str,
    pub(super) fragment: &'a str,
    pub(super) groups: &'a [&'a wgpu::BindGroupLayout],
    /// Tests and writes depth: (write, compare).
    pub(super) depth: (bool, wgpu::CompareFunction),
    /// Pushes away from the eye, in depth steps: (constant, by slope).
    pub(super) bias: (i32, f32),
    /// Mixes with what is there by alpha.
    pub(super) blend: bool,
}

/// Triangles from shader-made vertices.
pub(super) fn build(device: &wgpu::Device, target: Target, recipe: &Recipe<'_>) -> wgpu::RenderPipeline {
    let groups: Vec<_> = recipe.groups.iter().map(|&group| Some(group)).collect();
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(recipe.label),
        bind_group_layouts: &groups,
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(recipe.label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: recipe.module,
            entry_point: Some(recipe.vertex),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(recipe.depth.0),
            depth_compare: Some(recipe.depth.1),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState { constant: recipe.bias.0, slope_scale: recipe.bias.1, clamp: 0.0 },
        }),
        multisample: wgpu::MultisampleState { count: target.samples, ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module: recipe.module,
            entry_point: Some(recipe.fragment),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(wgpu::ColorTargetState {
                format: target.format,
                blend: recipe.blend.then_some(wgpu::BlendState::ALPHA_BLENDING),
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}
