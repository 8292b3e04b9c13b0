//! The changes of an update, as the device stores them.
//!
//! The device has each box now and at the last update (`shaders/shared/search_changes.wgsl`). So transfers in both
//! directions are proportional to the number of changes.

use super::upload::PIECE;
use crate::layout::{BoxChange, DeviceBox, FilterChange, Motion, WAS_ABSENT};
use pbig_core::{Aabb, ChangedBox, ProxyFilter, internal as parallel};
use std::borrow::Cow;
use std::ops::Range;

/// The changes since the last update.
#[derive(Clone, Copy)]
pub(super) struct Changes<'a> {
    /// All boxes now, by id.
    pub(super) boxes: &'a [Aabb],
    /// Filters now, by id.
    pub(super) filters: &'a [ProxyFilter],
    pub(super) changed: &'a [ChangedBox],
}

impl Changes<'_> {
    /// Returns true if the device treats a changed box as new.
    ///
    /// - The box has left its old place. Otherwise the cells between both places could be all there are; so no box
    ///   reaches further than the lengths of its old and its new box together.
    /// - Its filter has changed. The device stores one filter per box.
    fn is_restarted(&self, change: &ChangedBox) -> bool {
        let (now, filter) = (&self.boxes[change.id as usize], &self.filters[change.id as usize]);
        let has_left = now.is_valid() && !now.overlaps(&change.aabb);
        change.aabb.is_valid() && (has_left || *filter != change.filter)
    }

    /// Returns a changed box at the last update, as the device stores it.
    fn before(&self, change: &ChangedBox) -> Aabb {
        if self.is_restarted(change) { Aabb::NOWHERE } else { change.aabb }
    }

    /// Returns the ids of the boxes that the device treats as new, ascending.
    pub(super) fn restarted(&self) -> Vec<u32> {
        let pieces: Vec<&[ChangedBox]> = self.changed.chunks(PIECE).collect();
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
        if ids.is_empty() {
            // Usual in an update: not worth a look at all changes.
            return Vec::new();
        }
        let at_rest = |now: DeviceBox| Motion { now, before: now };
        let boxes = self.boxes[ids.clone()].iter();
        let mut motions: Vec<_> = boxes.map(|now| at_rest(DeviceBox::new(now))).collect();
        for change in self.changed.iter().filter(|change| ids.contains(&(change.id as usize))) {
            motions[change.id as usize - ids.start].before = DeviceBox::new(&self.before(change));
        }
        motions
    }

    /// Returns the changes of the first `known` boxes.
    pub(super) fn of_known(&self, known: usize) -> Cow<'_, [ChangedBox]> {
        if known >= self.boxes.len() {
            return Cow::Borrowed(self.changed);
        }
        Cow::Owned(self.changed.iter().filter(|change| (change.id as usize) < known).copied().collect())
    }

    /// Returns the changes of filters, in pieces.
    pub(super) fn filter_changes(&self) -> Vec<Vec<FilterChange>> {
        let pieces: Vec<&[ChangedBox]> = self.changed.chunks(PIECE).collect();
        parallel::map(pieces.len(), |i| {
            pieces[i].iter().filter_map(|change| self.filter_change(change)).collect()
        })
    }

    /// Gives the changes of boxes, as the device stores them, to `put`: some of them at a time.
    pub(super) fn put_box_changes(&self, mut put: impl FnMut(&[BoxChange])) {
        const BLOCK: usize = 128;
        let mut block = [BoxChange::default(); BLOCK];
        for changed in self.changed.chunks(BLOCK) {
            let made = changed.iter().map(|change| self.box_change(change));
            block.iter_mut().zip(made).for_each(|(to, made)| *to = made);
            put(&block[..changed.len()]);
        }
    }

    fn box_change(&self, change: &ChangedBox) -> BoxChange {
        let mark = if self.before(change).is_valid() { 0 } else { WAS_ABSENT };
        BoxChange { marked_id: change.id | mark, now: DeviceBox::new(&self.boxes[change.id as usize]) }
    }

    /// Returns the new filter, if the device may have another one and the box is valid.
    fn filter_change(&self, change: &ChangedBox) -> Option<FilterChange> {
        let (now, filter) = (&self.boxes[change.id as usize], self.filters[change.id as usize]);
        // The filter that the device has for an absent box is unknown.
        let may_differ = filter != change.filter || !change.aabb.is_valid();
        (may_differ && now.is_valid()).then_some(FilterChange { id: change.id, filter })
    }

    /// Returns the bounds of each box now and at the last update.
    pub(super) fn bounds(&self) -> Vec<Aabb> {
        let mut bounds = self.boxes.to_vec();
        for change in self.changed {
            let one = &mut bounds[change.id as usize];
            *one = one.union(&self.before(change));
        }
        bounds
    }
}
