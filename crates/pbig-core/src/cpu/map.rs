//! Map: boxes into cells. One entry a box, sorted by the cell of its lower corner.

use super::cells::{Cells, Span};
use super::entries::{Entries, Stored};
use crate::plan::{LevelPlan, OccupiedCell, Plan, Summary, size_class_of};
use crate::report::{StageTimes, lap, stage};
use crate::{Aabb, Config};
use std::ops::Range;
use std::time::Instant;

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
    /// Other boxes in a box's cell, on average over boxes.
    crowd: f32,
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
    crowding: Crowding,
    /// How often boxes were sorted.
    #[cfg(test)]
    builds: usize,
}

/// Cells smaller than an even spread of boxes would ask for, where clusters make them too full.
/// Kept from one build to the next.
#[derive(Clone, Copy, Debug)]
struct Crowding {
    /// Factor on the cell size.
    factor: f32,
    /// How full cells are where smaller ones did not help: identical boxes, say.
    accepted: f32,
}

/// Other entries in a box's cell, on average over boxes, at which smaller cells are tried. An even
/// spread has half a one. Doubling a cell gathers eight times as many boxes, so that cells grow
/// again only when they are certain to stay below: the choice does not flap.
const CROWDED: f32 = 12.0;

/// Where dividing the cells ends.
const FINEST: f32 = 1e-12;

impl Map {
    pub(crate) fn new() -> Self {
        Self {
            grids: vec![],
            list: Entries::default(),
            members: vec![],
            sort: Sort::default(),
            crowding: Crowding { factor: 1.0, accepted: 0.0 },
            #[cfg(test)]
            builds: 0,
        }
    }

    /// Plans and sorts; again with smaller cells where clusters make them too full.
    pub(crate) fn plan_and_build(
        &mut self,
        summary: &Summary,
        config: &Config,
        boxes: &[Aabb],
        ids: Option<&[u32]>,
        times: &mut StageTimes,
    ) -> Plan {
        let mut build = |map: &mut Self| {
            let mut clock = Instant::now();
            let plan = {
                stage!("plan");
                Plan::new(summary, config, map.crowding.factor)
            };
            times.plan += lap(&mut clock);
            stage!("map");
            map.build(&plan, boxes, ids);
            times.map += lap(&mut clock);
            plan
        };
        let mut tried: Vec<(f32, f32)> = Vec::new();
        loop {
            let plan = build(self);
            let crowd = self.crowd();
            tried.push((self.crowding.factor, crowd));
            let limit = CROWDED.max(1.5 * self.crowding.accepted);
            if crowd > limit && divisible(&plan) && self.crowding.factor > FINEST {
                // The first halvings of two far clusters change nothing: take larger steps then.
                let helps = tried.len() < 2 || crowd < 0.8 * tried[tried.len() - 2].1;
                self.crowding.factor *= if helps { 0.5 } else { 0.125 };
                continue;
            }
            if self.crowding.settle(&tried) {
                return build(self);
            }
            return plan;
        }
    }

    /// How full the fullest level is.
    fn crowd(&self) -> f32 {
        self.grids.iter().map(|grid| grid.crowd).fold(0.0, f32::max)
    }

    /// Sorts the valid boxes among `boxes` (or among those with the given ids) as planned.
    fn build(&mut self, plan: &Plan, boxes: &[Aabb], ids: Option<&[u32]>) {
        #[cfg(test)]
        {
            self.builds += 1;
        }
        self.distribute(plan, boxes, ids);
        self.grids.truncate(plan.levels.len());
        for (i, level) in plan.levels.iter().enumerate() {
            if self.grids.len() == i {
                self.grids.push(Grid::new(level));
            }
            self.grids[i].build(level, boxes, &self.members[i], &mut self.sort);
        }
    }

