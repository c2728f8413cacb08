//! Pictures of a motion, all from one point of view: a folder of PNG files, or one animated GIF.

use std::{cell::RefCell, io::Write, path::Path, rc::Rc};

use glam::{Vec2, Vec3};
use image::{
    Delay, RgbaImage,
    codecs::gif::{GifEncoder, Repeat},
};

use super::{
    camera::{Bounds, Camera},
    geometry::Geometry,
    gpu::{Attachments, Gpu, PICTURE_FORMAT, Picture},
    picture::{Pixels, telling_yaw},
    render::{Cloth, Frame as Drawn, Look, Renderer, Style, View, flag},
};
use crate::{
    export::{Format, Frame, PendingFolder, Sink, Span},
    scene::{Pending, Refusal},
    world::World,
};

/// Samples a pixel: smooth edges are worth their price on any adapter.
const SAMPLES: u32 = 4;
/// Viewers play a shorter delay, s, at a speed of their own.
const SHORTEST_GIF_DELAY: f64 = 0.02;

/// The box that a motion stays in, m.
#[derive(Clone, Debug, Default)]
struct Outline {
    bounds: Option<Bounds>,
}

impl Sink for Outline {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), Refusal> {
        let mut points: Vec<[f32; 3]> = frame.positions.iter().map(|p| p.as_vec3().to_array()).collect();
        points.extend(self.bounds.iter().flat_map(|b| [b.min.to_array(), b.max.to_array()]));
        self.bounds = Bounds::of(&points);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), Refusal> {
        Ok(())
    }
}

/// A motion to be drawn.
pub struct Film {
    gpu: Gpu,
    size: [u32; 2],
    style: Style,
    renderer: Renderer,
    view: View,
    cloth: [Cloth; 1],
    picture: Picture,
    attachments: Attachments,
    flags: Vec<u32>,
    /// How many springs were torn when the geometry was taken.
    torn: Option<usize>,
    version: u64,
    reel: Reel,
}

/// Where the pictures go.
enum Reel {
    Folder(PendingFolder),
    Gif { file: Pending, encoder: Box<GifEncoder<Bytes>>, bytes: Bytes, fps: f64 },
}

/// What an encoder has written, so that no error of the file is lost in its drop.
#[derive(Clone, Default)]
struct Bytes(Rc<RefCell<Vec<u8>>>);

impl Write for Bytes {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Bytes {
    fn hand_on(&self, file: &Pending) -> Result<(), Refusal> {
        file.file().write_all(&self.0.take()).map_err(|e| file.failed(e))
    }
}

impl Film {
    /// Pictures of a motion, of a size in pixels. The world runs once before, from where it stands, so that they are taken
    /// from where all of it is seen; `run` does that, and the world then stands where it was.
    ///
    /// # Errors
    /// A place that cannot be written, no adapter, a size that is impossible, a rate that the format cannot hold; those
    /// before the run. What `run` refuses.
    pub fn of(
        world: &mut World,
        format: Format,
        path: &Path,
        size: [u32; 2],
        span: Span,
        run: impl FnOnce(&mut World, &mut dyn Sink) -> Result<u64, Refusal>,
    ) -> Result<Self, Refusal> {
        let film = Self::new(format, path, size, span)?;
        let start = world.snapshot();
        let mut outline = Outline::default();
        run(world, &mut outline)?;
        let film = film.framed(world, &outline);
        world.restore(&start);
        Ok(film)
    }

    fn new(format: Format, path: &Path, size: [u32; 2], span: Span) -> Result<Self, Refusal> {
        let refused = |e: &dyn std::fmt::Display| Refusal::new(format!("{}: {e}", path.display()));
        let reel = if format == Format::Gif {
            let fastest = 1.0 / SHORTEST_GIF_DELAY;
            if span.fps > fastest {
                let fps = span.fps;
                return Err(refused(&format!("a GIF of {fps} frames a second; accepted: up to {fastest}")));
            }
            if size.iter().any(|side| *side > u32::from(u16::MAX)) {
                return Err(refused(&format!(
                    "a GIF of {} x {} pixels; accepted: up to 65535",
                    size[0], size[1]
                )));
            }
            let bytes = Bytes::default();
            let mut encoder = Box::new(GifEncoder::new_with_speed(bytes.clone(), 10));
            encoder.set_repeat(Repeat::Infinite).map_err(|e| refused(&e))?;
            Reel::Gif { file: Pending::new(path)?, encoder, bytes, fps: span.fps }
        } else {
            Reel::Folder(PendingFolder::new(path, "png", span)?)
        };
        let gpu = Gpu::offscreen().map_err(|e| Refusal::new(e.to_string()))?;
        gpu.check_size(size).map_err(|e| Refusal::new(e.to_string()))?;
        let picture = Picture::new(&gpu, size).map_err(|e| refused(&e))?;
        let (device, queue) = (&gpu.device, &gpu.queue);
        let renderer = Renderer::new(device, PICTURE_FORMAT, SAMPLES);
        let view = View::new(device, &renderer);
        let cloth = [Cloth::new(device, queue, &renderer)];
        let attachments = Attachments::new(device, PICTURE_FORMAT, size, SAMPLES);
        let (style, flags) = (Style::default(), Vec::new());
        Ok(Self {
            gpu,
            size,
            style,
            renderer,
            view,
            cloth,
            picture,
            attachments,
            flags,
            torn: None,
            version: 0,
            reel,
        })
    }

