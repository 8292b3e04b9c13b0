//! The content of `.npy` files. The head is read and checked first, then the values, box by box.

use super::{BoxList, Frames, Location, MAX_BOXES, Source, brief, f64_box, one_line, too_many};
use ndarray_npy::npy::header::Header;
use pbig_core::Aabb;
use std::io::{ErrorKind, Read};

/// The first bytes of every `.npy` file.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

/// The content of an `.npy` file of boxes, see [`super::read_boxes`].
pub fn npy_boxes(bytes: &[u8]) -> Result<Vec<Aabb>, String> {
    Ok(boxes(Source::of(bytes))?.boxes)
}

/// The content of an `.npy` file of frames, see [`super::read_frames`].
pub fn npy_frames(bytes: &[u8]) -> Result<Frames, String> {
    frames(Source::of(bytes))
}

/// Reads an array of shape (N,6).
pub(super) fn boxes<R: Read>(source: Source<R>) -> Result<BoxList, String> {
    let array = Array::open(source, 2)?;
    let mut list = BoxList { boxes: Vec::with_capacity(array.room()), first_invalid: None };
    array.each_row(|v| list.push(f64_box(v), Location::Row(list.boxes.len())))?;
    Ok(list)
}

/// Reads an array of shape (F,N,6).
pub(super) fn frames<R: Read>(source: Source<R>) -> Result<Frames, String> {
    let array = Array::open(source, 3)?;
    let (count, boxes, room) = (array.frames, array.boxes, array.room());
    let mut frames: Vec<Vec<_>> = Vec::new();
    array.each_row(|v| {
        if frames.last().is_none_or(|frame| frame.len() == boxes) {
            frames.push(Vec::with_capacity(room));
        }
        let present = (!v.iter().all(|x| x.is_nan())).then(|| f64_box(v));
        frames.last_mut().expect("pushed above").push(present);
    })?;
    // Frames without boxes have no rows.
    frames.resize_with(count, Vec::new);
    Ok(Frames { boxes, frames })
}

/// An array of six columns whose head has been read and checked. One list of boxes is one frame.
struct Array<R> {
    source: Source<R>,
    frames: usize,
    boxes: usize,
    number: Number,
    is_fortran: bool,
}

/// A kind of values.
#[derive(Clone, Copy)]
struct Number {
    bytes: usize,
    is_big_endian: bool,
}

impl Number {
    /// Returns the kind that a header describes as, say, `<f4`.
    fn named(kind: &str) -> Option<Self> {
        let (bytes, is_big_endian) = match kind {
            "<f4" => (4, false),
            ">f4" => (4, true),
            "<f8" => (8, false),
            ">f8" => (8, true),
            _ => return None,
        };
        Some(Self { bytes, is_big_endian })
    }

    /// Returns a value. An f32 is the same number in f64.
    fn value(self, bytes: &[u8]) -> f64 {
        let mut eight = [0; 8];
        let used = &mut eight[..self.bytes];
        used.copy_from_slice(&bytes[..self.bytes]);
        if self.is_big_endian {
            used.reverse();
        }
        let [a, b, c, d, ..] = eight;
        if self.bytes == 4 { f32::from_le_bytes([a, b, c, d]).into() } else { f64::from_le_bytes(eight) }
    }
}

impl<R: Read> Array<R> {
    /// Reads the head of an array with this number of dimensions.
    fn open(mut source: Source<R>, dimensions: usize) -> Result<Self, String> {
        let head = read_head(&mut source.reader)?;
        source.length = source.length.map(|length| length.saturating_sub(head.len() as u64));
        let header = Header::from_reader(&mut &head[..]).map_err(|error| unreadable(&error))?;
        let kind = header.type_descriptor.as_string();
        let number = kind.and_then(|kind| Number::named(kind)).ok_or_else(|| values_text(kind))?;
        check_size(&header.shape, number.bytes as u64, source.length)?;
        let (frames, boxes) = frames_and_boxes(dimensions, &header.shape)?;
        Ok(Self { source, frames, boxes, number, is_fortran: header.layout.is_fortran() })
    }

    /// Returns the number of boxes to reserve memory for: none if the length of the file is not known.
    fn room(&self) -> usize {
        self.source.length.map_or(0, |_| self.boxes)
    }

    /// Reads the values, and passes them on in rows.
    fn each_row(mut self, mut take: impl FnMut([f64; 6])) -> Result<(), String> {
        if self.is_fortran {
            self.each_row_of_columns(take)?;
        } else {
            for _ in 0..self.frames * self.boxes {
                take(self.row()?);
            }
        }
        match self.source.reader.read(&mut [0]) {
            Ok(0) => Ok(()),
            Ok(_) => Err("more bytes follow the values".into()),
            Err(error) => Err(one_line(error)),
        }
    }

