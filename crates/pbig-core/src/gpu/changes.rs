//! Changes: instead of all pairs, those that came or went since the last update.
//!
//! The device keeps of each box what it is and what it was (`shaders/shared/changes.wgsl`). What it is
//! becomes what it was, the changed boxes go up, and one search over the cells that boxes reach, now or
//! before, emits each pair that overlaps now and did not before, or the other way round. So what is
//! transferred, in either direction, follows what changed.

use super::search::{Task, search};
use super::upload::{PIECE, follows};
use super::{Failure, GpuFinder};
use crate::cpu::found::Found;
use crate::layout::{ANEW, Box as DeviceBox, Motion, Move, Refilter};
use crate::plan::Summary;
use crate::report::Report;
use crate::{Aabb, Config, Error, ProxyFilter};
use rayon::prelude::*;
use std::ops::Range;

/// What a changed box was at the last update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// The box.
    pub id: u32,
    /// Where it was. [`Aabb::NOWHERE`]: it was not there, or the caller knows that its pairs have ended.
    pub aabb: Aabb,
    /// Its filter.
    pub filter: ProxyFilter,
}

/// What has changed since the last update.
#[derive(Clone, Copy, Debug)]
pub struct ChangeRequest<'a> {
    /// All boxes as they are, by id; [`Aabb::NOWHERE`] where there is none.
    pub boxes: &'a [Aabb],
    /// Their filters.
    pub filters: &'a [ProxyFilter],
    /// Boxes that have changed, each once. All others are as they were, new ids nowhere.
    pub changed: &'a [Change],
    /// The number of this update, one more with each that was completed, by whatever backend: a device that
    /// has not seen the one before is told everything again.
    pub update: u64,
    /// Pairs that exist: as many may end without any being too many.
    pub kept: u64,
    /// The settings.
    pub config: &'a Config,
}

impl ChangeRequest<'_> {
    /// Whether a box is searched as if it had not been there before. The cells between where it was and
    /// where it is could be all there are, so one that has left its old box altogether begins anew, and
    /// no box reaches further than what it is and what it was are long together. With another filter it
    /// does too, so that the device needs one filter a box.
    fn restarts(&self, change: &Change) -> bool {
        let (now, filter) = (&self.boxes[change.id as usize], &self.filters[change.id as usize]);
        let gone = now.is_valid() && !now.overlaps(&change.aabb);
        change.aabb.is_valid() && (gone || *filter != change.filter)
    }

    /// What the device takes a changed box to have been.
    fn before(&self, change: &Change) -> Aabb {
        if self.restarts(change) { Aabb::NOWHERE } else { change.aabb }
    }

    /// Boxes that begin anew although they had pairs.
    fn restarted(&self) -> Vec<u32> {
        let changed = self.changed.par_iter().with_min_len(PIECE);
        changed.filter(|change| self.restarts(change)).map(|change| change.id).collect()
    }

    /// The search for what has changed.
    fn task<'a>(&'a self, trail: &'a Trail, summary: &'a Summary) -> Task<'a> {
        Task {
            boxes: &trail.reach,
            filters: Some(self.filters),
            changes: Some(self),
            accept: None,
            // More than this and more were added than there may be pairs: what ended had been kept.
            limit: self.config.limits.max_pairs.saturating_add(self.kept),
            summary,
            config: self.config,
        }
    }

    /// What boxes are and were, for a device that does not know them.
    pub(super) fn motions(&self, ids: Range<usize>) -> Vec<Motion> {
        let at_rest = |now: DeviceBox| Motion { now, before: now };
        let boxes = self.boxes[ids.clone()].iter();
        let mut motions: Vec<_> = boxes.map(|now| at_rest(DeviceBox::new(now))).collect();
        for change in self.changed.iter().filter(|change| ids.contains(&(change.id as usize))) {
            motions[change.id as usize - ids.start].before = DeviceBox::new(&self.before(change));
        }
        motions
    }

    /// What has changed of the first `known` boxes, for a device that knows what they were.
    pub(super) fn lists(&self, known: usize) -> (Vec<Move>, Vec<Refilter>) {
        let changed = self.changed.par_iter().with_min_len(PIECE);
        let changed = changed.filter(|change| (change.id as usize) < known);
        let moves = changed.clone().map(|change| self.as_move(change)).collect();
        (moves, changed.filter_map(|change| self.as_refilter(change)).collect())
    }

    fn as_move(&self, change: &Change) -> Move {
        let mark = if self.before(change).is_valid() { 0 } else { ANEW };
        Move { place: change.id | mark, now: DeviceBox::new(&self.boxes[change.id as usize]) }
    }

    /// The new filter, if the device may have another and it matters.
    fn as_refilter(&self, change: &Change) -> Option<Refilter> {
        let (now, filter) = (&self.boxes[change.id as usize], self.filters[change.id as usize]);
        // Of a box that was not there before nobody says which filter the device has.
        let new = filter != change.filter || !change.aabb.is_valid();
        (new && now.is_valid()).then_some(Refilter { id: change.id, filter })
    }
}

