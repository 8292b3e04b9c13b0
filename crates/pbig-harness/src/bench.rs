//! Times of several sides that do the same work, in turn in one run: only such times compare.

use crate::cells;
use crate::output::Failure;
use crate::runner::{Spread, milliseconds};
use crate::table::Value;
use std::time::{Duration, Instant};

/// The length of a measurement.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Rounds that do not count: they allocate, fill caches, and learn how boxes move.
    pub warm_up: usize,
    pub rounds: usize,
    /// Time after which no further round starts, if there are enough rounds for a median.
    pub budget: Duration,
}

impl Effort {
    /// Seconds for a row, or a fraction of one.
    pub fn new(quick: bool) -> Self {
        let (rounds, budget) = if quick { (31, 250) } else { (61, 6000) };
        let warm_up = if quick { 3 } else { 12 };
        Self { warm_up, rounds, budget: Duration::from_millis(budget) }
    }
}

/// The times of a side, in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Took {
    pub median: f64,
    /// The mean of all rounds. It includes its share of work that one round does for many.
    pub mean: f64,
}

/// The columns of a table in which pbig stands beside another side.
pub const COMPARED: &str = "case | boxes | pairs | unit | pbig_median | pbig_mean | other | other_median | other_mean | \
    other_over_pbig_median | other_over_pbig_mean";

/// A unit, and the factor from milliseconds to it.
pub type Unit = (&'static str, f64);

pub const MS: Unit = ("ms", 1.0);

/// Returns a row of [`COMPARED`].
pub fn compared(
    case: &str,
    boxes: usize,
    pairs: u64,
    unit: Unit,
    ours: Took,
    other: (&str, Took),
) -> Vec<Value> {
    let (name, theirs) = other;
    let of = |ms: f64| ms * unit.1;
    // A clock can tell 0.
    let times = |ours: f64, theirs: f64| theirs.max(1e-9) / ours.max(1e-9);
    let ratios = [times(ours.median, theirs.median), times(ours.mean, theirs.mean)];
    let [ours, theirs] = [ours, theirs].map(|took| [of(took.median), of(took.mean)]);
    cells![case, boxes, pairs, unit.0, ..ours, name, ..theirs, ..ratios]
}

/// Returns a row of [`COMPARED`] with one value of pbig's alone.
pub fn alone(case: &str, boxes: usize, pairs: u64, unit: &str, value: Option<f64>) -> Vec<Value> {
    cells![case, boxes, pairs, unit, value]
}

/// Prepares nothing, for [`measured`].
pub fn unprepared<S>(_: &mut S, _: usize) {}

/// Returns the medians of [`measured`].
pub fn medians<S>(
    state: &mut S,
    sides: usize,
    effort: Effort,
    prepare: impl FnMut(&mut S, usize),
    run: impl FnMut(&mut S, usize) -> Result<f64, Failure>,
) -> Result<Vec<f64>, Failure> {
    Ok(measured(state, sides, effort, prepare, run)?.iter().map(|took| took.median).collect())
}

/// Measures sides that do the same work, round by round. `prepare` gets the round and is not measured; `run` does one side's work
/// and returns its milliseconds. Sides change places from round to round, because the first in a round warms the caches for the
/// others. A side's median is the mean of its medians at each place.
pub fn measured<S>(
    state: &mut S,
    sides: usize,
    effort: Effort,
    mut prepare: impl FnMut(&mut S, usize),
    mut run: impl FnMut(&mut S, usize) -> Result<f64, Failure>,
) -> Result<Vec<Took>, Failure> {
    // By place, then by side.
    let mut times = vec![vec![Vec::new(); sides]; sides];
    let enough = effort.warm_up + 3 * sides.min(2);
    let clock = Instant::now();
    for round in 0..effort.warm_up + effort.rounds {
        // After an even number of rounds, boxes that go to and fro are at home: the same pairs in every run.
        if round >= enough && round.is_multiple_of(2) && clock.elapsed() > effort.budget {
            break;
        }
        prepare(state, round);
        for (place, times) in times.iter_mut().enumerate() {
            let side = (round + place) % sides;
            let time = run(state, side)?;
            if round >= effort.warm_up {
                times[side].push(time);
            }
        }
    }
    let took = |side: usize| {
        let places = || times.iter().map(|times| &times[side][..]);
        let (sum, count) = places().flatten().fold((0.0, 0), |(sum, count), time| (sum + time, count + 1));
        Took { median: mean_of_medians(places()), mean: sum / f64::from(count.max(1)) }
    };
    Ok((0..sides).map(took).collect())
}

/// Returns the mean of the medians of all places in which there is a time.
fn mean_of_medians<'a>(places: impl IntoIterator<Item = &'a [f64]>) -> f64 {
    let median = |times: &[f64]| Spread::of(times.iter().copied()).median;
    let seen: Vec<f64> = places.into_iter().filter(|times| !times.is_empty()).map(median).collect();
    seen.iter().sum::<f64>() / seen.len().max(1) as f64
}

/// Returns a call's result and its milliseconds.
pub fn timed<T>(call: impl FnOnce() -> T) -> (T, f64) {
    let clock = Instant::now();
    let result = call();
    (result, milliseconds(clock.elapsed()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_in_a_round_favour_no_side() {
        // Side 1 takes twice as long as side 0, and the first of a round 10 more.
        let effort = Effort { warm_up: 1, rounds: 7, budget: Duration::MAX };
        let run = |is_cold: &mut bool, side: usize| {
            Ok([1.0, 2.0][side] + if std::mem::take(is_cold) { 10.0 } else { 0.0 })
        };
        let took = measured(&mut false, 2, effort, |is_cold, _| *is_cold = true, run).expect("no failure");
        assert_eq!([took[0].median, took[1].median], [6.0, 7.0]);
        // Side 1 is first in four of seven rounds.
        assert_eq!([took[0].mean, took[1].mean], [1.0 + 30.0 / 7.0, 2.0 + 40.0 / 7.0]);
    }
}
