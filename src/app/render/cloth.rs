//! What the device stores of one cloth, and its updates: indices with the topology, positions once a state.

use bytemuck::{Pod, Zeroable};

use super::{
    Frame, Renderer, Style, Topology,
    buffer::Buffer,
    lines::{EDGES, KINDS, LineSet},
    motion::Motion,
    normals::triangles_around,
    pipeline::{Layouts, bind},
    style::rgba,
};

#[repr(C)]
#[derive(Clone, Copy, PartialEq, Pod, Zeroable)]
struct Uniform {
    front: [f32; 4],
    back: [f32; 4],
    particle: [f32; 4],
    pinned: [f32; 4],
    grabbed: [f32; 4],
    selected: [f32; 4],
    /// By kind, then the edges of the faces.
    lines: [[f32; 4]; KINDS + 1],
    ramp: [[f32; 4]; 8],
    sizes: [f32; 4],
    rest_scale: [f32; 4],
    stride: [u32; 4],
}

/// One lane's cloth on the device.
pub struct Cloth {
    uniform: Buffer,
    pub(super) motion: Motion,
    normals: Buffer,
    flags: Buffer,
    values: Buffer,
    starts: Buffer,
    around: Buffer,
    marked: Buffer,
    pub(super) triangles: Buffer,
    pub(super) lines: [LineSet; KINDS],
    pub(super) bind_group: wgpu::BindGroup,
    pub(super) normals_group: wgpu::BindGroup,
    pub(super) marked_group: wgpu::BindGroup,
    pub(super) triangle_count: u32,
    pub(super) particle_count: u32,
    pub(super) marked_count: u32,
    pub(super) enabled: [bool; 3],
    /// The positions that the normals belong to.
    pub(super) normals_of: Option<u64>,
    topology_version: Option<u64>,
    values_version: Option<u64>,
    shown_uniform: Option<Uniform>,
    shown_flags: Vec<u32>,
    /// Mean length of an edge at rest, m.
    pub(super) spacing: f32,
    uploaded: u64,
}

