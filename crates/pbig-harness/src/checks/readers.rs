//! Files of any content: no more boxes than the bytes can hold, or one line of error.

use crate::files;
use crate::mesh::Mesh;

/// The bytes of an `.npy` file, read as boxes and as frames.
pub fn npy_reader(data: &[u8]) {
    check(files::npy_boxes(data).map(|boxes| 24 * boxes.len()), data);
    let size = |frames: files::Frames| 24 * frames.frames.iter().map(Vec::len).sum::<usize>();
    check(files::npy_frames(data).map(size), data);
}

/// The text of a `.csv` file.
pub fn csv_reader(data: &[u8]) {
    // Eleven characters at least: six numbers of a digit, five commas.
    check(files::csv_boxes(data).map(|boxes| 11 * boxes.len()), data);
}

/// The bytes of a `.ply` file.
pub fn ply_reader(data: &[u8]) {
    // At least: three bytes a vertex, one a triangle of a strip, two a rod.
    check_mesh(&Mesh::from_ply(data), [3, 1, 2], data);
}

/// The text of an `.obj` file.
pub fn obj_reader(data: &[u8]) {
    let mesh = Mesh::from_obj(data);
    // At least: a letter and three numbers after blanks; a number after a blank for each rod of a line.
    check_mesh(&mesh, [7, 7, 2], data);
    if !data.contains(&b'\r') {
        let lines: Vec<&[u8]> = data.split(|byte| *byte == b'\n').collect();
        let other = Mesh::from_obj(&lines.join(&b"\r\n"[..])[..]);
        // Text, because a NaN differs from itself.
        assert_eq!(format!("{mesh:?}"), format!("{other:?}"), "line ends make a difference");
    }
}

/// Every mesh that is read has the elements that its faces and rods name.
fn check_mesh(mesh: &Result<Mesh, String>, [vertex, face, rod]: [usize; 3], data: &[u8]) {
    let bytes = |mesh: &Mesh| vertex * mesh.vertices.len() + face * mesh.faces.len() + rod * mesh.rods.len();
    check(mesh.as_ref().map(bytes), data);
    if let Ok(mesh) = mesh {
        let elements = mesh.elements(Some(mesh)).expect("the same mesh");
        assert_eq!(elements.vertices.boxes.len(), mesh.vertices.len());
        assert_eq!(elements.faces.boxes.len(), mesh.faces.len());
        assert!(elements.edges.boxes.len() <= 4 * mesh.faces.len() + mesh.rods.len());
        mesh.notes().iter().for_each(|note| check_words(note, 4000, data));
    }
}

fn check<E: AsRef<str>>(needed: Result<usize, E>, data: &[u8]) {
    match needed {
        Ok(bytes) => assert!(bytes <= data.len(), "{bytes} bytes of boxes in {} of file", data.len()),
        // The program cuts a message of more than 600 characters, and the file's name comes before.
        Err(what) => check_words(what.as_ref(), 500, data),
    }
}

/// A message is one line, and no dump of a type. A file may have such words itself.
fn check_words(what: &str, longest: usize, data: &[u8]) {
    assert!(!what.is_empty() && !what.contains(['\n', '\r']) && what.chars().count() <= longest, "{what:?}");
    let text = String::from_utf8_lossy(data);
    for dump in ["{", "Error", "Some(", "None", "kind:", "\\u"] {
        assert!(!what.contains(dump) || text.contains(dump), "{what:?}");
    }
}
