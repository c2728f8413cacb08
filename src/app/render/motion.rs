//! Positions on the device: those of one state, or on the way between two, which are uploaded once and blended there.

use super::{
    buffer::Buffer,
    pipeline::{Compute, Layouts, bind, shader},
};

/// Where the particles were at the state before, and how much of the way since has passed.
#[derive(Clone, Copy, Debug)]
pub struct Earlier<'a> {
    /// The frame's version when it showed these positions, if it did.
    pub version: u64,
    /// As many as the frame's own, m.
    pub positions: &'a [[f32; 3]],
    /// 0 shows these positions, 1 the frame's own.
    pub part: f32,
}

pub(super) struct Blend(Compute);

impl Blend {
    pub(super) fn new(device: &wgpu::Device, layouts: &Layouts) -> Self {
        Self(Compute::new(device, "blend", &layouts.blend, &shader!(device, "blend")))
    }
}

/// What `positions` hold.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shown {
    /// A state.
    State(u64),
    /// A place between the states in `later` and `earlier`.
    Between { part: f32 },
}

/// The positions of one cloth.
pub(super) struct Motion {
    pub(super) positions: Buffer,
    earlier: Buffer,
    later: Buffer,
    part: Buffer,
    /// Where the earlier and the later positions are read, and the blended ones written; none once a buffer is another.
    group: Option<wgpu::BindGroup>,
    /// Versions of what the buffers `earlier` and `later` hold.
    held: [Option<u64>; 2],
    shown: Option<Shown>,
    /// `positions` are to be blended before they are drawn.
    is_due: bool,
    /// Counts what `positions` held.
    count: u64,
}

impl Motion {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let storage = |label| Buffer::new(device, label, wgpu::BufferUsages::STORAGE);
        let mut part = Buffer::new(device, "part of the way", wgpu::BufferUsages::UNIFORM);
        part.resize(device, 16);
        Self {
            positions: storage("positions"),
            earlier: storage("earlier positions"),
            later: storage("later positions"),
            part,
            group: None,
            held: [None; 2],
            shown: None,
            is_due: false,
            count: 0,
        }
    }

    /// Makes room for another cloth.
    pub(super) fn resize(&mut self, device: &wgpu::Device, particles: u64) {
        self.positions.resize(device, 12 * particles);
        (self.group, self.held, self.shown, self.is_due) = (None, [None; 2], None, false);
    }

    /// Shows a state, or a place on the way to it. What was uploaded for the frame before is not uploaded again.
    pub(super) fn show(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        version: u64,
        positions: &[[f32; 3]],
        earlier: Option<Earlier<'_>>,
        uploaded: &mut u64,
    ) {
        let shown = match earlier {
            None => Shown::State(version),
            Some(Earlier { part, .. }) => Shown::Between { part },
        };
        let mut is_new = self.shown != Some(shown);
        match earlier {
            None if is_new => {
                self.positions.set(device, queue, positions, uploaded);
                self.is_due = false;
            }
            None => {}
            Some(earlier) => {
                if self.held[1] != Some(version) {
                    // What came last is where the next way begins.
                    std::mem::swap(&mut self.earlier, &mut self.later);
                    self.held = [self.held[1], Some(version)];
                    if self.held[0] != Some(earlier.version) {
                        self.earlier.set(device, queue, earlier.positions, uploaded);
                        self.held[0] = Some(earlier.version);
                    }
                    self.later.set(device, queue, positions, uploaded);
                    self.group = None;
                    is_new = true;
                }
                if is_new {
                    self.part.set(device, queue, &[earlier.part, 0.0, 0.0, 0.0], uploaded);
                    self.is_due = true;
                }
            }
        }
        self.shown = Some(shown);
        self.count += u64::from(is_new);
    }

    /// Blends on the device if that is due.
    pub(super) fn blend(
        &mut self,
        device: &wgpu::Device,
        layouts: &Layouts,
        blend: &Blend,
        encoder: &mut wgpu::CommandEncoder,
    ) {
        if !std::mem::take(&mut self.is_due) {
            return;
        }
        let buffers = [&self.earlier, &self.later, &self.part, &self.positions];
        let group = self.group.get_or_insert_with(|| bind(device, "blend", &layouts.blend, &buffers));
        let numbers = self.positions.inner.size() / 4;
        blend.0.run(encoder, group, numbers as u32);
    }

    /// Differs for any two pictures of different positions.
    pub(super) fn version(&self) -> u64 {
        self.count
    }
}
