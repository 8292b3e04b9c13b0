//! Meshes from files: what both formats have in common.

use super::{MESHES, Mesh, obj, ply};
use crate::files::{Location, brief, ending, is_stream, name, one_line, stdin};
use pbig_core::NO_KEY;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Maximum length of a line, in bytes. A strip of triangles may have millions of vertices.
pub(super) const MAX_LINE_BYTES: usize = 64 << 20;

/// The note on a file of vertices alone.
pub const NO_ELEMENTS: &str = "no faces and no rods";

/// Number of names that a list of skipped things shows.
const MOST_NAMES: usize = 8;

/// A thing that a mesh may have, but seldom has on purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Oddity {
    Far,
    DoubledVertex,
    LoopRod,
    ShortStrip,
}

impl Oddity {
    fn name(self) -> &'static str {
        match self {
            Self::Far => "vertices beyond the range of f32, with infinite boxes",
            Self::DoubledVertex => "faces that name a vertex twice",
            Self::LoopRod => "rods from a vertex to itself, left out",
            Self::ShortStrip => "strips of fewer than 3 vertices, without a triangle",
        }
    }
}

impl Mesh {
    /// Reads a `.ply` or `.obj` file; `-` is stdin, with either.
    ///
    /// # Errors
    /// The file, what is wrong and where, in one line.
    pub fn read(path: &Path) -> Result<Self, String> {
        if is_stream(path) {
            return Self::from_stdin().map_err(|what| format!("{}: {what}", name(path)));
        }
        let read = if ending(path, &MESHES)? == "ply" { Self::from_ply } else { Self::from_obj };
        let file = std::fs::File::open(path).map_err(|error| error.to_string());
        file.and_then(|file| read(BufReader::new(file))).map_err(|what| format!("{}: {what}", path.display()))
    }

    fn from_stdin() -> Result<Self, String> {
        let (start, content) = stdin()?;
        let is_ply = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&start).starts_with(b"ply");
        if is_ply { Self::from_ply(content) } else { Self::from_obj(content) }
    }

    /// Reads the content of a `.ply` file.
    ///
    /// # Errors
    /// The fault and its place, in one line.
    pub fn from_ply(mut content: impl BufRead) -> Result<Self, String> {
        refuse_other_bytes(&mut content).and_then(|()| ply::read(content)).map_err(one_line)
    }

    /// Reads the content of an `.obj` file.
    ///
    /// # Errors
    /// The fault and its place, in one line.
    pub fn from_obj(mut content: impl BufRead) -> Result<Self, String> {
        refuse_other_bytes(&mut content).and_then(|()| obj::read(content)).map_err(one_line)
    }

    /// Returns what a reader of the summary should know about the file, a line each.
    pub fn notes(&self) -> Vec<String> {
        let invalid = self.first_invalid.map(|(vertex, place)| {
            let all = self.vertices.iter().filter(|at| at.iter().any(|x| x.is_nan())).count();
            let number = vertex + self.first_number;
            format!("vertices with a NaN: {all}, the first is vertex {number} in {place}")
        });
        let odd = self
            .oddities
            .iter()
            .map(|(oddity, (all, place))| format!("{}: {all}, the first in {place}", oddity.name()));
        let empty = match (self.faces.is_empty(), self.rods.is_empty()) {
            (true, true) => Some(NO_ELEMENTS.to_owned()),
            (true, false) => Some("no faces; rods have edges and vertices".to_owned()),
            _ => None,
        };
        let skipped = (!self.skipped.is_empty()).then(|| format!("not read: {}", self.skipped.join("; ")));
        invalid.into_iter().chain(odd).chain(empty).chain(skipped).collect()
    }

    /// Counts something that a mesh seldom has on purpose.
    pub(super) fn notice(&mut self, oddity: Oddity, place: Location) {
        self.oddities.entry(oddity).or_insert((0, place)).0 += 1;
    }

    pub(super) fn add_vertex(&mut self, at: [f64; 3], place: Location) {
        if self.first_invalid.is_none() && at.iter().any(|x| x.is_nan()) {
            self.first_invalid = Some((self.vertices.len(), place));
        }
        if at.iter().any(|x| x.abs() > f64::from(f32::MAX)) {
            self.notice(Oddity::Far, place);
        }
        self.vertices.push(at);
    }

    /// Adds a face of three or four vertices.
    pub(super) fn add_face(&mut self, corners: &[u32], place: Location) -> Result<(), String> {
        let face = match *corners {
            [a, b, c] => [a, b, c, NO_KEY],
            [a, b, c, d] => [a, b, c, d],
            _ if corners.len() < 3 => {
                return Err(format!("expected a face of 3 or 4 vertices, found {}", corners.len()));
            }
            _ => {
                return Err(
                    "a face of more than 4 vertices; divide it into triangles or quadrilaterals".into()
                );
            }
        };
        if corners.iter().enumerate().any(|(i, corner)| corners[..i].contains(corner)) {
            self.notice(Oddity::DoubledVertex, place);
        }
        self.faces.push(face);
        Ok(())
    }

    pub(super) fn add_rod(&mut self, ends: [u32; 2], place: Location) {
        match ends[0] == ends[1] {
            true => self.notice(Oddity::LoopRod, place),
            false => self.rods.push(ends),
        }
    }

    /// Adds names of what is skipped. Those of one `group`, such as the properties of an element, are one entry.
    pub(super) fn skip(&mut self, names: &[String], group: &str) {
        if !names.is_empty() {
            self.skipped.push(format!("{}{group}", list(names)));
        }
    }
}

/// Returns the first names, and how many there are more.
fn list(names: &[String]) -> String {
    let (shown, rest) = names.split_at(names.len().min(MOST_NAMES));
    let more = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
    let plain = |name: &String| name.chars().map(|c| if c.is_control() { '?' } else { c }).collect();
    format!("{}{more}", shown.iter().map(plain).collect::<Vec<String>>().join(", "))
}

/// Refuses other bytes than a text has at its beginning, or a header, with what to do about them.
fn refuse_other_bytes(content: &mut impl BufRead) -> Result<(), String> {
    let begun = content.fill_buf().map_err(one_line)?;
    let has = |starts: &[&[u8]]| starts.iter().any(|start| begun.starts_with(start));
    if begun.is_empty() {
        return Err("the file is empty".into());
    }
    if has(&[b"\xff\xfe", b"\xfe\xff"]) {
        return Err("this is UTF-16; save the file as UTF-8 text".into());
    }
    match has(&[b"\x1f\x8b", b"PK\x03\x04", b"\x28\xb5\x2f\xfd"]) {
        true => Err("this is compressed; unpack it first".into()),
        false => Ok(()),
    }
}

/// Returns a number, also with Fortran's `d` before the exponent.
pub(super) fn number(word: &str) -> Result<f64, String> {
    let number = word.parse().or_else(|_| word.replace(['d', 'D'], "e").parse());
    number.map_err(|_| format!("'{}' is not a number such as -0.5, 1e3 or nan", brief(word)))
}
