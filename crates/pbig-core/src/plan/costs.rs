//! What work costs, and what the ways to search a set would take: the plan compares forecasts, and what searches then
//! took corrects them.

use crate::config::{Config, Grids};
use std::fmt;

/// What a unit of work costs on one core, in ns. Only time depends on it: results are the same whatever the plan.
///
/// [`Costs::REFERENCE`] will do where a choice is clear. Where it is close, what this machine takes is measured, once in
/// a process (0.2 to 0.3 ms), unless [`crate::Config::costs`] has costs: with given ones the same boxes get the same plan on
/// any machine, as long as searches start from nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Costs {
    /// A test of two boxes in a sweep over a list: brute force.
    pub test: f32,
    /// Starting such a sweep.
    pub sweep: f32,
    /// Sorting a box into a grid and starting its search there.
    pub place: f32,
    /// A candidate of that search.
    pub candidate: f32,
    /// Starting the search for a box in the grid of another level.
    pub visit: f32,
    /// A candidate of that search: many of them overlap, so that they are read.
    pub visited: f32,
    /// One more grid, however small.
    pub grid: f32,
    /// A pair that overlaps, however it is found.
    pub pair: f32,
}

impl Costs {
    /// Of a core of an AMD EPYC (Zen 4, 2.4 GHz, one thread). Fitted to 320 plans, several for each of 26 sets (edges over
    /// one to six decades, 0.1 to 30 pairs a box, a few or many larger boxes among others, dust around large ones), then
    /// adjusted on 12 of them, when visits had become three times as fast: plans took at most 1.10 times as long as the
    /// best of one grid, other splits, and a list. Those by the costs of an older search took up to 4.4 times as long as
    /// the best (edges over four decades, ten pairs a box: 40 ms, one grid 9): a candidate in a box's own level costs far
    /// less than it did, and so few sets are worth a second level.
    pub const REFERENCE: Self = Self {
        test: 2.0,
        sweep: 20.0,
        place: 50.0,
        candidate: 0.5,
        visit: 80.0,
        visited: 1.0,
        grid: 700.0,
        pair: 13.0,
    };
}

/// A way to search a set from nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    /// Every pair is tested.
    Brute = 0,
    /// All boxes in one grid.
    OneGrid = 1,
    /// Grids by size, or one and a list.
    Levels = 2,
}

impl Way {
    /// The one that is asked for.
    pub(super) fn asked(config: &Config) -> Option<Self> {
        match config.study.grids {
            Grids::Auto => None,
            Grids::One => Some(Self::OneGrid),
            Grids::Levels => Some(Self::Levels),
        }
    }
}

/// What the ways to search a set would take, in ns on one core, pairs not counted; infinite for one that is not possible
/// or not allowed, all 0 where nothing was compared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Forecast {
    /// Testing every pair.
    pub brute: f32,
    /// One grid for all boxes.
    pub one_grid: f32,
    /// The best split into several grids, or one and a list.
    pub levels: f32,
}

/// How far the machine's costs may be from the reference for each other.
const UNLIKE: f32 = 4.0;

impl Forecast {
    pub(super) fn of(&self, way: Way) -> f32 {
        [self.brute, self.one_grid, self.levels][way as usize]
    }

    /// The cheapest way, or the one before unless that is much dearer: the choice does not flap.
    pub(super) fn best(&self, before: Option<Way>) -> Way {
        let ways = [Way::Brute, Way::OneGrid, Way::Levels];
        let best =
            ways.into_iter().min_by(|a, b| self.of(*a).total_cmp(&self.of(*b))).unwrap_or(Way::OneGrid);
        before.filter(|&way| self.of(best) >= Experience::BETTER * self.of(way)).unwrap_or(best)
    }

    /// Whether the choice could be another on another machine.
    pub(crate) fn is_close(&self) -> bool {
        let mut costs = [self.brute, self.one_grid, self.levels];
        costs.sort_unstable_by(f32::total_cmp);
        costs[0] > 0.0 && costs[1] < UNLIKE * costs[0]
    }

    fn times(&self, factors: [f32; 3]) -> Self {
        Self {
            brute: self.brute * factors[0],
            one_grid: self.one_grid * factors[1],
            levels: self.levels * factors[2],
        }
    }
}

/// `brute force 0.45 ms, one grid 0.012 ms`.
impl fmt::Display for Forecast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = [("brute force", self.brute), ("one grid", self.one_grid), ("levels", self.levels)];
        let possible = named.into_iter().filter(|(_, ns)| ns.is_finite());
        for (i, (name, ns)) in possible.enumerate() {
            let comma = if i == 0 { "" } else { ", " };
            write!(f, "{comma}{name} {}", Milliseconds(ns))?;
        }
        Ok(())
    }
}

/// Two digits: more would not be true.
pub(super) struct Milliseconds(pub(super) f32);

impl fmt::Display for Milliseconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = f64::from(self.0) * 1e-6;
        let digits = (1 - ms.max(1e-6).log10().floor() as i32).clamp(0, 6) as usize;
        write!(f, "{ms:.digits$} ms")
    }
}

/// What searches took against what was forecast.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Experience {
    /// By [`Way`]: on what is forecast.
    factors: [f32; 3],
    /// The way of the search before.
    before: Option<Way>,
}

impl Default for Experience {
    fn default() -> Self {
        Self { factors: [1.0; 3], before: None }
    }
}