    /// Reads an array whose first index counts fastest. Its first row is complete with its last column only.
    fn each_row_of_columns(&mut self, mut take: impl FnMut([f64; 6])) -> Result<(), String> {
        let (frames, boxes) = (self.frames, self.boxes);
        let mut values = Vec::with_capacity(6 * self.room() * frames);
        for _ in 0..frames * boxes {
            values.extend(self.row()?);
        }
        for row in 0..frames * boxes {
            let first = row / boxes + frames * (row % boxes);
            take(std::array::from_fn(|column| values[first + frames * boxes * column]));
        }
        Ok(())
    }

    /// Reads the next six values.
    fn row(&mut self) -> Result<[f64; 6], String> {
        let (number, mut bytes) = (self.number, [0; 48]);
        let bytes = &mut bytes[..6 * number.bytes];
        self.source.reader.read_exact(bytes).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => "the file ends within the values".into(),
            _ => one_line(error),
        })?;
        Ok(std::array::from_fn(|k| number.value(&bytes[k * number.bytes..])))
    }
}

/// Returns the numbers of frames and of boxes in each.
fn frames_and_boxes(dimensions: usize, shape: &[usize]) -> Result<(usize, usize), String> {
    let (frames, boxes) = match (dimensions, shape) {
        (2, &[boxes, 6]) => (1, boxes),
        (3, &[frames, boxes, 6]) => (frames, boxes),
        _ => return Err(wrong_shape(dimensions, shape)),
    };
    if boxes as u64 > MAX_BOXES { Err(too_many(boxes, MAX_BOXES)) } else { Ok((frames, boxes)) }
}

fn shape_text(shape: &[usize]) -> String {
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    brief(&format!("({})", lengths.join(", ")))
}

fn wrong_shape(wanted: usize, shape: &[usize]) -> String {
    let (found, of_frames, of_boxes) = (shape_text(shape), "(F, N, 6)", "(N, 6)");
    match (wanted, shape) {
        (2, [_, _, 6]) => {
            format!("shape {found} is a list of frames: use `pbig replay`; `pbig pairs` expects {of_boxes}")
        }
        (3, [_, 6]) => {
            format!("shape {found} is one list of boxes: use `pbig pairs`; `pbig replay` expects {of_frames}")
        }
        (2, _) => format!("expected an array of shape {of_boxes}, found {found}"),
        _ => format!("expected an array of shape {of_frames}, found {found}"),
    }
}

