//! The engine for many changed boxes: all boxes are searched, by the CPU or a device, and the pairs are compared with the kept ones.
//! Where most ids have no box, the present boxes are listed first, and the search knows them by their places in the list.

use super::Task;
use super::listed::Listed;
use crate::all_pairs::{AllPairs, Request};
use crate::broad_phase::world::World;
use crate::device_slot::DeviceSlot;
use crate::holder::Holder;
use crate::outcome::{End, Outcome};
use crate::pairs::{Grouping, Groups, Kept};
use crate::policy;
use crate::report::{Clock, stage};
use crate::{Boxes, Pair};

/// The buffers of the engine.
#[derive(Clone, Debug, Default)]
pub(super) struct Rebuild {
    all_pairs: AllPairs,
    groups: Groups,
    listed: Listed,
}

impl Rebuild {
    /// Leaves the events of an update in the task, and replaces the kept pairs by the found ones. Gives up, and leaves all as it is, if
    /// it is given a device that could not find them.
    pub(super) fn run(&mut self, task: &mut Task<'_>, device: Option<&mut DeviceSlot>) -> Outcome {
        let world = task.world;
        let is_listed = policy::is_listed(world.present.len(), world.ids());
        let (mut boxes, mut filters) = (&world.boxes, &world.filters);
        if is_listed {
            self.listed.take(world);
            (boxes, filters) = (&self.listed.boxes, &self.listed.filters);
        }
        let filters = world.is_filtered.then_some(&filters[..]);
        let all = Boxes { boxes, filters, keys: None };
        self.groups.may_repeat = device.is_some();
        let mut outcome = search(&mut self.all_pairs, &all, task, device);
        outcome.work += (boxes.len() - world.present.len()) as u64;
        if outcome.end == End::Done {
            let mut clock = Clock::start();
            self.compare(task, outcome.holder, is_listed);
            outcome.stages.diff = clock.lap();
            outcome.has_replaced_kept = true;
        } else if outcome.end == End::GivenUp {
            // The structure on the CPU is untouched, so another engine may go on with it.
            outcome.holder = task.holder;
        }
        outcome
    }

    /// Gives memory back if as many pairs are expected.
    pub(super) fn settle(&mut self, pairs: usize) {
        self.all_pairs.settle(pairs);
        self.groups.settle(pairs);
    }

    /// Compares the found pairs with the kept ones.
    fn compare(&mut self, task: &mut Task<'_>, holder: Holder, is_listed: bool) {
        stage!("diff");
        let world = task.world;
        if world.has_removed() {
            drop_pairs_of_removed(world, task.kept);
        }
        let boxes = if is_listed { self.listed.ids.len() } else { world.ids() };
        self.all_pairs.gather(Grouping::new(boxes), &mut self.groups);
        let names = is_listed.then_some(&self.listed.ids[..]);
        if let Some(names) = names {
            task.store.rename(holder, names);
            self.groups.rename_partners(names);
        }
        task.events.run((&mut self.groups, names), task.kept, AllPairs::workers(boxes));
    }
}

/// Leaves the pairs of all boxes in `all_pairs`.
fn search(
    all_pairs: &mut AllPairs,
    all: &Boxes<'_>,
    task: &mut Task<'_>,
    device: Option<&mut DeviceSlot>,
) -> Outcome {
    let grouping = Some(Grouping::new(all.boxes.len()));
    if let Some(device) = device {
        return all_pairs.find_on(device, all, task.config, grouping);
    }
    let request = Request { grouping, ..Request::of_one(all, task.config) };
    all_pairs.find(&request, task.store)
}

/// Drops the kept pairs of boxes that were removed since the last update. Boxes left after a peak are few, so it reads their rows only.
fn drop_pairs_of_removed(world: &World, kept: &mut Kept) {
    let absent = world.removed.iter().copied().filter(|id| !world.contains(*id));
    let pairs = |a: u32| kept.later_partners(a).iter().map(move |&b| Pair { a, b });
    let has_ended = |pair: &Pair| world.was_removed(pair.a) || world.was_removed(pair.b);
    let all = world.present.iter().chain(absent).flat_map(pairs);
    let mut dropped: Vec<Pair> = all.filter(has_ended).collect();
    dropped.sort_unstable();
    kept.apply(&[], &dropped);
}
