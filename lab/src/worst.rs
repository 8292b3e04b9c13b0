//! The search for the world that makes pbig work most for what it finds: recipes are changed at random, and changes that raise
//! the work are kept.

use pbig_harness::hard::{
    Change, History, Part, Placement, Recipe, histories, ratio_of_history, ratio_of_search, ratio_of_two,
    shapes,
};
use pbig_harness::prelude::*;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::time::{Duration, Instant};

/// A step of the search starts again from a known world with a chance of one in this number.
const AFRESH_ONE_IN: u32 = 8;

/// Settings of a search.
#[derive(Clone, Copy, Debug)]
pub struct Search {
    /// The time that it may take.
    pub seconds: u64,
    /// For its random numbers.
    pub seed: u64,
    /// Boxes in a world.
    pub boxes: usize,
    /// Worlds to search among.
    pub kind: Kind,
}

/// Kinds of worlds to search among.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// Worlds of one set of boxes.
    OneSet,
    /// Worlds of two sets, whose pairs have a box of each.
    TwoSets,
    /// Worlds that change.
    Histories,
}

impl Kind {
    /// Returns the worlds of this kind from which a search begins.
    fn known(self) -> Vec<Find> {
        let all: Vec<Recipe> = shapes().into_iter().map(|(_, recipe)| recipe).collect();
        let next = all.iter().cycle().skip(1);
        match self {
            Self::OneSet => all.into_iter().map(Find::World).collect(),
            Self::TwoSets => {
                all.iter().zip(next).map(|(a, b)| Find::Two([a.clone(), b.clone()], 1)).collect()
            }
            Self::Histories => histories().into_iter().map(|(_, history)| Find::History(history)).collect(),
        }
    }
}

/// A world or a history that may be the worst.
#[derive(Clone, Debug)]
enum Find {
    World(Recipe),
    /// Two sets: the second one has this many times the boxes of the first one.
    Two([Recipe; 2], usize),
    History(History),
}

impl Find {
    fn ratio(&self, n: usize) -> Option<f64> {
        match self {
            Self::World(recipe) => ratio_of_search(recipe, n),
            Self::Two(sets, part) => ratio_of_two(sets, [n / (part + 1), n - n / (part + 1)]),
            Self::History(history) => ratio_of_history(history, n),
        }
    }

    fn mutated(&self, random: &mut StdRng) -> Self {
        match self {
            Self::World(recipe) => Self::World(mutated(recipe, random)),
            Self::Two([a, b], part) => match random.random_range(0..8) {
                0 => Self::Two([b.clone(), a.clone()], *part),
                1 => Self::Two([a.clone(), b.clone()], [1, 2, 10, 100][random.random_range(0..4)]),
                2..5 => Self::Two([mutated(a, random), b.clone()], *part),
                _ => Self::Two([a.clone(), mutated(b, random)], *part),
            },
            Self::History(history) => Self::History(mutated_history(history, random)),
        }
    }
}

/// Runs a search, and tells the worst finds.
pub fn run(search: Search) -> Result<BenchReport, Failure> {
    let mut random = StdRng::seed_from_u64(search.seed);
    let known = search.kind.known();
    let mut best: Vec<(f64, Find)> =
        known.iter().filter_map(|find| Some((find.ratio(search.boxes)?, find.clone()))).collect();
    let (clock, end) = (Instant::now(), Duration::from_secs(search.seconds));
    let bar = progress(search.seconds as usize, "seconds");
    let mut tried = known.len();
    while clock.elapsed() < end {
        let place = random.random_range(0..best.len());
        let start = if random.random_ratio(1, AFRESH_ONE_IN) {
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
    Ok(BenchReport::new("worst", vec![table]))
}

fn mutated(recipe: &Recipe, random: &mut StdRng) -> Recipe {
    let mut parts = recipe.0.clone();
    match random.random_range(0..8) {
        0 if parts.len() < 4 => parts.push(random_part(random)),
        1 if parts.len() < 4 => parts.push(mutated_part(parts[random.random_range(0..parts.len())], random)),
        2 if parts.len() > 1 => _ = parts.remove(random.random_range(0..parts.len())),
        _ => {
            let at = random.random_range(0..parts.len());
            parts[at] = mutated_part(parts[at], random);
        }
    }
    Recipe(parts)
}

/// Returns boxes of any size and shape, anywhere.
fn random_part(random: &mut StdRng) -> Part {
    let mut three = |decades: f32| [0; 3].map(|_| factor(random, decades));
    let (corner, width, half) = (three(3.0), three(4.0), three(4.0));
    mutated_part(Part { corner, width, half, ..Part::CUBES }, random)
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
            part.place = [Placement::Anywhere, Placement::Line, Placement::Lattice, Placement::Around]
                [random.random_range(0..4)];
        }
        _ => {
            let scale = factor(random, 3.0);
            part.half = part.half.map(|half| half * scale);
            part.width = part.width.map(|width| width * scale);
        }
    }
    part
}

/// Returns a random factor within this number of decades up or down.
fn factor(random: &mut StdRng, decades: f32) -> f32 {
    10f32.powf(random.random_range(-decades..decades))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_finds_worse_worlds_than_it_begins_with() {
        for kind in [Kind::OneSet, Kind::TwoSets, Kind::Histories] {
            let of = |seconds: u64| {
                let report = run(Search { seconds, seed: 1, boxes: 1000, kind }).expect("a search");
                report.tables[0].numbers("ratio")
            };
            let (start, end) = (of(0), of(1));
            assert_eq!(start.len(), end.len());
            assert!(start.iter().sum::<f64>() < end.iter().sum(), "{kind:?}: {start:?} {end:?}");
        }
    }
}
