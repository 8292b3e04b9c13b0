//! All pairs of a box of one set with a box of another one. Boxes that miss all of the other set are dropped first. The others are
//! found by two grids, by a tree where a grid would test too many, or by testing every pair where one set is small.

use crate::all_pairs::{AllPairs, Request};
use crate::grid::{GridPlan, Rule, TwoGrids, brute_force_across};
use crate::index::BoxIndex;
use crate::outcome::Outcome;
use crate::policy::{BRUTE_FORCE_UP_TO_BOXES, FEW_BOXES};
use crate::report::{Clock, stage};
use crate::{Aabb, Algorithm, Backend, Boxes, Keys, NO_KEY, NeighbourScan, Plan, ProxyFilter};
use std::sync::atomic::AtomicU64;

/// The boxes of two sets that may have pairs, in one list: those of the first set, then those of the second.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sets {
    pub(crate) boxes: Vec<Aabb>,
    /// By place in the list: the id in the set.
    pub(crate) ids: Vec<u32>,
    /// Empty if there are none.
    filters: Vec<ProxyFilter>,
    keys: Vec<Keys>,
    /// The number of boxes of the first set.
    pub(crate) split: usize,
    /// Valid boxes of both sets, before any was dropped.
    pub(crate) valid: u64,
    /// Scratch: the ids of the second set.
    second: Vec<u32>,
}

/// A box that all valid boxes overlap.
const EVERYWHERE: Aabb = Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);

impl Sets {
    /// Takes two sets, without the boxes that miss all of the other one.
    pub(crate) fn take(&mut self, a: &Boxes<'_>, b: &Boxes<'_>) {
        self.list_near(a.boxes, b.boxes);
        self.split = self.ids.len();
        self.ids.append(&mut self.second);
        let [first, second] = [&self.ids[..self.split], &self.ids[self.split..]];
        self.boxes.clear();
        self.boxes.extend(first.iter().map(|id| a.boxes[*id as usize]));
        self.boxes.extend(second.iter().map(|id| b.boxes[*id as usize]));
        let filters = [(first, a.filters), (second, b.filters)];
        let keys = [(first, a.keys), (second, b.keys)];
        gather(&mut self.filters, filters, ProxyFilter::ALL);
        gather(&mut self.keys, keys, [NO_KEY; 4]);
    }

    /// Lists the valid boxes of each set that overlap the bounds of the other set. Repeats it while a quarter of the boxes is
    /// dropped, because the bounds of the boxes that are left are smaller.
    fn list_near(&mut self, a: &[Aabb], b: &[Aabb]) {
        let (first, second) = (&mut self.ids, &mut self.second);
        first.clear();
        first.extend(0..a.len() as u32);
        second.clear();
        second.extend(0..b.len() as u32);
        let mut bounds = keep_near(second, b, &EVERYWHERE);
        self.valid = second.len() as u64 + a.iter().filter(|aabb| aabb.is_valid()).count() as u64;
        loop {
            let before = first.len() + second.len();
            let first_bounds = keep_near(first, a, &bounds);
            bounds = keep_near(second, b, &first_bounds);
            if 4 * (first.len() + second.len()) >= 3 * before {
                return;
            }
        }
    }

    /// Returns the filters and keys by place in the list; none if no box has any.
    pub(crate) fn rules(&self) -> (Option<&[ProxyFilter]>, Option<&[Keys]>) {
        (
            Some(&self.filters[..]).filter(|all| !all.is_empty()),
            Some(&self.keys[..]).filter(|all| !all.is_empty()),
        )
    }
}

