//! A job: the boxes of one search on a device.

use super::changes::Changes;
use crate::layout::Motion;
use pbig_core::{Aabb, ChangedBox, ProxyFilter};

/// The data that goes up to the device.
#[derive(Clone, Copy)]
pub(super) enum Input<'a> {
    /// The boxes of the job.
    Boxes,
    /// Boxes now and at the last update.
    Motions(&'a [Motion]),
    /// Changes, for a device that has the boxes of the last update.
    Changes(Changes<'a>),
}

/// A search of boxes that fit the device at once.
pub(super) struct Job<'a> {
    /// The boxes now.
    pub(super) boxes: &'a [Aabb],
    pub(super) input: Input<'a>,
    pub(super) filters: Option<&'a [ProxyFilter]>,
    /// If not 0: only pairs of a box below this index and a box from it on are wanted.
    pub(super) split: u32,
    /// Without a grid every pair is tested.
    pub(super) needs_grid: bool,
    /// The caller wants the pairs in order.
    pub(super) is_sorted: bool,
}

impl Job<'_> {
    /// Returns the number of boxes that are valid now or were at the last update.
    pub(super) fn valid(&self) -> u32 {
        let now = self.boxes.iter().filter(|one| one.is_valid()).count();
        let Input::Changes(changes) = self.input else { return now as u32 };
        let ended =
            |change: &&ChangedBox| change.aabb.is_valid() && !self.boxes[change.id as usize].is_valid();
        (now + changes.changed.iter().filter(ended).count()) as u32
    }
}
