//! The window's surface: configured to its size, and brought back when the system takes it away.

use std::sync::Arc;

use winit::window::Window;

use super::gpu::{Attachments, Gpu, GpuError};

/// The surface of one window, and the textures drawn beside it.
pub struct Swapchain {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    attachments: Attachments,
}

impl Swapchain {
    /// Configures the surface to the window's size.
    ///
    /// # Errors
    /// [`GpuError::NoSurface`] if the adapter cannot present to it.
    pub fn new(
        gpu: &Gpu,
        window: Arc<Window>,
        surface: wgpu::Surface<'static>,
        samples: u32,
    ) -> Result<Self, GpuError> {
        let [width, height] = size_of_window(gpu, &window);
        let mut config =
            surface.get_default_config(&gpu.adapter, width, height).ok_or(GpuError::NoSurface)?;
        let formats = surface.get_capabilities(&gpu.adapter).formats;
        config.format = egui_wgpu::preferred_framebuffer_format(&formats).map_err(|_| GpuError::NoSurface)?;
        config.present_mode = wgpu::PresentMode::AutoVsync;
        // One frame in the queue: the cloth hangs on the cursor.
        config.desired_maximum_frame_latency = 1;
        surface.configure(&gpu.device, &config);
        let attachments = Attachments::new(&gpu.device, config.format, [width, height], samples);
        Ok(Self { window, surface, config, attachments })
    }

    /// Format of the frames.
    pub fn format(&self) -> wgpu::TextureFormat {
        self.config.format
    }

    /// Depth and multisampled colour in the window's size.
    pub fn attachments(&self) -> &Attachments {
        &self.attachments
    }

    /// Follows the window's size.
    pub fn resize(&mut self, gpu: &Gpu) {
        let size = size_of_window(gpu, &self.window);
        if size == [self.config.width, self.config.height] {
            return;
        }
        [self.config.width, self.config.height] = size;
        self.surface.configure(&gpu.device, &self.config);
        self.attachments =
            Attachments::new(&gpu.device, self.config.format, size, self.attachments.samples());
    }

    /// The next frame; `None` if there is none this time (hidden window, lost surface): the next redraw tries again.
    pub fn frame(&mut self, gpu: &Gpu) -> Option<wgpu::SurfaceTexture> {
        use wgpu::CurrentSurfaceTexture as Current;
        for _ in 0..2 {
            match self.surface.get_current_texture() {
                Current::Success(frame) => return Some(frame),
                Current::Suboptimal(frame) => {
                    // What it is suboptimal for is mostly a size that the window no longer has.
                    drop(frame);
                    self.surface.configure(&gpu.device, &self.config);
                }
                Current::Outdated => {
                    self.resize(gpu);
                    self.surface.configure(&gpu.device, &self.config);
                }
                Current::Lost => {
                    self.surface = gpu.instance.create_surface(Arc::clone(&self.window)).ok()?;
                    self.surface.configure(&gpu.device, &self.config);
                }
                Current::Timeout | Current::Occluded | Current::Validation => return None,
            }
        }
        // Suboptimal twice: the system finds nothing better, so it is shown as it is.
        match self.surface.get_current_texture() {
            Current::Success(frame) | Current::Suboptimal(frame) => Some(frame),
            _ => None,
        }
    }
}

fn size_of_window(gpu: &Gpu, window: &Window) -> [u32; 2] {
    let limit = gpu.device.limits().max_texture_dimension_2d;
    let size = window.inner_size();
    [size.width, size.height].map(|side| side.clamp(1, limit))
}
