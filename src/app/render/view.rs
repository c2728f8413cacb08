//! One look into the world: camera, ground and backdrop as the shaders read them.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

use super::{Renderer, Style, Theme, buffer::Buffer, shadow, style::rgba};
use crate::app::camera::{Bounds, Camera, Projection};

/// What a view shows.
#[derive(Clone, Copy, Debug)]
pub struct Look<'a> {
    /// Where from.
    pub camera: &'a Camera,
    /// Width and height of the viewport, pixels.
    pub size: Vec2,
    /// Pixels per point: 1 on an ordinary screen, 2 on a dense one.
    pub pixels_per_point: f32,
    /// Height of the ground, m.
    pub ground_height: f32,
    /// Box around all cloths of the view; it throws the shadow.
    pub bounds: Option<Bounds>,
}

#[repr(C)]
#[derive(Clone, Copy, PartialEq, Pod, Zeroable)]
struct Uniform {
    clip_from_world: [[f32; 4]; 4],
    eye: [f32; 4],
    right: [f32; 4],
    up: [f32; 4],
    forward: [f32; 4],
    viewport: [f32; 4],
    sky_top: [f32; 4],
    sky_bottom: [f32; 4],
    grid: [f32; 4],
    ground: [f32; 4],
    target_point: [f32; 4],
    shadow: [f32; 4],
}

/// Where a shadow map lies, and the versions of the cloths that throw it.
pub(super) type Thrown = ([f32; 4], Vec<[Option<u64>; 2]>);

/// The device's side of a look: one for each tile of the window.
pub struct View {
    uniform: Buffer,
    pub(super) bind_group: wgpu::BindGroup,
    pub(super) shadow_map: wgpu::TextureView,
    pub(super) shadow_group: wgpu::BindGroup,
    shown: Option<Uniform>,
    /// Pixels that a metre covers where the cloths are nearest.
    pub(super) pixels_per_metre: f32,
    /// What the shadow map holds.
    pub(super) shadow_of: Option<Thrown>,
    uploaded: u64,
}

impl View {
    /// A view that shows nothing yet.
    pub fn new(device: &wgpu::Device, renderer: &Renderer) -> Self {
        let mut uniform = Buffer::new(device, "view", wgpu::BufferUsages::UNIFORM);
        uniform.resize(device, size_of::<Uniform>() as u64);
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("view"),
            layout: &renderer.layouts.view,
            entries: &[uniform.binding(0)],
        });
        let shadow_map = device
            .create_texture(&wgpu::TextureDescriptor {
                label: Some("shadow map"),
                size: wgpu::Extent3d { width: shadow::SIDE, height: shadow::SIDE, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: shadow::FORMAT,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            })
            .create_view(&wgpu::TextureViewDescriptor::default());
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("shadow map"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let shadow_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("shadow map"),
            layout: &renderer.layouts.shadow_map,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&shadow_map),
                },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&sampler) },
            ],
        });
        Self {
            uniform,
            bind_group,
            shadow_map,
            shadow_group,
            shown: None,
            pixels_per_metre: f32::INFINITY,
            shadow_of: None,
            uploaded: 0,
        }
    }

    /// Uploads the look if it is another one than last time.
    pub fn set(&mut self, queue: &wgpu::Queue, look: &Look<'_>, style: &Style) {
        let content = uniform(look, style);
        self.pixels_per_metre = pixels_per_metre(look);
        if self.shown != Some(content) {
            queue.write_buffer(&self.uniform.inner, 0, bytemuck::bytes_of(&content));
            self.uploaded += size_of::<Uniform>() as u64;
            self.shown = Some(content);
        }
    }

    /// Where the shadow map lies.
    pub(super) fn shadow(&self) -> [f32; 4] {
        self.shown.map_or([0.0; 4], |content| content.shadow)
    }

    /// Bytes uploaded since the last call.
    pub fn take_uploaded(&mut self) -> u64 {
        std::mem::take(&mut self.uploaded)
    }
}

fn pixels_per_metre(look: &Look<'_>) -> f32 {
    let camera = look.camera;
    let nearest = match (camera.projection, look.bounds) {
        (Projection::Orthographic, _) => camera.distance,
        (Projection::Perspective, None) => 0.0,
        (Projection::Perspective, Some(bounds)) => {
            (bounds.centre() - camera.eye()).dot(camera.axes()[2]) - bounds.radius()
        }
    };
    look.size.y / (2.0 * camera.half_height() * (nearest / camera.distance).max(1e-6))
}

fn uniform(look: &Look<'_>, style: &Style) -> Uniform {
    let camera = look.camera;
    let [right, up, forward] = camera.axes();
    let aspect = look.size.x / look.size.y;
    let perspective = camera.projection == Projection::Perspective;
    let half = if perspective { (camera.fov / 2.0).tan() } else { camera.half_height() };
    let (sky_top, sky_bottom, grid, dark) = match style.theme {
        Theme::Dark => ([32, 35, 41], [19, 20, 24], [150, 160, 178, 70], 0.55),
        Theme::Light => ([236, 239, 243], [206, 211, 218], [70, 80, 100, 90], 0.30),
    };
    let [r, g, b, a] = grid.map(|c: u8| f32::from(c) / 255.0);
    // Cells of a size that the eye can follow: a power of ten below the picture's height, halved or not.
    let visible = 2.0 * camera.half_height();
    let cell = 10_f32.powf((visible / 8.0).log10().floor());
    let bounds = look.bounds.unwrap_or(Bounds { min: Vec3::ZERO, max: Vec3::ZERO });
    let middle = bounds.centre();
    let reach = ((bounds.max - bounds.min) / 2.0).with_y(0.0).max_element() * 1.35 + 1e-3;
    // The higher the cloth hangs, the fainter its shadow.
    let lift = ((bounds.min.y - look.ground_height) / (2.0 * reach)).max(0.0);
    let below = if bounds.max.y > look.ground_height { 1.0 } else { 0.0 };
    let strength = if style.shadow && look.bounds.is_some() { below * dark / (1.0 + lift) } else { 0.0 };
    Uniform {
        clip_from_world: camera.clip_from_world(aspect).to_cols_array_2d(),
        eye: camera.eye().extend(f32::from(u8::from(perspective))).to_array(),
        right: (right * half * aspect).extend(0.0).to_array(),
        up: (up * half).extend(0.0).to_array(),
        forward: forward.extend(look.pixels_per_point).to_array(),
        viewport: [look.size.x, look.size.y, 1.0 / look.size.x, 1.0 / look.size.y],
        sky_top: rgba(sky_top),
        sky_bottom: rgba(sky_bottom),
        grid: [r, g, b, a],
        ground: [look.ground_height, cell, 2.5 * visible, f32::from(u8::from(style.axes))],
        target_point: camera.target.extend(strength).to_array(),
        shadow: [middle.x, middle.z, reach, lift],
    }
}
