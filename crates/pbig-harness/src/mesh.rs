//! Meshes from files, and the boxes of their vertices, edges and faces.

mod obj;
mod ply;

use crate::files::{ending, one_line};
use pbig_core::{Aabb, Boxes, Keys, NO_KEY};
use std::io::{BufRead, BufReader};
use std::path::Path;

/// The endings of a file with a mesh.
pub const MESHES: [&str; 2] = ["ply", "obj"];

/// A surface of triangles and quadrilaterals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The places of the vertices.
    pub vertices: Vec<[f64; 3]>,
    /// By face: its vertices, three or four of them.
    pub faces: Vec<Keys>,
}

/// The boxes of vertices, edges or faces, with their vertices as keys: neighbours have one in common.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Elements {
    /// A box for each element.
    pub boxes: Vec<Aabb>,
    /// The vertices of each element.
    pub keys: Vec<Keys>,
}

impl Elements {
    /// Returns the boxes for a search that leaves out neighbours.
    pub fn apart(&self) -> Boxes<'_> {
        Boxes::new(&self.boxes).with_keys(&self.keys)
    }

    fn new(keys: Vec<Keys>, vertices: &[Aabb]) -> Self {
        let around = |keys: &Keys| {
            let corners = keys.iter().filter(|key| **key != NO_KEY).map(|key| vertices[*key as usize]);
            corners.reduce(|a, b| around_both(&a, &b)).unwrap_or(Aabb::NOWHERE)
        };
        Self { boxes: keys.iter().map(around).collect(), keys }
    }
}

/// Returns the box around two; invalid if either is, unlike [`Aabb::union`].
fn around_both(a: &Aabb, b: &Aabb) -> Aabb {
    if a.is_valid() && b.is_valid() { a.union(b) } else { Aabb::NOWHERE }
}

/// The vertices, edges and faces of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshElements {
    /// In the order of the file.
    pub vertices: Elements,
    /// Each once, by larger and then smaller vertex.
    pub edges: Elements,
    /// In the order of the file.
    pub faces: Elements,
}

impl Mesh {
    /// Reads a `.ply` or `.obj` file.
    ///
    /// # Errors
    /// The file, what is wrong and where, in one line.
    pub fn read(path: &Path) -> Result<Self, String> {
        let read = if ending(path, &MESHES)? == "ply" { Self::from_ply } else { Self::from_obj };
        let file = std::fs::File::open(path).map_err(|error| error.to_string());
        file.and_then(|file| read(BufReader::new(file))).map_err(|what| format!("{}: {what}", path.display()))
    }

    /// Reads the content of a `.ply` file.
    ///
    /// # Errors
    /// The fault and its place, in one line.
    pub fn from_ply(content: impl BufRead) -> Result<Self, String> {
        ply::read(content).and_then(Self::checked).map_err(one_line)
    }

    /// Reads the content of an `.obj` file.
    ///
    /// # Errors
    /// The fault and its place, in one line.
    pub fn from_obj(content: impl BufRead) -> Result<Self, String> {
        obj::read(content).and_then(Self::checked).map_err(one_line)
    }

    /// Refuses a face with a vertex that does not exist.
    fn checked(self) -> Result<Self, String> {
        let count = self.vertices.len();
        for (i, face) in self.faces.iter().enumerate() {
            let mut corners = face.iter().filter(|corner| **corner != NO_KEY);
            if let Some(corner) = corners.find(|corner| **corner as usize >= count) {
                return Err(format!(
                    "face {i} (counted from 0): vertex {corner} is none of the {count} vertices"
                ));
            }
        }
        Ok(self)
    }

    /// Returns the edges of the faces, each once: larger and then smaller vertex, sorted.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges: Vec<[u32; 2]> = self.faces.iter().flat_map(edges_of).collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// Returns the boxes of all elements. Where there is a `next` frame, the boxes hold each element on its straight way there.
    ///
    /// # Errors
    /// The frames differ in more than the places of the vertices.
    pub fn elements(&self, next: Option<&Self>) -> Result<MeshElements, String> {
        let next = next.unwrap_or(self);
        if self.vertices.len() != next.vertices.len() || self.faces != next.faces {
            let counts = [self, next].map(|mesh| (mesh.vertices.len(), mesh.faces.len()));
            return Err(format!(
                "not a frame of the same mesh: {:?} vertices and faces before, {:?} now",
                counts[0], counts[1]
            ));
        }
        Ok(self.elements_around(
            self.vertices.iter().zip(&next.vertices).map(|(from, to)| swept(from, to)).collect(),
        ))
    }

