//! glTF 2.0 with the motion as morph targets: frame 0 is the mesh, every later frame a target, and the weights are
//! animated so that each frame's time shows that frame alone and the time between blends the two around it.
//!
//! Source: Khronos, glTF 2.0 specification, sections 3.7.2.2 (morph targets) and 3.11 (animations).

use super::{Frame, Sink, Span, check_single, single};
use crate::scene::{Pending, Refusal};
use crate::target::{Corner, Surface, Vertex};
use base64::Engine;
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
/// Bytes of a position or a normal.
const VECTOR: u64 = 12;

/// A file of one mesh. What its buffer holds goes to a file without a name first, as the JSON before it depends on all.
pub(super) struct Gltf {
    file: Pending,
    is_binary: bool,
    span: Span,
    surface: Surface,
    /// Vertices of the file: of the surface's corners the distinct ones.
    corners: Vec<Corner>,
    parts: Vec<Part>,
    buffer: Buffer,
    positions: Vec<DVec3>,
    /// Positions and normals of frame 0, as they were written.
    base: Vec<(Vec3, Vec3)>,
    frames: u64,
}

/// Faces of one material, or edges.
#[derive(Default)]
struct Part {
    material: Option<String>,
    is_lines: bool,
    indices: Vec<u32>,
}

impl Gltf {
    pub(super) fn new(path: &Path, surface: Surface, span: Span, is_binary: bool) -> Result<Self, Refusal> {
        let file = Pending::new(path)?;
        let (corners, parts) = parts(&surface);
        let (vertices, frames) = (corners.len() as u64, span.frames());
        let bytes = vertices * (2 * VECTOR * frames + 8) + frames * frames * 4 + 16 * vertices;
        if bytes > u64::from(u32::MAX) / 4 * 3 {
            return Err(file.failed(format!(
                "{vertices} vertices in {frames} frames take {} GB; accepted in one glTF file: 3 GB, fewer frames or a point cache",
                bytes / 1_000_000_000
            )));
        }
        if corners.is_empty() {
            return Err(file.failed("there are no faces and no edges; accepted: a point cache"));
        }
        let buffer = Buffer::new(path).map_err(|e| file.failed(e))?;
        let (positions, base) = Default::default();
        Ok(Self { file, is_binary, span, surface, corners, parts, buffer, positions, base, frames: 0 })
    }

    /// Writes what does not move, once the first frame is known to be there.
    fn begin(&mut self) -> std::io::Result<()> {
        for part in &self.parts {
            let bytes: Vec<u8> = part.indices.iter().flat_map(|i| i.to_le_bytes()).collect();
            let view = self.buffer.view(&bytes, json!({ "target": ELEMENT_ARRAY_BUFFER }))?;
            self.buffer.accessor(view, part.indices.len(), UNSIGNED_INT, "SCALAR", json!({}));
        }
        if !self.surface.uvs.is_empty() {
            let uvs = self.corners.iter().map(|c| c.uv.map_or([0.0; 2], |uv| self.surface.uvs[uv as usize]));
            let bytes: Vec<u8> =
                uvs.flat_map(|[u, v]| [u as f32, (1.0 - v) as f32]).flat_map(f32::to_le_bytes).collect();
            let view = self.buffer.view(&bytes, json!({ "target": ARRAY_BUFFER }))?;
            self.buffer.accessor(view, self.corners.len(), FLOAT, "VEC2", json!({}));
        }
        Ok(())
    }

    /// Unit normals of the surface's vertices: the sum of the faces' normals, each as long as its face is large. What
    /// follows one particle has one normal, also where the texture is cut.
    fn normals(&self) -> Vec<DVec3> {
        let key = |vertex: usize| match self.surface.vertices[vertex] {
            Vertex::Follows(particle) => particle as usize,
            Vertex::Stays(_) => self.surface.particles() + vertex,
        };
        let keys: Vec<usize> = (0..self.surface.vertices.len()).map(key).collect();
        let mut sums = vec![DVec3::ZERO; keys.iter().max().map_or(0, |most| most + 1)];
        for (face, _) in self.surface.faces() {
            let place = |c: &Corner| self.positions[c.vertex as usize];
            let first = place(&face[0]);
            let fan = face.windows(2).map(|side| (place(&side[0]) - first).cross(place(&side[1]) - first));
            let normal: DVec3 = fan.sum();
            face.iter().for_each(|c| sums[keys[c.vertex as usize]] += normal);
        }
        keys.iter().map(|key| sums[*key].try_normalize().unwrap_or(DVec3::Y)).collect()
    }

