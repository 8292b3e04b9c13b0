//! An update on a GPU: only what has changed goes there, only pairs that came or went come back.

use super::update::{State, state};
use super::{BroadPhase, flag};
use crate::diff::Judgement;
use crate::gpu::{Change, ChangeRequest};
use crate::{Error, Pair};

/// What a device is asked by a broad phase of which other fields may be written.
macro_rules! request {
    ($of:ident) => {
        ChangeRequest {
            boxes: &$of.boxes,
            filters: &$of.filters,
            changed: &$of.asked.changes,
            update: $of.updates,
            kept: $of.pairs.listed() as u64,
            config: &$of.config,
        }
    };
}

/// The request of the last update.
#[derive(Clone, Debug, Default)]
pub(super) struct Asked {
    changes: Vec<Change>,
}

impl BroadPhase {
    /// What the changed boxes were.
    fn note_changes(&mut self) {
        let state = state!(self);
        let was = |&id: &u32| -> Change {
            let old = state.old(id);
            Change { id, aabb: old.aabb, filter: old.filter }
        };
        self.asked.changes.clear();
        self.asked.changes.extend(self.changed.iter().map(was));
    }

    /// What the device has found, if it was asked: the added ones into `events.added`, boxes that have
    /// lost some into `ending`. False when the CPU has to do it.
    pub(super) fn find_changes_on_gpu(&mut self) -> Result<bool, Error> {
        let wanted = self.base.wants_gpu(&self.config, self.changed.len());
        if wanted.is_err() {
            return Ok(false);
        }
        self.drop_near();
        self.pairs.drop_removed();
        self.note_changes();
        let Some(restarted) = self.base.changes_on_gpu(&request!(self), &mut self.report)? else {
            return Ok(false);
        };
        self.has_base = false;
        self.sort_out(&restarted)?;
        Ok(true)
    }

    /// The device has gone on to where the boxes are, and the update has not: another one may follow without it.
    pub(super) fn take_back_on_gpu(&mut self) {
        self.ending.drain(..).for_each(|id| self.flags[id as usize] &= !flag::ENDING);
        if let Some(gpu) = &mut self.base.gpu {
            gpu.forget_changes();
        }
    }

    /// Pairs that came from those that went.
    fn sort_out(&mut self, restarted: &[u32]) -> Result<(), Error> {
        let boxes = &self.boxes;
        for &pair in self.base.found.chunks.iter().flatten() {
            if boxes[pair.a as usize].overlaps(&boxes[pair.b as usize]) {
                self.events.added.push(pair);
            } else {
                self.ending.push(pair.a);
            }
        }
        if !restarted.is_empty() {
            // The device takes pairs of boxes that began anew for new ones.
            let state = state!(self);
            self.events.added.retain(|pair| !state.paired_before(pair.a, pair.b));
        }
        // The device has counted those that went, too.
        let limit = self.config.limits.max_pairs;
        if self.events.added.len() as u64 > limit {
            return Err(Error::TooManyPairs { limit });
        }
        self.ending.extend_from_slice(restarted);
        for &id in &self.ending {
            self.flags[id as usize] |= flag::ENDING;
        }
        Ok(())
    }
}

/// As [`State`], where it is known which boxes have lost pairs.
pub(super) struct Ending<'a>(pub(super) State<'a>);

impl Judgement for Ending<'_> {
    fn holds(&self, pair: Pair) -> bool {
        self.0.flags(pair.a, pair.b) & flag::ENDING == 0 || self.0.holds(pair)
    }
}

#[cfg(test)]
mod tests {
    use crate::{
        Aabb, Backend, BroadPhase, Config, Error, GpuFinder, Limits, Pair, ProxyFilter, Strategy, oracle,
    };
    use rand::rngs::StdRng;
    use rand::{RngExt, SeedableRng};
    use std::collections::BTreeSet;
    use std::ops::Range;

    /// Boxes 2i and 2i + 1 of some couples, which overlap when they are close. Between the two the latter goes half its
    /// size: one that goes further would begin anew, and it would not matter what the device has.
    fn put(broad_phase: &mut BroadPhase, couples: Range<u32>, close: bool) {
        for i in couples {
            let gap = if close { 1.5 } else { 2.5 };
            for (id, x) in [(2 * i, 0.0), (2 * i + 1, gap)] {
                let aabb = Aabb::from_center([10.0 * i as f32 + x, 0.0, 0.0], [1.0; 3]);
                broad_phase.set(id, aabb, ProxyFilter::ALL).expect("room for it");
            }
        }
    }

