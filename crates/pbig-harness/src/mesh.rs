//! Meshes from files, and the boxes of their vertices, edges and faces.

mod obj;
mod ply;
mod reading;
#[cfg(test)]
mod tests_of_files;

use crate::files::{Location, counted, grown};
use pbig_core::{Aabb, Boxes, Keys, NO_KEY};
pub use reading::NO_ELEMENTS;
use reading::Oddity;
use std::collections::BTreeMap;

/// The endings of a file with a mesh.
pub const MESHES: [&str; 2] = ["ply", "obj"];

/// A surface of triangles and quadrilaterals, and rods.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The places of the vertices.
    pub vertices: Vec<[f64; 3]>,
    /// By face: its vertices, three or four of them.
    pub faces: Vec<Keys>,
    /// Pairs of vertices that are edges without a face.
    pub rods: Vec<[u32; 2]>,
    /// Number of the first vertex in the file's counting: 1 in `.obj`, 0 in `.ply`.
    pub first_number: usize,
    /// The first vertex that has a NaN: its index and its place in the file.
    pub first_invalid: Option<(usize, Location)>,
    /// By oddity: how many there are, and the place of the first.
    oddities: BTreeMap<Oddity, (usize, Location)>,
    /// Names of what the file has and a mesh has not.
    skipped: Vec<String>,
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

impl MeshElements {
    /// Grows all boxes by a margin, see [`grown`].
    pub fn grow(&mut self, margin: f64) {
        for elements in [&mut self.vertices, &mut self.edges, &mut self.faces] {
            elements.boxes.iter_mut().for_each(|aabb| *aabb = grown(aabb, margin));
        }
    }

    /// Returns the vertices (`v`), edges (`e`) or, for any other kind, faces.
    pub fn of(&self, kind: char) -> &Elements {
        match kind {
            'v' => &self.vertices,
            'e' => &self.edges,
            _ => &self.faces,
        }
    }
}

impl Mesh {
    /// Returns the edges, each once: larger and then smaller vertex, sorted. A rod is an edge; a vertex has none to itself.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let sides = self.faces.iter().flat_map(sides);
        let edges = sides.chain(self.rods.iter().copied()).map(|[a, b]| [a.max(b), a.min(b)]);
        let mut edges: Vec<[u32; 2]> = edges.filter(|[a, b]| a != b).collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// Returns the boxes of all elements. Where there is a `next` frame, the boxes hold each element on its straight way there.
    /// It may have vertices alone.
    ///
    /// # Errors
    /// The frames differ in more than the places of the vertices.
    pub fn elements(&self, next: Option<&Self>) -> Result<MeshElements, String> {
        let next = next.unwrap_or(self);
        if let Some(what) = self.difference(next) {
            return Err(format!("not a frame of the same mesh: {what}"));
        }
        Ok(self.elements_around(
            self.vertices.iter().zip(&next.vertices).map(|(from, to)| swept(from, to)).collect(),
        ))
    }

    /// Returns the first difference of another frame, unless it has vertices alone.
    fn difference(&self, next: &Self) -> Option<String> {
        let counts = [next.vertices.len(), self.vertices.len()];
        if counts[0] != counts[1] {
            return Some(format!(
                "it has {}, the other {}",
                counted(counts[0], "vertex", "vertices"),
                counts[1]
            ));
        }
        if next.faces.is_empty() && next.rods.is_empty() {
            return None;
        }
        let firsts = [next, self].map(|mesh| mesh.first_number);
        let face = difference("face", firsts, &next.faces, &self.faces);
        face.or_else(|| difference("rod", firsts, &next.rods, &self.rods))
    }

    /// Returns the boxes of all elements, around given ones of the vertices.
    fn elements_around(&self, vertices: Vec<Aabb>) -> MeshElements {
        let edges = self.edges().into_iter().map(|[a, b]| [a, b, NO_KEY, NO_KEY]).collect();
        let (edges, faces) = (Elements::new(edges, &vertices), Elements::new(self.faces.clone(), &vertices));
        let keys = (0..vertices.len() as u32).map(|vertex| [vertex, NO_KEY, NO_KEY, NO_KEY]).collect();
        MeshElements { vertices: Elements { keys, boxes: vertices }, edges, faces }
    }
}

