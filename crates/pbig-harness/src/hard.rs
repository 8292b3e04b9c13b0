//! Worlds that are hard for a broad phase, as recipes: numbers that a search for the worst world can change.

mod known;

pub use known::{histories, shapes};

use crate::boxes::shifted;
use pbig_core::{Aabb, BroadPhase, Config, Error, Finder, Limits, ProxyFilter, Report};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// The number of boxes for which a recipe's widths are meant. More boxes take more room.
pub const MEANT_FOR: usize = 25_000;

/// The arrangement of a part's boxes in its region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    Anywhere,
    /// At equal distances along the region's diagonal.
    Line,
    Lattice,
    /// At distances from its corner that are log-uniform over ten decades up to its width, sizes in proportion.
    Around,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// The share of all boxes, relative to the other parts'.
    pub weight: u32,
    pub place: Placement,
    pub corner: [f32; 3],
    pub width: [f32; 3],
    /// The power of the number of boxes with which the widths grow: a third keeps the density.
    pub growth: f32,
    pub half: [f32; 3],
    pub decades: f32,
}

impl Part {
    /// Unit cubes, about one pair for four boxes.
    pub const CUBES: Self = Self {
        weight: 1,
        place: Placement::Anywhere,
        corner: [0.0; 3],
        width: [74.0; 3],
        growth: 1.0 / 3.0,
        half: [0.5; 3],
        decades: 0.0,
    };

    fn make(&self, (i, count): (usize, usize), scale: f32, random: &mut StdRng) -> Aabb {
        let width = self.width.map(|width| width * scale.powf(self.growth));
        let at = self.at(i, count, random);
        let size = match self.place {
            Placement::Around => at[0].abs().max(at[1].abs()).max(at[2].abs()),
            _ => 10f32.powf(-self.decades * random.random_range(0.0..1.0)),
        };
        let center = std::array::from_fn(|k| self.corner[k] + at[k] * width[k]);
        Aabb::from_center(center, self.half.map(|half| half * size))
    }

    /// Returns where a box lies, in widths.
    fn at(&self, i: usize, count: usize, random: &mut StdRng) -> [f32; 3] {
        match self.place {
            Placement::Anywhere => [0; 3].map(|_| random.random_range(0.0..1.0)),
            Placement::Line => [i as f32 / count.max(1) as f32; 3],
            Placement::Lattice => {
                let side = (count as f64).cbrt().ceil().max(1.0) as usize;
                [i % side, i / side % side, i / side / side].map(|cell| cell as f32 / side as f32)
            }
            Placement::Around => {
                let direction = [0; 3].map(|_| random.random_range(-1.0f32..1.0));
                let length = direction.iter().fold(1e-3f32, |all, x| all.max(x.abs()));
                let distance = 10f32.powf(-10.0 * random.random_range(0.0f32..1.0));
                direction.map(|x| x / length * distance)
            }
        }
    }
}

/// A world: some parts, whose boxes take turns.
#[derive(Clone, Debug, PartialEq)]
pub struct Recipe(pub Vec<Part>);

impl Recipe {
    pub fn boxes(&self, n: usize, seed: u64) -> Vec<Aabb> {
        let mut random = StdRng::seed_from_u64(seed);
        let turns: Vec<usize> =
            self.0.iter().enumerate().flat_map(|(k, part)| vec![k; part.weight as usize]).collect();
        let scale = n as f32 / MEANT_FOR as f32;
        let mut made = vec![0; self.0.len()];
        let mut next = |i: usize| {
            let part = turns[i % turns.len()];
            made[part] += 1;
            let count = n * self.0[part].weight as usize / turns.len();
            self.0[part].make((made[part] - 1, count), scale, &mut random)
        };
        if turns.is_empty() { Vec::new() } else { (0..n).map(&mut next).collect() }
    }
}

/// Returns needles in one layer, of which each would meet half of the others in a grid of cubes, and few touch.
pub fn crossing(n: usize) -> Vec<Aabb> {
    let long = |i: usize, half: [f32; 3]| Aabb::from_center([0.0, 0.0, i as f32].map(|x| x * 0.001), half);
    let half = |i: usize| if i.is_multiple_of(2) { [9.0, 0.0001, 0.0001] } else { [0.0001, 9.0, 0.0001] };
    (0..n).map(|i| long(i, half(i))).collect()
}

