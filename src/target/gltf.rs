//! Reads glTF 2.0, as JSON or binary: the triangles of every mesh that the default scene shows, and where its nodes put them.
//!
//! The container and the constants come from the `gltf` crate. Its document is not used: it takes up to 200 bytes of memory for a
//! byte of JSON, panics on references out of range, and knows no `KHR_mesh_quantization`. What is read here is a small part of the
//! format, and every number in it is checked before it is used.
//!
//! Source: Khronos, glTF 2.0 specification.

mod surface;

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use base64::{DecodeError, Engine as _};
use glam::{DMat4, DQuat, DVec3};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::mesh::Mode;
use gltf::json::validation::Checked;
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::QuadMesh;
pub(super) use surface::{Faces, Shown};

const QUANTIZATION: &str = "KHR_mesh_quantization";
const NGON_ENCODING: &str = "FB_ngon_encoding";
/// Extensions that a file may require; these say nothing about where the vertices are.
const SUPPORTED: [&str; 9] = [
    QUANTIZATION,
    NGON_ENCODING,
    "KHR_materials_unlit",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_variants",
];

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Document {
    asset: Asset,
    #[serde(default)]
    extensions_used: Vec<String>,
    #[serde(default)]
    extensions_required: Vec<String>,
    scene: Option<u32>,
    #[serde(default)]
    scenes: Vec<SceneNodes>,
    #[serde(default)]
    nodes: Vec<Node>,
    #[serde(default)]
    meshes: Vec<Mesh>,
    #[serde(default)]
    materials: Vec<Material>,
    #[serde(default)]
    accessors: Vec<Accessor>,
    #[serde(default)]
    buffer_views: Vec<View>,
    #[serde(default)]
    buffers: Vec<Buffer>,
}

#[derive(Deserialize)]
struct Asset {
    version: String,
}

#[derive(Deserialize)]
struct SceneNodes {
    #[serde(default)]
    nodes: Vec<u32>,
}

/// Boxed, as an empty node is three bytes of JSON.
#[derive(Deserialize)]
struct Node {
    #[serde(default)]
    children: Box<[u32]>,
    mesh: Option<u32>,
    matrix: Option<Box<[f64; 16]>>,
    translation: Option<Box<[f64; 3]>>,
    rotation: Option<Box<[f64; 4]>>,
    scale: Option<Box<[f64; 3]>>,
    skin: Option<IgnoredAny>,
}

#[derive(Deserialize)]
struct Material {
    name: Option<String>,
}

#[derive(Deserialize)]
struct Mesh {
    name: Option<String>,
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
struct Primitive {
    attributes: Attributes,
    indices: Option<u32>,
    mode: Option<Checked<Mode>>,
    material: Option<u32>,
    #[serde(default)]
    targets: Vec<IgnoredAny>,
}

#[derive(Deserialize)]
struct Attributes {
    #[serde(rename = "POSITION")]
    position: Option<u32>,
    #[serde(rename = "TEXCOORD_0")]
    texcoord: Option<u32>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<u32>,
    #[serde(default)]
    byte_offset: u64,
    component_type: Checked<GenericComponentType>,
    #[serde(default)]
    normalized: bool,
    count: u64,
    #[serde(rename = "type")]
    shape: Checked<Type>,
    sparse: Option<Box<Sparse>>,
}

#[derive(Deserialize)]
struct Sparse {
    count: u64,
    indices: SparsePart,
    values: SparsePart,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct SparsePart {
    buffer_view: u32,
    #[serde(default)]
    byte_offset: u64,
    component_type: Option<Checked<GenericComponentType>>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: u32,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: Option<u64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Buffer {
    byte_length: u64,
    uri: Option<String>,
}

/// A file whose JSON was read; buffers are loaded when a mesh needs them.
pub(super) struct Scene<'a> {
    document: Document,
    /// The binary part of a `.glb`, which is buffer 0 where that has no uri.
    binary: Option<&'a [u8]>,
    folder: Option<&'a Path>,
    elements_left: Cell<usize>,
    loaded: Vec<OnceCell<Rc<[u8]>>>,
    /// Files in the folder, so that one which many buffers name is in memory once.
    files: RefCell<HashMap<PathBuf, Rc<[u8]>>>,
}

/// One mesh in one place.
pub(super) struct Instance {
    pub mesh: usize,
    pub transform: DMat4,
    /// Whether a skin would bend it.
    pub is_skinned: bool,
}

/// Vertices and corners that any file may bring beside one for each of its bytes: for many copies of a small mesh.
const FREE_ELEMENTS: usize = 1 << 18;

impl<'a> Scene<'a> {
    /// Reads the JSON of a file, binary or not, whatever it is called.
    pub(super) fn read(bytes: &'a [u8], folder: Option<&'a Path>) -> Result<Self, String> {
        let (json, binary) = if bytes.starts_with(b"glTF") { split_binary(bytes)? } else { (bytes, None) };
        let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
        let json = std::str::from_utf8(json)
            .map_err(|e| format!("JSON: byte {} is not UTF-8, which would be accepted", e.valid_up_to()))?;
        let document: Document = serde_json::from_str(json.trim_end_matches('\0'))
            .map_err(|e| format!("JSON: {e}; a glTF 2.0 document would be accepted"))?;
        let unsupported: Vec<_> = document
            .extensions_required
            .iter()
            .filter(|e| !SUPPORTED.contains(&e.as_str()))
            .map(|e| shown(e))
            .take(8)
            .collect();
        if !unsupported.is_empty() {
            return Err(format!(
                "extensionsRequired: {} is not supported; a file without it, or with {QUANTIZATION}, would be accepted",
                unsupported.join(", ")
            ));
        }
        if document.asset.version.split('.').next() != Some("2") {
            let version = shown(&document.asset.version);
            return Err(format!("asset.version {version} is not supported; \"2.0\" would be accepted"));
        }
        let loaded = (0..document.buffers.len()).map(|_| OnceCell::new()).collect();
        Ok(Self {
            document,
            binary,
            folder,
            elements_left: (bytes.len() + FREE_ELEMENTS).into(),
            loaded,
            files: HashMap::new().into(),
        })
    }