/// Drops boxes that are invalid or miss a box; returns the bounds of the others, invalid if there are none.
fn keep_near(ids: &mut Vec<u32>, boxes: &[Aabb], near: &Aabb) -> Aabb {
    let mut bounds = Aabb::new([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    ids.retain(|id| {
        let aabb = &boxes[*id as usize];
        let is_near = aabb.is_valid() & aabb.overlaps(near);
        if is_near {
            for k in 0..3 {
                bounds.min[k] = bounds.min[k].min(aabb.min[k]);
                bounds.max[k] = bounds.max[k].max(aabb.max[k]);
            }
        }
        is_near
    });
    if ids.is_empty() { Aabb::NOWHERE } else { bounds }
}

/// Copies the values of listed boxes; none if neither set has any.
fn gather<T: Copy>(to: &mut Vec<T>, sets: [(&[u32], Option<&[T]>); 2], default: T) {
    to.clear();
    if sets.iter().all(|(_, values)| values.is_none()) {
        return;
    }
    for (ids, values) in sets {
        match values {
            Some(values) => to.extend(ids.iter().map(|id| values[*id as usize])),
            None => to.extend(ids.iter().map(|_| default)),
        }
    }
}

/// The structures that hold the boxes of two sets.
#[derive(Clone, Debug, Default)]
pub(crate) struct TwoSets {
    grids: TwoGrids,
    tree: BoxIndex,
}

impl AllPairs {
    /// Leaves the pairs of two sets in `hits`, by place in their list, and what was done in the outcome.
    pub(crate) fn find_between(
        &mut self,
        request: &Request<'_>,
        sets: &Sets,
        store: &mut TwoSets,
    ) -> Outcome {
        self.begin(request);
        let found = AtomicU64::new(0);
        let rule = request.rule(&found);
        let mut outcome = Outcome::default();
        let few = sets.split.min(sets.boxes.len() - sets.split);
        let is_few = few <= FEW_BOXES || sets.boxes.len() <= BRUTE_FORCE_UP_TO_BOXES;
        let is_brute = request.config.backend == Backend::Brute || request.config.engine.is_none() && is_few;
        if few > 0 && is_brute {
            self.test_all_between(sets, &rule, &mut outcome);
        } else if few > 0 {
            self.search_between((request, sets.split), store, &rule, &mut outcome);
        }
        self.finish(&rule, outcome)
    }

    fn test_all_between(&mut self, sets: &Sets, rule: &Rule<'_>, outcome: &mut Outcome) {
        stage!("check");
        let mut clock = Clock::start();
        brute_force_across(&sets.boxes, sets.split, rule, &mut self.hits);
        outcome.plan =
            Plan { algorithm: Algorithm::Brute, boxes: sets.boxes.len() as u32, ..Plan::default() };
        outcome.stages.check += clock.lap();
    }

    fn search_between(
        &mut self,
        (request, split): (&Request<'_>, usize),
        store: &mut TwoSets,
        rule: &Rule<'_>,
        outcome: &mut Outcome,
    ) {
        let workers = self.hits.len();
        let mut clock = Clock::start();
        let plan = {
            stage!("plan");
            GridPlan { scan: NeighbourScan::Windows, ..GridPlan::new(request.boxes, workers) }
        };
        outcome.stages.plan += clock.lap();
        let sorted = {
            stage!("map");
            store.grids.build(plan, request.boxes, split, workers)
        };
        outcome.stages.map += clock.lap();
        let is_grid = self.is_for_grid(request, &sorted);
        if is_grid {
            stage!("check");
            sorted.search(rule, &mut self.hits);
        }
        outcome.stages.check += clock.lap();
        outcome.plan = Plan::of_cells(Algorithm::Grid, &plan, sorted.boxes(), sorted.oversize_count());
        if !is_grid {
            self.search_trees((request, split as u32), &mut store.tree, rule, outcome);
        }
    }

    /// Sorts the boxes of two sets into a tree, and finds the pairs there.
    fn search_trees(
        &mut self,
        (request, split): (&Request<'_>, u32),
        tree: &mut BoxIndex,
        rule: &Rule<'_>,
        outcome: &mut Outcome,
    ) {
        let mut clock = Clock::start();
        {
            stage!("map");
            tree.sort_sets(request.boxes, split);
        }
        outcome.stages.map += clock.lap();
        self.join((request, Some(split)), tree, rule);
        outcome.stages.check += clock.lap();
        outcome.plan =
            Plan { algorithm: Algorithm::Tree, boxes: request.boxes.len() as u32, ..Plan::default() };
    }
}
