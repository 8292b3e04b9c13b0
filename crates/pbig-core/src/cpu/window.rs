//! Windows: any box against every box of a level that it may overlap, each once.

use super::codes::{BLOCK, Lanes, Portable, Simd};
use super::judge::{Accept, HITS, Hits, Judge, Scratch};
use super::levels::Level;
use super::record::Record;
use super::sort::Sorted;
use crate::Aabb;

/// A search of levels for boxes from elsewhere.
pub(super) struct Windows<'a, 'b, R, A> {
    pub(super) sorted: &'a Sorted<R>,
    pub(super) judge: Judge<'a, R, A>,
    pub(super) scratch: &'b mut Scratch,
    pub(super) checks: u64,
    /// Hits that wait to be judged.
    kept: usize,
}

impl<'a, 'b, R: Record, A: Accept> Windows<'a, 'b, R, A> {
    pub(super) fn new(sorted: &'a Sorted<R>, judge: Judge<'a, R, A>, scratch: &'b mut Scratch) -> Self {
        Self { sorted, judge, scratch, checks: 0, kept: 0 }
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
        for batch in places.chunks(usize::from(u16::MAX)) {
            for (query, &place) in batch.iter().enumerate() {
                let aabb = self.judge.queries[place as usize].item().aabb;
                if !self.scan::<L>(level, query as u16, &aabb, batch) {
                    return false;
                }
            }
            if !self.settle(batch) {
                return false;
            }
        }
        true
    }

    /// Row by row.
    #[inline(always)]
    fn scan<L: Lanes>(&mut self, level: &Level, query: u16, aabb: &Aabb, batch: &[u32]) -> bool {
        let cells = &level.cells;
        let (low, high) = cells.window(aabb);
        let code = cells.query(aabb);
        let wide: [u64; 3] = std::array::from_fn(|k| (high[k] - low[k]) as u64 + 1);
        // A window that wraps onto itself would meet boxes twice; one with more rows than there are boxes is slower
        // than all of them.
        let wraps = (0..3).any(|k| wide[k] > u64::from(cells.dims[k]));
        if wraps || wide[1] * wide[2] > level.slots.len() as u64 {
            let all = (level.slots.start as u32, level.slots.end as u32);
            return self.test::<L>(query, code, all, batch);
        }
        (low[2]..=high[2]).all(|z| {
            (low[1]..=high[1]).all(|y| {
                let [run, rest] = self.runs(level, cells.key([low[0], y, z]), wide[0] as u32);
                self.test::<L>(query, code, run, batch)
                    && (rest.0 == rest.1 || self.test::<L>(query, code, rest, batch))
            })
        })
    }

    /// The slots in `length` consecutive cells from `key` on; the second run is not empty where they wrap around.
    #[inline(always)]
    fn runs(&self, level: &Level, key: u32, length: u32) -> [(u32, u32); 2] {
        let (base, behind) = (level.cells.base, level.cells.base + level.cells.mask + 1);
        let start = |key: u32| self.sorted.starts[key as usize];
        let end = key + length;
        let rest = if end > behind { (start(base), start(base + end - behind)) } else { (0, 0) };
        [(start(key), start(end.min(behind))), rest]
    }

    /// A run of slots; a query without a code may overlap all of them.
    #[inline(always)]
    fn test<L: Lanes>(&mut self, query: u16, code: Option<u64>, run: (u32, u32), batch: &[u32]) -> bool {
        let (mut from, to) = run;
        self.checks += u64::from(to - from);
        loop {
            let block = match code {
                // SAFETY: these are slots, behind the last of which there is a block more of codes.
                Some(code) => unsafe { L::test(code, &self.sorted.codes, from as usize) },
                None => u32::MAX,
            };
            let length = to.saturating_sub(from).min(BLOCK as u32);
            let mask = block & ((1 << length) - 1);
            self.scratch.hits[self.kept] = Hits { query, mask: mask as u16, from };
            self.kept += usize::from(mask != 0);
            if self.kept == HITS && !self.settle(batch) {
                return false;
            }
            from += BLOCK as u32;
            if from >= to {
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
