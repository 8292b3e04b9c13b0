//! The boxes of a search, with what else decides about their pairs: filters, and keys. Two boxes with a key in common never pair.

use crate::{Aabb, Error, ProxyFilter};

/// Up to four numbers of a box; [`NO_KEY`] where there are fewer.
///
/// Boxes of a mesh have their vertices: `[v, NO_KEY, NO_KEY, NO_KEY]` is a vertex, `[v, w, NO_KEY, NO_KEY]` an edge.
pub type Keys = [u32; 4];

/// An unused place in [`Keys`], which nothing has in common.
pub const NO_KEY: u32 = u32::MAX;

/// Boxes to search, and what else decides about their pairs: filters, keys, or neither. `boxes[i]` has the id `i`.
///
/// A slice, an array or a vector of boxes becomes one by itself.
///
/// ```
/// use pbig_core::{Aabb, Boxes, Finder, NO_KEY};
/// let boxes = [Aabb::new([0.0; 3], [1.0; 3]); 3];
/// // Three edges; the first two share vertex 1.
/// let edges = [[0, 1], [1, 2], [3, 4]].map(|[v, w]| [v, w, NO_KEY, NO_KEY]);
/// let mut finder = Finder::default();
/// assert_eq!(finder.find_between(&boxes, &boxes)?.len(), 9);
/// let edges = Boxes::new(&boxes).with_keys(&edges);
/// assert_eq!(finder.find_between(edges, edges)?.len(), 4);
/// # Ok::<(), pbig_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Boxes<'a> {
    pub(crate) boxes: &'a [Aabb],
    pub(crate) filters: Option<&'a [ProxyFilter]>,
    pub(crate) keys: Option<&'a [Keys]>,
}

impl<'a> Boxes<'a> {
    /// Makes boxes that may all pair.
    pub const fn new(boxes: &'a [Aabb]) -> Self {
        Self { boxes, filters: None, keys: None }
    }

    /// Leaves out pairs that the filters do not allow: one filter for each box.
    pub const fn with_filters(self, filters: &'a [ProxyFilter]) -> Self {
        Self { filters: Some(filters), ..self }
    }

    /// Leaves out pairs of boxes that have a key in common: one entry for each box.
    pub const fn with_keys(self, keys: &'a [Keys]) -> Self {
        Self { keys: Some(keys), ..self }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let boxes = self.boxes.len();
        match (self.filters.map_or(boxes, <[_]>::len), self.keys.map_or(boxes, <[_]>::len)) {
            (filters, _) if filters != boxes => Err(Error::FilterCount { boxes, filters }),
            (_, keys) if keys != boxes => Err(Error::KeyCount { boxes, keys }),
            _ => Ok(()),
        }
    }
}

impl<'a, T: AsRef<[Aabb]> + ?Sized> From<&'a T> for Boxes<'a> {
    fn from(boxes: &'a T) -> Self {
        Self::new(boxes.as_ref())
    }
}

/// Returns true if two boxes share no key. Without a branch, so that the compiler compares four at once.
#[inline(always)]
pub(crate) fn share_no_key(one: &Keys, other: &Keys) -> bool {
    let mut shared = [0; 4];
    for &key in one {
        for (shared, &other) in shared.iter_mut().zip(other) {
            *shared |= u32::from(key == other) & u32::from(key != NO_KEY);
        }
    }
    shared == [0; 4]
}
