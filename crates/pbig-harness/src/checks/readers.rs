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
    // Three bytes at least for a vertex, four for a face: its number of vertices, and these.
    check_mesh(Mesh::from_ply(data), [3, 4], data);
}

/// The text of an `.obj` file.
pub fn obj_reader(data: &[u8]) {
    // Seven characters at least: a letter, and three numbers after blanks.
    check_mesh(Mesh::from_obj(data), [7, 7], data);
}

/// Every mesh that is read has the elements that its faces name.
fn check_mesh(mesh: Result<Mesh, String>, [vertex, face]: [usize; 2], data: &[u8]) {
    check(mesh.as_ref().map(|mesh| vertex * mesh.vertices.len() + face * mesh.faces.len()), data);
    if let Ok(mesh) = mesh {
        let elements = mesh.elements(Some(&mesh)).expect("the same mesh");
        assert_eq!(elements.vertices.boxes.len(), mesh.vertices.len());
        assert_eq!(elements.faces.boxes.len(), mesh.faces.len());
        assert!(elements.edges.boxes.len() <= 4 * mesh.faces.len());
    }
}

fn check<E: AsRef<str>>(needed: Result<usize, E>, data: &[u8]) {
    match needed {
        Ok(bytes) => assert!(bytes <= data.len(), "{bytes} bytes of boxes in {} of file", data.len()),
        Err(what) => {
            let what = what.as_ref();
            assert!(!what.is_empty() && !what.contains(['\n', '\r']), "{what:?}");
        }
    }
}
