//! All pairs of a list of boxes, or those of two sets: by grids, by a tree where a grid would test too many, or by testing every
//! pair of a few.

use super::brute::{brute_force, brute_force_across};
use super::grid::{Cells, Grid, TwoGrids};
use super::hits::{ById, Hits, Receiver, Rule};
use super::{Budget, DeviceSlot, join, streamed};
use crate::bvh::BoxIndex;
use crate::memory::{Scratch, ShrinkingVec};
use crate::pairs::{Grouping, Groups};
use crate::parallel::{available_threads, piece_range, run_with};
use crate::policy::{self, PARALLEL_FROM_BOXES, search};
use crate::report::{Checks, Report, stage};
use crate::{
    Aabb, Algorithm, Backend, Boxes, Config, Engine, Error, Keys, Pair, Plan, ProxyFilter, SearchRequest,
};
use std::sync::atomic::{AtomicU64, Ordering};

#[derive(Clone, Copy)]
pub(crate) struct Request<'a> {
    pub(crate) boxes: &'a [Aabb],
    /// The boxes of another set, whose ids are behind those of `boxes`. With it no two boxes of a set pair.
    pub(crate) others: Option<&'a [Aabb]>,
    /// None if all may pair.
    pub(crate) filters: Option<ById<'a, ProxyFilter>>,
    /// None if boxes have no keys.
    pub(crate) keys: Option<ById<'a, Keys>>,
    /// None if pairs are listed.
    pub(crate) receiver: Option<Receiver<'a>>,
    pub(crate) config: &'a Config,
    /// The groups by which found pairs are counted, for [`Groups::gather`]. Without one they are not counted.
    pub(crate) grouping: Option<Grouping>,
    /// The boxes are about those of the last search: a grid that was given up then is not tried at once.
    pub(crate) is_repeated: bool,
}

impl<'a> Request<'a> {
    /// Makes a search for all pairs of one set, whose groups are not counted.
    pub(crate) fn of_one(&Boxes { boxes, filters, keys }: &Boxes<'a>, config: &'a Config) -> Self {
        Self {
            boxes,
            others: None,
            filters: filters.map(ById::of_one),
            keys: keys.map(ById::of_one),
            receiver: None,
            config,
            grouping: None,
            is_repeated: false,
        }
    }

    fn count(&self) -> usize {
        self.boxes.len() + self.others.map_or(0, <[_]>::len)
    }

    /// Returns the boxes in one list, and the first id of the second set, if there is one. Two sets are copied into a buffer.
    fn in_one_list<'b>(&'b self, both_sets: &'b mut Vec<Aabb>) -> (&'b [Aabb], Option<u32>) {
        let Some(others) = self.others else { return (self.boxes, None) };
        both_sets.clear();
        both_sets.extend(self.boxes.iter().chain(others));
        (both_sets, Some(self.boxes.len() as u32))
    }

    /// Returns the rule for pairs, which `found` counts.
    pub(crate) fn rule(&self, found: &'a AtomicU64) -> Rule<'a> {
        let Self { filters, keys, receiver, .. } = *self;
        let max_pairs = if receiver.is_some() { u64::MAX } else { self.config.limits.pairs() };
        Rule { filters, keys, receiver, max_pairs, found, budget: None }
    }

    fn is_for_brute_force(&self) -> bool {
        let smaller = self.others.map(|others| others.len().min(self.boxes.len()));
        let is_few = self.count() <= policy::BRUTE_FORCE_UP_TO_BOXES
            || smaller.is_some_and(|few| few <= policy::FEW_BOXES);
        let may_be_brute = matches!(self.config.engine, None | Some(Engine::LookUp)) || smaller == Some(0);
        self.config.backend == Backend::Brute || may_be_brute && is_few
    }
}

/// The structures that hold the boxes of a search.
#[derive(Clone, Debug, Default)]
pub(crate) struct Store {
    pub(crate) grid: Scratch<Grid>,
    two_grids: Scratch<TwoGrids>,
    pub(crate) tree: BoxIndex,
    /// The tree has the boxes of the last search.
    pub(crate) has_tree: bool,
    /// Both sets in one list, for a tree.
    both_sets: Scratch<Vec<Aabb>>,
    /// Grids, and trees, that took too much work.
    pub(crate) grids: policy::GivenUp,
    pub(crate) trees: policy::GivenUp,
}

/// The buffers of a search: what each thread has found.
#[derive(Clone, Debug, Default)]
pub(crate) struct AllPairs {
    pub(crate) hits: Vec<Hits>,
    /// Memory for the answer of a device.
    answer: ShrinkingVec<Pair>,
}

impl AllPairs {
    /// Returns the number of threads that share the work on this number of boxes.
    pub(crate) fn workers(boxes: usize) -> usize {
        if boxes < PARALLEL_FROM_BOXES { 1 } else { available_threads() }
    }

