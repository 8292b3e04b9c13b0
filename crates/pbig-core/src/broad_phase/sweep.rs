//! The engine for small worlds: each changed box is tested against all boxes, and the overlapping ones are compared with its kept
//! pairs. If more than half of the boxes changed, each box is tested against the boxes with higher ids. In a large world, a tree
//! tells what a changed box overlaps.
//!
//! Boxes lie axis by axis, so that eight are tested at once. There is no index to keep. The tests take
//! a quarter of a microsecond for one changed box of a thousand; each pair that begins or ends takes as long as 256 tests.

use super::world::World;
use crate::grid::{BLOCK, EightBoxes, Kernel, Simd, dispatch};
use crate::index::BoxIndex;
use crate::pairs::{Comparison, Kept, differences, equal};
use crate::{Aabb, Checks, Pair};

/// The lane of a box that is absent or invalid, and the box of a free lane.
const NONE: u32 = u32::MAX;

/// Maximum number of free lanes beyond the number of boxes. Free lanes are tested, too.
const MAX_HOLES: usize = 64;

/// Eight lanes. Aligned, as every second load would cross a cache line.
#[repr(align(32))]
#[derive(Clone, Copy, Debug)]
struct Block(EightBoxes);

/// The boxes of a small world axis by axis, eight to a block, padded with boxes that overlap nothing; and buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Sweep {
    blocks: Vec<Block>,
    /// By lane of all blocks: the id of its box, or `NONE`.
    ids: Vec<u32>,
    /// By id: the lane. Ids that are not in use take none, so that a few boxes left of many are as fast as a few.
    lanes: Vec<u32>,
    free: Vec<u32>,
    /// True if lanes are in the order of ids.
    is_in_order: bool,
    /// True if the blocks hold the boxes of the last update.
    is_current: bool,
    /// Ids that the box at hand overlaps, sorted.
    now: Vec<u32>,
    /// Its kept partners, sorted.
    was: Vec<u32>,
}

impl Sweep {
    /// Says that another engine has made an update.
    pub(super) fn expire(&mut self) {
        self.is_current = false;
    }

    /// Leaves the events of an update in `events`, sorted. Returns the tests made.
    pub(super) fn run(&mut self, world: &World, kept: &Kept, events: &mut Comparison) -> Checks {
        events.clear();
        let are_many = 2 * world.changed.len() > world.valid() as usize;
        let has_holes = self.free.len() > world.valid() as usize + MAX_HOLES;
        if self.is_current && !has_holes && (self.is_in_order || !are_many) {
            self.lanes.resize(world.ids(), NONE);
            world.changed.iter().for_each(|&id| self.put(id, &world.boxes[id as usize]));
        } else {
            self.lay_out(&world.boxes);
        }
        let are_many = are_many && self.is_in_order;
        let (made, met) = dispatch(SweepAll { sweep: self, world, kept, events, are_many });
        events.sort(world.ids());
        Checks { made, unnecessary: made - met, redundant: 0 }
    }

    /// Gives every valid box a lane.
    fn lay_out(&mut self, boxes: &[Aabb]) {
        self.blocks.clear();
        self.ids.clear();
        self.free.clear();
        self.lanes.clear();
        self.lanes.resize(boxes.len(), NONE);
        (self.is_in_order, self.is_current) = (true, true);
        (0..).zip(boxes).for_each(|(id, aabb)| self.put(id, aabb));
    }

    /// Stores a box in its lane, in a new one, or in none if it is invalid.
    fn put(&mut self, id: u32, aabb: &Aabb) {
        let lane = match (self.lanes[id as usize], aabb.is_valid()) {
            (NONE, false) => return,
            (NONE, true) => self.take_lane(id),
            (lane, true) => lane,
            (lane, false) => {
                (self.lanes[id as usize], self.ids[lane as usize]) = (NONE, NONE);
                self.free.push(lane);
                lane
            }
        };
        let values = aabb.min.into_iter().chain(aabb.max);
        for (row, value) in self.blocks[lane as usize / BLOCK].0.iter_mut().zip(values) {
            row[lane as usize % BLOCK] = value;
        }
    }

    fn take_lane(&mut self, id: u32) -> u32 {
        let is_last = self.free.is_empty() && self.ids.last().is_none_or(|last| *last < id);
        self.is_in_order &= is_last;
        let lane = self.free.pop().unwrap_or(self.ids.len() as u32);
        if lane as usize == self.ids.len() {
            self.ids.push(id);
            self.blocks.resize(self.ids.len().div_ceil(BLOCK), Block([[f32::NAN; BLOCK]; 6]));
        }
        self.ids[lane as usize] = id;
        self.lanes[id as usize] = lane;
        lane
    }

