//! Bringing an index up to date: boxes that moved, came or went, and now and then a new layout.

use super::BoxIndex;
use super::node::{LANES, NONE, Node, extent_sum};
use super::sort::{Entry, sort};
use crate::Aabb;
use crate::grid::{Simd, dispatch, prefetch};
use crate::parallel::{SharedSlice, alone, available_threads, run};
use crate::policy::{PARALLEL_FROM_BOXES, index as policy};
use std::sync::atomic::Ordering;

/// Leaves that a thread reads at a time.
const PIECE: usize = 256;

/// Leaves between the one that is read and the one whose boxes are asked for.
const READ_AHEAD: usize = 3;

impl BoxIndex {
    /// Takes the boxes as they are now: `boxes` by id, [`Aabb::NOWHERE`] for an absent one. `changed` are the ids whose boxes
    /// may differ from those at the last call, in any order, repeated or not; without it any box may differ. Ids beyond the list have
    /// no box. Shares the work of many boxes among rayon's threads.
    pub fn refresh(&mut self, boxes: &[Aabb], changed: Option<&[u32]>) {
        self.has_moved |= changed.is_none_or(|changed| !changed.is_empty());
        let gone = boxes.len() as u32..self.known as u32;
        let is_few = |changed: &&[u32]| (changed.len() + gone.len()) * policy::REFIT_SHARE < self.listed;
        match changed.filter(is_few) {
            Some(changed) => {
                changed.iter().copied().chain(gone).for_each(|id| self.take(id, boxes));
            }
            None => self.refit(boxes),
        }
        self.known = boxes.len();
        self.plan_sort();
        if self.wants_sort() || self.loose().len() > policy::loose_leaves(self.leaves) {
            self.lay_out(boxes, self.has_earned_sort().then_some(u32::MAX));
        }
    }

    /// As [`BoxIndex::refresh`], on the caller's thread alone. A caller that holds a lock needs this: rayon could give its thread another
    /// task, which waits for the lock.
    #[doc(hidden)]
    pub fn refresh_alone(&mut self, boxes: &[Aabb], changed: Option<&[u32]>) {
        alone(|| self.refresh(boxes, changed));
    }

    /// Reads the changed boxes, for an owner that looks up each of them. Returns false if the boxes should be sorted before.
    pub(crate) fn follow(&mut self, boxes: &[Aabb], changed: &[u32]) -> bool {
        // A clone is empty.
        if !self.is_sorted {
            return false;
        }
        self.has_moved = true;
        changed.iter().for_each(|&id| self.take(id, boxes));
        self.plan_sort();
        let is_loose = self.loose().len() > policy::loose_leaves(self.leaves);
        !is_loose && !self.wants_sort()
    }

    /// Renames the boxes, as of the last sort: `names[id]` is the new id of the box `id`.
    pub(crate) fn rename(&mut self, names: &[u32]) {
        self.forget_places();
        let ids = names.last().map_or(0, |last| *last as usize + 1);
        self.places.resize(ids.max(self.places.len()), NONE);
        for (leaf, node) in self.nodes[..self.leaves as usize].iter_mut().enumerate() {
            for (lane, id) in node.children.iter_mut().enumerate().filter(|(_, id)| **id != NONE) {
                *id = names[*id as usize];
                self.places[*id as usize] = (leaf * LANES + lane) as u32;
            }
        }
    }

    /// Clears the places of all boxes, without a pass over ids that have none.
    fn forget_places(&mut self) {
        for leaf in (0..self.leaves).chain(self.loose()) {
            for id in self.nodes[leaf as usize].children.iter().filter(|id| **id != NONE) {
                self.places[*id as usize] = NONE;
            }
        }
    }

    /// Returns true if sorting the boxes anew would pay: queries have looked at as many nodes as a sort costs, and the order is bad.
    /// [`BoxIndex::refresh`] sorts then, too.
    #[inline]
    pub fn wants_sort(&self) -> bool {
        self.sort_after.is_some_and(|nodes| self.looked_at.0.load(Ordering::Relaxed) >= nodes)
    }

    /// Chooses the number of nodes that queries look at before the next sort: as many as one sort costs if the order is bad, some
    /// more if boxes have moved, and no number if the order is as after a sort.
    fn plan_sort(&mut self) {
        let has_many_loose = policy::FEW_LOOSE_SHARE * self.loose().len() > policy::loose_leaves(self.leaves);
        let has_grown = self.grown * policy::GROWN_SHARE > self.end as usize;
        let is_bad = !self.is_sorted || has_many_loose || has_grown;
        let one = policy::nodes_for_sort(self.leaves, self.listed);
        self.sort_after = match (is_bad, self.has_moved) {
            (true, _) => Some(one),
            (false, true) => Some(policy::SORTS_FOR_ORDER * one),
            (false, false) => None,
        };
    }