    /// Leaves all pairs in `hits`, and the boxes in `store` unless they were too few.
    pub(crate) fn find(
        &mut self,
        request: &Request<'_>,
        store: &mut Store,
        report: &mut Report,
    ) -> Result<(), Error> {
        self.begin(request);
        store.has_tree = false;
        let found = AtomicU64::new(0);
        let rule = request.rule(&found);
        if request.is_for_brute_force() {
            self.test_all(request, &rule, report);
            return self.finish(&rule, report);
        }
        let before = (store.grids, store.trees);
        self.search(request, store, &rule, report);
        let done = self.finish(&rule, report);
        if done.is_err() {
            // The limit of pairs or the budget may end a way first: threads differ in time.
            (store.grids, store.trees) = before;
        }
        done
    }

    /// Hands the last pairs to the receiver, and reports the counts.
    fn finish(&mut self, rule: &Rule<'_>, report: &mut Report) -> Result<(), Error> {
        if let Some(receiver) = rule.receiver {
            self.hits.iter_mut().for_each(|hits| hits.hand_over(receiver));
        }
        let sum = |of: fn(&Hits) -> u64| self.hits.iter().map(of).sum::<u64>();
        let (made, overlaps) = (sum(|hits| hits.tests), sum(|hits| hits.overlaps));
        report.checks = Checks { made, unnecessary: made - overlaps, redundant: 0 };
        report.work += sum(Hits::work);
        let are_too_many = self.hits.iter().any(|hits| hits.is_full) || self.count() > rule.max_pairs;
        if are_too_many { Err(Error::TooManyPairs { limit: rule.max_pairs }) } else { Ok(()) }
    }

    pub(crate) fn count(&self) -> u64 {
        self.hits.iter().map(Hits::count).sum()
    }

    fn begin(&mut self, request: &Request<'_>) {
        let workers = Self::workers(request.count());
        self.hits.resize_with(workers, Hits::default);
        self.hits.iter_mut().for_each(|hits| hits.begin(request.grouping));
    }

    fn test_all(&mut self, request: &Request<'_>, rule: &Rule<'_>, report: &mut Report) {
        let boxes = stage!(report, check, {
            match request.others {
                Some(others) => brute_force_across(request.boxes, others, rule, &mut self.hits),
                None => brute_force(request.boxes, rule, &mut self.hits[0]),
            }
        });
        let algorithm = if boxes < 2 { Algorithm::Nothing } else { Algorithm::Brute };
        report.set_plan(Plan { algorithm, boxes: boxes as u32, ..Plan::default() });
    }

    fn search(&mut self, request: &Request<'_>, store: &mut Store, rule: &Rule<'_>, report: &mut Report) {
        let is_forced = request.config.engine == Some(Engine::Tree);
        let is_hard = request.is_repeated && store.grids.forbids(0);
        if !is_forced && !is_hard {
            let is_done = self.search_grid(request, store, rule, report);
            store.grids.note(!is_done, 0);
            if is_done {
                return;
            }
        }
        let is_hard = request.is_repeated && store.trees.forbids(0);
        if is_forced || !is_hard {
            let is_done = self.search_tree(request, store, rule, report);
            store.trees.note(!is_done, 0);
            if is_done {
                return;
            }
        }
        self.stream(request, store, rule, report);
    }

    /// Finds the pairs in a grid. Returns false if that takes too much work.
    fn search_grid(
        &mut self,
        request: &Request<'_>,
        store: &mut Store,
        rule: &Rule<'_>,
        report: &mut Report,
    ) -> bool {
        let (boxes, workers) = (request.boxes, self.hits.len());
        let cells = stage!(report, plan, Cells::new(boxes, request.others, workers));
        let sorted = stage!(report, map, {
            match request.others {
                Some(others) => store.two_grids.build(cells, [boxes, others], workers),
                None => store.grid.build(cells, boxes, workers),
            }
        });
        report.set_plan(cells.told(sorted.boxes(), sorted.oversize_count()));
        let most = search::grid_up_to_work(sorted.boxes());
        // A receiver's search runs twice if it may fail, so it may as well take twice the budget.
        let is_forced = request.config.engine == Some(Engine::Grid);
        stage!(report, check, {
            let is_sure = is_forced || rule.receiver.is_some() && sorted.takes_at_most(2 * most);
            let search = |rule: &Rule<'_>, hits: &mut [Hits]| sorted.search(rule, hits);
            self.run_within((!is_sure).then_some(most), request, rule, report, search)
        })
    }

