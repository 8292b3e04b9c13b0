//! The engines: each gets a [`Task`], leaves the events in it, and returns an [`Outcome`].

pub(super) mod edit;
mod listed;
mod partners;
mod rebuild;
mod sweep;
mod tree;

use super::world::World;
use crate::all_pairs::Store;
use crate::device_slot::DeviceSlot;
use crate::holder::Holder;
use crate::memory::Scratch;
use crate::outcome::Outcome;
use crate::pairs::{Comparison, Kept};
use crate::{Config, Engine};
use edit::Edit;
use rebuild::Rebuild;
use sweep::Sweep;
use tree::LookUp;

/// The engines on the CPU, each with its buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Engines {
    sweep: Sweep,
    pub(super) edit: Scratch<Edit>,
    tree: Scratch<LookUp>,
    rebuild: Scratch<Rebuild>,
}

impl Engines {
    /// Gives memory back if as many pairs are expected.
    pub(super) fn settle(&mut self, pairs: usize) {
        self.edit.settle();
        self.rebuild.settle(pairs);
    }

    pub(super) fn run(&mut self, engine: Engine, task: &mut Task<'_>) -> Outcome {
        match engine {
            Engine::Sweep => self.sweep.run(task),
            Engine::Edit => self.edit.run(task),
            Engine::Tree => self.tree.run(task),
            Engine::Rebuild => self.rebuild.run(task, None),
        }
    }

    /// Rebuilds with the pairs that a device finds.
    pub(super) fn run_on(&mut self, device: &mut DeviceSlot, task: &mut Task<'_>) -> Outcome {
        self.rebuild.run(task, Some(device))
    }
}

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
