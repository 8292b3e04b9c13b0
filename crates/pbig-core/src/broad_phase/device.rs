//! An update on a GPU: only what has changed goes there, only pairs that came or went come back.

use super::update::{State, state};
use super::{BroadPhase, flag};
use crate::diff::Judgement;
use crate::gpu::{Change, ChangeRequest};
use crate::{Backend, Error, Pair};
use std::collections::HashSet;

impl BroadPhase {
    /// Asks the device, if that is wanted, for pairs that came or went: the added ones into `events.added`, boxes that have
    /// lost some into `ending`. False when the CPU has to do it.
    pub(super) fn find_changes_on_gpu(&mut self) -> Result<bool, Error> {
        // Where little moves the base of the CPU is worth having.
        let few = self.config.backend == Backend::Auto && !self.many_changed();
        if few || !self.base.wants_gpu(&self.config, self.boxes.len()) {
            return Ok(false);
        }
        let state = state!(self);
        let was = |&id: &u32| -> Change {
            let old = state.old(id);
            Change { id, aabb: old.aabb, filter: old.filter }
        };
        let changed: Vec<Change> = self.changed.iter().map(was).collect();
        let request = ChangeRequest {
            boxes: &self.boxes,
            filters: &self.filters,
            changed: &changed,
            update: self.updates,
            kept: self.pairs.len() as u64,
            config: &self.config,
        };
        let Some(restarted) = self.base.changes_on_gpu(&request, &mut self.report)? else {
            return Ok(false);
        };
        self.has_base = false;
        self.sort_out(&restarted)?;
        Ok(true)
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
        let held = self.held_by(restarted);
        self.events.added.retain(|pair| !held.contains(pair));
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

    /// The kept pairs of boxes that began anew: the device takes those that still hold for new ones.
    fn held_by(&self, restarted: &[u32]) -> HashSet<Pair> {
        if restarted.is_empty() {
            return HashSet::new();
        }
        let ids: HashSet<u32> = restarted.iter().copied().collect();
        self.pairs.iter().filter(|pair| ids.contains(&pair.a) || ids.contains(&pair.b)).collect()
    }
}

/// As [`State`], where it is known which boxes have lost pairs.
pub(super) struct Ending<'a>(pub(super) State<'a>);

impl Judgement for Ending<'_> {
    fn holds(&self, pair: Pair) -> bool {
        self.0.flags(pair.a, pair.b) & flag::ENDING == 0 || self.0.holds(pair)
    }
}
