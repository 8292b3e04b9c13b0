//! The tree (a bounding volume hierarchy) of boxes: for rays, moving boxes, boxes, points, and for a search of all pairs.
//!
//! ```text
//! boxes by id ─► sort (rarely) ─► nodes of eight boxes, eight nodes, ... ◄─ place (few changed), refit (many)
//! ```
//!
//! Each node has eight children. A refit is one pass over the nodes, children first. Boxes are sorted anew once queries have looked at
//! enough nodes for a sort to pay.

#![allow(clippy::needless_range_loop, reason = "a lane of several arrays")]

mod node;
mod place;
mod query;
mod refit;
mod sort;
#[cfg(test)]
mod tests;
mod walk;

use crate::policy;
use crate::simd::dispatch;
use crate::{Aabb, OccupiedCell};
use node::Node;
pub(crate) use node::{LANES, NONE};
use query::Cast;
use std::sync::atomic::{AtomicU64, Ordering};
pub(crate) use walk::overlapping;

/// Boxes by id, for queries about places: which boxes does a ray, a moving box, a box or a point meet?
///
/// The index holds copies of boxes. [`BoxIndex::refresh`] brings it up to date; queries see the boxes of the last refresh.
///
/// ```
/// use pbig_core::{Aabb, BoxIndex};
/// let boxes = [0.0, 5.0, 9.0].map(|x| Aabb::from_center([x, 0.0, 0.0], [0.5; 3]));
/// let mut index = BoxIndex::default();
/// index.refresh(&boxes, None);
/// // The first box on a ray: each visit shortens the ray.
/// let (point, along) = (Aabb::new([2.0, 0.0, 0.0], [2.0, 0.0, 0.0]), [1.0, 0.0, 0.0]);
/// let mut first = (f32::INFINITY, None);
/// index.cast_aabb(&point, along, 100.0, |id| {
///     let distance = boxes[id as usize].min[0] - 2.0;
///     if distance < first.0 {
///         first = (distance, Some(id));
///     }
///     first.0
/// });
/// assert_eq!(first, (2.5, Some(1)));
/// ```
#[derive(Clone, Debug, Default)]
pub struct BoxIndex {
    /// Leaves first, then their parents, and so on up to the root; then loose leaves, which hold boxes that came since the sort.
    pub(crate) nodes: Vec<Node>,
    pub(crate) leaves: u32,
    /// One more than the root's number; 0 if there is none.
    pub(crate) end: u32,
    /// By node: the lane in which its parent has it (node times eight plus lane), or `NONE`.
    parents: Vec<u32>,
    /// By node: the box around its boxes.
    pub(crate) bounds: Vec<Aabb>,
    /// By node: free lanes of a leaf; for any other, children that have room.
    room: Vec<u8>,
    /// The leaf whose lane was left last.
    left: usize,
    /// By node: the sum of its extents at the last sort; infinite once it has grown past twice that.
    extents: Vec<f32>,
    grown: usize,
    /// By id: the lane of its box, or `NONE`.
    places: Vec<u32>,
    /// Boxes at the last layout.
    listed: usize,
    /// Length of the list of boxes at the last refresh.
    known: usize,
    /// Boxes may have moved since the last sort.
    has_moved: bool,
    /// Nodes that queries have looked at since the last sort; not counted while no sort is wanted.
    looked_at: Count,
    /// As `looked_at`, of look-ups: threads that query at once do not decide about an update.
    looked_up: u64,
    /// Nodes to look at before a sort pays; none if no number of them is enough.
    sort_after: Option<u64>,
    /// Buffers for few changed boxes: these in the order of places, and the nodes of a level above them.
    order: Vec<u64>,
    level: Vec<u32>,
}

/// A count on a cache line of its own: queries of other threads read what would lie beside it.
#[derive(Debug, Default)]
#[repr(align(64))]
struct Count(AtomicU64);

impl Clone for Count {
    fn clone(&self) -> Self {
        Self(AtomicU64::new(self.0.load(Ordering::Relaxed)))
    }
}

