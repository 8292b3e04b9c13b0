//! The pairs of a search on a device: those read back so far, and all of them in the end.

use super::{Failure, GpuPlan};
use crate::layout::{Totals, wide};
use crate::report::{Checks, GpuReport};
use crate::{Error, Pair};
use std::time::Duration;

/// The pairs that a device found, and how it found them. There is none of a search that failed.
#[derive(Debug, Default)]
pub struct GpuFound {
    /// Pairs, each once, in no particular order: a list for each piece of decoded output. A search for all pairs finds
    /// those that overlap and that the filters allow; a search for changes, allowed pairs that overlap now and did not at
    /// the last update, or the other way round.
    pub pairs: Vec<Vec<Pair>>,
    /// Ids of boxes that a search for changes treated as new.
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
    pub(super) pairs: u64,
    /// Words of output so far.
    pub(super) words: u64,
    /// The caller's limit of pairs.
    pub(super) limit: u64,
    /// Number of kept pairs in a search for changes. As many may be removed without counting against the limit.
    pub(super) kept: u64,
}

impl Sink {
    pub(super) fn left(&self) -> u64 {
        self.limit.saturating_add(self.kept).saturating_sub(self.pairs)
    }

    /// Returns an error if `more` pairs are too many.
    pub(super) fn check(&self, more: u64) -> Result<(), Failure> {
        let limit = self.limit;
        if more > self.left() { Err(Failure::Call(Error::TooManyPairs { limit })) } else { Ok(()) }
    }

    pub(super) fn add(&mut self, mut pieces: Vec<Vec<Pair>>) -> Result<(), Failure> {
        let pairs = pieces.iter().map(|piece| piece.len() as u64).sum();
        self.check(pairs)?;
        self.pairs += pairs;
        self.found.pairs.append(&mut pieces);
        Ok(())
    }

    /// Adds the counts of a chunk with so many words of output.
    pub(super) fn count(&mut self, totals: &Totals, words: u64) {
        self.words += words;
        let (made, redundant, overlaps) = (wide(totals.made), wide(totals.redundant), wide(totals.overlaps));
        let checks = &mut self.found.checks;
        checks.made += made;
        checks.redundant += redundant;
        checks.unnecessary += made.saturating_sub(redundant + overlaps);
    }

    pub(super) fn add_time(&mut self, name: &'static str, time: Duration) {
        let kernels = &mut self.found.report.kernels;
        match kernels.iter_mut().find(|(known, _)| *known == name) {
            Some((_, sum)) => *sum += time,
            None => kernels.push((name, time)),
        }
    }

    pub(super) fn end(mut self, plan: Option<GpuPlan>, valid: u32) -> GpuFound {
        (self.found.plan, self.found.valid) = (plan, valid);
        let ratio = self.words as f64 / (2 * self.pairs) as f64;
        self.found.report.compression = if self.pairs > 0 { ratio } else { 0.0 };
        self.found
    }
}
