//! Looking up boxes: every stored box that overlaps a given one, in a grid that may have been edited.

use super::cells::query_of;
use super::edit::EditedGrid;
use super::record::Record;
use super::search::KeyRun;
use super::simd::{BLOCK, Kernel, Simd, dispatch, prefetch};
use crate::Aabb;

/// Candidates that are tested together.
const ROOM: usize = 4096;

/// Boxes between the prefetch of a box's cells and its turn; half of them for the codes in the cells.
const AHEAD: usize = 16;

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

/// Receiver of the stored boxes that overlap the boxes looked up; `i` is the number of such a box.
pub(crate) trait Meet {
    fn meet(&mut self, i: usize, stored: &Record, place: Place);
}

/// Buffers of a look-up: candidates as the number of the box and a slot, or an entry of the spill list.
#[derive(Clone, Debug, Default)]
pub(crate) struct Candidates {
    boxes: Vec<u32>,
    places: Vec<u32>,
    len: usize,
    /// Stored boxes tested.
    pub(crate) tests: u64,
    /// Stored boxes that overlapped, each box itself included.
    pub(crate) met: u64,
}

/// Marks an entry of the spill list. Slots are below 2^28.
const SPILL: u32 = 1 << 31;

impl EditedGrid {
    /// Hands every stored box that overlaps one of `boxes` to `meet`. Invalid boxes meet nothing.
    pub(crate) fn look_up<M: Meet>(&self, boxes: &[Record], candidates: &mut Candidates, meet: &mut M) {
        candidates.boxes.resize(ROOM + 2 * BLOCK, 0);
        candidates.places.resize(ROOM + 2 * BLOCK, 0);
        candidates.len = 0;
        dispatch(LookUp { grid: self, boxes, candidates, meet });
        for (i, one) in boxes.iter().enumerate().filter(|(_, one)| one.aabb.is_valid()) {
            self.meet_oversize(i, one, candidates, meet);
        }
    }

    fn meet_oversize<M: Meet>(&self, i: usize, one: &Record, counts: &mut Candidates, meet: &mut M) {
        let mut counted = |stored: &Record, place: Place| {
            counts.tests += 1;
            if one.overlaps(stored) {
                counts.met += 1;
                meet.meet(i, stored, place);
            }
        };
        for (place, stored) in self.grid.oversize.iter().enumerate() {
            counted(stored, Place::Oversize(place as u32));
        }
        if !self.grid.plan.cells.takes(&one.aabb) {
            self.visit_reached(&one.aabb, counted);
        }
    }

    /// Visits all boxes in the cells that an oversize box reaches.
    fn visit_reached(&self, aabb: &Aabb, mut visit: impl FnMut(&Record, Place)) {
        self.grid.reached_by(aabb, |run| {
            let (first, end) = self.grid.slots(run);
            for (slot, stored) in (first..end).zip(&self.grid.records[first..end]) {
                visit(stored, Place::Slot(slot as u32));
            }
            self.spill.visit(run, |entry| visit(self.spill.record(entry), Place::Spill(entry)));
        });
    }

    /// Hands stored boxes that overlap `aabb` to `visit`.
    pub(crate) fn overlapping(&self, aabb: &Aabb, visit: &mut dyn FnMut(u32)) {
        struct Visit<'a>(&'a mut dyn FnMut(u32));
        impl Meet for Visit<'_> {
            fn meet(&mut self, _: usize, stored: &Record, _: Place) {
                (self.0)(stored.id);
            }
        }
        let one = [Record::new(*aabb, u32::MAX, 0)];
        self.look_up(&one, &mut Candidates::default(), &mut Visit(visit));
    }
}

struct LookUp<'a, M> {
    grid: &'a EditedGrid,
    boxes: &'a [Record],
    candidates: &'a mut Candidates,
    meet: &'a mut M,
}

impl<M: Meet> Kernel for LookUp<'_, M> {
    type Output = ();

    #[inline(always)]
    unsafe fn run<S: Simd>(mut self) {
        // SAFETY: the caller has the instructions.
        unsafe {
            if self.grid.grid.plan.cells.wraps {
                self.all::<S, true>();
            } else {
                self.all::<S, false>();
            }
        }
    }
}