    pub(super) fn mesh_count(&self) -> usize {
        self.document.meshes.len()
    }

    /// Whether the file declares its polygons.
    pub(super) fn ngon_encoding(&self) -> bool {
        self.document.extensions_used.iter().any(|e| e == NGON_ENCODING)
    }

    /// Accounts for vertices and corners before there is memory for them. A file of a few bytes can name the same data again and
    /// again, or claim billions of zeros; honest files have less than one element a byte.
    pub(super) fn spend(&self, elements: usize) -> Result<(), String> {
        let left = self.elements_left.get();
        let after = left.checked_sub(elements).ok_or_else(|| {
            format!("{elements} more vertices and corners are refused; for a file of this size {left} more would be accepted")
        })?;
        self.elements_left.set(after);
        Ok(())
    }

    /// The meshes that the default scene shows, depth first. Without a scene, all root nodes are shown.
    pub(super) fn instances(&self) -> Result<Vec<Instance>, String> {
        let nodes = &self.document.nodes;
        let roots: Vec<u32> = match (self.document.scene, self.document.scenes.as_slice()) {
            (None, []) => {
                let mut is_child = vec![false; nodes.len()];
                for child in nodes.iter().flat_map(|n| n.children.iter()) {
                    if let Some(is_child) = is_child.get_mut(*child as usize) {
                        *is_child = true;
                    }
                }
                (0..nodes.len() as u32).filter(|n| !is_child[*n as usize]).collect()
            }
            (scene, scenes) => element(scenes, scene.unwrap_or(0), "scene", "scene")?.nodes.clone(),
        };
        let mut instances = Vec::new();
        let mut visited = vec![false; nodes.len()];
        // The nodes from a root down to where the walk stands: transform, and the children that are left to visit.
        let mut way: Vec<(DMat4, std::slice::Iter<u32>)> = vec![(DMat4::IDENTITY, roots.iter())];
        while let Some((parent, children)) = way.last_mut() {
            let Some(child) = children.next() else {
                way.pop();
                continue;
            };
            let node = element(nodes, *child, "node", "scene or node")?;
            if std::mem::replace(&mut visited[*child as usize], true) {
                return Err(format!(
                    "node {child} is reached twice: nodes that form a tree would be accepted"
                ));
            }
            let transform = *parent * node.transform();
            if !transform.is_finite() {
                return Err(format!(
                    "node {child}: its transform is not finite; finite numbers would be accepted"
                ));
            }
            if let Some(mesh) = node.mesh {
                element(&self.document.meshes, mesh, "mesh", &format!("node {child}"))?;
                instances.push(Instance { mesh: mesh as usize, transform, is_skinned: node.skin.is_some() });
            }
            if !node.children.is_empty() {
                way.push((transform, node.children.iter()));
            }
        }
        Ok(instances)
    }

