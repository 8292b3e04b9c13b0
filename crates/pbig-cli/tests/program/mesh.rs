//! Mesh files as people and programs write them: what is read, what is told about it, and what is refused with which line.

use super::{json, pbig, refused};
use serde_json::{Value, json};
use std::path::Path;

/// Three vertices of a triangle.
const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// A header and three rows; rows of the elements in `more` may follow.
fn ply(more: &str, rows: &str) -> String {
    let axes = "property float x\nproperty float y\nproperty float z\n";
    format!("ply\nformat ascii 1.0\nelement vertex 3\n{axes}{more}end_header\n0 0 0\n1 0 0\n0 1 0\n{rows}")
}

const FACE: &str = "element face 1\nproperty list uchar int vertex_indices\n";
const EDGE: &str = "element edge 2\nproperty int vertex1\nproperty int vertex2\n";

/// The text about a mesh, and its JSON.
fn read(folder: &Path, name: &str, content: impl AsRef<[u8]>) -> (String, Value) {
    std::fs::write(folder.join(name), content).expect("written");
    let args = ["pairs", "--mesh", name, "--elements", "ee,vf", "--threads", "1"];
    let (text, object) = (pbig(folder, &args), pbig(folder, &[&args[..], &["--json"]].concat()));
    (String::from_utf8(text.stdout).expect("UTF-8"), json(&object))
}

fn counts(object: &Value) -> [u64; 4] {
    ["vertices", "edges", "rods", "faces"].map(|key| object[key].as_u64().unwrap_or(u64::MAX))
}

#[test]
fn a_triangle_is_read_in_every_form_that_programs_write() {
    let folder = tempfile::tempdir().expect("a folder");
    let row = "3 0 1 2\n";
    let plain = ply(FACE, row);
    let obj = [
        format!("{OBJ}f 1 2 3"),
        format!("{OBJ}f 1 2 3 \\"),
        format!("{OBJ}f 1 2\\\n3"),
        format!("{OBJ}f 1 2 3# all\n"),
        format!("\u{feff}# a\n{OBJ}f 1/1 2//2 -1/3/3\n").replace('\n', "\r"),
        format!("{OBJ}fo +1 +2 +3\n").replace('0', "0d0").replace(' ', "\t"),
    ];
    let text = [
        plain.replace("\n0 0 0\n", "\nnan .5 5.\n"),
        plain.replace("\n0 0 0\n", "\n-inf 1e3 -.5\n\n"),
        plain.replace('\n', "\r"),
        plain.replace('\n', "\r\n"),
        plain.replace("ply", "\u{feff}PLY").replace("element", "\n \telement").replace("float x", "float X"),
        plain.replace("vertex 3", "Vertex 3").replace("face 1", "FACE 1").replace("ascii", "ASCII"),
        plain.replace("3 0 1 2", "3.0 0.0 1.0 2.0").replace("uchar", "float32"),
        plain.replace("vertex_indices", "vertex_index").replace("ascii 1.0", "ascii"),
        ply(&format!("{FACE}property float a.b:c\n"), "3 0 1 2 7\n"),
        ply("element tristrips 1\nproperty list int int vertex_indices\n", "7 0 1 -1 0 1 2 -1\n"),
    ];
    let files = obj.iter().map(|text| ("a.obj", text)).chain(text.iter().map(|text| ("a.ply", text)));
    for (name, text) in files {
        assert_eq!(counts(&read(folder.path(), name, text).1), [3, 3, 0, 1], "{text:?}");
    }
}

