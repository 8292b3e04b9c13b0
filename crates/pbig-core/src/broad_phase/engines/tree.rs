//! The engine for few changed boxes where a tree is kept: each is looked up where it is, and what it overlaps is compared with its
//! kept pairs.

use super::Task;
use super::listed::Listed;
use super::partners::Partners;
use crate::grid::BLOCK;
use crate::holder::Holder;
use crate::outcome::{End, Outcome};
use crate::policy;
use crate::report::{Clock, stage};
use crate::{Algorithm, Checks, Plan};

/// The buffers of the engine.
#[derive(Clone, Debug, Default)]
pub(super) struct LookUp {
    partners: Partners,
    listed: Listed,
}

impl LookUp {
    /// Brings the tree up to date, and leaves the events of an update in the task. Gives up if it takes too much work.
    pub(super) fn run(&mut self, task: &mut Task<'_>) -> Outcome {
        stage!("tree");
        let mut clock = Clock::start();
        let world = task.world;
        let mut outcome = Outcome { holder: Holder::Tree, ..Outcome::default() };
        let refit = self.bring_up_to_date(task);
        outcome.stages.map = clock.lap();
        let max_work = task.unless_forced(policy::look_up_to_nodes(world.present.len()));
        let (nodes, met) = self.look_up(task, max_work);
        outcome.stages.check = clock.lap();
        let made = nodes * BLOCK as u64;
        outcome.checks = Checks { made, unnecessary: made - met, redundant: 0 };
        outcome.work = refit + made + nodes + met;
        outcome.plan = Plan { algorithm: Algorithm::Tree, boxes: world.valid, ..Plan::default() };
        outcome.end = if nodes + met <= max_work { End::Done } else { End::GivenUp };
        outcome
    }

    /// Refits the tree along the changed boxes, or sorts it. Returns the work, in boxes.
    fn bring_up_to_date(&mut self, task: &mut Task<'_>) -> u64 {
        let (world, tree) = (task.world, &mut task.store.tree);
        if task.holder == Holder::Tree && tree.follow(&world.boxes, &world.changed) {
            return world.changed.len() as u64;
        }
        self.listed.take(world);
        tree.sort(&self.listed.boxes);
        tree.rename(&self.listed.ids);
        (world.changed.len() + self.listed.ids.len()) as u64
    }

    /// Looks the changed boxes up, and leaves the events. Returns the numbers of nodes looked at and of boxes met. If they are
    /// more than `max_work` together, events are missing.
    fn look_up(&mut self, task: &mut Task<'_>, max_work: u64) -> (u64, u64) {
        let Task { world, kept, store, events, .. } = task;
        events.clear();
        let (mut nodes, mut met) = (0, 0);
        for &id in &world.changed {
            let (aabb, now) = (&world.boxes[id as usize], &mut self.partners.now);
            now.clear();
            nodes += store.tree.overlapping(aabb, |other| now.push(other));
            now.sort_unstable();
            met += now.len() as u64;
            if nodes + met > max_work {
                break;
            }
            self.partners.compare_all(world, kept, id, events);
        }
        events.sort(world.ids());
        (nodes, met)
    }
}
