//! Boxes in files, as the program `pbig` reads and writes them.

use ndarray::{Array2, ArrayView2};
use ndarray_npy::{ReadNpyError, ReadNpyExt, ReadableElement, WriteNpyError, WriteNpyExt};
use pbig_core::{Aabb, Pair};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// What is wrong with a file, in one line that names it.
pub type FileError = String;

/// The same about its content, before it is known which file that is.
type ContentError = String;

fn at(path: &Path, what: impl std::fmt::Display) -> FileError {
    format!("{}: {}", path.display(), one_line(what))
}

/// Whatever a library put into its message.
fn one_line(what: impl std::fmt::Display) -> String {
    what.to_string().replace(['\n', '\r'], " ")
}

/// A list of boxes: `.npy` (N,6) float32 or float64 (rounded outward), or `.csv` with the columns
/// min_x,min_y,min_z,max_x,max_y,max_z (rounded to nearest, which never parts two boxes that touch).
///
/// # Errors
/// A message that names the file, what is wrong and where.
pub fn read_boxes(path: &Path) -> Result<Vec<Aabb>, FileError> {
    match extension(path) {
        "npy" => read(path, npy_boxes),
        "csv" => read(path, csv_boxes),
        _ => Err(at(path, "expected a file that ends in .npy or .csv")),
    }
}

/// Frames of boxes: `.npy` (F,N,6) float32 or float64 (rounded outward).
///
/// # Errors
/// A message that names the file and what is wrong.
pub fn read_frames(path: &Path) -> Result<Frames, FileError> {
    match extension(path) {
        "npy" => read(path, npy_frames),
        _ => Err(at(path, "expected a file that ends in .npy")),
    }
}

fn read<T>(path: &Path, content: fn(&[u8]) -> Result<T, ContentError>) -> Result<T, FileError> {
    let bytes = std::fs::read(path).map_err(|error| at(path, error))?;
    content(&bytes).map_err(|what| at(path, what))
}

/// The content of an `.npy` file of boxes, see [`read_boxes`].
///
/// # Errors
/// What is wrong, in one line.
pub fn npy_boxes(bytes: &[u8]) -> Result<Vec<Aabb>, ContentError> {
    let wrong = |shape: &[usize]| format!("expected an array of shape (N,6), found {}", shape_text(shape));
    match array::<ndarray::Ix2>(bytes)? {
        Floats::F32(a) if a.ncols() == 6 => Ok(rows(&a.view()).map(f32_box).collect()),
        Floats::F64(a) if a.ncols() == 6 => Ok(rows(&a.view()).map(f64_box).collect()),
        Floats::F32(a) => Err(wrong(a.shape())),
        Floats::F64(a) => Err(wrong(a.shape())),
    }
}

/// The content of an `.npy` file of frames, see [`read_frames`].
///
/// # Errors
/// What is wrong, in one line.
pub fn npy_frames(bytes: &[u8]) -> Result<Frames, ContentError> {
    let boxes = |shape: &[usize]| match shape {
        [_, n, 6] => Ok(*n),
        other => Err(format!("expected an array of shape (F,N,6), found {}", shape_text(other))),
    };
    Ok(match array::<ndarray::Ix3>(bytes)? {
        Floats::F32(array) => Frames {
            boxes: boxes(array.shape())?,
            frames: array.outer_iter().map(|frame| rows(&frame).map(FrameBox::from_f32).collect()).collect(),
        },
        Floats::F64(array) => Frames {
            boxes: boxes(array.shape())?,
            frames: array.outer_iter().map(|frame| rows(&frame).map(FrameBox::from_f64).collect()).collect(),
        },
    })
}

/// What a file of frames holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    /// Boxes in each frame.
    pub boxes: usize,
    /// The frames.
    pub frames: Vec<Vec<FrameBox>>,
}

/// A box of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrameBox {
    /// All six values are NaN: the box is not there.
    Absent,
    /// A box, perhaps an invalid one.
    Present(Aabb),
}

impl FrameBox {
    fn from_f32(v: [f32; 6]) -> Self {
        Self::new(v.iter().all(|x| x.is_nan()), f32_box(v))
    }

    fn from_f64(v: [f64; 6]) -> Self {
        Self::new(v.iter().all(|x| x.is_nan()), f64_box(v))
    }

    fn new(absent: bool, aabb: Aabb) -> Self {
        if absent { Self::Absent } else { Self::Present(aabb) }
    }
}

