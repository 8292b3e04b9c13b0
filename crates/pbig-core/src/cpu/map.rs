//! Map: boxes into cells. One entry a box, sorted by the cell of its lower corner.

use super::codes::Simd;
use super::crowding::{Crowding, Kept, Set};
use super::edit::Homes;
use super::entries::Entries;
use super::levels::{Classes, LISTED, Level};
use super::record::{Item, Record};
use super::sort::{Input, Sort, Sorted, shift_for};
use crate::plan::{Camps, Experience, KeptLevels, Looks, OPEN, OccupiedCell, Plan};
use crate::share::has_threads;
use crate::{Aabb, Look, shared_from};

/// Boxes from which a sort is shared with other threads.
const PARALLEL_FROM: usize = shared_from(20_000);

/// A set of boxes, ready to be searched: grids by level, and the boxes that fit none of them.
#[derive(Clone, Debug)]
pub(crate) struct Map<R> {
    pub(crate) levels: Vec<Level>,
    pub(crate) sorted: Sorted<R>,
    /// Boxes tested against everything.
    pub(crate) list: Entries,
    pub(super) simd: Simd,
    /// Which rows a search is asked to look at.
    pub(super) look: Look,
    pub(super) classes: Classes,
    sort: Sort,
    pub(super) homes: Homes,
    pub(super) crowding: Crowding,
    pub(super) kept: Option<Kept>,
    /// Scratch of a build.
    pub(super) tried: Vec<(f32, f32)>,
    /// Boxes of the set that are invalid.
    pub(crate) invalid: u32,
    pub(super) camps: Camps,
    /// Of the boxes of the set, in their order; empty without camps.
    pub(super) camp_of: Vec<u8>,
    /// What searches took against what was expected.
    pub(crate) experience: Experience,
    pub(super) kept_levels: KeptLevels,
    /// How often boxes were sorted.
    #[cfg(test)]
    pub(super) builds: usize,
}

impl<R: Record> Map<R> {
    pub(crate) fn new() -> Self {
        Self {
            levels: Vec::new(),
            sorted: Sorted::default(),
            list: Entries::default(),
            simd: Simd::detect(),
            look: Look::Auto,
            classes: Classes::default(),
            sort: Sort::default(),
            homes: Homes::default(),
            crowding: Crowding::default(),
            kept: None,
            tried: Vec::new(),
            invalid: 0,
            camps: Camps::default(),
            camp_of: Vec::new(),
            experience: Experience::default(),
            kept_levels: KeptLevels::default(),
            #[cfg(test)]
            builds: 0,
        }
    }

    /// Sorts the valid boxes of the set as planned; false, and nothing is sorted, when more than `most_listed` fit no
    /// level.
    pub(super) fn build(&mut self, plan: &Plan, set: &Set<'_>, most_listed: u32) -> bool {
        #[cfg(test)]
        {
            self.builds += 1;
        }
        self.homes.forget();
        self.classes.set(plan, self.camps.count());
        let input = Input { boxes: set.boxes, before: set.before, camp_of: &self.camp_of };
        let shift = shift_for(input.boxes.len(), plan.levels.iter().map(|level| level.cells));
        self.levels.clear();
        let mut base = 0;
        for level in plan.levels.iter() {
            self.levels.push(Level::new(level, base));
            base += (level.cells.div_ceil(1 << shift)) << shift;
        }
        let threads = input.boxes.len() >= PARALLEL_FROM && has_threads();
        let elsewhere = self.sort.place(&input, &self.classes, &self.levels, shift, threads);
        self.invalid = elsewhere.invalid;
        if elsewhere.listed > most_listed {
            return false;
        }
        self.sort.sort(&input, &mut self.levels, threads, &mut self.sorted);
        let listed = (0..).zip(&self.sort.keys).filter(|(_, key)| **key == LISTED);
        // Most sets have none, and need not be asked box by box.
        let listed = listed.take(elsewhere.listed as usize).map(|(id, _)| id);
        self.list.fill(set.boxes, listed);
        true
    }

    /// The box in a slot.
    #[inline(always)]
    pub(super) fn item(&self, slot: usize) -> &Item {
        self.sorted.records[self.sorted.places[slot] as usize].item()
    }

    /// The occupied cells.
    pub(crate) fn cells(&self, out: &mut Vec<OccupiedCell>) {
        for (i, level) in self.levels.iter().enumerate() {
            let behind = self.sorted.behind().filter(|&slot| level.has(self.sorted.keys[slot]));
            let items = level.slots.clone().chain(behind).map(|slot| self.item(slot));
            let items = items.filter(|item| item.aabb.is_valid());
            let place =
                |item: &Item| -> (([i64; 3], Aabb), u32) { (level.cells.bounds(&item.aabb), item.id) };
            let mut placed: Vec<_> = items.map(place).collect();
            placed.sort_by_key(|((cell, _), id)| (*cell, *id));
            for cell in placed.chunk_by(|a, b| a.0.0 == b.0.0) {
                let ids = cell.iter().map(|(_, id)| *id).collect();
                out.push(OccupiedCell { level: i as u32, aabb: cell[0].0.1, ids });
            }
        }
    }

    /// Which rows a search looks at, level by level.
    pub(crate) fn looks(&self) -> Looks {
        let mut looks = Looks::default();
        // Of other camps none is searched for its own pairs.
        let searched = self.levels.iter().filter(|level| level.camp == OPEN && !level.slots.is_empty());
        searched.for_each(|level| looks.count(level.look(self.look)));
        looks
    }

    /// Boxes in grids.
    pub(crate) fn len_in_grids(&self) -> usize {
        self.sorted.places.len()
    }
}
