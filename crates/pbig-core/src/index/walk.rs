//! Walking the nodes that a question meets, nearest first.

use super::BoxIndex;
use super::node::{LANES, Lanes, NONE, Node, next};
use super::question::Question;
use crate::grid::Simd;
use arrayvec::ArrayVec;

/// Maximum number of nodes that wait: seven for each level, and 2^32 boxes of 448 classes make 14 levels.
const STACK: usize = 128;

/// A node that waits, and the bound from which on it belongs to the answer.
type Waiting = (f32, u32);

pub(super) struct Walk<'a, Q> {
    pub(super) index: &'a BoxIndex,
    pub(super) question: Q,
    pub(super) bound: f32,
    /// Called with the id of a box; returns the new bound.
    pub(super) visit: &'a mut dyn FnMut(u32) -> f32,
    /// Boxes at bound 0, of which crowds have many.
    pub(super) at_start: Vec<u32>,
    /// Nodes.
    pub(super) looked_at: u64,
}

impl<Q: Question> Walk<'_, Q> {
    /// Visits the boxes, and returns the number of nodes looked at. Boxes at bound 0 come first, by id, so that the lowest id wins among
    /// them without a look at the others.
    #[inline(always)]
    pub(super) fn answer(_: impl Simd, mut walk: Self) -> u64 {
        let is_still = walk.bound <= 0.0;
        let bound = std::mem::replace(&mut walk.bound, 0.0);
        walk.walk::<true>();
        walk.bound = bound;
        walk.at_start.sort_unstable();
        for id in std::mem::take(&mut walk.at_start) {
            walk.take(id);
            if walk.bound <= 0.0 && !is_still {
                return walk.looked_at;
            }
        }
        if !is_still {
            walk.walk::<false>();
        }
        walk.looked_at
    }

    /// Collects the boxes at bound 0, or visits the others.
    #[inline(always)]
    fn walk<const AT_START: bool>(&mut self) {
        let mut nodes: ArrayVec<Waiting, STACK> = ArrayVec::new();
        for loose in self.index.loose() {
            self.look_at::<AT_START>(loose, true, &mut nodes);
        }
        nodes.extend(self.index.root().map(|root| (0.0, root)));
        while let Some((least, node)) = nodes.pop() {
            if least <= self.bound {
                self.look_at::<AT_START>(node, self.index.is_leaf(node), &mut nodes);
            }
        }
    }

    /// Takes the boxes of a leaf, or lets the children of a node wait, the nearest on top.
    #[inline(always)]
    fn look_at<const AT_START: bool>(
        &mut self,
        number: u32,
        is_leaf: bool,
        nodes: &mut ArrayVec<Waiting, STACK>,
    ) {
        let node = &self.index.nodes[number as usize];
        self.looked_at += 1;
        let met = self.met(node, &self.question.least(node));
        if !is_leaf {
            return nodes.extend(met);
        }
        for (least, id) in met.into_iter().rev() {
            if AT_START {
                self.at_start.push(id);
            } else if least > 0.0 && least <= self.bound {
                self.take(id);
            }
        }
    }

    #[inline(always)]
    fn take(&mut self, id: u32) {
        self.bound = (self.visit)(id).min(f32::MAX);
    }

    /// Returns the lanes within the bound, the farthest first.
    #[inline(always)]
    fn met(&self, node: &Node, least: &Lanes) -> ArrayVec<Waiting, LANES> {
        let mut met = ArrayVec::new();
        let mut within = (0..LANES).fold(0u32, |mask, i| mask | u32::from(least[i] <= self.bound) << i);
        while let Some(lane) = next(&mut within) {
            // A box without bounds meets empty lanes, too.
            if node.children[lane] != NONE && node.has(lane) {
                insert(&mut met, (least[lane], node.children[lane]));
            }
        }
        met
    }
}

/// Inserts into a list that is sorted from the farthest to the nearest.
#[inline(always)]
fn insert(sorted: &mut ArrayVec<Waiting, LANES>, one: Waiting) {
    sorted.push(one);
    let mut at = sorted.len() - 1;
    while at > 0 && sorted[at - 1].0 < sorted[at].0 {
        sorted.swap(at - 1, at);
        at -= 1;
    }
}