    /// The triangles of one mesh in its own space, all primitives together, as they stand in the file; and which
    /// primitives these are.
    pub(super) fn triangles(
        &self,
        mesh: usize,
        warnings: &mut Vec<String>,
    ) -> Result<(QuadMesh, Vec<Shown>), String> {
        let mut shown = Vec::new();
        let mut whole = QuadMesh::default();
        for (p, primitive) in self.document.meshes[mesh].primitives.iter().enumerate() {
            let place = format!("mesh {mesh} primitive {p}");
            let mode = match primitive.mode {
                None => Mode::Triangles,
                Some(Checked::Valid(mode)) => mode,
                Some(Checked::Invalid) => {
                    return Err(format!(
                        "{place}: its mode is not known; 4 (triangles), 5 or 6 would be accepted"
                    ));
                }
            };
            if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
                warnings.push(format!("{place} holds {mode:?}, which is not cloth, and was left out"));
                continue;
            }
            let Some(position) = primitive.attributes.position else {
                return Err(format!("{place} has no POSITION; vertices with positions would be accepted"));
            };
            let first = whole.positions.len() as u32;
            shown.push(Shown { primitive: p, first });
            if !primitive.targets.is_empty() {
                warnings.push(format!(
                    "{place} has {} morph targets, which are not read: the cloth starts in the base shape",
                    primitive.targets.len()
                ));
            }
            self.read_positions(position, &place, &mut whole.positions)?;
            let count = whole.positions.len() as u32 - first;
            let corners = match primitive.indices {
                Some(indices) => self.read_indices(indices, &place, count)?,
                None => (0..count).collect(),
            };
            let corner = |i: usize| corners[i] + first;
            let before = whole.face_count();
            match mode {
                Mode::TriangleStrip => {
                    // Every other triangle of a strip is wound the other way.
                    let strip =
                        (2..corners.len()).map(|i| [corner(i - 2 + i % 2), corner(i - 1 - i % 2), corner(i)]);
                    // Strips are linked by triangles without area.
                    let strip = strip.filter(|[a, b, c]| a != b && b != c && c != a);
                    strip.for_each(|triangle| whole.push_face(&triangle));
                }
                Mode::TriangleFan => {
                    (2..corners.len()).for_each(|i| whole.push_face(&[corner(0), corner(i - 1), corner(i)]));
                }
                _ => {
                    let (triangles, left) = corners.as_chunks::<3>();
                    if !left.is_empty() {
                        warnings.push(format!(
                            "{place} has {} corners, which is not a multiple of 3; the last {} were left out",
                            corners.len(),
                            left.len()
                        ));
                    }
                    triangles.iter().for_each(|triangle| whole.push_face(&triangle.map(|c| c + first)));
                }
            }
            if whole.face_count() == before {
                warnings.push(format!("{place} holds no triangle"));
            }
        }
        Ok((whole, shown))
    }

    fn read_positions(&self, accessor: u32, place: &str, positions: &mut Vec<DVec3>) -> Result<(), String> {
        let data = element(&self.document.accessors, accessor, "accessor", place)?;
        let place = format!("{place} POSITION (accessor {accessor})");
        let (Checked::Valid(Type::Vec3), Checked::Valid(GenericComponentType(component))) =
            (data.shape, data.component_type)
        else {
            return Err(format!("{place} is no VEC3 of a known component type, which would be accepted"));
        };
        let is_quantized = matches!(
            component,
            ComponentType::I8 | ComponentType::U8 | ComponentType::I16 | ComponentType::U16
        );
        let document = &self.document;
        let declared = || document.extensions_used.iter().chain(&document.extensions_required);
        if component != ComponentType::F32 && !(is_quantized && declared().any(|e| e == QUANTIZATION)) {
            return Err(format!(
                "{place} holds {component:?}; F32, or 8 or 16 bits with {QUANTIZATION}, would be accepted"
            ));
        }
        let number = component_reader(component, data.normalized);
        let size = component.size();
        let vector = |bytes: &[u8]| DVec3::from([0, 1, 2].map(|axis| number(&bytes[axis * size..])));
        let read = self.read_accessor(data, 3 * size, &place, vector)?;
        if let Some(bad) = read.iter().position(|p| !p.is_finite()) {
            return Err(format!("{place}: vertex {bad} is {}; finite numbers would be accepted", read[bad]));
        }
        if positions.is_empty() {
            *positions = read;
        } else {
            positions.extend(read);
        }
        Ok(())
    }

