//! The times and pairs of each margin: the same rounds several times over, all margins in turn in each round.

use crate::reported::Reported;
use pbig_harness::bench::{Contest, Effort, medians};
use pbig_harness::output::Failure;
use pbig_harness::runner::StepTime;
use std::time::Duration;

/// In units of rapier's length unit, as `Config::margin`.
pub(super) const MARGINS: [f64; 8] = [0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5];

/// Rounds that do not count: boxes are new in the first, and later ones learn how they move.
const WARM_UP: usize = 8;

/// Pairs are compared with brute force in one of so many rounds.
const COMPARED: usize = 10;

/// All is done so often. The work is the same each time, so the shortest time of each round is the one least disturbed.
/// (A median over rounds would hide what a margin does: boxes of one speed leave their fat boxes in the same round.)
const PASSES: usize = 2;

/// One margin's part.
#[derive(Clone, Debug, Default)]
pub(super) struct Tally {
    rounds: usize,
    times: Vec<StepTime>,
    /// Boxes that the broad phase was told of, in the counted rounds.
    pub(super) listed: u64,
    /// Those of them that had left their fat box.
    pub(super) changed: u64,
    /// In the rounds that were compared.
    pub(super) reported: Reported,
    /// Rounds that were compared.
    pub(super) compared: u64,
}

impl Tally {
    /// Returns true if pairs are compared in this round.
    pub(super) fn compares(round: usize) -> bool {
        round >= WARM_UP && (round + 1).is_multiple_of(COMPARED)
    }

    /// A round is done; `reported` is asked if it is one to compare.
    pub(super) fn note(
        &mut self,
        time: StepTime,
        [listed, changed]: [u64; 2],
        reported: impl FnOnce() -> Reported,
    ) {
        if Self::compares(self.rounds) {
            self.reported += reported();
            self.compared += 1;
        }
        if self.rounds >= WARM_UP {
            self.times.push(time);
            self.listed += listed;
            self.changed += changed;
        }
        self.rounds += 1;
    }

    /// Of the counted rounds: milliseconds of each, on average.
    pub(super) fn mean(&self, of: fn(&StepTime) -> f64) -> f64 {
        self.times.iter().map(of).sum::<f64>() / self.times.len().max(1) as f64
    }

    fn mean_time(&self) -> StepTime {
        StepTime { broad_phase: self.mean(|time| time.broad_phase), step: self.mean(|time| time.step) }
    }

    /// Rounds that count.
    pub(super) fn counted(&self) -> usize {
        self.times.len()
    }

    /// Takes the shorter time of each round.
    fn shorten(&mut self, again: &Self) {
        for (time, other) in self.times.iter_mut().zip(&again.times) {
            time.broad_phase = time.broad_phase.min(other.broad_phase);
            time.step = time.step.min(other.step);
        }
    }
}

/// Margins that take part, and what they have done.
pub(super) trait Tallied: Contest {
    fn tallies(self) -> Vec<Tally>;
}

/// The results of the passes.
pub(super) struct Passes {
    /// By margin.
    pub(super) tallies: Vec<Tally>,
    /// By margin, then by pass: a step, on average.
    pub(super) means: Vec<Vec<StepTime>>,
}

/// Makes the contest anew for each pass.
pub(super) fn passes<C: Tallied>(
    counted: usize,
    make: impl Fn() -> Result<C, Failure>,
) -> Result<Passes, Failure> {
    let effort = Effort { warm_up: 0, rounds: WARM_UP + counted, budget: Duration::MAX };
    let pass = |_| -> Result<Vec<Tally>, Failure> {
        let mut contest = make()?;
        medians(&mut contest, effort)?;
        Ok(contest.tallies())
    };
    Ok(joined((0..PASSES).map(pass).collect::<Result<_, _>>()?))
}

/// From the tallies of each pass, by margin.
fn joined(all: Vec<Vec<Tally>>) -> Passes {
    let margins = all.first().map_or(0, Vec::len);
    let of = |margin: usize| all.iter().map(|tallies| tallies[margin].mean_time()).collect();
    let means = (0..margins).map(of).collect();
    let shorter = |mut one: Vec<Tally>, again: Vec<Tally>| {
        one.iter_mut().zip(&again).for_each(|(tally, again)| tally.shorten(again));
        one
    };
    Passes { tallies: all.into_iter().reduce(shorter).unwrap_or_default(), means }
}
