//! The half neighbourhood: all pairs within one level, each from one of its boxes.
//!
//! Branches are what costs here: whether a row of the window is needed, how many boxes it holds, and which of them
//! overlap are coin tosses. So a box looks at the same five rows (the rest of its own, the next one, and three in
//! the next layer), each a run of slots that is empty when not needed; the first block of each is tested whether or not
//! there is anything in it, and hits are appended without a branch. What is longer than a block, or wraps around, waits
//! until the batch is through. Only where boxes are small in their cells, so that few reach beyond, is that asked first.

use super::cells::{Span, as_query};
use super::codes::{BLOCK, Lanes, Portable, Simd};
use super::judge::{Accept, HITS, Hits, Judge, Scratch};
use super::levels::Level;
use super::record::Record;
use super::sort::Sorted;
use crate::Look;
use std::ops::Range;

/// Boxes whose rows are scanned before what they hit is judged.
const BATCH: usize = 64;

/// Rows that a box looks at.
const ROWS: usize = 5;

/// One more is written than is kept.
const _: () = assert!(BATCH * ROWS < HITS);

/// A run of slots that one box has still to look at.
#[derive(Clone, Copy, Default)]
struct Rest {
    query: u16,
    from: u32,
    to: u32,
}

/// The runs of a batch that are longer than a block; two for a row that wraps around.
pub(super) struct Rests {
    list: Box<[Rest; 2 * BATCH * ROWS]>,
    count: usize,
}

impl Default for Rests {
    fn default() -> Self {
        Self { list: Box::new([Rest::default(); 2 * BATCH * ROWS]), count: 0 }
    }
}

impl Rests {
    #[inline(always)]
    fn push(&mut self, rest: Rest) {
        self.list[self.count] = rest;
        self.count += 1;
    }
}

/// See [`Look`].
const EVERYWHERE: u8 = Look::Everywhere as u8;
const TRIMMED: u8 = Look::Trimmed as u8;
const SELDOM: u8 = Look::Seldom as u8;

/// Other boxes in a box's cell from which rows are trimmed.
const TRIM_FROM: f32 = 1.0;

impl Level {
    /// Which rows its boxes look at; never [`Look::Auto`].
    pub(super) fn look(&self, asked: Look) -> Look {
        match asked {
            Look::Auto if self.cells.are_spacious() => Look::Seldom,
            Look::Auto if self.crowd > TRIM_FROM => Look::Trimmed,
            Look::Auto => Look::Everywhere,
            asked => asked,
        }
    }
}

/// The search over one level.
pub(super) struct Half<'a, 'b, R, A> {
    pub(super) sorted: &'a Sorted<R>,
    pub(super) level: &'a Level,
    /// What is asked for.
    pub(super) look: Look,
    pub(super) judge: Judge<'a, R, A>,
    pub(super) scratch: &'b mut Scratch,
    pub(super) rests: &'b mut Rests,
    pub(super) checks: u64,
}

impl<R: Record, A: Accept> Half<'_, '_, R, A> {
    /// The boxes in `slots` against what comes after each; false when there is no more room.
    pub(super) fn check(&mut self, slots: Range<usize>, simd: Simd) -> bool {
        match simd {
            // SAFETY: the processor has what was detected.
            #[cfg(target_arch = "x86_64")]
            Simd::Avx2 => unsafe { self.check_avx2(slots) },
            Simd::Portable => self.check_looking::<Portable>(slots),
        }
    }

    /// # Safety
    /// The processor has what [`Simd::Avx2`] stands for.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
    unsafe fn check_avx2(&mut self, slots: Range<usize>) -> bool {
        self.check_looking::<super::codes::Avx2>(slots)
    }

    #[inline(always)]
    fn check_looking<L: Lanes>(&mut self, slots: Range<usize>) -> bool {
        match self.level.look(self.look) {
            Look::Seldom => self.check_with::<L, SELDOM>(slots),
            Look::Trimmed => self.check_with::<L, TRIMMED>(slots),
            Look::Everywhere | Look::Auto => self.check_with::<L, EVERYWHERE>(slots),
        }
    }

    #[inline(always)]
    fn check_with<L: Lanes, const LOOK: u8>(&mut self, slots: Range<usize>) -> bool {
        debug_assert!(self.level.slots.start <= slots.start && slots.end <= self.level.slots.end);
        for first in slots.clone().step_by(BATCH) {
            let batch = first..slots.end.min(first + BATCH);
            let hits = self.scan::<L, LOOK>(batch);
            if !self.settle(first, hits) || !self.scan_rests::<L>(first) {
                return false;
            }
        }
        true
    }