    /// Finds the pairs in a tree of all boxes. Returns false if that takes too much work.
    fn search_tree(
        &mut self,
        request: &Request<'_>,
        Store { tree, has_tree, both_sets, .. }: &mut Store,
        rule: &Rule<'_>,
        report: &mut Report,
    ) -> bool {
        let split = stage!(report, map, {
            let (boxes, split) = request.in_one_list(both_sets);
            tree.sort_sets(boxes, split);
            split
        });
        *has_tree = true;
        report.set_plan(Plan { algorithm: Algorithm::Tree, boxes: tree.len() as u32, ..Plan::default() });
        let most = search::join_up_to_work(tree.len());
        let most = (request.config.engine != Some(Engine::Tree)).then_some(most);
        let search = |rule: &Rule<'_>, hits: &mut [Hits]| join::find_pairs(tree, split, rule, hits);
        stage!(report, check, self.run_within(most, request, rule, report, search))
    }

    /// Finds the pairs by streamed segment trees: a tree does not cut boxes apart that cross.
    fn stream(&mut self, request: &Request<'_>, store: &mut Store, rule: &Rule<'_>, report: &mut Report) {
        let valid = stage!(report, check, {
            let (boxes, split) = request.in_one_list(&mut store.both_sets);
            streamed::find_pairs(boxes, split, rule, &mut self.hits)
        });
        report.set_plan(Plan { algorithm: Algorithm::Tree, boxes: valid as u32, ..Plan::default() });
    }

    /// Runs a search that may take at most some work in vain, or any. Returns false, and leaves no pairs, if it takes more. A receiver
    /// cannot give pairs back, so it gets none before they are known to be all: the search runs twice.
    fn run_within(
        &mut self,
        most: Option<u64>,
        request: &Request<'_>,
        rule: &Rule<'_>,
        report: &mut Report,
        search: impl Fn(&Rule<'_>, &mut [Hits]),
    ) -> bool {
        if let Some(most) = most {
            let budget = Budget::new(most);
            let nobody = &|_: &[Pair]| ();
            let receiver = rule.receiver.map(|_| nobody as Receiver<'_>);
            search(&Rule { receiver, budget: Some(&budget), ..*rule }, &mut self.hits);
            if !budget.is_over() && receiver.is_none() {
                return true;
            }
            // Where threads stop is a matter of time.
            report.work += if budget.is_over() { most } else { self.hits.iter().map(Hits::work).sum() };
            self.begin(request);
            rule.found.store(0, Ordering::Relaxed);
            if budget.is_over() {
                return false;
            }
        }
        search(rule, &mut self.hits);
        true
    }

    pub(crate) fn gather(&mut self, grouping: Grouping, groups: &mut Groups) {
        groups.gather(grouping, &mut self.hits, |hits| &mut hits.found);
    }

    /// Forgets the pairs, and gives memory back if as many are expected.
    pub(crate) fn settle(&mut self, pairs: usize) {
        let share = pairs / self.hits.len().max(1);
        self.hits.iter_mut().for_each(|hits| hits.found.pairs.settle_and_clear(share));
        self.answer.clear();
        self.answer.settle(pairs);
    }

    /// Leaves the pairs that a device finds in `hits`. Returns false if it could not find them.
    pub(crate) fn find_on(
        &mut self,
        device: &mut DeviceSlot,
        all: &Boxes<'_>,
        config: &Config,
        grouping: Option<Grouping>,
        report: &mut Report,
    ) -> Result<bool, Error> {
        let Boxes { boxes, filters, .. } = *all;
        let max_pairs = config.limits.pairs();
        // Rows are sorted later, by several threads.
        let request = SearchRequest { boxes, filters, is_sorted: false, max_pairs };
        let mut found = std::mem::take(&mut *self.answer);
        let is_found = device.find_all(&request, &mut found, report).map(|found| found.is_some());
        if is_found == Ok(true) {
            self.take(&mut found, grouping);
        }
        *self.answer = found;
        is_found
    }

    /// Takes pairs that a device has found. Several threads copy and count them.
    pub(crate) fn take(&mut self, pairs: &mut Vec<Pair>, grouping: Option<Grouping>) {
        self.hits.resize_with(Self::workers(pairs.len()), Hits::default);
        self.hits.iter_mut().for_each(|hits| hits.begin(grouping));
        if let [hits] = &mut self.hits[..] {
            return hits.found.take(pairs);
        }
        let pieces = pairs.len().div_ceil(PARALLEL_FROM_BOXES);
        run_with(&mut self.hits, pieces, |hits, piece| {
            hits.found.add(&pairs[piece_range(pairs.len(), piece, pieces)]);
        });
    }

    /// Copies all pairs into one list, in no particular order.
    pub(crate) fn list(&mut self, pairs: &mut Vec<Pair>) {
        pairs.clear();
        pairs.reserve(self.hits.iter().map(|hits| hits.found.pairs.len()).sum());
        self.hits.iter().for_each(|hits| pairs.extend_from_slice(&hits.found.pairs));
    }
}