impl<M: Meet> LookUp<'_, M> {
    #[inline(always)]
    unsafe fn all<S: Simd, const WRAPS: bool>(&mut self) {
        for i in 0..self.boxes.len() {
            // SAFETY: the caller has the instructions.
            unsafe {
                if let Some(ahead) = self.boxes.get(i + AHEAD) {
                    self.prefetch::<S, WRAPS>(&ahead.aabb, false);
                }
                if let Some(ahead) = self.boxes.get(i + AHEAD / 2) {
                    self.prefetch::<S, WRAPS>(&ahead.aabb, true);
                }
                if self.grid.grid.plan.cells.takes(&self.boxes[i].aabb) {
                    self.one::<S, WRAPS>(i);
                }
            }
        }
        self.test();
    }

    /// Prefetches where the cells of a box begin, or the codes there.
    #[inline(always)]
    unsafe fn prefetch<S: Simd, const WRAPS: bool>(&self, aabb: &Aabb, codes: bool) {
        let grid = &self.grid.grid;
        let cells = &grid.plan.cells;
        if !cells.takes(aabb) {
            return;
        }
        // SAFETY: the caller has the instructions.
        let (low, high) = unsafe { S::steps(cells, aabb) };
        let window = cells.window(low, high);
        for z in window.low[2]..=window.high[2] {
            for y in window.low[1]..=window.high[1] {
                let [(key, _), _] = cells.row::<WRAPS>([window.low[0], y, z], window.high[0]);
                if codes {
                    prefetch(grid.codes.as_ptr().wrapping_add(grid.starts[key] as usize));
                } else {
                    prefetch(grid.starts.as_ptr().wrapping_add(key));
                }
            }
        }
    }

    #[inline(always)]
    unsafe fn one<S: Simd, const WRAPS: bool>(&mut self, i: usize) {
        let cells = &self.grid.grid.plan.cells;
        // SAFETY: the caller has the instructions.
        let (low, high) = unsafe { S::steps(cells, &self.boxes[i].aabb) };
        // SAFETY: as above.
        let (query, window) = (query_of(unsafe { S::code(low, high) }), cells.window(low, high));
        for z in window.low[2]..=window.high[2] {
            for y in window.low[1]..=window.high[1] {
                for run in cells.row::<WRAPS>([window.low[0], y, z], window.high[0]) {
                    // SAFETY: as above.
                    unsafe { self.run_of_cells::<S>(i, query, run) };
                }
            }
        }
    }

    #[inline(always)]
    unsafe fn run_of_cells<S: Simd>(&mut self, i: usize, query: u64, run: KeyRun) {
        let grid = &self.grid.grid;
        let (first, end) = grid.slots(run);
        self.candidates.tests += (end - first) as u64;
        for first in (first..end).step_by(BLOCK) {
            let beyond = (end - first).min(BLOCK) as u32;
            let Candidates { boxes, places, len, .. } = &mut *self.candidates;
            // SAFETY: codes are padded by two blocks; the lists have room for a block more than `ROOM`.
            unsafe {
                let mask = S::test(query, grid.codes.as_ptr().add(first)) & ((1u32 << beyond) - 1);
                let (boxes, places) = (boxes.as_mut_ptr().add(*len), places.as_mut_ptr().add(*len));
                let count = S::expand(i as u32, first as u32, mask, boxes, places);
                prefetch(grid.records.as_ptr().wrapping_add(*places as usize & 0xFFF_FFFF));
                *len += count;
            }
            if self.candidates.len > ROOM {
                self.test();
            }
        }
        if !self.grid.spill.is_empty() {
            self.spilled(i, run);
        }
    }

    fn spilled(&mut self, i: usize, run: KeyRun) {
        let grid = self.grid;
        grid.spill.visit(run, |entry| {
            let at = self.candidates.len;
            (self.candidates.boxes[at], self.candidates.places[at]) = (i as u32, entry | SPILL);
            self.candidates.len += 1;
            self.candidates.tests += 1;
            if self.candidates.len > ROOM {
                self.test();
            }
        });
    }

    /// Tests the candidates so far exactly.
    #[inline(always)]
    fn test(&mut self) {
        let candidates = self.candidates.len;
        for at in 0..candidates {
            let (i, place) = (self.candidates.boxes[at] as usize, self.candidates.places[at]);
            let (stored, place) = if place & SPILL == 0 {
                (&self.grid.grid.records[place as usize], Place::Slot(place))
            } else {
                (self.grid.spill.record(place & !SPILL), Place::Spill(place & !SPILL))
            };
            if self.boxes[i].overlaps(stored) {
                self.candidates.met += 1;
                self.meet.meet(i, stored, place);
            }
        }
        self.candidates.len = 0;
    }
}
