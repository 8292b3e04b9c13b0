//! The last steps' times, for the graph and its figures.

use crate::choice::Choice;
use pbig_scenes::times::Summary;
use std::collections::VecDeque;

/// Steps that the graph shows.
pub const HISTORY_STEPS: usize = 300;

/// The times of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredStep {
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
    steps: VecDeque<MeasuredStep>,
    swaps: u32,
}

impl History {
    /// Appends a step, and drops the oldest one if there are more than [`HISTORY_STEPS`].
    pub fn push(&mut self, step: MeasuredStep) {
        if self.steps.len() == HISTORY_STEPS {
            self.steps.pop_front();
        }
        self.steps.push_back(step);
    }

    /// Counts a swap of the broad phase. Summaries start anew.
    pub fn count_swap(&mut self) {
        self.swaps += 1;
    }

    pub fn swaps(&self) -> u32 {
        self.swaps
    }

    pub fn steps(&self) -> impl ExactSizeIterator<Item = &MeasuredStep> {
        self.steps.iter()
    }

    /// Returns the newest step since the last swap.
    pub fn last(&self) -> Option<&MeasuredStep> {
        self.since_swap().next()
    }

    /// Returns the steps since the last swap, newest first.
    fn since_swap(&self) -> impl Iterator<Item = &MeasuredStep> {
        self.steps.iter().rev().take_while(|step| step.swaps == self.swaps)
    }

    /// Summarizes one time of the shown steps since the last swap.
    pub fn summary(&self, time: impl Fn(&MeasuredStep) -> f64) -> Summary {
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
        history.push(MeasuredStep { choice, swaps, broad_phase_ms, step_ms: 10.0 * broad_phase_ms });
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
        assert_eq!(
            history.summary(|step| step.broad_phase_ms),
            Summary { mean: 1.5, median: 2.0, p99: 2.0, max: 2.0 }
        );
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
