//! An index of boxes for questions: rays, moving boxes, boxes, points.
//!
//! ```text
//! boxes by id ─► sort (rarely) ─► nodes of eight boxes, eight nodes, ... ◄─ refit (before a question, if boxes moved)
//! ```
//!
//! A tree of nodes with eight children each. It is refitted in one pass over its nodes, children first. Sorting is left until
//! questions have looked at enough nodes for a sort to pay.

#![allow(clippy::needless_range_loop, reason = "a lane of several arrays")]

mod join;
mod node;
mod question;
mod refit;
mod sort;
#[cfg(test)]
pub(crate) mod tests;
mod walk;

use crate::grid::dispatch;
use crate::{Aabb, OccupiedCell};
use node::{LANES, Node};
use question::{Near, Question, Sweep};
use std::sync::atomic::{AtomicU64, Ordering};
use walk::Walk;

/// Boxes by id, for questions about places: which boxes does a ray, a moving box, a box or a point meet?
///
/// The index holds copies of boxes. [`BoxIndex::refresh`] brings it up to date; questions see the boxes of the last refresh.
///
/// ```
/// use pbig_core::{Aabb, BoxIndex};
/// let boxes = [0.0, 5.0, 9.0].map(|x| Aabb::from_center([x, 0.0, 0.0], [0.5; 3]));
/// let mut index = BoxIndex::default();
/// index.refresh(&boxes, None);
/// // The first box on a ray: each visit shortens the ray.
/// let (point, along) = (Aabb::new([2.0, 0.0, 0.0], [2.0, 0.0, 0.0]), [1.0, 0.0, 0.0]);
/// let mut first = (f32::INFINITY, None);
/// index.sweep(&point, along, 100.0, &mut |id| {
///     let distance = boxes[id as usize].min[0] - 2.0;
///     if distance < first.0 {
///         first = (distance, Some(id));
///     }
///     first.0
/// });
/// assert_eq!(first, (2.5, Some(1)));
/// ```
#[derive(Debug, Default)]
pub struct BoxIndex {
    /// Leaves first, then their parents, and so on up to the root; then loose leaves, which hold boxes that came since the sort.
    nodes: Vec<Node>,
    leaves: u32,
    /// One more than the root's number; 0 if there is none.
    end: u32,
    /// By node: the lane in which its parent has it (node times eight plus lane), or `NONE`.
    parents: Vec<u32>,
    /// By node: the sum of its extents at the last sort; infinite once it has grown past twice that.
    extents: Vec<f32>,
    grown: usize,
    /// By id: the lane of its box, or `NONE`.
    places: Vec<u32>,
    /// Length of the list of boxes at the last layout.
    listed: usize,
    is_sorted: bool,
    /// Boxes may have moved since the last sort.
    has_moved: bool,
    /// Nodes that questions have looked at since the last sort.
    looked_at: AtomicU64,
}

impl Clone for BoxIndex {
    /// Returns an empty index, which its first [`BoxIndex::refresh`] fills.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl BoxIndex {
    /// Visits the ids of boxes that a moving box meets between time 0 and `max_time`: those at time 0 first, by id, then the
    /// others, about the earliest first. `start` is the moving box at time 0 (a point for a ray), `velocity` its motion in a
    /// unit of time.
    ///
    /// `visit` returns the time until which further boxes are wanted; boxes that are met just after it may be visited as well.
    /// After a time of 0 no box is wanted. No box is visited twice. With a NaN in the question, or a
    /// negative time, no box is visited. Returns the number of nodes, of eight boxes each, that were tested.
    pub fn sweep(
        &self,
        start: &Aabb,
        velocity: [f32; 3],
        max_time: f32,
        visit: &mut dyn FnMut(u32) -> f32,
    ) -> u64 {
        Sweep::new(start, velocity, max_time).map_or(0, |question| self.ask(question, max_time, visit))
    }

    /// Visits the ids of boxes within a distance of a point: those around it first, by id, then the others, about the nearest
    /// first. `visit` returns the distance up to which
    /// further boxes are wanted; boxes just beyond may be visited as well. Returns the number of nodes that were tested.
    pub fn near(&self, point: [f32; 3], max_distance: f32, visit: &mut dyn FnMut(u32) -> f32) -> u64 {
        let is_place = point.iter().all(|x| x.is_finite());
        if is_place { self.ask(Near { point }, max_distance, visit) } else { 0 }
    }

    /// Visits the ids of boxes that overlap a box, in ascending order. Returns the number of nodes that were tested.
    pub fn overlapping(&self, aabb: &Aabb, visit: &mut dyn FnMut(u32)) -> u64 {
        self.sweep(aabb, [0.0; 3], 0.0, &mut |id| {
            visit(id);
            0.0
        })
    }

    fn ask<Q: Question>(&self, question: Q, bound: f32, visit: &mut dyn FnMut(u32) -> f32) -> u64 {
        if bound.is_nan() || bound < 0.0 {
            return 0;
        }
        // An empty lane is met at infinity.
        let bound = bound.min(f32::MAX);
        let walk = Walk { index: self, question, bound, visit, at_start: Vec::new(), looked_at: 0 };
        let looked_at = dispatch!(Walk::answer, walk);
        self.looked_at.fetch_add(looked_at, Ordering::Relaxed);
        looked_at
    }

    /// Returns the leaves and the ids of their boxes, for pictures.
    pub(crate) fn occupied_leaves(&self) -> Vec<OccupiedCell> {
        let leaves = (0..self.leaves).chain(self.loose()).map(|leaf| &self.nodes[leaf as usize]);
        let cells = leaves.map(|node| OccupiedCell {
            aabb: node.bounds(),
            ids: (0..LANES).filter(|lane| node.has(*lane)).map(|lane| node.children[lane]).collect(),
        });
        cells.filter(|cell| !cell.ids.is_empty()).collect()
    }

    fn root(&self) -> Option<u32> {
        self.end.checked_sub(1)
    }

    #[inline(always)]
    fn is_leaf(&self, node: u32) -> bool {
        node < self.leaves
    }

    /// Returns the leaves that no other node holds.
    fn loose(&self) -> std::ops::Range<u32> {
        self.end..self.nodes.len() as u32
    }
}
