//! Bringing an index up to date: boxes that moved, came or went, and now and then a new layout.

use super::BoxIndex;
use super::node::{LANES, NONE, Node, extent_sum};
use super::sort::{Entry, Order, sort};
use crate::Aabb;
use crate::parallel::{available_threads, run_parts};
use crate::policy::{self, PARALLEL_FROM_BOXES};
use crate::simd::{Simd, dispatch, prefetch};
use std::sync::atomic::Ordering;

/// Leaves that a thread reads at a time.
const PIECE: usize = 256;

/// Leaves between the one that is read and the one whose boxes are asked for.
const READ_AHEAD: usize = 3;

/// Number of boxes whose memory is never given back.
const SMALL: usize = 8192;

/// Minimum ratio of memory to what is needed for it to be given back.
const PEAK: usize = 8;

impl BoxIndex {
    /// Takes the boxes as they are now: `boxes` by id, [`Aabb::NOWHERE`] for an absent one. `changed` are the ids whose boxes
    /// may differ from those at the last call, in any order, repeated or not; without it any box may differ. Ids beyond the list have
    /// no box. The first call sorts the boxes. Shares the work of many boxes among rayon's threads.
    pub fn refresh(&mut self, boxes: &[Aabb], changed: Option<&[u32]>) {
        let gone = boxes.len() as u32..self.known as u32;
        if changed.is_none() || gone.is_empty() {
            self.refresh_present(boxes, changed, 0..boxes.len() as u32, false);
            return;
        }
        let changed: Vec<u32> = changed.unwrap_or_default().iter().copied().chain(gone).collect();
        self.refresh_present(boxes, Some(&changed), 0..boxes.len() as u32, false);
    }

    /// As [`BoxIndex::refresh`]; no id but the `present` ones has a box. Look-ups count their own nodes, and leave room for boxes that
    /// come. Returns the number of boxes that were read.
    pub(crate) fn refresh_present(
        &mut self,
        boxes: &[Aabb],
        changed: Option<&[u32]>,
        present: impl Iterator<Item = u32> + Clone,
        is_for_look_ups: bool,
    ) -> usize {
        let order = if is_for_look_ups { Order::ROOMY } else { Order::SORTED };
        let mut read = 0;
        if self.end > 0 {
            read = self.update(boxes, changed, present.clone(), order);
            let have_look_ups_paid = || self.sort_after.is_some_and(|nodes| self.looked_up >= nodes);
            let has_paid = if is_for_look_ups { have_look_ups_paid() } else { self.wants_sort() };
            if !has_paid && !self.has_many_loose() {
                return read;
            }
        }
        self.lay_out(boxes, present, order);
        read + self.listed
    }

    /// Reads the changed boxes, if they are few, or all; lays them out anew in an order if they hardly fit. Returns the number of boxes
    /// that were read.
    fn update(
        &mut self,
        boxes: &[Aabb],
        changed: Option<&[u32]>,
        present: impl Iterator<Item = u32> + Clone,
        order: Order,
    ) -> usize {
        self.has_moved |= changed.is_none_or(|changed| !changed.is_empty());
        let is_few = |changed: &&[u32]| changed.len() * policy::bvh::REFIT_SHARE < boxes.len();
        let few = changed.filter(is_few);
        match few {
            Some(changed) => self.place(boxes, changed),
            None => self.refit(boxes, present, order),
        }
        self.known = boxes.len();
        self.plan_sort();
        few.map_or(self.listed, <[u32]>::len)
    }

    /// Returns true if the boxes should be laid out anew, because too many have no place in the tree.
    fn has_many_loose(&self) -> bool {
        self.loose().len() > policy::bvh::loose_leaves(self.leaves)
    }

    /// Writes ids in the order of their places: place and id in one word.
    pub(crate) fn in_order(&self, ids: &[u32], order: &mut Vec<u64>) {
        order.clear();
        let place = |id: u32| self.places.get(id as usize).copied().unwrap_or(NONE);
        order.extend(ids.iter().map(|id| word(place(*id), *id)));
        order.sort_unstable();
    }

