//! Times of several sides that do the same work, in turn in one run: only such times compare.

use crate::output::Failure;
use pbig_harness::runner::{Spread, milliseconds};
use std::time::{Duration, Instant};

/// Seconds that all studies, and the papers' tables, may each take on two cores; and with `--quick`.
pub(crate) const MOST_SECONDS: [f64; 2] = [1200.0, 60.0];

/// Sides that do the same work, round by round.
pub(crate) trait Contest {
    /// Returns the number of sides.
    fn sides(&self) -> usize;

    /// Prepares a round. This is not measured.
    fn prepare(&mut self, round: usize);

    /// One side's work in this round, and its milliseconds.
    fn run(&mut self, side: usize) -> Result<f64, Failure>;
}

/// The length of a measurement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    /// Rounds that do not count: they allocate, fill caches, and learn how boxes move.
    pub(crate) warm_up: usize,
    /// Rounds that do, at most.
    pub(crate) rounds: usize,
    /// Time after which no further round starts, once there are enough for a median.
    pub(crate) budget: Duration,
}

impl Effort {
    /// Seconds for a row, or a fraction of one.
    pub(crate) fn new(quick: bool) -> Self {
        let (rounds, budget) = if quick { (31, 250) } else { (61, 6000) };
        let warm_up = if quick { 3 } else { 12 };
        Self { warm_up, rounds, budget: Duration::from_millis(budget) }
    }
}

/// The times of a side, in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Took {
    pub(crate) median: f64,
    /// The mean of all rounds. It includes its share of work that one round does for many.
    pub(crate) mean: f64,
}

/// The medians of [`measured`].
pub(crate) fn medians(contest: &mut impl Contest, effort: Effort) -> Result<Vec<f64>, Failure> {
    Ok(measured(contest, effort)?.iter().map(|took| took.median).collect())
}

/// Measures the sides. They change places from round to round, as the first in a round warms
/// the caches for the next: a side's median is the mean, over its places, of its median there.
pub(crate) fn measured(contest: &mut impl Contest, effort: Effort) -> Result<Vec<Took>, Failure> {
    let sides = contest.sides();
    // By place, then by side.
    let mut times = vec![vec![Vec::new(); sides]; sides];
    let enough = effort.warm_up + 3 * sides.min(2);
    let clock = Instant::now();
    for round in 0..effort.warm_up + effort.rounds {
        // After an even number of rounds, boxes that go to and fro are at home: the same pairs in every run.
        if round >= enough && round.is_multiple_of(2) && clock.elapsed() > effort.budget {
            break;
        }
        contest.prepare(round);
        for (place, times) in times.iter_mut().enumerate() {
            let side = (round + place) % sides;
            let time = contest.run(side)?;
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

/// Over the places in which there is a time.
pub(crate) fn mean_of_medians<'a>(places: impl IntoIterator<Item = &'a [f64]>) -> f64 {
    let median = |times: &[f64]| Spread::of(times.iter().copied()).median;
    let seen: Vec<f64> = places.into_iter().filter(|times| !times.is_empty()).map(median).collect();
    seen.iter().sum::<f64>() / seen.len().max(1) as f64
}

/// A call's result and its milliseconds.
pub(crate) fn timed<T>(call: impl FnOnce() -> T) -> (T, f64) {
    let clock = Instant::now();
    let result = call();
    (result, milliseconds(clock.elapsed()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Side 1 takes twice as long as side 0, and the first of a round 10 more.
    struct Known(bool);

    impl Contest for Known {
        fn sides(&self) -> usize {
            2
        }
        fn prepare(&mut self, _: usize) {
            self.0 = true;
        }
        fn run(&mut self, side: usize) -> Result<f64, Failure> {
            let cold = if std::mem::take(&mut self.0) { 10.0 } else { 0.0 };
            Ok(cold + [1.0, 2.0][side])
        }
    }

    #[test]
    fn places_in_a_round_favour_no_side() {
        let effort = Effort { warm_up: 1, rounds: 7, budget: Duration::MAX };
        assert_eq!(medians(&mut Known(false), effort).expect("no failure"), [6.0, 7.0]);
        // Side 1 is first in four of seven rounds.
        let mean = |side: usize| measured(&mut Known(false), effort).expect("no failure")[side].mean;
        assert_eq!([mean(0), mean(1)], [1.0 + 30.0 / 7.0, 2.0 + 40.0 / 7.0]);
    }
}
