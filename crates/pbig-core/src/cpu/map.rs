//! Map: boxes into cells. One entry a box, sorted by the cell of its lower corner.

use super::cells::{Cells, Span};
use super::crowding::{Crowding, Set};
use super::entries::{Entries, Stored};
use crate::Aabb;
use crate::plan::{Camps, LevelPlan, OPEN, OccupiedCell, Plan, size_class_of};
use std::ops::Range;

/// The boxes of one level, sorted by cell.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub(crate) cells: Cells,
    /// First entry of each cell. [`GHOSTS`] more continue beyond the last cell, see `haunt`.
    pub(crate) starts: Vec<u32>,
    /// The boxes; behind them, copies of those of the first cells.
    pub(crate) entries: Entries,
    /// By entry: the key of its cell, and its window.
    pub(crate) keys: Vec<u32>,
    pub(crate) spans: Vec<Span>,
    /// Boxes of one camp other than [`OPEN`] never pair with each other.
    pub(crate) camp: u8,
    /// Other boxes in a box's cell, on average over boxes.
    pub(super) crowd: f32,
}

/// Cells that are repeated behind the last one, so that a row of a window that wraps around is still
/// one run of entries: a row has three cells.
pub(crate) const GHOSTS: usize = 4;

/// Entries behind the last ghost, so that a block of [`super::half::BLOCK`] may be read anywhere.
pub(crate) const PADDING: usize = 8;

impl Grid {
    fn new(level: &LevelPlan) -> Self {
        Self {
            cells: Cells::new(level),
            starts: Vec::new(),
            entries: Entries::default(),
            keys: Vec::new(),
            spans: Vec::new(),
            camp: level.camp,
            crowd: 0.0,
        }
    }

    /// How many boxes there are, without copies.
    pub(crate) fn len(&self) -> usize {
        self.keys.len()
    }

    /// How many cells there are, without ghosts.
    pub(crate) fn cell_count(&self) -> u32 {
        (self.starts.len() - 1 - GHOSTS) as u32
    }

    /// Counting sort of `members` by cell (PBIG 4.2: count, scan, scatter), stable, in two passes:
    /// into buckets of consecutive cells, then each bucket, which fits a cache. In one pass the
    /// scatter misses the cache with every box: 112 to 126 ms for a million, against 43 to 51.
    fn build(&mut self, level: &LevelPlan, boxes: &[Aabb], members: &[u32], sort: &mut Sort) {
        self.cells = Cells::new(level);
        self.camp = level.camp;
        sort.place(&self.cells, boxes, members);
        let shift = sort.distribute(level.cells, boxes, members);
        self.starts.clear();
        self.starts.resize(level.cells as usize + 1 + GHOSTS, 0);
        self.entries.resize(members.len());
        self.keys.resize(members.len(), 0);
        self.spans.resize(members.len(), Span::default());
        let mut squares = 0;
        for (bucket, range) in sort.buckets().enumerate() {
            let first = (bucket as u32) << shift;
            let last = (first + (1 << shift)).min(level.cells);
            squares += self.fill(first..last, range.start, &sort.items[range]);
        }
        self.crowd = (squares as f64 / members.len().max(1) as f64) as f32 - 1.0;
        self.haunt();
    }

    /// Sorts a bucket, whose entries begin at `base`, into its cells; returns the sum of the squares
    /// of their counts.
    fn fill(&mut self, cells: Range<u32>, base: usize, bucket: &[Item]) -> u64 {
        // One cell further on: the cursor of a cell ends where the next one begins.
        let cursors = &mut self.starts[cells.start as usize + 1..=cells.end as usize];
        for item in bucket {
            cursors[(item.key - cells.start) as usize] += 1;
        }
        let (mut next, mut squares) = (base as u32, 0);
        for cursor in cursors.iter_mut() {
            let count = *cursor;
            squares += u64::from(count) * u64::from(count);
            *cursor = next;
            next += count;
        }
        for item in bucket {
            let cursor = &mut cursors[(item.key - cells.start) as usize];
            let place = *cursor as usize;
            *cursor += 1;
            self.entries.boxes[place] = Stored::new(&item.aabb);
            self.entries.ids[place] = item.id;
            self.keys[place] = item.key;
            self.spans[place] = item.span;
        }
        squares
    }

    /// Copies the first cells behind the last.
    fn haunt(&mut self) {
        let (cells, n) = (self.cell_count() as usize, self.len() as u32);
        for ghost in 0..=GHOSTS {
            self.starts[cells + ghost] = n + self.starts[ghost];
        }
        let copies = self.starts[GHOSTS] as usize;
        self.entries.extend_from_within(copies);
        self.entries.resize(n as usize + copies + PADDING);
    }
}

/// A box on its way into a grid. It travels whole: to fetch it by id in the second pass would miss
/// the cache with every box (60 ns each at a million, two thirds of the whole sort).
#[derive(Clone, Copy, Debug)]
struct Item {
    aabb: Aabb,
    id: u32,
    key: u32,
    span: Span,
}

/// The first pass of the sort, with its buffers.
#[derive(Clone, Debug, Default)]
struct Sort {
    /// By member: the key of its cell, and its window.
    placed: Vec<(u32, Span)>,
    /// The members by bucket.
    items: Vec<Item>,
    /// End of each bucket in `items`.
    ends: Vec<u32>,
}

impl Sort {
    /// Boxes of a bucket: with its cells about 100 KB, a share of a second-level cache.
    const BUCKET: usize = 2048;

    /// Most buckets: each is a stream of writes, and the first-level cache has 512 lines.
    const MOST: usize = 512;

