//! The half neighbourhood: all pairs within one grid, each from one of its boxes.
//!
//! Branches are what costs here: whether a row of the window is needed, how many boxes it holds, and
//! which of them overlap are coin tosses. So a box always looks at the same five rows (the rest of
//! its own, the next one, and three in the next layer), each a run of entries that is empty when
//! not needed; the first block of each is tested whether or not there is anything in it, and masks
//! are appended without a branch, to be expanded later. On unit cubes at density 1/4 that takes the
//! search from 66 ns a box (the rows that are needed, a loop each) to 35.

use super::entries::Query;
use super::find::Room;
use super::map::{GHOSTS, Grid, PADDING};
use crate::Pair;
use std::ops::Range;

/// Candidates tested at once.
const BLOCK: usize = 4;

/// Tested blocks with hits that are kept before they are expanded.
const KEPT: usize = 1024;

/// Rows that a box looks at; each may keep a block.
const ROWS: usize = 5;

/// A block may read beyond the last entry, and a row of three cells beyond the last cell.
const _: () = assert!(PADDING >= BLOCK && GHOSTS >= 3);

/// A block with hits: entry `i`, candidates from `j` on, a bit for each.
#[derive(Clone, Copy, Default)]
struct Hits {
    i: u32,
    j: u32,
    mask: u32,
}

/// The search over one grid.
pub(crate) struct Half<'a, A> {
    grid: &'a Grid,
    accept: &'a A,
    out: &'a mut Vec<Pair>,
    room: &'a Room,
    taken: usize,
    pub(crate) checks: u64,
    pub(crate) overlaps: u64,
    hits: Box<[Hits; KEPT]>,
    kept: usize,
}

impl<'a, A: Fn(u32, u32) -> bool> Half<'a, A> {
    pub(crate) fn new(grid: &'a Grid, accept: &'a A, out: &'a mut Vec<Pair>, room: &'a Room) -> Self {
        let hits = Box::new([Hits::default(); KEPT]);
        Self { grid, accept, out, room, taken: 0, checks: 0, overlaps: 0, hits, kept: 0 }
    }

    /// Entries `range` against what comes after each; false when there is no more room.
    pub(crate) fn check(&mut self, range: Range<usize>) -> bool {
        for i in range {
            self.check_one(i);
            if self.kept > KEPT - ROWS {
                self.expand();
            }
            // Here, not after expanding: a long row has expanded its blocks itself.
            if !self.room.take(self.out.len(), &mut self.taken) {
                return false;
            }
        }
        self.expand();
        true
    }

    #[inline(always)]
    fn check_one(&mut self, i: usize) {
        let (grid, key) = (self.grid, self.grid.keys[i]);
        let (span, cells) = (grid.spans[i], &grid.cells);
        let query = grid.entries.boxes[i].query();
        let own_end = grid.starts[(key + 1 + span.up_x()) as usize];
        self.test(i, &query, i as u32 + 1, own_end);
        let row = key.wrapping_sub(span.down_x());
        let layer = row.wrapping_add(cells.stride_z);
        let length = span.down_x() + span.up_x() + 1;
        let (up_y, up_z) = (span.up_y(), span.up_z());
        for (from, needed) in [
            (row.wrapping_add(cells.stride_y), up_y),
            (layer.wrapping_sub(cells.stride_y), up_z & span.down_y()),
            (layer, up_z),
            (layer.wrapping_add(cells.stride_y), up_z & up_y),
        ] {
            let from = cells.wrap(from);
            let end = from + length * needed;
            self.test(i, &query, grid.starts[from as usize], grid.starts[end as usize]);
        }
    }

    /// Entry `i` against the entries `start..end`, which may lie behind the last entry, among the
    /// copies of the first ones.
    #[inline(always)]
    fn test(&mut self, i: usize, query: &Query, start: u32, end: u32) {
        let length = end - start;
        self.checks += u64::from(length);
        self.test_block(i, query, start, length);
        if length > BLOCK as u32 {
            self.test_long(i, query, start + BLOCK as u32, length - BLOCK as u32);
        }
    }

    #[inline(always)]
    fn test_block(&mut self, i: usize, query: &Query, start: u32, length: u32) {
        let block = &self.grid.entries.boxes[start as usize..start as usize + BLOCK];
        let mut mask = 0;
        for (bit, candidate) in block.iter().enumerate() {
            mask |= u32::from(candidate.overlaps(query)) << bit;
        }
        mask &= (1 << length.min(BLOCK as u32)) - 1;
        self.hits[self.kept] = Hits { i: i as u32, j: start, mask };
        self.kept += usize::from(mask != 0);
    }

    #[inline(never)]
    fn test_long(&mut self, i: usize, query: &Query, start: u32, length: u32) {
        for done in (0..length).step_by(BLOCK) {
            // Before, not after: the entry's last row may have used up what was left.
            if self.kept > KEPT - 2 * ROWS {
                self.expand();
            }
            self.test_block(i, query, start + done, length - done);
        }
    }

    /// Kept blocks into pairs.
    fn expand(&mut self) {
        let ids = &self.grid.entries.ids;
        for hits in &self.hits[..self.kept] {
            let id = ids[hits.i as usize];
            let mut mask = hits.mask;
            self.overlaps += u64::from(mask.count_ones());
            while mask != 0 {
                let other = ids[(hits.j + mask.trailing_zeros()) as usize];
                mask &= mask - 1;
                if (self.accept)(id, other) {
                    self.out.push(Pair::new(id, other));
                }
            }
        }
        self.kept = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::crowding::Set;
    use crate::cpu::map::Map;
    use crate::plan::Summary;
    use crate::report::StageTimes;
    use crate::{Aabb, Config, Strategy, oracle};

    /// Two or three boxes in a row of cells on average, in some rows many: whatever an entry may meet.
    fn crowd() -> Vec<Aabb> {
        let mut random = 1u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 40) as f32 / 16_777_216.0 * 12.0
        };
        (0..3000).map(|_| Aabb::from_center([next(), next(), next()], [0.5; 3])).collect()
    }

    #[test]
    fn kept_blocks_have_room_whatever_rows_an_entry_has() {
        let boxes = crowd();
        let config = Config { strategy: Strategy::Grid, ..Config::DEFAULT };
        let mut map = Map::new();
        let summary = &Summary::of(&boxes, None);
        let set = Set { boxes: &boxes, filters: None, ids: None, summary };
        map.plan_and_build(&set, &config, &mut StageTimes::default());
        let (mut out, room) = (Vec::new(), Room::new(u64::MAX));
        let mut half = Half::new(&map.grids[0], &|_, _| true, &mut out, &room);
        for i in 0..boxes.len() {
            // As many blocks as may be left over when an entry begins, none with a hit.
            half.hits.fill(Hits::default());
            half.kept = KEPT - ROWS;
            half.check(i..i + 1);
        }
        assert_eq!(out.len(), oracle::pairs(&boxes).len());
    }
}
