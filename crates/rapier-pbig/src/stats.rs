//! What an update did, in numbers.

use crate::PbigBroadPhase;
use pbig_core::Report;
use std::time::Duration;

/// What the last update did. Rapier makes two in each step: the first sees what the app changed, the second
/// what the step moved.
#[derive(Clone, Copy, Debug)]
pub struct Stats<'a> {
    /// Updates so far, this one included.
    pub updates: u64,
    /// Colliders on the roll, disabled ones included.
    pub colliders: usize,
    /// Colliders that rapier listed as modified.
    pub modified: usize,
    /// Colliders that rapier listed as removed or disabled.
    pub removed: usize,
    /// Whether all colliders were looked at, because the world was not the one known so far.
    pub rescanned: bool,
    /// `AddPair` events sent.
    pub added: usize,
    /// `DeletePair` events sent.
    pub deleted: usize,
    /// Time for the boxes and filters of the modified colliders: reading colliders and bodies.
    pub proxies: Duration,
    /// Time for comparing those with what is stored.
    pub set: Duration,
    /// Time for turning pairs of ids into events.
    pub events: Duration,
    /// The finder's stages between `set` and `events`, its plan and counts.
    pub report: &'a Report,
}

/// The part of [`Stats`] that is kept.
#[derive(Clone, Debug, Default)]
pub(crate) struct Kept {
    pub(crate) updates: u64,
    pub(crate) modified: usize,
    pub(crate) removed: usize,
    pub(crate) rescanned: bool,
    pub(crate) added: usize,
    pub(crate) deleted: usize,
    pub(crate) proxies: Duration,
    pub(crate) set: Duration,
    pub(crate) events: Duration,
}

impl Stats<'_> {
    /// The time of the whole update.
    pub fn total(&self) -> Duration {
        self.proxies + self.set + self.report.stages.total() + self.events
    }
}

impl PbigBroadPhase {
    /// What the last update did.
    pub fn stats(&self) -> Stats<'_> {
        let Kept { updates, modified, removed, rescanned, added, deleted, proxies, set, events } = self.kept;
        let (colliders, report) = (self.roll.len(), self.finder.report());
        Stats {
            updates,
            colliders,
            modified,
            removed,
            rescanned,
            added,
            deleted,
            proxies,
            set,
            events,
            report,
        }
    }
}
