//! Counts of what the updates did.

use crate::{Colliders, Tree};
use pbig_core::Report;

/// Counts of the last update. Rapier 0.27 makes two updates in each step: the first sees what the app changed, the second what
/// the step moved. After a step these are the numbers of the second one; [`Totals`] adds up both. Rapier 0.36 makes one. Both make
/// one more for each further substep of continuous collision detection.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Stats<'a> {
    /// Known colliders, disabled ones included.
    pub colliders: usize,
    /// Colliders that rapier listed as modified, and boxes that the step before moved: in rapier 0.36 these are not listed. One that
    /// did both counts twice.
    pub modified: usize,
    /// Colliders that rapier listed as removed or disabled.
    pub removed: usize,
    /// `AddPair` events sent.
    pub added: usize,
    /// `DeletePair` events sent.
    pub deleted: usize,
    /// Sums over all updates.
    pub totals: Totals,
    /// The core's report on its last update: stage times, algorithm and counts.
    pub report: &'a Report,
}

/// Sums over all updates so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Totals {
    /// Updates.
    pub updates: u64,
    /// Updates that read all colliders, because the world was not the one known so far.
    pub rescans: u64,
    /// Updates with an error.
    pub failures: u64,
    /// `AddPair` events.
    pub added: u64,
    /// `DeletePair` events.
    pub deleted: u64,
}

/// The part of [`Stats`] that the adapter counts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Counts {
    pub(crate) modified: usize,
    /// Boxes moved by steps since the last update.
    pub(crate) moved: usize,
    pub(crate) removed: usize,
    pub(crate) added: usize,
    pub(crate) deleted: usize,
    pub(crate) totals: Totals,
}

impl Counts {
    pub(crate) fn note_events(&mut self, added: usize, deleted: usize) {
        (self.added, self.deleted) = (added, deleted);
        self.totals.added += added as u64;
        self.totals.deleted += deleted as u64;
    }
}

impl<T: Tree> Colliders<T> {
    /// Returns the counts of the last update.
    pub fn stats(&self) -> Stats<'_> {
        let Counts { modified, removed, added, deleted, totals, .. } = self.counts;
        let (colliders, report) = (self.registry.len(), self.core.report());
        Stats { colliders, modified, removed, added, deleted, totals, report }
    }
}