    /// Returns the boxes of all elements, around given ones of the vertices.
    ///
    /// # Panics
    /// If there is no box for a vertex of a face.
    pub fn elements_around(&self, vertices: Vec<Aabb>) -> MeshElements {
        let edges = self.edges().into_iter().map(|[a, b]| [a, b, NO_KEY, NO_KEY]).collect();
        let (edges, faces) = (Elements::new(edges, &vertices), Elements::new(self.faces.clone(), &vertices));
        let keys = (0..vertices.len() as u32).map(|vertex| [vertex, NO_KEY, NO_KEY, NO_KEY]).collect();
        MeshElements { vertices: Elements { keys, boxes: vertices }, edges, faces }
    }
}

/// Returns the box of a point that moves, rounded outward.
fn swept(from: &[f64; 3], to: &[f64; 3]) -> Aabb {
    if from.iter().chain(to).any(|x| x.is_nan()) {
        return Aabb::NOWHERE;
    }
    let corner = |of: fn(f64, f64) -> f64| std::array::from_fn(|k| of(from[k], to[k]));
    Aabb::from_f64(corner(f64::min), corner(f64::max))
}

fn edges_of(face: &Keys) -> impl Iterator<Item = [u32; 2]> {
    let corners = if face[3] == NO_KEY { 3 } else { 4 };
    let face = *face;
    (0..corners).map(move |i| (face[i], face[(i + 1) % corners])).map(|(a, b)| [a.max(b), a.min(b)])
}

