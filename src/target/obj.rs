//! Reads Wavefront OBJ: the vertices and polygons of all objects and groups.
//!
//! Of `v` and `f` lines positions and position indices are taken, and nothing else: whatever else stands in the file (materials,
//! normals, curves) cannot make it open a file, split the cloth, or fail.

use std::borrow::Cow;

use glam::DVec3;

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

/// A corner that names no vertex.
const NOWHERE: u32 = u32::MAX;

/// Reads the text of an OBJ file. The error says what is wrong, in which line, and what would be accepted.
pub(super) fn read(bytes: &[u8]) -> Result<Polygons, String> {
    let mut lines = Lines::new(bytes);
    let mut vertices = Vec::new();
    let mut mesh = QuadMesh::default();
    let (mut short_faces, mut strokes) = (0, 0);
    let mut face = Vec::new();
    while let Some((keyword, line)) = lines.statement(&[b"v", b"f", b"l", b"p"]) {
        let words = words(&line).skip(1);
        if keyword == b"v" {
            let what = "is not a vertex; `v` and three numbers would be accepted";
            vertices.push(vertex(words).ok_or_else(|| lines.refused(&line, what))?);
        } else if keyword == b"f" {
            face.clear();
            let mut are_numbers = true;
            face.extend(words.map(|word| {
                corner(word, vertices.len()).unwrap_or_else(|| {
                    are_numbers = false;
                    NOWHERE
                })
            }));
            if face.len() < 3 {
                short_faces += 1;
            } else if are_numbers {
                mesh.push_face(&face);
            } else {
                return Err(lines.refused(&line, "is not a face; `f` and vertex numbers would be accepted"));
            }
        } else {
            strokes += 1;
        }
    }
    // Only now, as faces may stand before their vertices.
    if mesh.corners().iter().any(|corner| *corner as usize >= vertices.len()) {
        return Err(first_bad_index(bytes, vertices.len()));
    }
    let mut number = vec![NOWHERE; vertices.len()];
    mesh.change_corners(|corner, positions| {
        let number = &mut number[*corner as usize];
        if *number == NOWHERE {
            *number = positions.len() as u32;
            positions.push(vertices[*corner as usize]);
        }
        *corner = *number;
    });
    if mesh.positions.iter().any(|p| !p.is_finite()) {
        return Err(first_bad_vertex(bytes));
    }
    let mut warnings = Vec::new();
    if strokes > 0 {
        warnings.push(format!(
            "{strokes} `l` and `p` lines (strokes and points) are not cloth and were left out"
        ));
    }
    Ok(Polygons { unused_vertices: vertices.len() - mesh.positions.len(), short_faces, mesh, warnings })
}

/// Three coordinates; what follows is a weight or a colour.
fn vertex<'a>(mut words: impl Iterator<Item = &'a [u8]>) -> Option<DVec3> {
    let mut next = || real(words.next()?);
    Some(DVec3::new(next()?, next()?, next()?))
}

/// A number as `str::parse` reads it.
fn real(word: &[u8]) -> Option<f64> {
    decimal(word).or_else(|| std::str::from_utf8(word).ok()?.parse().ok())
}

