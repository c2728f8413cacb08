//! Reads Wavefront OBJ: the vertices and polygons of all objects and groups, through `tobj`.
//!
//! `tobj` is given only `v` and `f` lines, each reduced to positions and position indices: whatever else stands in the file
//! (materials, normals, curves) cannot make it open a file, split the cloth, or fail. Where there are two threads, one reduces
//! lines while `tobj` parses on the other those that are reduced already.

use std::borrow::Cow;
use std::io::{BufRead, Read};
use std::sync::mpsc;

use glam::DVec3;
use memchr::memchr2;
use tobj::{LoadError, LoadOptions, Model};

use super::QuadMesh;

/// The polygons of a file, with the vertices that they use, in the order of first use.
pub(super) struct Polygons {
    pub mesh: QuadMesh,
    /// Faces with fewer than three corners, dropped.
    pub short_faces: usize,
    /// Vertices that no polygon uses, dropped.
    pub unused_vertices: usize,
    pub warnings: Vec<String>,
}

/// Reads the text of an OBJ file. The error says what is wrong, in which line, and what would be accepted.
pub(super) fn read(bytes: &[u8]) -> Result<Polygons, String> {
    // Without an end, so that on a single thread one can come after the other.
    let (to, blocks) = mpsc::channel();
    let mut reduced = Reduced { blocks, block: Vec::new(), consumed: 0 };
    // Each end goes with its reader or writer: the other notices.
    let (lines, models) = rayon::join(move || reduce(bytes, &to), move || parse(&mut reduced));
    let models = models.map_err(|error| refusal(bytes, error))?;
    let mut mesh = QuadMesh::default();
    // Without `o`, `g` and `usemtl` lines everything is one model.
    if let Some(model) = models.into_iter().next() {
        let model = model.mesh;
        let positions = model.positions.chunks_exact(3).map(|p| DVec3::new(p[0], p[1], p[2]));
        mesh = QuadMesh::new(positions.collect());
        if mesh.positions.iter().any(|p| !p.is_finite()) {
            return Err(first_bad_vertex(bytes));
        }
        let triangles = model.indices.len() / 3;
        // No arities means triangles only.
        let arities: Cow<[u32]> =
            if model.face_arities.is_empty() { vec![3; triangles].into() } else { model.face_arities.into() };
        let mut rest = model.indices.as_slice();
        for arity in arities.iter() {
            let (face, after) = rest.split_at(*arity as usize);
            mesh.push_face(face);
            rest = after;
        }
    }
    let mut warnings = Vec::new();
    if lines.strokes > 0 {
        warnings.push(format!(
            "{} `l` and `p` lines (strokes and points) are not cloth and were left out",
            lines.strokes
        ));
    }
    Ok(Polygons {
        unused_vertices: lines.vertices - mesh.positions.len(),
        short_faces: lines.short_faces,
        mesh,
        warnings,
    })
}

fn parse(lines: &mut impl BufRead) -> Result<Vec<Model>, LoadError> {
    let options = LoadOptions { ignore_points: true, ignore_lines: true, ..LoadOptions::default() };
    Ok(tobj::load_obj_buf(lines, &options, |_| Ok(<(Vec<_>, _)>::default()))?.0)
}

/// Reduces all lines, as far as somebody reads them.
fn reduce<'a>(bytes: &'a [u8], to: &mpsc::Sender<Vec<u8>>) -> Lines<'a> {
    /// Bytes: far more than a line, far less than a file that takes long.
    const BLOCK: usize = 1 << 16;
    let mut lines = Lines::new(bytes);
    let mut block = Vec::new();
    while lines.next() {
        block.extend_from_slice(&lines.line);
        if block.len() >= BLOCK && to.send(std::mem::take(&mut block)).is_err() {
            return lines;
        }
    }
    let _ = to.send(block);
    lines
}

/// What is wrong with a file that `tobj` has refused: found by reading it again line by line, as far as `tobj` takes it.
fn refusal(bytes: &[u8], error: LoadError) -> String {
    if matches!(error, LoadError::FaceVertexOutOfBounds) {
        return first_bad_index(bytes);
    }
    let mut lines = Lines::new(bytes);
    let _ = parse(&mut lines);
    let what = match error {
        LoadError::PositionParseError => "is not a vertex; `v` and three numbers would be accepted",
        LoadError::FaceParseError => "is not a face; `f` and vertex numbers would be accepted",
        other => return format!("line {}: {other}", lines.number),
    };
    format!("line {}: {} {what}", lines.number, lines.quoted())
}

