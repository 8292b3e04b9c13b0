//! The engine for small worlds: each changed box is tested against all boxes, and the overlapping ones are compared with its kept
//! pairs. If more than half of the boxes changed, each box is tested against the boxes with higher ids.
//!
//! Boxes lie axis by axis, so that eight are tested at once. There is no index to keep. The tests take
//! a quarter of a microsecond for one changed box of a thousand; each pair that begins or ends takes as long as 256 tests.

use super::Task;
use super::partners::Partners;
use crate::broad_phase::world::World;
use crate::grid::{BLOCK, EightBoxes, Simd, dispatch};
use crate::holder::Holder;
use crate::outcome::{End, Outcome};
use crate::pairs::{Comparison, Kept};
use crate::report::{Clock, StageTimes, stage};
use crate::{Aabb, Algorithm, Checks, Plan};

/// The lane of a box that is absent or invalid, and the box of a free lane.
const NONE: u32 = u32::MAX;

/// Maximum number of free lanes beyond an eighth of the boxes. Free lanes are tested, too.
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
    partners: Partners,
}

impl Sweep {
    /// Leaves the events of an update in the task.
    pub(super) fn run(&mut self, task: &mut Task<'_>) -> Outcome {
        stage!("check");
        let mut clock = Clock::start();
        let world = task.world;
        task.events.clear();
        let are_many = 2 * world.changed.len() > world.valid as usize;
        self.bring_up_to_date(world, task.holder == Holder::Lanes, are_many);
        let (kept, events) = (&*task.kept, &mut *task.events);
        let (made, met) = dispatch!(Self::sweep, self, world, kept, events, are_many);
        task.events.sort(world.ids());
        Outcome {
            end: End::Done,
            holder: Holder::Lanes,
            checks: Checks { made, unnecessary: made - met, redundant: 0 },
            work: made,
            plan: Plan { algorithm: Algorithm::Sweep, boxes: world.valid, ..Plan::default() },
            stages: StageTimes { check: clock.lap(), ..StageTimes::default() },
            ..Outcome::default()
        }
    }

    /// Stores all boxes, or the changed ones if the blocks hold the boxes of the last update.
    fn bring_up_to_date(&mut self, world: &World, is_current: bool, are_many: bool) {
        let has_holes = self.free.len() > world.valid as usize / 8 + MAX_HOLES;
        let can_stay = is_current && !has_holes && (self.is_in_order || !are_many);
        if can_stay {
            self.lanes.resize(world.ids(), NONE);
            world.changed.iter().for_each(|&id| self.put(id, &world.boxes[id as usize]));
        }
        // A box in a lane that was free is out of order. Where each box is tested, so would be each free lane.
        if !can_stay || are_many && !(self.is_in_order && self.free.is_empty()) {
            self.lay_out(world);
        }
    }

    /// Gives every valid box a lane.
    fn lay_out(&mut self, world: &World) {
        for &id in self.ids.iter().filter(|id| **id != NONE) {
            self.lanes[id as usize] = NONE;
        }
        self.lanes.resize(world.ids(), NONE);
        self.blocks.clear();
        self.ids.clear();
        self.free.clear();
        self.is_in_order = true;
        world.present.iter().for_each(|id| self.put(id, &world.boxes[id as usize]));
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

    /// Ends the pairs of changed boxes without a lane, which overlap nothing.
    fn end_all(&mut self, world: &World, kept: &Kept, events: &mut Comparison) {
        self.partners.now.clear();
        for &id in &world.changed {
            if self.lanes[id as usize] == NONE {
                self.partners.compare_later(world, kept, id, events);
            }
        }
    }

    /// Tests each box against those with higher ids if they `are_many`, otherwise each changed one against all. Returns the numbers
    /// of tested and of overlapping boxes.
    #[inline(always)]
    fn sweep(
        simd: impl Simd,
        sweep: &mut Self,
        world: &World,
        kept: &Kept,
        events: &mut Comparison,
        are_many: bool,
    ) -> (u64, u64) {
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
            sweep.partners.now.clear();
            met += sweep.meet(simd, &world.boxes[id as usize], first, wanted);
            if are_many {
                sweep.partners.compare_later(world, kept, id, events);
            } else {
                sweep.partners.compare_all(world, kept, id, events);
            }
        }
        if are_many {
            sweep.end_all(world, kept, events);
        }
        (made, met)
    }

    /// Lists the ids of boxes that overlap one, from a block on; in the first block only the `wanted` lanes. Returns how many.
    #[inline(always)]
    fn meet(&mut self, simd: impl Simd, aabb: &Aabb, first: usize, mut wanted: u32) -> u64 {
        for (block, Block(boxes)) in self.blocks.iter().enumerate().skip(first) {
            let mut mask = simd.overlaps_eight(boxes, aabb) & wanted;
            wanted = 255;
            while mask != 0 {
                self.partners.now.push(self.ids[block * BLOCK + mask.trailing_zeros() as usize]);
                mask &= mask - 1;
            }
        }
        if !self.is_in_order {
            self.partners.now.sort_unstable();
        }
        self.partners.now.len() as u64
    }
}
