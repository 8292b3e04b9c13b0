//! The search for the world that makes pbig work most for what it finds: recipes are changed at random, and changes that raise
//! the work are kept.

use pbig_core::{BroadPhase, Config, Error, Finder, Limits, ProxyFilter};
use pbig_harness::hard::{Change, History, Part, Place, Recipe, histories, shapes};
use pbig_harness::prelude::*;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::time::{Duration, Instant};

/// Pairs beyond which a world is not looked at: it would be a test of memory.
const MAX_PAIRS: u64 = 2_000_000;

/// Random worlds to start from, besides the known ones, one in so many.
const FRESH_ONE_IN: u32 = 8;

/// Settings of a search.
#[derive(Clone, Copy, Debug)]
pub struct Search {
    /// The time that it may take.
    pub seconds: u64,
    /// For its random numbers.
    pub seed: u64,
    /// Boxes in a world.
    pub boxes: usize,
}

/// Returns the work of a search from nothing for each box and pair, in binary logarithms of the number of boxes, which
/// [`pbig_core::WORK_LIMIT`] bounds. None where there are too many pairs.
pub fn ratio_of_search(recipe: &Recipe, n: usize) -> Option<f64> {
    let mut finder = Finder::new(config());
    finder.find(&recipe.boxes(n, 1)).ok()?;
    Some(ratio(finder.report(), n))
}

/// Returns the largest such ratio of all updates of a history.
pub fn ratio_of_history(history: &History, n: usize) -> Option<f64> {
    let boxes = history.start.boxes(n, 1);
    let mut broad_phase = BroadPhase::new(config()).ok()?;
    for (id, aabb) in (0..).zip(&boxes) {
        broad_phase.set(id, *aabb, ProxyFilter::ALL).ok()?;
    }
    let after = history.after(&boxes, 1);
    let mut worst = update(&mut broad_phase, n)?;
    for changed in (0u32..n as u32).collect::<Vec<_>>().chunks(n.div_ceil(history.updates.max(1))) {
        for &id in changed {
            match after[id as usize] {
                Some(aabb) => broad_phase.set(id, aabb, ProxyFilter::ALL).ok()?,
                None => _ = broad_phase.remove(id),
            }
        }
        worst = worst.max(update(&mut broad_phase, n)?);
    }
    Some(worst)
}

fn config() -> Config {
    Config { limits: Limits { max_pairs: MAX_PAIRS, ..Limits::DEFAULT }, ..Config::DEFAULT }
}

fn update(broad_phase: &mut BroadPhase, n: usize) -> Option<f64> {
    let done: Result<_, Error> = broad_phase.update();
    done.ok()?;
    Some(ratio(broad_phase.report(), n))
}

fn ratio(report: &pbig_core::Report, n: usize) -> f64 {
    report.work as f64 / ((n as f64 + report.pairs as f64) * (n.max(2) as f64).log2())
}

/// A world or a history, and its ratio.
#[derive(Clone, Debug)]
enum Find {
    World(Recipe),
    History(History),
}

impl Find {
    fn ratio(&self, n: usize) -> Option<f64> {
        match self {
            Self::World(recipe) => ratio_of_search(recipe, n),
            Self::History(history) => ratio_of_history(history, n),
        }
    }

    fn mutated(&self, random: &mut StdRng) -> Self {
        match self {
            Self::World(recipe) => Self::World(mutated(recipe, random)),
            Self::History(history) => Self::History(mutated_history(history, random)),
        }
    }
}

