//! Places for boxes that come, and for boxes that jump: lanes that are free, near others.

use super::BoxIndex;
use super::node::{LANES, NONE, Node, extent_sum};
use super::refit::word;
use crate::Aabb;
use crate::policy::bvh as policy;
use crate::simd::dispatch;

impl BoxIndex {
    /// Returns how many of some boxes came or have jumped: these need new places.
    pub(crate) fn arrivals(&self, boxes: &[Aabb], ids: &[u32]) -> usize {
        let place = |id: u32| self.places.get(id as usize).copied().unwrap_or(NONE);
        let aabb = |id: u32| boxes.get(id as usize).filter(|aabb| aabb.is_valid());
        let has_arrived = |id: &&u32| aabb(**id).is_some_and(|aabb| !self.is_near(place(**id), aabb));
        if self.is_sorted { ids.iter().filter(has_arrived).count() } else { 0 }
    }

    /// Reads few boxes. Those that came, and those that have jumped, get places near others.
    pub(super) fn place(&mut self, boxes: &[Aabb], ids: &[u32]) {
        let mut order = std::mem::take(&mut self.order);
        order.clear();
        for &id in ids {
            let place = self.places.get(id as usize).copied().unwrap_or(NONE);
            let aabb = boxes.get(id as usize).filter(|aabb| aabb.is_valid());
            let stays = aabb.is_some_and(|aabb| self.is_near(place, aabb));
            if place != NONE && !stays {
                self.leave(place);
                self.places[id as usize] = NONE;
                order.push(word(place, NONE));
            }
            if let Some(aabb) = aabb {
                if !stays {
                    self.add(id, aabb);
                }
                order.push(word(self.places[id as usize], id));
            }
        }
        order.sort_unstable();
        dispatch!(Self::put_all, self, boxes, &order);
        self.order = order;
    }

    /// Frees a lane. Its box is still there.
    fn leave(&mut self, place: u32) {
        let leaf = place as usize / LANES;
        self.nodes[leaf].children[place as usize % LANES] = NONE;
        self.room[leaf] += 1;
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
    fn add(&mut self, id: u32, aabb: &Aabb) {
        if self.places.len() <= id as usize {
            self.places.resize(id as usize + 1, NONE);
        }
        if let Some(leaf) = self.leaf_with_room(aabb) {
            return self.put(leaf, id, aabb);
        }
        let last = self.nodes.len().checked_sub(1).filter(|last| *last >= self.end as usize);
        let open = last.filter(|last| self.room[*last] > 0);
        let at = open.unwrap_or_else(|| {
            self.push(Node::EMPTY);
            self.nodes.len() - 1
        });
        self.put(at, id, aabb);
        self.bounds[at] = self.bounds[at].union(aabb);
    }

    /// Puts a box into the first free lane of a leaf. The bounds do not know it yet.
    fn put(&mut self, leaf: usize, id: u32, aabb: &Aabb) {
        let node = &mut self.nodes[leaf];
        let lane = node.children.iter().position(|child| *child == NONE).unwrap_or(LANES - 1);
        node.children[lane] = id;
        node.set(lane, aabb);
        self.room[leaf] -= 1;
        self.places[id as usize] = (leaf * LANES + lane) as u32;
    }

    /// Returns the leaf with a free lane that grows least with a box: from the root on, the child that grows least. There is none if that
    /// leads to full leaves, or if the leaf would become larger than the node above it.
    fn leaf_with_room(&self, aabb: &Aabb) -> Option<usize> {
        let (mut above, mut at) = (None, self.root()? as usize);
        while !self.is_leaf(at as u32) {
            let node = &self.nodes[at];
            let has_room =
                |lane: &usize| node.children[*lane] != NONE && self.room[node.children[*lane] as usize] > 0;
            let growth = |lane: &usize| node.growth(*lane, aabb);
            let lane =
                (0..LANES).filter(has_room).min_by(|one, other| growth(one).total_cmp(&growth(other)))?;
            (above, at) = (Some(at), node.children[lane] as usize);
        }
        let extent = extent_sum(&self.bounds[at].union(aabb));
        let is_small = above.is_none_or(|above| extent <= policy::GROWN_TO * extent_sum(&self.bounds[above]));
        (is_small && self.room[at] > 0).then_some(at)
    }
}
