use super::Mesh;
use pbig_core::NO_KEY;

fn read(name: &str, content: &[u8]) -> Result<Mesh, String> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join(name), content).expect("written");
    let read = Mesh::read(&folder.path().join(name));
    read.map_err(|what| what.split_once(&format!("{name}: ")).expect("the file is named").1.to_owned())
}

const HEAD: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty double y\nproperty float z\n\
                    property uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";

/// The mesh of [`HEAD`] as bytes.
fn binary(is_big: bool) -> Vec<u8> {
    let order = |mut bytes: Vec<u8>| {
        if is_big {
            bytes.reverse();
        }
        bytes
    };
    let name = if is_big { "binary_big_endian" } else { "binary_little_endian" };
    let mut content = HEAD.replace("ascii", name).into_bytes();
    for [x, y, z] in [[0.5f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 2.0]] {
        content.extend(order(x.to_le_bytes().into()));
        content.extend(order(f64::from(y).to_le_bytes().into()));
        content.extend(order(z.to_le_bytes().into()));
        content.push(9);
    }
    content.push(3);
    (0..3i32).for_each(|corner| content.extend(order(corner.to_le_bytes().into())));
    content
}

#[test]
fn ply_files_are_read_as_text_and_binary() {
    let mesh = read("a.ply", format!("{HEAD}0.5 0 0 9\n1 0 0 9\n0 1 2 9\n3 0 1 2\n").as_bytes());
    let mesh = mesh.expect("a mesh");
    assert_eq!(mesh.vertices, [[0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 2.0]]);
    assert_eq!((mesh.faces.as_slice(), mesh.rods.len()), (&[[0, 1, 2, NO_KEY]][..], 0));
    assert_eq!(mesh.notes(), ["not read: red of element vertex"]);
    for is_big in [false, true] {
        let mut content = binary(is_big);
        assert_eq!(read("b.PLY", &content), Ok(mesh.clone()));
        content.pop();
        let error = read("b.ply", &content).expect_err("a byte is missing");
        assert_eq!(error, "the file ends after 0 of 1 rows of element face");
    }
}

/// Three vertices of a triangle.
const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn a_triangle_is_read_in_every_form_that_programs_write() {
    let plain = HEAD.replace("property uchar red\n", "") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let strips = "element tristrips 1\nproperty list int int";
    let obj = [
        format!("{OBJ}f 1 2 3"),
        format!("\u{feff}# a\n{OBJ}f 1/1 2//2 -1/3/3\n").replace('\n', "\r"),
        format!("{OBJ}fo +1 +2 +3\n").replace('0', "0d0").replace(' ', "\t"),
    ];
    let ply = [
        plain.replace("\n0 0 0\n", "\nnan .5 5.\n"),
        plain.replace("\n0 0 0\n", "\n-inf 1e3 -.5\n\n"),
        plain.replace('\n', "\r"),
        plain.replace('\n', "\r\n"),
        plain.replace("ply", "\u{feff}PLY").replace("element", "\n \telement").replace("float x", "float X"),
        plain.replace("vertex 3", "Vertex 3").replace("face 1", "FACE 1").replace("ascii", "ASCII"),
        plain.replace("3 0 1 2", "3.0 0.0 1.0 2.0").replace("uchar", "float32"),
        plain.replace("vertex_indices", "vertex_index").replace("ascii 1.0", "ascii"),
        plain
            .replace("vertex_indices\n", "vertex_indices\nproperty float a.b:c\n")
            .replace("0 1 2\n", "0 1 2 7\n"),
        plain
            .replace("element face 1\nproperty list uchar int", strips)
            .replace("3 0 1 2", "7 0 1 -1 0 1 2 -1"),
    ];
    let files = obj.iter().map(|text| ("a.obj", text)).chain(ply.iter().map(|text| ("a.ply", text)));
    for (name, text) in files {
        let mesh = read(name, text.as_bytes()).expect(text);
        let counts = (mesh.vertices.len(), mesh.edges().len(), mesh.rods.len());
        assert_eq!((counts, mesh.faces), ((3, 3, 0), vec![[0, 1, 2, NO_KEY]]), "{text:?}");
    }
}

