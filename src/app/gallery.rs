//! Small pictures of the built-in scenes, made by the program itself: a thread runs each scene for a moment and draws it.

use std::{
    collections::BTreeMap,
    sync::mpsc::{Receiver, channel},
    time::{Duration, Instant},
};

use egui::{ColorImage, TextureHandle, TextureOptions};

use super::{gpu::Gpu, picture, render::Style};
use crate::{
    scene::{Place, builtin},
    world::World,
};

/// Size of a picture, pixels.
pub const SIZE: [u32; 2] = [336, 210];
/// Simulated time until the picture, s, and the time that it may take.
const MOMENT: f64 = 1.8;
const PATIENCE: Duration = Duration::from_millis(1500);

/// The pictures that are there.
#[derive(Default)]
pub struct Gallery {
    work: Option<Receiver<(&'static str, ColorImage)>>,
    pictures: BTreeMap<&'static str, TextureHandle>,
}

impl Gallery {
    /// Starts to make the pictures, once; `style` says how they look.
    pub fn start(&mut self, window: &egui::Context, style: &Style) {
        if self.work.is_some() {
            return;
        }
        let (sender, receiver) = channel();
        let window = window.clone();
        let style = Style { particles: false, edges: false, axes: false, ..style.clone() };
        self.work = Some(receiver);
        // Without a thread or an adapter there are no pictures, and the names must do.
        let _ = std::thread::Builder::new().name("gallery".to_owned()).spawn(move || {
            let Ok(gpu) = Gpu::offscreen() else { return };
            for scene in builtin::ALL {
                let Some(picture) = draw(&gpu, scene, &style) else { continue };
                if sender.send((scene.name, picture)).is_err() {
                    return;
                }
                window.request_repaint();
            }
        });
    }

    /// Takes the pictures that are ready.
    pub fn poll(&mut self, window: &egui::Context) {
        for (name, image) in self.work.iter().flat_map(Receiver::try_iter) {
            let texture = window.load_texture(name, image, TextureOptions::LINEAR);
            self.pictures.insert(name, texture);
        }
    }

    /// The picture of a scene.
    pub fn picture(&self, name: &str) -> Option<&TextureHandle> {
        self.pictures.get(name)
    }
}

fn draw(gpu: &Gpu, scene: &builtin::Builtin, style: &Style) -> Option<ColorImage> {
    let mut world = World::new((scene.make)(), Place::default()).ok()?;
    let start = Instant::now();
    while world.time() < MOMENT && start.elapsed() < PATIENCE && !world.health().is_diverged() {
        world.step();
    }
    let pixels = picture::of_world(gpu, &world, SIZE, style).ok()?;
    let size = pixels.size.map(|side| side as usize);
    Some(ColorImage::from_rgba_unmultiplied(size, &pixels.rgba))
}
