//! The engine for small worlds: each changed box is tested against all boxes, and what it overlaps is compared with its kept
//! pairs. In a large world the boxes are looked up in a tree instead. If more than half of the boxes changed, each box is tested against the boxes with higher ids.
//!
//! Boxes lie axis by axis, so that eight are tested at once. There is no index to keep, and no cost but that of
//! the tests: a quarter of a microsecond for one changed box of a thousand.

use super::world::World;
use crate::grid::{BLOCK, EightBoxes, Kernel, Simd, dispatch};
use crate::index::BoxIndex;
use crate::pairs::{Comparison, Kept, differences, equal};
use crate::{Aabb, Checks, Pair};

/// The boxes of a small world axis by axis, eight to a block, padded with boxes that overlap nothing; and buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Sweep {
    blocks: Vec<EightBoxes>,
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
        self.blocks.resize(world.ids().div_ceil(BLOCK), [[f32::NAN; BLOCK]; 6]);
        if self.is_current {
            world.changed.iter().for_each(|&id| self.put(id as usize, &world.boxes[id as usize]));
        } else {
            world.boxes.iter().enumerate().for_each(|(id, aabb)| self.put(id, aabb));
        }
        self.is_current = true;
        let (made, met) = dispatch(SweepAll { sweep: self, world, kept, events });
        events.sort(world.ids());
        Checks { made, unnecessary: made - met, redundant: 0 }
    }

    /// As [`Sweep::run`], with the boxes in a tree. Returns the nodes looked at as well; if they are more than `max_nodes`, the
    /// events are not all.
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
            // Tested again, as an infinite box meets the empty places of a tree.
            let mut take = |other: u32| now.extend(aabb.overlaps(&world.boxes[other as usize]).then_some(other));
            nodes += tree.overlapping(aabb, &mut take).nodes;
            met += now.len() as u64;
            if nodes > max_nodes {
                break;
            }
            self.compare_all(world, kept, id, events);
        }
        events.sort(world.ids());
        let made = nodes * BLOCK as u64;
        (Checks { made, unnecessary: made - met, redundant: 0 }, nodes)
    }

    fn put(&mut self, id: usize, aabb: &Aabb) {
        let values = aabb.min.into_iter().chain(aabb.max);
        for (row, value) in self.blocks[id / BLOCK].iter_mut().zip(values) {
            row[id % BLOCK] = value;
        }
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
}

impl Kernel for SweepAll<'_> {
    /// Boxes tested, and those that overlap.
    type Output = (u64, u64);

    #[inline(always)]
    unsafe fn run<S: Simd>(self) -> (u64, u64) {
        let Self { sweep, world, kept, events } = self;
        let (mut made, mut met) = (0, 0);
        let are_many = 2 * world.changed.len() > world.ids();
        let count = if are_many { world.ids() } else { world.changed.len() };
        for i in 0..count {
            let id = if are_many { i } else { world.changed[i] as usize };
            // The first block also has the box itself and lower ids: their lanes are masked out.
            let (first, mut wanted) =
                if are_many { (id / BLOCK, 255 & !((2 << (id % BLOCK)) - 1)) } else { (0, 255) };
            made += (world.ids() - first * BLOCK) as u64;
            sweep.now.clear();
            for (block, boxes) in sweep.blocks.iter().enumerate().skip(first) {
                // SAFETY: the caller has the instructions.
                let mut mask = unsafe { S::overlaps_eight(boxes, &world.boxes[id]) } & wanted;
                wanted = 255;
                met += u64::from(mask.count_ones());
                while mask != 0 {
                    sweep.now.push((block * BLOCK) as u32 + mask.trailing_zeros());
                    mask &= mask - 1;
                }
            }
            if are_many {
                sweep.compare_later(world, kept, id as u32, events);
            } else {
                sweep.compare_all(world, kept, id as u32, events);
            }
        }
        (made, met)
    }
}
