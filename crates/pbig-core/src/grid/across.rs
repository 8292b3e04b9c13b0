//! The search between two sets: each has a grid, both grids have one plan, and the boxes of one are searched for in the other. No
//! two boxes of a set meet.

use super::count::{self, has_vague_code, in_window, scattered};
use super::hits::{HIT_ROOM, HitWriter, Hits, Rule};
use super::plan::GridPlan;
use super::record::Record;
use super::search::{OVERSIZE_PIECE, PIECE, Scan, Seeker};
use super::simd::{Simd, dispatch};
use super::{Grid, cells::query_of};
use crate::Aabb;
use crate::parallel::{run, run_with};
use crate::policy::search as policy;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// Boxes of the larger set in a piece of work, where every pair is tested.
const BRUTE_PIECE: usize = 4096;

/// The grids of two sets.
#[derive(Clone, Debug, Default)]
pub(crate) struct TwoGrids([Grid; 2]);

impl TwoGrids {
    /// Sorts valid boxes, `boxes[id]` with the id `id`, into two grids: those before `split` into the first.
    pub(crate) fn build(
        &mut self,
        plan: GridPlan,
        boxes: &[Aabb],
        split: usize,
        workers: usize,
    ) -> Across<'_> {
        let [first, second] = &mut self.0;
        first.build_from(plan, &boxes[..split], 0, workers);
        second.build_from(plan, &boxes[split..], split as u32, workers);
        let (own, grid) = if first.len <= second.len { (first, second) } else { (second, first) };
        Across { own, grid }
    }
}

/// Two grids as they were built. The one with fewer boxes is the one whose boxes are searched for.
pub(crate) struct Across<'a> {
    own: &'a Grid,
    grid: &'a Grid,
}

/// An oversize box, the grid that it is searched for in, and other oversize boxes that it is tested against.
type Oversize<'a> = (&'a Record, &'a Grid, &'a [Record]);

impl Across<'_> {
    /// Returns the number of boxes of both sets.
    pub(crate) fn boxes(&self) -> usize {
        self.own.len + self.grid.len + self.oversize_count()
    }

    /// Returns the number of boxes that are searched for.
    pub(crate) fn searched(&self) -> usize {
        self.own.len + self.oversize_count()
    }

    /// Returns the number of oversize boxes of both sets.
    pub(crate) fn oversize_count(&self) -> usize {
        self.own.oversize.len() + self.grid.oversize.len()
    }

    /// Returns an oversize box: one of `own` comes first, and meets those of the other grid.
    fn oversize(&self, i: usize) -> Oversize<'_> {
        match self.own.oversize.get(i) {
            Some(one) => (one, self.grid, &self.grid.oversize),
            None => (&self.grid.oversize[i - self.own.oversize.len()], self.own, &[]),
        }
    }

    /// Returns the work of a search: of the boxes in cells one in [`policy::COUNT_ONE_IN`] is counted, without a test.
    pub(crate) fn work(&self, workers: usize) -> u64 {
        let total = AtomicU64::new(0);
        run(workers, self.own.len.div_ceil(count::PIECE), |_, piece| {
            let slots = piece * count::PIECE..self.own.len.min((piece + 1) * count::PIECE);
            total.fetch_add(dispatch!(count_slots, self, slots.clone()), Ordering::Relaxed);
        });
        let step = self.oversize_count().div_ceil(policy::COUNTED_OVERSIZE).max(1);
        let work_of = |i: usize| {
            let (one, grid, others) = self.oversize(i);
            grid.work_of_oversize(one) + others.len() as u64 * policy::WORK_OF_EXACT_TEST
        };
        let counted = scattered(0..self.oversize_count(), step).map(work_of).sum::<u64>();
        total.into_inner() * policy::COUNT_ONE_IN as u64 + counted * step as u64
    }

    /// Estimates the work in vain of a search, by a sample of one box in `step`, see `Sorted::vain_work`.
    pub(crate) fn vain_work(&self, step: usize, rule: &Rule<'_>, hits: &mut Hits) -> u64 {
        let mut vain = 0;
        for slot in scattered(0..self.own.len, step) {
            hits.begin(0, 0);
            self.search_slots(slot..slot + 1, rule, hits);
            vain += policy::in_vain(hits.work_in_cells(), hits.overlaps) * step as u64;
        }
        let step = step.min(self.oversize_count() / policy::SAMPLED_OVERSIZE + 1);
        for i in scattered(0..self.oversize_count(), step) {
            hits.begin(0, 0);
            self.find_oversize_pairs(i, rule, hits);
            vain += policy::in_vain(hits.tests * policy::WORK_OF_EXACT_TEST, hits.overlaps) * step as u64;
        }
        vain
    }

    /// Finds all pairs of a box of each set, into the lists of as many threads as there are `hits`.
    pub(crate) fn search(&self, rule: &Rule<'_>, hits: &mut [Hits]) {
        // Each of a few boxes may meet many.
        let piece = (self.own.len / (8 * hits.len())).clamp(1, PIECE.end);
        let in_grid = self.own.len.div_ceil(piece);
        run_with(hits, in_grid + self.oversize_count().div_ceil(OVERSIZE_PIECE), |hits, i| {
            if hits.is_full {
                return;
            }
            if i < in_grid {
                return self.search_slots(i * piece..self.own.len.min((i + 1) * piece), rule, hits);
            }
            let first = (i - in_grid) * OVERSIZE_PIECE;
            let last = self.oversize_count().min(first + OVERSIZE_PIECE);
            (first..last).for_each(|i| self.find_oversize_pairs(i, rule, hits));
        });
    }

    fn search_slots(&self, slots: Range<usize>, rule: &Rule<'_>, hits: &mut Hits) {
        dispatch!(search_piece, self, slots.clone(), rule, hits);
    }

    fn find_oversize_pairs(&self, i: usize, rule: &Rule<'_>, hits: &mut Hits) {
        let (one, grid, others) = self.oversize(i);
        grid.find_reached(one, rule, hits);
        hits.test_run(one, others, rule);
    }
}