/// A plain decimal of so few digits that both they and the power of ten below them are exact: then one division rounds right
/// (Clinger, "How to read floating point numbers accurately", 1990). Nearly all coordinates are that, and are read in half of
/// the time.
fn decimal(word: &[u8]) -> Option<f64> {
    const MOST: usize = 15;
    const POWERS: [f64; MOST + 1] =
        [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
    let (is_negative, digits) = match word {
        [b'-', digits @ ..] => (true, digits),
        digits => (false, digits),
    };
    if digits.len() > MOST {
        return None;
    }
    let (mut number, mut count, mut point) = (0_u64, 0, None);
    for digit in digits {
        match digit {
            b'0'..=b'9' => {
                number = 10 * number + u64::from(digit - b'0');
                count += 1;
            }
            b'.' if point.is_none() => point = Some(count),
            _ => return None,
        }
    }
    let size = number as f64 / POWERS[count - point.unwrap_or(count)];
    (count > 0).then_some(if is_negative { -size } else { size })
}

/// The vertex that a corner of a face names before its first slash, counted from 0, when there are so many; [`NOWHERE`] where
/// there can be no such vertex, none where that is no number.
fn corner(word: &[u8], so_far: usize) -> Option<u32> {
    let number = before_slash(word);
    if number == b"/" {
        return Some(NOWHERE);
    }
    let number = match plain(number) {
        Some(number) => i64::from(number),
        None => std::str::from_utf8(number).ok()?.parse().ok()?,
    };
    let index = if number < 0 { so_far.cast_signed() as i64 + number } else { number - 1 };
    Some(u32::try_from(index).unwrap_or(NOWHERE))
}

/// A number of up to nine digits without a sign, as nearly all are.
fn plain(digits: &[u8]) -> Option<u32> {
    let append =
        |number: u32, digit: &u8| digit.is_ascii_digit().then(|| 10 * number + u32::from(digit - b'0'));
    if matches!(digits.len(), 1..=9) { digits.iter().try_fold(0, append) } else { None }
}

/// The lines of a file.
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    /// Number in the file, from 1, of the line that was read last.
    number: usize,
    /// Physical lines read so far.
    read: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let rest = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        Self { rest, number: 0, read: 0 }
    }

    /// The next line as it stands in the file, without its end; LF, CRLF and CR all end a line.
    fn physical(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.read += 1;
        let end = self.rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(self.rest.len());
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
            while whole.ends_with(b"\\") {
                let joined = whole.to_mut();
                joined.pop();
                joined.push(b' ');
                joined.extend_from_slice(self.physical().unwrap_or_default());
            }
            return Some((keyword, whole));
        }
    }

    /// Says of the line that was read last what is wrong with it. Shown is what was looked at, shortened, as printable text.
    fn refused(&self, line: &[u8], what: &str) -> String {
        let mut words = words(line);
        let keyword = words.next().unwrap_or_default();
        let shown: Vec<_> = match keyword {
            b"v" => words.take(3).collect(),
            _ => words.map(before_slash).collect(),
        };
        let text = [&[keyword], &shown[..]].concat().join(&b' ');
        let text = String::from_utf8_lossy(&text);
        let short: String = text.chars().take(60).collect();
        let dots = if short.len() < text.len() { "..." } else { "" };
        format!("line {}: `{}{dots}` {what}", self.number, short.escape_debug())
    }
}

/// The words of a line up to a comment.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).take_while(|w| w[0] != b'#')
}

/// What a corner says of its vertex.
fn before_slash(word: &[u8]) -> &[u8] {
    let end = word.iter().position(|b| *b == b'/').unwrap_or(word.len());
    // A slash with nothing before it is shown, or nothing would be.
    &word[..end.max(1)]
}

/// A second pass over a file of so many vertices, which names the corner that leads to none.
fn first_bad_index(bytes: &[u8], vertices: usize) -> String {
    let mut lines = Lines::new(bytes);
    let mut so_far = 0;
    while let Some((keyword, line)) = lines.statement(&[b"v", b"f"]) {
        if keyword == b"v" {
            so_far += 1;
            continue;
        }
        let is_bad = |word: &&[u8]| corner(word, so_far).is_none_or(|corner| corner as usize >= vertices);
        let is_face = words(&line).count() > 3;
        if let Some(word) = words(&line).skip(1).find(is_bad).filter(|_| is_face) {
            let shown: String = String::from_utf8_lossy(before_slash(word)).chars().take(30).collect();
            return format!(
                "line {}: face corner `{}` names no vertex; 1 to {vertices}, or -1 to -{so_far} counted back from here, would be accepted",
                lines.number,
                shown.escape_debug(),
            );
        }
    }
    format!("a face corner names no vertex; 1 to {vertices} would be accepted")
}

/// The same for a vertex that is not finite.
fn first_bad_vertex(bytes: &[u8]) -> String {
    let mut lines = Lines::new(bytes);
    while let Some((_, line)) = lines.statement(&[b"v"]) {
        if vertex(words(&line).skip(1)).is_some_and(|vertex| !vertex.is_finite()) {
            return lines.refused(&line, "is not finite; three finite numbers would be accepted");
        }
    }
    "a vertex is not finite; finite coordinates would be accepted".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_standard_library() {
        let words = [
            "0",
            "-0",
            "1",
            "-1.5",
            "0.1",
            ".5",
            "5.",
            "-.25",
            "123456789012345",
            "0.00000000000001",
            "12345.678901234",
            "1234567890123456",
            "1e3",
            "-2.5E-7",
            "+4",
            "inf",
            "nan",
            "",
            "-",
            ".",
            "-.",
            "1.2.3",
            "1_0",
            "0x1",
            "1e400",
            "--1",
        ];
        for word in words {
            let expected = word.parse::<f64>().ok();
            assert_eq!(real(word.as_bytes()).map(f64::to_bits), expected.map(f64::to_bits), "{word}");
        }
        // Every second one of these would be off by a bit if it were multiplied by 1e-6.
        for i in (0..10_000_000_u32).step_by(997) {
            let word = format!("-{}.{:06}", i % 1000, i);
            assert_eq!(real(word.as_bytes()), word.parse().ok(), "{word}");
        }
    }
}