/// Returns the first difference of two lists of vertices, which are named as their files count them.
fn difference<T: AsRef<[u32]> + PartialEq>(
    what: &str,
    firsts: [usize; 2],
    now: &[T],
    before: &[T],
) -> Option<String> {
    if now.len() != before.len() {
        let now = counted(now.len(), what, &format!("{what}s"));
        return Some(format!("it has {now}, the other {}", before.len()));
    }
    let i = now.iter().zip(before).position(|(now, before)| now != before)?;
    let numbers = |list: &T, first: usize| {
        let vertices = list.as_ref().iter().filter(|vertex| **vertex != NO_KEY);
        vertices.map(|vertex| (*vertex as usize + first).to_string()).collect::<Vec<_>>().join(" ")
    };
    let (now, before) = (numbers(&now[i], firsts[0]), numbers(&before[i], firsts[1]));
    Some(format!("its {what} {i} (counted from 0) has the vertices {now}, the other's {before}"))
}

/// Returns the box of a point that moves, rounded outward.
fn swept(from: &[f64; 3], to: &[f64; 3]) -> Aabb {
    if from.iter().chain(to).any(|x| x.is_nan()) {
        return Aabb::NOWHERE;
    }
    let corner = |of: fn(f64, f64) -> f64| std::array::from_fn(|k| of(from[k], to[k]));
    Aabb::from_f64(corner(f64::min), corner(f64::max))
}

fn sides(face: &Keys) -> impl Iterator<Item = [u32; 2]> {
    let corners = if face[3] == NO_KEY { 3 } else { 4 };
    let face = *face;
    (0..corners).map(move |i| [face[i], face[(i + 1) % corners]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::{Finder, Pair};

    /// Two triangles and a quadrilateral; vertex 5 belongs to no face.
    fn mesh() -> Mesh {
        let vertices = [[0, 0], [2, 0], [0, 2], [2, 2], [4, 0], [1, 1], [4, 2]];
        let vertices = vertices.map(|[x, y]| [f64::from(x), f64::from(y), 0.0]).to_vec();
        Mesh { vertices, faces: vec![[0, 1, 2, NO_KEY], [2, 1, 3, NO_KEY], [1, 4, 6, 3]], ..Mesh::default() }
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
    fn a_rod_is_an_edge_unless_a_face_has_it() {
        let rods = vec![[1, 0], [5, 6], [6, 5], [0, 5]];
        let doubled = [0, 0, 4, NO_KEY];
        let mut mesh = Mesh { rods, ..mesh() };
        mesh.faces.push(doubled);
        let edges = mesh.edges();
        assert!(edges.windows(2).all(|two| two[0] < two[1]) && edges.len() == 8 + 3, "{edges:?}");
        assert!([[6, 5], [5, 0], [4, 0]].iter().all(|edge| edges.contains(edge)));
        let elements = mesh.elements(None).expect("one frame");
        let rod = edges.iter().position(|edge| *edge == [6, 5]).expect("a rod");
        assert_eq!(elements.edges.boxes[rod], Aabb::new([1.0, 1.0, 0.0], [4.0, 2.0, 0.0]));
        assert_eq!(elements.faces.boxes.len(), 4);
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
        // A frame may have vertices alone.
        let faces = std::mem::take(&mut after.faces);
        assert_eq!(before.elements(Some(&after)).expect("two frames").faces.boxes.len(), 3);
        after.faces = faces;
        let error = |after: &Mesh| before.elements(Some(after)).expect_err("another mesh");
        after.first_number = 1;
        after.faces[1][0] = 5;
        let wanted = "its face 1 (counted from 0) has the vertices 6 2 4, the other's 2 1 3";
        assert_eq!(error(&after), format!("not a frame of the same mesh: {wanted}"));
        after.faces.pop();
        assert!(error(&after).ends_with("it has 2 faces, the other 3"));
        after.vertices.pop();
        assert!(error(&after).ends_with("it has 6 vertices, the other 7"));
    }
}
