//! `tenter render`: steps a scene headless and draws one picture of it.

use super::Common;
#[cfg(not(feature = "app"))]
use super::Ending;
use super::run::Length;
use crate::scene::Refusal;
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub struct Options {
    /// A .ron file, a mesh, a built-in scene, or - for standard input.
    scene: String,
    #[command(flatten)]
    length: Length,
    /// Where the picture goes.
    #[arg(long, value_name = "FILE.png")]
    out: PathBuf,
    /// Width and height of the picture, pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x800", value_parser = size)]
    size: [u32; 2],
    #[command(flatten)]
    common: Common,
}

pub fn size(text: &str) -> Result<[u32; 2], String> {
    let side = |text: &str| text.parse().ok().filter(|side| *side > 0);
    let sides = text.split_once(['x', 'X']).and_then(|(width, height)| Some([side(width)?, side(height)?]));
    sides.ok_or_else(|| "accepted: width x height in pixels, as in 1280x800".to_owned())
}

/// Width and height where none are named, pixels.
#[cfg(feature = "app")]
pub const SIZE: [u32; 2] = [1280, 800];

#[cfg(feature = "app")]
pub use with_renderer::{Painter, render};

#[cfg(not(feature = "app"))]
pub fn render(options: &Options) -> Result<Ending, Refusal> {
    let Options { scene, length: _, out, size: _, common: _ } = options;
    let out = out.display();
    Err(Refusal::new(format!(
        "{out}: {scene} is not drawn: this build has no renderer; build it with the feature app"
    )))
}

#[cfg(feature = "app")]
mod with_renderer {
    use super::{Options, Refusal};
    use crate::app::{gpu::Gpu, picture, render::Style};
    use crate::cli::output::{self, Pending};
    use crate::cli::run::advance;
    use crate::cli::{Common, Ending};
    use crate::world::{Health, World};
    use serde::Serialize;
    use std::path::Path;

    /// A picture to be: device and file are there before the long work begins.
    pub struct Painter<'a> {
        gpu: Gpu,
        file: Pending,
        path: &'a Path,
        size: [u32; 2],
    }

    /// What was drawn, as JSON has it.
    #[derive(Serialize)]
    pub struct Drawn<'a> {
        file: &'a Path,
        size: [u32; 2],
        adapter: String,
        software: bool,
        scene: &'a str,
        particles: usize,
        steps: u64,
        time: f64,
        health: Health,
    }

    impl<'a> Painter<'a> {
        /// Prepares a picture.
        pub fn new(path: &'a Path, size: [u32; 2]) -> Result<Self, Refusal> {
            let refused = |e: crate::app::gpu::GpuError| Refusal::new(e.to_string());
            let file = Pending::new(path)?;
            let gpu = Gpu::offscreen().map_err(refused)?;
            gpu.check_size(size).map_err(refused)?;
            Ok(Self { gpu, file, path, size })
        }

        /// Draws the world as it stands.
        pub fn draw(self, world: &World, title: &'a str) -> Result<Drawn<'a>, Refusal> {
            let refused = |e: &dyn std::fmt::Display| Refusal::new(format!("{}: {e}", self.path.display()));
            let pixels = picture::of_world(&self.gpu, world, self.size, &Style::default());
            let png = pixels.map_err(|e| refused(&e))?.png().map_err(|e| refused(&e))?;
            self.file.finish(&png)?;
            Ok(Drawn {
                file: self.path,
                size: self.size,
                adapter: self.gpu.description(),
                software: self.gpu.software,
                scene: title,
                particles: world.pinned().len(),
                steps: world.steps(),
                time: world.time(),
                health: world.health(),
            })
        }
    }

    impl Drawn<'_> {
        /// For people.
        pub fn summary(&self) -> String {
            let [width, height] = self.size;
            let Self { scene, time, adapter, .. } = self;
            let file = self.file.display();
            format!("{file}: {scene} at {time:.4} s, {width} x {height} pixels, drawn by {adapter}")
        }
    }

    pub fn render(options: &Options) -> Result<Ending, Refusal> {
        let common: &Common = &options.common;
        let extension = options.out.extension().and_then(|extension| extension.to_str());
        if extension.is_some_and(|extension| !extension.eq_ignore_ascii_case("png")) {
            let out = options.out.display();
            return Err(Refusal::new(format!("--out {out}: accepted: a name that ends in .png")));
        }
        let opened = common.open(&options.scene)?;
        let steps = options.length.steps(&opened.scene)?;
        let mut world = common.world(&opened)?;
        let painter = Painter::new(&options.out, options.size)?;
        common.warn(&world.warnings());
        advance(&mut world, common, steps, |_| Ok(true))?;
        let drawn = painter.draw(&world, &opened.title)?;
        if common.json {
            output::print(&output::json(&drawn)?);
        }
        common.say(&drawn.summary());
        if let Health::Diverged { step, time, particle } = world.health() {
            common.say(&format!(
                "health: diverged in step {step} ({time:.4} s) at particle {particle}; the picture shows the last good state"
            ));
        }
        Ok(Ending::of(&world))
    }
}