impl BoxIndex {
    /// Visits the ids of boxes that a moving box meets between time 0 and `max_time`, about the earliest first. `start` is the
    /// moving box at time 0 (a point for a ray), `velocity` its motion in a unit of time.
    ///
    /// `visit` returns the time until which further boxes are wanted; boxes that are met just after it may be visited as well. After
    /// a time of 0 only boxes that are met at time 0 are visited, and of these (unless `max_time` is 0) only those with lower ids: so
    /// a caller that takes the lowest id of several at one time needs no others. After a negative time none is visited. No box is
    /// visited twice. With a NaN in the query, or a negative `max_time`, no box is visited. A box may be missed if its distance, or the
    /// time until it is met, is too large for `f32`. Returns the number of nodes, of eight boxes each, that were tested.
    #[inline(always)]
    pub fn cast_aabb(
        &self,
        start: &Aabb,
        velocity: [f32; 3],
        max_time: f32,
        visit: impl FnMut(u32) -> f32,
    ) -> u64 {
        let Some(cast) = Cast::new(start, velocity, max_time) else { return 0 };
        // Rays that miss everything are many, and the instructions for eight boxes take longer to begin with.
        if self.loose().is_empty() && !self.bounds.last().is_some_and(|all| cast.meets(all, max_time)) {
            return 0;
        }
        self.note(dispatch!(walk::cast, self, (cast, max_time), visit))
    }

    /// Visits the ids of boxes within a distance of a point, about the nearest first. `visit` returns the distance up to which
    /// further boxes are wanted, by the rules of [`BoxIndex::cast_aabb`]; a box that holds the point is at distance 0. With a
    /// number in the point that is not finite, or a negative `max_distance`, no box is visited. Returns the number of nodes that
    /// were tested.
    #[inline(always)]
    pub fn near(&self, point: [f32; 3], max_distance: f32, visit: impl FnMut(u32) -> f32) -> u64 {
        self.note(dispatch!(walk::near, self, (point, max_distance), visit))
    }

    /// Visits the ids of boxes that overlap a box, in no particular order: none if it is invalid. Returns the number of nodes that
    /// were tested.
    #[inline(always)]
    pub fn overlapping(&self, aabb: &Aabb, visit: impl FnMut(u32)) -> u64 {
        self.note(dispatch!(walk::overlapping, self, aabb, visit))
    }

    /// Counts nodes that look-ups have looked at. Those that were given up count as a sort, unless boxes were sorted just now.
    pub(crate) fn note_look_ups(&mut self, nodes: u64, is_given_up: bool) {
        let is_useless = is_given_up && self.has_moved;
        let one_sort = policy::bvh::nodes_for_sort(self.leaves, self.listed);
        self.looked_up += nodes + if is_useless { one_sort } else { 0 };
    }

    /// Counts nodes that a query has looked at, where they can lead to a sort. Threads may lose each other's counts: an atomic addition
    /// takes as long as a node.
    #[inline(always)]
    fn note(&self, looked_at: u64) -> u64 {
        if self.sort_after.is_some() {
            let before = self.looked_at.0.load(Ordering::Relaxed);
            self.looked_at.0.store(before + looked_at, Ordering::Relaxed);
        }
        looked_at
    }

    /// Returns the number of boxes at the last layout.
    pub(crate) fn len(&self) -> usize {
        self.listed
    }

    /// Returns the leaves and the ids of their boxes, for pictures.
    pub(crate) fn occupied_leaves(&self) -> Vec<OccupiedCell> {
        let cell = |leaf: u32| {
            let node = &self.nodes[leaf as usize];
            let ids = (0..LANES).filter(|lane| node.has(*lane)).map(|lane| node.children[lane]).collect();
            OccupiedCell { aabb: self.bounds[leaf as usize], ids }
        };
        let cells = (0..self.leaves).chain(self.loose()).map(cell);
        cells.filter(|cell| !cell.ids.is_empty()).collect()
    }

    #[inline(always)]
    pub(crate) fn root(&self) -> Option<u32> {
        self.end.checked_sub(1)
    }

    #[inline(always)]
    pub(crate) fn is_leaf(&self, node: u32) -> bool {
        node < self.leaves || node >= self.end
    }

    /// Returns the leaves that no other node holds.
    #[inline(always)]
    fn loose(&self) -> std::ops::Range<u32> {
        self.end..self.nodes.len() as u32
    }
}
