//! The vertices, edges and faces of a mesh, their boxes, and pairs of these that share no vertex.

use pbig_core::{Aabb, Boxes, Error, Finder, Keys, NO_KEY};
use rayon::prelude::*;
use std::borrow::Cow;

/// Two kinds of elements: `v` for vertices, `e` for edges or `f` for faces.
pub(crate) type KindPair = [char; 2];

/// Maximum number of vertices, for each face, that are counted: beyond, sorting takes less time and memory.
const MAX_VERTICES_PER_FACE: usize = 32;

/// Minimum number of boxes that a thread makes.
const BOXES_OF_THREAD: usize = 4096;

/// Pairs of indices.
type Pairs = Vec<[u32; 2]>;

/// Returns the edges of faces, each once: smaller and then larger vertex, sorted by the larger one first, as in the program `pbig`.
pub(crate) fn edges(faces: &[Keys]) -> Pairs {
    let vertices = sides(faces).map(|[larger, _]| larger as usize + 1).max().unwrap_or(0);
    if vertices > MAX_VERTICES_PER_FACE * faces.len() {
        return sorted_edges(faces);
    }
    // By larger vertex: where its smaller ones begin; once they are written, where they end.
    let mut next = vec![0; vertices + 1];
    sides(faces).for_each(|[larger, _]| next[larger as usize + 1] += 1);
    (0..vertices).for_each(|vertex| next[vertex + 1] += next[vertex]);
    let mut smaller = vec![0; next[vertices]];
    for [v, w] in sides(faces) {
        smaller[next[v as usize]] = w;
        next[v as usize] += 1;
    }
    let mut start = 0;
    let mut edges = Pairs::with_capacity(smaller.len());
    for (larger, end) in (0..).zip(&next[..vertices]) {
        let row = &mut smaller[start..*end];
        row.sort_unstable();
        edges.extend(row.chunk_by(|v, w| v == w).map(|equal| [equal[0], larger]));
        start = *end;
    }
    edges
}

/// As [`edges`], in time that does not follow the number of vertices.
fn sorted_edges(faces: &[Keys]) -> Pairs {
    let mut edges: Pairs = sides(faces).collect();
    edges.sort_unstable();
    edges.dedup();
    edges.iter_mut().for_each(|edge| edge.reverse());
    edges
}

/// Yields the sides of faces, larger vertex first. None is from a vertex to itself.
fn sides(faces: &[Keys]) -> impl Iterator<Item = [u32; 2]> {
    let sides = faces.iter().flat_map(|face| {
        let corners = if face[3] == NO_KEY { 3 } else { 4 };
        (0..corners).map(move |k| [face[k], face[(k + 1) % corners]])
    });
    sides.map(|[v, w]| [v.max(w), v.min(w)]).filter(|[v, w]| v != w)
}

/// The boxes of the vertices, and the faces: three vertices and `NO_KEY`, or four vertices.
pub(crate) struct Mesh<'a> {
    vertices: Vec<Aabb>,
    faces: &'a [Keys],
    /// The caller's edges. Without them the sides of the faces are the edges.
    edges: Option<&'a [[u32; 2]]>,
}

impl<'a> Mesh<'a> {
    pub(crate) fn new(
        [from, to]: [&[[f64; 3]]; 2],
        faces: &'a [Keys],
        edges: Option<&'a [[u32; 2]]>,
        margin: f64,
    ) -> Self {
        let steps = from.par_iter().zip(to).with_min_len(BOXES_OF_THREAD);
        let vertices = steps.map(|(from, to)| swept(from, to, margin)).collect();
        Self { vertices, faces, edges }
    }

    /// Returns a list of pairs for each two kinds.
    pub(crate) fn find(&self, all: &[KindPair]) -> Result<Vec<Pairs>, (KindPair, Error)> {
        let is_wanted = |kind| all.iter().any(|kinds| kinds.contains(&kind));
        let wanted = |kind| if is_wanted(kind) { self.elements(kind) } else { Elements::default() };
        let [v, e, f] = ['v', 'e', 'f'].map(wanted);
        let of = |kind| match kind {
            'v' => &v,
            'e' => &e,
            _ => &f,
        };
        let find = |[a, b]: KindPair| if a == b { of(a).pairs() } else { of(a).pairs_with(of(b)) };
        all.iter().map(|kinds| find(*kinds).map_err(|error| (*kinds, error))).collect()
    }

    fn elements(&self, kind: char) -> Elements {
        let keys: Vec<Keys> = match kind {
            'v' => (0..self.vertices.len() as u32).map(|v| [v, NO_KEY, NO_KEY, NO_KEY]).collect(),
            'e' => {
                let edges = self.edges.map_or_else(|| edges(self.faces).into(), Cow::Borrowed);
                edges.iter().map(|[v, w]| [*v, *w, NO_KEY, NO_KEY]).collect()
            }
            _ => self.faces.to_vec(),
        };
        let corners = keys.par_iter().with_min_len(BOXES_OF_THREAD);
        Elements { boxes: corners.map(|keys| self.around(keys)).collect(), keys }
    }

    /// Returns the box around some vertices; invalid if one of theirs is.
    fn around(&self, keys: &Keys) -> Aabb {
        let corners = keys.iter().filter(|key| **key != NO_KEY).map(|key| self.vertices[*key as usize]);
        let both = |a: Aabb, b: Aabb| if a.is_valid() && b.is_valid() { a.union(&b) } else { Aabb::NOWHERE };
        corners.reduce(both).unwrap_or(Aabb::NOWHERE)
    }
}

/// Returns the box of a point on its straight way, grown by a margin and rounded outward. A NaN makes it invalid.
fn swept(from: &[f64; 3], to: &[f64; 3], margin: f64) -> Aabb {
    if from.iter().chain(to).any(|x| x.is_nan()) {
        return Aabb::NOWHERE;
    }
    let min = std::array::from_fn(|k| lowered(from[k].min(to[k]), margin));
    let max = std::array::from_fn(|k| -lowered((-from[k]).min(-to[k]), margin));
    Aabb::from_f64(min, max)
}

/// Returns `x - margin`, rounded downward.
fn lowered(x: f64, margin: f64) -> f64 {
    let nearest = x - margin;
    // The rounding error, exactly (Knuth's TwoSum). With infinities it is a NaN.
    let subtracted = x - nearest;
    let error = (x - (nearest + subtracted)) + (subtracted - margin);
    if error < 0.0 { nearest.next_down() } else { nearest }
}

/// Boxes of elements of one kind, and the vertices of each.
#[derive(Default)]
struct Elements {
    boxes: Vec<Aabb>,
    keys: Vec<Keys>,
}

impl Elements {
    fn apart(&self) -> Boxes<'_> {
        Boxes::new(&self.boxes).with_keys(&self.keys)
    }

    fn pairs(&self) -> Result<Pairs, Error> {
        let mut finder = Finder::default();
        finder.find_without_shared(&self.boxes, &self.keys)?;
        Ok(bytemuck::cast_vec(finder.into_pairs()))
    }

    fn pairs_with(&self, other: &Self) -> Result<Pairs, Error> {
        let mut finder = Finder::default();
        finder.find_between(self.apart(), other.apart())?;
        Ok(bytemuck::cast_vec(finder.into_pairs_between()))
    }
}