    /// The first block of each row of each box; returns the number of hits.
    #[inline(always)]
    fn scan<L: Lanes, const LOOK: u8>(&mut self, batch: Range<usize>) -> usize {
        let (cells, sorted) = (self.level.cells, self.sorted);
        let (base, count) = (cells.base as usize, cells.mask as usize + 1);
        let mut rows = Rows {
            starts: &sorted.starts[base..=base + count],
            codes: &sorted.codes,
            hits: &mut self.scratch.hits,
            rests: self.rests,
            kept: 0,
            checks: 0,
        };
        rows.rests.count = 0;
        for (query, slot) in batch.enumerate() {
            let (code, key) = (sorted.codes[slot], sorted.keys[slot] - cells.base);
            let span = if LOOK == EVERYWHERE { Span::WHOLE } else { cells.span(code) };
            let length = span.down_x + span.up_x + 1;
            let row = key.wrapping_sub(span.down_x);
            let layer = row.wrapping_add(cells.stride_z);
            let (next, below, above) = (
                cells.wrap(row.wrapping_add(cells.stride_y)),
                cells.wrap(layer.wrapping_sub(cells.stride_y)),
                cells.wrap(layer.wrapping_add(cells.stride_y)),
            );
            let query = Query { number: query as u16, code: as_query(code) };
            // SAFETY: keys are wrapped, slots are those of the level, and hits are enough for a batch.
            unsafe {
                // Of its own cell, what comes after the box.
                let (_, end) = rows.run(query, key, 1 + span.up_x);
                rows.test::<L>(query, (slot as u32 + 1, end));
                if LOOK == SELDOM && span.up_y + span.up_z == 0 {
                    continue;
                }
                let run = rows.run(query, next, length * span.up_y);
                rows.test::<L>(query, run);
                let run = rows.run(query, below, length * (span.up_z & span.down_y));
                rows.test::<L>(query, run);
                let run = rows.run(query, cells.wrap(layer), length * span.up_z);
                rows.test::<L>(query, run);
                let run = rows.run(query, above, length * (span.up_z & span.up_y));
                rows.test::<L>(query, run);
            }
        }
        self.checks += rows.checks;
        rows.kept
    }

    /// What is left of long runs; false when there is no more room.
    #[inline(always)]
    fn scan_rests<L: Lanes>(&mut self, first: usize) -> bool {
        let mut kept = 0;
        for i in 0..self.rests.count {
            let Rest { query, mut from, to } = self.rests.list[i];
            let code = as_query(self.sorted.codes[first + usize::from(query)]);
            while from < to {
                if kept == HITS {
                    if !self.settle(first, kept) {
                        return false;
                    }
                    kept = 0;
                }
                // SAFETY: these are slots, behind the last of which there is a block more of codes.
                let block = unsafe { L::test(code, &self.sorted.codes, from as usize) };
                let mask = block & first_bits(to - from);
                self.scratch.hits[kept] = Hits { query, mask: mask as u16, from };
                kept += usize::from(mask != 0);
                from += BLOCK as u32;
            }
        }
        self.settle(first, kept)
    }

    #[inline(never)]
    fn settle(&mut self, first: usize, count: usize) -> bool {
        let places = &self.sorted.places;
        count == 0 || self.judge.settle(self.scratch, count, |query| places[first + query])
    }
}

/// A box that looks for others.
#[derive(Clone, Copy)]
struct Query {
    /// In the batch.
    number: u16,
    code: u64,
}

/// What the scan of a batch reads and writes.
struct Rows<'a> {
    /// Of the level.
    starts: &'a [u32],
    codes: &'a [u64],
    hits: &'a mut [Hits; HITS],
    rests: &'a mut Rests,
    kept: usize,
    checks: u64,
}

impl Rows<'_> {
    /// The slots of `length` cells from key `from` on. If they wrap around, what lies behind goes to the rests.
    ///
    /// # Safety
    /// `from` is a key of the level, without its base.
    #[inline(always)]
    unsafe fn run(&mut self, query: Query, from: u32, length: u32) -> (u32, u32) {
        let count = self.starts.len() as u32 - 1;
        if from + length > count {
            return self.wrapped_run(query, from, length);
        }
        // SAFETY: both are at most the number of keys, and there is one start more.
        unsafe {
            let start = |key: u32| *self.starts.get_unchecked(key as usize);
            (start(from), start(from + length))
        }
    }

    #[cold]
    fn wrapped_run(&mut self, query: Query, from: u32, length: u32) -> (u32, u32) {
        let count = self.starts.len() - 1;
        let behind = self.starts[from as usize + length as usize - count];
        self.checks += u64::from(behind - self.starts[0]);
        self.rests.push(Rest { query: query.number, from: self.starts[0], to: behind });
        (self.starts[from as usize], self.starts[count])
    }

    /// The first block of a run.
    ///
    /// # Safety
    /// `start..end` are slots, and fewer than [`HITS`] hits are kept.
    #[inline(always)]
    unsafe fn test<L: Lanes>(&mut self, query: Query, (start, end): (u32, u32)) {
        let length = end - start;
        self.checks += u64::from(length);
        debug_assert!(self.kept < HITS);
        // SAFETY: behind the last slot there is a block more of codes, and there is room for a hit.
        let mask = unsafe {
            let mask = L::test(query.code, self.codes, start as usize) & first_bits(length);
            let hits = Hits { query: query.number, mask: mask as u16, from: start };
            *self.hits.get_unchecked_mut(self.kept) = hits;
            mask
        };
        self.kept += usize::from(mask != 0);
        if length > BLOCK as u32 {
            self.rests.push(Rest { query: query.number, from: start + BLOCK as u32, to: end });
        }
    }
}

