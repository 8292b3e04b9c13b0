//! Stanford's `.ply`, as text and binary, by the crate `ply-rs-bw`.

use super::{Mesh, face};
use pbig_core::Keys;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType};
use std::io::BufRead;

pub(super) fn read(reader: impl BufRead) -> Result<Mesh, String> {
    let (mut reader, mut mesh) = (Reader::new(reader), Mesh::default());
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(text)?;
    // Rows without properties take no bytes: a short file could have any number of them.
    let is_empty = |element: &&ElementDef| element.properties.is_empty() && element.count > 0;
    if let Some(ElementDef { name, .. }) = header.elements.values().find(is_empty) {
        return Err(format!("element `{name}` has no property"));
    }
    let vertex = header.elements.get("vertex").ok_or("no element `vertex`")?;
    for axis in AXES {
        let data_type = vertex.properties.get(axis).map(|property| &property.data_type);
        if !matches!(data_type, Some(PropertyType::Scalar(_))) {
            return Err(format!("element `vertex` has no number `{axis}`"));
        }
    }
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                mesh.vertices = rows(&mut reader, element, &header)?.iter().map(|Point(at)| *at).collect()
            }
            "face" => mesh.faces = faces(&rows(&mut reader, element, &header)?)?,
            _ => drop(rows::<Skipped>(&mut reader, element, &header)?),
        }
    }
    Ok(mesh)
}

fn rows<R: PropertyAccess>(
    reader: &mut Reader<impl BufRead>,
    element: &ElementDef,
    header: &Header,
) -> Result<Vec<R>, String> {
    let rows = Parser::new().read_payload_for_element(reader, element, header);
    rows.map_err(|error| format!("element `{}`: {}", element.name, text(error)))
}

fn text(error: ParseError) -> String {
    error.to_string()
}

fn faces(rows: &[Corners]) -> Result<Vec<Keys>, String> {
    let at = |i: usize, what: &str| format!("face {i} (counted from 0): {what}");
    let row = |(i, Corners(corners)): (usize, &Corners)| {
        let corners = corners.as_ref().ok_or_else(|| at(i, "a vertex is no index"))?;
        face(corners).map_err(|what| at(i, &what))
    };
    rows.iter().enumerate().map(row).collect()
}

/// A row of no interest.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

/// The names of a vertex's coordinates.
const AXES: [&str; 3] = ["x", "y", "z"];

/// The place of a vertex.
struct Point([f64; 3]);

impl PropertyAccess for Point {
    fn new() -> Self {
        Self([f64::NAN; 3])
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = AXES.iter().position(|axis| *axis == name);
        let Some((axis, value)) = axis.zip(scalar(&property)) else { return PropertyAccessResult::Ignored };
        self.0[axis] = value;
        PropertyAccessResult::Set
    }
}

fn scalar(property: &Property) -> Option<f64> {
    Some(match *property {
        Property::Float(x) => x.into(),
        Property::Double(x) => x,
        Property::Char(x) => x.into(),
        Property::UChar(x) => x.into(),
        Property::Short(x) => x.into(),
        Property::UShort(x) => x.into(),
        Property::Int(x) => x.into(),
        Property::UInt(x) => x.into(),
        _ => return None,
    })
}

/// The vertices of a face; none if one of them is negative or no integer, or the file does not have them.
struct Corners(Option<Vec<u32>>);

impl PropertyAccess for Corners {
    fn new() -> Self {
        Self(None)
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !["vertex_indices", "vertex_index"].contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        self.0 = property.to_u32_list();
        PropertyAccessResult::Set
    }
}