#[test]
fn rods_are_edges_without_faces() {
    let folder = tempfile::tempdir().expect("a folder");
    // Two rods that cross, one that goes on, and a triangle above them.
    let rods = "v 0 0 0\nv 2 2 0\nv 0 2 0\nv 2 0 0\nv 4 0 0\nl 1 2\nl 3 4 5\n";
    let (text, object) = read(folder.path(), "a.obj", rods);
    assert_eq!(counts(&object), [5, 3, 3, 0]);
    assert!(
        text.starts_with("5 vertices, 3 edges (3 rods), 0 faces\na.obj: no faces; rods have edges"),
        "{text}"
    );
    let pairs = ["-o", "out.csv"];
    let args = ["pairs", "--mesh", "a.obj", "--elements"];
    pbig(folder.path(), &[&args[..], &["ee"], &pairs].concat());
    // Edges by larger and then smaller vertex: 2-1, 4-3, 5-4. The last two have a vertex in common.
    assert_eq!(std::fs::read_to_string(folder.path().join("out.csv")).expect("pairs"), "a,b\n0,1\n0,2\n");
    let (_, object) = read(folder.path(), "a.ply", ply(&format!("{FACE}{EDGE}"), "3 0 1 2\n0 1\n2 2\n"));
    // A rod along a side of the face is the same edge.
    assert_eq!(counts(&object), [3, 3, 1, 1]);
    let (_, object) = read(folder.path(), "b.ply", ply(EDGE, "0 1\n2 1\n"));
    assert_eq!(counts(&object), [3, 2, 2, 0]);
}

#[test]
fn what_is_odd_or_not_read_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let nan = OBJ.replace("1 0 0", "1 nan 0");
    let camera = "element camera 2\nproperty float view\n";
    for (name, content, told) in [
        ("a.obj", format!("{OBJ}f 1 2 3\nvn 0 0 1\nusemtl x\n"), &[][..]),
        (
            "a.obj",
            format!("{OBJ}f 1 1 2\nf 1 2 3\n"),
            &["faces that name a vertex twice: 1, the first in line 4"],
        ),
        (
            "a.obj",
            format!("{OBJ}f 1 2 3\nl 2 2\n"),
            &["rods from a vertex to itself, left out: 1, the first in line 5"],
        ),
        ("a.obj", OBJ.into(), &["no faces and no rods"]),
        ("a.obj", format!("{nan}f 1 2 3\n"), &["vertices with a NaN: 1, the first is vertex 2 in line 2"]),
        (
            "a.obj",
            format!("{OBJ}f 1 2 3\np 1\nvp 0\ncurv 0 1 1 2\np 2\n"),
            &["not read: curv (1), p (2), vp (1)"],
        ),
        ("a.ply", ply("", ""), &["no faces and no rods"]),
        ("a.ply", ply(FACE, "3 0 0 1\n"), &["faces that name a vertex twice: 1, the first in line 13"]),
        ("a.ply", ply(&format!("{FACE}{camera}"), "3 0 1 2\n0\n0\n"), &["not read: element camera (2)"]),
        (
            "a.ply",
            ply(&format!("{FACE}property uchar red\nproperty list int int b\n"), "3 0 1 2 9 0\n"),
            &["not read: red, b of element face"],
        ),
        (
            "a.ply",
            ply(FACE, "3 0 1 2\nmore\n"),
            &["not read: all from line 14, which no element of the header has"],
        ),
    ] {
        let (text, object) = read(folder.path(), name, &content);
        let told: Vec<String> = told.iter().map(|note| format!("{name}: {note}")).collect();
        assert_eq!(object["notes"], json!(told), "{content}");
        assert!(told.iter().all(|note| text.contains(&format!("\n{note}\n"))), "{text}");
    }
    let (text, _) = read(folder.path(), "a.obj", format!("{nan}f 1 2 3\n"));
    assert!(text.contains("vertex (2 elements invalid: e 0, e 2)"), "{text}");
    assert!(text.contains("vertex (2 elements invalid: v 1, f 0)"), "{text}");
}

