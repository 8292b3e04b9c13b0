//! Looking up boxes: every stored box that overlaps a given one, in a grid that may have been edited.

use super::cells::query_of;
use super::edit::EditedGrid;
use super::record::Record;
use super::search::KeyRun;
use super::simd::{BLOCK, Simd, dispatch};
use crate::Aabb;
use crate::policy::search::{WORK_OF_ENTRY, WORK_OF_EXACT_TEST};
use std::sync::atomic::{AtomicU64, Ordering};

/// Place of a stored box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// A slot of the grid.
    Slot(u32),
    /// An entry of the spill list.
    Spill(u32),
    /// An entry of the list of oversize boxes.
    Oversize(u32),
    /// Nowhere: the box was absent or invalid.
    Nowhere,
}

/// The work that look-ups may take, and what all threads have taken. Beyond the limit they end early.
#[derive(Debug)]
pub(crate) struct Budget {
    limit: u64,
    spent: AtomicU64,
}

impl Budget {
    pub(crate) fn new(limit: u64) -> Self {
        Self { limit, spent: AtomicU64::new(0) }
    }

    /// Returns the work done so far.
    pub(crate) fn spent(&self) -> u64 {
        self.spent.load(Ordering::Relaxed)
    }

    /// Returns true if more than the limit was spent. The final answer depends on the work alone, not on the threads.
    pub(crate) fn is_over(&self) -> bool {
        self.spent() > self.limit
    }
}

/// Work that a thread does before it adds it to the total.
const CHARGED_TOGETHER: u64 = 4096;

/// The counts of a thread's look-ups.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tally {
    /// Stored boxes tested.
    pub(crate) tests: u64,
    /// Stored boxes that overlapped, each box itself included.
    pub(crate) met: u64,
    /// The work: tests of codes, rows, and exact tests of what lies out of order.
    work: u64,
    /// The part of the work that other threads know of.
    charged: u64,
}

impl Tally {
    /// Returns true while the budget lasts.
    #[inline(always)]
    fn may_go_on(&mut self, budget: &Budget) -> bool {
        if self.work - self.charged < CHARGED_TOGETHER {
            return true;
        }
        self.charge(budget);
        !budget.is_over()
    }

    fn charge(&mut self, budget: &Budget) {
        budget.spent.fetch_add(self.work - self.charged, Ordering::Relaxed);
        self.charged = self.work;
    }
}

impl EditedGrid {
    /// Hands every stored box that overlaps one of `boxes` to `meet`, with the number of that one; some only, if the budget does not
    /// suffice. Invalid boxes meet nothing.
    pub(crate) fn look_up<M: FnMut(usize, &Record, Place)>(
        &self,
        boxes: &[Record],
        tally: &mut Tally,
        budget: &Budget,
        meet: M,
    ) {
        let look_up = &mut LookUp { grid: self, tally, budget, meet };
        if self.grid.plan.cells.wraps {
            dispatch!(LookUp::all::<true>, look_up, boxes);
        } else {
            dispatch!(LookUp::all::<false>, look_up, boxes);
        }
        tally.charge(budget);
    }

    /// Hands stored boxes that overlap `aabb` to `visit`.
    pub(crate) fn overlapping(&self, aabb: &Aabb, visit: &mut dyn FnMut(u32)) {
        let one = [Record::new(*aabb, u32::MAX, 0)];
        let (tally, budget) = (&mut Tally::default(), &Budget::new(u64::MAX));
        self.look_up(&one, tally, budget, |_, stored, _| visit(stored.id));
    }
}

struct LookUp<'a, M> {
    grid: &'a EditedGrid,
    tally: &'a mut Tally,
    budget: &'a Budget,
    meet: M,
}