    #[test]
    fn a_device_whose_update_was_too_much_does_not_go_on_from_it() {
        let limits = Limits { max_pairs: 10, ..Limits::UNLIMITED };
        let config = Config { backend: Backend::Gpu, limits, ..Config::DEFAULT };
        let gpu = GpuFinder::new().expect("an adapter, of which a software one will do");
        let mut broad_phase = BroadPhase::with_gpu(config, gpu).expect("a margin that is one");
        put(&mut broad_phase, 0..1000, false);
        put(&mut broad_phase, 0..9, true);
        assert_eq!(broad_phase.update().map(|events| events.added.len()), Ok(9));
        // As many as the device may find, which counts those that may end, too.
        put(&mut broad_phase, 20..32, true);
        assert_eq!(broad_phase.update(), Err(Error::TooManyPairs { limit: 10 }));
        assert!(broad_phase.report().gpu.is_some(), "the device has found them");
        put(&mut broad_phase, 20..32, false);
        broad_phase.config.backend = Backend::Cpu;
        assert_eq!(broad_phase.update().map(|events| events.added.len()), Ok(0));
        broad_phase.config.backend = Backend::Gpu;
        put(&mut broad_phase, 20..21, true);
        assert_eq!(broad_phase.update().map(|events| events.added.clone()), Ok(vec![Pair::new(40, 41)]));
        assert!(broad_phase.report().gpu.is_some());
    }

    /// Whoever does an update, and however many before it have ended with an error: events lead from the pairs of the last
    /// one that has not to those that there are.
    #[test]
    fn devices_and_the_cpu_take_turns_and_updates_fail_in_between() {
        let config = Config { strategy: Strategy::Grid, ..Config::DEFAULT };
        let gpu = GpuFinder::new().expect("an adapter, of which a software one will do");
        let mut broad_phase = BroadPhase::with_gpu(config, gpu).expect("a margin that is one");
        let (mut random, mut pairs) = (StdRng::seed_from_u64(17), BTreeSet::new());
        let home = |id: u32| [id % 8, id / 8 % 8, id / 64].map(|i| i as f32);
        // Updates on the device, on the CPU, and there by near pairs; and those that failed, with a list or without.
        let mut seen = [[0; 2]; 3];
        for round in 0..400 {
            // For a while the same, so that there are lists.
            if round % 10 == 0 {
                broad_phase.config.backend = [Backend::Gpu, Backend::Cpu][random.random_range(0..2)];
            }
            broad_phase.config.limits.max_pairs = if random.random_ratio(1, 6) { 40 } else { u64::MAX };
            for id in 0..400 {
                // All tremble; few go elsewhere, are taken out or get another filter: more would end a list.
                let to = if random.random_ratio(1, 400) { random.random_range(0..400) } else { id };
                let center = home(to).map(|x| x + random.random_range(-0.02..0.02));
                if random.random_ratio(1, 400) {
                    broad_phase.remove(id);
                    pairs.retain(|pair: &Pair| pair.a != id && pair.b != id);
                } else {
                    let memberships = 1 + u32::from(random.random_ratio(1, 400));
                    let filter = ProxyFilter { memberships, ..ProxyFilter::ALL };
                    broad_phase.set(id, Aabb::from_center(center, [0.5; 3]), filter).expect("room for it");
                }
            }
            broad_phase.near.worth.pause = 0;
            let result = broad_phase.update().cloned();
            let is_near = broad_phase.near.is_on && result.is_ok();
            let way = if broad_phase.config.backend == Backend::Gpu { 0 } else { 1 + usize::from(is_near) };
            assert!(way > 0 || result.is_err() || broad_phase.report().gpu.is_some(), "the device works");
            seen[way][usize::from(result.is_err())] += 1;
            if let Ok(events) = result {
                assert!(events.removed.iter().all(|pair| pairs.remove(pair)), "round {round}: was not there");
                assert!(events.added.iter().all(|pair| pairs.insert(*pair)), "round {round}: was there");
                let wanted = oracle::pairs(&broad_phase.boxes);
                let allowed = |pair: &Pair| {
                    let [a, b] = [pair.a, pair.b].map(|id| &broad_phase.filters[id as usize]);
                    a.allows(b)
                };
                assert!(wanted.into_iter().filter(allowed).eq(pairs.iter().copied()), "round {round}");
            }
        }
        let [[on_gpu, failed_there], [by_grid, failed], [by_near, _]] = seen;
        let are_enough = [on_gpu, failed_there, failed, by_near].iter().all(|updates| *updates > 10);
        assert!(are_enough && by_grid > 0, "{seen:?}");
    }
}