    /// Ids by level, and the rest as entries of the list.
    fn distribute(&mut self, plan: &Plan, boxes: &[Aabb], ids: Option<&[u32]>) {
        let levels = LevelOfClass::new(plan);
        self.list.clear();
        self.members.resize(plan.levels.len().max(self.members.len()), Vec::new());
        self.members.iter_mut().for_each(Vec::clear);
        let mut put = |id: u32| {
            let aabb = boxes[id as usize];
            if aabb.is_valid() {
                match levels.of(&aabb) {
                    Some(level) => self.members[level].push(id),
                    None => self.list.push(&aabb, id),
                }
            }
        };
        match ids {
            Some(ids) => ids.iter().for_each(|&id| put(id)),
            None => (0..boxes.len() as u32).for_each(put),
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

/// Whether smaller cells would still hold the largest box of a level.
fn divisible(plan: &Plan) -> bool {
    plan.levels.iter().any(|level| (0..3).any(|k| level.cell[k] > 1.5 * level.max_extent[k]))
}

impl Crowding {
    /// Settles on one of the factors tried in a call, with the crowd that each led to, for the calls
    /// to come; true when it is not the last one, so that the map has to be built again.
    fn settle(&mut self, tried: &[(f32, f32)]) -> bool {
        let last = tried.len() - 1;
        let least = tried.iter().map(|t| t.1).fold(f32::INFINITY, f32::min);
        if tried[last].1 <= CROWDED {
            self.accepted = 0.0;
            if 8.0 * (least + 1.0) <= CROWDED {
                self.factor = (self.factor * 2.0).min(1.0);
            }
            return false;
        }
        // Smaller cells that are as full are of no use: the largest that are no fuller.
        let best = tried.iter().position(|t| t.1 <= 1.1 * least).unwrap_or(last);
        (self.factor, self.accepted) = tried[best];
        best != last
    }
}

/// Which level a box belongs to.
struct LevelOfClass([u8; 256]);

impl LevelOfClass {
    const LIST: u8 = u8::MAX;

    fn new(plan: &Plan) -> Self {
        let mut table = [Self::LIST; 256];
        for (i, level) in plan.levels.iter().enumerate() {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Builds in one call: how often the boxes were sorted.
    fn builds(map: &mut Map, boxes: &[Aabb]) -> usize {
        let summary = Summary::of(boxes, None);
        let before = map.builds;
        map.plan_and_build(&summary, &Config::DEFAULT, boxes, None, &mut StageTimes::default());
        map.builds - before
    }

    fn lattice(side: usize, step: f32, half: f32, at: f32) -> Vec<Aabb> {
        let corner = |i: usize| [i % side, i / side % side, i / side / side].map(|c| c as f32 * step + at);
        (0..side.pow(3)).map(|i| Aabb::from_center(corner(i), [half; 3])).collect()
    }

    #[test]
    fn cells_that_were_divided_for_clusters_stay_so() {
        for apart in [3e3, 1e4, 1e5, 1e7] {
            let mut boxes = lattice(12, 1.02, 0.5, 0.0);
            boxes.extend(lattice(12, 1.02, 0.5, apart));
            let mut map = Map::new();
            let calls: Vec<usize> = (0..5).map(|_| builds(&mut map, &boxes)).collect();
            assert!(calls[0] > 1 && calls[0] < 16, "{apart}: {calls:?}");
            assert_eq!(calls[1..], [1; 4], "{apart}");
        }
    }

    #[test]
    fn boxes_that_no_cell_can_part_do_not_ruin_the_cells_of_the_others() {
        let mut boxes = lattice(20, 1.0, 0.0, 0.0);
        boxes.extend(vec![Aabb::from_center([5.5; 3], [0.0; 3]); 2000]);
        let mut map = Map::new();
        let calls: Vec<usize> = (0..4).map(|_| builds(&mut map, &boxes)).collect();
        assert_eq!(calls[1..], [1; 3], "{calls:?}");
        assert!(map.crowding.factor > 0.2, "{:?}", map.crowding);
        let even = lattice(20, 1.0, 0.3, 0.0);
        for _ in 0..8 {
            builds(&mut map, &even);
        }
        assert_eq!(map.crowding.factor, 1.0, "an even world gets its cells back");
    }
}
