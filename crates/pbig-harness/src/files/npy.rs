//! The content of `.npy` files.

use super::{Frames, brief, f64_box, one_line};
use ndarray::{Array, ArrayD, ArrayView2, Dimension, Ix2, Ix3};
use ndarray_npy::npy::header::Header;
use ndarray_npy::{ReadNpyError, ReadNpyExt};
use pbig_core::Aabb;

/// The first bytes of every `.npy` file.
const MAGIC: &[u8] = b"\x93NUMPY";

/// The content of an `.npy` file of boxes, see [`super::read_boxes`].
pub fn npy_boxes(bytes: &[u8]) -> Result<Vec<Aabb>, String> {
    Ok(rows(&array::<Ix2>(bytes)?.view()).map(f64_box).collect())
}

/// The content of an `.npy` file of frames, see [`super::read_frames`].
pub fn npy_frames(bytes: &[u8]) -> Result<Frames, String> {
    let array = array::<Ix3>(bytes)?;
    let present = |v: [f64; 6]| (!v.iter().all(|x| x.is_nan())).then(|| f64_box(v));
    let frames = array.outer_iter().map(|frame| rows(&frame).map(present).collect());
    Ok(Frames { boxes: array.dim().1, frames: frames.collect() })
}

/// The rows of an (N,6) array, whatever its memory order.
fn rows<'a>(array: &'a ArrayView2<'_, f64>) -> impl Iterator<Item = [f64; 6]> + 'a {
    array.outer_iter().map(|row| std::array::from_fn(|k| row[k]))
}

fn shape_text(shape: &[usize]) -> String {
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    brief(&format!("({})", lengths.join(", ")))
}

/// Returns the array of six columns. An f32 is the same number in f64.
fn array<D: Dimension>(bytes: &[u8]) -> Result<Array<f64, D>, String> {
    check_start(bytes)?;
    check_size(bytes).map_err(one_line)?;
    let read = match ArrayD::<f32>::read_npy(bytes) {
        Err(ReadNpyError::WrongDescriptor(_)) => ArrayD::<f64>::read_npy(bytes),
        read => read.map(|array| array.mapv(f64::from)),
    };
    let array = read.map_err(|error| npy_text(&error))?;
    let shape = array.shape().to_vec();
    let fits = D::NDIM == Some(shape.len()) && shape.last() == Some(&6);
    array.into_dimensionality().ok().filter(|_| fits).ok_or_else(|| wrong_shape(D::NDIM, &shape))
}

fn wrong_shape(wanted: Option<usize>, shape: &[usize]) -> String {
    let (found, of_frames, of_boxes) = (shape_text(shape), "(F, N, 6)", "(N, 6)");
    match (wanted, shape) {
        (Some(2), [_, _, 6]) => {
            format!("shape {found} is a list of frames: use `pbig replay`; `pbig pairs` expects {of_boxes}")
        }
        (Some(3), [_, 6]) => {
            format!("shape {found} is one list of boxes: use `pbig pairs`; `pbig replay` expects {of_frames}")
        }
        (Some(2), _) => format!("expected an array of shape {of_boxes}, found {found}"),
        _ => format!("expected an array of shape {of_frames}, found {found}"),
    }
}

fn npy_text(error: &ReadNpyError) -> String {
    match error {
        ReadNpyError::WrongDescriptor(kind) => values_text(kind.as_string()),
        other => one_line(format!("not a readable .npy file: {}", brief(&other.to_string()))),
    }
}

/// Marks of the order of bytes.
const ORDERS: [char; 4] = ['<', '>', '=', '|'];

fn values_text(kind: Option<&String>) -> String {
    let found = kind.map_or("records".into(), |kind| value_name(kind));
    one_line(format!("values are {found}; expected float32 or float64 (numpy: `.astype('float32')`)"))
}

