//! Which boxes share a grid. Sizes have no law (contract 4): one grid where one is cheapest, several
//! levels where sizes differ by decades, and a list tested against everything for the few largest.

use super::costs::{Costs, Experience, Forecast, Way};
use super::summary::LARGEST_CLASS;
use super::{Summary, spacing};
use crate::Aabb;
use crate::config::Strategy;
use arrayvec::ArrayVec;
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
    /// cell, or two.
    pub cell: [f32; 3],
    /// Where cell 0 begins.
    pub origin: [f32; 3],
    /// Cells on each axis before they wrap around; the last is a lower bound, see `cells`.
    pub dims: [u32; 3],
    /// All cells, a power of two.
    pub cells: u32,
    /// Boxes expected in a cell, were they spread evenly over the range.
    pub(crate) crowd: f32,
    /// 0, or the number of a camp: boxes of levels with the same number never pair, whatever their filters say of
    /// others.
    pub camp: u8,
}

/// A cell of a grid with the boxes whose lower corners lie in it.
#[derive(Clone, Debug, PartialEq)]
pub struct OccupiedCell {
    /// Which level of its grid it belongs to, from 0.
    pub level: u32,
    /// Where it is.
    pub aabb: Aabb,
    /// The boxes.
    pub ids: Vec<u32>,
}

impl LevelPlan {
    /// How much larger than its largest box a cell is at least: 62 of 64 steps, see `cpu::cells`.
    pub const SPARE: f32 = 64.0 / 62.0 + 1e-6;

    /// Against its cell, boxes up to this size count as small: few reach beyond it. 22 of 64 steps, and two for rounding,
    /// see `cpu::cells`.
    pub(crate) const SPACIOUS: f32 = 22.0 / 64.0;
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

/// Boxes wanted in a cell. The measured optimum is flat from 0.25 to 1.
const PER_CELL: f64 = 0.5;

/// The same where that makes cells so large that few boxes reach beyond theirs: fewer cells then cost less to sort into,
/// and few neighbours are looked at. All moving, of 0.5 to 6: 100,000 boxes of the set `uniform` 5.6 ms an update against
/// 6.7 with half a box a cell, 10,000 of them 0.43 against 0.48, 30,000 unit cubes with 0.1 pairs each 1.75 against 2.2.
/// Where boxes do reach beyond, two in a cell cost 5 to 10% more.
const SPARSE_PER_CELL: f64 = 2.0;

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

/// What the choice depends on, besides the boxes.
#[derive(Clone, Copy)]
pub(super) struct Setting<'a> {
    /// Factor on the cell size of an even spread.
    pub(super) crowding: f32,
    pub(super) strategy: Strategy,
    pub(super) company: Company,
    pub(super) costs: &'a Costs,
    pub(super) experience: &'a Experience,
    /// A way that is given.
    pub(super) only: Option<Way>,
}

/// The split into levels and a number of swept boxes, why, and by what way.
pub(super) struct Choice {
    pub(super) levels: Levels,
    pub(super) swept: u32,
    pub(super) forecast: Forecast,
    /// The way, and what it would take by the costs alone.
    pub(super) expected: (Way, f32),
}

