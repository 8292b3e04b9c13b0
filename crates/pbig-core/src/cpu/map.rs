//! Map: boxes into cells. One entry a box, sorted by the cell of its lower corner.
//!
//! The grid has no bounds (contract 4). A cell is three integers `x, y, z`; its *key* is
//! `(x + y * dims.x + z * dims.x * dims.y) mod M`, `M` a power of two. Neighbours in x are
//! neighbours in memory, a row of a window is one run of entries, and what lies outside the planned
//! range wraps onto other cells, which costs tests but never a pair:
//!
//! * A box is stored once, so no pair is found in two cells.
//! * Two cells of a window never share a key: `dims.x >= 8`, `dims.y >= 8`, `M >= 8 dims.x dims.y`,
//!   and windows reach at most 3 cells to each side (or are checked against `dims`). So a pair is
//!   met at most once from each of its boxes, and from exactly one of them, because the half
//!   neighbourhood and its mirror image share no key either.
//! * Cells are computed by a monotone function of the coordinate, and a window is computed from
//!   coordinates that bound those of every overlapping box: whatever the rounding, it is inside.

use crate::plan::{LevelPlan, Plan, Summary, size_class_of};
use crate::report::{StageTimes, lap};
use crate::{Aabb, Config};
use std::time::Instant;

/// A box as stored: `[min, -max]` and two lanes that always pass, so that whether it overlaps a
/// [`Query`] is one comparison of eight lanes, which compilers turn into two or one instructions
/// (4 ns a test as a branch-free chain of six comparisons, 1.5 so).
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stored([f32; 8]);

/// A box as it is compared with stored ones: `[max, -min]` and the two lanes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Query([f32; 8]);

impl Stored {
    const EMPTY: Self = Self([f32::INFINITY; 8]);

    #[inline(always)]
    pub(crate) fn new(b: &Aabb) -> Self {
        let pass = f32::NEG_INFINITY;
        Self([b.min[0], b.min[1], b.min[2], -b.max[0], -b.max[1], -b.max[2], pass, pass])
    }

    pub(crate) fn aabb(&self) -> Aabb {
        let [a, b, c, d, e, f, ..] = self.0;
        Aabb::new([a, b, c], [-d, -e, -f])
    }

    /// The stored box as a query.
    #[inline(always)]
    pub(crate) fn query(&self) -> Query {
        let [a, b, c, d, e, f, ..] = self.0;
        Query([-d, -e, -f, -a, -b, -c, 0.0, 0.0])
    }

    /// `min <= query.max` and `-max <= -query.min` on all axes: equation 1.
    #[inline(always)]
    pub(crate) fn overlaps(&self, query: &Query) -> bool {
        let mut all = true;
        for (stored, query) in self.0.iter().zip(&query.0) {
            all &= stored <= query;
        }
        all
    }
}

impl Query {
    #[inline(always)]
    pub(crate) fn new(b: &Aabb) -> Self {
        Stored::new(b).query()
    }
}

/// Stored boxes and their ids, side by side: ids are read for the few that overlap.
#[derive(Clone, Debug, Default)]
pub(crate) struct Entries {
    pub(crate) boxes: Vec<Stored>,
    pub(crate) ids: Vec<u32>,
}

impl Entries {
    pub(crate) fn len(&self) -> usize {
        self.ids.len()
    }

    pub(crate) fn clear(&mut self) {
        self.boxes.clear();
        self.ids.clear();
    }

    pub(crate) fn push(&mut self, aabb: &Aabb, id: u32) {
        self.boxes.push(Stored::new(aabb));
        self.ids.push(id);
    }

    fn resize(&mut self, len: usize) {
        self.boxes.resize(len, Stored::EMPTY);
        self.ids.resize(len, 0);
    }
}

/// From coordinates to cells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cells {
    origin: [f32; 3],
    inverse: [f32; 3],
    pub(crate) dims: [u32; 3],
    pub(crate) stride_y: u32,
    pub(crate) stride_z: u32,
    mask: u32,
}

/// Cells beyond this distance from the origin share the last one. Up to here rounding moves a
/// coordinate by at most an eighth of a cell, which keeps windows within 3 cells.
const FARTHEST: f32 = (1 << 20) as f32;

impl Cells {
    fn new(level: &LevelPlan) -> Self {
        let [x, y, _] = level.dims;
        Self {
            origin: level.origin,
            inverse: level.cell.map(|c| 1.0 / c),
            dims: level.dims,
            stride_y: x,
            stride_z: x * y,
            mask: level.cells - 1,
        }
    }

