//! Which boxes share a grid. Sizes have no law (contract 4): one grid where one is cheapest, several
//! levels where sizes differ by decades, and a list tested against everything for the few largest.

use super::summary::LARGEST_CLASS;
use super::{Summary, spacing};
use crate::Aabb;
use crate::config::Strategy;
use std::fmt;

/// One grid: the boxes of neighbouring size classes, sorted by the cell of their lower corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelPlan {
    /// Boxes in the level.
    pub boxes: u32,
    /// First and last size class ([`super::Summary::classes`]).
    pub classes: (u8, u8),
    /// Largest extent on each axis, in the boxes' length unit like all lengths here: no box reaches
    /// further than this beyond its lower corner.
    pub max_extent: [f32; 3],
    /// Cell size: at least [`LevelPlan::SPARE`] times `max_extent`, and such that about half a box falls into a
    /// cell.
    pub cell: [f32; 3],
    /// Where cell 0 begins.
    pub origin: [f32; 3],
    /// Cells on each axis before they wrap around; the last is a lower bound, see `cells`.
    pub dims: [u32; 3],
    /// All cells, a power of two.
    pub cells: u32,
    /// 0, or the number of a camp: boxes of levels with the same number never pair, whatever their filters say of
    /// others.
    pub camp: u8,
}

/// A cell of a grid with the boxes whose lower corners lie in it.
#[derive(Clone, Debug, PartialEq)]
pub struct OccupiedCell {
    /// Which level of its grid it belongs to, from 0. The boxes at rest and those that have moved have levels each.
    pub level: u32,
    /// Where it is.
    pub aabb: Aabb,
    /// The boxes.
    pub ids: Vec<u32>,
}

impl LevelPlan {
    /// How much larger than its largest box a cell is at least: 62 of 64 steps, see `cpu::cells`.
    pub const SPARE: f32 = 64.0 / 62.0 + 1e-6;
}

impl fmt::Display for LevelPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let largest = self.max_extent.into_iter().fold(0.0, f32::max);
        let [x, y, z] = self.cell;
        write!(f, "level of {} boxes up to {largest}, cells of {x} x {y} x {z}", self.boxes)?;
        if self.camp == 0 { Ok(()) } else { write!(f, ", none of which pair (camp {})", self.camp) }
    }
}

/// Smallest cell, 2^-100, for the same reason.
const SMALLEST_CELL: f32 = 7.888_609e-31;

/// Costs in ns on one core (Zen 3, 2.4 GHz), from the stage times of the sets `unit`, `pile` and
/// `mixed` at 10,000 and 100,000 boxes. Their ratios decide between one level, several, and a list:
/// splitting `mixed` into two levels, as cheaper visits would suggest, takes 1.7 times as long. Measured with a search
/// that tested boxes rather than codes: absolute times are lower now, the ratios have not been measured again.
mod cost {
    /// One test of two boxes at random places.
    pub(super) const CHECK: f64 = 0.7;
    /// One test in a sweep over a list.
    pub(super) const SWEEP: f64 = 1.8;
    /// Sorting one box into a grid, and setting up its search there.
    pub(super) const BOX: f64 = 65.0;
    /// Setting up the search for a box in the grid of another level.
    pub(super) const VISIT: f64 = 85.0;
    /// One more grid, however small.
    pub(super) const LEVEL: f64 = 2000.0;
}

/// Boxes wanted in a cell. The measured optimum is flat from 0.25 to 1.
const PER_CELL: f64 = 0.5;

/// Who else there is.
#[derive(Clone, Copy)]
pub(super) struct Company {
    /// Boxes in levels of their own, which these are to be tested against, too.
    pub(super) others: u32,
    /// Whether these are tested against each other.
    pub(super) pairs: bool,
}

impl Company {
    pub(super) const NONE: Self = Self { others: 0, pairs: true };
}

/// Splits the boxes into levels and a number of swept boxes, at least cost.
pub(super) fn choose(
    summary: &Summary,
    crowding: f32,
    strategy: Strategy,
    company: Company,
) -> (Vec<LevelPlan>, u32) {
    let world = World::new(summary, crowding, company);
    let groups = groups(summary);
    let steps = split(&world, &groups, strategy);
    let (levels, in_levels) = assemble(&world, &groups, steps);
    (levels, summary.valid - in_levels)
}