/// Returns numpy's name of the values that a header describes as, say, `<i4`.
fn value_name(kind: &str) -> String {
    let plain = kind.trim_start_matches(ORDERS);
    let (letter, bytes) = plain.split_at_checked(1).unwrap_or((plain, ""));
    let named = |name: &str| bytes.parse::<u8>().map(|bytes| format!("{name}{}", 8 * u32::from(bytes))).ok();
    let name = match letter {
        "b" => Some("bool".to_string()),
        "i" => named("int"),
        "u" => named("uint"),
        "f" => named("float"),
        "c" => named("complex"),
        _ => None,
    };
    name.unwrap_or_else(|| format!("of type '{}'", brief(kind)))
}

/// Checks that this is a `.npy` file.
fn check_start(bytes: &[u8]) -> Result<(), String> {
    match bytes {
        [] => Err("the file is empty".into()),
        _ if bytes.starts_with(MAGIC) => Ok(()),
        _ => Err("this is no .npy file, as `numpy.save` writes it".into()),
    }
}

/// Checks that the file holds as many bytes as its header promises. The reader allocates what the header says, so a header
/// that lies must be noticed before: by the reader's own parser, or the two would understand different things. What that
/// cannot understand it will not read either.
fn check_size(bytes: &[u8]) -> Result<(), String> {
    check_header(bytes)?;
    let mut rest = bytes;
    let Ok(header) = Header::from_reader(&mut rest) else { return Ok(()) };
    let (lengths, shape) = (&header.shape, shape_text(&header.shape));
    let kind = header.type_descriptor.as_string();
    let size: u64 = match kind.map(|kind| kind.trim_start_matches(ORDERS)) {
        Some("f4") => 4,
        Some("f8") => 8,
        // The reader would ask for memory first.
        _ => return Err(values_text(kind)),
    };
    let bytes_of =
        |least: u64| lengths.iter().map(|&n| (n as u64).max(least)).try_fold(size, u64::checked_mul);
    // Even without boxes, frames take memory, which the bytes of the file do not account for.
    let most_for_nothing = (64 << 10) + 64 * bytes.len() as u64;
    let found = rest.len() as u64;
    match (bytes_of(0), bytes_of(1)) {
        (_, None) => Err(format!("shape {shape} is larger than any file")),
        (Some(0), Some(frames)) if frames > most_for_nothing => {
            Err(format!("shape {shape} has too many empty frames"))
        }
        (Some(needed), _) if needed > found => {
            Err(format!("shape {shape} needs {needed} bytes of values, the file has {found}"))
        }
        _ => Ok(()),
    }
}

/// Checks that the header is complete and that its parser will not take for ever. That allocates what the header's length says, up
/// to 4 GiB, and takes twice as long for each bracket within another.
fn check_header(bytes: &[u8]) -> Result<(), String> {
    const LONGEST: u32 = 1 << 16;
    const DEEPEST: i32 = 6;
    let Some((after, length)) = header_length(bytes) else { return Ok(()) };
    let Some(header) = after.get(..length as usize) else {
        return Err(format!("the header needs {length} bytes, the file has {}", after.len()));
    };
    let mut depth = 0;
    let mut step = |byte: &u8| {
        depth += i32::from(b"([{".contains(byte)) - i32::from(b")]}".contains(byte) && depth > 0);
        depth
    };
    let deepest = header.iter().map(&mut step).max().unwrap_or(0);
    if length > LONGEST || deepest > DEEPEST {
        return Err("the header is none that numpy writes for an array of floats".into());
    }
    Ok(())
}

/// Returns the bytes after the length of the header, and this length.
fn header_length(bytes: &[u8]) -> Option<(&[u8], u32)> {
    let rest = bytes.strip_prefix(MAGIC)?;
    match *rest.first()? {
        1 => Some((rest.get(4..)?, u32::from(u16::from_le_bytes(rest.get(2..4)?.try_into().ok()?)))),
        _ => Some((rest.get(6..)?, u32::from_le_bytes(rest.get(2..6)?.try_into().ok()?))),
    }
}
