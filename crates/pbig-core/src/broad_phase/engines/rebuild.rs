//! The engine for many changed boxes: all boxes are searched, and the pairs are compared with the kept ones.

use super::task::Task;
use crate::all_pairs::{AllPairs, Request};
use crate::outcome::{End, Outcome};
use crate::pairs::{Grouping, Groups};
use crate::report::{Clock, stage};

/// The buffers of the engine.
#[derive(Clone, Debug, Default)]
pub(super) struct Rebuild {
    all_pairs: AllPairs,
    groups: Groups,
}

impl Rebuild {
    /// Leaves the events of an update in the task, and replaces the kept pairs by the found ones.
    pub(super) fn run(&mut self, task: &mut Task<'_>) -> Outcome {
        let (world, grouping) = (task.world, Grouping::new(task.world.ids()));
        let filters = world.is_filtered.then_some(&world.filters[..]);
        let request =
            Request { filters, grouping: Some(grouping), ..Request::new(&world.boxes, task.config) };
        let mut outcome = self.all_pairs.find(&request, task.store);
        if outcome.end != End::Done {
            return outcome;
        }
        stage!("diff");
        let mut clock = Clock::start();
        self.all_pairs.gather(grouping, &mut self.groups);
        let was_removed = |id: u32| world.was_removed(id);
        let is_removed: Option<&(dyn Fn(u32) -> bool + Sync)> =
            if world.has_removed() { Some(&was_removed) } else { None };
        let workers = AllPairs::workers(world.ids());
        task.events.run(&mut self.groups, task.kept, is_removed, workers);
        outcome.stages.diff = clock.lap();
        outcome.has_replaced_kept = true;
        outcome
    }
}