    /// Stores boxes in their places, and passes the bounds of their nodes on, level by level.
    #[inline(always)]
    pub(super) fn put_all(simd: impl Simd, index: &mut Self, boxes: &[Aabb], order: &[u64]) {
        let mut nodes = std::mem::take(&mut index.level);
        nodes.clear();
        for word in order {
            let (place, id) = ((word >> 32) as u32, *word as u32);
            let node = &mut index.nodes[place as usize / LANES];
            // A lane that was left may have been taken since.
            if node.children[place as usize % LANES] == id {
                let aabb = boxes.get(id as usize).unwrap_or(&Aabb::NOWHERE);
                node.set(place as usize % LANES, aabb);
                if nodes.last() != Some(&(place / LANES as u32)) {
                    nodes.push(place / LANES as u32);
                }
            }
        }
        while !nodes.is_empty() {
            let mut parents = 0;
            for i in 0..nodes.len() {
                let at = nodes[i] as usize;
                let bounds = simd.around(&index.nodes[at].boxes);
                if index.bounds[at] == bounds {
                    continue;
                }
                index.bounds[at] = bounds;
                index.grown += usize::from(outgrows(&bounds, &mut index.extents[at]));
                let place = index.parents[at];
                if place != NONE {
                    index.nodes[place as usize / LANES].set(place as usize % LANES, &bounds);
                    let parent = place / LANES as u32;
                    if parents == 0 || nodes[parents - 1] != parent {
                        nodes[parents] = parent;
                        parents += 1;
                    }
                }
            }
            nodes.truncate(parents);
        }
        index.level = nodes;
    }

    /// Clears the places of all boxes, without a pass over ids that have none.
    fn forget_places(&mut self) {
        for leaf in (0..self.leaves).chain(self.loose()) {
            for id in self.nodes[leaf as usize].children.iter().filter(|id| **id != NONE) {
                self.places[*id as usize] = NONE;
            }
        }
    }

    /// Returns true if sorting the boxes anew would pay: queries have looked at as many nodes as a sort costs if the order is bad, and at
    /// some times as many if boxes have moved. [`BoxIndex::refresh`] sorts then, too.
    #[inline]
    pub fn wants_sort(&self) -> bool {
        self.sort_after.is_some_and(|nodes| self.looked_at.0.load(Ordering::Relaxed) >= nodes)
    }

    /// Chooses the number of nodes that queries look at before the next sort: as many as one sort costs if the order is bad, some
    /// more if boxes have moved, and no number if the order is as after a sort.
    fn plan_sort(&mut self) {
        let has_some_loose =
            policy::bvh::FEW_LOOSE_SHARE * self.loose().len() > policy::bvh::loose_leaves(self.leaves);
        let has_grown = self.grown * policy::bvh::GROWN_SHARE > self.end as usize;
        let is_bad = has_some_loose || has_grown;
        let one = policy::bvh::nodes_for_sort(self.leaves, self.listed);
        self.sort_after = match (is_bad, self.has_moved) {
            (true, _) => Some(one),
            (false, true) => Some(policy::bvh::SORTS_FOR_ORDER * one),
            (false, false) => None,
        };
    }

    /// Sorts the boxes as they are now.
    pub fn sort(&mut self, boxes: &[Aabb]) {
        self.sort_sets(boxes, None);
    }

    /// Sorts the boxes; of two sets, ids from `split` on are the second, and no leaf has boxes of both.
    pub(crate) fn sort_sets(&mut self, boxes: &[Aabb], split: Option<u32>) {
        let split = split.unwrap_or(u32::MAX);
        self.lay_out(boxes, 0..boxes.len() as u32, Order { split, ..Order::SORTED });
    }

    fn refit(&mut self, boxes: &[Aabb], present: impl Iterator<Item = u32> + Clone, order: Order) {
        self.read_all(boxes);
        // After a peak, most leaves are empty.
        let full = self.bounds[..self.leaves as usize].iter().filter(|bounds| bounds.is_valid()).count();
        if policy::bvh::FULL_LEAVES_SHARE * full < self.leaves as usize {
            return self.lay_out(boxes, present, order);
        }
        self.places.resize(boxes.len().max(self.places.len()), NONE);
        let has_come = |id: &u32| self.places[*id as usize] == NONE && boxes[*id as usize].is_valid();
        let came: Vec<u32> = present.clone().filter(has_come).collect();
        if came.len() > LANES * policy::bvh::loose_leaves(self.leaves) {
            return self.lay_out(boxes, present, order);
        }
        self.place(boxes, &came);
    }