    fn write_frame(&mut self) -> std::io::Result<()> {
        let normals = self.normals();
        let shown = self.corners.iter().map(|c| c.vertex as usize);
        let shown: Vec<(DVec3, DVec3)> = shown.map(|v| (self.positions[v], normals[v])).collect();
        let shown: Vec<(Vec3, Vec3)> = if self.frames == 0 {
            self.begin()?;
            self.base = shown.iter().map(|(p, n)| (p.as_vec3(), n.as_vec3())).collect();
            self.base.clone()
        } else {
            // From what was written as the base: its rounding is made good.
            let moved = |((p, n), base): (&(DVec3, DVec3), &(Vec3, Vec3))| {
                ((*p - base.0.as_dvec3()).as_vec3(), (*n - base.1.as_dvec3()).as_vec3())
            };
            shown.iter().zip(&self.base).map(moved).collect()
        };
        let low = shown.iter().fold(Vec3::INFINITY, |low, (p, _)| low.min(*p));
        let high = shown.iter().fold(Vec3::NEG_INFINITY, |high, (p, _)| high.max(*p));
        let bytes: Vec<u8> = shown.iter().flat_map(|(p, _)| single(p.as_dvec3())).collect();
        let options = json!({ "target": ARRAY_BUFFER, "byteStride": VECTOR });
        let view = self.buffer.view(&bytes, options.clone())?;
        let bounds = json!({ "min": low.to_array(), "max": high.to_array() });
        self.buffer.accessor(view, shown.len(), FLOAT, "VEC3", bounds);
        let bytes: Vec<u8> = shown.iter().flat_map(|(_, n)| single(n.as_dvec3())).collect();
        let view = self.buffer.view(&bytes, options)?;
        self.buffer.accessor(view, shown.len(), FLOAT, "VEC3", json!({}));
        self.frames += 1;
        Ok(())
    }

    /// Writes the animation's times and weights, and answers with the document.
    fn document(&mut self) -> std::io::Result<Value> {
        let targets = self.frames - 1;
        let has_uvs = !self.surface.uvs.is_empty();
        let uvs = self.parts.len();
        let base = uvs + usize::from(has_uvs);
        let shape = |frame: u64| {
            let at = base + 2 * frame as usize;
            json!({ "POSITION": at, "NORMAL": at + 1 })
        };
        let mut attributes = shape(0);
        if has_uvs {
            attributes["TEXCOORD_0"] = json!(uvs);
        }
        let shapes: Vec<Value> = (1..self.frames).map(shape).collect();
        let mut materials = Vec::new();
        let mut primitives = Vec::new();
        for (at, part) in self.parts.iter().enumerate() {
            let mut primitive = json!({ "attributes": attributes, "indices": at, "material": at });
            if targets > 0 {
                primitive["targets"] = json!(shapes);
            }
            if part.is_lines {
                primitive["mode"] = json!(1);
            } else {
                primitive["extensions"] = json!({ "FB_ngon_encoding": {} });
            }
            primitives.push(primitive);
            let name = part.material.as_deref().unwrap_or("cloth");
            let surface = json!({ "baseColorFactor": [0.8, 0.8, 0.8, 1.0], "metallicFactor": 0.0 });
            materials.push(json!({ "name": name, "doubleSided": true, "pbrMetallicRoughness": surface }));
        }
        let mut mesh = json!({ "name": "cloth", "primitives": primitives });
        let mut animations = Vec::new();
        if targets > 0 {
            mesh["weights"] = json!(vec![0.0; targets as usize]);
            let times: Vec<f32> = (0..self.frames).map(|n| self.span.time(n) as f32).collect();
            let bytes: Vec<u8> = times.iter().flat_map(|t| t.to_le_bytes()).collect();
            let view = self.buffer.view(&bytes, json!({}))?;
            let bounds = json!({ "min": [times[0]], "max": [times[times.len() - 1]] });
            let input = self.buffer.accessor(view, times.len(), FLOAT, "SCALAR", bounds);
            let weights =
                (0..self.frames).flat_map(|n| (1..=targets).map(move |t| f32::from(u8::from(t == n))));
            let count = (self.frames * targets) as usize;
            let bytes: Vec<u8> = weights.flat_map(f32::to_le_bytes).collect();
            let view = self.buffer.view(&bytes, json!({}))?;
            let output = self.buffer.accessor(view, count, FLOAT, "SCALAR", json!({}));
            animations.push(json!({
                "name": "simulation",
                "samplers": [{ "input": input, "output": output, "interpolation": "LINEAR" }],
                "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
            }));
        }
        let mut document = json!({
            "asset": { "version": "2.0", "generator": concat!("Tenter ", env!("CARGO_PKG_VERSION")) },
            "extensionsUsed": ["FB_ngon_encoding"],
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "name": "cloth", "mesh": 0 }],
            "meshes": [mesh],
            "materials": materials,
            "accessors": self.buffer.accessors,
            "bufferViews": self.buffer.views,
            "buffers": [{ "byteLength": self.buffer.length }],
        });
        if !animations.is_empty() {
            document["animations"] = json!(animations);
        }
        if self.parts.iter().all(|part| part.is_lines) {
            document.as_object_mut().map(|d| d.remove("extensionsUsed"));
        }
        Ok(document)
    }

    fn write(&mut self) -> std::io::Result<()> {
        let mut document = self.document()?;
        self.buffer.bytes.seek(SeekFrom::Start(0))?;
        let mut to = BufWriter::new(self.file.file());
        if self.is_binary {
            let mut text = serde_json::to_vec(&document)?;
            text.resize(text.len().next_multiple_of(4), b' ');
            let lengths = [text.len() as u64, self.buffer.length];
            let whole = u32::try_from(12 + 8 + lengths[0] + 8 + lengths[1]);
            let whole = whole.map_err(|_| std::io::Error::other("over 4 GB, more than a GLB can hold"))?;
            to.write_all(b"glTF\x02\0\0\0")?;
            to.write_all(&whole.to_le_bytes())?;
            to.write_all(&(lengths[0] as u32).to_le_bytes())?;
            to.write_all(b"JSON")?;
            to.write_all(&text)?;
            to.write_all(&(lengths[1] as u32).to_le_bytes())?;
            to.write_all(b"BIN\0")?;
            std::io::copy(&mut self.buffer.bytes, &mut to)?;
        } else {
            let mut bytes = Vec::new();
            self.buffer.bytes.read_to_end(&mut bytes)?;
            let data = base64::engine::general_purpose::STANDARD.encode(bytes);
            document["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{data}"));
            serde_json::to_writer(&mut to, &document)?;
        }
        to.flush()
    }
}

