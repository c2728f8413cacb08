//! Pictures of the built-in scenes, compared with stored ones; and what is uploaded for a picture.
//!
//! `TENTER_STORE_PICTURES=1 WGPU_BACKEND=vulkan cargo test --test pictures` makes the stored pictures again.

mod machine;

use glam::{Vec2, Vec3};
use std::path::{Path, PathBuf};
use tenter::app::{
    camera::{Bounds, Camera},
    geometry::Geometry,
    gpu::{Gpu, PICTURE_FORMAT},
    picture::{self, Pixels},
    render::{Cloth, Earlier, Frame, Look, Renderer, Style, View, flag},
};
use tenter::scene::{Opened, Place, Scene, open};
use tenter::world::World;

/// Pixels: small, so that all scenes together stay below a megabyte.
const SIZE: [u32; 2] = [320, 200];
/// Simulated time at which a scene is drawn, s.
const TIME: f64 = 1.0;

// The same adapter draws the same bytes. The slack is for other versions of Mesa and other adapters, whose edges of
// triangles and samples of the shadow fall a little elsewhere: a pixel counts as different where a channel is off by more
// than LEVELS of 255, and LIMIT of all pixels may be. Mesa's OpenGL differs from its Vulkan in 0.008 % of the pixels of the
// worst scene; the limit is 25 times that, and every setting of the display that can be switched goes far beyond it.
const LEVELS: u8 = 24;
const LIMIT: f64 = 0.002;

fn gpu(test: &str) -> Option<Gpu> {
    Gpu::offscreen().map_err(|e| machine::lacks(test, &e.to_string())).ok()
}

fn world(name: &str) -> World {
    let Opened { scene, place, .. } = open(name).expect("a built-in scene");
    let mut world = World::new(scene, place).expect("a world");
    while world.time() + world.scene().dt / 2.0 < TIME && !world.health().is_diverged() {
        world.step();
    }
    world
}

/// The part of the pixels that differ.
fn difference(a: &[u8], b: &[u8]) -> f64 {
    let differs = |(a, b): &(&[u8], &[u8])| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > LEVELS);
    a.chunks_exact(4).zip(b.chunks_exact(4)).filter(differs).count() as f64 * 4.0 / a.len() as f64
}

fn compare(name: &str, pixels: &Pixels, stored: &Path) -> Result<(), String> {
    let image = image::open(stored).map_err(|e| format!("{name}: {}: {e}", stored.display()))?.to_rgba8();
    if image.dimensions() != (pixels.size[0], pixels.size[1]) {
        return Err(format!("{name}: the stored picture has another size"));
    }
    let part = difference(&pixels.rgba, &image);
    println!("{name}: {:.3} % of the pixels differ", part * 100.0);
    if part <= LIMIT {
        return Ok(());
    }
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let drawn = folder.join(format!("{name}.png"));
    pixels.save_png(&drawn).map_err(|e| e.to_string())?;
    let percent = part * 100.0;
    Err(format!(
        "{name}: {percent:.2} % of the pixels differ from {}; drawn: {}",
        stored.display(),
        drawn.display()
    ))
}