    /// Where each box goes; cells are computed here and nowhere else.
    fn place(&mut self, cells: &Cells, boxes: &[Aabb], members: &[u32]) {
        self.placed.clear();
        self.placed.extend(members.iter().map(|&id| cells.place(&boxes[id as usize])));
    }

    /// Into buckets of `2^shift` cells each; returns the shift.
    fn distribute(&mut self, cells: u32, boxes: &[Aabb], members: &[u32]) -> u32 {
        let buckets = (members.len() / Self::BUCKET).next_power_of_two().min(Self::MOST) as u32;
        let shift = (cells / buckets.min(cells)).trailing_zeros();
        self.ends.clear();
        self.ends.resize(buckets as usize, 0);
        for (key, _) in &self.placed {
            self.ends[(key >> shift) as usize] += 1;
        }
        let mut sum = 0;
        for end in &mut self.ends {
            // The start for now; it moves to the end as the bucket fills.
            sum += std::mem::replace(end, sum);
        }
        let empty = Item { aabb: Aabb::NOWHERE, id: 0, key: 0, span: Span::default() };
        self.items.resize(members.len(), empty);
        for (&id, &(key, span)) in members.iter().zip(&self.placed) {
            let cursor = &mut self.ends[(key >> shift) as usize];
            self.items[*cursor as usize] = Item { aabb: boxes[id as usize], id, key, span };
            *cursor += 1;
        }
        shift
    }

    fn buckets(&self) -> impl Iterator<Item = Range<usize>> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| start as usize..end as usize)
    }
}

/// A set of boxes, ready to be searched: grids by level, and the boxes that fit none of them.
#[derive(Clone, Debug)]
pub(crate) struct Map {
    pub(crate) grids: Vec<Grid>,
    /// Boxes tested against everything.
    pub(crate) list: Entries,
    /// Scratch: ids of the boxes of a level, and where they go.
    members: Vec<Vec<u32>>,
    sort: Sort,
    pub(super) crowding: Crowding,
    pub(super) camps: Camps,
    /// Of the boxes of the set, in their order; empty without camps.
    pub(super) camp_of: Vec<u8>,
    /// How often boxes were sorted.
    #[cfg(test)]
    pub(super) builds: usize,
}

impl Map {
    pub(crate) fn new() -> Self {
        Self {
            grids: vec![],
            list: Entries::default(),
            members: vec![],
            sort: Sort::default(),
            crowding: Crowding::default(),
            camps: Camps::default(),
            camp_of: vec![],
            #[cfg(test)]
            builds: 0,
        }
    }

    /// Sorts the valid boxes of the set as planned.
    pub(super) fn build(&mut self, plan: &Plan, set: &Set<'_>) {
        #[cfg(test)]
        {
            self.builds += 1;
        }
        self.distribute(plan, set);
        self.grids.truncate(plan.levels.len());
        for (i, level) in plan.levels.iter().enumerate() {
            if self.grids.len() == i {
                self.grids.push(Grid::new(level));
            }
            self.grids[i].build(level, set.boxes, &self.members[i], &mut self.sort);
        }
    }

    /// Ids by level, and the rest as entries of the list.
    fn distribute(&mut self, plan: &Plan, set: &Set<'_>) {
        let levels: Vec<LevelOfClass> =
            (0..self.camps.count()).map(|camp| LevelOfClass::new(plan, camp as u8)).collect();
        self.list.clear();
        self.members.resize(plan.levels.len().max(self.members.len()), Vec::new());
        self.members.iter_mut().for_each(Vec::clear);
        for (i, id) in set.ids().enumerate() {
            let aabb = set.boxes[id as usize];
            if aabb.is_valid() {
                let camp = self.camp_of.get(i).copied().unwrap_or(OPEN);
                match levels[camp as usize].of(&aabb) {
                    Some(level) => self.members[level].push(id),
                    None => self.list.push(&aabb, id),
                }
            }
        }
    }

    /// The occupied cells, with the boxes that `counts` takes.
    pub(crate) fn cells(&self, counts: impl Fn(u32) -> bool, out: &mut Vec<OccupiedCell>) {
        for (level, grid) in self.grids.iter().enumerate() {
            let entries = &grid.entries;
            let taken = (0..grid.len()).filter(|&i| counts(entries.ids[i]));
            let place = |i: usize| (grid.cells.bounds(&entries.boxes[i].aabb()), entries.ids[i]);
            let mut placed: Vec<_> = taken.map(place).collect();
            placed.sort_by_key(|((cell, _), id)| (*cell, *id));
            for cell in placed.chunk_by(|a, b| a.0.0 == b.0.0) {
                let ids = cell.iter().map(|(_, id)| *id).collect();
                out.push(OccupiedCell { level: level as u32, aabb: cell[0].0.1, ids });
            }
        }
    }

    /// All entries, grid by grid, smallest boxes first; without the list.
    pub(crate) fn len_in_grids(&self) -> usize {
        self.grids.iter().map(|g| g.len()).sum()
    }
}

/// Which level a box belongs to.
struct LevelOfClass([u8; 256]);

impl LevelOfClass {
    const LIST: u8 = u8::MAX;

    fn new(plan: &Plan, camp: u8) -> Self {
        let mut table = [Self::LIST; 256];
        for (i, level) in plan.levels.iter().enumerate().filter(|(_, level)| level.camp == camp) {
            table[level.classes.0 as usize..=level.classes.1 as usize].fill(i as u8);
        }
        Self(table)
    }

    #[inline]
    fn of(&self, one: &Aabb) -> Option<usize> {
        let level = self.0[size_class_of(one)];
        (level != Self::LIST).then_some(level as usize)
    }
}
