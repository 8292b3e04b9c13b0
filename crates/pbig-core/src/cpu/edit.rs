//! Edits: boxes that have changed, put where they belong without sorting anew.
//!
//! A box that stays in its cell keeps its slot and its place, its *home*: record and code are overwritten. (Of moves by 0.1
//! in cells of 1.28, seven in eight stay.) One that leaves its cell leaves its home empty, and may come back. Homes are looked up by id in a
//! table that is made when the first box is edited: where everything moves, none is.

use super::codes::prefetch;
use super::map::Map;
use super::record::{Record, Tracked};
use crate::{Aabb, ProxyFilter};

/// Boxes that are edited together: first all ask for their memory, then all are written.
const BLOCK: usize = 32;

/// No home: the box was invalid, or not there.
const NONE: u32 = u32::MAX;

/// The home of a box that is in no cell, with its place in the list.
const IN_LIST: u32 = 1 << 31;

/// Where each box of a map is.
#[derive(Clone, Debug, Default)]
pub(super) struct Homes {
    /// By id.
    of: Vec<u32>,
    are_known: bool,
}

impl Homes {
    /// Boxes have been sorted anew.
    pub(super) fn forget(&mut self) {
        self.are_known = false;
    }

    #[inline(always)]
    fn of(&self, id: u32) -> u32 {
        self.of.get(id as usize).copied().unwrap_or(NONE)
    }
}

/// Boxes that have changed.
#[derive(Clone, Copy)]
pub(crate) struct Changed<'a> {
    pub(crate) ids: &'a [u32],
    /// These by id.
    pub(crate) boxes: &'a [Aabb],
    pub(crate) before: &'a [Aabb],
    pub(crate) filters: &'a [ProxyFilter],
    /// The update in which they have.
    pub(crate) update: u64,
}

impl Changed<'_> {
    fn record(&self, id: u32) -> Tracked {
        let i = id as usize;
        Tracked::changed(self.boxes[i], id, self.before[i], self.update)
    }
}

impl Map<Tracked> {
    /// Writes changed boxes to their homes, if they are still in those cells, and empties the others. `tell` hears of each whether
    /// it is at home; `records` gets those of all that are valid.
    pub(crate) fn edit(
        &mut self,
        changed: &Changed<'_>,
        records: &mut Vec<Tracked>,
        mut tell: impl FnMut(u32, bool),
    ) {
        self.learn_homes(changed.boxes.len());
        records.clear();
        for ids in changed.ids.chunks(BLOCK) {
            self.ask_for(ids, changed);
            for &id in ids {
                let record = changed.record(id);
                let camp = if self.has_camps() { self.camps.camp(&changed.filters[id as usize]) } else { 0 };
                let is_home = self.put(record, camp);
                let is_valid = !record.item().aabb.min[0].is_nan();
                if is_valid {
                    records.push(record);
                }
                tell(id, is_home || !is_valid);
            }
        }
    }

    /// Asks for the memory of some boxes and their homes.
    fn ask_for(&self, ids: &[u32], changed: &Changed<'_>) {
        let mut homes = [NONE; BLOCK];
        for (home, &id) in homes.iter_mut().zip(ids) {
            prefetch(&changed.boxes[id as usize]);
            prefetch(&changed.before[id as usize]);
            *home = self.homes.of(id);
        }
        for &home in homes.iter().filter(|home| **home < IN_LIST) {
            prefetch(&self.sorted.places[home as usize]);
            prefetch(&self.sorted.codes[home as usize]);
        }
        for &home in homes.iter().filter(|home| **home < IN_LIST) {
            prefetch(&self.sorted.records[self.sorted.places[home as usize] as usize]);
        }
    }

    /// Writes a box to its home, or empties that; false where it is not at home now.
    fn put(&mut self, record: Tracked, camp: u8) -> bool {
        let (home, aabb) = (self.homes.of(record.item().id), &record.item().aabb);
        if home == NONE {
            return false;
        }
        if home >= IN_LIST {
            self.list.set((home & !IN_LIST) as usize, aabb);
            return true;
        }
        let (home, key) = (home as usize, self.classes.key(aabb, camp, &self.levels));
        let kept = &mut self.sorted.records[self.sorted.places[home] as usize];
        let stays = key == kept.item().key;
        kept.put(if stays {
            record
        } else {
            Tracked::changed(Aabb::NOWHERE, record.item().id, Aabb::NOWHERE, 0)
        });
        if stays {
            let level = self.levels.iter().rfind(|level| level.cells.base <= key);
            self.sorted.codes[home] = level.map_or(0, |level| level.cells.code(aabb));
        }
        stays
    }

