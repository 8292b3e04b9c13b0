//! Boxes in files, as the program `pbig` reads and writes them.

mod grow;
mod npy;
mod text;
mod write;

pub use grow::grown;
pub use npy::{npy_boxes, npy_frames};
pub use text::csv_boxes;
pub(crate) use text::{Lines, too_long};
pub use write::{check_output, is_stream, write_csv, write_id_pairs, write_pairs};

use pbig_core::{Aabb, Limits};
use std::fmt;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::{Display, Path};

/// The endings of a file of boxes, and of one of pairs.
pub const BOXES_OR_PAIRS: [&str; 2] = ["npy", "csv"];

/// Maximum number of boxes in a file: no search of the program `pbig` takes more.
const MAX_BOXES: u64 = Limits::DEFAULT.max_boxes;

/// Returns a message about a file, in one line that names it. Messages about the content alone do not know the name.
fn at(path: &Path, what: impl fmt::Display) -> String {
    format!("{}: {}", name(path), one_line(what))
}

/// Returns the name of an input for messages.
pub fn name(path: &Path) -> Display<'_> {
    if is_stream(path) { Path::new("stdin").display() } else { path.display() }
}

/// Returns the first bytes of stdin, which tell formats apart, and all of it.
pub(crate) fn stdin() -> Result<(Vec<u8>, impl BufRead), String> {
    let (mut start, mut rest) = (Vec::new(), io::stdin().lock());
    Read::take(&mut rest, npy::MAGIC.len() as u64).read_to_end(&mut start).map_err(one_line)?;
    Ok((start.clone(), Cursor::new(start).chain(rest)))
}

/// Returns a library's message in one line.
pub(crate) fn one_line(what: impl fmt::Display) -> String {
    what.to_string().replace(['\n', '\r'], " ")
}

/// Returns a number and its noun: `1 vertex`, `2 vertices`.
pub fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// Returns the beginning of a value in a file, short enough that a message can also say what was expected.
pub(crate) fn brief(text: &str) -> String {
    const LONGEST: usize = 120;
    text.char_indices().nth(LONGEST).map_or(text.to_owned(), |(end, _)| format!("{}...", &text[..end]))
}

/// Boxes of a file, and the place of the first invalid one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoxList {
    pub boxes: Vec<Aabb>,
    /// The first box that is invalid: its index and its place in the file.
    pub first_invalid: Option<(usize, Location)>,
}

/// The place of a box in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Location {
    /// Line of a text, counted from 1.
    Line(usize),
    /// Row of an array, counted from 0.
    Row(usize),
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Row(row) => write!(f, "row {row}, counted from 0"),
        }
    }
}

impl BoxList {
    fn push(&mut self, aabb: Aabb, place: Location) {
        if self.first_invalid.is_none() && !aabb.is_valid() {
            self.first_invalid = Some((self.boxes.len(), place));
        }
        self.boxes.push(aabb);
    }
}

/// Bytes to read, and their number if it is known: of a pipe it is not.
struct Source<R> {
    reader: R,
    length: Option<u64>,
}

impl Source<BufReader<File>> {
    fn open(path: &Path) -> Result<Self, String> {
        let open = || {
            let file = File::open(path)?;
            let about = file.metadata()?;
            Ok((file, about.is_file().then_some(about.len())))
        };
        let (file, length) = open().map_err(|error: std::io::Error| at(path, error))?;
        Ok(Self { reader: BufReader::with_capacity(64 << 10, file), length })
    }
}

impl<'a> Source<&'a [u8]> {
    fn of(bytes: &'a [u8]) -> Self {
        Self { reader: bytes, length: Some(bytes.len() as u64) }
    }
}

/// A list of boxes: `.npy` (N,6) float32 or float64 (rounded outward), or `.csv` with the columns
/// min_x,min_y,min_z,max_x,max_y,max_z (rounded to nearest, which never parts two boxes that touch). `-` is stdin, with either.
pub fn read_boxes(path: &Path) -> Result<BoxList, String> {
    if is_stream(path) {
        return boxes_of_stdin().map_err(|what| at(path, what));
    }
    let is_npy = ending(path, &BOXES_OR_PAIRS)? == "npy";
    let source = Source::open(path)?;
    let read = if is_npy { npy::boxes(source) } else { text::boxes(source.reader, MAX_BOXES) };
    read.map_err(|what| at(path, what))
}

fn boxes_of_stdin() -> Result<BoxList, String> {
    let (start, reader) = stdin()?;
    let is_npy = start.starts_with(npy::MAGIC);
    if is_npy { npy::boxes(Source { reader, length: None }) } else { text::boxes(reader, MAX_BOXES) }
}

/// Frames of boxes: `.npy` (F,N,6) float32 or float64 (rounded outward); `-` is stdin.
pub fn read_frames(path: &Path) -> Result<Frames, String> {
    if is_stream(path) {
        let read = stdin().and_then(|(_, reader)| npy::frames(Source { reader, length: None }));
        return read.map_err(|what| at(path, what));
    }
    ending(path, &["npy"])?;
    npy::frames(Source::open(path)?).map_err(|what| at(path, what))
}

#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    pub boxes: usize,
    /// The frames, each with its boxes, perhaps invalid ones. None: all six values are NaN, the box is not there.
    pub frames: Vec<Vec<Option<Aabb>>>,
}

fn f64_box(v: [f64; 6]) -> Aabb {
    Aabb::from_f64([v[0], v[1], v[2]], [v[3], v[4], v[5]])
}

/// Returns which of these endings a file has, in small letters. For a file to write, call it before the work, not after.
pub fn ending<'a>(path: &Path, known: &[&'a str]) -> Result<&'a str, String> {
    let has = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    let found = known.iter().find(|known| known.eq_ignore_ascii_case(has)).copied();
    found.ok_or_else(|| at(path, format!("expected a file that ends in .{}", known.join(" or ."))))
}

/// Returns the message about more boxes than [`MAX_BOXES`].
fn too_many(boxes: impl fmt::Display, limit: u64) -> String {
    format!("{boxes} boxes are more than {limit}; for more, use the crate pbig-core with larger `Limits`")
}