    /// The cell of coordinate `x` on axis `k`: monotone in `x`, all that correctness asks of it.
    #[inline(always)]
    fn coordinate(&self, k: usize, x: f32) -> i32 {
        ((x - self.origin[k]) * self.inverse[k]).clamp(-FARTHEST, FARTHEST) as i32
    }

    #[inline(always)]
    pub(crate) fn cell(&self, point: &[f32; 3]) -> [i32; 3] {
        [self.coordinate(0, point[0]), self.coordinate(1, point[1]), self.coordinate(2, point[2])]
    }

    #[inline(always)]
    pub(crate) fn key(&self, cell: [i32; 3]) -> u32 {
        let y = (cell[1] as u32).wrapping_mul(self.stride_y);
        let z = (cell[2] as u32).wrapping_mul(self.stride_z);
        self.wrap((cell[0] as u32).wrapping_add(y).wrapping_add(z))
    }

    #[inline(always)]
    pub(crate) fn wrap(&self, key: u32) -> u32 {
        key & self.mask
    }
}

/// How far a box's window reaches from the cell of its lower corner, computed once (contract 3):
/// to the cell of its upper corner, and down to where the lower corner of the largest box of the
/// level could lie. The half neighbourhood needs no lower z.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Span(u16);

impl Span {
    #[inline(always)]
    fn new(down: [i32; 2], up: [i32; 3]) -> Self {
        let fields = [down[0], down[1], up[0], up[1], up[2]];
        debug_assert!(fields.iter().all(|f| (0..4).contains(f)), "window wider than 3 cells");
        Self(fields.iter().enumerate().fold(0, |bits, (i, &f)| bits | ((f & 3) as u16) << (2 * i)))
    }

    #[inline(always)]
    fn field(self, i: u32) -> u32 {
        u32::from(self.0 >> (2 * i) & 3)
    }

    pub(crate) fn down_x(self) -> u32 {
        self.field(0)
    }

    pub(crate) fn down_y(self) -> u32 {
        self.field(1)
    }

    pub(crate) fn up_x(self) -> u32 {
        self.field(2)
    }

    pub(crate) fn up_y(self) -> u32 {
        self.field(3)
    }

    pub(crate) fn up_z(self) -> u32 {
        self.field(4)
    }
}

/// The boxes of one level, sorted by cell.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub(crate) cells: Cells,
    pub(crate) max_extent: [f32; 3],
    /// First entry of each cell; one more at the end.
    pub(crate) starts: Vec<u32>,
    pub(crate) entries: Entries,
    /// By entry: the key of its cell, and its window.
    pub(crate) keys: Vec<u32>,
    pub(crate) spans: Vec<Span>,
    /// Entries that share their cell with another, counted twice a pair, per entry: how full cells
    /// are where boxes are.
    pub(crate) crowd: f32,
}

impl Grid {
    pub(crate) fn new(level: &LevelPlan) -> Self {
        Self {
            cells: Cells::new(level),
            max_extent: level.max_extent,
            starts: Vec::new(),
            entries: Entries::default(),
            keys: Vec::new(),
            spans: Vec::new(),
            crowd: 0.0,
        }
    }

    /// Counting sort of `members` by cell (PBIG 4.2: count, scan, scatter), stable.
    fn build(&mut self, level: &LevelPlan, boxes: &[Aabb], members: &[u32], keys: &mut Vec<u32>) {
        self.cells = Cells::new(level);
        self.max_extent = level.max_extent;
        self.count(level.cells as usize, boxes, members, keys);
        self.scan();
        self.scatter(boxes, members, keys);
    }

    fn count(&mut self, cells: usize, boxes: &[Aabb], members: &[u32], keys: &mut Vec<u32>) {
        self.starts.clear();
        self.starts.resize(cells + 1, 0);
        keys.clear();
        keys.extend(members.iter().map(|&id| {
            let key = self.cells.key(self.cells.cell(&boxes[id as usize].min));
            self.starts[key as usize] += 1;
            key
        }));
    }

    /// Counts to ends (exclusive prefix sums follow from the scatter, which counts down).
    fn scan(&mut self) {
        let (mut sum, mut squares) = (0u32, 0u64);
        for start in &mut self.starts {
            squares += u64::from(*start) * u64::from(*start);
            sum += *start;
            *start = sum;
        }
        self.crowd = (squares as f64 / f64::from(sum.max(1))) as f32 - 1.0;
    }