    /// Does the work of [`Sweep::run`] with the boxes in a tree. Also returns the nodes looked at and boxes met. If these are more
    /// than `max_nodes`, events are missing.
    pub(super) fn run_in_tree(
        &mut self,
        world: &World,
        kept: &Kept,
        (tree, max_nodes): (&BoxIndex, u64),
        events: &mut Comparison,
    ) -> (Checks, u64) {
        events.clear();
        let (mut nodes, mut met) = (0, 0);
        for &id in &world.changed {
            let (aabb, now) = (&world.boxes[id as usize], &mut self.now);
            now.clear();
            // Tested again, because an infinite box meets the empty places of a tree.
            let mut take =
                |other: u32| now.extend(aabb.overlaps(&world.boxes[other as usize]).then_some(other));
            nodes += tree.overlapping(aabb, &mut take).nodes;
            met += now.len() as u64;
            if nodes + met > max_nodes {
                break;
            }
            self.compare_all(world, kept, id, events);
        }
        events.sort(world.ids());
        let made = nodes * BLOCK as u64;
        (Checks { made, unnecessary: made - met, redundant: 0 }, nodes + met)
    }

    /// Compares what a changed box overlaps with its kept pairs. The changed box with the lower id reports a pair
    /// of two changed boxes.
    fn compare_all(&mut self, world: &World, kept: &Kept, id: u32, events: &mut Comparison) {
        let Self { now, was, .. } = self;
        let is_own = |other: u32| other > id || other < id && world.change_of(other).is_none();
        now.retain(|&other| is_own(other));
        was.clear();
        was.extend(kept.partners(id).filter(|&other| is_own(other)));
        compare(world, id, was, now, events);
    }

    /// Ends the pairs of changed boxes without a lane, which overlap nothing.
    fn end_all(&mut self, world: &World, kept: &Kept, events: &mut Comparison) {
        self.now.clear();
        for &id in &world.changed {
            if self.lanes[id as usize] == NONE {
                self.compare_later(world, kept, id, events);
            }
        }
    }

    /// Compares the later boxes that a box overlaps with its kept pairs.
    #[inline(always)]
    fn compare_later(&mut self, world: &World, kept: &Kept, id: u32, events: &mut Comparison) {
        let Self { now, was, .. } = self;
        let partners = kept.later_partners(id);
        if !equal(partners, now) || world.is_filtered || world.has_removed() {
            was.clear();
            was.extend_from_slice(partners);
            compare(world, id, was, now, events);
        }
    }
}

/// Compares what a box overlaps with its kept partners.
#[inline(never)]
fn compare(world: &World, id: u32, was: &mut Vec<u32>, now: &mut Vec<u32>, events: &mut Comparison) {
    if world.is_filtered {
        let filter = &world.filters[id as usize];
        now.retain(|&other| filter.allows(&world.filters[other as usize]));
    }
    if world.has_removed() {
        let ended = |other: u32| world.was_removed(id) || world.was_removed(other);
        events.dropped.extend(was.iter().filter(|other| ended(**other)).map(|&other| Pair::new(id, other)));
        was.retain(|&other| !ended(other));
    }
    differences(id, was, now, &mut events.added, &mut events.removed);
}

struct SweepAll<'a> {
    sweep: &'a mut Sweep,
    world: &'a World,
    kept: &'a Kept,
    events: &'a mut Comparison,
    /// Test each box against those with higher ids; otherwise each changed one against all.
    are_many: bool,
}

impl Kernel for SweepAll<'_> {
    /// Numbers of tested and of overlapping boxes.
    type Output = (u64, u64);

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> (u64, u64) {
        let Self { sweep, world, kept, events, are_many } = self;
        let (mut made, mut met) = (0, 0);
        let lanes = sweep.ids.len();
        let count = if are_many { lanes } else { world.changed.len() };
        for i in 0..count {
            let id = if are_many { sweep.ids[i] } else { world.changed[i] };
            if id == NONE {
                continue;
            }
            // The first block also has the box itself and lower ids: their lanes are masked out.
            let (first, wanted) =
                if are_many { (i / BLOCK, 255 & !((2 << (i % BLOCK)) - 1)) } else { (0, 255) };
            made += (lanes - first * BLOCK) as u64;
            sweep.now.clear();
            met += sweep.meet(simd, &world.boxes[id as usize], first, wanted);
            if are_many {
                sweep.compare_later(world, kept, id, events);
            } else {
                sweep.compare_all(world, kept, id, events);
            }
        }
        if are_many {
            sweep.end_all(world, kept, events);
        }
        (made, met)
    }
}

impl Sweep {
    /// Lists the ids of boxes that overlap one, from a block on; in the first block only the `wanted` lanes. Returns how many.
    #[inline(always)]
    fn meet(&mut self, simd: impl Simd, aabb: &Aabb, first: usize, mut wanted: u32) -> u64 {
        for (block, Block(boxes)) in self.blocks.iter().enumerate().skip(first) {
            let mut mask = simd.overlaps_eight(boxes, aabb) & wanted;
            wanted = 255;
            while mask != 0 {
                self.now.push(self.ids[block * BLOCK + mask.trailing_zeros() as usize]);
                mask &= mask - 1;
            }
        }
        if !self.is_in_order {
            self.now.sort_unstable();
        }
        self.now.len() as u64
    }
}
