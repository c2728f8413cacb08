//! Pictures of a motion, all from one point of view: a folder of PNG files, or one animated GIF.

use std::{cell::RefCell, io::Write, path::Path, rc::Rc};

use glam::Vec2;
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

/// Most that is kept of a motion, bytes; what takes more runs a second time.
const KEPT: usize = 512 << 20;

/// What a picture shows.
struct Shot {
    positions: Vec<[f32; 3]>,
    geometry: Rc<Geometry>,
}

impl Shot {
    /// A frame; the geometry is that of the shot before unless more has torn since.
    fn of(frame: &Frame<'_>, shape: &mut Option<(usize, Rc<Geometry>)>) -> Self {
        let torn = frame.world.broken().len();
        let same = shape.take().filter(|(before, _)| *before == torn);
        let (_, geometry) =
            shape.insert(same.unwrap_or_else(|| (torn, Rc::new(Geometry::of(frame.world, torn as u64 + 1)))));
        let positions = frame.positions.iter().map(|p| p.as_vec3().to_array()).collect();
        Self { positions, geometry: Rc::clone(geometry) }
    }

    /// Bytes that keeping it takes, an upper estimate; those of a geometry with all that share it.
    fn size(&self) -> usize {
        let Geometry { triangles, springs, .. } = &*self.geometry;
        let springs: usize = springs.iter().map(Vec::len).sum();
        let own = if Rc::strong_count(&self.geometry) > 2 { 0 } else { 12 * (triangles.len() + springs) };
        12 * self.positions.len() + own
    }
}

/// A motion before it is drawn: the box that it stays in, m, and its frames as long as they are few.
struct Take {
    bounds: Option<Bounds>,
    shape: Option<(usize, Rc<Geometry>)>,
    shots: Vec<Shot>,
    /// Bytes that may still be kept; none once they have not sufficed.
    left: Option<usize>,
}

impl Sink for Take {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), Refusal> {
        let shot = Shot::of(frame, &mut self.shape);
        let corners = self.bounds.iter().flat_map(|b| [b.min.to_array(), b.max.to_array()]);
        let points: Vec<[f32; 3]> = shot.positions.iter().copied().chain(corners).collect();
        self.bounds = Bounds::of(&points);
        self.left = self.left.and_then(|left| left.checked_sub(shot.size()));
        if self.left.is_some() {
            self.shots.push(shot);
        } else {
            self.shots = Vec::new();
        }
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
    /// The springs that are there by kind, and how long they want to be.
    springs: ([bool; 3], [f32; 3]),
    shape: Option<(usize, Rc<Geometry>)>,
    /// Version of the geometry that is drawn, and number of pictures.
    shown: (u64, u64),
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
    /// Makes pictures of a motion, of a size in pixels, and puts them into their place; answers with their number. `run` runs
    /// the world from where it stands: once to find where all of it is seen from, and again to be drawn where it was too
    /// much to be kept; `go_on` is asked before each picture of a motion that was kept, with the number of those drawn.
    ///
    /// # Errors
    /// A place that cannot be written, no adapter, a size that is impossible, a rate that the format cannot hold; those
    /// before the run. What `run` refuses.
    pub fn make(
        world: &mut World,
        format: Format,
        path: &Path,
        size: [u32; 2],
        span: Span,
        run: &mut dyn FnMut(&mut World, &mut dyn Sink) -> Result<u64, Refusal>,
        go_on: &mut dyn FnMut(u64) -> Result<bool, Refusal>,
    ) -> Result<u64, Refusal> {
        Self::keeping(KEPT, world, format, path, size, span, run, go_on)
    }

    #[allow(clippy::too_many_arguments, reason = "those of the function above, and what it leaves to tests")]
    fn keeping(
        most: usize,
        world: &mut World,
        format: Format,
        path: &Path,
        size: [u32; 2],
        span: Span,
        run: &mut dyn FnMut(&mut World, &mut dyn Sink) -> Result<u64, Refusal>,
        go_on: &mut dyn FnMut(u64) -> Result<bool, Refusal>,
    ) -> Result<u64, Refusal> {
        let film = Self::new(format, path, size, span)?;
        let start = world.snapshot();
        let mut take = Take { bounds: None, shape: None, shots: Vec::new(), left: Some(most) };
        run(world, &mut take)?;
        let mut film = Box::new(film.framed(world, take.bounds));
        let frames = if take.left.is_some() {
            let mut drawn = 0;
            for shot in &take.shots {
                if !go_on(drawn)? {
                    break;
                }
                film.show(drawn, shot)?;
                drawn += 1;
            }
            drawn
        } else {
            world.restore(&start);
            run(world, &mut *film)?
        };
        film.finish()?;
        Ok(frames)
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
        Ok(Self {
            gpu,
            size,
            style: Style::default(),
            renderer,
            view,
            cloth,
            picture,
            attachments,
            flags: Vec::new(),
            springs: Default::default(),
            shape: None,
            shown: (0, 0),
            reel,
        })
    }