    /// The table of homes, once after boxes have been sorted.
    fn learn_homes(&mut self, ids: usize) {
        if std::mem::replace(&mut self.homes.are_known, true) {
            return;
        }
        let of = &mut self.homes.of;
        of.clear();
        of.resize(ids, NONE);
        for (slot, &place) in (0..).zip(&self.sorted.places) {
            of[self.sorted.records[place as usize].item().id as usize] = slot;
        }
        for (i, &id) in (0..).zip(&self.list.ids) {
            of[id as usize] = IN_LIST | i;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::crowding::Set;
    use crate::cpu::find::Others;
    use crate::cpu::judge::Accept;
    use crate::plan::LazySummary;
    use crate::report::StageTimes;
    use crate::{Config, Pair};
    use std::collections::BTreeSet;

    /// Every pair that is met and did not overlap, of two changed boxes (the first hundred) from one side.
    struct Met<'a>(&'a [Aabb]);

    impl Accept for Met<'_> {
        fn meets(&self, query: u32, candidate: u32) -> bool {
            query < candidate || candidate >= 100
        }

        fn pair(&self, pair: Pair) -> bool {
            !self.0[pair.a as usize].overlaps(&self.0[pair.b as usize])
        }

        /// Records tell.
        fn fresh(&self, _: Pair) -> bool {
            true
        }
    }

    fn random(seed: &mut u64) -> f32 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 40) as f32 / 16_777_216.0
    }

    fn shifted(one: &Aabb, by: f32, seed: &mut u64) -> Aabb {
        let by: [f32; 3] = std::array::from_fn(|_| by * (2.0 * random(seed) - 1.0));
        let add = |corner: [f32; 3]| std::array::from_fn(|k| corner[k] + by[k]);
        Aabb::new(add(one.min), add(one.max))
    }

    /// Small boxes and a few that are as large as the world.
    fn world(seed: &mut u64) -> Vec<Aabb> {
        let half = |id: u32| if id % 97 == 50 { 20.0 } else { 0.5 };
        let place = |seed: &mut u64| std::array::from_fn(|_| 10.0 * random(seed));
        (0..1000).map(|id| Aabb::from_center(place(seed), [half(id); 3])).collect()
    }

    fn built(boxes: &[Aabb], filters: &[ProxyFilter], config: &Config) -> Map<Tracked> {
        let summary = LazySummary::new(boxes, None, None);
        let set = Set { boxes, filters: Some(filters), ids: None, summary: &summary, before: boxes };
        let mut map = Map::new();
        map.plan_and_build(&set, config, &mut StageTimes::default());
        map
    }

    #[test]
    fn edited_boxes_are_found_where_they_are_with_what_they_were() {
        let (stayed, left, found) = edit_and_compare(&Config { brute_below: 0, ..Config::DEFAULT });
        assert!(stayed > 500 && left > 200 && found > 500, "{stayed} {left} {found}");
        let (stayed, left, found) = edit_and_compare(&Config { brute_below: 5000, ..Config::DEFAULT });
        assert!(stayed > 2000 && left == 0 && found > 500, "{stayed} {left} {found}");
    }

    /// How many boxes were at home after edits and how many were not, and the pairs that were found.
    fn edit_and_compare(config: &Config) -> (u32, u32, usize) {
        let mut seed = 5;
        let (before, filters) = (world(&mut seed), vec![ProxyFilter::ALL; 1000]);
        let mut map = built(&before, &filters, config);
        let ids: Vec<u32> = (0..100).collect();
        let (mut stayed, mut left, mut found) = (0, 0, 0);
        let (mut old, mut boxes, mut records) = (before.clone(), before, Vec::new());
        for update in 1..30 {
            old.clone_from(&boxes);
            for one in &mut boxes[..100] {
                *one = shifted(one, [0.1, 0.4, 0.0][update as usize % 3], &mut seed);
            }
            let changed = Changed { ids: &ids, boxes: &boxes, before: &old, filters: &filters, update };
            let mut away = BTreeSet::new();
            map.edit(&changed, &mut records, |id, is_home| {
                (stayed, left) = (stayed + u32::from(is_home), left + u32::from(!is_home));
                if !is_home {
                    away.insert(id);
                }
            });
            let others = Others { records: &records, filters: &filters, update: Some(update) };
            let mut out = Vec::new();
            map.check_others(&others, &Met(&old), &mut out, u64::MAX).expect("few pairs");
            let all: BTreeSet<Pair> = out.iter().copied().collect();
            assert_eq!(all.len(), out.len(), "twice");
            // A box that is away is a query only.
            let is_met = |a: u32, b: u32| {
                let (one, other) = (a as usize, b as usize);
                let is_new = boxes[one].overlaps(&boxes[other]) && !old[one].overlaps(&old[other]);
                is_new && !away.contains(&b)
            };
            let pairs = (0..100).flat_map(|a| (a + 1..1000).map(move |b| (a, b)));
            let wanted: BTreeSet<Pair> =
                pairs.filter(|&(a, b)| is_met(a, b)).map(|(a, b)| Pair::new(a, b)).collect();
            let wrong: Vec<&Pair> = all.symmetric_difference(&wanted).take(5).collect();
            assert!(wrong.is_empty(), "update {update}: {wrong:?}");
            found += all.len();
        }
        (stayed, left, found)
    }
}
