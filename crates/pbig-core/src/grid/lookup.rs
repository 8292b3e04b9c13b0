//! Looking up boxes: every stored box that overlaps a given one, in a grid that may have been edited.

use super::cells::query_of;
use super::edit::EditedGrid;
use super::record::Record;
use super::search::KeyRun;
use super::simd::{BLOCK, Simd, dispatch, prefetch};
use crate::Aabb;
use crate::policy::search::{WORK_OF_ENTRY, WORK_OF_EXACT_TEST};
use std::sync::atomic::{AtomicU64, Ordering};

/// Maximum number of candidates that are tested together.
const ROOM: usize = 4096;

/// Candidates that are tested together for each box of a short list.
const ROOM_PER_BOX: usize = 32;

/// Number of rows of cells in a round: enough for the first row's codes to arrive before the last row is prefetched.
const ROWS: usize = 256;

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

/// A row of cells to look through for a box.
#[derive(Clone, Copy, Debug)]
struct Row {
    query: u64,
    /// The number of the box.
    i: u32,
    /// The first key and the one after the last; later the slots.
    first: u32,
    end: u32,
}

impl Row {
    fn cells(&self) -> KeyRun {
        (self.first as usize, (self.end - self.first) as usize)
    }
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

    /// Adds work.
    pub(crate) fn charge(&self, work: u64) {
        self.spent.fetch_add(work, Ordering::Relaxed);
    }

    /// Returns true if more than the limit was spent. The final answer depends on the work alone, not on the threads.
    pub(crate) fn is_over(&self) -> bool {
        self.spent() > self.limit
    }
}

/// Work that a thread does before it adds it to the total.
const CHARGED_TOGETHER: u64 = 4096;

/// Buffers of a look-up: candidates as the number of the box and a slot, or an entry of the spill list.
#[derive(Clone, Debug, Default)]
pub(crate) struct Candidates {
    rows: Vec<Row>,
    boxes: Vec<u32>,
    places: Vec<u32>,
    len: usize,
    room: usize,
    /// Stored boxes tested.
    pub(crate) tests: u64,
    /// The work: tests of codes, rows, and exact tests of what lies out of order.
    work: u64,
    /// The part of the work that was added to the budget.
    charged: u64,
    /// Stored boxes that overlapped, each box itself included.
    pub(crate) met: u64,
}

impl Candidates {
    /// Makes room for the candidates of some boxes.
    fn begin(&mut self, boxes: usize) {
        self.room = ROOM.min(boxes * ROOM_PER_BOX).max(self.room);
        self.boxes.resize(self.room + 2 * BLOCK, 0);
        self.places.resize(self.room + 2 * BLOCK, 0);
        self.len = 0;
    }

    /// Forgets what was counted.
    pub(crate) fn clear_counts(&mut self) {
        (self.tests, self.met, self.work, self.charged) = (0, 0, 0, 0);
    }

    /// Counts the candidates from `from` on, which are entries of lists.
    #[inline(always)]
    fn count_entries(&mut self, from: usize) {
        let entries = (self.len - from) as u64;
        self.tests += entries;
        self.work += entries * WORK_OF_ENTRY;
    }

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

/// Marks an entry of the spill list. Slots are below 2^28.
const SPILL: u32 = 1 << 31;

impl EditedGrid {
    /// Hands every stored box that overlaps one of `boxes` to `meet`, with the number of that one; some only, if the budget does not
    /// suffice. Invalid boxes meet nothing.
    pub(crate) fn look_up(
        &self,
        boxes: &[Record],
        candidates: &mut Candidates,
        budget: &Budget,
        mut meet: impl FnMut(usize, &Record, Place),
    ) {
        candidates.begin(boxes.len());
        let look_up = &mut LookUp { grid: self, boxes, candidates, budget, meet: &mut meet };
        if self.grid.plan.cells.wraps {
            dispatch!(LookUp::in_cells::<true>, look_up);
        } else {
            dispatch!(LookUp::in_cells::<false>, look_up);
        }
        for (i, one) in boxes.iter().enumerate().filter(|(_, one)| one.aabb.is_valid()) {
            if !candidates.may_go_on(budget) {
                break;
            }
            self.meet_oversize(i, one, candidates, &mut meet);
        }
        candidates.charge(budget);
    }

