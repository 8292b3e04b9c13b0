//! The input of an engine, and the place for its events.

use crate::Config;
use crate::all_pairs::Store;
use crate::broad_phase::world::World;
use crate::holder::Holder;
use crate::pairs::{Comparison, Kept};

/// An update: what an engine reads, and where it leaves the events.
pub(crate) struct Task<'a> {
    pub(crate) world: &'a World,
    pub(crate) config: &'a Config,
    /// The structure that holds the boxes of the last update.
    pub(crate) holder: Holder,
    pub(crate) store: &'a mut Store,
    pub(crate) kept: &'a mut Kept,
    /// The events. An engine clears them first, and leaves them sorted.
    pub(crate) events: &'a mut Comparison,
}

impl Task<'_> {
    /// Returns the maximum work of an engine. An engine that the caller chose has no limit.
    pub(super) fn unless_forced(&self, limit: u64) -> u64 {
        self.config.engine.map_or(limit, |_| u64::MAX)
    }
}
