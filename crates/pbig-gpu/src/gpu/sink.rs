//! The pairs of a search on a device: those read back so far, and all of them in the end.

use super::{Failure, GpuPlan};
use crate::layout::{COUNTED, Params, Totals, wide};
use pbig_core::{DeviceFound, PairList};
use pbig_shaders::{Kernel, Stage};
use std::time::Duration;

/// The pairs and counts of a search so far.
#[derive(Debug, Default)]
pub(super) struct Sink {
    pub(super) found: DeviceFound,
    /// Words of output so far.
    pub(super) words: u64,
    /// Maximum number of pairs.
    max_pairs: u64,
}

impl Sink {
    /// Returns an empty result with the memory of `pairs`.
    pub(super) fn new(mut pairs: PairList, max_pairs: u64) -> Self {
        pairs.clear();
        let mut found = DeviceFound::default();
        (found.pairs, found.report.parts) = (pairs, 1);
        Self { found, words: 0, max_pairs }
    }

    /// Notes the grid. Of several parts the last one's is reported.
    pub(super) fn note_plan(&mut self, plan: Option<&GpuPlan>) {
        self.found.plan = plan.map(GpuPlan::to_string);
        self.found.report.cell = plan.map_or(0.0, |plan| plan.cell);
    }

    /// Returns the number of pairs so far.
    pub(super) fn pairs(&self) -> u64 {
        self.found.pairs.len() as u64
    }

    pub(super) fn left(&self) -> u64 {
        self.max_pairs.saturating_sub(self.pairs())
    }

    /// Returns an error if `more` pairs are too many, or those so far.
    pub(super) fn check(&self, more: u64) -> Result<(), Failure> {
        if self.pairs().saturating_add(more) > self.max_pairs { Err(Failure::TooManyPairs) } else { Ok(()) }
    }

    /// Adds the counts of a chunk with this number of words of output. A device counts tests only if it was told to.
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

    pub(super) fn add_time(&mut self, kernel: &Kernel, time: Duration) {
        let report = &mut self.found.report;
        match report.kernels.iter_mut().find(|(known, _)| *known == kernel.name) {
            Some((_, sum)) => *sum += time,
            None => report.kernels.push((kernel.name, time)),
        }
        if kernel.stage == Stage::Map {
            report.map += time;
        }
    }

    pub(super) fn end(mut self) -> DeviceFound {
        let ratio = self.words as f64 / (2 * self.pairs()) as f64;
        self.found.report.compression = if self.pairs() > 0 { ratio } else { 0.0 };
        self.found
    }
}