    fn meet_oversize(
        &self,
        i: usize,
        one: &Record,
        counts: &mut Candidates,
        meet: &mut impl FnMut(usize, &Record, Place),
    ) {
        let mut counted = |stored: &Record, place: Place| {
            counts.tests += 1;
            counts.work += WORK_OF_EXACT_TEST;
            if one.overlaps(stored) {
                counts.met += 1;
                counts.work += WORK_OF_ENTRY;
                meet(i, stored, place);
            }
        };
        for (place, stored) in self.grid.oversize.iter().enumerate() {
            counted(stored, Place::Oversize(place as u32));
        }
        if !self.grid.plan.cells.takes(&one.aabb) {
            let work = self.visit_reached(&one.aabb, counted);
            counts.work += work;
        }
    }

    /// Visits all boxes in the cells that an oversize box reaches. Returns the work of finding them.
    fn visit_reached(&self, aabb: &Aabb, mut visit: impl FnMut(&Record, Place)) -> u64 {
        let mut work = 0;
        self.grid.reached_by(aabb, |run| {
            work += WORK_OF_ENTRY;
            let (first, end) = self.grid.slots(run);
            for (slot, stored) in (first..end).zip(&self.grid.records[first..end]) {
                visit(stored, Place::Slot(slot as u32));
            }
            self.spill.visit(run, |entry| visit(self.spill.record(entry), Place::Spill(entry)));
        });
        work
    }

    /// Hands stored boxes that overlap `aabb` to `visit`.
    pub(crate) fn overlapping(&self, aabb: &Aabb, visit: &mut dyn FnMut(u32)) {
        let one = [Record::new(*aabb, u32::MAX, 0)];
        let (candidates, budget) = (&mut Candidates::default(), &Budget::new(u64::MAX));
        self.look_up(&one, candidates, budget, |_, stored, _| visit(stored.id));
    }
}

struct LookUp<'a, M> {
    grid: &'a EditedGrid,
    boxes: &'a [Record],
    candidates: &'a mut Candidates,
    budget: &'a Budget,
    meet: &'a mut M,
}

