//! Draws cloth: knows neither window nor simulation, so a picture on disk and the viewport come from the same code.
//!
//! [`Renderer`] holds the pipelines, [`Cloth`] what the device stores of one lane, [`View`] one camera's look into the world.
//! Positions are uploaded once a state, blended between two of them on the device, and read by every primitive from one buffer;
//! indices are uploaded only when the topology changes.

mod buffer;
mod cloth;
mod ground;
mod lines;
mod motion;
mod normals;
mod pipeline;
mod shadow;
mod spheres;
mod style;
mod surface;
mod view;

pub use cloth::Cloth;
pub use motion::Earlier;
pub use style::{Colour, Colours, Ramp, STRAIN_RAMP, Style, Theme};
pub use view::{Look, View};

/// Bits of [`Frame::flags`].
pub mod flag {
    /// Does not move.
    pub const PINNED: u32 = 1;
    /// Held by the mouse.
    pub const GRABBED: u32 = 2;
    /// Part of the selection.
    pub const SELECTED: u32 = 4;
}

/// The springs of one kind.
#[derive(Clone, Copy, Debug, Default)]
pub struct Springs<'a> {
    /// The particles that each joins.
    pub pairs: &'a [[u32; 2]],
    /// Length at rest before the kind's scale, m; as many as `pairs`, or none if strain is never shown.
    pub rest_lengths: &'a [f32],
}

/// What changes only when the cloth is built anew, switched or torn.
#[derive(Clone, Copy, Debug, Default)]
pub struct Topology<'a> {
    /// Differs whenever anything else here does; an unchanged version uploads nothing.
    pub version: u64,
    /// Number of particles; every index below is smaller.
    pub particles: u32,
    /// The surface, counter-clockwise as seen from its front.
    pub triangles: &'a [[u32; 3]],
    /// Springs by kind: stretch, which are the edges of the faces; shear; bend.
    pub springs: [Springs<'a>; 3],
}

/// What may change with every picture.
#[derive(Clone, Copy, Debug, Default)]
pub struct Frame<'a> {
    /// Differs whenever positions do; an unchanged version uploads none. Flags are compared.
    pub version: u64,
    /// Particle positions, m.
    pub positions: &'a [[f32; 3]],
    /// What is shown lies between these positions and `positions`; none shows `positions`.
    pub earlier: Option<Earlier<'a>>,
    /// Bits of [`flag`] for each particle; empty if none is marked.
    pub flags: &'a [u32],
    /// As the version, for values.
    pub values_version: u64,
    /// A value for each particle that can colour the surface (mean strain, distance between lanes).
    pub values: Option<&'a [f32]>,
    /// Kinds of springs that act and are therefore shown.
    pub enabled: [bool; 3],
    /// Rest length scale by kind.
    pub rest_scale: [f32; 3],
    /// Colour of the lane in place of the style's front and back.
    pub tint: Option<Colour>,
}

/// The pipelines, made once for a target's format and samples.
pub struct Renderer {
    layouts: pipeline::Layouts,
    blend: motion::Blend,
    normals: normals::Normals,
    shadow: shadow::Shadow,
    ground: ground::Ground,
    surface: surface::Surface,
    lines: lines::Lines,
    spheres: spheres::Spheres,
}

impl Renderer {
    /// Pipelines for targets of a format and a number of samples per pixel.
    pub fn new(device: &wgpu::Device, format: wgpu::TextureFormat, samples: u32) -> Self {
        let layouts = pipeline::Layouts::new(device);
        let target = pipeline::Target { format, samples };
        Self {
            blend: motion::Blend::new(device, &layouts),
            normals: normals::Normals::new(device, &layouts),
            shadow: shadow::Shadow::new(device, &layouts),
            ground: ground::Ground::new(device, &layouts, target),
            surface: surface::Surface::new(device, &layouts, target),
            lines: lines::Lines::new(device, &layouts, target),
            spheres: spheres::Spheres::new(device, &layouts, target),
            layouts,
        }
    }

    /// What must be known before the pass: positions and normals of the cloths that moved, and the shadow below them.
    pub fn prepare(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        view: &mut View,
        cloths: &mut [Cloth],
        style: &Style,
    ) {
        for cloth in cloths.iter_mut() {
            cloth.motion.blend(device, &self.layouts, &self.blend, encoder);
            self.normals.compute(encoder, cloth);
        }
        let thrown = Some((view.shadow(), cloths.iter().map(Cloth::versions).collect()));
        if style.shadow && style.ground && view.shadow_of != thrown {
            self.shadow.draw(encoder, view, cloths.iter());
            view.shadow_of = thrown;
        }
    }

    /// Draws one view; the pass' viewport and scissor say where.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, view: &View, cloths: &[Cloth], style: &Style) {
        pass.set_bind_group(0, &view.bind_group, &[]);
        self.ground.draw_backdrop(pass, view);
        for cloth in cloths {
            pass.set_bind_group(1, &cloth.bind_group, &[]);
            if style.surface {
                self.surface.draw(pass, cloth);
            }
            self.lines.draw(pass, view, cloth, style);
            self.spheres.draw(pass, cloth, style);
        }
        // Last: it is see-through.
        if style.ground {
            self.ground.draw(pass, view);
        }
    }
}
