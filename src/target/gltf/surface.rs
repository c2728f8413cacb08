//! The surface of one mesh of a glTF file: its vertices in their order, the faces that its triangles make, texture
//! coordinates and materials.

use super::{Checked, ComponentType, GenericComponentType, Scene, Type, component_reader, element};
use crate::target::QuadMesh;
use crate::target::surface::{Corner, Section, Surface, Vertex};
use glam::DVec3;
use std::sync::Arc;

/// A primitive that became part of the cloth.
pub(in crate::target) struct Shown {
    /// Its place in the mesh.
    pub primitive: usize,
    /// The number of its first vertex among those of the mesh.
    pub first: u32,
}

/// What became of the triangles of a mesh.
pub(in crate::target) struct Faces<'a> {
    /// Their vertices.
    pub positions: &'a [DVec3],
    /// The particle of each vertex; `u32::MAX` for none.
    pub particles: &'a [u32],
    /// The triangles that were kept, as vertices.
    pub triangles: &'a [[u32; 3]],
    /// The mesh with its quads back.
    pub mesh: &'a QuadMesh,
    /// The one or two triangles of each of its faces.
    pub sources: &'a [[u32; 2]],
}

impl Scene<'_> {
    /// The surface of a mesh in its own space. Texture coordinates that are malformed are left out.
    pub(in crate::target) fn surface(&self, mesh: usize, shown: &[Shown], faces: &Faces) -> Surface {
        let mut surface = Surface::default();
        surface.vertices.extend(faces.particles.iter().zip(faces.positions).map(|(particle, at)| {
            if *particle == u32::MAX { Vertex::Stays(*at) } else { Vertex::Follows(*particle) }
        }));
        // Of each primitive the number of its first texture coordinate.
        let mut first_uvs = Vec::with_capacity(shown.len());
        for (at, Shown { primitive, first }) in shown.iter().enumerate() {
            let next = shown.get(at + 1).map_or(faces.positions.len(), |next| next.first as usize);
            let uvs = self.uvs(mesh, *primitive).filter(|uvs| uvs.len() == next - *first as usize);
            first_uvs.push(uvs.is_some().then_some(surface.uvs.len() as u32));
            surface.uvs.extend(uvs.into_iter().flatten());
            surface.sections.push(self.section(mesh, *primitive));
        }
        for (face, sources) in faces.mesh.faces().zip(faces.sources) {
            let triangles = sources.iter().filter_map(|t| faces.triangles.get(*t as usize));
            let vertices: Vec<u32> = triangles.flatten().copied().collect();
            let section = shown.partition_point(|s| s.first <= vertices[0]) - 1;
            // Where the two triangles of a quad meet, the first one's vertices are taken.
            let vertex = |particle: &u32| {
                vertices.iter().find(|v| faces.particles[**v as usize] == *particle).copied().unwrap_or(0)
            };
            let corner = |vertex: u32| {
                let uv = first_uvs[section].map(|uv| uv + vertex - shown[section].first);
                Corner { vertex, uv: uv.filter(|uv| (*uv as usize) < surface.uvs.len()) }
            };
            let corners: Vec<_> = face.iter().map(|particle| corner(vertex(particle))).collect();
            surface.push_face(corners, section as u32);
        }
        surface
    }

    fn section(&self, mesh: usize, primitive: usize) -> Section {
        let mesh = &self.document.meshes[mesh];
        let material = mesh.primitives[primitive].material.and_then(|m| {
            let name = self.document.materials.get(m as usize)?.name.clone();
            Some(name.unwrap_or_else(|| format!("material {m}")))
        });
        let short = |name: &str| Arc::from(name.chars().take(200).collect::<String>());
        Section {
            object: mesh.name.as_deref().map(short),
            material: material.as_deref().map(short),
            ..Section::default()
        }
    }

    /// TEXCOORD_0, turned from v down to v up.
    fn uvs(&self, mesh: usize, primitive: usize) -> Option<Vec<[f64; 2]>> {
        let place = "TEXCOORD_0";
        let accessor = self.document.meshes[mesh].primitives[primitive].attributes.texcoord?;
        let data = element(&self.document.accessors, accessor, "accessor", place).ok()?;
        let (Checked::Valid(Type::Vec2), Checked::Valid(GenericComponentType(component))) =
            (data.shape, data.component_type)
        else {
            return None;
        };
        let is_real = component == ComponentType::F32;
        if !is_real && !data.normalized {
            return None;
        }
        let (size, number) = (component.size(), component_reader(component, data.normalized));
        let uv = |bytes: &[u8]| [number(bytes), 1.0 - number(&bytes[size..])];
        let uvs = self.read_accessor(data, 2 * size, place, uv).ok()?;
        uvs.iter().flatten().all(|x| x.is_finite()).then_some(uvs)
    }
}
