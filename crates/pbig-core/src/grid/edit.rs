//! Editing a grid in place: boxes that moved since it was built.
//!
//! A box that stays in its cell is overwritten. One that leaves its cell leaves a tombstone in its slot, and goes to a
//! *spill* list of its new cell.

use super::Grid;
use super::cells::{Cells, TOMBSTONE};
use super::lookup::Place;
use super::record::Record;
use super::search::KeyRun;
use super::search::Sorted;
use super::simd::{Simd, dispatch, prefetch};
use super::spacing::GridPlan;
use crate::memory::ShrinkingVec;
use crate::policy::search::WORK_OF_EXACT_TEST;
use crate::{Aabb, Algorithm, Plan};

/// Number of boxes between a prefetch and the move.
const AHEAD: usize = 12;

/// No entry: the end of a list.
const NONE: u32 = u32::MAX;

/// A grid, and the boxes that are out of its order.
#[derive(Clone, Debug, Default)]
pub(crate) struct EditedGrid {
    pub(super) grid: Grid,
    pub(super) spill: Spill,
}

/// Boxes by cell, as linked lists.
#[derive(Clone, Debug, Default)]
pub(super) struct Spill {
    records: ShrinkingVec<Record>,
    /// By entry: the one behind it and the one before it in its list.
    next: ShrinkingVec<u32>,
    before: ShrinkingVec<u32>,
    free: ShrinkingVec<u32>,
    /// By cell: the first entry. Empty until the first box moves.
    heads: ShrinkingVec<u32>,
    /// A bit for each cell: whether it has entries.
    occupied: ShrinkingVec<u64>,
}

impl EditedGrid {
    /// Gives back memory that the boxes of the last search did not need.
    pub(crate) fn settle(&mut self, holds_boxes: bool) {
        self.grid.settle(holds_boxes);
        self.spill.settle();
    }
}

impl Spill {
    fn settle(&mut self) {
        let entries = self.records.len();
        self.records.settle(entries);
        [&mut self.next, &mut self.before, &mut self.free].into_iter().for_each(|list| list.settle(entries));
        let cells = if self.is_empty() { 0 } else { self.heads.len() };
        self.heads.settle(cells);
        self.occupied.settle(cells.div_ceil(64) + 2);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.records.len() == self.free.len()
    }

    fn len(&self) -> usize {
        self.records.len() - self.free.len()
    }

    #[inline(always)]
    pub(super) fn record(&self, entry: u32) -> &Record {
        &self.records[entry as usize]
    }

    /// Visits the entries of a run of cells.
    #[inline(always)]
    pub(super) fn visit(&self, (key, count): KeyRun, mut visit: impl FnMut(u32)) {
        // Cells beyond those of the last insertion have no entries.
        let end = (key + count).min(self.heads.len());
        for first in (key..end).step_by(64) {
            let beyond = (end - first).min(64);
            let mut bits = self.occupied_from(first) & (u64::MAX >> (64 - beyond));
            while bits != 0 {
                let mut entry = self.heads[first + bits.trailing_zeros() as usize];
                bits &= bits - 1;
                while entry != NONE {
                    visit(entry);
                    entry = self.next[entry as usize];
                }
            }
        }
    }

    /// Returns the bits of 64 cells, any key first.
    #[inline(always)]
    fn occupied_from(&self, key: usize) -> u64 {
        let (word, bit) = (key / 64, key % 64);
        // Two shifts, because `64 - bit` can be 64, which is too large for one shift.
        self.occupied[word] >> bit | self.occupied[word + 1] << 1 << (63 - bit)
    }

    /// Prefetches the memory that a visit reads next.
    #[inline(always)]
    pub(super) fn prefetch_heads(&self, (key, count): KeyRun) {
        if key + count <= self.heads.len() && self.occupied_from(key) << (64 - count.clamp(1, 64)) != 0 {
            prefetch(&self.heads[key + self.occupied_from(key).trailing_zeros() as usize]);
        }
    }

    /// Prefetches the memory that a visit reads first.
    #[inline(always)]
    pub(super) fn prefetch(&self, key: usize) {
        prefetch(self.occupied.as_ptr().wrapping_add(key / 64));
    }

    /// Forgets all entries.
    fn clear(&mut self) {
        for record in self.records.iter() {
            if let Some(head) = self.heads.get_mut(record.key as usize) {
                *head = NONE;
                self.occupied[record.key as usize / 64] = 0;
            }
        }
        self.records.clear();
        self.next.clear();
        self.before.clear();
        self.free.clear();
    }

    fn insert(&mut self, record: Record, cells: usize) {
        if self.heads.len() < cells {
            self.heads.resize(cells, NONE);
            self.occupied.resize(cells / 64 + 2, 0);
        }
        let key = record.key as usize;
        let entry = self.free.pop().unwrap_or(self.records.len() as u32);
        if entry as usize == self.records.len() {
            self.records.push(record);
            self.next.push(NONE);
            self.before.push(NONE);
        }
        let second = std::mem::replace(&mut self.heads[key], entry);
        self.records[entry as usize] = record;
        (self.next[entry as usize], self.before[entry as usize]) = (second, NONE);
        if second != NONE {
            self.before[second as usize] = entry;
        }
        self.occupied[key / 64] |= 1 << (key % 64);
    }

    fn remove(&mut self, entry: u32) {
        let key = self.records[entry as usize].key as usize;
        let (next, before) = (self.next[entry as usize], self.before[entry as usize]);
        match before {
            NONE => self.heads[key] = next,
            before => self.next[before as usize] = next,
        }
        if next != NONE {
            self.before[next as usize] = before;
        }
        if self.heads[key] == NONE {
            self.occupied[key / 64] &= !(1 << (key % 64));
        }
        self.free.push(entry);
    }
}

