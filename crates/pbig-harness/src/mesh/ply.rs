//! Stanford's `.ply`, as text and binary: vertices, faces, strips of triangles and rods. The names of all else are kept.
//!
//! The crate `ply-rs-bw` refuses text such as `nan` or `.5`, and its errors are dumps. `serde-ply` takes the values of a row that
//! has too few from the next one. Neither says in which row of a binary file something is wrong.

mod body;
mod header;

use super::Mesh;
use super::reading::{MAX_LINE_BYTES, Oddity};
use crate::files::{Lines, brief, one_line};
use body::Body;
use header::{Element, Format};
use pbig_core::NO_KEY;
use std::io::BufRead;

/// The names of the vertices of a face or strip, and of a rod.
const CORNERS: [&str; 3] = ["vertex_indices", "vertex_index", "vertex_indexes"];
const ENDS: [&str; 2] = ["vertex1", "vertex2"];

pub(super) fn read(reader: impl BufRead) -> Result<Mesh, String> {
    let mut lines = Lines::new(reader, MAX_LINE_BYTES, "a line of a header, or the values of a row");
    let header = header::read(&mut lines)?;
    let body = match header.format {
        Format::Text => Body::Text { lines, at: 0 },
        Format::Binary { is_big } => Body::Binary { reader: lines.into_rest().map_err(one_line)?, is_big },
    };
    let vertices = header.elements.iter().find(|element| element.name.eq_ignore_ascii_case("vertex"));
    let vertices =
        vertices.ok_or_else(|| format!("line {}: the header has no element vertex", header.end))?.rows;
    let mut rows = Rows { body, mesh: Mesh::default(), vertices };
    header.elements.iter().filter(|element| element.rows > 0).try_for_each(|element| rows.add(element))?;
    rows.mesh.skip(&rows.body.rest()?, "");
    Ok(rows.mesh)
}

/// The rows behind a header, and the mesh of those that are read.
struct Rows<R> {
    body: Body<R>,
    mesh: Mesh,
    /// Number of vertices, from the header.
    vertices: u64,
}

impl<R: BufRead> Rows<R> {
    fn add(&mut self, element: &Element) -> Result<(), String> {
        match element.name.to_ascii_lowercase().as_str() {
            "vertex" => self.add_vertices(element),
            "face" => self.add_faces(element),
            "tristrips" if element.column(&CORNERS, true).is_ok() => self.add_strips(element),
            "edge" if element.column(&ENDS[..1], false).is_ok() => self.add_rods(element),
            _ => self.skip(element),
        }
    }

    fn skip(&mut self, element: &Element) -> Result<(), String> {
        self.mesh.skip(&[format!("element {} ({})", element.name, element.rows)], "");
        // Rows without properties take no bytes: a short file could have any number of them.
        let rows = if element.properties.is_empty() { 0 } else { element.rows };
        (0..rows).try_for_each(|row| self.body.row(element, row, &[], |_, _| Ok(())).map(|_| ()))
    }

    fn add_vertices(&mut self, element: &Element) -> Result<(), String> {
        let axis = |name| element.column(&[name], false);
        let columns = [axis("x")?, axis("y")?, axis("z")?];
        self.mesh.skip(&element.names_without(&columns), " of element vertex");
        for row in 0..element.rows {
            let mut at = [0.0; 3];
            let place = self.body.row(element, row, &columns, |axis, value| {
                at[axis] = value;
                Ok(())
            })?;
            self.mesh.add_vertex(at, place);
        }
        Ok(())
    }

    fn add_faces(&mut self, element: &Element) -> Result<(), String> {
        let column = [element.column(&CORNERS, true)?];
        self.mesh.skip(&element.names_without(&column), " of element face");
        let (mut corners, vertices) = (Vec::new(), self.vertices);
        for row in 0..element.rows {
            corners.clear();
            let place = self.body.row(element, row, &column, |_, value| {
                // A fifth one is refused below; a list can have billions.
                if corners.len() < 5 {
                    corners.push(index(value, vertices)?);
                }
                Ok(())
            })?;
            self.mesh.add_face(&corners, place).map_err(|what| element.at(place, &what))?;
        }
        Ok(())
    }

    /// Adds a triangle for each three vertices in a row. After -1 a new strip begins; a triangle that names a vertex twice only
    /// leads from one strip to the next.
    fn add_strips(&mut self, element: &Element) -> Result<(), String> {
        let column = [element.column(&CORNERS, true)?];
        self.mesh.skip(&element.names_without(&column), " of element tristrips");
        let vertices = self.vertices;
        for row in 0..element.rows {
            let (mut strip, mut length, mut short) = ([NO_KEY; 3], 0, 0);
            let place = self.body.row(element, row, &column, |_, value| {
                if value == -1.0 || value == f64::from(u32::MAX) {
                    short += u32::from(is_short(length));
                    (strip, length) = ([NO_KEY; 3], 0);
                    return Ok(());
                }
                (strip, length) = ([strip[1], strip[2], index(value, vertices)?], length + 1);
                let [a, b, c] = strip;
                if a != NO_KEY && a != b && b != c && c != a {
                    self.mesh.faces.push([a, b, c, NO_KEY]);
                }
                Ok(())
            })?;
            (0..short + u32::from(is_short(length)))
                .for_each(|_| self.mesh.notice(Oddity::ShortStrip, place));
        }
        Ok(())
    }

    fn add_rods(&mut self, element: &Element) -> Result<(), String> {
        let columns = [element.column(&ENDS[..1], false)?, element.column(&ENDS[1..], false)?];
        self.mesh.skip(&element.names_without(&columns), " of element edge");
        let (mut ends, vertices) = ([0; 2], self.vertices);
        for row in 0..element.rows {
            let place = self.body.row(element, row, &columns, |end, value| {
                ends[end] = index(value, vertices)?;
                Ok(())
            })?;
            self.mesh.add_rod(ends, place);
        }
        Ok(())
    }
}

/// Returns true for a strip that has vertices, but too few for a triangle.
fn is_short(length: u64) -> bool {
    (1..3).contains(&length)
}

/// Returns a vertex that exists.
fn index(value: f64, vertices: u64) -> Result<u32, String> {
    let text = || brief(&value.to_string());
    if value.fract() != 0.0 {
        return Err(format!("'{}' is not the number of a vertex", text()));
    }
    // Exact: no file has as many vertices as an f64 cannot count.
    let exists = value >= 0.0 && value < vertices as f64 && value < f64::from(NO_KEY);
    let what = || format!("vertex {} does not exist; the file has {vertices}, counted from 0", text());
    exists.then_some(value as u32).ok_or_else(what)
}