fn unreadable(error: &impl std::fmt::Display) -> String {
    one_line(format!("not a readable .npy file: {}", brief(&error.to_string())))
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

/// Reads the magic bytes, the version, the length of the header and the header, and stops at the first of them that is wrong.
fn read_head(reader: &mut impl Read) -> Result<Vec<u8>, String> {
    let mut head = Vec::new();
    let mut more = |head: &mut Vec<u8>, bytes: u64| {
        Read::take(&mut *reader, bytes).read_to_end(head).map_err(one_line).map(|found| found as u64)
    };
    more(&mut head, 8)?;
    check_start(&head)?;
    let is_short = head.get(6) == Some(&1);
    more(&mut head, if is_short { 2 } else { 4 })?;
    let Some(length) = header_length(&head) else { return Ok(head) };
    if length > MAX_HEADER_BYTES {
        return Err(NOT_NUMPYS.into());
    }
    let found = more(&mut head, length)?;
    if found < length {
        return Err(format!("the header needs {length} bytes, the file has {found}"));
    }
    check_depth(&head[head.len() - length as usize..])?;
    Ok(head)
}

/// Checks that this is a `.npy` file.
fn check_start(bytes: &[u8]) -> Result<(), String> {
    match bytes {
        [] => Err("the file is empty".into()),
        _ if bytes.starts_with(MAGIC) => Ok(()),
        _ => Err("not a .npy file, as `numpy.save` writes it".into()),
    }
}

/// Returns the length of the header, from the bytes before it.
fn header_length(start: &[u8]) -> Option<u64> {
    match *start.get(8..)? {
        [a, b] => Some(u16::from_le_bytes([a, b]).into()),
        [a, b, c, d] => Some(u32::from_le_bytes([a, b, c, d]).into()),
        _ => None,
    }
}

/// Maximum length of a header, in bytes. A file may claim up to 4 GiB.
const MAX_HEADER_BYTES: u64 = 1 << 16;

const NOT_NUMPYS: &str = "the header is none that numpy writes for an array of floats";

/// Checks that the parser of the header will not take for ever: it takes twice as long for each bracket within another.
fn check_depth(header: &[u8]) -> Result<(), String> {
    const DEEPEST: i32 = 6;
    let mut depth = 0;
    let step = |byte: &u8| {
        depth += i32::from(b"([{".contains(byte)) - i32::from(b")]}".contains(byte) && depth > 0);
        depth
    };
    let deepest = header.iter().map(step).max().unwrap_or(0);
    if deepest > DEEPEST { Err(NOT_NUMPYS.into()) } else { Ok(()) }
}

/// Checks that a file with these bytes after its head holds exactly the values that its shape promises.
fn check_size(lengths: &[usize], size: u64, found: Option<u64>) -> Result<(), String> {
    let shape = shape_text(lengths);
    let bytes_of =
        |least: u64| lengths.iter().map(|&n| (n as u64).max(least)).try_fold(size, u64::checked_mul);
    // Even without boxes, frames take memory, which the bytes of the file do not account for.
    let most_for_nothing = (64 << 10) + 64 * found.unwrap_or(0);
    match (bytes_of(0), bytes_of(1), found) {
        (_, None, _) => Err(format!("shape {shape} is larger than any file")),
        (Some(0), Some(frames), _) if frames > most_for_nothing => {
            Err(format!("shape {shape} has too many empty frames"))
        }
        (Some(needed), _, Some(found)) if needed != found => {
            Err(format!("shape {shape} needs {needed} bytes of values, the file has {found}"))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufReader, repeat};

    /// The bytes before the values, with a length of the header that need not be true.
    fn head(kind: &str, order: &str, shape: &str) -> Vec<u8> {
        let text = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': ({shape})}}\n");
        [b"\x93NUMPY\x01\x00", &(text.len() as u16).to_le_bytes()[..], text.as_bytes()].concat()
    }

    /// A file without an end: only a look at the head lets this end.
    fn endless(start: &[u8], length: Option<u64>) -> String {
        boxes(Source { reader: BufReader::new(start.chain(repeat(0))), length }).expect_err("refused")
    }

    #[test]
    fn a_wrong_head_is_refused_before_the_values_are_read() {
        let no_npy = "not a .npy file, as `numpy.save` writes it";
        assert_eq!((endless(b"", None).as_str(), endless(b"\x93NUMPX", None).as_str()), (no_npy, no_npy));
        assert_eq!(endless(b"\x93NUMPY\x03\x00\xff\xff\xff\xff", None), NOT_NUMPYS);
        for (start, words) in [
            (head("<i4", "False", "9, 6"), "values are int32"),
            (head("<f4", "False", "9, 5"), "found (9, 5)"),
            (head("<f4", "False", "9, 8, 6"), "use `pbig replay`"),
            (head("<f4", "False", "134217729, 6"), "134217729 boxes are more than 134217728; for more"),
        ] {
            let what = endless(&start, None);
            assert!(what.contains(words), "{what}");
        }
        let start = head("<f4", "False", "9, 6");
        let what = endless(&start, Some(start.len() as u64 + 217));
        assert_eq!(what, "shape (9, 6) needs 216 bytes of values, the file has 217");
    }

    #[test]
    fn a_pipe_is_read_as_a_file_is() {
        let start = head("<f4", "False", "2, 6");
        let piped = |bytes: &[u8]| boxes(Source { reader: bytes, length: None });
        let whole = [&start[..], &[0; 48]].concat();
        assert_eq!(piped(&whole).expect("two boxes"), boxes(Source::of(&whole)).expect("two boxes"));
        assert_eq!(piped(&whole[..whole.len() - 1]).expect_err("cut"), "the file ends within the values");
        assert_eq!(endless(&start, None), "more bytes follow the values");
    }

    type BytesOf = fn(u8) -> Vec<u8>;

    /// Bytes of the numbers from 0 on.
    fn numbers(count: u8, bytes_of: BytesOf) -> Vec<u8> {
        (0..count).flat_map(bytes_of).collect()
    }

    #[test]
    fn every_kind_and_order_gives_the_same_boxes() {
        let kinds: [(&str, BytesOf); 4] = [
            ("<f4", |n| f32::from(n).to_le_bytes().into()),
            (">f4", |n| f32::from(n).to_be_bytes().into()),
            ("<f8", |n| f64::from(n).to_le_bytes().into()),
            (">f8", |n| f64::from(n).to_be_bytes().into()),
        ];
        for (kind, bytes_of) in kinds {
            let read = |order| npy_frames(&[head(kind, order, "2, 3, 6"), numbers(36, bytes_of)].concat());
            let value = |order, frame: usize, id: usize| read(order).expect("frames").frames[frame][id];
            let at = |n: f32, step: f32| {
                Aabb::new([0., 1., 2.].map(|k| n + step * k), [3., 4., 5.].map(|k| n + step * k))
            };
            // The index of a value: 18 frame + 6 box + column, or frame + 2 box + 6 column.
            assert_eq!(value("False", 1, 2), Some(at(30.0, 1.0)), "{kind}");
            assert_eq!(value("True", 1, 2), Some(at(5.0, 6.0)), "{kind}");
        }
    }
}
