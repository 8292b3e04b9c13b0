//! The rows behind the header of a `.ply` file.

use super::header::{Element, Property, Scalar};
use crate::files::{Lines, Location, brief, one_line};
use crate::mesh::reading::number;
use std::io::{self, BufRead, ErrorKind, Read};

/// Values one by one.
pub(super) enum Body<R> {
    /// The present line is a row, of which the bytes up to `at` are read.
    Text {
        lines: Lines<R>,
        at: usize,
    },
    Binary {
        reader: R,
        is_big: bool,
    },
}

/// The reason why a row cannot be read.
enum Fault {
    /// The file ends.
    End,
    Wrong(String),
}

impl From<String> for Fault {
    fn from(what: String) -> Self {
        Self::Wrong(what)
    }
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        if error.kind() == ErrorKind::UnexpectedEof { Self::End } else { Self::Wrong(one_line(error)) }
    }
}

impl<R: BufRead> Body<R> {
    /// Reads a row, and returns its place. `take` gets the values of some columns, each with its index in `columns`.
    pub(super) fn row(
        &mut self,
        element: &Element,
        row: u64,
        columns: &[usize],
        take: impl FnMut(usize, f64) -> Result<(), String>,
    ) -> Result<Location, String> {
        let place = self.begin(row);
        let read = place.and_then(|place| self.values(element, columns, take).map(|()| place));
        read.map_err(|fault| match fault {
            Fault::End => {
                format!("the file ends after {row} of {} rows of element {}", element.rows, element.name)
            }
            Fault::Wrong(what) => element.at(self.place(row), &what),
        })
    }

    /// Returns what is left behind the last row, in words; nothing if that is all.
    pub(super) fn rest(&mut self) -> Result<Vec<String>, String> {
        let is_more = match self {
            Self::Text { .. } => self.next_line()?,
            Self::Binary { reader, .. } => !reader.fill_buf().map_err(one_line)?.is_empty(),
        };
        let from = match self {
            Self::Text { lines, .. } => format!("all from line {}, which", lines.number),
            Self::Binary { .. } => "bytes at the end, which".into(),
        };
        Ok(is_more.then(|| format!("{from} no element of the header has")).into_iter().collect())
    }

    /// Moves to the next row.
    fn begin(&mut self, row: u64) -> Result<Location, Fault> {
        let is_there = match self {
            Self::Text { .. } => self.next_line()?,
            Self::Binary { .. } => true,
        };
        if is_there { Ok(self.place(row)) } else { Err(Fault::End) }
    }

    /// Moves to the next line that is not blank. Returns false if there is none.
    fn next_line(&mut self) -> Result<bool, String> {
        let Self::Text { lines, at } = self else { return Ok(false) };
        *at = 0;
        while lines.advance()? {
            if !lines.bytes.trim_ascii().is_empty() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn place(&self, row: u64) -> Location {
        match self {
            Self::Text { lines, .. } => Location::Line(lines.number),
            Self::Binary { .. } => Location::Row(row as usize),
        }
    }

    fn values(
        &mut self,
        element: &Element,
        columns: &[usize],
        mut take: impl FnMut(usize, f64) -> Result<(), String>,
    ) -> Result<(), Fault> {
        for (column, property) in element.properties.iter().enumerate() {
            let wanted = columns.iter().position(|wanted| *wanted == column);
            let length = property.count.map(|scalar| self.value(property, scalar));
            for _ in 0..length.map_or(Ok(1), |length| self::length(length?, property))? {
                let value = self.value(property, property.scalar)?;
                wanted.map_or(Ok(()), |wanted| take(wanted, value))?;
            }
        }
        match self.word() {
            Some(word) => {
                Err(format!("'{}' is one value too many for element {}", brief(&word), element.name).into())
            }
            None => Ok(()),
        }
    }

    fn value(&mut self, property: &Property, scalar: Scalar) -> Result<f64, Fault> {
        if let Self::Binary { reader, is_big } = self {
            return Ok(binary(reader, scalar, *is_big)?);
        }
        let about = |what| format!("property {}: {what}", property.name);
        let word = self.word().ok_or_else(|| about("the line has too few values".into()))?;
        let number = number(&word).map_err(about)?;
        // As in a binary file.
        Ok(if matches!(scalar, Scalar::F32) { f64::from(number as f32) } else { number })
    }

    /// Returns the next word of a line of text.
    fn word(&mut self) -> Option<String> {
        let Self::Text { lines, at } = self else { return None };
        let rest = &lines.bytes[*at..];
        let start = rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let end =
            rest[start..].iter().position(u8::is_ascii_whitespace).map_or(rest.len(), |end| start + end);
        *at += end;
        Some(String::from_utf8_lossy(&rest[start..end]).into_owned())
    }
}

/// Returns the length of a list.
fn length(value: f64, property: &Property) -> Result<u64, Fault> {
    let is_length = value >= 0.0 && value.fract() == 0.0 && value < f64::from(u32::MAX);
    let what =
        || format!("property {}: a list cannot have {} values", property.name, brief(&value.to_string()));
    is_length.then_some(value as u64).ok_or_else(|| what().into())
}

fn binary(reader: &mut impl Read, scalar: Scalar, is_big: bool) -> io::Result<f64> {
    let mut bytes = [0; 8];
    let used = &mut bytes[..scalar.size()];
    reader.read_exact(used)?;
    if is_big {
        used.reverse();
    }
    let bits = u64::from_le_bytes(bytes);
    Ok(match scalar {
        Scalar::I8 => f64::from(bits as i8),
        Scalar::U8 => f64::from(bits as u8),
        Scalar::I16 => f64::from(bits as i16),
        Scalar::U16 => f64::from(bits as u16),
        Scalar::I32 => f64::from(bits as i32),
        Scalar::U32 => f64::from(bits as u32),
        Scalar::F32 => f64::from(f32::from_bits(bits as u32)),
        Scalar::F64 => f64::from_bits(bits),
    })
}
