//! The graphics device, with or without a window, and an offscreen target that can be read back.

use std::sync::{Arc, Mutex, PoisonError};

use winit::{event_loop::OwnedDisplayHandle, window::Window};

/// Why nothing can be drawn; each message is one line that says what would help.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// No driver offers an adapter.
    #[error(
        "no graphics adapter found: install a Vulkan or OpenGL driver (Debian, Ubuntu: apt install mesa-vulkan-drivers)"
    )]
    NoAdapter,
    /// The adapter exists, but gives no device.
    #[error("the graphics adapter {adapter} gives no device: {reason}")]
    NoDevice {
        /// Name of the adapter.
        adapter: String,
        /// The driver's reason, in one line.
        reason: String,
    },
    /// The window system and the driver do not fit together.
    #[error(
        "no graphics driver can draw into a window here: install one (Debian, Ubuntu: apt install mesa-vulkan-drivers libegl1 libgl1-mesa-dri)"
    )]
    NoSurface,
    /// The picture is larger than the adapter allows, or empty.
    #[error(
        "a picture of {width} x {height} pixels cannot be drawn: 1 to {limit} pixels a side are possible"
    )]
    Size {
        /// Width asked for, pixels.
        width: u32,
        /// Height asked for, pixels.
        height: u32,
        /// Longest side that the adapter draws, pixels.
        limit: u32,
    },
    /// The device was lost or ran out of memory while drawing.
    #[error("the graphics device failed while drawing: {0}")]
    Failed(String),
}

/// The device, its queue, and what is known about it.
pub struct Gpu {
    /// Makes surfaces for windows.
    pub instance: wgpu::Instance,
    /// The physical adapter or its software stand-in.
    pub adapter: wgpu::Adapter,
    /// Creates buffers, textures and pipelines.
    pub device: wgpu::Device,
    /// Takes uploads and commands.
    pub queue: wgpu::Queue,
    /// True if the adapter is a program on the CPU: then every pixel counts.
    pub software: bool,
    /// The first failure that the driver reported outside of any call.
    failure: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// A device for pictures without a window.
    ///
    /// # Errors
    /// [`GpuError`] if no driver is installed or it gives no device.
    pub fn offscreen() -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        Self::with_instance(instance, None)
    }

    /// A device that can draw into `window`, and the surface it draws to.
    ///
    /// # Errors
    /// [`GpuError`] if no driver fits the window system.
    pub fn for_window(
        window: &Arc<Window>,
        display: OwnedDisplayHandle,
    ) -> Result<(Self, wgpu::Surface<'static>), GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_with_display_handle_from_env(
            Box::new(display),
        ));
        let surface = instance.create_surface(Arc::clone(window)).map_err(|_| GpuError::NoSurface)?;
        let gpu = Self::with_instance(instance, Some(&surface))?;
        Ok((gpu, surface))
    }

    fn with_instance(
        instance: wgpu::Instance,
        surface: Option<&wgpu::Surface<'_>>,
    ) -> Result<Self, GpuError> {
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: surface,
            ..Default::default()
        }))
        .map_err(|_| GpuError::NoAdapter)?;
        let info = adapter.get_info();
        // A million particles need larger storage bindings than the defaults promise; what the adapter has is asked for.
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("tenter"),
            required_limits: adapter.limits(),
            ..Default::default()
        }))
        .map_err(|error| GpuError::NoDevice { adapter: info.name.clone(), reason: first_line(&error) })?;
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let failure = Arc::default();
        watch(&device, &failure);
        Ok(Self { instance, adapter, device, queue, software, failure })
    }

    /// Whether the device still works.
    ///
    /// # Errors
    /// [`GpuError::Failed`] with the driver's reason, once it has run out of memory or was lost.
    pub fn check(&self) -> Result<(), GpuError> {
        // What the driver has to tell it tells when asked.
        let _ = self.device.poll(wgpu::PollType::Poll);
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.as_ref().map_or(Ok(()), |reason| Err(GpuError::Failed(reason.clone())))
    }

    /// Whether a picture of this size can be drawn.
    ///
    /// # Errors
    /// [`GpuError::Size`] if a side is 0 or longer than the adapter allows.
    pub fn check_size(&self, size: [u32; 2]) -> Result<(), GpuError> {
        let [width, height] = size;
        let limit = self.device.limits().max_texture_dimension_2d;
        if size.iter().any(|&side| side == 0 || side > limit) {
            return Err(GpuError::Size { width, height, limit });
        }
        Ok(())
    }

    /// Samples per pixel by default: 4 on hardware, 1 where the CPU would pay for each of them.
    pub fn default_samples(&self) -> u32 {
        if self.software { 1 } else { 4 }
    }

    /// Name and driver, for the status bar and for reports.
    pub fn description(&self) -> String {
        let info = self.adapter.get_info();
        format!("{} ({})", info.name, info.backend)
    }
}

