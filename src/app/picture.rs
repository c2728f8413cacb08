//! One picture without a window: for `tenter render`, the gallery and the tests.

use std::{f32::consts::FRAC_PI_4, io::Write, path::Path};

use glam::{Vec2, Vec3};
use image::{
    ImageEncoder,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};

use super::{
    camera::{Bounds, Camera},
    geometry::Geometry,
    gpu::{Attachments, Gpu, GpuError, PICTURE_FORMAT, Picture},
    render::{Cloth, Frame, Look, Renderer, Style, Topology, View, flag},
};
use crate::world::World;

/// Pixels of a finished picture: rows from the top, red, green, blue, alpha.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pixels {
    /// Width and height.
    pub size: [u32; 2],
    /// 4 bytes a pixel.
    pub rgba: Vec<u8>,
}

/// Draws cloths into a picture of `look.size` pixels.
///
/// # Errors
/// [`GpuError`] if the size is impossible or the device was lost.
pub fn draw(
    gpu: &Gpu,
    cloths: &[(Topology<'_>, Frame<'_>)],
    look: &Look<'_>,
    style: &Style,
    samples: u32,
) -> Result<Pixels, GpuError> {
    let Gpu { device, queue, .. } = gpu;
    let size = [look.size.x as u32, look.size.y as u32];
    let picture = Picture::new(gpu, size)?;
    let renderer = Renderer::new(device, PICTURE_FORMAT, samples);
    let mut view = View::new(device, &renderer);
    view.set(queue, look, style);
    let mut stored: Vec<Cloth> = cloths
        .iter()
        .map(|(topology, frame)| {
            let mut cloth = Cloth::new(device, queue, &renderer);
            cloth.set_topology(device, queue, &renderer, topology);
            cloth.set_frame(device, queue, &renderer, frame, style);
            cloth
        })
        .collect();
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    renderer.prepare(device, &mut encoder, &mut view, &mut stored, style);
    let attachments = Attachments::new(device, PICTURE_FORMAT, size, samples);
    let mut pass = attachments.begin(&mut encoder, &picture.view(), wgpu::Color::BLACK);
    renderer.draw(&mut pass, &view, &stored, style);
    drop(pass);
    queue.submit([encoder.finish()]);
    let rgba = picture.read(gpu)?;
    gpu.check()?;
    Ok(Pixels { size, rgba })
}

impl Pixels {
    /// The picture as the bytes of a PNG file.
    ///
    /// # Errors
    /// Those of the encoder; none are known.
    pub fn png(&self) -> std::io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let [width, height] = self.size;
        // Every pixel is opaque: alpha would only be stored.
        let rgb: Vec<u8> = self.rgba.chunks_exact(4).flat_map(|pixel| &pixel[..3]).copied().collect();
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive)
            .write_image(&rgb, width, height, image::ExtendedColorType::Rgb8)
            .map_err(std::io::Error::other)?;
        Ok(bytes)
    }

    /// Writes the picture as PNG: beside the path first, then renamed, so that it is there whole or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save_png(&self, path: &Path) -> std::io::Result<()> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut file = builder.tempfile_in(folder)?;
        file.write_all(&self.png()?)?;
        file.persist(path)?;
        Ok(())
    }
}

/// Draws a world as it stands, from where all of it is seen.
///
/// # Errors
/// [`GpuError`] if the size is impossible or the device was lost.
pub fn of_world(gpu: &Gpu, world: &World, size: [u32; 2], style: &Style) -> Result<Pixels, GpuError> {
    let geometry = Geometry::of(world, 1);
    let mut positions = Vec::new();
    world.positions_f32(&mut positions);
    let flags: Vec<u32> = world.pinned().iter().map(|pinned| u32::from(*pinned) * flag::PINNED).collect();
    let kinds = world.scene().springs.kinds();
    let frame = Frame {
        version: 1,
        positions: &positions,
        earlier: None,
        flags: &flags,
        values_version: 1,
        values: None,
        enabled: kinds.each_ref().map(|kind| kind.enabled),
        rest_scale: kinds.each_ref().map(|kind| kind.rest_scale as f32),
        tint: None,
    };
    let size = Vec2::new(size[0] as f32, size[1] as f32);
    let bounds = Bounds::of(&positions);
    let mut camera = Camera::default();
    let mut ground_height = 0.0;
    if let Some(bounds) = &bounds {
        let points = positions.iter().map(|&p| Vec3::from(p)).filter(|p| p.is_finite());
        camera.yaw = telling_yaw(camera, &positions, &geometry.triangles);
        camera.focus_on(&points, bounds, size);
        ground_height = bounds.min.y - 0.1 * bounds.radius();
    }
    let look = Look { camera: &camera, size, pixels_per_point: 1.0, ground_height, bounds };
    // A picture is drawn once: smooth edges are worth their price on any adapter.
    draw(gpu, &[(geometry.topology(), frame)], &look, style, 4)
}