/// The change that each box of a history undergoes once.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// It goes where another world has it, with its size.
    To(Recipe),
    Grow(f32),
    Shift([f32; 3]),
    Remove,
}

/// A world and its history: in each update the next boxes change, each once.
#[derive(Clone, Debug, PartialEq)]
pub struct History {
    pub start: Recipe,
    pub change: Change,
    /// The number of updates after which all boxes have changed.
    pub updates: usize,
}

impl History {
    /// Returns the changes of each update. The first one makes the world of `n` boxes.
    pub fn changes(&self, n: usize, seed: u64) -> Vec<Changes> {
        let boxes = self.start.boxes(n, seed);
        let all: Vec<_> = (0..).zip(self.after(&boxes, seed)).collect();
        let start = (0..).zip(boxes.into_iter().map(Some)).collect();
        let later = all.chunks(n.div_ceil(self.updates.max(1)).max(1)).map(<[_]>::to_vec);
        std::iter::once(start).chain(later).collect()
    }

    /// Returns the boxes as they become, by id.
    fn after(&self, boxes: &[Aabb], seed: u64) -> Vec<Option<Aabb>> {
        let to = match &self.change {
            Change::To(recipe) => recipe.boxes(boxes.len(), seed + 1),
            _ => Vec::new(),
        };
        let changed = |(i, aabb): (usize, &Aabb)| match &self.change {
            Change::To(_) => Some(to[i]),
            Change::Grow(factor) => {
                let half: [f32; 3] = std::array::from_fn(|k| (aabb.max[k] - aabb.min[k]) * 0.5);
                Some(Aabb::from_center(
                    std::array::from_fn(|k| aabb.min[k] + half[k]),
                    half.map(|half| half * factor),
                ))
            }
            Change::Shift(by) => Some(shifted(aabb, *by)),
            Change::Remove => None,
        };
        boxes.iter().enumerate().map(changed).collect()
    }
}

/// The changes of an update: ids with their new boxes, or without one if they are removed.
pub type Changes = Vec<(u32, Option<Aabb>)>;

/// Sets and removes boxes.
pub fn tell(broad_phase: &mut BroadPhase, changes: &Changes) -> Result<(), Error> {
    for (id, aabb) in changes {
        match aabb {
            Some(aabb) => broad_phase.set(*id, *aabb, ProxyFilter::ALL)?,
            None => _ = broad_phase.remove(*id),
        }
    }
    Ok(())
}

/// Maximum number of pairs for a world to be measured: more would be a test of memory.
const MAX_PAIRS: u64 = 2_000_000;

fn config() -> Config {
    Config { limits: Limits { max_pairs: MAX_PAIRS, ..Limits::DEFAULT }, ..Config::DEFAULT }
}

/// Returns the work of a call for each box and pair, in binary logarithms of the number of boxes, which [`pbig_core::WORK_LIMIT`]
/// bounds. Changes count as boxes where they are more.
pub fn ratio(report: &Report) -> f64 {
    let boxes = report.boxes.max(report.changed);
    report.work as f64 / ((boxes + report.pairs).max(1) as f64 * (boxes.max(2) as f64).log2())
}

/// Returns the ratio of a search from nothing; none where there are too many pairs.
pub fn ratio_of_search(recipe: &Recipe, n: usize) -> Option<f64> {
    let mut finder = Finder::new(config());
    finder.find(&recipe.boxes(n, 1)).ok()?;
    Some(ratio(finder.report()))
}

/// Returns the ratio of a search for the pairs of two sets of some boxes; none where there are too many pairs.
pub fn ratio_of_two(recipes: &[Recipe; 2], n: [usize; 2]) -> Option<f64> {
    let [a, b] = [0, 1].map(|set| recipes[set].boxes(n[set], 1 + set as u64));
    let mut finder = Finder::new(config());
    finder.find_between(&a, &b).ok()?;
    Some(ratio(finder.report()))
}

/// Returns the largest ratio of all updates of a history; none where there are too many pairs.
pub fn ratio_of_history(history: &History, n: usize) -> Option<f64> {
    let mut broad_phase = BroadPhase::new(config()).ok()?;
    let mut worst = 0f64;
    for changes in history.changes(n, 1) {
        tell(&mut broad_phase, &changes).ok()?;
        broad_phase.update().ok()?;
        worst = worst.max(ratio(broad_phase.report()));
    }
    Some(worst)
}