/// Neighbouring size classes that share their level.
#[derive(Clone, Copy)]
struct Group {
    classes: (usize, usize),
    boxes: u32,
    max_extent: [f32; 3],
}

/// Most groups: the split weighs each run of groups by its members, cubic in their number, and sets of
/// any floats use up to 227 classes.
const GROUPS: usize = 24;

/// The classes in use, at most [`GROUPS`] of them apart.
fn groups(summary: &Summary) -> Vec<Group> {
    let used: Vec<usize> = (0..LARGEST_CLASS).filter(|&c| summary.classes[c].boxes > 0).collect();
    let together = used.len().div_ceil(GROUPS).max(1);
    used.chunks(together).map(|classes| Group::of(summary, classes)).collect()
}

impl Group {
    fn of(summary: &Summary, classes: &[usize]) -> Self {
        let extent = |k: usize| classes.iter().map(|&c| summary.classes[c].max_extent[k]).fold(0.0, f32::max);
        Self {
            classes: (classes[0], classes[classes.len() - 1]),
            boxes: classes.iter().map(|&c| summary.classes[c].boxes).sum(),
            max_extent: std::array::from_fn(extent),
        }
    }
}

/// One way to end at a group: the segment's first group, whether it is swept, and the cost so far.
#[derive(Clone, Copy)]
struct Step {
    first: usize,
    swept: bool,
    cost: f64,
}

/// The cheapest split, by dynamic programming over the groups: what a level costs depends only on its
/// own groups and on how many boxes are smaller. `steps[j]` covers groups `0..=j`.
fn split(world: &World, used: &[Group], strategy: Strategy) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::with_capacity(used.len());
    for last in 0..used.len() {
        let before = |first: usize| if first == 0 { 0.0 } else { steps[first - 1].cost };
        let grids = (0..=last).map(|first| {
            let cost = before(first) + world.grid_cost(&used[first..=last], &used[..first]);
            Step { first, swept: false, cost }
        });
        // Only the largest boxes can be swept, and never all when the caller asked for the grid.
        let may_sweep = last + 1 == used.len();
        let first_swept = usize::from(strategy == Strategy::Grid);
        let sweeps = (first_swept..if may_sweep { last + 1 } else { 0 }).map(|first| {
            let cost = before(first) + world.sweep_cost(&used[first..=last], &used[..first]);
            Step { first, swept: true, cost }
        });
        let best = grids.chain(sweeps).min_by(|a, b| a.cost.total_cmp(&b.cost));
        steps.extend(best);
    }
    steps
}

fn assemble(world: &World, used: &[Group], steps: Vec<Step>) -> (Vec<LevelPlan>, u32) {
    let mut levels = Vec::new();
    let mut end = used.len();
    while end > 0 {
        let step = steps[end - 1];
        if !step.swept {
            levels.push(world.level(&used[step.first..end]));
        }
        end = step.first;
    }
    levels.reverse();
    let boxes = levels.iter().map(|level| level.boxes).sum();
    (levels, boxes)
}

/// Where the boxes lie.
struct World {
    low: [f32; 3],
    range: [f32; 3],
    crowding: f32,
    others: f64,
    pairs: f64,
}

impl World {
    fn new(summary: &Summary, crowding: f32, company: Company) -> Self {
        let ranges: [(f32, f32); 3] = std::array::from_fn(|k| summary.range(k));
        Self {
            low: ranges.map(|r| r.0.clamp(f32::MIN, f32::MAX)),
            range: ranges.map(|r| (r.1 - r.0).clamp(0.0, f32::MAX)),
            crowding,
            others: f64::from(company.others),
            pairs: f64::from(u8::from(company.pairs)),
        }
    }

    /// A cell holds the largest box, with a little to spare for rounding, and about half a box.
    fn cell(&self, groups: &[Group]) -> [f32; 3] {
        let spaced = spacing(self.range, count(groups), PER_CELL) as f32 * self.crowding;
        max_extent(groups).map(|e| (e * LevelPlan::SPARE).max(spaced).max(SMALLEST_CELL))
    }

