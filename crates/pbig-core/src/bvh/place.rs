//! Places for boxes that come, and for boxes that jump: lanes that are free, near others.

use super::BoxIndex;
use super::node::{LANES, NONE, Node, extent_sum};
use super::refit::word;
use crate::Aabb;
use crate::policy;
use crate::simd::{Simd, dispatch};

/// Children of the root below which a leaf with room is looked for. Parts for boxes of other sizes may lie in the same place.
const TRIES: usize = 3;

impl BoxIndex {
    /// Returns how many of some boxes have no place, or no longer meet the node above their leaf: these need new places.
    pub(crate) fn arrivals(&self, boxes: &[Aabb], ids: &[u32]) -> usize {
        let place = |id: u32| self.places.get(id as usize).copied().unwrap_or(NONE);
        let aabb = |id: u32| boxes.get(id as usize).filter(|aabb| aabb.is_valid());
        let has_arrived = |id: &&u32| aabb(**id).is_some_and(|aabb| !self.is_near(place(**id), aabb));
        if self.end > 0 { ids.iter().filter(has_arrived).count() } else { 0 }
    }

    /// Reads few boxes. Those that came, and those that have jumped, get places near others.
    pub(super) fn place(&mut self, boxes: &[Aabb], ids: &[u32]) {
        let mut order = std::mem::take(&mut self.order);
        order.clear();
        dispatch!(Self::find_places, self, boxes, ids, &mut order);
        order.sort_unstable();
        dispatch!(Self::put_all, self, boxes, &order);
        self.order = order;
    }

    /// Finds new places for those boxes that need them. Appends all places that have changed, and the ids there.
    #[inline(always)]
    fn find_places(simd: impl Simd, index: &mut Self, boxes: &[Aabb], ids: &[u32], order: &mut Vec<u64>) {
        for &id in ids {
            let place = index.places.get(id as usize).copied().unwrap_or(NONE);
            let aabb = boxes.get(id as usize).filter(|aabb| aabb.is_valid());
            let stays = aabb.is_some_and(|aabb| index.is_near(place, aabb));
            if place != NONE && !stays {
                index.leave(place);
                index.places[id as usize] = NONE;
                order.push(word(place, NONE));
            }
            if let Some(aabb) = aabb {
                if !stays {
                    index.add(simd, id, aabb);
                }
                order.push(word(index.places[id as usize], id));
            }
        }
    }

    /// Frees a lane. Its box is still there.
    fn leave(&mut self, place: u32) {
        let leaf = place as usize / LANES;
        self.nodes[leaf].children[place as usize % LANES] = NONE;
        self.left = leaf;
        self.change_room(leaf, true);
    }

    /// Counts one free lane more in a leaf, or one less. A node above counts the children that have room.
    fn change_room(&mut self, mut node: usize, is_more: bool) {
        loop {
            let room = &mut self.room[node];
            let had_room = *room > 0;
            *room = if is_more { *room + 1 } else { *room - 1 };
            if had_room == (*room > 0) || self.parents[node] == NONE {
                return;
            }
            node = self.parents[node] as usize / LANES;
        }
    }

    /// Returns true if a box is still near the place that it has: it meets the bounds of the node above its leaf.
    fn is_near(&self, place: u32, aabb: &Aabb) -> bool {
        if place == NONE {
            return false;
        }
        let above = self.parents[place as usize / LANES];
        above == NONE || self.bounds[above as usize / LANES].overlaps(aabb)
    }

    /// Gives a box a place near others, or in the loose leaves.
    #[inline(always)]
    fn add(&mut self, simd: impl Simd, id: u32, aabb: &Aabb) {
        if self.places.len() <= id as usize {
            self.places.resize(id as usize + 1, NONE);
        }
        if let Some(leaf) = self.leaf_with_room(simd, aabb) {
            return self.put(leaf, id, aabb);
        }
        let last = self.nodes.len().checked_sub(1).filter(|last| *last >= self.end as usize);
        let is_open =
            |leaf: &usize| *leaf >= self.end as usize && self.room.get(*leaf).is_some_and(|room| *room > 0);
        let open = Some(self.left).filter(is_open).or(last.filter(is_open));
        let at = open.unwrap_or_else(|| {
            self.push(Node::EMPTY, LANES as u8);
            self.nodes.len() - 1
        });
        self.put(at, id, aabb);
    }

    /// Puts a box into the first free lane of a leaf. The bounds do not know it yet.
    fn put(&mut self, leaf: usize, id: u32, aabb: &Aabb) {
        let node = &mut self.nodes[leaf];
        let lane = node.children.iter().position(|child| *child == NONE).expect("the leaf has room");
        node.children[lane] = id;
        node.set(lane, aabb);
        self.places[id as usize] = (leaf * LANES + lane) as u32;
        self.change_room(leaf, false);
    }

    /// Returns a leaf with a free lane that grows little with a box: below some children of the root that grow least.
    #[inline(always)]
    fn leaf_with_room(&self, simd: impl Simd, aabb: &Aabb) -> Option<usize> {
        let root = self.root()?;
        if self.is_leaf(root) {
            return (self.room[root as usize] > 0).then_some(root as usize);
        }
        let node = &self.nodes[root as usize];
        let mut tried = 0;
        (0..TRIES).find_map(|_| {
            let lane = self.least_growing(simd, node, aabb, tried)?;
            tried |= 1 << lane;
            self.leaf_below(simd, root as usize, lane, aabb)
        })
    }

    /// Returns the lane of a node whose child grows least with a box, of those that have room and were not tried.
    #[inline(always)]
    fn least_growing(&self, simd: impl Simd, node: &Node, aabb: &Aabb, tried: u32) -> Option<usize> {
        let (mut best, mut least) = (None, f32::INFINITY);
        let growths = node.growths(simd, aabb);
        for lane in (0..LANES).filter(|lane| node.children[*lane] != NONE && tried >> lane & 1 == 0) {
            // A child without boxes grows by infinity.
            let is_better = best.is_none() || growths[lane] < least;
            if is_better && self.room[node.children[lane] as usize] > 0 {
                (best, least) = (Some(lane), growths[lane]);
            }
        }
        best
    }

    /// Returns the leaf with room below a child of a node: always the child that grows least. There is none if the leaf would become larger
    /// than twice the node above it that has boxes.
    #[inline(always)]
    fn leaf_below(&self, simd: impl Simd, node: usize, lane: usize, aabb: &Aabb) -> Option<usize> {
        let (mut above, mut at) = (node, self.nodes[node].children[lane] as usize);
        while !self.is_leaf(at as u32) {
            let lane = self.least_growing(simd, &self.nodes[at], aabb, 0)?;
            if self.bounds[at].is_valid() {
                above = at;
            }
            at = self.nodes[at].children[lane] as usize;
        }
        let extent = extent_sum(&self.bounds[at].union(aabb));
        let is_small = extent <= policy::bvh::GROWN_TO * extent_sum(&self.bounds[above]);
        is_small.then_some(at)
    }
}
