//! Wavefront's `.obj`: vertices, faces and rods. The names of other lines with geometry are kept.
//!
//! The crate `tobj` numbers vertices anew for each object, knows no line that goes on in the next, and its errors name no line.

use super::Mesh;
use super::reading::{MAX_LINE_BYTES, number};
use crate::files::{Lines, Location, brief, counted, too_long};
use std::collections::BTreeMap;
use std::io::BufRead;
use std::str::SplitWhitespace;

/// Expected form of a line.
const EXPECTED: &str = "a vertex, a face or a rod";

/// Lines without geometry of their own: textures, normals, groups, materials, and what belongs to a curve or surface.
const QUIET: &str = "vt vn g s mg o usemtl mtllib usemap maplib bevel c_interp d_interp lod shadow_obj trace_obj ctech stech \
                     cstype deg bmat step parm trim hole scrv sp con end csh";

pub(super) fn read(reader: impl BufRead) -> Result<Mesh, String> {
    let mut lines = Lines::new(reader, MAX_LINE_BYTES, EXPECTED);
    let mut file = Reading { mesh: Mesh { first_number: 1, ..Mesh::default() }, ..Reading::default() };
    let mut whole = String::new();
    while lines.advance()? {
        // Comments and names may be in any encoding.
        let line = String::from_utf8_lossy(&lines.bytes);
        let line = without_comment(line.trim_start_matches('\u{feff}')).trim_end();
        if whole.is_empty() {
            file.line = lines.number;
        }
        match line.strip_suffix('\\') {
            Some(_) if whole.len() > MAX_LINE_BYTES => {
                return Err(file.at(too_long(MAX_LINE_BYTES, EXPECTED)));
            }
            // Without the blank the last number of this line and the first of the next would be one.
            Some(begun) => whole.extend([begun, " "]),
            None => file.take(&(std::mem::take(&mut whole) + line))?,
        }
    }
    file.take(&whole)?;
    file.finish()
}

/// Returns a line without its comment. In the midst of a word, `#` is a character: `1.#INF` is no number.
fn without_comment(line: &str) -> &str {
    let is_blank = |c: Option<char>| c.is_none_or(char::is_whitespace);
    let begins = |(i, _): &(usize, &str)| {
        is_blank(line[..*i].chars().next_back()) || is_blank(line[i + 1..].chars().next())
    };
    line.match_indices('#').find(begins).map_or(line, |(i, _)| &line[..i])
}

#[derive(Default)]
struct Reading {
    mesh: Mesh,
    /// Number of the present line; of the first, if it goes on in others.
    line: usize,
    /// Vertices that a later line may define, each larger than those before, and the lines that name them.
    awaited: Vec<(i64, usize)>,
    /// Words at the beginning of lines that are skipped, with the number of these lines.
    skipped: BTreeMap<String, usize>,
    /// The first of these words.
    first_skipped: Option<String>,
}

impl Reading {
    fn at(&self, what: String) -> String {
        format!("line {}: {what}", self.line)
    }

    fn take(&mut self, line: &str) -> Result<(), String> {
        let mut words = line.split_whitespace();
        let taken = match words.next() {
            Some("v") => self.add_vertex(words),
            Some("f" | "fo") => self.add_face(words),
            Some("l") => self.add_rods(words),
            Some(word) if !QUIET.split(' ').any(|quiet| quiet == word) => {
                self.first_skipped.get_or_insert_with(|| brief(word));
                *self.skipped.entry(brief(word)).or_default() += 1;
                Ok(())
            }
            _ => Ok(()),
        };
        taken.map_err(|what| self.at(what))
    }

    /// Reads three coordinates. A weight or a colour may follow.
    fn add_vertex(&mut self, words: SplitWhitespace<'_>) -> Result<(), String> {
        let numbers: Vec<f64> = words.map(number).collect::<Result<_, _>>()?;
        let [x, y, z, ..] = numbers[..] else {
            return Err(format!("expected 3 coordinates, found {}", numbers.len()));
        };
        self.mesh.add_vertex([x, y, z], Location::Line(self.line));
        Ok(())
    }