impl Sink for Gltf {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), Refusal> {
        self.surface.place(frame.positions, &mut self.positions);
        check_single(&self.positions).map_err(|e| self.file.failed(e))?;
        self.write_frame().map_err(|e| self.file.failed(e))
    }

    fn finish(mut self: Box<Self>) -> Result<(), Refusal> {
        self.write().map_err(|e| self.file.failed(e))?;
        self.file.keep()
    }
}

/// The distinct corners of a surface, and its faces by material as indices of these.
///
/// Faces become fans of triangles by the rule of `FB_ngon_encoding`: the triangles of one face begin at the same corner,
/// those of the next face at another, so that a reader can put the faces together again.
fn parts(surface: &Surface) -> (Vec<Corner>, Vec<Part>) {
    let mut corners = Vec::new();
    let mut numbers = HashMap::new();
    let mut number = |corner: Corner| {
        *numbers.entry(corner).or_insert_with(|| {
            corners.push(corner);
            corners.len() as u32 - 1
        })
    };
    let mut parts: Vec<Part> = Vec::new();
    let mut by_material = HashMap::new();
    for (face, section) in surface.faces() {
        let material = surface.sections[section as usize].material.as_deref();
        let part = *by_material.entry(material).or_insert_with(|| {
            parts.push(Part { material: material.map(str::to_owned), ..Part::default() });
            parts.len() - 1
        });
        let indices = &mut parts[part].indices;
        let last_start = indices.len().checked_sub(3).map(|i| indices[i]);
        let mut fan: Vec<u32> = face.iter().map(|corner| number(*corner)).collect();
        if Some(fan[0]) == last_start {
            fan.rotate_left(1);
        }
        for side in fan[1..].windows(2) {
            indices.extend([fan[0], side[0], side[1]]);
        }
    }
    if !surface.edges.is_empty() {
        let mut end =
            |vertex: u32| number(Corner { vertex, uv: (!surface.uvs.is_empty()).then_some(vertex) });
        let indices = surface.edges.iter().flatten().map(|vertex| end(*vertex)).collect();
        parts.push(Part { is_lines: true, indices, ..Part::default() });
    }
    (corners, parts)
}

/// What the buffer holds, and where.
struct Buffer {
    bytes: File,
    length: u64,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffer {
    /// Beside the file to be: there is room where that shall be.
    fn new(path: &Path) -> std::io::Result<Self> {
        let beside = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Ok(Self {
            bytes: tempfile::tempfile_in(beside)?,
            length: 0,
            views: Vec::new(),
            accessors: Vec::new(),
        })
    }

    /// Appends bytes, a multiple of 4, as a view; answers with its number.
    fn view(&mut self, bytes: &[u8], options: Value) -> std::io::Result<usize> {
        self.bytes.write_all(bytes)?;
        let mut view = options;
        view["buffer"] = json!(0);
        view["byteOffset"] = json!(self.length);
        view["byteLength"] = json!(bytes.len());
        self.length += bytes.len() as u64;
        self.views.push(view);
        Ok(self.views.len() - 1)
    }

    fn accessor(&mut self, view: usize, count: usize, component: u32, shape: &str, options: Value) -> usize {
        let mut accessor = options;
        accessor["bufferView"] = json!(view);
        accessor["count"] = json!(count);
        accessor["componentType"] = json!(component);
        accessor["type"] = json!(shape);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}