    /// Returns true if queries have looked at as many nodes as a sort costs.
    fn has_earned_sort(&self) -> bool {
        self.looked_at.0.load(Ordering::Relaxed) >= policy::nodes_for_sort(self.leaves, self.listed)
    }

    /// Sorts the boxes as they are now.
    pub fn sort(&mut self, boxes: &[Aabb]) {
        self.sort_sets(boxes, None);
    }

    /// Sorts the boxes; of two sets, ids from `split` on are the second, and no leaf has boxes of both.
    pub(crate) fn sort_sets(&mut self, boxes: &[Aabb], split: Option<u32>) {
        self.lay_out(boxes, Some(split.unwrap_or(u32::MAX)));
    }

    /// Reads all boxes.
    fn refit(&mut self, boxes: &[Aabb]) {
        if self.end == 0 {
            return self.lay_out(boxes, None);
        }
        self.read_all(boxes);
        // After a peak, most leaves are empty.
        let full = self.bounds[..self.leaves as usize].iter().filter(|bounds| bounds.is_valid()).count();
        if policy::FULL_LEAVES_SHARE * full < self.leaves as usize {
            return self.lay_out(boxes, self.is_sorted.then_some(u32::MAX));
        }
        self.places.resize(boxes.len().max(self.places.len()), NONE);
        for (id, aabb) in boxes.iter().enumerate() {
            if self.places[id] == NONE && aabb.is_valid() {
                self.add(id as u32, boxes);
            }
        }
    }

    /// Reads the boxes of all leaves, then those of the other nodes, children first.
    fn read_all(&mut self, boxes: &[Aabb]) {
        let (leaves, end) = (self.leaves as usize, self.end as usize);
        let workers = if boxes.len() < PARALLEL_FROM_BOXES { 1 } else { available_threads() };
        let (nodes, bounds) = (SharedSlice::new(&mut self.nodes), SharedSlice::new(&mut self.bounds));
        run(workers, leaves.div_ceil(PIECE), |_, piece| {
            let leaves = piece * PIECE..leaves.min((piece + 1) * PIECE);
            // SAFETY: each number of a piece is given to one thread, pieces have different leaves, and leaves come first in both lists.
            let (nodes, bounds) = unsafe { (nodes.part(leaves.clone()), bounds.part(leaves)) };
            dispatch!(read, nodes, bounds, boxes);
        });
        dispatch!(read, &mut self.nodes[end..], &mut self.bounds[end..], boxes);
        dispatch!(read_inner, &mut self.nodes[leaves..end], &mut self.bounds, leaves);
        let grown =
            self.bounds.iter().zip(&mut self.extents).map(|(bounds, extent)| outgrows(bounds, extent));
        self.grown += grown.map(usize::from).sum::<usize>();
    }

    /// Reads one box.
    fn take(&mut self, id: u32, boxes: &[Aabb]) {
        let place = self.places.get(id as usize).copied().unwrap_or(NONE);
        let aabb = boxes.get(id as usize).copied().unwrap_or(Aabb::NOWHERE);
        if place != NONE {
            dispatch!(Self::put, self, place, &aabb);
        } else if aabb.is_valid() {
            self.add(id, boxes);
        }
    }

    /// Stores a box in a lane, and tells the ancestors of the node its bounds, up to the first one that they do not change.
    #[inline(always)]
    fn put(simd: impl Simd, index: &mut Self, mut place: u32, aabb: &Aabb) {
        let mut aabb = *aabb;
        while place != NONE {
            let at = place as usize / LANES;
            index.nodes[at].set(place as usize % LANES, &aabb);
            aabb = simd.around(&index.nodes[at].boxes);
            if index.bounds[at] == aabb {
                return;
            }
            index.bounds[at] = aabb;
            index.grown += usize::from(outgrows(&aabb, &mut index.extents[at]));
            place = index.parents[at];
        }
    }

    /// Appends a box that has no place to the loose leaves.
    fn add(&mut self, id: u32, boxes: &[Aabb]) {
        if self.places.len() <= id as usize {
            self.places.resize(id as usize + 1, NONE);
        }
        let last = self.nodes.len().checked_sub(1).filter(|last| *last >= self.end as usize);
        let open = last.filter(|last| self.nodes[*last].children[LANES - 1] == NONE);
        let at = open.unwrap_or_else(|| {
            self.push(Node::EMPTY);
            self.nodes.len() - 1
        });
        let node = &mut self.nodes[at];
        let lane = node.children.iter().position(|child| *child == NONE).unwrap_or(LANES - 1);
        node.children[lane] = id;
        let place = (at * LANES + lane) as u32;
        self.places[id as usize] = place;
        dispatch!(Self::put, self, place, &boxes[id as usize]);
    }