    fn add_face(&mut self, words: SplitWhitespace<'_>) -> Result<(), String> {
        let corners: Vec<u32> = words.map(|word| self.index(word)).collect::<Result<_, _>>()?;
        self.mesh.add_face(&corners, Location::Line(self.line))
    }

    fn add_rods(&mut self, words: SplitWhitespace<'_>) -> Result<(), String> {
        let path: Vec<u32> = words.map(|word| self.index(word)).collect::<Result<_, _>>()?;
        if path.len() < 2 {
            return Err(format!("expected a rod of 2 vertices or more, found {}", path.len()));
        }
        path.windows(2).for_each(|ends| self.mesh.add_rod([ends[0], ends[1]], Location::Line(self.line)));
        Ok(())
    }

    /// Returns the vertex of `vertex/texture/normal`: counted from 1, or backwards from the last one with -1.
    fn index(&mut self, word: &str) -> Result<u32, String> {
        let number = vertex_number(word).ok_or_else(|| not_a_vertex(word))?;
        let before = self.mesh.vertices.len() as i64;
        let from_start = if number < 0 { before.saturating_add(number) + 1 } else { number };
        if number == 0 {
            return Err("vertex 0 does not exist; the first is 1".into());
        }
        if from_start < 1 {
            let before = counted(self.mesh.vertices.len(), "vertex", "vertices");
            return Err(format!("vertex {number} does not exist; the lines before have {before}"));
        }
        if from_start > self.awaited.last().map_or(before, |(largest, _)| before.max(*largest)) {
            self.awaited.push((from_start, self.line));
        }
        // A larger one does not exist, which is told at the end.
        Ok(u32::try_from(from_start - 1).unwrap_or(u32::MAX))
    }

    fn finish(mut self) -> Result<Mesh, String> {
        let vertices = self.mesh.vertices.len();
        if vertices == 0 {
            let found = self.first_skipped.map_or(String::new(), |word| format!(", found '{word}'"));
            return Err(format!("no vertices; expected lines that begin with `v`{found}"));
        }
        if let Some((number, line)) = self.awaited.iter().find(|(number, _)| *number > vertices as i64) {
            return Err(format!("line {line}: vertex {number} does not exist; the file has {vertices}"));
        }
        let names = self.skipped.iter().map(|(word, lines)| format!("{word} ({lines})"));
        self.mesh.skip(&names.collect::<Vec<_>>(), "");
        Ok(self.mesh)
    }
}

/// Returns the vertex of `vertex`, `vertex/texture`, `vertex//normal` or `vertex/texture/normal`.
fn vertex_number(word: &str) -> Option<i64> {
    let mut parts = word.split('/');
    let vertex = parts.next()?.parse().ok();
    let others: Vec<&str> = parts.collect();
    let are_numbers = others.iter().all(|part| part.is_empty() || part.parse::<i64>().is_ok());
    vertex.filter(|_| others.len() < 3 && are_numbers)
}

fn not_a_vertex(word: &str) -> String {
    let form = if word.contains('/') { "; expected numbers: vertex/texture/normal" } else { "" };
    format!("'{}' is not the number of a vertex{form}", brief(word))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufReader, Read, repeat};

    /// Readers without an end: only a bound lets this end.
    #[test]
    fn a_line_without_an_end_is_refused() {
        let refused = |reader: &mut dyn Read| read(BufReader::new(reader)).expect_err("refused");
        let wanted = "line 1: longer than 67108864 bytes; expected a vertex, a face or a rod";
        assert_eq!(refused(&mut repeat(b'v')), wanted);
        let continued = format!("v 1 2 3{}\\\n", " 0".repeat(1 << 20));
        let continued = std::iter::repeat_n(continued, 40).collect::<String>();
        assert_eq!(refused(&mut continued.as_bytes()), wanted);
    }
}