    /// Looks so that a whole motion is seen, from the side that shows most of the cloth as `world` has it.
    fn framed(mut self, world: &World, outline: &Outline) -> Self {
        let size = Vec2::new(self.size[0] as f32, self.size[1] as f32);
        let mut camera = Camera::default();
        let mut ground_height = 0.0;
        if let Some(bounds) = &outline.bounds {
            let mut positions = Vec::new();
            world.positions_f32(&mut positions);
            camera.yaw = telling_yaw(camera, &positions, &Geometry::of(world, 1).triangles);
            camera.focus(bounds, size);
            ground_height = bounds.min.y - 0.1 * bounds.radius();
        }
        let bounds = outline.bounds;
        let look = Look { camera: &camera, size, pixels_per_point: 1.0, ground_height, bounds };
        self.view.set(&self.gpu.queue, &look, &self.style);
        self
    }

    fn draw(&mut self, frame: &Frame<'_>) -> Result<Pixels, super::gpu::GpuError> {
        let Self { gpu, renderer, style, view, .. } = self;
        let Gpu { device, queue, .. } = &*gpu;
        self.version += 1;
        let world = frame.world;
        if self.torn != Some(world.broken().len()) {
            self.torn = Some(world.broken().len());
            let geometry = Geometry::of(world, self.version);
            self.cloth[0].set_topology(device, queue, renderer, &geometry.topology());
            let pinned = world.pinned().iter();
            self.flags = pinned.map(|pinned| u32::from(*pinned) * flag::PINNED).collect();
        }
        let positions: Vec<[f32; 3]> = frame.positions.iter().map(|p| Vec3::to_array(&p.as_vec3())).collect();
        let kinds = world.scene().springs.kinds();
        let drawn = Drawn {
            version: self.version,
            positions: &positions,
            earlier: None,
            flags: &self.flags,
            values_version: 0,
            values: None,
            enabled: kinds.each_ref().map(|kind| kind.enabled),
            rest_scale: kinds.each_ref().map(|kind| kind.rest_scale as f32),
            tint: None,
        };
        self.cloth[0].set_frame(device, queue, renderer, &drawn, style);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        renderer.prepare(&gpu.device, &mut encoder, view, &mut self.cloth, style);
        let mut pass = self.attachments.begin(&mut encoder, &self.picture.view(), wgpu::Color::BLACK);
        renderer.draw(&mut pass, view, &self.cloth, style);
        drop(pass);
        queue.submit([encoder.finish()]);
        let rgba = self.picture.read(gpu)?;
        gpu.check()?;
        Ok(Pixels { size: self.size, rgba })
    }
}

impl Sink for Film {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), Refusal> {
        let pixels = self.draw(frame).map_err(|e| Refusal::new(e.to_string()))?;
        match &mut self.reel {
            Reel::Folder(folder) => {
                let png = pixels.png().map_err(|e| Refusal::new(e.to_string()))?;
                folder.write(frame.number, &png)
            }
            Reel::Gif { file, encoder, bytes, fps } => {
                // GIF counts hundredths of a second: rounded so that no error adds up.
                let hundredths = |frame: u64| (frame as f64 * 100.0 / *fps).round() as u32;
                let delay = hundredths(frame.number + 1) - hundredths(frame.number);
                let [width, height] = pixels.size;
                let image = RgbaImage::from_raw(width, height, pixels.rgba).unwrap_or_default();
                let delay = Delay::from_numer_denom_ms(delay * 10, 1);
                let image = image::Frame::from_parts(image, 0, 0, delay);
                encoder.encode_frame(image).map_err(|e| file.failed(e))?;
                bytes.hand_on(file)
            }
        }
    }

    fn finish(self: Box<Self>) -> Result<(), Refusal> {
        match self.reel {
            Reel::Folder(folder) => folder.keep(),
            Reel::Gif { file, encoder, bytes, .. } => {
                drop(encoder);
                bytes.hand_on(&file)?;
                file.keep()
            }
        }
    }
}