/// Behind a header whose lines end with `\r`, the byte `\n` is a value; behind one of `\r\n`, the end of its last line.
#[test]
fn binary_values_begin_right_behind_the_header() {
    let content = binary(false);
    let begin = HEAD.replace("ascii", "binary_little_endian").len();
    for end in ["\n", "\r", "\r\n"] {
        let header = String::from_utf8_lossy(&content[..begin]).replace('\n', end);
        let mut values = content[begin..].to_vec();
        values[0] = b'\n';
        let mesh = read("a.ply", &[header.as_bytes(), &values[..]].concat()).expect("a mesh");
        let first = f32::from_le_bytes([b'\n', 0, 0, 0x3f]);
        assert_eq!((mesh.vertices[0][0], mesh.faces.len()), (f64::from(first), 1), "{end:?}");
    }
}

#[test]
fn strips_become_triangles_and_edges_become_rods() {
    let head = HEAD.replace("face 1", "tristrips 2");
    let head =
        head.replace("end_header", "element edge 2\nproperty int vertex1\nproperty int vertex2\nend_header");
    let vertices = "0 0 0 9\n".repeat(3);
    // The second strip begins with a triangle that only turns it around.
    let rows = "7 0 1 2 0 -1 1 2\n5 0 0 1 2 2\n1 2\n2 2\n";
    let mesh = read("a.ply", format!("{head}{vertices}{rows}").as_bytes()).expect("a mesh");
    let triangles = [[0, 1, 2], [1, 2, 0], [0, 1, 2]].map(|[a, b, c]| [a, b, c, NO_KEY]);
    assert_eq!((mesh.faces.as_slice(), mesh.rods.as_slice()), (&triangles[..], &[[1, 2]][..]));
    assert_eq!(mesh.notes()[0], "rods from a vertex to itself, left out: 1, the first in line 20");
}

#[test]
fn rods_and_strips_that_name_no_vertices_are_not_read() {
    let head = HEAD.replace("face 1", "tristrips 1").replace("vertex_indices", "colours");
    let head = head.replace("end_header", "element edge 2\nproperty uchar red\nend_header");
    let mesh =
        read("a.ply", format!("{head}{}1 7\n7\n7\n", "0 0 0 9\n".repeat(3)).as_bytes()).expect("vertices");
    let told = "not read: red of element vertex; element tristrips (1); element edge (2)";
    assert_eq!(mesh.notes(), ["no faces and no rods", told]);
}

#[test]
fn obj_files_are_read_with_every_form_of_face() {
    let text = b"\xef\xbb\xbf# \xe4\no name\nv 0 0 0\nv 1 0 0\nv 0 1 0 1.0\nvn 0 0 1\nv 1 1 1\nf 1 2 3\nf 2//1 4//1 -2/5/1\nf 1 2 \\\n 3 4 # all\nusemtl x\n";
    let mesh = read("a.obj", text).expect("a mesh");
    assert_eq!(mesh.vertices[3], [1.0; 3]);
    assert_eq!(mesh.faces, [[0, 1, 2, NO_KEY], [1, 3, 2, NO_KEY], [0, 1, 2, 3]]);
    assert_eq!(mesh.notes(), [""; 0]);
}

#[test]
fn a_line_of_obj_can_go_on_in_the_next_and_ends_at_a_comment() {
    let vertices = "v 0 0 \\\r\n 1\nv 1 0 0\nv 0 1 0\n";
    for face in [
        "f 1 2 \\\n-1\n",
        "f 1 2\\\n3",
        "f 1 2 3 \\",
        "f 1 2 \\ # more\n3#\n",
        "f 1 2 3# all\n",
        "f 1 2 3 #all \\\n",
    ] {
        let mesh = read("a.obj", format!("{vertices}{face}").as_bytes()).expect("a triangle");
        assert_eq!((mesh.vertices[0], mesh.faces), ([0.0, 0.0, 1.0], vec![[0, 1, 2, NO_KEY]]), "{face}");
    }
}

