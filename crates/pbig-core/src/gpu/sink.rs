//! The collection of pairs and counts during a search.

use crate::layout::{Totals, wide};
use crate::report::{Checks, GpuReport};
use crate::{Error, Pair};
use std::time::Duration;

/// The pairs and counts of a search so far.
pub(super) struct Sink {
    pub(super) pairs: Vec<Vec<Pair>>,
    pub(super) pair_count: u64,
    /// Words of output so far.
    pub(super) words: u64,
    /// Most pairs that the search may find.
    pub(super) limit: u64,
    pub(super) checks: Checks,
    pub(super) report: GpuReport,
}

impl Sink {
    /// Returns how many more pairs the search may find.
    pub(super) fn left(&self) -> u64 {
        self.limit.saturating_sub(self.pair_count)
    }

    /// Adds decoded pairs.
    pub(super) fn add(&mut self, mut pieces: Vec<Vec<Pair>>) -> Result<(), Error> {
        self.pair_count += pieces.iter().map(|piece| piece.len() as u64).sum::<u64>();
        if self.pair_count > self.limit {
            return Err(Error::TooManyPairs { limit: self.limit });
        }
        self.pairs.append(&mut pieces);
        Ok(())
    }

    /// Adds the counts of a chunk.
    pub(super) fn count(&mut self, totals: &Totals) {
        let (made, redundant, overlaps) = (wide(totals.made), wide(totals.redundant), wide(totals.overlaps));
        self.checks.made += made;
        self.checks.redundant += redundant;
        self.checks.unnecessary += made.saturating_sub(redundant + overlaps);
    }

    /// Adds device times of kernels.
    pub(super) fn add_times(&mut self, times: &[(&'static str, Duration)]) {
        for &(name, time) in times {
            match self.report.kernels.iter_mut().find(|(known, _)| *known == name) {
                Some((_, sum)) => *sum += time,
                None => self.report.kernels.push((name, time)),
            }
        }
    }
}