    /// Corners of the primitive's triangles, each below `vertices`.
    fn read_indices(&self, accessor: u32, place: &str, vertices: u32) -> Result<Vec<u32>, String> {
        let data = element(&self.document.accessors, accessor, "accessor", place)?;
        let place = format!("{place} indices (accessor {accessor})");
        let (Checked::Valid(Type::Scalar), Checked::Valid(GenericComponentType(component))) =
            (data.shape, data.component_type)
        else {
            return Err(format!("{place} is no SCALAR of a known component type, which would be accepted"));
        };
        let (size, number) = index_reader(component, &place)?;
        let read = self.read_accessor(data, size, &place, number)?;
        if let Some(bad) = read.iter().position(|i| *i >= vertices) {
            return Err(format!(
                "{place}: index {} at {bad} names no vertex; the primitive has {vertices}, so 0 to {} would be accepted",
                read[bad],
                vertices - 1
            ));
        }
        Ok(read)
    }

    /// All elements of an accessor, `size` bytes each; sparse ones replaced.
    fn read_accessor<T: Default + Clone>(
        &self,
        accessor: &Accessor,
        size: usize,
        place: &str,
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, String> {
        if accessor.count == 0 {
            return Err(format!("{place} has count 0; at least 1 would be accepted"));
        }
        let count = usize::try_from(accessor.count).unwrap_or(usize::MAX);
        let mut elements = match accessor.buffer_view {
            None => {
                self.spend(count).map_err(|e| format!("{place} without a bufferView: {e}"))?;
                vec![T::default(); count]
            }
            Some(view) => {
                let items = self.items(view, accessor.byte_offset, count, size, place)?;
                self.spend(count).map_err(|e| format!("{place}: {e}"))?;
                items.map(&decode).collect()
            }
        };
        let Some(sparse) = &accessor.sparse else { return Ok(elements) };
        let place = format!("{place} sparse");
        let Some(Checked::Valid(GenericComponentType(component))) = sparse.indices.component_type else {
            return Err(format!(
                "{place} indices have no known component type; 5121, 5123 or 5125 would be accepted"
            ));
        };
        let replaced = usize::try_from(sparse.count).unwrap_or(usize::MAX);
        if replaced > count {
            return Err(format!(
                "{place} count {replaced} is more than the {count} elements that would be accepted"
            ));
        }
        let (index_size, index) = index_reader(component, &place)?;
        let indices =
            self.items(sparse.indices.buffer_view, sparse.indices.byte_offset, replaced, index_size, &place)?;
        let values =
            self.items(sparse.values.buffer_view, sparse.values.byte_offset, replaced, size, &place)?;
        for (at, value) in indices.map(index).zip(values) {
            *elements.get_mut(at as usize).ok_or_else(|| {
                format!("{place} index {at} is out of range; 0 to {} would be accepted", count - 1)
            })? = decode(value);
        }
        Ok(elements)
    }

    /// The bytes of `count` items of `size` bytes each in a buffer view.
    fn items(
        &self,
        view: u32,
        offset: u64,
        count: usize,
        size: usize,
        place: &str,
    ) -> Result<impl Iterator<Item = &[u8]>, String> {
        let data = element(&self.document.buffer_views, view, "bufferView", place)?;
        let buffer = self.buffer(data.buffer, &format!("bufferView {view}"))?;
        let inside = |from: u64, length: u64, whole: &'_ [u8]| {
            let end = from.checked_add(length)?;
            (end <= whole.len() as u64).then_some(from as usize..end as usize)
        };
        let range = inside(data.byte_offset, data.byte_length, buffer).ok_or_else(|| {
            format!(
                "bufferView {view}: {} bytes from {} run past buffer {}; up to {} would be accepted",
                data.byte_length,
                data.byte_offset,
                data.buffer,
                buffer.len()
            )
        })?;
        let bytes = &buffer[range];
        let stride = data.byte_stride.unwrap_or(size as u64);
        if stride < size as u64 || stride > 252 {
            return Err(format!(
                "bufferView {view}: byteStride {stride} is refused; {size} to 252 would be accepted"
            ));
        }
        let length = match count {
            0 => Some(0),
            _ => (count as u64 - 1).checked_mul(stride).and_then(|l| l.checked_add(size as u64)),
        };
        let range = length.and_then(|length| inside(offset, length, bytes)).ok_or_else(|| {
            format!(
                "{place}: {count} elements from byte {offset} run past bufferView {view}; up to {} bytes would be accepted",
                bytes.len()
            )
        })?;
        // The last item may be shorter than the stride.
        Ok(bytes[range].chunks(stride as usize).map(move |chunk| &chunk[..size]))
    }