#[test]
fn rods_of_obj_are_the_parts_of_a_line() {
    let mesh = read("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1/1 2/2 -1/3 1\nl 2 2\np 1\ncurv 0 1 1 2\np 2\n");
    let mesh = mesh.expect("a mesh");
    assert_eq!(mesh.rods, [[0, 1], [1, 2], [2, 0]]);
    let told = [
        "rods from a vertex to itself, left out: 1, the first in line 5",
        "no faces; rods have edges and vertices",
        "not read: curv (1), p (2)",
    ];
    assert_eq!(mesh.notes(), told);
}

#[test]
fn oddities_are_counted_and_the_first_is_named() {
    let mesh =
        read("a.obj", b"v 0 0 0\nv 1e39 0 0\nv 0 -inf nan\nf 1 1 2\nf 1 2 3\nf 3 2 3\n").expect("a mesh");
    let told = [
        "vertices with a NaN: 1, the first is vertex 3 in line 3",
        "vertices beyond the range of f32, with infinite boxes: 2, the first in line 2",
        "faces that name a vertex twice: 2, the first in line 4",
    ];
    assert_eq!(mesh.notes(), told);
    let head = HEAD.replace("face 1", "tristrips 3");
    let rows = "0 0 0 9\n".repeat(3) + "4 -1 0 1 2\n7 0 1 -1 2 -1 0 1\n4 0 1 2 -1\n";
    let mesh = read("a.ply", (head + &rows).as_bytes()).expect("a mesh");
    assert_eq!(mesh.faces.len(), 2);
    assert_eq!(
        mesh.notes()[0],
        "strips of fewer than 3 vertices, without a triangle: 3, the first in line 15"
    );
}

#[test]
fn a_long_list_of_what_is_not_read_is_cut() {
    let lines: String = (0..100).map(|i| format!("word{i}\u{7} 1\n")).collect();
    let notes = read("a.obj", format!("v 0 0 0\n{lines}").as_bytes()).expect("a vertex").notes();
    assert_eq!(notes[0], "no faces and no rods");
    assert!(
        notes[1].starts_with("not read: word0? (1), ") && notes[1].ends_with(" (1) and 92 more"),
        "{notes:?}"
    );
}