    fn push(&mut self, node: Node) {
        self.nodes.push(node);
        self.parents.push(NONE);
        self.bounds.push(Aabb::NOWHERE);
        self.extents.push(f32::INFINITY);
    }

    /// Makes all nodes anew: in the order of ids, or with a `split` sorted as two sets, the first with the ids below it.
    fn lay_out(&mut self, boxes: &[Aabb], split: Option<u32>) {
        let ids = (0u32..).zip(boxes).filter(|(_, aabb)| aabb.is_valid());
        let mut entries: Vec<Entry> = ids.map(|(id, aabb)| Entry::new(id, aabb)).collect();
        self.forget_places();
        self.nodes.clear();
        self.parents.clear();
        self.bounds.clear();
        self.extents.clear();
        self.places.resize(boxes.len().max(self.places.len()), NONE);
        self.listed = boxes.len();
        let all = 0..entries.len();
        let classes = split.map_or_else(|| Vec::from([all]), |split| sort(&mut entries, split));
        let classes: Vec<_> = classes.into_iter().map(|class| self.push_leaves(&entries[class])).collect();
        self.leaves = self.nodes.len() as u32;
        let mut roots: Vec<u32> =
            classes.into_iter().flat_map(|class| self.push_parents(class.collect())).collect();
        roots = self.push_parents(roots);
        debug_assert!(roots.len() < 2);
        self.end = self.nodes.len() as u32;
        self.known = boxes.len();
        self.read_all(boxes);
        self.extents = self.bounds.iter().map(extent_sum).collect();
        (self.grown, self.is_sorted) = (0, split.is_some());
        if self.is_sorted {
            *self.looked_at.0.get_mut() = 0;
            self.has_moved = false;
        }
        self.plan_sort();
    }

    /// Makes the leaves of a class; returns their numbers.
    fn push_leaves(&mut self, class: &[Entry]) -> std::ops::Range<u32> {
        let first = self.nodes.len() as u32;
        for eight in class.chunks(LANES) {
            let mut node = Node::EMPTY;
            for (lane, entry) in eight.iter().enumerate() {
                node.children[lane] = entry.id;
                self.places[entry.id as usize] = (self.nodes.len() * LANES + lane) as u32;
            }
            self.push(node);
        }
        first..self.nodes.len() as u32
    }

    /// Makes the parents of some nodes, and theirs, up to one; returns it.
    fn push_parents(&mut self, mut level: Vec<u32>) -> Vec<u32> {
        while level.len() > 1 {
            let first = self.nodes.len() as u32;
            for eight in level.chunks(LANES) {
                let mut node = Node::EMPTY;
                node.children[..eight.len()].copy_from_slice(eight);
                for (lane, child) in eight.iter().enumerate() {
                    self.parents[*child as usize] = (self.nodes.len() * LANES + lane) as u32;
                }
                self.push(node);
            }
            level = (first..self.nodes.len() as u32).collect();
        }
        level
    }
}

/// Reads the boxes of leaves, and the boxes around them.
#[inline(always)]
fn read(simd: impl Simd, leaves: &mut [Node], bounds: &mut [Aabb], boxes: &[Aabb]) {
    for at in 0..leaves.len() {
        if let Some(ahead) = leaves.get(at + READ_AHEAD) {
            ahead.children.iter().for_each(|id| prefetch(boxes.as_ptr().wrapping_add(*id as usize)));
        }
        leaves[at].boxes = simd.gather(boxes, &leaves[at].children);
        bounds[at] = simd.around(&leaves[at].boxes);
    }
}

/// Reads the bounds of the children of nodes, which lie before them; `first` is the number of the first node.
#[inline(always)]
fn read_inner(simd: impl Simd, nodes: &mut [Node], bounds: &mut [Aabb], first: usize) {
    for (at, node) in nodes.iter_mut().enumerate() {
        node.boxes = simd.gather(bounds, &node.children);
        bounds[first + at] = simd.around(&node.boxes);
    }
}

/// Returns true, once, if a node has grown to more than twice its extents at the last sort.
#[inline(always)]
fn outgrows(bounds: &Aabb, extent: &mut f32) -> bool {
    let is_grown = extent_sum(bounds) > policy::GROWN_TO * *extent;
    if is_grown {
        *extent = f32::INFINITY;
    }
    is_grown
}