/// In three rounds over many rows, so that memory is asked for long before it is read: where the cells begin, then the codes
/// in them, then the records of matching codes.
impl<M: FnMut(usize, &Record, Place)> LookUp<'_, M> {
    #[inline(always)]
    fn in_cells<const WRAPS: bool>(simd: impl Simd, look_up: &mut Self) {
        look_up.candidates.rows.clear();
        for i in 0..look_up.boxes.len() {
            if look_up.grid.grid.plan.cells.takes(&look_up.boxes[i].aabb) {
                look_up.list::<WRAPS>(simd, i);
            }
            if look_up.candidates.rows.len() >= ROWS {
                look_up.look_through(simd);
                if look_up.budget.is_over() {
                    break;
                }
            }
        }
        look_up.look_through(simd);
        look_up.test();
    }

    /// Lists the rows of cells in which the lower corner of an overlapping box can lie.
    #[inline(always)]
    fn list<const WRAPS: bool>(&mut self, simd: impl Simd, i: usize) {
        let cells = &self.grid.grid.plan.cells;
        let (low, high) = simd.steps(cells, &self.boxes[i].aabb);
        let (query, window) = (query_of(simd.code(low, high)), cells.window(low, high));
        for z in window.low[2]..=window.high[2] {
            for y in window.low[1]..=window.high[1] {
                let [run, rest] = cells.row::<WRAPS>([window.low[0], y, z], window.high[0]);
                self.push(i, query, run);
                if WRAPS && rest.1 > 0 {
                    self.push(i, query, rest);
                }
            }
        }
    }

    #[inline(always)]
    fn push(&mut self, i: usize, query: u64, (key, count): KeyRun) {
        prefetch(self.grid.grid.starts.as_ptr().wrapping_add(key));
        self.grid.spill.prefetch(key);
        let row = Row { query, i: i as u32, first: key as u32, end: (key + count) as u32 };
        self.candidates.rows.push(row);
    }

    /// Gathers the candidates of all rows listed.
    #[inline(always)]
    fn look_through(&mut self, simd: impl Simd) {
        let mut rows = std::mem::take(&mut self.candidates.rows);
        let grid = &self.grid.grid;
        self.candidates.work += rows.len() as u64;
        if !self.grid.spill.is_empty() {
            rows.iter().for_each(|row| self.grid.spill.prefetch_heads(row.cells()));
            self.spilled(&rows);
        }
        let mut slots = 0;
        for row in &mut rows {
            (row.first, row.end) = (grid.starts[row.first as usize], grid.starts[row.end as usize]);
            slots += u64::from(row.end - row.first);
            prefetch(grid.codes.as_ptr().wrapping_add(row.first as usize));
        }
        self.candidates.tests += slots;
        self.candidates.work += slots;
        if self.candidates.may_go_on(self.budget) {
            for row in &rows {
                self.slots(simd, row);
            }
        }
        rows.clear();
        self.candidates.rows = rows;
    }

    /// Gathers the candidates of a run of slots.
    #[inline(always)]
    fn slots(&mut self, simd: impl Simd, row: &Row) {
        let grid = &self.grid.grid;
        let mut first = row.first;
        // Not `step_by`, which counts its steps first.
        while first < row.end {
            let beyond = (row.end - first).min(BLOCK as u32);
            let Candidates { boxes, places, len, .. } = &mut *self.candidates;
            // SAFETY: `first` is below an end that comes from `starts`; `len` is at most `room`, and the lists have two blocks more.
            let (codes, boxes, places) = unsafe {
                let [boxes, places] = [boxes, places].map(|list| &mut *list.as_mut_ptr().add(*len).cast());
                (grid.block(first as usize), boxes, places)
            };
            let mask = simd.test(row.query, codes) & ((1u32 << beyond) - 1);
            *len += simd.expand(row.i, first, mask, boxes, places);
            prefetch(grid.records.as_ptr().wrapping_add(places[0] as usize & 0xFFF_FFFF));
            if self.candidates.len > self.candidates.room {
                self.test();
            }
            first += BLOCK as u32;
        }
    }

    /// Gathers the spilled boxes in rows of cells; not all if there are more than the budget allows.
    #[inline(always)]
    fn spilled(&mut self, rows: &[Row]) {
        let grid = self.grid;
        // Candidates from here on are not counted yet.
        let (mut uncounted, mut may_go_on) = (self.candidates.len, true);
        for row in rows {
            grid.spill.visit(row.cells(), |entry| {
                prefetch(grid.spill.record(entry));
                let at = self.candidates.len;
                (self.candidates.boxes[at], self.candidates.places[at]) = (row.i, entry | SPILL);
                self.candidates.len += 1;
                if self.candidates.len > self.candidates.room {
                    self.candidates.count_entries(uncounted);
                    uncounted = 0;
                    self.test();
                    may_go_on = self.candidates.may_go_on(self.budget);
                }
            });
            if !may_go_on {
                break;
            }
        }
        self.candidates.count_entries(uncounted);
    }

    /// Tests the candidates so far exactly. One copy for all its callers, so that `meet` is inlined.
    #[inline(never)]
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
                self.candidates.work += WORK_OF_ENTRY;
                (self.meet)(i, stored, place);
            }
        }
        self.candidates.len = 0;
    }
}