    fn buffer(&self, index: u32, place: &str) -> Result<&[u8], String> {
        let buffer = element(&self.document.buffers, index, "buffer", place)?;
        let cell = &self.loaded[index as usize];
        let bytes = match (&buffer.uri, cell.get(), self.binary) {
            (_, Some(loaded), _) => loaded,
            (None, _, Some(binary)) if index == 0 => binary,
            (None, ..) => {
                return Err(format!(
                    "buffer {index} has no data; a uri, or the binary chunk of a .glb, would be accepted"
                ));
            }
            (Some(uri), None, _) => {
                let bytes = self.load(uri).map_err(|e| format!("buffer {index}: {e}"))?;
                cell.get_or_init(|| bytes)
            }
        };
        usize::try_from(buffer.byte_length).ok().and_then(|length| bytes.get(..length)).ok_or_else(|| {
            format!(
                "buffer {index}: byteLength {} is more than the {} bytes that are there, which would be accepted",
                buffer.byte_length,
                bytes.len()
            )
        })
    }

    fn load(&self, uri: &str) -> Result<Rc<[u8]>, String> {
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded = data.split_once(',').filter(|(kind, _)| kind.ends_with(";base64"));
            let (_, text) =
                encoded.ok_or("a data uri without base64; `data:...;base64,...` would be accepted")?;
            return Ok(decode_base64(text)?.into());
        }
        let path = self.path_in_folder(uri)?;
        if let Some(bytes) = self.files.borrow().get(&path) {
            return Ok(bytes.clone());
        }
        let bytes: Rc<[u8]> = std::fs::read(&path).map_err(|e| format!("uri {}: {e}", shown(uri)))?.into();
        self.elements_left.set(self.elements_left.get() + bytes.len());
        self.files.borrow_mut().insert(path, bytes.clone());
        Ok(bytes)
    }

    /// The file that a uri names, if it really lies in the mesh file's folder, symbolic links followed.
    fn path_in_folder(&self, uri: &str) -> Result<PathBuf, String> {
        let refused = |why: &str| {
            format!("uri {} {why}; a file beside the mesh, or a data uri, would be accepted", shown(uri))
        };
        let decoded = percent_decode(uri).ok_or_else(|| refused("is not UTF-8 when decoded"))?;
        let path = Path::new(&decoded);
        let is_plain = !decoded.contains([':', '\\', '\0'])
            && path.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
        if !is_plain {
            return Err(refused("leads out of the mesh's folder"));
        }
        let folder = self.folder.ok_or_else(|| refused("cannot be opened: the mesh is not in a folder"))?;
        let missing = |e: std::io::Error| refused(&format!("cannot be read ({e})"));
        let folder = folder.canonicalize().map_err(missing)?;
        let path = folder.join(path).canonicalize().map_err(missing)?;
        if !path.starts_with(&folder) {
            return Err(refused("leads out of the mesh's folder"));
        }
        if !path.is_file() {
            return Err(refused("is not a plain file"));
        }
        Ok(path)
    }
}

impl Node {
    /// Translation * rotation * scale, or the matrix (columns first).
    fn transform(&self) -> DMat4 {
        if let Some(matrix) = &self.matrix {
            return DMat4::from_cols_array(matrix);
        }
        let translation = self.translation.as_deref().copied().map_or(DVec3::ZERO, DVec3::from);
        let scale = self.scale.as_deref().copied().map_or(DVec3::ONE, DVec3::from);
        let rotation = self.rotation.as_deref().copied().map_or(DQuat::IDENTITY, DQuat::from_array);
        // Unit quaternions are written in single precision.
        let rotation = if rotation.length() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
        DMat4::from_scale_rotation_translation(scale, rotation, translation)
    }
}