/// The `v` and `f` lines of a file, reduced to positions and position indices.
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    /// Number in the file, from 1, of the line that was read last.
    number: usize,
    /// Physical lines read so far.
    read: usize,
    line: Vec<u8>,
    consumed: usize,
    vertices: usize,
    short_faces: usize,
    strokes: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let rest = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        let line = Vec::new();
        Self { rest, number: 0, read: 0, line, consumed: 0, vertices: 0, short_faces: 0, strokes: 0 }
    }

    /// The next line as it stands in the file, without its end; LF, CRLF and CR all end a line.
    fn physical(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.read += 1;
        let end = memchr2(b'\n', b'\r', self.rest).unwrap_or(self.rest.len());
        let (line, after) = self.rest.split_at(end);
        let ending = if after.starts_with(b"\r\n") { 2 } else { after.len().min(1) };
        self.rest = &after[ending..];
        Some(line)
    }

    /// The next line with one of these keywords, and what continues it; other lines are skipped.
    pub(super) fn statement(&mut self, keywords: &[&[u8]]) -> Option<(&'a [u8], Cow<'a, [u8]>)> {
        loop {
            let physical = self.physical()?;
            self.number = self.read;
            let Some(keyword) = words(physical).next().filter(|k| keywords.contains(k)) else { continue };
            let mut whole = Cow::Borrowed(physical);
            while let Some(start) = whole.strip_suffix(b"\\") {
                let mut joined = start.to_vec();
                joined.push(b' ');
                joined.extend_from_slice(self.physical().unwrap_or_default());
                whole = Cow::Owned(joined);
            }
            return Some((keyword, whole));
        }
    }

    /// Puts the next vertex or polygon into `line`; false at the end of the file.
    fn next(&mut self) -> bool {
        while let Some((keyword, whole)) = self.statement(&[b"v", b"f", b"l", b"p"]) {
            if matches!(keyword, b"l" | b"p") {
                self.strokes += 1;
            } else if self.reduce(&whole) {
                return true;
            }
        }
        false
    }

    /// Keeps three coordinates of a vertex (what follows is a weight or a colour), and of every corner of a face its first number.
    fn reduce(&mut self, whole: &[u8]) -> bool {
        self.line.clear();
        self.consumed = 0;
        // Bytes that are no text become something that is no number either.
        let text = if whole.is_ascii() {
            Cow::Borrowed(whole)
        } else {
            String::from_utf8_lossy(whole).into_owned().into_bytes().into()
        };
        let mut words = words(&text);
        let is_vertex = words.next() == Some(b"v");
        self.line.push(if is_vertex { b'v' } else { b'f' });
        let mut count = 0;
        for word in words.take(if is_vertex { 3 } else { usize::MAX }) {
            self.line.push(b' ');
            let end = if is_vertex { None } else { word.iter().position(|b| *b == b'/') };
            self.line.extend_from_slice(&word[..end.unwrap_or(word.len())]);
            if end == Some(0) {
                self.line.push(b'/');
            }
            count += 1;
        }
        self.line.push(b'\n');
        if is_vertex {
            self.vertices += 1;
        } else if count < 3 {
            self.short_faces += 1;
            return false;
        }
        true
    }

    /// The reduced line for a message, shortened, as one line of printable text.
    fn quoted(&self) -> String {
        let text = String::from_utf8_lossy(&self.line);
        let text = text.trim_end();
        let short: String = text.chars().take(60).collect();
        let dots = if short.len() < text.len() { "..." } else { "" };
        format!("`{}{dots}`", short.escape_debug())
    }
}

/// The words of a line up to a comment.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).take_while(|w| w[0] != b'#')
}

impl Read for Lines<'_> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let count = self.fill_buf()?.read(into)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for Lines<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        if self.consumed == self.line.len() && !self.next() {
            self.line.clear();
            self.consumed = 0;
        }
        Ok(&self.line[self.consumed..])
    }

    fn consume(&mut self, amount: usize) {
        self.consumed += amount;
    }
}

/// Lines that were reduced on another thread.
struct Reduced {
    blocks: mpsc::Receiver<Vec<u8>>,
    block: Vec<u8>,
    consumed: usize,
}

impl Read for Reduced {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let count = self.fill_buf()?.read(into)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for Reduced {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        while self.consumed == self.block.len() {
            // All are there when the sender is gone.
            let Ok(next) = self.blocks.recv() else { return Ok(&[]) };
            (self.block, self.consumed) = (next, 0);
        }
        Ok(&self.block[self.consumed..])
    }

    fn consume(&mut self, amount: usize) {
        self.consumed += amount;
    }
}

/// A second pass over a file that `tobj` refused or that holds a NaN, which names the line.
fn first_bad_index(bytes: &[u8]) -> String {
    let mut lines = Lines::new(bytes);
    while lines.next() {}
    let total = lines.vertices;
    let mut lines = Lines::new(bytes);
    while lines.next() {
        for word in words(&lines.line).skip(1).filter(|_| lines.line[0] == b'f') {
            let word = String::from_utf8_lossy(word);
            let so_far = lines.vertices as i128;
            let named = match word.parse::<i128>() {
                Ok(index) if index < 0 => so_far + index >= 0,
                Ok(index) => index > 0 && index <= total as i128,
                Err(_) => false,
            };
            if !named {
                return format!(
                    "line {}: face corner `{}` names no vertex; 1 to {total}, or -1 to -{so_far} counted back from here, would be accepted",
                    lines.number,
                    word.chars().take(30).collect::<String>().escape_debug(),
                );
            }
        }
    }
    format!("a face corner names no vertex; 1 to {total} would be accepted")
}

fn first_bad_vertex(bytes: &[u8]) -> String {
    let mut lines = Lines::new(bytes);
    while lines.next() {
        let text = String::from_utf8_lossy(&lines.line);
        let is_bad = |word: &str| word.parse::<f64>().is_ok_and(|x| !x.is_finite());
        if lines.line[0] == b'v' && text.split_ascii_whitespace().skip(1).any(is_bad) {
            return format!(
                "line {}: {} is not finite; three finite numbers would be accepted",
                lines.number,
                lines.quoted()
            );
        }
    }
    "a vertex is not finite; finite coordinates would be accepted".to_owned()
}