    /// Reads the boxes of all leaves, then those of the other nodes, children first.
    fn read_all(&mut self, boxes: &[Aabb]) {
        let (leaves, end) = (self.leaves as usize, self.end as usize);
        let workers = if boxes.len() < PARALLEL_FROM_BOXES { 1 } else { available_threads() };
        let bounds = self.bounds[..leaves].chunks_mut(PIECE);
        run_parts(workers, self.nodes[..leaves].chunks_mut(PIECE).zip(bounds), |_, (nodes, bounds)| {
            dispatch!(read, nodes, bounds, boxes);
        });
        dispatch!(read, &mut self.nodes[end..], &mut self.bounds[end..], boxes);
        dispatch!(read_inner, &mut self.nodes[leaves..end], &mut self.bounds, leaves);
        let grown =
            self.bounds.iter().zip(&mut self.extents).map(|(bounds, extent)| outgrows(bounds, extent));
        self.grown += grown.map(usize::from).sum::<usize>();
    }

    pub(super) fn push(&mut self, node: Node, room: u8) {
        self.room.push(room);
        self.nodes.push(node);
        self.parents.push(NONE);
        self.bounds.push(Aabb::NOWHERE);
        self.extents.push(f32::INFINITY);
    }

    /// Makes all nodes anew.
    fn lay_out(&mut self, boxes: &[Aabb], present: impl Iterator<Item = u32>, order: Order) {
        let all = present.map(|id| (id, &boxes[id as usize])).filter(|(_, aabb)| aabb.is_valid());
        let mut entries: Vec<Entry> = all.map(|(id, aabb)| Entry::new(id, aabb)).collect();
        self.drop_peak(entries.len());
        self.forget_places();
        self.nodes.clear();
        self.room.clear();
        self.parents.clear();
        self.bounds.clear();
        self.extents.clear();
        self.places.resize(boxes.len().max(self.places.len()), NONE);
        self.listed = entries.len();
        let classes = sort(&mut entries, order).into_iter();
        let classes = classes.map(|class| self.push_leaves(&entries[class], order.leaf));
        let classes: Vec<_> = classes.collect();
        self.leaves = self.nodes.len() as u32;
        let mut roots: Vec<u32> =
            classes.into_iter().flat_map(|class| self.push_parents(class.collect())).collect();
        roots = self.push_parents(roots);
        debug_assert!(roots.len() < 2);
        self.end = self.nodes.len() as u32;
        self.known = boxes.len();
        self.read_all(boxes);
        self.extents = self.bounds.iter().map(extent_sum).collect();
        (self.grown, self.looked_up, self.has_moved) = (0, 0, false);
        *self.looked_at.0.get_mut() = 0;
        self.plan_sort();
    }

    /// Becomes empty if so many boxes need far less memory than there is.
    pub(crate) fn drop_peak(&mut self, boxes: usize) {
        if self.nodes.capacity() > PEAK * (boxes + SMALL) / LANES {
            *self = Self::default();
        }
    }

    /// Makes the leaves of a class, of so many boxes each; returns their numbers.
    fn push_leaves(&mut self, class: &[Entry], leaf: usize) -> std::ops::Range<u32> {
        let first = self.nodes.len() as u32;
        for boxes in class.chunks(leaf) {
            let mut node = Node::EMPTY;
            for (lane, entry) in boxes.iter().enumerate() {
                node.children[lane] = entry.id;
                self.places[entry.id as usize] = (self.nodes.len() * LANES + lane) as u32;
            }
            self.push(node, (LANES - boxes.len()) as u8);
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
                let room = eight.iter().map(|child| u8::from(self.room[*child as usize] > 0)).sum();
                self.push(node, room);
            }
            level = (first..self.nodes.len() as u32).collect();
        }
        level
    }
}

/// Returns a place and an id in one word, in the order of places.
pub(super) fn word(place: u32, id: u32) -> u64 {
    u64::from(place) << 32 | u64::from(id)
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
    let is_grown = extent_sum(bounds) > policy::bvh::GROWN_TO * *extent;
    if is_grown {
        *extent = f32::INFINITY;
    }
    is_grown
}
