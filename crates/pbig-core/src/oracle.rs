//! Brute force: the definition of right. Every backend must return this set.

use crate::{Aabb, CrossPair, Pair, ProxyFilter};

/// Returns every pair of valid boxes that overlap, sorted. Quadratic time.
///
/// ```
/// use pbig_core::{oracle, Aabb, Pair};
/// let unit = Aabb::new([0.0; 3], [1.0; 3]);
/// assert_eq!(oracle::pairs(&[unit, Aabb::NOWHERE, unit]), [Pair::new(0, 2)]);
/// ```
pub fn pairs(boxes: &[Aabb]) -> Vec<Pair> {
    pairs_where(boxes, |_, _| true)
}

/// Returns the [`pairs`] that both filters allow. `filters[i]` is the filter of `boxes[i]`; a box without a filter pairs with
/// nothing.
pub fn pairs_filtered(boxes: &[Aabb], filters: &[ProxyFilter]) -> Vec<Pair> {
    let filter = |id: u32| filters.get(id as usize);
    pairs_where(boxes, |a, b| filter(a).zip(filter(b)).is_some_and(|(a, b)| a.allows(b)))
}

/// Returns every pair of a valid box of `a` and a valid box of `b` that overlap, sorted. Quadratic time.
///
/// ```
/// use pbig_core::{oracle, Aabb, CrossPair};
/// let unit = Aabb::new([0.0; 3], [1.0; 3]);
/// assert_eq!(oracle::pairs_between(&[unit], &[Aabb::NOWHERE, unit]), [CrossPair { a: 0, b: 1 }]);
/// ```
pub fn pairs_between(a: &[Aabb], b: &[Aabb]) -> Vec<CrossPair> {
    let mut found = Vec::new();
    for (a, one) in (0..).zip(a).filter(|(_, one)| one.is_valid()) {
        let hits = (0..).zip(b).filter(|(_, other)| one.overlaps(other) && other.is_valid());
        found.extend(hits.map(|(b, _)| CrossPair { a, b }));
    }
    found
}

/// Returns the [`pairs`] for which `allowed(a, b)` is true, `a < b`.
pub fn pairs_where(boxes: &[Aabb], mut allowed: impl FnMut(u32, u32) -> bool) -> Vec<Pair> {
    let mut found = Vec::new();
    for (a, one) in (0..).zip(boxes).filter(|(_, one)| one.is_valid()) {
        for (b, other) in (0..).zip(boxes).skip(a as usize + 1) {
            if one.overlaps(other) && other.is_valid() && allowed(a, b) {
                found.push(Pair { a, b });
            }
        }
    }
    found
}