impl Experience {
    /// How much cheaper another way must be.
    const BETTER: f32 = 0.8;
    /// What one search counts: one that was interrupted must not decide.
    const SHARE: f32 = 0.125;
    /// One search says no more than this.
    const MOST_AT_ONCE: f32 = 2.0;
    /// All together say no more than this: sets change, and a way that is not taken cannot prove itself.
    const MOST: f32 = 4.0;

    /// The forecast in the light of experience, and the way to go.
    pub(super) fn choose(&self, forecast: Forecast) -> (Forecast, Way) {
        let corrected = forecast.times(self.factors);
        (corrected, corrected.best(self.before))
    }

    /// What a search took, pairs not counted, that would have taken `expected` by the costs alone.
    pub(crate) fn note(&mut self, (way, expected): (Way, f32), took: f32) {
        self.before = Some(way);
        if !(expected > 0.0 && expected.is_finite()) {
            return;
        }
        let factor = &mut self.factors[way as usize];
        let ratio = (took / expected / *factor).clamp(1.0 / Self::MOST_AT_ONCE, Self::MOST_AT_ONCE);
        *factor *= 1.0 + Self::SHARE * (ratio - 1.0);
        *factor = factor.clamp(1.0 / Self::MOST, Self::MOST);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Aabb, Finder, oracle};

    const CLOSE: Forecast = Forecast { brute: 100.0, one_grid: 90.0, levels: f32::INFINITY };

    #[test]
    fn the_choice_does_not_flap() {
        assert_eq!(CLOSE.best(None), Way::OneGrid);
        assert_eq!(CLOSE.best(Some(Way::Brute)), Way::Brute, "ten percent are not enough");
        assert_eq!(Forecast { one_grid: 79.0, ..CLOSE }.best(Some(Way::Brute)), Way::OneGrid);
        let (mut experience, mut changes, mut before) = (Experience::default(), 0, None);
        for i in 0..1000 {
            // The same cost in truth, as measured on a noisy machine.
            let way = experience.choose(CLOSE).1;
            let noise = [0.9, 1.0, 1.15, 1.0, 3.0][i % 5];
            experience.note((way, CLOSE.of(way)), 95.0 * noise);
            changes += u32::from(before.replace(way).is_some_and(|before| before != way));
        }
        assert!(changes <= 2, "{changes}");
    }

    #[test]
    fn a_way_that_takes_longer_than_forecast_is_left() {
        let mut experience = Experience::default();
        let mut searches = 0;
        while experience.choose(CLOSE).1 == Way::OneGrid {
            experience.note((Way::OneGrid, CLOSE.one_grid), 250.0);
            searches += 1;
        }
        assert!((3..20).contains(&searches), "{searches}");
    }

    #[test]
    fn one_interrupted_search_decides_nothing_and_nothing_is_learned_without_bounds() {
        let mut experience = Experience::default();
        experience.note((Way::OneGrid, 90.0), 9e6);
        assert_eq!(experience.choose(CLOSE).1, Way::OneGrid);
        for took in [9e6, 0.0] {
            for _ in 0..1000 {
                experience.note((Way::OneGrid, 90.0), took);
            }
            let factor = experience.factors[Way::OneGrid as usize];
            assert!(factor == 4.0 || factor == 0.25, "{factor}");
        }
        let before = experience.factors;
        experience.note((Way::Levels, f32::INFINITY), 1.0);
        assert_eq!(experience.factors, before, "no forecast, no lesson");
    }

    #[test]
    fn only_choices_that_are_close_need_a_measurement() {
        assert!(CLOSE.is_close());
        assert!(!Forecast { brute: 361.0, ..CLOSE }.is_close());
        assert!(!Forecast::default().is_close());
    }

    #[test]
    fn whatever_the_costs_pairs_are_the_same() {
        let mut random = 7u64;
        let mut next = |range: f32| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 40) as f32 / 16_777_216.0 * range
        };
        let mut boxes: Vec<Aabb> = Vec::new();
        for (count, half) in [(600, 0.001), (300, 0.3), (40, 4.0), (3, 30.0)] {
            boxes.extend(
                (0..count).map(|_| Aabb::from_center([next(30.0), next(30.0), next(30.0)], [half; 3])),
            );
        }
        let (wanted, mut plans) = (oracle::pairs(&boxes), std::collections::BTreeSet::new());
        for _ in 0..300 {
            let mut cost = || 10f32.powf(next(6.0) - 2.0);
            let [test, sweep, place, candidate] = [cost(), cost(), cost(), cost()];
            let [visit, visited, grid, pair] = [cost(), cost(), cost(), cost()];
            let costs = Costs { test, sweep, place, candidate, visit, visited, grid, pair };
            let mut finder = Finder::new(Config { costs: Some(costs), ..Config::DEFAULT });
            assert_eq!(finder.find(&boxes).expect("no limit"), wanted, "{costs:?}");
            let plan = &finder.report().plan;
            plans.insert((plan.levels.len(), plan.swept));
        }
        assert!(plans.len() > 6, "{plans:?}");
    }

    #[test]
    fn a_forecast_names_what_is_possible() {
        assert_eq!(CLOSE.to_string(), "brute force 0.00010 ms, one grid 0.000090 ms");
        assert_eq!(Milliseconds(12_345_678.0).to_string(), "12 ms");
    }
}
