//! Boxes in files, as the program `pbig` reads and writes them.

// The fuzz targets compile this file at another place: with a path it finds its part there too.
#[path = "files/npy.rs"]
mod npy;

pub use npy::{npy_boxes, npy_frames};

use ndarray::Array2;
use pbig_core::{Aabb, Pair};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// The endings of a file of boxes, and of one of pairs.
pub const BOXES_OR_PAIRS: [&str; 2] = ["npy", "csv"];

/// The columns of a `.csv` file.
const COLUMNS: [&str; 6] = ["min_x", "min_y", "min_z", "max_x", "max_y", "max_z"];

/// Returns a message about a file, in one line that names it. Messages about the content alone do not know the name.
fn at(path: &Path, what: impl std::fmt::Display) -> String {
    format!("{}: {}", path.display(), one_line(what))
}

/// Whatever a library put into its message.
fn one_line(what: impl std::fmt::Display) -> String {
    what.to_string().replace(['\n', '\r'], " ")
}

/// As much of what a file says as a message needs, so that what is expected instead is not lost behind it.
fn brief(text: &str) -> String {
    const LONGEST: usize = 120;
    text.char_indices().nth(LONGEST).map_or(text.to_owned(), |(end, _)| format!("{}...", &text[..end]))
}

/// A list of boxes: `.npy` (N,6) float32 or float64 (rounded outward), or `.csv` with the columns
/// min_x,min_y,min_z,max_x,max_y,max_z (rounded to nearest, which never parts two boxes that touch).
pub fn read_boxes(path: &Path) -> Result<Vec<Aabb>, String> {
    read(path, if ending(path, &BOXES_OR_PAIRS)? == "npy" { npy_boxes } else { csv_boxes })
}

/// Frames of boxes: `.npy` (F,N,6) float32 or float64 (rounded outward).
pub fn read_frames(path: &Path) -> Result<Frames, String> {
    ending(path, &["npy"])?;
    read(path, npy_frames)
}

fn read<T>(path: &Path, content: fn(&[u8]) -> Result<T, String>) -> Result<T, String> {
    let bytes = std::fs::read(path).map_err(|error| at(path, error))?;
    content(&bytes).map_err(|what| at(path, what))
}

/// The content of a file of frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    /// Boxes in each frame.
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

/// The content of a `.csv` file of boxes, see [`read_boxes`].
pub fn csv_boxes(bytes: &[u8]) -> Result<Vec<Aabb>, String> {
    let text = text(bytes)?;
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).trim(csv::Trim::All).from_reader(bytes);
    let mut boxes = Vec::new();
    for (i, record) in reader.records().enumerate() {
        let record = record.map_err(one_line)?;
        if i > 0 || !is_header(&record) {
            let better = |what| wrong_throughout(&record, i).unwrap_or(what);
            let about = |what| one_line(format!("line {}: {}", line_of(text, &record), better(what)));
            boxes.push(csv_box(&record).map_err(about)?);
        }
    }
    Ok(boxes)
}

fn text(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
        format!("line {line}: this is not UTF-8; save the file as UTF-8 text")
    })
}

/// The column names, and nothing else: a file that begins with other words is not taken for empty.
fn is_header(record: &csv::StringRecord) -> bool {
    record.len() == 6
        && record.iter().zip(COLUMNS).all(|(field, name)| plain(field).eq_ignore_ascii_case(name))
}

/// Without the mark that some programs put before the text.
fn plain(field: &str) -> &str {
    field.trim_start_matches('\u{feff}')
}

/// Returns a message about the whole file rather than a value.
fn wrong_throughout(record: &csv::StringRecord, number: usize) -> Option<String> {
    for (separator, name) in [(';', "semicolons"), ('\t', "tabs")] {
        if record.iter().any(|field| field.contains(separator)) {
            return Some(format!("values are separated by {name}; expected commas"));
        }
    }
    let is_name = |field: &str| plain(field).starts_with(|c: char| c.is_alphabetic() || c == '#');
    let header = number == 0 && record.iter().all(is_name);
    header.then(|| format!("the header must be {}, or be left out", COLUMNS.join(",")))
}

/// The line of a record, counted from 1. The reader's own count is off after blank lines.
fn line_of(text: &str, record: &csv::StringRecord) -> usize {
    let start = record.position().map_or(0, |position| position.byte() as usize);
    let blank = text[start..].len() - text[start..].trim_start_matches(['\r', '\n']).len();
    1 + text[..start + blank].matches('\n').count()
}

fn csv_box(record: &csv::StringRecord) -> Result<Aabb, String> {
    if record.len() != 6 {
        return Err(format!("expected 6 columns, separated by commas, found {}", record.len()));
    }
    let mut values = [0.0f32; 6];
    for (column, (value, field)) in values.iter_mut().zip(record).enumerate() {
        *value = field
            .parse()
            .map_err(|_| format!("column {}: '{}' is not a number", column + 1, brief(field)))?;
    }
    let [a, b, c, d, e, f] = values;
    Ok(Aabb::new([a, b, c], [d, e, f]))
}

/// Pairs as `.npy` (K,2) uint32 or `.csv`.
pub fn write_pairs(path: &Path, pairs: &[Pair]) -> Result<(), String> {
    if ending(path, &BOXES_OR_PAIRS)? == "csv" {
        return write_csv(path, "a,b", pairs.iter().map(|p| format!("{},{}", p.a, p.b)));
    }
    let flat = pairs.iter().flat_map(|p| [p.a, p.b]).collect();
    let array = Array2::from_shape_vec((pairs.len(), 2), flat).map_err(|error| at(path, error))?;
    ndarray_npy::write_npy(path, &array).map_err(|error| at(path, error))
}

/// A text file of a header and lines.
pub fn write_csv(path: &Path, header: &str, lines: impl IntoIterator<Item = String>) -> Result<(), String> {
    ending(path, &["csv"])?;
    let write = || -> std::io::Result<()> {
        let mut file = BufWriter::new(File::create(path)?);
        writeln!(file, "{header}")?;
        for line in lines {
            writeln!(file, "{line}")?;
        }
        file.flush()
    };
    write().map_err(|error| at(path, error))
}
