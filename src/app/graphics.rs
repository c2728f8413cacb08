//! What draws a window: device, surface and the painter of the panels, made anew where the device is lost.

use std::{collections::HashMap, sync::Arc};

use egui::{ClippedPrimitive, ColorImage, Context, ImageData, TextureId, TexturesDelta, epaint::ImageDelta};
use winit::{event_loop::OwnedDisplayHandle, window::Window};

use super::{
    gpu::{Gpu, GpuError},
    shell::{Canvas, Content, Stage},
    swapchain::Swapchain,
};

/// How often the device may be lost without a picture in between. What takes more memory than there is fails every time.
const MOST_LOSSES: u32 = 3;

/// What draws the window. Without a device in between, while a lost one is replaced.
pub struct Graphics {
    window: Arc<Window>,
    display: OwnedDisplayHandle,
    samples: Option<u32>,
    textures: Textures,
    device: Option<Device>,
    losses: u32,
}

/// Fields are dropped in this order: what lies on the device before the device.
struct Device {
    painter: egui_wgpu::Renderer,
    swapchain: Swapchain,
    gpu: Gpu,
}

impl Device {
    fn new(
        window: &Arc<Window>,
        display: OwnedDisplayHandle,
        samples: Option<u32>,
    ) -> Result<Self, GpuError> {
        let (gpu, surface) = Gpu::for_window(window, display)?;
        let samples = samples.unwrap_or_else(|| gpu.default_samples());
        let swapchain = Swapchain::new(&gpu, Arc::clone(window), surface, samples)?;
        let options = egui_wgpu::RendererOptions::default();
        let painter = egui_wgpu::Renderer::new(&gpu.device, swapchain.format(), options);
        Ok(Self { painter, swapchain, gpu })
    }
}

impl Graphics {
    /// Graphics for a window; without a number of samples per pixel the adapter decides.
    ///
    /// # Errors
    /// [`GpuError`] if nothing can draw into it.
    pub fn new(
        window: Arc<Window>,
        display: OwnedDisplayHandle,
        samples: Option<u32>,
    ) -> Result<Self, GpuError> {
        let device = Some(Device::new(&window, display.clone(), samples)?);
        Ok(Self { window, display, samples, textures: Textures::default(), device, losses: 0 })
    }

    /// What contents are made with.
    ///
    /// # Errors
    /// [`GpuError::Failed`] while there is no device.
    pub fn stage<'a>(&'a self, egui: &'a Context) -> Result<Stage<'a>, GpuError> {
        let Device { swapchain, gpu, .. } =
            self.device.as_ref().ok_or_else(|| GpuError::Failed("there is none".to_owned()))?;
        Ok(Stage { gpu, format: swapchain.format(), samples: swapchain.attachments().samples(), egui })
    }

    /// Whether the adapter is a program on the CPU.
    pub fn is_software(&self) -> bool {
        self.device.as_ref().is_some_and(|device| device.gpu.software)
    }

    /// Longest side of a texture, pixels.
    pub fn texture_limit(&self) -> Option<usize> {
        self.device.as_ref().map(|device| device.gpu.device.limits().max_texture_dimension_2d as usize)
    }

    /// Follows the window's size.
    pub fn resize(&mut self) {
        if let Some(Device { swapchain, gpu, .. }) = &mut self.device {
            swapchain.resize(gpu);
        }
    }

    /// Takes over the panels' new textures. What is freed may still be shown in the next picture: that is done behind it.
    pub fn set_textures(&mut self, delta: &mut TexturesDelta) {
        for (id, deltas) in delta.set.drain() {
            for delta in deltas {
                if let Some(Device { painter, gpu, .. }) = &mut self.device {
                    painter.update_texture(&gpu.device, &gpu.queue, id, &delta);
                }
                self.textures.set(id, delta);
            }
        }
    }

    /// Frees textures that the panels show no more.
    pub fn free_textures(&mut self, delta: &mut TexturesDelta) {
        for id in delta.free.drain() {
            self.textures.0.remove(&id);
            if let Some(device) = &mut self.device {
                device.painter.free_texture(&id);
            }
        }
    }

    /// Draws a content with its panels; false if there is nothing to draw into now, or the device was lost.
    pub fn paint(
        &mut self,
        content: &mut impl Content,
        shapes: &[ClippedPrimitive],
        pixels_per_point: f32,
    ) -> bool {
        let Some(Device { painter, swapchain, gpu }) = &mut self.device else { return false };
        let Some(frame) = swapchain.frame(gpu) else { return false };
        let target = frame.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let attachments = swapchain.attachments();
        content.draw(&mut Canvas {
            gpu,
            encoder: &mut encoder,
            target: &target,
            attachments,
            pixels_per_point,
        });
        // The painter maps buffers, and takes it for granted that it can.
        if gpu.check().is_err() {
            return false;
        }
        let screen = egui_wgpu::ScreenDescriptor { size_in_pixels: attachments.size(), pixels_per_point };
        let before = painter.update_buffers(&gpu.device, &gpu.queue, &mut encoder, shapes, &screen);
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("panels"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
            })],
            ..Default::default()
        });
        painter.render(&mut pass.forget_lifetime(), shapes, &screen);
        gpu.queue.submit(before.into_iter().chain([encoder.finish()]));
        self.window.pre_present_notify();
        gpu.queue.present(frame);
        if gpu.check().is_ok() {
            self.losses = 0;
        }
        true
    }

    /// Replaces the device if it was lost or has failed; true if there is another one now, on which nothing lies yet but the
    /// panels' textures.
    ///
    /// # Errors
    /// [`GpuError`] if there is none to be had, or the new ones fail like the old.
    pub fn recover(&mut self) -> Result<bool, GpuError> {
        let Some(device) = &self.device else { return Err(GpuError::NoAdapter) };
        let Err(failure) = device.gpu.check() else { return Ok(false) };
        self.losses += 1;
        if self.losses > MOST_LOSSES {
            return Err(failure);
        }
        // A window has one surface at a time.
        self.device = None;
        let mut device = Device::new(&self.window, self.display.clone(), self.samples)?;
        for (id, image) in &self.textures.0 {
            device.painter.update_texture(&device.gpu.device, &device.gpu.queue, *id, image);
        }
        self.device = Some(device);
        Ok(true)
    }
}

/// The panels' textures as they are on the device: egui only tells what changes.
#[derive(Default)]
struct Textures(HashMap<TextureId, ImageDelta>);

impl Textures {
    fn set(&mut self, id: TextureId, delta: ImageDelta) {
        let Some([left, top]) = delta.pos else {
            self.0.insert(id, delta);
            return;
        };
        let Some(whole) = self.0.get_mut(&id) else { return };
        let (ImageData::Color(whole), ImageData::Color(part)) = (&mut whole.image, &delta.image);
        let whole: &mut ColorImage = Arc::make_mut(whole);
        let ([width, _], [columns, _]) = (whole.size, part.size);
        for (row, pixels) in part.pixels.chunks_exact(columns.max(1)).enumerate() {
            let start = (top + row) * width + left;
            if let Some(into) = whole.pixels.get_mut(start..start + columns) {
                into.copy_from_slice(pixels);
            }
        }
    }
}
