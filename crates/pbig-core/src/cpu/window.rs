//! Windows: any box against every box of a level that it may overlap, each once.
//!
//! Boxes that are looked up are few among many, so that all they look at is far away in memory. A batch of them first
//! asks for where its rows begin, then for what is in them, and then tests it. (One box after the other: 1.3 ms for
//! 1,000 boxes among 100,000 instead of 0.4.)

use super::codes::{BLOCK, Lanes, Portable, Simd, prefetch};
use super::judge::{Accept, HITS, Hits, Judge, Scratch};
use super::levels::Level;
use super::record::Record;
use super::sort::Sorted;
use crate::Aabb;

/// Boxes whose rows are scanned together.
const BATCH: usize = 32;

/// Rows that are scanned together, or a few more.
const ROWS: usize = 1024;

/// What a box has to look at: cells by key, then slots.
#[derive(Clone, Copy, Debug)]
struct Row {
    query: u32,
    from: u32,
    to: u32,
}

/// The rows of a batch, and the codes of its boxes, as far as they have one; a buffer for each thread.
pub(super) struct Rows {
    list: Vec<Row>,
    /// Of slots.
    spilled: Vec<Row>,
    codes: [Option<u64>; BATCH],
}

impl Default for Rows {
    fn default() -> Self {
        Self { list: Vec::with_capacity(ROWS + 2), spilled: Vec::new(), codes: [None; BATCH] }
    }
}

/// A search of levels for boxes from elsewhere.
pub(super) struct Windows<'a, 'b, R, A> {
    pub(super) sorted: &'a Sorted<R>,
    pub(super) judge: Judge<'a, R, A>,
    pub(super) scratch: &'b mut Scratch,
    rows: &'b mut Rows,
    pub(super) checks: u64,
    /// Hits that wait to be judged.
    kept: usize,
}

impl<'a, 'b, R: Record, A: Accept> Windows<'a, 'b, R, A> {
    pub(super) fn new(
        sorted: &'a Sorted<R>,
        judge: Judge<'a, R, A>,
        (scratch, rows): (&'b mut Scratch, &'b mut Rows),
    ) -> Self {
        // A search that ran out of room leaves some.
        rows.list.clear();
        rows.spilled.clear();
        Self { sorted, judge, scratch, rows, checks: 0, kept: 0 }
    }

    /// The boxes, by the place of each on the side of the queries, against a level; false when there is no more room.
    pub(super) fn check(&mut self, level: &Level, places: &[u32], simd: Simd) -> bool {
        match simd {
            // SAFETY: the processor has what was detected.
            #[cfg(target_arch = "x86_64")]
            Simd::Avx2 => unsafe { self.check_avx2(level, places) },
            Simd::Portable => self.check_with::<Portable>(level, places),
        }
    }

    /// # Safety
    /// The processor has what [`Simd::Avx2`] stands for.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
    unsafe fn check_avx2(&mut self, level: &Level, places: &[u32]) -> bool {
        self.check_with::<super::codes::Avx2>(level, places)
    }

    #[inline(always)]
    fn check_with<L: Lanes>(&mut self, level: &Level, places: &[u32]) -> bool {
        for batch in places.chunks(BATCH) {
            for (query, &place) in batch.iter().enumerate() {
                let aabb = self.judge.queries[place as usize].item().aabb;
                if !self.look::<L>(level, query, &aabb, batch) {
                    return false;
                }
            }
            if !self.scan::<L>(batch) || !self.settle(batch) {
                return false;
            }
        }
        true
    }

