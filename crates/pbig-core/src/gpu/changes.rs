//! The search for changes: instead of all pairs, it finds those that an update adds or removes.
//!
//! The device has each box now and at the last update (`shaders/shared/search_changes.wgsl`). So transfers in both
//! directions are proportional to the number of changes.

use super::search::{SearchRequest, search};
use super::upload::PIECE;
use super::{Failure, GpuFinder, GpuFound};
use crate::layout::{BoxChange, DeviceBox, FilterChange, Motion, WAS_ABSENT};
use crate::{Aabb, Config, ProxyFilter, parallel};
use std::ops::Range;

/// A changed box as it was at the last update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Id of the box.
    pub id: u32,
    /// The box at the last update. [`Aabb::NOWHERE`] if it was absent, or if the caller has ended its pairs already.
    pub aabb: Aabb,
    /// The filter at the last update.
    pub filter: ProxyFilter,
}

/// The changes since the last update.
#[derive(Clone, Copy, Debug)]
pub struct ChangeRequest<'a> {
    /// All boxes now, by id; [`Aabb::NOWHERE`] where there is none.
    pub boxes: &'a [Aabb],
    /// Filters now, by id.
    pub filters: &'a [ProxyFilter],
    /// The changed boxes, each once. All others are as at the last update; new ids were absent.
    pub changed: &'a [Change],
    /// Number of this update: one more with each completed update, on any backend. A device that has not seen the last
    /// update gets all boxes.
    pub update: u64,
    /// Number of pairs at the last update. As many may end without counting against the limit.
    pub kept: u64,
    /// The settings. The limit of pairs counts added pairs here; the caller counts all.
    pub config: &'a Config,
}

impl ChangeRequest<'_> {
    /// Returns true if the device treats a changed box as new.
    ///
    /// - The box has left its old place. Otherwise the cells between both places could be all there are; so no box
    ///   reaches further than the lengths of its old and its new box together.
    /// - Its filter has changed. The device stores one filter per box.
    fn is_restarted(&self, change: &Change) -> bool {
        let (now, filter) = (&self.boxes[change.id as usize], &self.filters[change.id as usize]);
        let has_left = now.is_valid() && !now.overlaps(&change.aabb);
        change.aabb.is_valid() && (has_left || *filter != change.filter)
    }

    /// Returns a changed box at the last update, as the device stores it.
    fn before(&self, change: &Change) -> Aabb {
        if self.is_restarted(change) { Aabb::NOWHERE } else { change.aabb }
    }

    fn restarted(&self) -> Vec<u32> {
        let pieces: Vec<&[Change]> = self.changed.chunks(PIECE).collect();
        let ids = parallel::map(pieces.len(), |i| {
            let restarted = pieces[i].iter().filter(|change| self.is_restarted(change));
            restarted.map(|change| change.id).collect::<Vec<_>>()
        });
        let mut ids = ids.concat();
        ids.sort_unstable();
        ids
    }

    /// Returns boxes now and before, for a device that does not have them.
    pub(super) fn motions(&self, ids: Range<usize>) -> Vec<Motion> {
        let at_rest = |now: DeviceBox| Motion { now, before: now };
        let boxes = self.boxes[ids.clone()].iter();
        let mut motions: Vec<_> = boxes.map(|now| at_rest(DeviceBox::new(now))).collect();
        for change in self.changed.iter().filter(|change| ids.contains(&(change.id as usize))) {
            motions[change.id as usize - ids.start].before = DeviceBox::new(&self.before(change));
        }
        motions
    }

    /// Returns the changes of the first `known` boxes, for a device that has these boxes at the last update. Each list is
    /// in pieces.
    pub(super) fn lists(&self, known: usize) -> Vec<(Vec<BoxChange>, Vec<FilterChange>)> {
        let pieces: Vec<&[Change]> = self.changed.chunks(PIECE).collect();
        parallel::map(pieces.len(), |i| {
            let changed = pieces[i].iter().filter(|change| (change.id as usize) < known);
            let boxes = changed.clone().map(|change| self.box_change(change)).collect();
            (boxes, changed.filter_map(|change| self.filter_change(change)).collect())
        })
    }

    fn box_change(&self, change: &Change) -> BoxChange {
        let mark = if self.before(change).is_valid() { 0 } else { WAS_ABSENT };
        BoxChange { marked_id: change.id | mark, now: DeviceBox::new(&self.boxes[change.id as usize]) }
    }

    /// Returns the new filter, if the device may have another one and the box is valid.
    fn filter_change(&self, change: &Change) -> Option<FilterChange> {
        let (now, filter) = (&self.boxes[change.id as usize], self.filters[change.id as usize]);
        // The filter that the device has for an absent box is unknown.
        let may_differ = filter != change.filter || !change.aabb.is_valid();
        (may_differ && now.is_valid()).then_some(FilterChange { id: change.id, filter })
    }
}

/// Returns the bounds of each box now and at the last update.
pub(super) fn bounds_of(request: &ChangeRequest<'_>) -> Vec<Aabb> {
    let mut bounds = request.boxes.to_vec();
    for change in request.changed {
        let one = &mut bounds[change.id as usize];
        *one = one.union(&request.before(change));
    }
    bounds
}

impl GpuFinder {
    /// Finds the pairs that the filters allow and that overlap now and did not at the last update, or the other way
    /// round.
    ///
    /// The caller completes the answer for boxes in [`GpuFound::restarted`], which the device treats as new: kept pairs
    /// that no longer hold are not in the result, and those that still hold are.
    pub(crate) fn changes(&mut self, request: &ChangeRequest<'_>) -> Result<GpuFound, Failure> {
        let &ChangeRequest { filters, config, kept, .. } = request;
        self.run(config, kept, |session| {
            let (boxes, filters, changes) = (request.boxes, Some(filters), Some(request));
            // First, while the boxes are in the cache.
            let restarted = request.restarted();
            let found = search(session, &SearchRequest { boxes, filters, changes, config }, Vec::new())?;
            Ok(GpuFound { restarted, ..found })
        })
    }
}