/// Splits the boxes into levels and a number of swept boxes, at least cost.
pub(super) fn choose(summary: &Summary, setting: &Setting<'_>) -> Choice {
    let world = World::new(summary, setting);
    let groups = groups(summary);
    let (several, steps) = split(&world, &groups);
    let may_sweep_all = setting.strategy != Strategy::Grid;
    let brute = if may_sweep_all { world.sweep_cost(summary.valid, 0) } else { f64::INFINITY };
    let one_grid = if groups.is_empty() { f64::INFINITY } else { world.grid_cost(&groups, &[]) };
    let all = [brute, one_grid, several].map(|cost| cost as f32);
    let forecast = Forecast { brute: all[0], one_grid: all[1], levels: all[2] };
    let (corrected, best) = setting.experience.choose(forecast);
    // Boxes of one size cannot be parted by size.
    let only = setting.only.filter(|way| *way != Way::Levels || several.is_finite());
    let way = only.unwrap_or(best);
    let levels = match way {
        Way::OneGrid if !groups.is_empty() => Levels::from_iter([world.level(&groups)]),
        Way::Levels => assemble(&world, &groups, steps),
        _ => Levels::new(),
    };
    let in_levels: u32 = levels.iter().map(|level| level.boxes).sum();
    let swept = summary.valid - in_levels;
    Choice { levels, swept, forecast: corrected, expected: (way, forecast.of(way)) }
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

/// What there are at most as many of as groups, on the stack: planning allocates nothing.
type OfGroups<T> = ArrayVec<T, GROUPS>;

/// Levels of a plan, small boxes first.
pub(super) type Levels = OfGroups<LevelPlan>;

/// The classes in use, at most [`GROUPS`] of them apart.
fn groups(summary: &Summary) -> OfGroups<Group> {
    let used = (0..LARGEST_CLASS).filter(|&c| summary.classes[c].boxes > 0);
    let used: ArrayVec<usize, LARGEST_CLASS> = used.collect();
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

/// The cheapest split into two parts or more, by dynamic programming over the groups: what a level costs depends only on
/// its own groups and on how many boxes are smaller. Its cost, and `steps[j]` covers groups `0..=j`.
fn split(world: &World<'_>, used: &[Group]) -> (f64, OfGroups<Step>) {
    let mut steps = OfGroups::<Step>::new();
    for last in 0..used.len() {
        // All at the end, in two parts at least, and only the largest boxes can be swept.
        let at_end = last + 1 == used.len();
        let before = |first: usize| if first == 0 { 0.0 } else { steps[first - 1].cost };
        let grids = (usize::from(at_end)..=last).map(|first| {
            let cost = before(first) + world.grid_cost(&used[first..=last], &used[..first]);
            Step { first, swept: false, cost }
        });
        let sweeps = (1..if at_end { last + 1 } else { 0 }).map(|first| {
            let cost = before(first) + world.sweep_cost(count(&used[first..=last]), count(&used[..first]));
            Step { first, swept: true, cost }
        });
        let best = grids.chain(sweeps).min_by(|a, b| a.cost.total_cmp(&b.cost));
        steps.extend(best);
    }
    let whole = steps.len() == used.len();
    (steps.last().filter(|_| whole).map_or(f64::INFINITY, |step| step.cost), steps)
}

fn assemble(world: &World<'_>, used: &[Group], steps: OfGroups<Step>) -> Levels {
    let mut levels = Levels::new();
    let mut end = used.len();
    while end > 0 {
        let step = steps[end - 1];
        if !step.swept {
            levels.push(world.level(&used[step.first..end]));
        }
        end = step.first;
    }
    levels.reverse();
    levels
}

/// Where the boxes lie, and what work costs.
struct World<'a> {
    low: [f32; 3],
    range: [f32; 3],
    crowding: f32,
    others: f64,
    pairs: f64,
    costs: &'a Costs,
}

impl<'a> World<'a> {
    fn new(summary: &Summary, setting: &Setting<'a>) -> Self {
        let ranges: [(f32, f32); 3] = std::array::from_fn(|k| summary.range(k));
        Self {
            low: ranges.map(|r| r.0.clamp(f32::MIN, f32::MAX)),
            range: ranges.map(|r| (r.1 - r.0).clamp(0.0, f32::MAX)),
            crowding: setting.crowding,
            others: f64::from(setting.company.others),
            pairs: f64::from(u8::from(setting.company.pairs)),
            costs: setting.costs,
        }
    }

    /// A cell holds the largest box, with a little to spare for rounding, and about half a box; two, where few boxes then
    /// reach beyond it.
    fn cell(&self, groups: &[Group]) -> [f32; 3] {
        let spaced = |per_cell| spacing(self.range, count(groups), per_cell) as f32 * self.crowding;
        let (sparse, extent) = (spaced(SPARSE_PER_CELL), max_extent(groups));
        let is_sparse = extent.iter().all(|e| *e <= LevelPlan::SPACIOUS * sparse);
        let spaced = if is_sparse { sparse } else { spaced(PER_CELL) };
        extent.map(|e| (e * LevelPlan::SPARE).max(spaced).max(SMALLEST_CELL))
    }

    fn grid_cost(&self, level: &[Group], smaller: &[Group]) -> f64 {
        let &Costs { place, candidate, visit, visited, grid, .. } = self.costs;
        let [place, candidate, visit, visited, grid] =
            [place, candidate, visit, visited, grid].map(f64::from);
        let inner = self.half(level);
        let own = place + candidate * self.pairs * inner;
        let visits = visit + visited * self.candidates(smaller, level);
        let others = visit * self.others.min(f64::from(count(level)));
        grid + f64::from(count(level)) * own + f64::from(count(smaller)) * visits + others
    }

    /// A list is tested against everything, itself included, whatever may pair.
    fn sweep_cost(&self, swept: u32, smaller: u32) -> f64 {
        let (n, others) = (f64::from(swept), f64::from(smaller) + self.others);
        f64::from(self.costs.test) * n * (others + 0.5 * n) + f64::from(self.costs.sweep) * (n + others)
    }

    /// Boxes of `level` that an average one of them is tested against, in the half of its window that comes after it, were
    /// they spread evenly: the rest of its cell, and beyond only where it reaches there itself (`cpu::half`).
    fn half(&self, level: &[Group]) -> f64 {
        let (extent, cell) = (max_extent(level), self.cell(level));
        let share = |k: usize, cells: f32| f64::from((cells * cell[k] / self.range[k].max(cell[k])).min(1.0));
        let one: [f64; 3] = std::array::from_fn(|k| share(k, 1.0));
        let weighted = |group: &Group| {
            let own: [f32; 3] = std::array::from_fn(|k| group.max_extent[k] / cell[k]);
            let up: [f64; 3] = std::array::from_fn(|k| share(k, 1.0 + own[k]) - one[k]);
            let wide = |k: usize| share(k, 1.0 + own[k] + extent[k] / cell[k]);
            let row = (0.5 * one[0] + up[0]) * one[1] * one[2];
            let rest = up[1] * wide(0) * one[2] + up[2] * wide(0) * wide(1);
            f64::from(group.boxes) * (row + rest)
        };
        level.iter().map(weighted).sum()
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
            crowd: boxes as f32 * self.share(cell),
            camp: 0,
        }
    }

    /// Of the world that a cell is.
    fn share(&self, cell: [f32; 3]) -> f32 {
        (0..3).map(|k| cell[k] / self.range[k].max(cell[k])).product()
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