/// Where each box is or was at the last update: what a search for changes is planned for.
#[derive(Debug, Default)]
pub(super) struct Trail {
    update: Option<u64>,
    reach: Vec<Aabb>,
    moved: Vec<u32>,
}

impl Trail {
    /// Brings the trail to an update, in time proportional to what moves if it knows the one before.
    fn follow(&mut self, request: &ChangeRequest<'_>) {
        let boxes = request.boxes;
        self.reach.truncate(if follows(self.update, request.update) { boxes.len() } else { 0 });
        for id in self.moved.drain(..) {
            if let Some(reach) = self.reach.get_mut(id as usize) {
                *reach = boxes[id as usize];
            }
        }
        self.reach.extend_from_slice(&boxes[self.reach.len()..]);
        let reach = |change: &Change| boxes[change.id as usize].union(&request.before(change));
        let changed = request.changed.par_iter().with_min_len(PIECE);
        for (change, reach) in request.changed.iter().zip(changed.map(reach).collect::<Vec<_>>()) {
            self.reach[change.id as usize] = reach;
            self.moved.push(change.id);
        }
        self.update = Some(request.update);
    }
}

impl GpuFinder {
    /// Into `found`, once each and in no order, the pairs that filters allow and that overlap now and did
    /// not at the last update, or the other way round: which of the two the boxes tell. Returns the boxes
    /// that began anew, for which the caller completes the answer:
    ///
    /// - a kept pair of one that no longer holds has ended, and is not in `found`;
    /// - one that still holds is in `found` like a new one, and is not to be added again.
    ///
    /// Whatever fails, the next call begins with everything, so that nothing is missed.
    pub(crate) fn changes(
        &mut self,
        request: &ChangeRequest<'_>,
        found: &mut Found,
        report: &mut Report,
    ) -> Result<Vec<u32>, Failure> {
        found.clear();
        let result = self.try_changes(request, found, report);
        if let Err(failure) = &result {
            self.fail(failure, found);
        }
        result.map(|()| request.restarted())
    }

    fn try_changes(
        &mut self,
        request: &ChangeRequest<'_>,
        found: &mut Found,
        report: &mut Report,
    ) -> Result<(), Failure> {
        self.check_pause(request.config)?;
        let crowding = self.crowding;
        let session = self.session(&request.config.gpu)?;
        let engine = session.engine.clone();
        // It comes back with success only.
        let mut trail = std::mem::take(&mut session.trail);
        trail.follow(request);
        let summary = Summary::of(&trail.reach, None);
        let task = request.task(&trail, &summary);
        let searched = engine.watch(|| search(session, &task, crowding, found));
        let searched = searched.map_err(|failure| with_limit(failure, request.config.limits.max_pairs))?;
        session.trail = trail;
        session.end_call();
        self.finish(searched, request.boxes.len() as u64 + request.kept, report);
        Ok(())
    }
}

/// Too many pairs are too many for what the caller has set.
fn with_limit(failure: Failure, limit: u64) -> Failure {
    match failure {
        Failure::Call(Error::TooManyPairs { .. }) => Failure::Call(Error::TooManyPairs { limit }),
        other => other,
    }
}