/// The nearest turn from the usual one that shows about as much of the surface as any: cloth seen edge on is a line.
pub(super) fn telling_yaw(camera: Camera, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> f32 {
    const ENOUGH: f32 = 0.8;
    let yaws = [0, 1, -1, 2, -2, 3, -3, 4].map(|turn: i8| camera.yaw + f32::from(turn) * FRAC_PI_4);
    let mut shown = [0.0_f32; 8];
    let forwards = yaws.map(|yaw| Camera { yaw, ..camera }.axes()[2]);
    for corners in triangles {
        let [a, b, c] = corners.map(|p| Vec3::from(positions[p as usize]));
        let area = (b - a).cross(c - a);
        for (sum, forward) in shown.iter_mut().zip(forwards).filter(|_| area.is_finite()) {
            *sum += area.dot(forward).abs();
        }
    }
    let enough = ENOUGH * shown.iter().copied().fold(0.0, f32::max);
    shown.iter().zip(yaws).find(|(shown, _)| **shown >= enough).map_or(camera.yaw, |(_, yaw)| yaw)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::render::{Springs, Theme};

    /// A sheet that hangs in folds, with every kind of spring.
    struct Sheet {
        positions: Vec<[f32; 3]>,
        triangles: Vec<[u32; 3]>,
        pairs: [Vec<[u32; 2]>; 3],
        rest: [Vec<f32>; 3],
        flags: Vec<u32>,
        values: Vec<f32>,
    }

    fn sheet(n: u32, shape: impl Fn(f32, f32) -> Vec3) -> Sheet {
        let at = |r: u32, c: u32| r * n + c;
        let place = |i: u32| i as f32 / (n - 1) as f32;
        let mut s = Sheet {
            positions: Vec::new(),
            triangles: Vec::new(),
            pairs: Default::default(),
            rest: Default::default(),
            flags: vec![0; (n * n) as usize],
            values: Vec::new(),
        };
        let spacing = 24.0 / (n - 1) as f32;
        for r in 0..n {
            for c in 0..n {
                s.positions.push(shape(place(c), place(r)).to_array());
                s.values.push(0.22 * (6.0 * place(c)).sin() * place(r));
                for (kind, dr, dc) in [(0, 0, 1), (0, 1, 0), (1, 1, 1), (2, 0, 2), (2, 2, 0)] {
                    if r + dr < n && c + dc < n {
                        s.pairs[kind].push([at(r, c), at(r + dr, c + dc)]);
                        s.rest[kind].push(spacing * Vec2::new(dr as f32, dc as f32).length());
                    }
                }
                if r + 1 < n && c + 1 < n {
                    s.pairs[1].push([at(r, c + 1), at(r + 1, c)]);
                    s.rest[1].push(spacing * 2_f32.sqrt());
                    s.triangles.push([at(r, c), at(r + 1, c), at(r + 1, c + 1)]);
                    s.triangles.push([at(r, c), at(r + 1, c + 1), at(r, c + 1)]);
                }
            }
        }
        for i in 0..3 {
            s.flags[i] = flag::PINNED;
            s.flags[n as usize - 1 - i] = flag::PINNED;
        }
        s
    }

    fn folds(u: f32, v: f32) -> Vec3 {
        let sag = 1.0 - (2.0 * u - 1.0).powi(2);
        let wave = (u * 19.0).sin() * (0.25 + 1.1 * v);
        Vec3::new(20.0 * (u - 0.5), -3.0 * sag * (1.0 - 0.3 * v) - 20.0 * v, wave + 3.0 * v * v)
    }

    fn parts(s: &Sheet) -> (Topology<'_>, Frame<'_>) {
        let topology = Topology {
            version: 1,
            particles: s.positions.len() as u32,
            triangles: &s.triangles,
            springs: std::array::from_fn(|k| Springs { pairs: &s.pairs[k], rest_lengths: &s.rest[k] }),
        };
        let frame = Frame {
            version: 1,
            positions: &s.positions,
            earlier: None,
            flags: &s.flags,
            values_version: 1,
            values: Some(&s.values),
            enabled: [true; 3],
            rest_scale: [1.0; 3],
            tint: None,
        };
        (topology, frame)
    }

    fn shoot(name: &str, s: &Sheet, style: &Style, samples: u32, change: impl Fn(&mut Camera)) {
        let gpu = match Gpu::offscreen() {
            Ok(gpu) => gpu,
            Err(error) => return eprintln!("skipped {name}: {error}"),
        };
        let size = Vec2::new(1280.0, 800.0);
        let mut camera = Camera::default();
        change(&mut camera);
        let bounds = Bounds::of(&s.positions).expect("positions");
        camera.focus(&bounds, size);
        let look =
            Look { camera: &camera, size, pixels_per_point: 1.0, ground_height: -25.0, bounds: Some(bounds) };
        let start = std::time::Instant::now();
        let pixels = draw(&gpu, &[parts(s)], &look, style, samples).expect("draws");
        eprintln!("{name}: {:?}", start.elapsed());
        // The cloth is seen: much of the picture's middle is far brighter than the left edge, or darker in the light theme.
        let row = |y: u32| pixels.rgba[5120 * y as usize..][..5120].chunks_exact(4);
        let seen =
            |y: u32| row(y).filter(|p| p[0].abs_diff(row(y).next().map_or(0, |edge| edge[0])) > 24).count();
        let seen: usize = (300..500).map(seen).sum();
        assert!(seen > 3000, "{name}: {seen} pixels");
        if let Ok(folder) = std::env::var("TENTER_LOOK") {
            pixels.save_png(&Path::new(&folder).join(format!("{name}.png"))).expect("writes");
        }
    }

    #[test]
    fn every_way_to_show_a_sheet_draws_it() {
        let mut s = sheet(25, folds);
        s.flags[300] = flag::GRABBED;
        for i in [206, 207, 231, 232] {
            s.flags[i] = flag::SELECTED;
        }
        let dark = Style::default();
        shoot("dark", &s, &dark, 1, |_| {});
        shoot("back", &s, &dark, 4, |c| c.yaw += 3.0);
        let springs = Style { surface: false, springs: [true; 3], ..dark.clone() };
        shoot("springs", &s, &springs, 1, |_| {});
        let light = Style { theme: Theme::Light, particles: false, ..dark.clone() };
        shoot("light", &s, &light, 4, |c| c.pitch = 0.2);
        let strain = Style { surface_values: true, particles: false, ..dark.clone() };
        shoot("strain", &s, &strain, 4, |c| c.yaw = 0.2);
        let strain =
            Style { spring_strain: true, surface: false, springs: [true, false, false], ..dark.clone() };
        shoot("strain_springs", &s, &strain, 4, |c| {
            c.projection = crate::app::camera::Projection::Orthographic;
        });
        let fine = sheet(200, folds);
        shoot("fine", &fine, &dark, 4, |_| {});
        let flat = sheet(25, |u, v| Vec3::new(24.0 * (u - 0.5), 0.0, 24.0 * (v - 0.5)));
        shoot("flat", &flat, &dark, 1, |_| {});
    }

    #[test]
    fn a_world_is_drawn_and_saved() {
        let gpu = match Gpu::offscreen() {
            Ok(gpu) => gpu,
            Err(error) => return eprintln!("skipped a_world_is_drawn_and_saved: {error}"),
        };
        let scene = crate::scene::Scene::default();
        let mut world = World::new(scene, crate::scene::Place::default()).expect("the default scene");
        for _ in 0..100 {
            world.step();
        }
        let pixels = of_world(&gpu, &world, [640, 400], &Style::default()).expect("draws");
        let folder = tempfile::tempdir().expect("a folder");
        let path =
            std::env::var("TENTER_LOOK").map_or(folder.path().to_owned(), Into::into).join("world.png");
        pixels.save_png(&path).expect("writes");
        let back = image::open(&path).expect("reads").to_rgba8();
        assert_eq!((back.dimensions(), back.as_raw()), ((640, 400), &pixels.rgba));
        assert!(of_world(&gpu, &world, [0, 400], &Style::default()).is_err());
    }
}
