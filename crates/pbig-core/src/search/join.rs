//! Every pair of overlapping boxes: each leaf meets itself and the leaves behind it, or, between two sets, the leaves of the second.
//!
//! The eight boxes of a leaf lie near each other and have one size and shape, because the tree is cut at medians, along the axis on
//! which boxes lie apart most, and has a part for each class. So a leaf looks at few nodes.

use super::hits::{Hits, Rule};
use crate::bvh::{BoxIndex, LANES, NONE};
use crate::parallel::run_with;
use crate::policy::search::WORK_OF_NODE;
use crate::simd::{Simd, dispatch, next};
use crate::{Aabb, Pair};
use std::ops::Range;

/// Number of leaves in a piece of work.
const PIECE: usize = 64;

/// Maximum number of boxes that are tested at once, without a look at the bounds of their leaf.
const FEW_LANES: u32 = 3;

/// Finds all pairs of the boxes as of the last sort, into the lists of as many threads as there are `hits`; with a `split`, those
/// of a box with an id below it and one with another id, as of the last [`BoxIndex::sort_sets`].
pub(super) fn find_pairs(index: &BoxIndex, split: Option<u32>, rule: &Rule<'_>, hits: &mut [Hits]) {
    let (leaves, earliest) = joined(index, split);
    let (last_leaves, leaves) = (last_leaves(index), leaves as usize);
    run_with(hits, leaves.div_ceil(PIECE), |hits, piece| {
        let leaves = piece * PIECE..leaves.min((piece + 1) * PIECE);
        let join = &mut Join { index, last_leaves: &last_leaves, earliest, rule, hits };
        dispatch!(Join::meet_all, join, leaves.clone());
    });
}

/// Returns the number of leaves that are joined with others, and the first of these.
fn joined(index: &BoxIndex, split: Option<u32>) -> (u32, u32) {
    let Some(split) = split else { return (index.leaves, 0) };
    let leaves = &index.nodes[..index.leaves as usize];
    let second_set = leaves.partition_point(|leaf| leaf.children[0] < split) as u32;
    (second_set, second_set)
}

fn last_leaves(index: &BoxIndex) -> Vec<u32> {
    let mut last: Vec<u32> = (0..index.end).collect();
    for node in index.leaves..index.end {
        let children = index.nodes[node as usize].children.iter().filter(|child| **child != NONE);
        last[node as usize] = children.map(|child| last[*child as usize]).max().unwrap_or(0);
    }
    last
}

struct Join<'a, 'b> {
    index: &'a BoxIndex,
    last_leaves: &'a [u32],
    /// The first leaf that others may meet.
    earliest: u32,
    rule: &'a Rule<'b>,
    hits: &'a mut Hits,
}

impl Join<'_, '_> {
    #[inline(always)]
    fn meet_all(simd: impl Simd, join: &mut Self, leaves: Range<usize>) {
        let mut waiting = Vec::new();
        for leaf in leaves {
            if join.hits.is_full {
                return;
            }
            join.meet(simd, leaf as u32, &mut waiting);
            join.hits.charge_much(join.rule.budget);
        }
        join.hits.charge(join.rule.budget);
    }

    /// Finds the pairs of a leaf's boxes with each other, and with those of later leaves, from the earliest on.
    #[inline(always)]
    fn meet(&mut self, simd: impl Simd, leaf: u32, waiting: &mut Vec<u32>) {
        let index = self.index;
        let bounds = index.bounds[leaf as usize];
        let earliest = leaf.max(self.earliest);
        let mut from = self.hits.found.pairs.len();
        // A root that is a leaf may be of the first of two sets, too.
        waiting.extend(index.root().filter(|root| self.last_leaves[*root as usize] >= earliest));
        while let Some(at) = waiting.pop() {
            self.hits.extra += WORK_OF_NODE;
            if index.is_leaf(at) {
                self.test(simd, leaf, at, &bounds);
                // Boxes as large as the world meet all others.
                from = self.hits.keep_many(from, self.rule);
                continue;
            }
            let node = &index.nodes[at as usize];
            let mut lanes = simd.overlaps_eight(&node.boxes, &bounds);
            while let Some(lane) = next(&mut lanes) {
                let child = node.children[lane];
                if child != NONE && self.last_leaves[child as usize] >= earliest {
                    waiting.push(child);
                }
            }
        }
        self.hits.keep(from, self.rule);
    }

    /// Tests the boxes of a leaf, which have these bounds, against those of another one, or of its own.
    #[inline(always)]
    fn test(&mut self, simd: impl Simd, leaf: u32, at: u32, bounds: &Aabb) {
        let (one, other) = (&self.index.nodes[leaf as usize], &self.index.nodes[at as usize]);
        let mut lanes = simd.overlaps_eight(&one.boxes, &self.index.bounds[at as usize]);
        // At the edge of a crowd all boxes of one leaf can overlap the bounds of the other leaf, although no two boxes overlap.
        // The second test, of the other leaf's boxes against the first one's bounds, finds this at once.
        if lanes.count_ones() > FEW_LANES && leaf != at {
            self.hits.tests += LANES as u64;
            if simd.overlaps_eight(&other.boxes, bounds) == 0 {
                return;
            }
        }
        while let Some(lane) = next(&mut lanes) {
            let aabb: Aabb = one.get(lane);
            let wanted = if leaf == at { 255 & !((2u32 << lane) - 1) } else { 255 };
            self.hits.tests += u64::from(wanted.count_ones());
            let mut met = simd.overlaps_eight(&other.boxes, &aabb) & wanted;
            while let Some(hit) = next(&mut met) {
                if one.has(lane) && other.has(hit) {
                    self.hits.found.pairs.push(Pair::new(one.children[lane], other.children[hit]));
                }
            }
        }
    }
}