/// Keeps Mesa from asking for a Wayland display where there cannot be one: libwayland would complain about it on standard
/// error, in lines that are not ours. Called once, before the process has a second thread.
pub fn quiet_drivers() {
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: no other thread reads the environment yet.
        #[allow(unsafe_code)]
        unsafe {
            std::env::set_var("NODEVICE_SELECT", "1");
        }
    }
}

fn first_line(error: &impl std::fmt::Display) -> String {
    error.to_string().lines().next().unwrap_or_default().to_owned()
}

/// Keeps the first failure instead of the default, which is to panic.
fn watch(device: &wgpu::Device, failure: &Arc<Mutex<Option<String>>>) {
    let keep = |failure: &Mutex<Option<String>>, reason: String| {
        failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(reason);
    };
    let first = Arc::clone(failure);
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        keep(&first, error.to_string().replace('\n', " "));
    }));
    let first = Arc::clone(failure);
    device.set_device_lost_callback(move |_, message| keep(&first, message.replace('\n', " ")));
}

/// Depth of every target: reversed floating point, so that near and far are equally exact.
pub const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Colour of offscreen pictures; shaders write display values, as egui wants of a window's surface.
pub const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Depth and, with several samples, colour textures of one size: what a pass draws into beside its target.
pub struct Attachments {
    samples: u32,
    size: [u32; 2],
    colour: Option<wgpu::TextureView>,
    depth: wgpu::TextureView,
}

impl Attachments {
    /// Textures for targets of `size` pixels.
    pub fn new(device: &wgpu::Device, format: wgpu::TextureFormat, size: [u32; 2], samples: u32) -> Self {
        let view = |format, label| {
            device
                .create_texture(&wgpu::TextureDescriptor {
                    label: Some(label),
                    size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                    mip_level_count: 1,
                    sample_count: samples,
                    dimension: wgpu::TextureDimension::D2,
                    format,
                    usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                    view_formats: &[],
                })
                .create_view(&wgpu::TextureViewDescriptor::default())
        };
        Self {
            samples,
            size,
            colour: (samples > 1).then(|| view(format, "colour, multisampled")),
            depth: view(DEPTH_FORMAT, "depth"),
        }
    }

    /// Width and height, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Samples per pixel.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Begins the pass that clears `target` and draws into it.
    pub fn begin<'e>(
        &self,
        encoder: &'e mut wgpu::CommandEncoder,
        target: &wgpu::TextureView,
        clear: wgpu::Color,
    ) -> wgpu::RenderPass<'e> {
        let (view, resolve_target) =
            self.colour.as_ref().map_or((target, None), |colour| (colour, Some(target)));
        // What is resolved need not be kept: that saves a tile-based GPU the trip to memory.
        let store = if resolve_target.is_some() { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store };
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("viewport"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(clear), store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        })
    }
}

/// A picture in the device's memory that can be read back.
pub struct Picture {
    texture: wgpu::Texture,
    size: [u32; 2],
}

impl Picture {
    /// An empty picture.
    ///
    /// # Errors
    /// [`GpuError::Size`] if a side is 0 or longer than the adapter allows.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, GpuError> {
        gpu.check_size(size)?;
        let [width, height] = size;
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: PICTURE_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        Ok(Self { texture, size })
    }

    /// What a pass draws into.
    pub fn view(&self) -> wgpu::TextureView {
        self.texture.create_view(&wgpu::TextureViewDescriptor::default())
    }

    /// Waits for the device and reads the picture: rows from the top, 4 bytes (red, green, blue, alpha) a pixel.
    ///
    /// # Errors
    /// [`GpuError::Failed`] if the device was lost.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<u8>, GpuError> {
        let [width, height] = self.size;
        let row = width * 4;
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture, read back"),
            size: u64::from(padded) * u64::from(height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            self.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
        gpu.queue.submit([encoder.finish()]);
        let (sender, receiver) = std::sync::mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |result| {
            // The receiver lives until the wait below ends.
            let _ = sender.send(result);
        });
        let lost = |error: &dyn std::fmt::Display| GpuError::Failed(error.to_string());
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| lost(&e))?;
        receiver.recv().map_err(|e| lost(&e))?.map_err(|e| lost(&e))?;
        let bytes = buffer.get_mapped_range(..).map_err(|e| lost(&e))?;
        Ok(bytes.chunks_exact(padded as usize).flat_map(|r| &r[..row as usize]).copied().collect())
    }
}
