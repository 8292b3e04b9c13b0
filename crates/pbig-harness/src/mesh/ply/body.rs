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

impl<R: BufRead> Body<R> {
    /// Reads a row, and returns its place. `take` gets the values of some columns, each with its index in `columns`.
    pub(super) fn row(
        &mut self,
        element: &Element,
        row: u64,
        columns: &[usize],
        take: impl FnMut(usize, f64) -> Result<(), String>,
    ) -> Result<Location, String> {
        let (rows, name) = (element.rows, &element.name);
        let ends = || format!("the file ends after {row} of {rows} rows of element {name}");
        if !self.has_more()? {
            return Err(ends());
        }
        let place = self.place(row);
        self.values(element, columns, take).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => ends(),
            _ => element.at(place, &one_line(error)),
        })?;
        Ok(place)
    }

    /// Returns what is left behind the last row, in words; nothing if that is all.
    pub(super) fn rest(&mut self) -> Result<Vec<String>, String> {
        let is_more = self.has_more()?;
        let from = match self {
            Self::Text { lines, .. } => format!("all from line {}, which", lines.number),
            Self::Binary { .. } => "bytes at the end, which".into(),
        };
        Ok(is_more.then(|| format!("{from} no element of the header has")).into_iter().collect())
    }

    /// Returns true if the file goes on. In a text, moves to the next line that is not blank.
    fn has_more(&mut self) -> Result<bool, String> {
        let (lines, at) = match self {
            Self::Text { lines, at } => (lines, at),
            Self::Binary { reader, .. } => return Ok(!reader.fill_buf().map_err(one_line)?.is_empty()),
        };
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
    ) -> io::Result<()> {
        for (column, property) in element.properties.iter().enumerate() {
            let wanted = columns.iter().position(|wanted| *wanted == column);
            let length = match property.count {
                Some(scalar) => length(self.value(property, scalar)?, property)?,
                None => 1,
            };
            for _ in 0..length {
                let value = self.value(property, property.scalar)?;
                if let Some(wanted) = wanted {
                    take(wanted, value).map_err(io::Error::other)?;
                }
            }
        }
        let Some(word) = self.word() else { return Ok(()) };
        let what = format!("'{}' is one value too many for element {}", brief(&word), element.name);
        Err(io::Error::other(what))
    }

    fn value(&mut self, property: &Property, scalar: Scalar) -> io::Result<f64> {
        if let Self::Binary { reader, is_big } = self {
            return binary(reader, scalar, *is_big);
        }
        let about = |what| io::Error::other(format!("property {}: {what}", property.name));
        let word = self.word().ok_or_else(|| about("the line has too few values".into()))?;
        let number = number(&word).map_err(about)?;
        // As in a binary file.
        Ok(if matches!(scalar, Scalar::Float) { f64::from(number as f32) } else { number })
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
fn length(value: f64, property: &Property) -> io::Result<u64> {
    let is_length = value >= 0.0 && value.fract() == 0.0 && value <= f64::from(u32::MAX);
    let what = || {
        let found = brief(&value.to_string());
        io::Error::other(format!("property {}: a list cannot have {found} values", property.name))
    };
    is_length.then_some(value as u64).ok_or_else(what)
}

fn binary(reader: &mut impl Read, scalar: Scalar, is_big: bool) -> io::Result<f64> {
    let length = match scalar {
        Scalar::Signed(length) | Scalar::Unsigned(length) => length,
        Scalar::Float => 4,
        Scalar::Double => 8,
    };
    let mut bytes = [0; 8];
    reader.read_exact(&mut bytes[..length])?;
    if is_big {
        bytes[..length].reverse();
    }
    let bits = u64::from_le_bytes(bytes);
    let unused = 64 - 8 * length;
    Ok(match scalar {
        Scalar::Signed(_) => ((bits << unused) as i64 >> unused) as f64,
        Scalar::Unsigned(_) => bits as f64,
        Scalar::Float => f64::from(f32::from_bits(bits as u32)),
        Scalar::Double => f64::from_bits(bits),
    })
}