/// As many ones, at most [`BLOCK`].
#[inline(always)]
fn first_bits(length: u32) -> u32 {
    (1 << length.min(BLOCK as u32)) - 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::crowding::Set;
    use crate::cpu::found::Found;
    use crate::cpu::judge::Accept;
    use crate::cpu::map::Map;
    use crate::cpu::record::Item;
    use crate::plan::LazySummary;
    use crate::report::StageTimes;
    use crate::{Aabb, Config, Costs, Error, Pair, Strategy, oracle};

    struct Every;

    impl Accept for Every {
        fn pair(&self, _: Pair) -> bool {
            true
        }
    }

    /// Boxes of one size at random places: two or three in a row of cells on average, or a crowd.
    fn boxes(count: usize, edge: f32, half: f32) -> Vec<Aabb> {
        let mut random = 1u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 40) as f32 / 16_777_216.0 * edge
        };
        (0..count).map(|_| Aabb::from_center([next(), next(), next()], [half; 3])).collect()
    }

    fn map_of(boxes: &[Aabb]) -> Map<Item> {
        map_by(boxes, Costs::REFERENCE)
    }

    fn map_by(boxes: &[Aabb], costs: Costs) -> Map<Item> {
        let config = Config { strategy: Strategy::Grid, costs: Some(costs), ..Config::DEFAULT };
        let mut map = Map::new();
        let summary = &LazySummary::new(boxes, None);
        let set = Set { boxes, filters: None, summary, before: &[] };
        map.plan_and_build(&set, &config, &mut StageTimes::default());
        map
    }

    fn pairs(map: &Map<Item>) -> Vec<Pair> {
        let mut found = Found::default();
        map.find(&Every, u64::MAX, &mut found).expect("no limit");
        let mut pairs: Vec<Pair> = found.chunks.concat();
        pairs.sort_unstable();
        pairs
    }

    #[test]
    fn one_buffer_gets_what_chunks_do_whoever_shares_the_search_and_its_limit() {
        let boxes = boxes(20_000, 25.0, 0.5);
        let (map, mut found, mut all) = (map_of(&boxes), Found::default(), vec![]);
        let wanted = pairs(&map);
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let mut search = |limit| pool.install(|| map.find_all(&Every, limit, &mut found, &mut all));
            assert_eq!(
                search(wanted.len() as u64 - 1),
                Err(Error::TooManyPairs { limit: wanted.len() as u64 - 1 })
            );
            assert_eq!(search(wanted.len() as u64), Ok(()));
            all.sort_unstable();
            assert!(all == wanted && found.overlaps == wanted.len() as u64 && found.len() == 0, "{threads}");
        }
    }

    #[test]
    fn whichever_rows_are_left_out_and_whatever_the_processor_the_pairs_are_the_same() {
        // Spacious cells, sparse, dense, and so full that runs are longer than all hits that are judged together.
        for (count, edge, half) in
            [(3000, 200.0, 0.5), (3000, 30.0, 0.5), (3000, 12.0, 0.5), (3000, 5.0, 0.5), (1500, 0.5, 0.5)]
        {
            let boxes = boxes(count, edge, half);
            let wanted = oracle::pairs(&boxes);
            let mut map = map_of(&boxes);
            for look in [Look::Everywhere, Look::Trimmed, Look::Seldom] {
                map.look = look;
                for simd in [Simd::Portable, Simd::detect()] {
                    map.simd = simd;
                    assert_eq!(pairs(&map), wanted, "{count} in {edge}, {look:?}, {simd:?}");
                }
            }
        }
    }

    #[test]
    fn levels_search_each_other_whatever_the_processor() {
        let mut boxes = boxes(8000, 20.0, 0.0005);
        boxes.extend(super::tests::boxes(1000, 100.0, 5.0));
        let wanted = oracle::pairs(&boxes);
        let mut map = map_by(&boxes, Costs { visit: 1.0, visited: 0.1, ..Costs::REFERENCE });
        assert!(map.levels.len() > 1, "{} levels", map.levels.len());
        for simd in [Simd::Portable, Simd::detect()] {
            map.simd = simd;
            assert_eq!(pairs(&map), wanted, "{simd:?}");
        }
    }

    #[test]
    fn rows_that_wrap_around_are_searched_to_their_end() {
        // One row of boxes along each axis in turn, far longer than a level has cells on it.
        for axis in 0..3 {
            let at = |i: u32| std::array::from_fn(|k| if k == axis { i as f32 * 0.9 } else { 0.0 });
            let boxes: Vec<Aabb> = (0..3000).map(|i| Aabb::from_center(at(i), [0.5; 3])).collect();
            assert_eq!(pairs(&map_of(&boxes)).len(), 2999, "axis {axis}");
        }
    }
}