    fn scatter(&mut self, boxes: &[Aabb], members: &[u32], keys: &[u32]) {
        self.entries.resize(members.len());
        self.keys.resize(members.len(), 0);
        self.spans.resize(members.len(), Span::default());
        // Backwards, so that equal keys keep the order of their ids.
        for (&id, &key) in members.iter().zip(keys).rev() {
            let start = &mut self.starts[key as usize];
            *start -= 1;
            let place = *start as usize;
            let aabb = boxes[id as usize];
            self.entries.boxes[place] = Stored::new(&aabb);
            self.entries.ids[place] = id;
            self.keys[place] = key;
            self.spans[place] = self.span(&aabb);
        }
    }

    #[inline(always)]
    fn span(&self, one: &Aabb) -> Span {
        let cell = self.cells.cell(&one.min);
        let up = self.cells.cell(&one.max);
        let down = |k: usize| cell[k] - self.cells.coordinate(k, one.min[k] - self.max_extent[k]);
        Span::new([down(0), down(1)], std::array::from_fn(|k| up[k] - cell[k]))
    }

    /// The cells in which the lower corner of a box that overlaps `one` can lie.
    #[inline(always)]
    pub(crate) fn window(&self, one: &Aabb) -> ([i32; 3], [i32; 3]) {
        let low = std::array::from_fn(|k| self.cells.coordinate(k, one.min[k] - self.max_extent[k]));
        (low, self.cells.cell(&one.max))
    }
}

/// A set of boxes, ready to be searched: grids by level, and the boxes that fit none of them.
#[derive(Clone, Debug)]
pub(crate) struct Map {
    pub(crate) grids: Vec<Grid>,
    /// Boxes tested against everything.
    pub(crate) list: Entries,
    /// Scratch: ids of the boxes of a level, and their keys.
    members: Vec<Vec<u32>>,
    keys: Vec<u32>,
    /// Factor on the cell size: below 1 where clusters fill the cells that an even spread would
    /// leave half empty. Kept from one build to the next.
    crowding: f32,
}

/// Other entries in a box's cell, on average, at which finer cells are tried. An even spread has
/// half a one. Relaxed again below a sixteenth of it, so that the choice does not flap.
const CROWDED: f32 = 6.0;

impl Map {
    pub(crate) fn new() -> Self {
        Self { grids: vec![], list: Entries::default(), members: vec![], keys: vec![], crowding: 1.0 }
    }

    /// Plans and sorts; again with finer cells where clusters make them too full.
    pub(crate) fn plan_and_build(
        &mut self,
        summary: &Summary,
        config: &Config,
        boxes: &[Aabb],
        ids: Option<&[u32]>,
        times: &mut StageTimes,
    ) -> Plan {
        loop {
            let mut clock = Instant::now();
            let plan = Plan::new(summary, config, self.crowding);
            times.plan += lap(&mut clock);
            self.build(&plan, boxes, ids);
            times.map += lap(&mut clock);
            match self.finer(&plan) {
                Some(crowding) => self.crowding = crowding,
                None => {
                    self.relax();
                    return plan;
                }
            }
        }
    }

    fn relax(&mut self) {
        let worst = self.grids.iter().map(|g| g.crowd).fold(0.0, f32::max);
        if worst < CROWDED / 16.0 {
            self.crowding = (self.crowding * 2.0).min(1.0);
        }
    }

    /// Sorts the valid boxes among `boxes` (or among those with the given ids) as planned.
    fn build(&mut self, plan: &Plan, boxes: &[Aabb], ids: Option<&[u32]>) {
        self.distribute(plan, boxes, ids);
        self.grids.truncate(plan.levels.len());
        for (i, level) in plan.levels.iter().enumerate() {
            if self.grids.len() == i {
                self.grids.push(Grid::new(level));
            }
            self.grids[i].build(level, boxes, &self.members[i], &mut self.keys);
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

    /// Whether finer cells would help, and then how much finer the next plan should make them.
    fn finer(&self, plan: &Plan) -> Option<f32> {
        let divisible = |level: &LevelPlan| (0..3).any(|k| level.cell[k] > 1.5 * level.max_extent[k]);
        let crowd = |(grid, level): (&Grid, _)| if divisible(level) { grid.crowd } else { 0.0 };
        let worst = self.grids.iter().zip(&plan.levels).map(crowd).fold(0.0, f32::max);
        (worst > CROWDED && self.crowding > 1e-6).then_some(self.crowding * 0.5)
    }

    /// All entries, grid by grid, smallest boxes first; without the list.
    pub(crate) fn len_in_grids(&self) -> usize {
        self.grids.iter().map(|g| g.entries.len()).sum()
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
