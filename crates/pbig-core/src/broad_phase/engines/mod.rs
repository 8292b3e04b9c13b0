//! The engines: each gets a [`Task`], leaves the events in it, and returns an [`Outcome`].

pub(super) mod device;
pub(super) mod edit;
mod listed;
mod partners;
mod rebuild;
mod sweep;
mod task;
mod tree;

use crate::Engine;
use crate::outcome::Outcome;
use edit::Edit;
use rebuild::Rebuild;
use sweep::Sweep;
pub(super) use task::Task;
use tree::LookUp;

/// The engines on the CPU, each with its buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Engines {
    sweep: Sweep,
    pub(super) edit: Edit,
    tree: LookUp,
    rebuild: Rebuild,
}

impl Engines {
    pub(super) fn run(&mut self, engine: Engine, task: &mut Task<'_>) -> Outcome {
        match engine {
            Engine::Sweep => self.sweep.run(task),
            Engine::Edit => self.edit.run(task),
            Engine::Tree => self.tree.run(task),
            Engine::Rebuild => self.rebuild.run(task),
        }
    }
}