    fn grid_cost(&self, level: &[Group], smaller: &[Group]) -> f64 {
        let own = cost::BOX + 0.5 * cost::CHECK * self.pairs * self.candidates(level, level);
        let visit = cost::VISIT + cost::CHECK * self.candidates(smaller, level);
        let others = cost::VISIT * self.others.min(f64::from(count(level)));
        cost::LEVEL + f64::from(count(level)) * own + f64::from(count(smaller)) * visit + others
    }

    /// A list is tested against everything, itself included, whatever may pair.
    fn sweep_cost(&self, swept: &[Group], smaller: &[Group]) -> f64 {
        let n = f64::from(count(swept));
        cost::SWEEP * n * (f64::from(count(smaller)) + 0.5 * n + self.others)
    }

    /// Boxes of `level` that an average box of `groups` is tested against, were they spread evenly.
    fn candidates(&self, groups: &[Group], level: &[Group]) -> f64 {
        let (extent, cell) = (max_extent(level), self.cell(level));
        let share = |own: &[f32; 3], k: usize| {
            let window = own[k] + extent[k] + cell[k];
            f64::from(window) / f64::from(self.range[k].max(window))
        };
        let weighted = |group: &Group| {
            let share: f64 = (0..3).map(|k| share(&group.max_extent, k)).product();
            f64::from(group.boxes) * share
        };
        let sum: f64 = groups.iter().map(weighted).sum();
        f64::from(count(level)) * sum / f64::from(count(groups).max(1))
    }

    fn level(&self, groups: &[Group]) -> LevelPlan {
        let (boxes, cell) = (count(groups), self.cell(groups));
        let (dims, cells) = dimensions(self.range, cell, boxes);
        let (first, last) = (groups[0].classes.0, groups[groups.len() - 1].classes.1);
        LevelPlan {
            boxes,
            classes: (first as u8, last as u8),
            max_extent: max_extent(groups),
            cell,
            origin: self.low,
            dims,
            cells,
            camp: 0,
        }
    }
}

fn count(groups: &[Group]) -> u32 {
    groups.iter().map(|group| group.boxes).sum()
}

/// Room in a level for boxes that turn, or are rounded otherwise in another place: one that fits no level is tested
/// against everything.
const SLACK: f32 = 1.0 + 1.0 / 128.0;

/// Rounded up: a window reaches down by this much, and `max - min` was rounded to nearest.
fn max_extent(groups: &[Group]) -> [f32; 3] {
    let largest = |k: usize| groups.iter().map(|group| group.max_extent[k]).fold(0.0, f32::max);
    std::array::from_fn(|k| (largest(k) * SLACK).next_up().min(f32::MAX))
}

/// Fewest cells on an axis. Windows reach one cell to each side (see `cpu::cells`), so that two cells
/// of one window never wrap onto each other when an axis has more than four.
const FEWEST: u32 = 8;

/// Most cells in all.
const MOST: u64 = 1 << 27;

/// Cells on each axis: enough for the range, but no more than four a box in all (wrapping around
/// costs a few more tests, empty cells cost memory traffic).
fn dimensions(range: [f32; 3], cell: [f32; 3], boxes: u32) -> ([u32; 3], u32) {
    let budget = (4 * u64::from(boxes)).max(u64::from(FEWEST).pow(3)).min(MOST);
    // Capped so that the product of three stays below 2^64; the loop takes care of the rest.
    let wanted = |k: usize| ((range[k] / cell[k]).min(1e6) as u64) + 4;
    let mut dims: [u64; 3] = std::array::from_fn(|k| wanted(k).max(u64::from(FEWEST)));
    while dims.iter().product::<u64>() > budget {
        let widest = (0..3).max_by_key(|&k| dims[k]).unwrap_or(0);
        if dims[widest] <= u64::from(FEWEST) {
            break;
        }
        dims[widest] = (dims[widest] / 2).max(u64::from(FEWEST));
    }
    let cells = dims.iter().product::<u64>().next_power_of_two();
    (dims.map(|d| d as u32), cells as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dimensions_follow_the_range_and_stay_within_four_cells_a_box() {
        assert_eq!(dimensions([96.0; 3], [1.0; 3], 1_000_000).0, [100; 3]);
        let (dims, cells) = dimensions([1e30, 1.0, 1.0], [1.0; 3], 1000);
        assert!(cells <= 4096 && dims[0] >= 32, "{dims:?}");
        assert_eq!(dimensions([0.0; 3], [1.0; 3], 1), ([8; 3], 512));
    }
}