fn f32_box(v: [f32; 6]) -> Aabb {
    Aabb::new([v[0], v[1], v[2]], [v[3], v[4], v[5]])
}

fn f64_box(v: [f64; 6]) -> Aabb {
    Aabb::from_f64([v[0], v[1], v[2]], [v[3], v[4], v[5]])
}

fn extension(path: &Path) -> &str {
    path.extension().and_then(|e| e.to_str()).unwrap_or("")
}

fn shape_text(shape: &[usize]) -> String {
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    format!("({})", lengths.join(","))
}

/// An array of either float type.
enum Floats<D> {
    F32(ndarray::Array<f32, D>),
    F64(ndarray::Array<f64, D>),
}

fn array<D: ndarray::Dimension>(bytes: &[u8]) -> Result<Floats<D>, ContentError> {
    check_size(bytes).map_err(one_line)?;
    match read_as::<f32, D>(bytes) {
        Ok(array) => Ok(Floats::F32(array)),
        Err(ReadNpyError::WrongDescriptor(_)) => match read_as::<f64, D>(bytes) {
            Ok(array) => Ok(Floats::F64(array)),
            Err(ReadNpyError::WrongDescriptor(_)) => Err("expected float32 or float64 values".into()),
            Err(error) => Err(npy_text(&error)),
        },
        Err(error) => Err(npy_text(&error)),
    }
}

fn read_as<T: ReadableElement, D: ndarray::Dimension>(
    bytes: &[u8],
) -> Result<ndarray::Array<T, D>, ReadNpyError> {
    ndarray::Array::<T, D>::read_npy(bytes)
}

fn npy_text(error: &ReadNpyError) -> String {
    match error {
        ReadNpyError::WrongNdim(wanted, found) => {
            format!("expected {} dimensions, found {found}", wanted.unwrap_or_default())
        }
        other => one_line(format!("not a readable .npy file: {other}")),
    }
}

/// Whether the file holds as many bytes as its header promises. The reader allocates what the header
/// says, so a header that lies must be noticed before. What cannot be understood here is left to it.
fn check_size(bytes: &[u8]) -> Result<(), String> {
    let Some((header, rest)) = npy_header(bytes)? else { return Ok(()) };
    let field = |name: &str, from: char, to: char| {
        let text = header.split(&format!("'{name}'")).nth(1)?;
        Some(text.split(from).nth(1)?.split(to).next()?.to_string())
    };
    let (Some(shape), Some(kind)) = (field("shape", '(', ')'), field("descr", '\'', '\'')) else {
        return Ok(());
    };
    let lengths: Option<Vec<u64>> =
        shape.split(',').map(str::trim).filter(|n| !n.is_empty()).map(|n| n.parse().ok()).collect();
    let Some(lengths) = lengths else { return Ok(()) };
    let size: u64 = kind.trim_start_matches(|c: char| !c.is_ascii_digit()).parse().unwrap_or(1);
    let bytes_of = |least: u64| lengths.iter().map(|&n| n.max(least)).try_fold(size, u64::checked_mul);
    let found = rest.len() as u64;
    match (bytes_of(0), bytes_of(1)) {
        // Even without boxes, frames take memory: each as much as a box.
        (_, None) => Err(format!("shape ({shape}) is larger than any file")),
        (Some(0), Some(frames)) if frames > 1 << 26 => {
            Err(format!("shape ({shape}) has too many empty frames"))
        }
        (Some(needed), _) if needed > found => {
            Err(format!("shape ({shape}) needs {needed} bytes of values, the file has {found}"))
        }
        _ => Ok(()),
    }
}

/// The header's text, and what follows it. The reader allocates what the header's length says, up to 4 GiB, so one
/// that is cut off must be noticed before.
fn npy_header(bytes: &[u8]) -> Result<Option<(String, &[u8])>, ContentError> {
    let Some((after, length)) = header_length(bytes) else { return Ok(None) };
    match after.split_at_checked(length as usize) {
        Some((header, rest)) => Ok(Some((String::from_utf8_lossy(header).into_owned(), rest))),
        None => Err(format!("the header needs {length} bytes, the file has {}", after.len())),
    }
}

/// What follows the length of the header, and this length.
fn header_length(bytes: &[u8]) -> Option<(&[u8], u32)> {
    let rest = bytes.strip_prefix(b"\x93NUMPY")?;
    match *rest.first()? {
        1 => Some((rest.get(4..)?, u32::from(u16::from_le_bytes(rest.get(2..4)?.try_into().ok()?)))),
        _ => Some((rest.get(6..)?, u32::from_le_bytes(rest.get(2..6)?.try_into().ok()?))),
    }
}

