//! Walking the nodes that a question meets, nearest first.

use super::node::{LANES, Lanes, NONE, Node};
use super::question::Question;
use super::{BoxIndex, Visited};
use crate::grid::{Kernel, Simd};
use arrayvec::ArrayVec;

/// Nodes that wait: seven for each level, of which there are 15 at most (2^32 boxes in eight sizes).
const STACK: usize = 128;

/// A node that waits, and the bound from which on it belongs to the answer.
type Waiting = (f32, u32);

pub(super) struct Walk<'a, Q> {
    pub(super) index: &'a BoxIndex,
    pub(super) question: Q,
    pub(super) bound: f32,
    /// Called with the id of a box; returns the new bound.
    pub(super) visit: &'a mut dyn FnMut(u32) -> f32,
}

impl<Q: Question> Kernel for Walk<'_, Q> {
    type Output = Visited;

    #[inline(always)]
    unsafe fn run<S: Simd>(mut self) -> Visited {
        let mut visited = Visited::default();
        let mut waiting: ArrayVec<Waiting, STACK> = ArrayVec::new();
        for loose in self.index.loose() {
            self.look_at(loose, true, &mut waiting, &mut visited);
        }
        waiting.extend(self.index.root().map(|root| (0.0, root)));
        while let Some((least, node)) = waiting.pop() {
            if least <= self.bound {
                self.look_at(node, self.index.is_leaf(node), &mut waiting, &mut visited);
            }
        }
        visited
    }
}

impl<Q: Question> Walk<'_, Q> {
    /// Visits the boxes of a leaf, or lets the children of a node wait, the nearest on top.
    #[inline(always)]
    fn look_at(
        &mut self,
        number: u32,
        is_leaf: bool,
        waiting: &mut ArrayVec<Waiting, STACK>,
        visited: &mut Visited,
    ) {
        let node = &self.index.nodes[number as usize];
        visited.nodes += 1;
        let met = self.met(node, &self.question.least(node));
        if !is_leaf {
            return waiting.extend(met);
        }
        for (least, id) in met.into_iter().rev() {
            if least <= self.bound {
                visited.boxes += 1;
                self.bound = (self.visit)(id).min(f32::MAX);
            }
        }
    }

    /// Returns the lanes within the bound, the farthest first.
    #[inline(always)]
    fn met(&self, node: &Node, least: &Lanes) -> ArrayVec<Waiting, LANES> {
        let mut met = ArrayVec::new();
        let within = (0..LANES).fold(0u32, |mask, i| mask | u32::from(least[i] <= self.bound) << i);
        let mut rest = within;
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            if node.children[lane] != NONE {
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
