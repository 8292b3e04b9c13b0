//! The last steps' times, for the graph and its figures.

use crate::choice::Choice;
use std::collections::VecDeque;

/// Steps that the graph shows.
pub const HISTORY_STEPS: usize = 300;

/// The times of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepTime {
    /// The broad phase that was measured.
    pub choice: Choice,
    /// Swaps of the broad phase before the step.
    pub swaps: u32,
    /// Time inside the broad phase, all its calls, in ms.
    pub broad_phase_ms: f64,
    /// Time of the whole step, the broad phase included, in ms.
    pub step_ms: f64,
}

/// The times of the last [`HISTORY_STEPS`] steps, oldest first.
#[derive(Clone, Debug, Default)]
pub struct History {
    steps: VecDeque<StepTime>,
    swaps: u32,
}

/// Figures of some times, in ms. All zero without times.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// The mean.
    pub mean: f64,
    /// The median; of an even count, the upper of the two in the middle.
    pub median: f64,
    /// The 99th percentile: the smallest time that at least 99% of the times do not exceed.
    pub p99: f64,
}

impl Summary {
    /// Summarizes times.
    pub fn of(times: impl IntoIterator<Item = f64>) -> Self {
        let mut times: Vec<f64> = times.into_iter().collect();
        times.sort_unstable_by(f64::total_cmp);
        let rank = (times.len() * 99).div_ceil(100);
        match times.get(rank.wrapping_sub(1)) {
            None => Self::default(),
            Some(&p99) => {
                let mean = times.iter().sum::<f64>() / times.len() as f64;
                Self { mean, median: times[times.len() / 2], p99 }
            }
        }
    }
}

impl History {
    /// Appends a step, and drops the oldest one if there are more than [`HISTORY_STEPS`].
    pub fn push(&mut self, step: StepTime) {
        if self.steps.len() == HISTORY_STEPS {
            self.steps.pop_front();
        }
        self.steps.push_back(step);
    }

    /// Counts a swap of the broad phase. Summaries start anew.
    pub fn count_swap(&mut self) {
        self.swaps += 1;
    }

    /// Returns the number of swaps so far.
    pub fn swaps(&self) -> u32 {
        self.swaps
    }

    /// Returns the steps, oldest first.
    pub fn steps(&self) -> impl ExactSizeIterator<Item = &StepTime> {
        self.steps.iter()
    }

    /// Returns the newest step since the last swap.
    pub fn last(&self) -> Option<&StepTime> {
        self.since_swap().next()
    }

    /// Returns the steps since the last swap, newest first.
    fn since_swap(&self) -> impl Iterator<Item = &StepTime> {
        self.steps.iter().rev().take_while(|step| step.swaps == self.swaps)
    }

    /// Summarizes one time of the shown steps since the last swap.
    pub fn summary(&self, time: impl Fn(&StepTime) -> f64) -> Summary {
        Summary::of(self.since_swap().map(time))
    }

    /// Returns the longest time inside the broad phase, in ms; 0 without steps.
    pub fn longest_broad_phase_ms(&self) -> f64 {
        self.steps.iter().map(|step| step.broad_phase_ms).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn push(history: &mut History, choice: Choice, broad_phase_ms: f64) {
        let swaps = history.swaps();
        history.push(StepTime { choice, swaps, broad_phase_ms, step_ms: 10.0 * broad_phase_ms });
    }

    #[test]
    fn p99_is_the_nearest_rank() {
        assert_eq!(Summary::of([]), Summary::default());
        assert_eq!(Summary::of([3.0]), Summary { mean: 3.0, median: 3.0, p99: 3.0 });
        assert_eq!(Summary::of((1..=100).map(f64::from)), Summary { mean: 50.5, median: 51.0, p99: 99.0 });
        assert_eq!(
            Summary::of((1..=101).rev().map(f64::from)),
            Summary { mean: 51.0, median: 51.0, p99: 100.0 }
        );
    }

    #[test]
    fn old_steps_leave_and_a_swap_starts_a_new_summary() {
        let mut history = History::default();
        (0..HISTORY_STEPS + 5).for_each(|i| push(&mut history, Choice::Stock, i as f64));
        assert_eq!(
            (history.steps().len(), history.steps().next().unwrap().broad_phase_ms),
            (HISTORY_STEPS, 5.0)
        );
        assert_eq!(history.longest_broad_phase_ms(), (HISTORY_STEPS + 4) as f64);
        history.count_swap();
        assert_eq!((history.last(), history.summary(|step| step.step_ms)), (None, Summary::default()));
        push(&mut history, Choice::Cpu, 1.0);
        push(&mut history, Choice::Cpu, 2.0);
        assert_eq!(history.summary(|step| step.broad_phase_ms), Summary { mean: 1.5, median: 2.0, p99: 2.0 });
        assert_eq!(history.summary(|step| step.step_ms).mean, 15.0);
    }

    #[test]
    fn a_broad_phase_that_comes_back_starts_a_new_summary() {
        let mut history = History::default();
        push(&mut history, Choice::Stock, 9.0);
        history.count_swap();
        history.count_swap();
        push(&mut history, Choice::Stock, 1.0);
        assert_eq!(history.summary(|step| step.broad_phase_ms).mean, 1.0);
        assert_eq!(history.longest_broad_phase_ms(), 9.0, "the graph shows all");
    }
}