/// The rows of an (N,6) array, whatever its memory order.
fn rows<'a, T: Copy>(array: &'a ArrayView2<'_, T>) -> impl Iterator<Item = [T; 6]> + 'a {
    array.outer_iter().map(|row| std::array::from_fn(|k| row[k]))
}

/// The content of a `.csv` file of boxes, see [`read_boxes`].
///
/// # Errors
/// What is wrong and in which line, in one line.
pub fn csv_boxes(bytes: &[u8]) -> Result<Vec<Aabb>, ContentError> {
    let text = std::str::from_utf8(bytes).map_err(one_line)?;
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).trim(csv::Trim::All).from_reader(bytes);
    let mut boxes = Vec::new();
    for (i, record) in reader.records().enumerate() {
        let record = record.map_err(one_line)?;
        if i > 0 || !is_header(&record) {
            let about = |what| one_line(format!("line {}: {what}", line_of(text, &record)));
            boxes.push(csv_box(&record).map_err(about)?);
        }
    }
    Ok(boxes)
}

/// The column names, and nothing else: a file that begins with other words is not taken for empty.
fn is_header(record: &csv::StringRecord) -> bool {
    let names = ["min_x", "min_y", "min_z", "max_x", "max_y", "max_z"];
    let plain = |field: &str| field.trim_start_matches('\u{feff}').to_ascii_lowercase();
    record.len() == 6 && record.iter().zip(names).all(|(field, name)| plain(field) == name)
}

/// The line of a record, counted from 1. The reader's own count is off after blank lines.
fn line_of(text: &str, record: &csv::StringRecord) -> usize {
    let start = record.position().map_or(0, |position| position.byte() as usize);
    let blank = text[start..].len() - text[start..].trim_start_matches(['\r', '\n']).len();
    1 + text[..start + blank].matches('\n').count()
}

fn csv_box(record: &csv::StringRecord) -> Result<Aabb, String> {
    if record.len() != 6 {
        return Err(format!("expected 6 columns, found {}", record.len()));
    }
    let mut values = [0.0f32; 6];
    for (column, (value, field)) in values.iter_mut().zip(record).enumerate() {
        *value = field.parse().map_err(|_| format!("column {}: '{field}' is not a number", column + 1))?;
    }
    Ok(f32_box(values))
}

/// Whether [`write_pairs`] knows the extension: to be asked before the work, not after.
///
/// # Errors
/// A message that names the file.
pub fn check_pairs_path(path: &Path) -> Result<(), FileError> {
    let known = ["npy", "csv"].contains(&extension(path));
    if known { Ok(()) } else { Err(at(path, "expected a file that ends in .npy or .csv")) }
}

/// Pairs as `.npy` (K,2) uint32 or `.csv`.
///
/// # Errors
/// A message that names the file, when it cannot be written or has another extension.
pub fn write_pairs(path: &Path, pairs: &[Pair]) -> Result<(), FileError> {
    check_pairs_path(path)?;
    match extension(path) {
        "npy" => {
            let flat = pairs.iter().flat_map(|p| [p.a, p.b]).collect();
            let array = Array2::from_shape_vec((pairs.len(), 2), flat).map_err(|error| at(path, error))?;
            write_npy(path, |file| array.write_npy(file))
        }
        _ => write_csv(path, "a,b", pairs.iter().map(|p| format!("{},{}", p.a, p.b))),
    }
}

/// Whether [`write_csv`] accepts the extension: to be asked before the work, not after.
///
/// # Errors
/// A message that names the file.
pub fn check_csv_path(path: &Path) -> Result<(), FileError> {
    if extension(path) == "csv" { Ok(()) } else { Err(at(path, "expected a file that ends in .csv")) }
}

/// A text file of a header and lines.
///
/// # Errors
/// A message that names the file, when it cannot be written.
pub fn write_csv(
    path: &Path,
    header: &str,
    lines: impl IntoIterator<Item = String>,
) -> Result<(), FileError> {
    check_csv_path(path)?;
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

fn write_npy(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), WriteNpyError>,
) -> Result<(), FileError> {
    let mut file = BufWriter::new(File::create(path).map_err(|error| at(path, error))?);
    write(&mut file).map_err(|error| at(path, error))?;
    file.flush().map_err(|error| at(path, error))
}
