//! The header of a `.ply` file.

use crate::files::{Lines, Location, brief};
use std::io::BufRead;

pub(super) struct Header {
    /// Number of the last line.
    pub(super) end: usize,
    pub(super) format: Format,
    pub(super) elements: Vec<Element>,
}

pub(super) enum Format {
    Text,
    Binary { is_big: bool },
}

/// A kind of rows.
pub(super) struct Element {
    /// Number of its line in the header.
    line: usize,
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

/// The type of a number, with its bytes in a binary file.
#[derive(Clone, Copy)]
pub(super) enum Scalar {
    Signed(usize),
    Unsigned(usize),
    Float,
    Double,
}

impl Element {
    /// Returns the column of a list or number, by any of its names.
    pub(super) fn column(&self, names: &[&str], is_list: bool) -> Result<usize, String> {
        let has_name =
            |property: &Property| names.iter().any(|name| property.name.eq_ignore_ascii_case(name));
        let columns = self.properties.iter().enumerate();
        let mut found = columns.filter(|(_, of)| of.count.is_some() == is_list && has_name(of));
        let what = if is_list { "list" } else { "number" };
        match (found.next(), found.next()) {
            (Some((column, _)), None) => Ok(column),
            (None, _) => Err(format!("line {}: element {} has no {what} {}", self.line, self.name, names[0])),
            _ => Err(format!(
                "line {}: element {} has more than one {what} {}",
                self.line, self.name, names[0]
            )),
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
        let at = |what: String| format!("line {}: {what}", lines.number);
        match words[..] {
            [word] if lines.number == 1 && word.eq_ignore_ascii_case("ply") => {}
            _ if lines.number == 1 => return Err(at("a .ply file begins with a line `ply`".into())),
            [] | ["comment" | "obj_info", ..] => {}
            ["format", ..] if format.is_some() => return Err(at("a second line `format`".into())),
            ["format", name, ..] => format = Some(format_of(name).map_err(at)?),
            ["element", name, rows] => {
                elements.push(element(lines.number, name, rows, &elements).map_err(at)?)
            }
            ["property", ref rest @ ..] => {
                let element: Option<&mut Element> = elements.last_mut();
                let element = element.ok_or_else(|| at("a property before the first element".into()))?;
                element.properties.push(property(rest).map_err(at)?);
            }
            ["end_header"] => {
                let format = format.ok_or_else(|| at("no line `format ascii 1.0` before it".into()))?;
                return Ok(Header { end: lines.number, format, elements });
            }
            _ => {
                let known = "`format NAME`, `element NAME ROWS`, `property TYPE NAME` or `end_header`";
                return Err(at(format!("'{}' is no line of a header; expected {known}", brief(line.trim()))));
            }
        }
    }
    Err(format!("line {}: the file ends before a line `end_header`", lines.number))
}

fn format_of(name: &str) -> Result<Format, String> {
    let known = "ascii, binary_little_endian or binary_big_endian";
    match name.to_ascii_lowercase().as_str() {
        "ascii" => Ok(Format::Text),
        "binary_little_endian" => Ok(Format::Binary { is_big: false }),
        "binary_big_endian" => Ok(Format::Binary { is_big: true }),
        _ => Err(format!("'{}' is no format; expected {known}", brief(name))),
    }
}

fn element(line: usize, name: &str, rows: &str, before: &[Element]) -> Result<Element, String> {
    let name = brief(name);
    if before.iter().any(|element| element.name.eq_ignore_ascii_case(&name)) {
        return Err(format!("a second element {name}"));
    }
    let wrong = |_| format!("'{}' is not a number of rows", brief(rows));
    Ok(Element { line, name, rows: rows.parse().map_err(wrong)?, properties: vec![] })
}

fn property(words: &[&str]) -> Result<Property, String> {
    let (count, scalar_of, name) = match *words {
        ["list", count, of, name] => (Some(scalar(count)?), of, name),
        [of, name] => (None, of, name),
        _ => return Err("expected `property TYPE NAME` or `property list TYPE TYPE NAME`".into()),
    };
    Ok(Property { name: brief(name), count, scalar: scalar(scalar_of)? })
}

fn scalar(word: &str) -> Result<Scalar, String> {
    let known = "char, uchar, short, ushort, int, uint, float, double, or int8 to float64";
    Ok(match word.to_ascii_lowercase().as_str() {
        "char" | "int8" => Scalar::Signed(1),
        "uchar" | "uint8" => Scalar::Unsigned(1),
        "short" | "int16" => Scalar::Signed(2),
        "ushort" | "uint16" => Scalar::Unsigned(2),
        "int" | "int32" => Scalar::Signed(4),
        "uint" | "uint32" => Scalar::Unsigned(4),
        "float" | "float32" => Scalar::Float,
        "double" | "float64" => Scalar::Double,
        _ => return Err(format!("'{}' is no type; expected {known}", brief(word))),
    })
}
