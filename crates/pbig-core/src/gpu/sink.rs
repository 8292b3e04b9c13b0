//! The pairs of a search on a device: those read back so far, and all of them in the end.

use super::{Failure, GpuPlan};
use crate::layout::{COUNTED, Params, Totals, wide};
use crate::report::{Checks, GpuReport};
use crate::{Error, Pair};
use std::time::Duration;

/// The pairs that a device found, and how it found them. There is none of a search that failed.
#[derive(Debug, Default)]
pub struct GpuFound {
    /// Pairs that overlap and that the filters allow, each once; of a search for changes, those that did not at the last
    /// update.
    pub pairs: Vec<Pair>,
    /// Allowed pairs that overlapped at the last update and no longer do, each once. Empty in a search for all pairs.
    pub ended: Vec<Pair>,
    /// The pairs are in order.
    pub is_sorted: bool,
    /// Ids of boxes that a search for changes treated as new, ascending.
    pub restarted: Vec<u32>,
    /// Number of valid boxes; in a search for changes, of boxes that are valid now or were at the last update.
    pub valid: u32,
    /// The grid; none if every pair was tested, or if fewer than two boxes are valid. Of several parts, the last one's.
    pub plan: Option<GpuPlan>,
    /// Tests made.
    pub checks: Checks,
    /// Work of the device.
    pub report: GpuReport,
}

/// The pairs and counts of a search so far.
#[derive(Default)]
pub(super) struct Sink {
    pub(super) found: GpuFound,
    /// Words of output so far.
    pub(super) words: u64,
    /// The caller's limit of pairs.
    pub(super) limit: u64,
    /// Number of kept pairs in a search for changes. As many may be removed without counting against the limit.
    pub(super) kept: u64,
}

impl Sink {
    /// Returns the number of pairs so far.
    pub(super) fn pairs(&self) -> u64 {
        (self.found.pairs.len() + self.found.ended.len()) as u64
    }

    pub(super) fn left(&self) -> u64 {
        self.limit.saturating_add(self.kept).saturating_sub(self.pairs())
    }

    /// Returns an error if `more` pairs are too many, or those so far.
    pub(super) fn check(&self, more: u64) -> Result<(), Failure> {
        let (limit, all) = (self.limit, self.limit.saturating_add(self.kept));
        if self.pairs().saturating_add(more) > all {
            Err(Failure::Call(Error::TooManyPairs { limit }))
        } else {
            Ok(())
        }
    }

    /// Adds the counts of a chunk with so many words of output. Only a device that was told to counts tests.
    pub(super) fn count(&mut self, params: &Params, totals: &Totals, words: u64) {
        self.words += words;
        let checks = &mut self.found.checks;
        if params.flags & COUNTED != 0 {
            let (made, redundant) = (wide(totals.made), wide(totals.redundant));
            checks.made += made;
            checks.redundant += redundant;
            checks.unnecessary += made.saturating_sub(redundant + wide(totals.overlaps));
        }
    }

    pub(super) fn add_time(&mut self, name: &'static str, time: Duration) {
        let kernels = &mut self.found.report.kernels;
        match kernels.iter_mut().find(|(known, _)| *known == name) {
            Some((_, sum)) => *sum += time,
            None => kernels.push((name, time)),
        }
    }

    pub(super) fn end(mut self) -> GpuFound {
        let ratio = self.words as f64 / (2 * self.pairs()) as f64;
        self.found.report.compression = if self.pairs() > 0 { ratio } else { 0.0 };
        self.found
    }
}