impl Cloth {
    /// A cloth without particles.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, renderer: &Renderer) -> Self {
        use wgpu::BufferUsages as Usage;
        let storage = |label| Buffer::new(device, label, Usage::STORAGE);
        let layouts = &renderer.layouts;
        let mut uniform = Buffer::new(device, "cloth", Usage::UNIFORM);
        uniform.resize(device, size_of::<Uniform>() as u64);
        let motion = Motion::new(device);
        let [normals, flags, values, starts, around, marked] =
            ["normals", "flags", "values", "starts", "around", "marked"].map(storage);
        let triangles = Buffer::new(device, "triangles", Usage::STORAGE | Usage::INDEX);
        Self {
            bind_group: bind_cloth(device, layouts, [&uniform, &motion.positions, &normals, &flags, &values]),
            normals_group: bind_normals(
                device,
                layouts,
                [&motion.positions, &triangles, &starts, &around, &normals],
            ),
            marked_group: bind_marked(device, layouts, &marked),
            lines: std::array::from_fn(|kind| LineSet::new(device, queue, layouts, kind)),
            uniform,
            motion,
            normals,
            flags,
            values,
            starts,
            around,
            marked,
            triangles,
            triangle_count: 0,
            particle_count: 0,
            marked_count: 0,
            enabled: [false; 3],
            normals_of: None,
            topology_version: None,
            values_version: None,
            shown_uniform: None,
            shown_flags: Vec::new(),
            spacing: 1.0,
            uploaded: 0,
        }
    }

    /// Uploads indices if the topology is another one than last time. Afterwards a frame must follow before drawing.
    pub fn set_topology(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        topology: &Topology<'_>,
    ) {
        if self.topology_version == Some(topology.version) {
            return;
        }
        self.topology_version = Some(topology.version);
        (self.values_version, self.normals_of) = (None, None);
        let layouts = &renderer.layouts;
        let n = u64::from(topology.particles);
        let (starts, around) = triangles_around(topology.particles, topology.triangles);
        let uploaded = &mut self.uploaded;
        self.triangles.set(device, queue, topology.triangles, uploaded);
        self.starts.set(device, queue, &starts, uploaded);
        self.around.set(device, queue, &around, uploaded);
        self.motion.resize(device, n);
        self.normals.resize(device, 16 * n);
        if self.flags.resize(device, 4 * n) {
            // A new buffer is zero, and so is what it is taken to show.
            self.shown_flags.clear();
        }
        for (set, springs) in self.lines.iter_mut().zip(topology.springs) {
            set.set(device, queue, layouts, (springs.pairs, springs.rest_lengths), uploaded);
        }
        self.triangle_count = topology.triangles.len() as u32;
        self.particle_count = topology.particles;
        let rest = topology.springs.iter().map(|s| s.rest_lengths).find(|rest| !rest.is_empty());
        self.spacing = rest.map_or(1.0, |rest| rest.iter().sum::<f32>() / rest.len() as f32);
        self.bind(device, layouts);
    }

    /// Uploads what changed since the last frame. Frames whose lengths do not fit the topology are skipped.
    pub fn set_frame(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        frame: &Frame<'_>,
        style: &Style,
    ) {
        let n = self.particle_count as usize;
        let fits = frame.positions.len() == n
            && (frame.flags.is_empty() || frame.flags.len() == n)
            && frame.earlier.is_none_or(|earlier| earlier.positions.len() == n)
            && frame.values.is_none_or(|values| values.len() == n);
        if !fits {
            return;
        }
        if n > 0 {
            let Frame { version, positions, earlier, .. } = *frame;
            self.motion.show(device, queue, version, positions, earlier, &mut self.uploaded);
        }
        if let Some(values) =
            frame.values.filter(|_| n > 0 && self.values_version != Some(frame.values_version))
        {
            self.values_version = Some(frame.values_version);
            if self.values.set(device, queue, values, &mut self.uploaded) {
                self.bind(device, &renderer.layouts);
            }
        }
        self.set_flags(device, queue, renderer, frame.flags);
        self.enabled = frame.enabled;
        let uniform = self.uniform(frame, style);
        if self.shown_uniform != Some(uniform) {
            self.uniform.set(device, queue, &[uniform], &mut self.uploaded);
            self.shown_uniform = Some(uniform);
        }
    }

    /// Flags change with a click, not with a frame: they are compared before they are sent.
    fn set_flags(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, renderer: &Renderer, flags: &[u32]) {
        if self.shown_flags == flags {
            return;
        }
        self.shown_flags.clear();
        self.shown_flags.extend_from_slice(flags);
        if flags.is_empty() {
            let none = vec![0_u32; self.particle_count as usize];
            self.flags.set(device, queue, &none, &mut self.uploaded);
        } else {
            self.flags.set(device, queue, flags, &mut self.uploaded);
        }
        let marked: Vec<u32> = (0..).zip(flags).filter(|(_, flag)| **flag != 0).map(|(i, _)| i).collect();
        self.marked_count = marked.len() as u32;
        if self.marked.set(device, queue, &marked, &mut self.uploaded) {
            self.marked_group = bind_marked(device, &renderer.layouts, &self.marked);
        }
    }

    fn uniform(&self, frame: &Frame<'_>, style: &Style) -> Uniform {
        let colours = &style.colours;
        let [stretch, shear, bend] = colours.springs.map(rgba);
        let mut ramp = [[1.0; 4]; 8];
        for (stop, &colour) in ramp.iter_mut().zip(&style.ramp.stops()) {
            *stop = rgba(colour);
        }
        let on = |switch: bool| f32::from(u8::from(switch));
        let values = style.surface_values && frame.values.is_some();
        let [s, h, b] = frame.rest_scale;
        let strides = std::array::from_fn(|kind| match kind {
            0 => self.particle_stride(style),
            _ => self.line_stride(kind - 1, style),
        });
        let darker = |[r, g, b, a]: [f32; 4]| [0.7 * r, 0.7 * g, 0.7 * b, a];
        Uniform {
            front: rgba(frame.tint.unwrap_or(colours.front)),
            back: frame.tint.map_or(rgba(colours.back), |tint| darker(rgba(tint))),
            particle: rgba(colours.particle),
            pinned: rgba(colours.pinned),
            grabbed: rgba(colours.grabbed),
            selected: rgba(colours.selected),
            lines: [stretch, shear, bend, rgba(colours.edges)],
            ramp,
            sizes: [
                style.particle_size * self.spacing,
                style.line_width,
                style.value_range.max(f32::MIN_POSITIVE),
                on(values),
            ],
            rest_scale: [s, h, b, on(style.spring_strain)],
            stride: strides,
        }
    }

    /// What is drawn of it now: other versions, another shape.
    pub(super) fn versions(&self) -> [Option<u64>; 2] {
        [self.topology_version, Some(self.motion.version())]
    }

    /// Every n-th free particle is drawn.
    pub(super) fn particle_stride(&self, style: &Style) -> u32 {
        self.particle_count.div_ceil(style.particle_limit.max(1)).max(1)
    }

    /// Every n-th line of a kind is drawn; edges are never thinned, they fade with their size on the screen.
    pub(super) fn line_stride(&self, kind: usize, style: &Style) -> u32 {
        if kind == EDGES {
            return 1;
        }
        self.lines[kind].count.div_ceil(style.spring_limit.max(1)).max(1)
    }

    /// Bytes uploaded since the last call.
    pub fn take_uploaded(&mut self) -> u64 {
        std::mem::take(&mut self.uploaded)
    }

    fn bind(&mut self, device: &wgpu::Device, layouts: &Layouts) {
        self.bind_group = bind_cloth(
            device,
            layouts,
            [&self.uniform, &self.motion.positions, &self.normals, &self.flags, &self.values],
        );
        self.normals_group = bind_normals(
            device,
            layouts,
            [&self.motion.positions, &self.triangles, &self.starts, &self.around, &self.normals],
        );
    }
}

fn bind_cloth(device: &wgpu::Device, layouts: &Layouts, buffers: [&Buffer; 5]) -> wgpu::BindGroup {
    bind(device, "cloth", &layouts.cloth, &buffers)
}

fn bind_normals(device: &wgpu::Device, layouts: &Layouts, buffers: [&Buffer; 5]) -> wgpu::BindGroup {
    bind(device, "normals", &layouts.normals, &buffers)
}

fn bind_marked(device: &wgpu::Device, layouts: &Layouts, marked: &Buffer) -> wgpu::BindGroup {
    bind(device, "marked particles", &layouts.marked, &[marked])
}
