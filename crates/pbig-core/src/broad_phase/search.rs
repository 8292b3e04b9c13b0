//! The update of many changed boxes: all boxes are searched, by the CPU or a device, and the pairs are compared with the kept ones.
//! Where most ids have no box, the present boxes are listed first, and the search knows them by their places in the list.

use super::Task;
use super::world::World;
use crate::pairs::{Grouping, Groups, Kept};
use crate::policy;
use crate::report::stage;
use crate::search::{AllPairs, DeviceSlot, Request, Store};
use crate::{Aabb, Algorithm, Boxes, Error, Pair, ProxyFilter};

#[derive(Clone, Debug, Default)]
pub(super) struct Search {
    store: Store,
    all_pairs: AllPairs,
    groups: Groups,
    listed: Listed,
}

impl Search {
    /// Leaves the events of an update in the task, or replaces the kept pairs by the found ones, too. Returns false, and leaves all as it
    /// is, if it is given a device that could not find them.
    pub(super) fn run(
        &mut self,
        task: &mut Task<'_>,
        device: Option<&mut DeviceSlot>,
    ) -> Result<bool, Error> {
        let world = task.world;
        let is_listed = policy::is_listed(world.present.len(), world.ids());
        let (mut boxes, mut filters) = (&world.boxes, &world.filters);
        if is_listed {
            self.listed.take(world);
            (boxes, filters) = (&self.listed.boxes, &self.listed.filters);
        }
        let all = Boxes { boxes, filters: world.noted.is_filtered.then_some(&filters[..]), keys: None };
        let is_on_device = device.is_some();
        task.report.work += (boxes.len() - world.present.len()) as u64;
        let grouping = Grouping::new(boxes.len());
        if let Some(device) = device {
            if !self.all_pairs.find_on(device, &all, task.config, Some(grouping), task.report)? {
                return Ok(false);
            }
        } else {
            let request =
                Request { grouping: Some(grouping), is_repeated: true, ..Request::of_one(&all, task.config) };
            self.all_pairs.find(&request, &mut self.store, task.report)?;
        }
        if self.store.has_tree && !is_on_device && !is_listed {
            task.tree.adopt(&mut self.store.tree);
        }
        stage!(task.report, diff, self.compare(task, grouping, is_on_device, is_listed));
        Ok(true)
    }

    /// The next searches begin with streamed segment trees, as after grids and trees that took too much work.
    #[cfg(test)]
    pub(super) fn give_up_grids_and_trees(&mut self) {
        for _ in 0..4 {
            self.store.grids.note(true, 0);
            self.store.trees.note(true, 0);
        }
    }

    pub(super) fn settle(&mut self, pairs: usize) {
        self.store.grid.settle();
        self.all_pairs.settle(pairs);
        self.groups.settle(pairs);
    }

    fn compare(&mut self, task: &mut Task<'_>, grouping: Grouping, is_on_device: bool, is_listed: bool) {
        let algorithm = task.report.plan.algorithm;
        let is_brute = !is_on_device && matches!(algorithm, Algorithm::Brute | Algorithm::Nothing);
        let world = task.world;
        if world.has_removed() {
            drop_pairs_of_removed(world, task.kept);
        }
        let names = is_listed.then_some(&self.listed.ids[..]);
        if is_brute {
            let name = |place: u32| names.map_or(place, |names| names[place as usize]);
            let found = self.all_pairs.hits[0]
                .found
                .pairs
                .iter()
                .map(|pair| Pair { a: name(pair.a), b: name(pair.b) });
            return task.comparison.compare_sorted(world.present.iter(), found, task.kept);
        }
        self.all_pairs.gather(grouping, &mut self.groups);
        if let Some(names) = names {
            self.groups.rename_partners(names);
        }
        let doubted = is_on_device.then_some(&world.present);
        let workers = AllPairs::workers(grouping.ids);
        task.comparison.run((&mut self.groups, names), task.kept, workers, doubted);
    }
}

/// The ids of present boxes, in order, and what decides about their pairs: work on them follows the boxes that are left after a peak,
/// not the ids.
#[derive(Clone, Debug, Default)]
struct Listed {
    ids: Vec<u32>,
    boxes: Vec<Aabb>,
    /// Empty if no box of the world was ever filtered.
    filters: Vec<ProxyFilter>,
}

impl Listed {
    fn take(&mut self, world: &World) {
        let Self { ids, boxes, filters } = self;
        ids.clear();
        ids.extend(world.present.iter());
        boxes.clear();
        boxes.extend(ids.iter().map(|id| world.boxes[*id as usize]));
        filters.clear();
        if world.noted.is_filtered {
            filters.extend(ids.iter().map(|id| world.filters[*id as usize]));
        }
    }
}

/// Drops the kept pairs of boxes that were removed since the last update. Boxes left after a peak are few, so it reads their rows only.
fn drop_pairs_of_removed(world: &World, kept: &mut Kept) {
    let absent = world.removed.iter().copied().filter(|id| !world.contains(*id));
    let pairs = |a: u32| kept.rows_of(a).1.iter().map(move |&b| Pair { a, b });
    let has_ended = |pair: &Pair| world.was_removed(pair.a) || world.was_removed(pair.b);
    let all = world.present.iter().chain(absent).flat_map(pairs);
    let mut dropped: Vec<Pair> = all.filter(has_ended).collect();
    // Two sorted lists one behind the other: a stable sort merges them.
    dropped.sort();
    kept.drop_pairs(&dropped);
}