#[inline(always)]
fn search_piece(simd: impl Simd, across: &Across<'_>, slots: Range<usize>, rule: &Rule<'_>, hits: &mut Hits) {
    let mut blocks = [0; HIT_ROOM];
    let &Across { own, grid } = across;
    let writer = HitWriter::new(&mut blocks);
    let mut scan = Scan { simd, cells: grid.plan.cells, own, grid, rule, hits, writer };
    if scan.cells.wraps {
        scan.across::<true>(slots)
    } else {
        scan.across::<false>(slots)
    }
    scan.finish();
}

impl<S: Simd> Scan<'_, '_, S> {
    /// Visits, for each box, the cells of the other grid in which the lower corner of an overlapping box can lie.
    #[inline(always)]
    fn across<const WRAPS: bool>(&mut self, slots: Range<usize>) {
        let cells = self.cells;
        for slot in slots {
            if self.hits.is_full {
                break;
            }
            let (low, high) = self.simd.steps(&cells, &self.own.records[slot].aabb);
            let one = Seeker { slot, query: query_of(self.simd.code(low, high)) };
            let window = cells.window(low, high);
            for z in window.low[2]..=window.high[2] {
                for y in window.low[1]..=window.high[1] {
                    self.row(one, cells.row::<WRAPS>([window.low[0], y, z], window.high[0]));
                }
            }
        }
    }
}

/// Counts the rows and slots that one box in [`policy::COUNT_ONE_IN`] visits.
#[inline(always)]
fn count_slots(simd: impl Simd, across: &Across<'_>, slots: Range<usize>) -> u64 {
    let &Across { own, grid } = across;
    let mut work = 0;
    for slot in scattered(slots, policy::COUNT_ONE_IN) {
        let (rows, slots) = if grid.plan.cells.wraps {
            in_window::<true>(simd, own, grid, slot)
        } else {
            in_window::<false>(simd, own, grid, slot)
        };
        let is_vague = has_vague_code(simd, own, slot);
        work += rows + if is_vague { slots * policy::WORK_OF_VAGUE_TEST } else { slots };
    }
    work
}

/// Tests every valid box before `split` against every one behind it.
pub(crate) fn brute_force_across(boxes: &[Aabb], split: usize, rule: &Rule<'_>, hits: &mut [Hits]) {
    let (first, second) = boxes.split_at(split);
    let sides = [(first, 0), (second, split as u32)];
    let [few, (many, first_id)] = if first.len() <= second.len() { sides } else { [sides[1], sides[0]] };
    run_with(hits, many.len().div_ceil(BRUTE_PIECE), |hits, piece| {
        let start = piece * BRUTE_PIECE;
        let many = &many[start..many.len().min(start + BRUTE_PIECE)];
        test_piece(few, (many, first_id + start as u32), rule, hits);
    });
}

/// Tests all boxes of a list, given with the id of its first one, against those of another list.
fn test_piece(few: (&[Aabb], u32), many: (&[Aabb], u32), rule: &Rule<'_>, hits: &mut Hits) {
    let records = |(boxes, first_id): (&[Aabb], u32)| {
        boxes.iter().zip(first_id..).map(|(aabb, id)| Record::new(*aabb, id, 0)).collect()
    };
    let (few, many): (Vec<Record>, Vec<Record>) = (records(few), records(many));
    for one in few {
        if hits.is_full {
            return;
        }
        hits.test_run(&one, &many, rule);
    }
}