/// Returns a face of three or four vertices.
fn face(corners: &[u32]) -> Result<Keys, String> {
    match *corners {
        _ if corners.contains(&NO_KEY) => Err(format!("vertex {NO_KEY} is too large a number")),
        [a, b, c] => Ok([a, b, c, NO_KEY]),
        [a, b, c, d] => Ok([a, b, c, d]),
        _ => Err(format!("{} vertices; divide it into triangles or quadrilaterals", corners.len())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::{Finder, Pair};

    /// Two triangles and a quadrilateral; vertex 5 belongs to no face.
    fn mesh() -> Mesh {
        let vertices = [[0, 0], [2, 0], [0, 2], [2, 2], [4, 0], [1, 1], [4, 2]];
        let vertices = vertices.map(|[x, y]| [f64::from(x), f64::from(y), 0.0]).to_vec();
        Mesh { vertices, faces: vec![[0, 1, 2, NO_KEY], [2, 1, 3, NO_KEY], [1, 4, 6, 3]] }
    }

    #[test]
    fn elements_have_their_vertices_as_keys() {
        let MeshElements { vertices, edges, faces } = mesh().elements(None).expect("one frame");
        let sorted = [[1, 0], [2, 0], [2, 1], [3, 1], [3, 2], [4, 1], [6, 3], [6, 4]];
        assert_eq!(edges.keys, sorted.map(|[a, b]| [a, b, NO_KEY, NO_KEY]));
        assert_eq!(faces.boxes[1], Aabb::new([0.0; 3], [2.0, 2.0, 0.0]));
        let mut finder = Finder::default();
        let pairs = finder.find_between(vertices.apart(), faces.apart()).expect("few");
        let pairs: Vec<_> = pairs.iter().map(|pair| (pair.a, pair.b)).collect();
        assert_eq!(pairs, [(0, 1), (3, 0), (5, 0), (5, 1)]);
        let pairs = finder.find_without_shared(&edges.boxes, &edges.keys).expect("few");
        // Edges 0 and 3 have vertex 1 in common.
        assert!(pairs.contains(&Pair::new(2, 6)) && !pairs.contains(&Pair::new(0, 3)));
    }

    #[test]
    fn boxes_are_swept_over_two_frames() {
        let (before, mut after) = (mesh(), mesh());
        after.vertices[4][2] = -3.0;
        after.vertices[5][0] = f64::NAN;
        let MeshElements { vertices, faces, .. } = before.elements(Some(&after)).expect("two frames");
        assert_eq!(vertices.boxes[4], Aabb::new([4.0, 0.0, -3.0], [4.0, 0.0, 0.0]));
        assert_eq!(faces.boxes[2].min, [2.0, 0.0, -3.0]);
        assert!(!vertices.boxes[5].is_valid() && faces.boxes.iter().all(Aabb::is_valid));
        after.faces.pop();
        assert!(
            before
                .elements(Some(&after))
                .expect_err("fewer faces")
                .contains("(7, 3) vertices and faces before")
        );
    }

    fn read(name: &str, content: &[u8]) -> Result<Mesh, String> {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join(name), content).expect("written");
        let read = Mesh::read(&folder.path().join(name));
        read.map_err(|what| what.split_once(&format!("{name}: ")).expect("the file is named").1.to_owned())
    }

    const HEAD: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty double y\nproperty float z\n\
                        property uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";

    #[test]
    fn ply_files_are_read_as_text_and_binary() {
        let wanted = Mesh {
            vertices: vec![[0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 2.0]],
            faces: vec![[0, 1, 2, NO_KEY]],
        };
        let rows = "0.5 0 0 9\n1 0 0 9\n0 1 2 9\n3 0 1 2\n";
        assert_eq!(read("a.ply", format!("{HEAD}{rows}").as_bytes()), Ok(wanted.clone()));
        for is_big in [false, true] {
            let order = |mut bytes: Vec<u8>| {
                if is_big {
                    bytes.reverse();
                }
                bytes
            };
            let name = if is_big { "binary_big_endian" } else { "binary_little_endian" };
            let mut content = HEAD.replace("ascii", name).into_bytes();
            for [x, y, z] in &wanted.vertices {
                content.extend(order((*x as f32).to_le_bytes().into()));
                content.extend(order(y.to_le_bytes().into()));
                content.extend(order((*z as f32).to_le_bytes().into()));
                content.push(9);
            }
            content.push(3);
            (0..3i32).for_each(|corner| content.extend(order(corner.to_le_bytes().into())));
            assert_eq!(read("b.PLY", &content), Ok(wanted.clone()));
            content.pop();
            assert!(read("b.ply", &content).is_err());
        }
    }

    #[test]
    fn obj_files_are_read_with_every_form_of_face() {
        let text = b"\xef\xbb\xbf# \xe4\no name\nv 0 0 0\nv 1 0 0\nv 0 1 0 1.0\nvn 0 0 1\nv 1 1 1\nf 1 2 3\nf 2//1 4//1 -2/5/1\nf 1 2 \\\n 3 4 # all\nusemtl x\n";
        let mesh = read("a.obj", text).expect("a mesh");
        assert_eq!(mesh.vertices[3], [1.0; 3]);
        assert_eq!(mesh.faces, [[0, 1, 2, NO_KEY], [1, 3, 2, NO_KEY], [0, 1, 2, 3]]);
    }

    #[test]
    fn errors_say_what_is_wrong_and_where() {
        let ply = |rows: &str| read("a.ply", format!("{HEAD}{rows}").as_bytes()).expect_err("a wrong file");
        let obj = |text: &str| read("a.obj", text.as_bytes()).expect_err("a wrong file");
        for (error, words) in [
            (
                ply("0 0 0 9\n1 0 0 9\n0 1 2 9\n3 0 1 7\n"),
                "face 0 (counted from 0): vertex 7 is none of the 3",
            ),
            (ply("0 0 0 9\n1 0 0 9\n0 1 2 9\n3 0 1 -1\n"), "face 0 (counted from 0): a vertex is no index"),
            (ply("0 0 0 9\n1 0 0 9\n0 1 2 9\n5 0 1 2 0 1\n"), "face 0 (counted from 0): 5 vertices"),
            (ply("0 0 0 9\n1 zero 0 9\n"), "12"),
            (
                read("a.ply", b"ply\nformat ascii 1.0\nelement point 0\nend_header\n")
                    .expect_err("no vertices"),
                "no element `vertex`",
            ),
            (
                read(
                    "a.ply",
                    HEAD.replace("element face", "element junk 99999999999\nelement face").as_bytes(),
                )
                .expect_err("rows without bytes"),
                "element `junk` has no property",
            ),
            (obj("v 0 0 0\nv 1 zero 0\n"), "line 2: 'zero' is no number"),
            (obj("v 0 0\n"), "line 1: a vertex has three coordinates"),
            (obj("v 0 0 0\nf 1 1 2\n"), "face 0 (counted from 0): vertex 1 is none of the 1"),
            (obj("v 0 0 0\nf 1 1 0\n"), "line 2: '0' is no vertex"),
            (obj("v 0 0 0\nf 1 1 -2\n"), "line 2: '-2' is no vertex"),
            (obj("v 0 0 0\nf 1 1\n"), "line 2: 2 vertices"),
            (obj("v 0 0 0\nf 1 1 4294967296\n"), "line 2: vertex 4294967295 is too large"),
            (
                read("a.ply", HEAD.replace("float z", "float w").as_bytes()).expect_err("no z"),
                "no number `z`",
            ),
            (obj("hello\n"), "no vertices"),
            (read("a.stl", b"").expect_err("another format"), "ends in .ply or .obj"),
        ] {
            assert!(error.contains(words), "'{words}' is not in: {error}");
        }
    }
}