/// Splits a binary file into its JSON and its binary part.
fn split_binary(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let refused = |why: String| format!("GLB: {why}; a whole binary glTF 2.0 file would be accepted");
    let header: [u8; 12] = bytes
        .first_chunk()
        .copied()
        .ok_or_else(|| refused(format!("{} bytes are too few for its header", bytes.len())))?;
    let length = u32::from_le_bytes(array(&header[8..]));
    // The crate subtracts the header's size before it looks.
    if (length as usize) < header.len() {
        return Err(refused(format!("length {length} is less than its header")));
    }
    let whole = bytes.get(..length as usize);
    let whole =
        whole.ok_or_else(|| refused(format!("length {length} is more than its {} bytes", bytes.len())))?;
    let glb = gltf::Glb::from_slice(whole).map_err(|e| refused(e.to_string()))?;
    match (glb.json, glb.bin) {
        (std::borrow::Cow::Borrowed(json), None) => Ok((json, None)),
        (std::borrow::Cow::Borrowed(json), Some(std::borrow::Cow::Borrowed(binary))) => {
            Ok((json, Some(binary)))
        }
        _ => Err(refused("its chunks are not in the file".to_owned())),
    }
}

/// An element that something refers to by its number.
fn element<'e, T>(all: &'e [T], index: u32, kind: &str, place: &str) -> Result<&'e T, String> {
    all.get(index as usize).ok_or_else(|| {
        format!("{place} names {kind} {index}, which does not exist; the file has {}", all.len())
    })
}

/// Size in bytes of an index of this type, and how it is read.
fn index_reader(component: ComponentType, place: &str) -> Result<(usize, impl Fn(&[u8]) -> u32), String> {
    if !matches!(component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) {
        return Err(format!("{place} holds {component:?} as indices; U8, U16 or U32 would be accepted"));
    }
    let size = component.size();
    let number = move |bytes: &[u8]| match size {
        1 => bytes[0].into(),
        2 => u16::from_le_bytes(array(bytes)).into(),
        _ => u32::from_le_bytes(array(bytes)),
    };
    Ok((size, number))
}

/// The first N bytes of a slice that is known to be long enough.
fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    std::array::from_fn(|i| bytes[i])
}

/// How one component is read. Normalised integers: glTF 2.0 section 3.11, signed ones are clamped at -1.
fn component_reader(component: ComponentType, normalised: bool) -> impl Fn(&[u8]) -> f64 {
    move |bytes| match component {
        ComponentType::F32 => f64::from(f32::from_le_bytes(array(bytes))),
        ComponentType::I8 => scaled(i8::from_le_bytes(array(bytes)).into(), 127.0, normalised),
        ComponentType::U8 => scaled(u8::from_le_bytes(array(bytes)).into(), 255.0, normalised),
        ComponentType::I16 => scaled(i16::from_le_bytes(array(bytes)).into(), 32767.0, normalised),
        ComponentType::U16 => scaled(u16::from_le_bytes(array(bytes)).into(), 65535.0, normalised),
        ComponentType::U32 => u32::from_le_bytes(array(bytes)).into(),
    }
}

fn scaled(integer: f64, highest: f64, normalised: bool) -> f64 {
    if normalised { (integer / highest).max(-1.0) } else { integer }
}

/// A piece of the file's text for a message: quoted, escaped and short.
fn shown(text: &str) -> String {
    let short: String = text.chars().take(60).collect();
    let dots = if short.len() < text.len() { "..." } else { "" };
    format!("\"{}{dots}\"", short.escape_debug())
}

fn percent_decode(uri: &str) -> Option<String> {
    let mut decoded = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [byte, after @ ..] = rest {
        rest = after;
        if *byte == b'%' {
            let digits = after.first_chunk::<2>()?;
            let digit = |d: u8| char::from(d).to_digit(16);
            decoded.push((digit(digits[0])? * 16 + digit(digits[1])?) as u8);
            rest = &after[2..];
        } else {
            decoded.push(*byte);
        }
    }
    String::from_utf8(decoded).ok()
}

/// RFC 4648 section 4; the padding may be missing.
fn decode_base64(text: &str) -> Result<Vec<u8>, String> {
    const PLAIN: GeneralPurpose = GeneralPurpose::new(
        &STANDARD,
        GeneralPurposeConfig::new()
            .with_decode_padding_mode(DecodePaddingMode::RequireNone)
            .with_decode_allow_trailing_bits(true),
    );
    let text = text.trim_end_matches('=');
    PLAIN.decode(text).map_err(|error| match error {
        DecodeError::InvalidByte(at, symbol) => {
            let symbol = char::from(symbol).escape_debug();
            format!("base64 symbol `{symbol}` at {at} is refused; A-Z a-z 0-9 + / would be accepted")
        }
        _ => "base64 text is cut in the middle of a byte; whole bytes would be accepted".to_owned(),
    })
}
