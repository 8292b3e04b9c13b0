//! Walking the nodes that a query meets, about the nearest first.

use super::BoxIndex;
use super::node::{LANES, Lanes};
use super::query::{Cast, Near, Query};
use crate::Aabb;
use crate::simd::{Eight, Simd, next};
use arrayvec::ArrayVec;

/// Maximum number of nodes that wait: seven for each level and one more, and 2^32 boxes of 448 classes make 14 levels.
const STACK: usize = 128;

/// Visits the boxes that a moving box meets up to a time; see [`BoxIndex::cast_aabb`].
#[inline(always)]
pub(super) fn cast(
    simd: impl Simd,
    index: &BoxIndex,
    (cast, max_time): (Cast, f32),
    visit: impl FnMut(u32) -> f32,
) -> u64 {
    Walk::new(index, cast, max_time, visit).answer(simd)
}

/// Visits the boxes within a distance of a point; see [`BoxIndex::near`].
#[inline(always)]
pub(super) fn near(
    simd: impl Simd,
    index: &BoxIndex,
    (point, max_distance): ([f32; 3], f32),
    visit: impl FnMut(u32) -> f32,
) -> u64 {
    let is_place = point[0].is_finite() & point[1].is_finite() & point[2].is_finite();
    if is_place { Walk::new(index, Near { point }, max_distance, visit).answer(simd) } else { 0 }
}

/// A walk of a query that orders boxes by time or distance.
struct Walk<'a, Q, V> {
    index: &'a BoxIndex,
    query: Q,
    /// Called with the id of a box; returns the new bound.
    visit: V,
    /// Boxes beyond this value are not wanted. Negative if none is.
    limit: f32,
    /// The first box whose visit returned 0, if the walk did not begin with 0. Of the boxes at 0 only those with lower ids are wanted.
    below: u32,
    /// The walk began with 0: every box at 0 is wanted.
    is_overlap: bool,
    /// Nodes.
    looked_at: u64,
}

impl<'a, Q: Query, V: FnMut(u32) -> f32> Walk<'a, Q, V> {
    /// Makes a walk up to a time or distance.
    #[inline(always)]
    fn new(index: &'a BoxIndex, query: Q, bound: f32, visit: V) -> Self {
        let limit = limit_of(&query, bound);
        Self { index, query, visit, limit, below: u32::MAX, is_overlap: bound <= 0.0, looked_at: 0 }
    }

    /// Visits the boxes, and returns the number of nodes looked at.
    #[inline(always)]
    fn answer(mut self, simd: impl Simd) -> u64 {
        let (index, mut loose) = (self.index, self.index.loose());
        // Nodes that wait, the nearest one last, and the least value at which the query meets each.
        let mut bounds = ArrayVec::<f32, STACK>::new();
        let mut nodes = ArrayVec::<u32, STACK>::new();
        bounds.push(0.0);
        nodes.extend(index.root());
        while let Some(mut number) = loose.next().or_else(|| nodes.pop()) {
            if number < index.end && bounds.pop().is_none_or(|least| least > self.limit) {
                continue;
            }
            loop {
                self.looked_at += 1;
                let node = &index.nodes[number as usize];
                let [least, latest] = self.query.meet(node, self.limit);
                let Some(nearest) = simd.nearest(&least, &latest) else { break };
                let (least, children, count) = simd.farthest_first(&least, &latest, &node.children);
                if index.is_leaf(number) {
                    self.visit(&least, &children, count);
                    break;
                }
                // The next node is known before the others are in order.
                number = node.children[nearest];
                push_all(&mut bounds, &least, count - 1);
                push_all(&mut nodes, &children, count - 1);
            }
        }
        self.looked_at
    }

    /// Visits the first boxes of a list, from the last of them on.
    #[inline(always)]
    fn visit(&mut self, least: &Lanes, ids: &Eight, count: usize) {
        for (&least, &id) in least.iter().zip(ids).take(count).rev() {
            if least > self.limit || least == 0.0 && id >= self.below {
                continue;
            }
            let bound = (self.visit)(id);
            if bound <= 0.0 && self.below == u32::MAX && !self.is_overlap {
                self.below = id;
            }
            self.limit = limit_of(&self.query, bound);
        }
    }
}

/// Returns the value beyond which a query wants no boxes; negative if it wants none.
#[inline(always)]
fn limit_of(query: &impl Query, bound: f32) -> f32 {
    if bound >= 0.0 { query.limit(bound.min(f32::MAX)) } else { -1.0 }
}

/// Adds the first numbers of eight. (All are copied: a loop of unknown length takes longer.)
#[inline(always)]
fn push_all<T: Copy>(list: &mut ArrayVec<T, STACK>, numbers: &[T; LANES], count: usize) {
    let len = list.len() + count;
    list.try_extend_from_slice(numbers).expect("a walk waits for few nodes");
    list.truncate(len);
}

/// Calls `visit` with the id of each box that overlaps one, and returns the number of nodes looked at, which are not counted for a sort.
#[inline(always)]
pub(crate) fn overlapping(simd: impl Simd, index: &BoxIndex, aabb: &Aabb, mut visit: impl FnMut(u32)) -> u64 {
    if !aabb.is_valid() {
        return 0;
    }
    let (mut looked_at, mut loose, mut waiting) = (0, index.loose(), ArrayVec::<u32, STACK>::new());
    waiting.extend(index.root());
    while let Some(number) = loose.next().or_else(|| waiting.pop()) {
        looked_at += 1;
        let node = &index.nodes[number as usize];
        let mut met = simd.overlaps_eight(&node.boxes, aabb) & node.used(simd);
        while let Some(lane) = next(&mut met) {
            let child = node.children[lane];
            if index.is_leaf(number) { visit(child) } else { waiting.push(child) }
        }
    }
    looked_at
}
