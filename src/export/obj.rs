//! A sequence of Wavefront OBJ files: the source's vertices in their order, its faces, texture coordinates and names.

use super::{Frame, PendingFolder, Sink, Span};
use crate::scene::Refusal;
use crate::target::{Section, Surface};
use glam::DVec3;
use std::fmt::Write;
use std::path::Path;

/// A folder of files, one a frame. Positions have the digits that read back as the same 64-bit numbers; normals are left
/// to the reader.
pub(super) struct ObjSequence {
    folder: PendingFolder,
    surface: Surface,
    positions: Vec<DVec3>,
    /// What stands behind the vertices: the same in every frame.
    faces: String,
}

impl ObjSequence {
    pub(super) fn new(path: &Path, surface: Surface, span: Span) -> Result<Self, Refusal> {
        let folder = PendingFolder::new(path, "obj", span)?;
        let faces = faces(&surface);
        Ok(Self { folder, surface, positions: Vec::new(), faces })
    }
}

impl Sink for ObjSequence {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), Refusal> {
        self.surface.place(frame.positions, &mut self.positions);
        let mut text = format!("# Tenter, frame {} at {} s; metres, y up\n", frame.number, frame.time);
        for p in &self.positions {
            // Adding +0 turns -0 into +0.
            let [x, y, z] = (*p + DVec3::ZERO).to_array();
            let _ = writeln!(text, "v {x} {y} {z}");
        }
        text += &self.faces;
        self.folder.write(frame.number, text.as_bytes())
    }

    fn finish(self: Box<Self>) -> Result<(), Refusal> {
        self.folder.keep()
    }
}

/// Texture coordinates and faces, as OBJ has them. Writing to a string cannot fail.
fn faces(surface: &Surface) -> String {
    let mut text = String::new();
    for [u, v] in &surface.uvs {
        let _ = writeln!(text, "vt {u} {v}");
    }
    for [a, b] in &surface.edges {
        let _ = writeln!(text, "l {} {}", a + 1, b + 1);
    }
    let mut current = &Section::default();
    for (corners, section) in surface.faces() {
        let section = &surface.sections[section as usize];
        let before = std::mem::replace(&mut current, section);
        for (keyword, name, old) in [
            ("o", &section.object, &before.object),
            ("g", &section.group, &before.group),
            ("usemtl", &section.material, &before.material),
            ("s", &section.smoothing, &before.smoothing),
        ] {
            if name != old {
                let name = crate::params::one_line(name.as_deref().unwrap_or("default"));
                let _ = writeln!(text, "{keyword} {name}");
            }
        }
        text.push('f');
        for corner in corners {
            let _ = match corner.uv {
                Some(uv) => write!(text, " {}/{}", corner.vertex + 1, uv + 1),
                None => write!(text, " {}", corner.vertex + 1),
            };
        }
        text.push('\n');
    }
    text
}