    /// The rows of a box's window, to be scanned.
    #[inline(always)]
    fn look<L: Lanes>(&mut self, level: &Level, query: usize, aabb: &Aabb, batch: &[u32]) -> bool {
        let cells = &level.cells;
        let (low, high) = cells.window(aabb);
        let wide: [u64; 3] = std::array::from_fn(|k| (high[k] - low[k]) as u64 + 1);
        self.rows.codes[query] = cells.query(aabb);
        // A window that wraps onto itself would meet boxes twice; one with more rows than there are boxes is slower
        // than all of them.
        let wraps = (0..3).any(|k| wide[k] > u64::from(cells.dims[k]));
        if wraps || wide[1] * wide[2] > level.slots.len() as u64 {
            return self.scan_all::<L>(level, query as u32, batch);
        }
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                self.push(level, query, cells.key([low[0], y, z]), wide[0] as u32);
                if self.rows.list.len() >= ROWS && !self.scan::<L>(batch) {
                    return false;
                }
            }
        }
        true
    }

    /// Consecutive cells from `key` on, two rows where they wrap around.
    #[inline(always)]
    fn push(&mut self, level: &Level, query: usize, key: u32, length: u32) {
        let (base, behind) = (level.cells.base, level.cells.base + level.cells.mask + 1);
        let (query, end) = (query as u32, key + length);
        prefetch(&self.sorted.starts[key as usize]);
        self.rows.list.push(Row { query, from: key, to: end.min(behind) });
        if end > behind {
            self.rows.list.push(Row { query, from: base, to: base + end - behind });
        }
    }

    /// The rows that were pushed: first where in memory they and what their cells have spilled are, then what is there.
    #[inline(always)]
    fn scan<L: Lanes>(&mut self, batch: &[u32]) -> bool {
        let (sorted, rows) = (self.sorted, &mut *self.rows);
        for row in &mut rows.list {
            let Row { query, from, to } = *row;
            if sorted.have_spilled(from, to) {
                let spilled = (from..to).flat_map(|key| sorted.spilled(key));
                rows.spilled.extend(spilled.map(|slot| Row { query, from: slot, to: slot + 1 }));
            }
            (row.from, row.to) = (sorted.start(from), sorted.start(to));
            prefetch(&sorted.codes[row.from as usize]);
            prefetch(&sorted.codes[row.from as usize + BLOCK - 1]);
        }
        for i in 0..self.rows.list.len() {
            if !self.scan_run::<L>(self.rows.list[i], batch) {
                return false;
            }
        }
        for i in 0..self.rows.spilled.len() {
            if !self.scan_run::<L>(self.rows.spilled[i], batch) {
                return false;
            }
        }
        self.rows.list.clear();
        self.rows.spilled.clear();
        true
    }

    /// All slots of a level.
    #[inline(always)]
    fn scan_all<L: Lanes>(&mut self, level: &Level, query: u32, batch: &[u32]) -> bool {
        let (from, to) = (level.slots.start as u32, level.slots.end as u32);
        if !self.scan_run::<L>(Row { query, from, to }, batch) {
            return false;
        }
        let sorted = self.sorted;
        for slot in sorted.behind().filter(|&slot| level.has(sorted.keys[slot])) {
            let from = slot as u32;
            if !self.scan_run::<L>(Row { query, from, to: from + 1 }, batch) {
                return false;
            }
        }
        true
    }

    /// A run of slots; a query without a code may overlap all of them.
    #[inline(always)]
    fn scan_run<L: Lanes>(&mut self, run: Row, batch: &[u32]) -> bool {
        let (mut from, code) = (run.from, self.rows.codes[run.query as usize]);
        self.checks += u64::from(run.to - run.from);
        loop {
            let block = match code {
                // SAFETY: these are slots, behind the last of which there is a block more of codes.
                Some(code) => unsafe { L::test(code, &self.sorted.codes, from as usize) },
                None => u32::MAX,
            };
            let length = run.to.saturating_sub(from).min(BLOCK as u32);
            let mask = block & ((1 << length) - 1);
            self.scratch.hits[self.kept] = Hits { query: run.query as u16, mask: mask as u16, from };
            self.kept += usize::from(mask != 0);
            if self.kept == HITS && !self.settle(batch) {
                return false;
            }
            from += BLOCK as u32;
            if from >= run.to {
                return true;
            }
        }
    }

    #[inline(never)]
    fn settle(&mut self, batch: &[u32]) -> bool {
        let count = std::mem::take(&mut self.kept);
        count == 0 || self.judge.settle(self.scratch, count, |query| batch[query])
    }
}