    /// Looks so that a whole motion is seen, from the side that shows most of the cloth as `world` has it at the end.
    fn framed(mut self, world: &World, bounds: Option<Bounds>) -> Self {
        let pinned = world.pinned().iter();
        self.flags = pinned.map(|pinned| u32::from(*pinned) * flag::PINNED).collect();
        let kinds = world.scene().springs.kinds();
        self.springs =
            (kinds.each_ref().map(|kind| kind.enabled), kinds.each_ref().map(|kind| kind.rest_scale as f32));
        let size = Vec2::new(self.size[0] as f32, self.size[1] as f32);
        let mut camera = Camera::default();
        let mut ground_height = 0.0;
        if let Some(bounds) = &bounds {
            let mut positions = Vec::new();
            world.positions_f32(&mut positions);
            camera.yaw = telling_yaw(camera, &positions, &Geometry::of(world, 1).triangles);
            camera.focus(bounds, size);
            ground_height = bounds.min.y - 0.1 * bounds.radius();
        }
        let look = Look { camera: &camera, size, pixels_per_point: 1.0, ground_height, bounds };
        self.view.set(&self.gpu.queue, &look, &self.style);
        self
    }

    fn draw(&mut self, shot: &Shot) -> Result<Pixels, super::gpu::GpuError> {
        let Self { gpu, renderer, style, view, .. } = self;
        let Gpu { device, queue, .. } = &*gpu;
        self.shown.1 += 1;
        if self.shown.0 != shot.geometry.version {
            self.shown.0 = shot.geometry.version;
            self.cloth[0].set_topology(device, queue, renderer, &shot.geometry.topology());
        }
        let drawn = Drawn {
            version: self.shown.1,
            positions: &shot.positions,
            earlier: None,
            flags: &self.flags,
            values_version: 0,
            values: None,
            enabled: self.springs.0,
            rest_scale: self.springs.1,
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

impl Film {
    /// Draws the picture of a number.
    fn show(&mut self, number: u64, shot: &Shot) -> Result<(), Refusal> {
        let pixels = self.draw(shot).map_err(|e| Refusal::new(e.to_string()))?;
        match &mut self.reel {
            Reel::Folder(folder) => {
                let png = pixels.png().map_err(|e| Refusal::new(e.to_string()))?;
                folder.write(number, &png)
            }
            Reel::Gif { file, encoder, bytes, fps } => {
                // GIF counts hundredths of a second: rounded so that no error adds up.
                let hundredths = |frame: u64| (frame as f64 * 100.0 / *fps).round() as u32;
                let delay = hundredths(number + 1) - hundredths(number);
                let [width, height] = pixels.size;
                let image = RgbaImage::from_raw(width, height, pixels.rgba).unwrap_or_default();
                let delay = Delay::from_numer_denom_ms(delay * 10, 1);
                let image = image::Frame::from_parts(image, 0, 0, delay);
                encoder.encode_frame(image).map_err(|e| file.failed(e))?;
                bytes.hand_on(file)
            }
        }
    }
}

impl Sink for Film {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), Refusal> {
        let shot = Shot::of(frame, &mut self.shape);
        self.show(frame.number, &shot)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{export, scene::Place, scene::Scene};

    /// Drawn pictures of a tearing cloth, when so many bytes may be kept; and how often it ran.
    fn pictures(most: usize) -> (Vec<Vec<u8>>, u32) {
        let folder = tempfile::tempdir().expect("a folder");
        let text = "(target: Grid(columns: 6, rows: 6), tearing: (enabled: true, max_ratio: 1.02), springs: (stretch: (stiffness: 20.0)))";
        let scene = Scene::from_ron(text).expect("a scene");
        let mut world = World::new(scene, Place::default()).expect("a world");
        let span = Span::new(0.4, 10.0).expect("frames");
        let mut runs = 0;
        let run = &mut |world: &mut World, sink: &mut dyn Sink| {
            runs += 1;
            export::run(world, span, sink, &mut |_| true)
        };
        let path = folder.path().join("a.png");
        let frames =
            Film::keeping(most, &mut world, Format::Png, &path, [80, 50], span, run, &mut |_| Ok(true));
        assert_eq!(frames, Ok(5));
        assert!(!world.broken().is_empty(), "nothing has torn");
        let file = |n: u64| folder.path().join(format!("a/a_{n:04}.png"));
        ((0..5).map(|n| std::fs::read(file(n)).expect("a picture")).collect(), runs)
    }

    #[test]
    fn a_motion_that_is_kept_is_drawn_as_one_that_runs_again() {
        if Gpu::offscreen().is_err() {
            return;
        }
        let (kept, once) = pictures(KEPT);
        let (again, twice) = pictures(1000);
        assert_eq!((once, twice), (1, 2));
        assert!(kept == again, "the pictures differ");
    }
}
