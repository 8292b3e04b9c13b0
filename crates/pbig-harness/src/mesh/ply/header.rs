//! The header of a `.ply` file.

use crate::files::{Lines, Location, brief};
use std::io::BufRead;

/// The lines that a header has.
const KNOWN: &str = "format, comment, obj_info, element, property or end_header";

pub(super) struct Header {
    pub(super) format: Format,
    pub(super) elements: Vec<Element>,
}

pub(super) enum Format {
    Text,
    Binary { is_big: bool },
}

/// A kind of rows.
pub(super) struct Element {
    pub(super) name: String,
    pub(super) rows: u64,
    pub(super) properties: Vec<Property>,
}

/// A column of an element: a number, or a list if `count` has the type of its length.
pub(super) struct Property {
    pub(super) name: String,
    pub(super) count: Option<Scalar>,
    pub(super) scalar: Scalar,
}

#[derive(Clone, Copy)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    /// Returns the number of bytes in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

impl Element {
    /// Returns the column of a list or number, by any of its names.
    pub(super) fn column(&self, names: &[&str], is_list: bool) -> Result<usize, String> {
        let is_one = |property: &Property| {
            property.count.is_some() == is_list
                && names.iter().any(|name| property.name.eq_ignore_ascii_case(name))
        };
        let mut found = (0..self.properties.len()).filter(|column| is_one(&self.properties[*column]));
        let what = format!("{} {}", if is_list { "list" } else { "number" }, names[0]);
        match (found.next(), found.next()) {
            (Some(column), None) => Ok(column),
            (None, _) => Err(format!("element {} has no {what}", self.name)),
            _ => Err(format!("element {} has more than one {what}", self.name)),
        }
    }

    /// Returns the names of the other columns.
    pub(super) fn names_without(&self, columns: &[usize]) -> Vec<String> {
        let others = self.properties.iter().enumerate().filter(|(column, _)| !columns.contains(column));
        others.map(|(_, property)| property.name.clone()).collect()
    }

    /// Returns a message with its place.
    pub(super) fn at(&self, place: Location, what: &str) -> String {
        match place {
            Location::Line(_) => format!("{place}: {what}"),
            Location::Row(_) => format!("element {}, {place}: {what}", self.name),
        }
    }
}

/// Reads up to `end_header`.
pub(super) fn read(lines: &mut Lines<impl BufRead>) -> Result<Header, String> {
    let (mut format, mut elements) = (None, vec![]);
    while lines.advance()? {
        // Comments may be in any encoding.
        let line = String::from_utf8_lossy(&lines.bytes);
        let words: Vec<&str> = line.trim_start_matches('\u{feff}').split_whitespace().collect();
        let at = |what| format!("line {}: {what}", lines.number);
        match words[..] {
            [word] if lines.number == 1 && word.eq_ignore_ascii_case("ply") => {}
            _ if lines.number == 1 => return Err(at("a .ply file begins with a line `ply`".into())),
            ["end_header"] => {
                let format = format
                    .ok_or_else(|| at("the header has no line `format ascii 1.0` or similar".into()))?;
                return Ok(Header { format, elements });
            }
            ["format", name, ..] => format = Some(format_of(name).map_err(at)?),
            _ => add(&words, &mut elements).map_err(at)?,
        }
    }
    Err(format!("line {}: the file ends before a line `end_header`", lines.number))
}

/// Adds an element, or a property of the last element.
fn add(words: &[&str], elements: &mut Vec<Element>) -> Result<(), String> {
    match *words {
        [] | ["comment" | "obj_info", ..] => Ok(()),
        ["element", name, rows] => {
            if elements.iter().any(|element| element.name == brief(name)) {
                return Err(format!("a second element {}", brief(name)));
            }
            let wrong = |_| format!("'{}' is not a number of rows", brief(rows));
            elements.push(Element {
                name: brief(name),
                rows: rows.parse().map_err(wrong)?,
                properties: vec![],
            });
            Ok(())
        }
        ["property", ref rest @ ..] => {
            let element = elements.last_mut().ok_or("a property before the first element")?;
            element.properties.push(property(rest)?);
            Ok(())
        }
        ["format" | "element" | "end_header", ..] => {
            Err("expected `format NAME VERSION`, `element NAME ROWS` or `end_header`".into())
        }
        [word, ..] => Err(format!("'{}' begins no line of a header; expected {KNOWN}", brief(word))),
    }
}

fn format_of(name: &str) -> Result<Format, String> {
    match name {
        "ascii" => Ok(Format::Text),
        "binary_little_endian" => Ok(Format::Binary { is_big: false }),
        "binary_big_endian" => Ok(Format::Binary { is_big: true }),
        _ => Err(format!(
            "'{}' is no format; expected ascii, binary_little_endian or binary_big_endian",
            brief(name)
        )),
    }
}

fn property(words: &[&str]) -> Result<Property, String> {
    match *words {
        ["list", count, of, name] => {
            Ok(Property { name: brief(name), count: Some(scalar(count)?), scalar: scalar(of)? })
        }
        [of, name] => Ok(Property { name: brief(name), count: None, scalar: scalar(of)? }),
        _ => Err("expected `property TYPE NAME` or `property list TYPE TYPE NAME`".into()),
    }
}

fn scalar(word: &str) -> Result<Scalar, String> {
    Ok(match word {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => {
            let known = "char, uchar, short, ushort, int, uint, float, double, or int8 to float64";
            return Err(format!("'{}' is no type; expected {known}", brief(word)));
        }
    })
}