#[test]
fn errors_say_what_is_wrong_and_where() {
    let ply = |rows: &str| read("a.ply", format!("{HEAD}{rows}").as_bytes()).expect_err("a wrong file");
    let head =
        |from: &str, to: &str| read("a.ply", HEAD.replace(from, to).as_bytes()).expect_err("a wrong header");
    let obj = |text: &str| read("a.obj", text.as_bytes()).expect_err("a wrong file");
    let vertices = "0 0 0 9\n1 0 0 9\n0 1 2 9\n";
    let mut far = binary(false);
    *far.last_mut().expect("a byte") = 0x80;
    for (error, wanted) in [
        (
            ply(&format!("{vertices}3 0 1 7\n")),
            "line 14: vertex 7 does not exist; the file has 3, counted from 0",
        ),
        (
            ply(&format!("{vertices}3 0 1 -1\n")),
            "line 14: vertex -1 does not exist; the file has 3, counted from 0",
        ),
        (ply(&format!("{vertices}3 0 1 0.5\n")), "line 14: '0.5' is not the number of a vertex"),
        (
            ply(&format!("{vertices}5 0 1 2 0 1\n")),
            "line 14: a face of more than 4 vertices; divide it into triangles or quadrilaterals",
        ),
        (ply(&format!("{vertices}3 0 1\n")), "line 14: property vertex_indices: the line has too few values"),
        (
            ply(&format!("{vertices}-3 0 1 2\n")),
            "line 14: property vertex_indices: a list cannot have -3 values",
        ),
        (
            ply("0 0 0 9\n1 zero 0 9\n"),
            "line 12: property y: 'zero' is not a number such as -0.5, 1e3 or nan",
        ),
        (ply("0 0 0 9 9\n"), "line 11: '9' is one value too many for element vertex"),
        (ply("0 0 0 9\n"), "the file ends after 1 of 3 rows of element vertex"),
        (
            read("a.ply", &far).expect_err("a negative vertex"),
            "element face, row 0, counted from 0: vertex -2147483646 does not exist; the file has 3, counted from 0",
        ),
        (head("element vertex", "element point"), "line 10: the header has no element vertex"),
        (head("float z", "float w"), "line 3: element vertex has no number z"),
        (head("double y", "double x"), "line 3: element vertex has more than one number x"),
        (head("float z", "list uchar float z"), "line 3: element vertex has no number z"),
        (head("vertex_indices", "corners"), "the file ends after 0 of 3 rows of element vertex"),
        (
            head("float x", "flaot x"),
            "line 4: 'flaot' is no type; expected char, uchar, short, ushort, int, uint, float, double, or int8 to float64",
        ),
        (head("float x", "float"), "line 4: expected `property TYPE NAME` or `property list TYPE TYPE NAME`"),
        (
            head("element face", "elemnt face"),
            "line 8: 'elemnt face 1' is no line of a header; expected `format NAME`, `element NAME ROWS`, `property TYPE NAME` or `end_header`",
        ),
        (head("element vertex 3\n", ""), "line 3: a property before the first element"),
        (head("vertex 3", "vertex -3"), "line 3: '-3' is not a number of rows"),
        (head("element face", "element vertex"), "line 8: a second element vertex"),
        (
            head("element face 1", "element face"),
            "line 8: 'element face' is no line of a header; expected `format NAME`, `element NAME ROWS`, `property TYPE NAME` or `end_header`",
        ),
        (head("format ascii 1.0\n", ""), "line 9: no line `format ascii 1.0` before it"),
        (
            head("ascii", "text"),
            "line 2: 'text' is no format; expected ascii, binary_little_endian or binary_big_endian",
        ),
        (head("end_header\n", ""), "line 9: the file ends before a line `end_header`"),
        (head("ply\n", "solid\n"), "line 1: a .ply file begins with a line `ply`"),
        (obj("v 0 0 0\nv 1 zero 0\n"), "line 2: 'zero' is not a number such as -0.5, 1e3 or nan"),
        (obj("v 0 0 1.#INF\n"), "line 1: '1.#INF' is not a number such as -0.5, 1e3 or nan"),
        (obj("v 0 0\n"), "line 1: expected 3 coordinates, found 2"),
        (obj("v 0 0 0\nf 1 9 4 # all\nf 1 8 1\n"), "line 2: vertex 9 does not exist; the file has 1"),
        (obj("v 0 0 0\nf 1 1 0\n"), "line 2: vertex 0 does not exist; the first is 1"),
        (
            obj("v 0 0 0\nf 1 1 -2\nv 0 0 0\n"),
            "line 2: vertex -2 does not exist; the lines before have 1 vertex",
        ),
        // The first that is wrong, not the largest.
        (obj("v 0 0 0\nf 1 2 3\nf 1 1 9\nv 0 0 0\n"), "line 2: vertex 3 does not exist; the file has 2"),
        (
            obj("v 0 0 0\nf 1 1/x 1\n"),
            "line 2: '1/x' is not the number of a vertex; expected numbers: vertex/texture/normal",
        ),
        (
            obj("v 0 0 0\nl 1/1/1/1 1\n"),
            "line 2: '1/1/1/1' is not the number of a vertex; expected numbers: vertex/texture/normal",
        ),
        (obj("v 0 0 0\nf 1 \\\n1\n"), "line 2: expected a face of 3 or 4 vertices, found 2"),
        (obj("v 0 0 0\nl 1\n"), "line 2: expected a rod of 2 vertices or more, found 1"),
        (obj("v 0 0 0\nf 1 1 4294967296\n"), "line 2: vertex 4294967296 does not exist; the file has 1"),
        (obj("v 0 0 0\nf 1 1 1.0\n"), "line 2: '1.0' is not the number of a vertex"),
        (obj("\nsolid x\n"), "no vertices; expected lines that begin with `v`, found 'solid'"),
        (obj("\u{feff}"), "no vertices; expected lines that begin with `v`"),
        (obj(""), "the file is empty"),
        (read("a.obj", b"\xff\xfev\0").expect_err("UTF-16"), "this is UTF-16; save the file as UTF-8 text"),
        (read("a.ply", b"\x1f\x8b\x08").expect_err("gzip"), "this is compressed; unpack it first"),
        (read("a.stl", b"").expect_err("another format"), "expected a file that ends in .ply or .obj"),
    ] {
        assert_eq!(error, wanted);
    }
}
