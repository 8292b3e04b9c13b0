//! Wavefront's `.obj`: vertices and faces. All else is skipped.
//!
//! The crate `tobj` numbers vertices anew for each object, and its errors name no line.

use super::{Mesh, face};
use crate::files::{Lines, MAX_LINE_BYTES, brief, too_long};
use std::io::BufRead;

/// What a line should have.
const EXPECTED: &str = "a vertex or a face";

pub(super) fn read(reader: impl BufRead) -> Result<Mesh, String> {
    let (mut mesh, mut lines) = (Mesh::default(), Lines::new(reader, EXPECTED));
    let mut whole = String::new();
    while lines.advance()? {
        let at = |what: String| format!("line {}: {what}", lines.number);
        // Comments and names may be in any encoding.
        let line = String::from_utf8_lossy(&lines.bytes);
        let line = line.trim_start_matches('\u{feff}').split('#').next().unwrap_or_default().trim_end();
        match line.strip_suffix('\\') {
            Some(_) if whole.len() > MAX_LINE_BYTES => return Err(at(too_long(EXPECTED))),
            Some(begun) => whole += begun,
            None => take(&(std::mem::take(&mut whole) + line), &mut mesh).map_err(at)?,
        }
    }
    if mesh.vertices.is_empty() { Err("no vertices (lines that begin with `v`)".into()) } else { Ok(mesh) }
}

fn take(line: &str, mesh: &mut Mesh) -> Result<(), String> {
    let mut words = line.split_whitespace();
    match words.next() {
        Some("v") => {
            let numbers: Vec<f64> = words.map(number).collect::<Result<_, _>>()?;
            let [x, y, z, ..] = numbers[..] else { return Err("a vertex has three coordinates".into()) };
            mesh.vertices.push([x, y, z]);
        }
        Some("f") => {
            let corners: Vec<u32> =
                words.map(|word| corner(word, mesh.vertices.len())).collect::<Result<_, _>>()?;
            mesh.faces.push(face(&corners)?);
        }
        _ => {}
    }
    Ok(())
}

fn number(word: &str) -> Result<f64, String> {
    word.parse().map_err(|_| format!("'{}' is no number", brief(word)))
}

/// Returns the vertex of `vertex/texture/normal`: counted from 1, or backwards from the last one with -1.
fn corner(word: &str, vertices: usize) -> Result<u32, String> {
    let number = word.split('/').next().and_then(|vertex| vertex.parse::<i64>().ok());
    let index = number
        .and_then(|number| if number < 0 { vertices as i64 + number } else { number - 1 }.try_into().ok());
    index.ok_or_else(|| format!("'{}' is no vertex", brief(word)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufReader, Read, repeat};

    /// Readers without an end: only a bound lets this end.
    #[test]
    fn a_line_without_an_end_is_refused() {
        let refused = |reader: &mut dyn Read| read(BufReader::new(reader)).expect_err("refused");
        assert_eq!(
            refused(&mut repeat(b'v')),
            "line 1: longer than 65536 bytes; expected a vertex or a face"
        );
        let continued = "v 1 2 3\\\n".repeat(10_000);
        assert!(refused(&mut continued.as_bytes()).contains(": longer than 65536 bytes; expected"));
    }

    #[test]
    fn a_line_that_goes_on_in_the_next_one_is_one() {
        let mesh = read(&b"v 0 0 \\\r\n 1\nv 1 0 0\nv 0 1 0\nf 1 2 \\\n-1\n"[..]).expect("a triangle");
        assert_eq!((mesh.vertices[0], mesh.faces.len()), ([0.0, 0.0, 1.0], 1));
    }
}
