//! Boxes in files, as the program `pbig` reads and writes them.

use ndarray::{Array2, Array3, ArrayView2};
use ndarray_npy::{ReadNpyError, ReadNpyExt, ReadableElement, WriteNpyError, WriteNpyExt};
use pbig_core::{Aabb, Pair};
use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::Path;

/// What is wrong with a file, in one line that names it.
pub type FileError = String;

fn at(path: &Path, what: impl std::fmt::Display) -> FileError {
    // One line, whatever a library put into its message.
    format!("{}: {what}", path.display()).replace('\n', " ")
}

/// A list of boxes: `.npy` (N,6) float32 or float64 (rounded outward), or `.csv` with the columns
/// min_x,min_y,min_z,max_x,max_y,max_z (rounded to nearest, which never parts two boxes that touch).
///
/// # Errors
/// A message that names the file, what is wrong and where.
pub fn read_boxes(path: &Path) -> Result<Vec<Aabb>, FileError> {
    match extension(path) {
        "npy" => read_npy_boxes(path),
        "csv" => read_csv_boxes(path),
        _ => Err(at(path, "expected a file that ends in .npy or .csv")),
    }
}

/// Frames of boxes: `.npy` (F,N,6) float32 or float64 (rounded outward).
///
/// # Errors
/// A message that names the file and what is wrong.
pub fn read_frames(path: &Path) -> Result<Vec<Vec<Frame>>, FileError> {
    if extension(path) != "npy" {
        return Err(at(path, "expected a file that ends in .npy"));
    }
    let frames = |shape: &[usize]| match shape {
        [_, n, 6] => Ok(*n),
        other => Err(at(path, format!("expected an array of shape (F,N,6), found {}", shape_text(other)))),
    };
    Ok(match read_array::<ndarray::Ix3>(path)? {
        Floats::F32(array) => {
            frames(array.shape())?;
            array.outer_iter().map(|frame| rows(&frame).map(Frame::from_f32).collect()).collect()
        }
        Floats::F64(array) => {
            frames(array.shape())?;
            array.outer_iter().map(|frame| rows(&frame).map(Frame::from_f64).collect()).collect()
        }
    })
}

/// A box of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Frame {
    /// All six values are NaN: the box is not there.
    Absent,
    /// A box, perhaps an invalid one.
    Present(Aabb),
}

impl Frame {
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

fn read_array<D: ndarray::Dimension>(path: &Path) -> Result<Floats<D>, FileError> {
    match read_as::<f32, D>(path) {
        Ok(array) => Ok(Floats::F32(array)),
        Err(Reading::Type) => match read_as::<f64, D>(path) {
            Ok(array) => Ok(Floats::F64(array)),
            Err(Reading::Type) => Err(at(path, "expected float32 or float64 values, little-endian")),
            Err(Reading::Other(message)) => Err(message),
        },
        Err(Reading::Other(message)) => Err(message),
    }
}

enum Reading {
    Type,
    Other(FileError),
}

fn read_as<T: ReadableElement, D: ndarray::Dimension>(path: &Path) -> Result<ndarray::Array<T, D>, Reading> {
    let file = File::open(path).map_err(|error| Reading::Other(at(path, error)))?;
    ndarray::Array::<T, D>::read_npy(BufReader::new(file)).map_err(|error| match error {
        ReadNpyError::WrongDescriptor(_) => Reading::Type,
        ReadNpyError::WrongNdim(wanted, found) => Reading::Other(at(
            path,
            format!(
                "expected {} dimensions, found {found}",
                wanted.map_or("other".into(), |n| n.to_string())
            ),
        )),
        other => Reading::Other(at(path, format!("not a readable .npy file: {other}"))),
    })
}

/// The rows of an (N,6) array, whatever its memory order.
fn rows<'a, T: Copy>(array: &'a ArrayView2<'_, T>) -> impl Iterator<Item = [T; 6]> + 'a {
    array.outer_iter().map(|row| std::array::from_fn(|k| row[k]))
}

fn read_npy_boxes(path: &Path) -> Result<Vec<Aabb>, FileError> {
    let wrong =
        |shape: &[usize]| at(path, format!("expected an array of shape (N,6), found {}", shape_text(shape)));
    match read_array::<ndarray::Ix2>(path)? {
        Floats::F32(a) if a.ncols() == 6 => Ok(rows(&a.view()).map(f32_box).collect()),
        Floats::F64(a) if a.ncols() == 6 => Ok(rows(&a.view()).map(f64_box).collect()),
        Floats::F32(a) => Err(wrong(a.shape())),
        Floats::F64(a) => Err(wrong(a.shape())),
    }
}

fn read_csv_boxes(path: &Path) -> Result<Vec<Aabb>, FileError> {
    let text = std::fs::read_to_string(path).map_err(|error| at(path, error))?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut boxes = Vec::new();
    for (i, record) in reader.records().enumerate() {
        let record = record.map_err(|error| at(path, error))?;
        let is_header = i == 0 && record.iter().all(|field| field.parse::<f32>().is_err());
        if !is_header {
            let about = |what| at(path, format!("line {}: {what}", line_of(&text, &record)));
            boxes.push(csv_box(&record).map_err(about)?);
        }
    }
    Ok(boxes)
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

/// Pairs as `.npy` (K,2) uint32 or `.csv`.
///
/// # Errors
/// A message that names the file, when it cannot be written or has another extension.
pub fn write_pairs(path: &Path, pairs: &[Pair]) -> Result<(), FileError> {
    match extension(path) {
        "npy" => {
            let flat = pairs.iter().flat_map(|p| [p.a, p.b]).collect();
            let array = Array2::from_shape_vec((pairs.len(), 2), flat).map_err(|error| at(path, error))?;
            write_npy(path, |file| array.write_npy(file))
        }
        "csv" => write_csv(path, "a,b", pairs.iter().map(|p| format!("{},{}", p.a, p.b))),
        _ => Err(at(path, "expected a file that ends in .npy or .csv")),
    }
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

/// Frames as `.npy` (F,N,6) float32, readable by `pbig replay`; boxes that a frame lacks are NaN.
///
/// # Errors
/// A message that names the file, when it cannot be written.
pub fn write_frames<'a>(
    path: &Path,
    frames: impl IntoIterator<Item = &'a Vec<Aabb>>,
) -> Result<(), FileError> {
    let frames: Vec<&Vec<Aabb>> = frames.into_iter().collect();
    let boxes = frames.iter().map(|frame| frame.len()).max().unwrap_or(0);
    let array = Array3::from_shape_fn((frames.len(), boxes, 6), |(f, i, k)| {
        let aabb = frames[f].get(i).unwrap_or(&Aabb::NOWHERE);
        if k < 3 { aabb.min[k] } else { aabb.max[k - 3] }
    });
    write_npy(path, |file| array.write_npy(file))
}

fn write_npy(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), WriteNpyError>,
) -> Result<(), FileError> {
    let mut file = BufWriter::new(File::create(path).map_err(|error| at(path, error))?);
    write(&mut file).map_err(|error| at(path, error))?;
    file.flush().map_err(|error| at(path, error))
}
