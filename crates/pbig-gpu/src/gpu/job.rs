//! A job: a search of the boxes of a call, or of a part of them that fits the device.

use super::changes::Changes;
use crate::GpuOptions;
use crate::layout::Motion;
use pbig_core::{Aabb, ChangeRequest, ChangedBox, ProxyFilter, SearchRequest};
use std::borrow::Cow;

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

/// A search for all pairs or for changes.
#[derive(Clone, Copy)]
pub(super) struct Job<'a> {
    /// The boxes now; in a part of an update, around each one now and before.
    pub(super) boxes: &'a [Aabb],
    pub(super) input: Input<'a>,
    pub(super) filters: Option<&'a [ProxyFilter]>,
    /// Set in a part of a call. If not 0: only pairs of a box below this index and a box from it on are wanted.
    pub(super) split: Option<u32>,
    /// The caller wants the pairs in order.
    pub(super) is_sorted: bool,
    /// Maximum number of pairs; in a search for changes also of those that end.
    pub(super) max_pairs: u64,
}

impl<'a> Job<'a> {
    pub(super) fn all(request: &SearchRequest<'a>) -> Self {
        let &SearchRequest { boxes, filters, is_sorted, max_pairs } = request;
        Self { boxes, input: Input::Boxes, filters, split: None, is_sorted, max_pairs }
    }

    pub(super) fn changes(request: &ChangeRequest<'a>) -> Self {
        let &ChangeRequest { boxes, filters, changed, kept, max_pairs } = request;
        let input = Input::Changes(Changes { boxes, filters, changed });
        let max_pairs = max_pairs.saturating_add(kept);
        Self { boxes, input, filters: Some(filters), split: None, is_sorted: true, max_pairs }
    }

    /// Returns the changes of a call; none in a search for all pairs.
    pub(super) fn changed(&self) -> Option<Changes<'a>> {
        if let Input::Changes(changes) = self.input { Some(changes) } else { None }
    }

    /// Returns the boxes; in an update, around each one now and before.
    pub(super) fn bounds(&self) -> Cow<'a, [Aabb]> {
        self.changed().map_or(Cow::Borrowed(self.boxes), |changes| Cow::Owned(changes.bounds()))
    }

    /// Returns true if not every pair is tested: without a grid the kernels do not know parts.
    pub(super) fn needs_grid(&self, options: &GpuOptions) -> bool {
        self.split.is_some() || self.boxes.len() > options.all_pairs_up_to as usize
    }

    /// Returns the number of boxes that are valid now or were at the last update.
    pub(super) fn valid(&self) -> u32 {
        let now = self.boxes.iter().filter(|one| one.is_valid()).count();
        let Input::Changes(changes) = self.input else { return now as u32 };
        let ended =
            |change: &&ChangedBox| change.aabb.is_valid() && !self.boxes[change.id as usize].is_valid();
        (now + changes.changed.iter().filter(ended).count()) as u32
    }
}