impl<M: FnMut(usize, &Record, Place)> LookUp<'_, M> {
    #[inline(always)]
    fn all<const WRAPS: bool>(simd: impl Simd, look_up: &mut Self, boxes: &[Record]) {
        for (i, one) in boxes.iter().enumerate() {
            if !look_up.tally.may_go_on(look_up.budget) {
                break;
            }
            if simd.takes(&look_up.grid.grid.plan.cells, &one.aabb) {
                look_up.in_cells::<WRAPS>(simd, i, one);
            } else if one.aabb.is_valid() {
                look_up.in_reach(i, one);
            } else {
                continue;
            }
            for (entry, stored) in (0..).zip(&look_up.grid.grid.oversize) {
                look_up.test_counted(i, one, stored, Place::Oversize(entry), WORK_OF_EXACT_TEST);
            }
        }
    }

    /// Visits the cells in which the lower corner of an overlapping box can lie.
    #[inline(always)]
    fn in_cells<const WRAPS: bool>(&mut self, simd: impl Simd, i: usize, one: &Record) {
        let cells = &self.grid.grid.plan.cells;
        let (low, high) = simd.steps(cells, &one.aabb);
        let (query, window) = (query_of(simd.code(low, high)), cells.window(low, high));
        for z in window.low[2]..=window.high[2] {
            for y in window.low[1]..=window.high[1] {
                let row = cells.row::<WRAPS>([window.low[0], y, z], window.high[0]);
                for run in row.into_iter().filter(|(_, count)| *count > 0) {
                    self.tally.work += 1;
                    self.spilled(i, one, run, WORK_OF_ENTRY);
                    self.slots(simd, query, (i, one), run);
                }
            }
        }
    }

    /// Tests the spilled boxes of a run of cells.
    #[inline(always)]
    fn spilled(&mut self, i: usize, one: &Record, run: KeyRun, work: u64) {
        let spill = &self.grid.spill;
        if !spill.is_empty() {
            spill.visit(run, |entry| {
                self.test_counted(i, one, spill.record(entry), Place::Spill(entry), work);
            });
        }
    }

    /// Tests the slots of a run of cells, first by their codes.
    #[inline(always)]
    fn slots(&mut self, simd: impl Simd, query: u64, (i, one): (usize, &Record), run: KeyRun) {
        let grid = &self.grid.grid;
        let (first, end) = grid.slots(run);
        self.tally.tests += (end - first) as u64;
        self.tally.work += (end - first) as u64;
        for first in (first..end).step_by(BLOCK) {
            let beyond = (end - first).min(BLOCK) as u32;
            // SAFETY: `first` is below an end that comes from `starts`.
            let block = unsafe { grid.block(first) };
            let mut mask = simd.test(query, block) & ((1u32 << beyond) - 1);
            while mask != 0 {
                let slot = first + mask.trailing_zeros() as usize;
                mask &= mask - 1;
                self.test(i, one, &grid.records[slot], Place::Slot(slot as u32));
            }
        }
    }

    /// Tests all boxes in the cells that an oversize box reaches.
    fn in_reach(&mut self, i: usize, one: &Record) {
        let grid = &self.grid.grid;
        grid.reached_by(&one.aabb, |run| {
            self.tally.work += WORK_OF_ENTRY;
            let (first, end) = grid.slots(run);
            for (slot, stored) in (first as u32..).zip(&grid.records[first..end]) {
                self.test_counted(i, one, stored, Place::Slot(slot), WORK_OF_EXACT_TEST);
            }
            self.spilled(i, one, run, WORK_OF_EXACT_TEST);
        });
    }

    /// Tests a stored box, and counts the test and its work.
    #[inline(always)]
    fn test_counted(&mut self, i: usize, one: &Record, stored: &Record, place: Place, work: u64) {
        self.tally.tests += 1;
        self.tally.work += work;
        self.test(i, one, stored, place);
    }

    #[inline(always)]
    fn test(&mut self, i: usize, one: &Record, stored: &Record, place: Place) {
        if one.overlaps(stored) {
            self.tally.met += 1;
            self.tally.work += WORK_OF_ENTRY;
            (self.meet)(i, stored, place);
        }
    }
}
