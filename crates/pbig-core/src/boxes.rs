//! The boxes of a search, with what else decides about their pairs.

use crate::{Aabb, Error, Keys, ProxyFilter};

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

    /// Returns an error if there is not one filter, or entry of keys, for each box.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let boxes = self.boxes.len();
        match (self.filters.map_or(boxes, <[_]>::len), self.keys.map_or(boxes, <[_]>::len)) {
            (filters, _) if filters != boxes => Err(Error::FilterCount { boxes, filters }),
            (_, keys) if keys != boxes => Err(Error::KeyCount { boxes, keys }),
            _ => Ok(()),
        }
    }
}

impl<'a> From<&'a [Aabb]> for Boxes<'a> {
    fn from(boxes: &'a [Aabb]) -> Self {
        Self::new(boxes)
    }
}

impl<'a> From<&'a Vec<Aabb>> for Boxes<'a> {
    fn from(boxes: &'a Vec<Aabb>) -> Self {
        Self::new(boxes)
    }
}

impl<'a, const N: usize> From<&'a [Aabb; N]> for Boxes<'a> {
    fn from(boxes: &'a [Aabb; N]) -> Self {
        Self::new(boxes)
    }
}
