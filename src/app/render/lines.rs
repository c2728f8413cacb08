//! Springs by kind and the faces' edges: one draw call a kind, two triangles a line made by the vertex shader.

use super::{
    Cloth, Style, View,
    buffer::Buffer,
    pipeline::{Layouts, Recipe, Target, build, shader},
};

/// Stretch, shear, bend.
pub(super) const KINDS: usize = 3;
/// The edges of the faces, which are the stretch springs in another colour.
pub(super) const EDGES: usize = 3;
const STRETCH: usize = 0;
/// Pixels at which the shader lets edges fade away, and how much longer than the mean one at rest an edge may be.
const FADED: f32 = 6.0;
const STRETCHED: f32 = 4.0;

pub(super) struct Lines {
    pipeline: wgpu::RenderPipeline,
}

impl Lines {
    pub(super) fn new(device: &wgpu::Device, layouts: &Layouts, target: Target) -> Self {
        let module = shader!(device, "common", "cloth", "lines");
        let recipe = Recipe {
            label: "lines",
            module: &module,
            vertex: "vertex",
            fragment: "fragment",
            groups: &[&layouts.view, &layouts.cloth, &layouts.lines],
            depth: (true, wgpu::CompareFunction::Greater),
            bias: (0, 0.0),
            blend: true,
        };
        Self { pipeline: build(device, target, &recipe) }
    }

    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, view: &View, cloth: &Cloth, style: &Style) {
        pass.set_pipeline(&self.pipeline);
        for (kind, set) in cloth.lines.iter().enumerate() {
            let count = set.count / cloth.line_stride(kind, style);
            if style.springs[kind] && cloth.enabled[kind] && count > 0 {
                pass.set_bind_group(2, &set.bind_group, &[]);
                pass.draw(0..6 * count, 0..1);
            }
        }
        // The shader fades edges of few pixels away: where there are many, and even stretched ones are so short, none is drawn
        // at all.
        let set = &cloth.lines[STRETCH];
        let many = set.count > style.spring_limit;
        let seen = !many || STRETCHED * cloth.spacing * view.pixels_per_metre > FADED;
        if let Some(edges) =
            set.edges_group.as_ref().filter(|_| style.edges && style.surface && seen && set.count > 0)
        {
            pass.set_bind_group(2, edges, &[]);
            pass.draw(0..6 * set.count, 0..1);
        }
    }
}

/// The lines of one kind on the device.
pub(super) struct LineSet {
    kind: Buffer,
    pairs: Buffer,
    rest: Buffer,
    bind_group: wgpu::BindGroup,
    /// The same lines as edges, where they are.
    edges: Option<Buffer>,
    edges_group: Option<wgpu::BindGroup>,
    pub(super) count: u32,
}

impl LineSet {
    pub(super) fn new(device: &wgpu::Device, queue: &wgpu::Queue, layouts: &Layouts, kind: usize) -> Self {
        let index_of = |kind: usize| {
            let mut index = Buffer::new(device, "line kind", wgpu::BufferUsages::UNIFORM);
            // A uniform with a vec3 in it is 32 bytes long.
            index.set(device, queue, &[kind as u32, 0, 0, 0, 0, 0, 0, 0], &mut 0);
            index
        };
        let index = index_of(kind);
        let edges = (kind == STRETCH).then(|| index_of(EDGES));
        let pairs = Buffer::new(device, "line pairs", wgpu::BufferUsages::STORAGE);
        let rest = Buffer::new(device, "rest lengths", wgpu::BufferUsages::STORAGE);
        let group = |index: &Buffer| bind(device, layouts, index, &pairs, &rest);
        let (bind_group, edges_group) = (group(&index), edges.as_ref().map(group));
        Self { kind: index, pairs, rest, bind_group, edges, edges_group, count: 0 }
    }

    pub(super) fn set(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        layouts: &Layouts,
        (pairs, rest_lengths): (&[[u32; 2]], &[f32]),
        uploaded: &mut u64,
    ) {
        let new_pairs = self.pairs.set(device, queue, pairs, uploaded);
        let new_rest = self.rest.set(device, queue, rest_lengths, uploaded);
        if new_pairs || new_rest {
            let group = |index: &Buffer| bind(device, layouts, index, &self.pairs, &self.rest);
            (self.bind_group, self.edges_group) = (group(&self.kind), self.edges.as_ref().map(group));
        }
        self.count = pairs.len() as u32;
    }
}

fn bind(
    device: &wgpu::Device,
    layouts: &Layouts,
    kind: &Buffer,
    pairs: &Buffer,
    rest: &Buffer,
) -> wgpu::BindGroup {
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("lines"),
        layout: &layouts.lines,
        entries: &[kind.binding(0), pairs.binding(1), rest.binding(2)],
    })
}
