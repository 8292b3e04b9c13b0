//! Stanford's `.ply`, as text and binary: vertices, faces, strips of triangles and rods. The names of all else are kept.
//!
//! The crate `ply-rs-bw` refuses text such as `nan` or `.5`, and its errors are dumps. `serde-ply` takes the values of a row that
//! has too few from the next one. Neither says in which row of a binary file something is wrong.

mod body;
mod header;

use super::Mesh;
use super::reading::MAX_LINE_BYTES;
use crate::files::{Lines, brief, one_line};
use body::Body;
use header::{Element, Format};
use pbig_core::NO_KEY;
use std::io::BufRead;

/// The names of a face's vertices, also in a strip.
const CORNERS: [&str; 3] = ["vertex_indices", "vertex_index", "vertex_indexes"];

/// The names of a rod's vertices.
const ENDS: [&str; 2] = ["vertex1", "vertex2"];

pub(super) fn read(reader: impl BufRead) -> Result<Mesh, String> {
    let mut lines = Lines::new(reader, MAX_LINE_BYTES, "a line of a header, or the values of a row");
    let header = header::read(&mut lines)?;
    let mut body = match header.format {
        Format::Text => Body::Text { lines, at: 0 },
        Format::Binary { is_big } => Body::Binary { reader: lines.into_rest().map_err(one_line)?, is_big },
    };
    let vertices = header.elements.iter().find(|element| element.name == "vertex");
    let vertices = vertices.ok_or("no element vertex in the header")?.rows;
    let mut mesh = Mesh::default();
    for element in header.elements.iter().filter(|element| element.rows > 0) {
        add(element, &mut body, &mut mesh, vertices)?;
    }
    mesh.skip(&body.rest()?, "");
    Ok(mesh)
}

/// Reads the rows of an element.
fn add(
    element: &Element,
    body: &mut Body<impl BufRead>,
    mesh: &mut Mesh,
    vertices: u64,
) -> Result<(), String> {
    match element.name.as_str() {
        "vertex" => add_vertices(element, body, mesh),
        "face" => add_faces(element, body, mesh, vertices),
        "tristrips" => add_strips(element, body, mesh, vertices),
        "edge" if element.column(&ENDS[..1], false).is_ok() => add_rods(element, body, mesh, vertices),
        name => {
            mesh.skip(&[format!("element {name} ({})", element.rows)], "");
            let is_empty = element.properties.is_empty();
            // Rows without properties take no bytes: a short file could have any number of them.
            let rows = if is_empty { 0 } else { element.rows };
            (0..rows).try_for_each(|row| body.row(element, row, &[], |_, _| Ok(())).map(|_| ()))
        }
    }
}

fn add_vertices(element: &Element, body: &mut Body<impl BufRead>, mesh: &mut Mesh) -> Result<(), String> {
    let axis = |name| element.column(&[name], false);
    let columns = [axis("x")?, axis("y")?, axis("z")?];
    mesh.skip(&element.names_without(&columns), " of element vertex");
    for row in 0..element.rows {
        let mut at = [0.0; 3];
        let place = body.row(element, row, &columns, |axis, value| {
            at[axis] = value;
            Ok(())
        })?;
        mesh.add_vertex(at, place);
    }
    Ok(())
}

fn add_faces(
    element: &Element,
    body: &mut Body<impl BufRead>,
    mesh: &mut Mesh,
    vertices: u64,
) -> Result<(), String> {
    let column = [element.column(&CORNERS, true)?];
    mesh.skip(&element.names_without(&column), " of element face");
    let mut corners = Vec::new();
    for row in 0..element.rows {
        corners.clear();
        let place = body.row(element, row, &column, |_, value| {
            // A fifth one is refused below; a list can have billions.
            if corners.len() < 5 {
                corners.push(index(value, vertices)?);
            }
            Ok(())
        })?;
        mesh.add_face(&corners, place).map_err(|what| element.at(place, &what))?;
    }
    Ok(())
}

/// Adds a triangle for each three vertices in a row. After -1 a new strip begins; a triangle that names a vertex twice only
/// leads from one strip to the next.
fn add_strips(
    element: &Element,
    body: &mut Body<impl BufRead>,
    mesh: &mut Mesh,
    vertices: u64,
) -> Result<(), String> {
    let column = [element.column(&CORNERS, true)?];
    mesh.skip(&element.names_without(&column), " of element tristrips");
    for row in 0..element.rows {
        let mut strip = [NO_KEY; 3];
        body.row(element, row, &column, |_, value| {
            let is_end = value == -1.0 || value == f64::from(u32::MAX);
            strip = if is_end { [NO_KEY; 3] } else { [strip[1], strip[2], index(value, vertices)?] };
            let [a, b, c] = strip;
            if a != NO_KEY && a != b && b != c && c != a {
                mesh.faces.push([a, b, c, NO_KEY]);
            }
            Ok(())
        })?;
    }
    Ok(())
}

fn add_rods(
    element: &Element,
    body: &mut Body<impl BufRead>,
    mesh: &mut Mesh,
    vertices: u64,
) -> Result<(), String> {
    let columns = [element.column(&ENDS[..1], false)?, element.column(&ENDS[1..], false)?];
    mesh.skip(&element.names_without(&columns), " of element edge");
    for row in 0..element.rows {
        let mut ends = [0; 2];
        let place = body.row(element, row, &columns, |end, value| {
            ends[end] = index(value, vertices)?;
            Ok(())
        })?;
        mesh.add_rod(ends, place);
    }
    Ok(())
}

/// Returns a vertex that exists.
fn index(value: f64, vertices: u64) -> Result<u32, String> {
    // Exact: a file of more vertices than 2^53 has no room anywhere.
    let exists = value >= 0.0 && value < vertices as f64 && value < f64::from(NO_KEY);
    match (value.fract() == 0.0, exists) {
        (true, true) => Ok(value as u32),
        (true, false) => Err(format!(
            "vertex {} does not exist; the file has {vertices}, counted from 0",
            brief(&value.to_string())
        )),
        _ => Err(format!("'{}' is not the number of a vertex", brief(&value.to_string()))),
    }
}
