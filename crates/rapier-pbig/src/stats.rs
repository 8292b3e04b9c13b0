//! What an update did, in numbers.

use crate::PbigBroadPhase;
use pbig_core::Report;
use std::time::{Duration, Instant};

/// Colliders or events from which their stages are timed: a reading of the clock takes as long as one.
pub(crate) const MEASURED_FROM: usize = 64;

/// Reads the clock, or does not.
pub(crate) struct Watch(Option<Instant>);

impl Watch {
    pub(crate) fn new(reads: bool) -> Self {
        Self(reads.then(Instant::now))
    }

    /// The time since the last lap; zero when the clock is not read.
    pub(crate) fn lap(&mut self) -> Duration {
        let Some(clock) = &mut self.0 else { return Duration::ZERO };
        let now = Instant::now();
        now.duration_since(std::mem::replace(clock, now))
    }
}

/// What the last update did. Rapier makes two in each step: the first sees what the app changed, the second
/// what the step moved. So after a step these are the numbers of the second; [`Totals`] count both.
#[derive(Clone, Copy, Debug)]
pub struct Stats<'a> {
    /// Colliders on the roll, disabled ones included.
    pub colliders: usize,
    /// Colliders that rapier listed as modified.
    pub modified: usize,
    /// Colliders that rapier listed as removed or disabled.
    pub removed: usize,
    /// `AddPair` events sent.
    pub added: usize,
    /// `DeletePair` events sent.
    pub deleted: usize,
    /// The sums over all updates.
    pub totals: Totals,
    /// Time for the boxes and filters of the modified colliders: reading colliders and bodies, and comparing each with
    /// what is stored. Zero for fewer than 64 colliders: reading the clock would take as long.
    pub proxies: Duration,
    /// Time for turning pairs of ids into events. Zero for fewer than 64.
    pub events: Duration,
    /// The finder's stages between `proxies` and `events`, its plan and counts.
    pub report: &'a Report,
}

/// Sums over all updates so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Updates.
    pub updates: u64,
    /// Those that looked at all colliders, because the world was not the one known so far.
    pub rescans: u64,
    /// Those that failed: `tracing` has the error, and the next one sees the same changes again.
    pub failures: u64,
    /// `AddPair` events.
    pub added: u64,
    /// `DeletePair` events.
    pub deleted: u64,
}

/// The part of [`Stats`] that is kept.
#[derive(Clone, Debug, Default)]
pub(crate) struct Kept {
    pub(crate) modified: usize,
    pub(crate) removed: usize,
    pub(crate) added: usize,
    pub(crate) deleted: usize,
    pub(crate) totals: Totals,
    pub(crate) proxies: Duration,
    pub(crate) events: Duration,
}

impl Stats<'_> {
    /// The time of all stages that were timed: nearly all of an update in which much changes.
    pub fn total(&self) -> Duration {
        self.proxies + self.report.stages.total() + self.events
    }
}

impl PbigBroadPhase {
    /// What the last update did.
    pub fn stats(&self) -> Stats<'_> {
        let Kept { modified, removed, added, deleted, totals, proxies, events } = self.kept;
        let (colliders, report) = (self.roll.len(), self.finder.report());
        Stats {
            colliders,
            modified,
            removed,
            added,
            deleted,
            totals,
            proxies,
            events,
            report,
        }
    }
}