impl EditedGrid {
    /// Builds the grid anew from all boxes.
    pub(crate) fn build(&mut self, plan: GridPlan, boxes: &[Aabb], workers: usize) -> Sorted<'_> {
        self.spill.clear();
        self.grid.build(plan, boxes, workers)
    }

    /// Renames the boxes of a grid as it was built: `names[id]` is the new id of the box `id`.
    pub(crate) fn rename(&mut self, names: &[u32]) {
        let Grid { records, oversize, len, .. } = &mut self.grid;
        records[..*len].iter_mut().chain(oversize).for_each(|record| record.id = names[record.id as usize]);
    }

    /// Returns the plan for reports, with this number of valid boxes.
    pub(crate) fn describe(&self, boxes: u32) -> Plan {
        let (algorithm, spilled) = (Algorithm::Edit, self.spilled() as u32);
        let Grid { plan, oversize, .. } = &self.grid;
        Plan { algorithm, spilled, ..Plan::of_grid(plan, boxes as usize, oversize.len()) }
    }

    /// Returns an estimate of the work of testing changed boxes against the oversize ones, before and after the move. `after` are the
    /// boxes as they are now. Those that are oversize may have been so before.
    pub(crate) fn work_with_oversize<'a>(&self, after: impl ExactSizeIterator<Item = &'a Aabb>) -> u64 {
        let (boxes, oversize, cells) = (after.len(), self.grid.oversize.len(), &self.grid.plan.cells);
        let more = after.filter(|aabb| !cells.takes(aabb) && aabb.is_valid()).count();
        boxes as u64 * (oversize + more.max(oversize)) as u64 * WORK_OF_EXACT_TEST
    }

    /// Returns the number of boxes that are out of the grid's order.
    pub(crate) fn spilled(&self) -> usize {
        self.spill.len()
    }

    /// Moves boxes from where they are to where they are now; `moved[i]` is at `places[i]`.
    pub(crate) fn move_all(&mut self, moved: &[Record], places: &[Place]) {
        dispatch!(move_all, self, moved, places);
    }

    /// Returns the key of the cell in which a box lies, for sorting: movers are looked up in the order of cells.
    pub(crate) fn keys(&self, boxes: &mut [Record]) {
        dispatch!(compute_keys, &self.grid.plan.cells, boxes);
    }

    /// Prefetches the memory that the move of a box reads and writes, at its old and its new place.
    #[inline(always)]
    fn prefetch(&self, moved: &[Record], places: &[Place], i: usize) {
        let Some(Place::Slot(slot)) = places.get(i) else { return };
        prefetch(self.grid.records.as_ptr().wrapping_add(*slot as usize));
        prefetch(self.grid.codes.as_ptr().wrapping_add(*slot as usize));
        prefetch(self.spill.heads.as_ptr().wrapping_add(moved[i].key as usize));
    }

    fn take_out(&mut self, place: Place, moved: &mut Vec<u32>) {
        match place {
            Place::Slot(slot) => {
                self.grid.codes[slot as usize] = TOMBSTONE;
                self.grid.records[slot as usize].aabb = Aabb::NOWHERE;
            }
            Place::Spill(entry) => self.spill.remove(entry),
            Place::Oversize(entry) => moved.push(entry),
            Place::Nowhere => {}
        }
    }

    /// Overwrites a box that stays in its slot or spill list. Returns false if it leaves.
    fn overwrite(&mut self, record: Record, code: u64, place: Place) -> bool {
        match place {
            Place::Slot(slot) if self.grid.records[slot as usize].key == record.key => {
                self.grid.records[slot as usize] = record;
                self.grid.codes[slot as usize] = code;
                true
            }
            Place::Spill(entry) if self.spill.records[entry as usize].key == record.key => {
                self.spill.records[entry as usize] = record;
                true
            }
            _ => false,
        }
    }

    /// Takes boxes out of the oversize list.
    fn take_out_oversize(&mut self, mut entries: Vec<u32>) {
        entries.sort_unstable();
        entries.iter().rev().for_each(|&entry| _ = self.grid.oversize.swap_remove(entry as usize));
    }
}

#[inline(always)]
fn compute_keys(simd: impl Simd, cells: &Cells, boxes: &mut [Record]) {
    for record in boxes {
        let (low, _) = simd.steps(cells, &record.aabb);
        record.key = cells.key(cells.cell(low));
    }
}

#[inline(always)]
fn move_all(simd: impl Simd, grid: &mut EditedGrid, moved: &[Record], places: &[Place]) {
    let cells = grid.grid.plan.cells;
    let (mut no_longer_oversize, mut oversize) = (vec![], vec![]);
    for (i, (record, &place)) in moved.iter().zip(places).enumerate() {
        grid.prefetch(moved, places, i + AHEAD);
        if !cells.takes(&record.aabb) {
            grid.take_out(place, &mut no_longer_oversize);
            oversize.extend(record.aabb.is_valid().then_some(*record));
            continue;
        }
        let (low, high) = simd.steps(&cells, &record.aabb);
        if !grid.overwrite(*record, simd.code(low, high), place) {
            grid.take_out(place, &mut no_longer_oversize);
            grid.spill.insert(*record, cells.count());
        }
    }
    grid.take_out_oversize(no_longer_oversize);
    grid.grid.oversize.extend(oversize);
}