/// Runs a search, and tells the worst finds.
pub fn run(search: Search) -> Result<Report, Failure> {
    let mut random = StdRng::seed_from_u64(search.seed);
    let worlds = shapes().into_iter().map(|(_, recipe)| Find::World(recipe));
    let known: Vec<Find> =
        worlds.chain(histories().into_iter().map(|(_, history)| Find::History(history))).collect();
    let mut best: Vec<(f64, Find)> =
        known.iter().filter_map(|find| Some((find.ratio(search.boxes)?, find.clone()))).collect();
    let (clock, end) = (Instant::now(), Duration::from_secs(search.seconds));
    let bar = progress(search.seconds as usize, "seconds");
    let mut tried = known.len();
    while clock.elapsed() < end {
        let place = random.random_range(0..best.len());
        let start = if random.random_ratio(1, FRESH_ONE_IN) {
            &known[random.random_range(0..known.len())]
        } else {
            &best[place].1
        };
        let find = start.mutated(&mut random);
        let ratio = find.ratio(search.boxes).unwrap_or(0.0);
        if ratio > best[place].0 {
            best[place] = (ratio, find);
        }
        tried += 1;
        bar.set_position(clock.elapsed().as_secs());
    }
    bar.finish_and_clear();
    best.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut table = Table::new("worst", "ratio | boxes | worlds_tried | what");
    for (ratio, find) in best.into_iter().take(10) {
        table.row(cells![ratio, search.boxes, tried, format!("{find:?}")]);
    }
    Ok(Report::new("worst", vec![table]))
}

fn mutated(recipe: &Recipe, random: &mut StdRng) -> Recipe {
    let mut parts = recipe.0.clone();
    match random.random_range(0..8) {
        0 if parts.len() < 4 => parts.push(mutated_part(Part::CUBES, random)),
        1 if parts.len() < 4 => parts.push(mutated_part(parts[random.random_range(0..parts.len())], random)),
        2 if parts.len() > 1 => _ = parts.remove(random.random_range(0..parts.len())),
        _ => {
            let at = random.random_range(0..parts.len());
            parts[at] = mutated_part(parts[at], random);
        }
    }
    Recipe(parts)
}

fn mutated_history(history: &History, random: &mut StdRng) -> History {
    let History { mut start, mut change, mut updates } = history.clone();
    match random.random_range(0..4) {
        0 => start = mutated(&start, random),
        1 => updates = [4, 25, 100, 400][random.random_range(0..4)],
        2 => {
            change = match random.random_range(0..4) {
                0 => Change::Grow(10f32.powf(random.random_range(-1.0..2.0))),
                1 => Change::Shift([0; 3].map(|_| factor(random, 5.0))),
                2 => Change::Remove,
                _ => Change::To(mutated(&start, random)),
            }
        }
        _ => {
            if let Change::To(to) = &change {
                change = Change::To(mutated(to, random));
            }
        }
    }
    History { start, change, updates }
}

fn mutated_part(mut part: Part, random: &mut StdRng) -> Part {
    let k = random.random_range(0..3);
    match random.random_range(0..9) {
        0 => part.weight = random.random_range(1..20),
        1 => part.half[k] *= factor(random, 2.0),
        2 => part.half = part.half.map(|half| half * factor(random, 1.0)),
        3 => part.width[k] *= factor(random, 2.0),
        4 => part.width = part.width.map(|width| width * factor(random, 0.5)),
        5 => part.corner[k] += part.width[k] * factor(random, 1.0),
        6 => part.decades = random.random_range(0.0..4.0),
        7 => {
            part.place =
                [Place::Anywhere, Place::Line, Place::Lattice, Place::Around][random.random_range(0..4)];
        }
        _ => {
            let scale = factor(random, 3.0);
            part.half = part.half.map(|half| half * scale);
            part.width = part.width.map(|width| width * scale);
        }
    }
    part
}

/// Returns a factor of up to so many decades up or down.
fn factor(random: &mut StdRng, decades: f32) -> f32 {
    10f32.powf(random.random_range(-decades..decades))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_finds_no_less_than_it_begins_with() {
        let report = run(Search { seconds: 1, seed: 1, boxes: 500 }).expect("a search");
        assert!(!report.tables[0].rows.is_empty());
        let (_, uniform) = &shapes()[0];
        let ratio = ratio_of_search(uniform, 2000).expect("few pairs");
        assert!(ratio > 0.1 && ratio < 2.0, "{ratio}");
    }
}
