//! Reads the surface of an OBJ file: its own vertices in their order, faces, texture coordinates and names.

use super::QuadMesh;
use super::obj::{Lines, words};
use super::surface::{Corner, Section, Surface, Vertex};
use std::collections::HashMap;

/// Longest name that is kept, letters: a megabyte that names every face would have no end.
const LONGEST_NAME: usize = 200;

/// The surface of a file that [`obj::read`](super::obj::read) took in as `mesh`, whose vertices became `particles`
/// (`u32::MAX` for none). A texture coordinate that is malformed or is not there is left out.
pub(super) fn read(bytes: &[u8], mesh: &QuadMesh, particles: &[u32]) -> Surface {
    let mut surface = Surface::default();
    let mut section = Section::default();
    let mut numbers = HashMap::new();
    let mut face = Vec::new();
    let mut lines = Lines::new(bytes);
    while let Some((keyword, line)) = lines.statement(&[b"v", b"vt", b"f", b"o", b"g", b"usemtl", b"s"]) {
        match keyword {
            b"v" => surface.vertices.push(Vertex::Stays(reals(&line).into())),
            b"vt" => {
                let [u, v, _] = reals(&line);
                surface.uvs.push([u, v]);
            }
            b"f" => {
                face.clear();
                face.extend(words(&line).skip(1).map(|word| corner(word, &surface)));
                if face.len() >= 3 {
                    let number = *numbers.entry(section.clone()).or_insert_with(|| {
                        surface.sections.push(section.clone());
                        surface.sections.len() as u32 - 1
                    });
                    surface.push_face(face.drain(..), number);
                }
            }
            _ => {
                let text = String::from_utf8_lossy(&line);
                let rest = text.trim().split_once(char::is_whitespace).map_or("", |(_, rest)| rest.trim());
                let name = match keyword {
                    b"o" => &mut section.object,
                    b"g" => &mut section.group,
                    b"usemtl" => &mut section.material,
                    _ => &mut section.smoothing,
                };
                *name = Some(rest.chars().take(LONGEST_NAME).collect::<String>().into());
            }
        }
    }
    // Both readers list the same corners in the same order.
    let followed: Vec<_> = surface.corners().iter().map(|c| c.vertex).zip(mesh.corners()).collect();
    for (vertex, raw) in followed {
        let particle = particles[*raw as usize];
        if let Some(vertex) = surface.vertices.get_mut(vertex as usize)
            && particle != u32::MAX
        {
            *vertex = Vertex::Follows(particle);
        }
    }
    let uvs = surface.uvs.len() as u32;
    surface.change_corners(|corner| corner.uv = corner.uv.filter(|uv| *uv < uvs));
    surface
}

/// The first three numbers of a line after its keyword, 0 where there is none.
fn reals(line: &[u8]) -> [f64; 3] {
    let mut numbers = words(line).skip(1).map(|word| {
        let number = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
        number.filter(|n: &f64| n.is_finite()).unwrap_or(0.0)
    });
    std::array::from_fn(|_| numbers.next().unwrap_or(0.0))
}

/// `vertex`, `vertex/uv`, `vertex/uv/normal` or `vertex//normal`, numbered from 1, or from -1 back from here.
fn corner(word: &[u8], surface: &Surface) -> Corner {
    let mut parts = word.split(|b| *b == b'/');
    let mut number = |count: usize| {
        let number: i64 = std::str::from_utf8(parts.next()?).ok()?.parse().ok()?;
        u32::try_from(if number < 0 { count.cast_signed() as i64 + number } else { number - 1 }).ok()
    };
    // The other reader has refused faces whose vertices are not there.
    Corner { vertex: number(surface.vertices.len()).unwrap_or(0), uv: number(surface.uvs.len()) }
}