#[test]
fn a_fault_is_told_in_one_line_with_the_words_of_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let number = "is not a number such as -0.5, 1e3 or nan";
    let binary = |rows: &[u8]| {
        [
            ply(FACE, "")
                .replace("ascii", "binary_little_endian")
                .split("0 0 0\n")
                .next()
                .unwrap_or_default()
                .as_bytes(),
            rows,
        ]
        .concat()
    };
    let cases: Vec<(&str, Vec<u8>, String)> = vec![
        ("a.obj", OBJ.replace("0 1 0", "0 1 1.#INF").into(), format!("line 3: '1.#INF' {number}")),
        ("a.obj", OBJ.replace("0 1 0", "0 1 -1.#IND00").into(), format!("line 3: '-1.#IND00' {number}")),
        ("a.obj", OBJ.replace("0 1 0", "0 1.#QNAN0 1").into(), format!("line 3: '1.#QNAN0' {number}")),
        ("a.obj", format!("{OBJ}f 1 2 9\n").into(), "line 4: vertex 9 does not exist; the file has 3".into()),
        ("a.obj", format!("{OBJ}l 1 2 9\n").into(), "line 4: vertex 9 does not exist; the file has 3".into()),
        (
            "a.obj",
            format!("{OBJ}f 1 2\n").into(),
            "line 4: expected a face of 3 or 4 vertices, found 2".into(),
        ),
        ("a.obj", b"\x1f\x8b\x08\0".to_vec(), "this is compressed; unpack it first".into()),
        (
            "a.ply",
            ply(FACE, "3 0 1 9\n").into(),
            "line 13: vertex 9 does not exist; the file has 3, counted from 0".into(),
        ),
        (
            "a.ply",
            ply(EDGE, "0 1\n1 7\n").into(),
            "line 15: vertex 7 does not exist; the file has 3, counted from 0".into(),
        ),
        (
            "a.ply",
            ply(FACE, "3 0 1 two\n").into(),
            format!("line 13: property vertex_indices: 'two' {number}"),
        ),
        ("a.ply", "solid x\n".into(), "line 1: a .ply file begins with a line `ply`".into()),
        ("a.ply", binary(&[0; 30]), "the file ends after 2 of 3 rows of element vertex".into()),
        (
            "a.ply",
            binary(&[&[0; 36][..], &[3], &[0; 8], &[9, 0, 0, 0]].concat()),
            "element face, row 0, counted from 0: vertex 9 does not exist; the file has 3, counted from 0"
                .into(),
        ),
    ];
    for (name, content, wanted) in cases {
        std::fs::write(folder.path().join(name), content).expect("written");
        for json in [&[][..], &["--json"]] {
            let args = [&["pairs", "--mesh", name, "--elements", "ee"], json].concat();
            assert_eq!(refused(&pbig(folder.path(), &args), &[]), format!("pbig: {name}: {wanted}"));
        }
    }
}

#[test]
fn frames_of_different_meshes_say_where_they_differ() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    let quad = format!("{OBJ}v 1 1 0\n");
    write("a.obj", &format!("{quad}f 1 2 3\nf 2 4 3\n"));
    write("turned.obj", &format!("{quad}f 1 2 3\nf 1 4 3\n"));
    write("less.obj", &format!("{quad}f 1 2 3\n"));
    write("vertices.obj", &quad);
    let next = |name: &str, more: &[&str]| {
        let args = ["pairs", "--mesh", "a.obj", "--elements", "ee", "--next", name];
        pbig(folder.path(), &[&args[..], more].concat())
    };
    let other = "pbig: turned.obj: not a frame of the same mesh: its face 1 (counted from 0) has the vertices 1 4 3, the other's 2 4 3";
    assert_eq!(refused(&next("turned.obj", &[]), &[]), other);
    refused(&next("less.obj", &[]), &["less.obj: not a frame of the same mesh: it has 1 face, the other 2"]);
    assert_eq!(counts(&json(&next("vertices.obj", &["--json"]))), [4, 5, 0, 2]);
    write("nan.obj", &quad.replace("1 1 0", "1 1 nan"));
    let strict = "nan.obj: line 4: vertex 4 (counted from 1) has a NaN; mend it, or leave out --strict";
    refused(&next("nan.obj", &["--strict"]), &[strict]);
    assert_eq!(json(&next("nan.obj", &["--json"]))["searches"][0]["invalid"], 2);
}

#[test]
fn a_mesh_in_place_of_boxes_is_told_the_option() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("a.csv"), "0,0,0,1,1,1\n").expect("written");
    let wanted = "cloth.OBJ: this is a mesh; use --mesh cloth.OBJ --elements ee, or vf";
    refused(&pbig(folder.path(), &["pairs", "cloth.OBJ"]), &[wanted]);
    refused(&pbig(folder.path(), &["pairs", "a.csv", "--with", "cloth.OBJ"]), &[wanted]);
}
