//! Map: boxes into cells. One entry a box, sorted by the cell of its lower corner.

use super::cells::{Cells, Span};
use super::entries::{Entries, Stored};
use crate::plan::{LevelPlan, Plan, Summary, size_class_of};
use crate::report::{StageTimes, lap};
use crate::{Aabb, Config};
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
/// one run of entries: the widest row has 7 cells.
pub(crate) const GHOSTS: usize = 8;

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

    /// Counting sort of `members` by cell (PBIG 4.2: count, scan, scatter), stable.
    fn build(&mut self, level: &LevelPlan, boxes: &[Aabb], members: &[u32], places: &mut Vec<(u32, Span)>) {
        self.cells = Cells::new(level);
        self.count(level.cells as usize, boxes, members, places);
        self.scan();
        self.scatter(boxes, members, places);
        self.haunt();
    }

    fn count(&mut self, cells: usize, boxes: &[Aabb], members: &[u32], places: &mut Vec<(u32, Span)>) {
        self.starts.clear();
        self.starts.resize(cells + 1 + GHOSTS, 0);
        places.clear();
        places.extend(members.iter().map(|&id| self.cells.place(&boxes[id as usize])));
        for (key, _) in places {
            self.starts[*key as usize] += 1;
        }
    }

    /// Counts to ends, which the scatter turns into starts.
    fn scan(&mut self) {
        let (mut sum, mut squares) = (0u32, 0u64);
        for start in &mut self.starts {
            squares += u64::from(*start) * u64::from(*start);
            sum += *start;
            *start = sum;
        }
        self.crowd = (squares as f64 / f64::from(sum.max(1))) as f32 - 1.0;
    }

    fn scatter(&mut self, boxes: &[Aabb], members: &[u32], places: &[(u32, Span)]) {
        self.entries.resize(members.len());
        self.keys.resize(members.len(), 0);
        self.spans.resize(members.len(), Span::default());
        // Backwards, so that equal keys keep the order of their ids.
        for (&id, &(key, span)) in members.iter().zip(places).rev() {
            let start = &mut self.starts[key as usize];
            *start -= 1;
            let place = *start as usize;
            self.entries.boxes[place] = Stored::new(&boxes[id as usize]);
            self.entries.ids[place] = id;
            self.keys[place] = key;
            self.spans[place] = span;
        }
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

/// A set of boxes, ready to be searched: grids by level, and the boxes that fit none of them.
#[derive(Clone, Debug)]
pub(crate) struct Map {
    pub(crate) grids: Vec<Grid>,
    /// Boxes tested against everything.
    pub(crate) list: Entries,
    /// Scratch: ids of the boxes of a level, and where they go.
    members: Vec<Vec<u32>>,
    places: Vec<(u32, Span)>,
    /// Factor on the cell size: below 1 where clusters fill the cells that an even spread would
    /// leave half empty. Kept from one build to the next.
    crowding: f32,
}

/// Other entries in a box's cell, on average, at which finer cells are tried. An even spread has
/// half a one. Relaxed again below a sixteenth of it, so that the choice does not flap.
const CROWDED: f32 = 6.0;

/// Where halving the cells ends.
const FINEST: f32 = 1e-6;

impl Map {
    pub(crate) fn new() -> Self {
        Self { grids: vec![], list: Entries::default(), members: vec![], places: vec![], crowding: 1.0 }
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
            if !self.divide(self.worst_crowd(&plan)) {
                return plan;
            }
        }
    }

    /// How full the fullest level is, of those whose cells could be smaller.
    fn worst_crowd(&self, plan: &Plan) -> f32 {
        let divisible = |level: &LevelPlan| (0..3).any(|k| level.cell[k] > 1.5 * level.max_extent[k]);
        let crowd = |(grid, level): (&Grid, _)| if divisible(level) { grid.crowd } else { 0.0 };
        self.grids.iter().zip(&plan.levels).map(crowd).fold(0.0, f32::max)
    }

    /// Whether to build again with finer cells, which `crowding` then asks for. Two far clusters
    /// need many halvings before any helps; identical boxes stop at the last.
    fn divide(&mut self, crowd: f32) -> bool {
        let divide = crowd > CROWDED && self.crowding > FINEST;
        if divide {
            self.crowding *= 0.5;
        } else if crowd < CROWDED / 16.0 {
            self.crowding = (self.crowding * 2.0).min(1.0);
        }
        divide
    }

    /// Sorts the valid boxes among `boxes` (or among those with the given ids) as planned.
    fn build(&mut self, plan: &Plan, boxes: &[Aabb], ids: Option<&[u32]>) {
        self.distribute(plan, boxes, ids);
        self.grids.truncate(plan.levels.len());
        for (i, level) in plan.levels.iter().enumerate() {
            if self.grids.len() == i {
                self.grids.push(Grid::new(level));
            }
            self.grids[i].build(level, boxes, &self.members[i], &mut self.places);
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

    /// All entries, grid by grid, smallest boxes first; without the list.
    pub(crate) fn len_in_grids(&self) -> usize {
        self.grids.iter().map(|g| g.len()).sum()
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