#[test]
fn built_in_scenes_look_as_stored() {
    let Some(gpu) = gpu("built_in_scenes_look_as_stored") else { return };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pictures");
    let store = std::env::var_os("TENTER_STORE_PICTURES").is_some();
    if store {
        std::fs::create_dir_all(&folder).expect("a folder");
    }
    let mut wrong = Vec::new();
    for scene in tenter::scene::builtin::ALL {
        let stored = folder.join(format!("{}.png", scene.name));
        let pixels = picture::of_world(&gpu, &world(scene.name), SIZE, &Style::default()).expect("drawn");
        if store {
            pixels.save_png(&stored).expect("written");
        }
        wrong.extend(compare(scene.name, &pixels, &stored).err());
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_same_picture_is_drawn_twice_to_the_byte() {
    let Some(gpu) = gpu("the_same_picture_is_drawn_twice_to_the_byte") else { return };
    let world = world("cylinder");
    let draw = || picture::of_world(&gpu, &world, SIZE, &Style::default()).expect("drawn");
    assert!(draw() == draw());
}

#[test]
fn the_comparison_sees_what_a_person_would_see() {
    let Some(gpu) = gpu("the_comparison_sees_what_a_person_would_see") else { return };
    let world = world("sheet");
    let draw = |style: &Style| picture::of_world(&gpu, &world, SIZE, style).expect("drawn").rgba;
    let usual = draw(&Style::default());
    let unlike = |change: fn(&mut Style)| {
        let mut style = Style::default();
        change(&mut style);
        difference(&usual, &draw(&style))
    };
    assert!(unlike(|_| {}) == 0.0);
    for (what, part) in [
        ("particles", unlike(|style| style.particles = false)),
        ("edges", unlike(|style| style.edges = false)),
        ("surface", unlike(|style| style.surface = false)),
        ("front", unlike(|style| style.colours.front = [88, 168, 196])),
        ("springs", unlike(|style| style.springs[1] = true)),
        ("axes", unlike(|style| style.axes = false)),
    ] {
        assert!(part > LIMIT, "{what}: {part}");
    }
}

/// What a frame's upload is made of.
#[test]
fn no_byte_is_uploaded_twice() {
    let Some(gpu) = gpu("no_byte_is_uploaded_twice") else { return };
    let (device, queue) = (&gpu.device, &gpu.queue);
    let renderer = Renderer::new(device, PICTURE_FORMAT, 1);
    let style = Style::default();
    let mut cloth = Cloth::new(device, queue, &renderer);
    let scene = Scene::from_ron("(tearing: (enabled: true, max_ratio: 1.5), gravity: (magnitude: 100))");
    let mut world = World::new(scene.expect("a scene"), Place::default()).expect("a world");
    let particles = world.pinned().len() as u64;
    let mut shapes = 0;
    let mut show = |version: u64, world: &World, geometry: &Geometry, flags: &[u32]| {
        let mut positions = Vec::new();
        world.positions_f32(&mut positions);
        cloth.set_topology(device, queue, &renderer, &geometry.topology());
        let frame = Frame {
            version,
            positions: &positions,
            earlier: None,
            flags,
            enabled: [true; 3],
            rest_scale: [1.0; 3],
            ..Frame::default()
        };
        cloth.set_frame(device, queue, &renderer, &frame, &style);
        cloth.take_uploaded()
    };
    let mut geometry_of = |world: &World| {
        shapes += 1;
        Geometry::of(world, shapes)
    };
    let geometry = geometry_of(&world);
    let mut flags = vec![0; particles as usize];
    let indices = |geometry: &Geometry| {
        let springs: usize = geometry.springs.iter().map(Vec::len).sum();
        (12 * geometry.triangles.len() + 12 * springs) as u64
    };
    let positions = 12 * particles;
    let first = show(1, &world, &geometry, &flags);
    assert!(first > positions + indices(&geometry), "{first}");

    world.step();
    assert_eq!(show(2, &world, &geometry, &flags), positions, "a frame is its positions, once");
    assert_eq!(show(2, &world, &geometry, &flags), 0, "what stands still is not sent again");
    flags[7] = flag::GRABBED;
    assert_eq!(show(2, &world, &geometry, &flags), 4 * particles + 4, "a mark is the flags and its number");

    while world.broken().is_empty() {
        world.step();
    }
    let torn = geometry_of(&world);
    assert!(show(3, &world, &torn, &flags) > positions + indices(&torn), "a tear is new indices");
    assert_eq!(show(4, &world, &torn, &flags), positions);

    // Between states two are there, of which the first was shown last; on the way only a number is sent.
    let positions_of = |world: &mut World| {
        let mut positions = Vec::new();
        world.step();
        world.positions_f32(&mut positions);
        positions
    };
    let ways: [Vec<[f32; 3]>; 3] = std::array::from_fn(|_| positions_of(&mut world));
    let mut between = |number: usize, part: f32| {
        let before = Earlier { version: 10 + number as u64, positions: &ways[number], part };
        let frame = Frame {
            version: before.version + 1,
            positions: &ways[number + 1],
            earlier: Some(before),
            flags: &flags,
            enabled: [true; 3],
            rest_scale: [1.0; 3],
            ..Frame::default()
        };
        cloth.set_frame(device, queue, &renderer, &frame, &style);
        cloth.take_uploaded()
    };
    assert_eq!(between(0, 0.5), 2 * positions + 16);
    assert_eq!(between(0, 0.75), 16, "on the way only its part is sent");
    assert_eq!(between(0, 0.75), 0);
    assert_eq!(between(1, 0.25), positions + 16, "where one way ends the next begins");

    let mut view = View::new(device, &renderer);
    let mut look = |camera: &Camera| {
        let bounds = Bounds::of(&[[0.0; 3], [1.0; 3]]);
        let size = glam::Vec2::new(SIZE[0] as f32, SIZE[1] as f32);
        view.set(queue, &Look { camera, size, pixels_per_point: 1.0, ground_height: 0.0, bounds }, &style);
        view.take_uploaded()
    };
    assert!(look(&Camera::default()) > 0);
    assert_eq!(look(&Camera::default()), 0, "a camera that stands still is not sent again");
    assert!(look(&Camera { yaw: 1.0, ..Camera::default() }) > 0);
}

#[test]
fn between_two_states_a_picture_shows_the_way() {
    let Some(gpu) = gpu("between_two_states_a_picture_shows_the_way") else { return };
    let mut world = world("sheet");
    let geometry = Geometry::of(&world, 1);
    let mut states: [Vec<[f32; 3]>; 2] = Default::default();
    world.positions_f32(&mut states[0]);
    for _ in 0..40 {
        world.step();
    }
    world.positions_f32(&mut states[1]);
    let [first, last] = &states;
    let middle: Vec<[f32; 3]> =
        first.iter().zip(last).map(|(&a, &b)| Vec3::from(a).midpoint(b.into()).to_array()).collect();
    let mut camera = Camera::default();
    let bounds = Bounds::of(first.iter().chain(last)).expect("a box");
    let size = Vec2::new(SIZE[0] as f32, SIZE[1] as f32);
    camera.focus(&bounds, size);
    let look =
        Look { camera: &camera, size, pixels_per_point: 1.0, ground_height: -30.0, bounds: Some(bounds) };
    let draw = |positions: &[[f32; 3]], earlier: Option<Earlier<'_>>| {
        let frame = Frame {
            version: 2,
            positions,
            earlier,
            enabled: [true; 3],
            rest_scale: [1.0; 3],
            ..Frame::default()
        };
        let cloths = [(geometry.topology(), frame)];
        picture::draw(&gpu, &cloths, &look, &Style::default(), 1).expect("drawn").rgba
    };
    let way = |part| draw(last, Some(Earlier { version: 1, positions: first, part }));
    let straight = draw(&middle, None);
    assert!(difference(&way(0.5), &straight) <= LIMIT);
    assert!(difference(&way(1.0), &draw(last, None)) == 0.0);
    assert!(difference(&way(0.0), &straight) > LIMIT, "the ends are not the middle");
}
