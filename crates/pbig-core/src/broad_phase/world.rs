//! The world: what is kept of each box by id, and which boxes have changed since the last update. It knows no grid.

use super::tree::Tree;
use crate::id_set::IdSet;
use crate::{Aabb, ProxyFilter};

/// A byte for each id: flags.
mod state {
    /// The box was set and not removed.
    pub(super) const PRESENT: u8 = 1;
    /// The box of the last update was removed since: its pairs end without an event.
    pub(super) const REMOVED: u8 = 2;
    /// The id is in the list of changed ids.
    pub(super) const CHANGED: u8 = 4;
}

/// Boxes by id.
#[derive(Clone, Debug, Default)]
pub(crate) struct World {
    /// Fat boxes; [`Aabb::NOWHERE`] for absent and invalid ones.
    pub(super) boxes: Vec<Aabb>,
    pub(super) filters: Vec<ProxyFilter>,
    states: Vec<u8>,
    /// Ids that have changed since the last update, each once.
    pub(super) changed: Vec<u32>,
    /// Ids whose box of the last update was removed.
    pub(super) removed: Vec<u32>,
    /// Ids whose box was set and not removed, valid or not.
    pub(super) present: IdSet,
    pub(super) valid: u32,
    /// Boxes that were ever given a filter other than [`ProxyFilter::ALL`].
    pub(super) is_filtered: bool,
    pub(super) tree: Tree,
}

impl World {
    /// Returns one more than the largest id that was ever set.
    pub(super) fn ids(&self) -> usize {
        self.boxes.len()
    }

    /// Returns true if a box was set and not removed, valid or not.
    #[inline(always)]
    pub(super) fn contains(&self, id: u32) -> bool {
        self.states.get(id as usize).is_some_and(|state| state & state::PRESENT != 0)
    }

    /// Returns true if the box that an id had at the last update was removed since.
    #[inline(always)]
    pub(super) fn was_removed(&self, id: u32) -> bool {
        self.states[id as usize] & state::REMOVED != 0
    }

    /// Returns true if any box was removed since the last update.
    pub(super) fn has_removed(&self) -> bool {
        !self.removed.is_empty()
    }

    /// Returns true if a box has changed since the last update.
    #[inline(always)]
    pub(super) fn has_changed(&self, id: u32) -> bool {
        self.states[id as usize] & state::CHANGED != 0
    }

    /// Makes ids below `ids` known.
    pub(super) fn reserve_ids(&mut self, ids: usize) {
        self.boxes.resize(ids, Aabb::NOWHERE);
        self.filters.resize(ids, ProxyFilter::ALL);
        self.states.resize(ids, 0);
        self.present.reserve(ids);
    }

    /// Moves a box that is present. Returns false, and does nothing, if it is not.
    ///
    /// A valid stored box is present, so its state is not read if it holds the new box. Its filter is read only if any box was
    /// ever filtered.
    #[inline(always)]
    pub(super) fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter, margin: f32) -> bool {
        if !self.set_aabb(id, aabb, margin) {
            return false;
        }
        let i = id as usize;
        let is_unfiltered = !self.is_filtered && filter.is(&ProxyFilter::ALL);
        if !is_unfiltered && !self.filters[i].is(&filter) {
            self.set_filter(id, filter);
        }
        true
    }

    /// As [`World::set`], with the filter that the box has.
    #[inline(always)]
    pub(super) fn set_aabb(&mut self, id: u32, aabb: Aabb, margin: f32) -> bool {
        let i = id as usize;
        let Some(fat) = self.boxes.get(i) else { return false };
        let gaps = aabb.gaps_are_within(fat, slack(margin));
        let is_held = gaps == Some(true) && aabb.is_valid();
        if !is_held && !self.contains(id) {
            return false;
        }
        if !is_held && (gaps.is_some() || !holds_exactly(fat, aabb, slack(margin))) {
            self.note_change(id);
            self.put(i, aabb, margin);
        }
        true
    }

    #[cold]
    pub(super) fn set_filter(&mut self, id: u32, filter: ProxyFilter) {
        self.note_change(id);
        self.filters[id as usize] = filter;
        self.is_filtered |= !filter.is(&ProxyFilter::ALL);
    }

    /// Inserts a box that is not present; its id is known.
    #[cold]
    pub(super) fn insert(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter, margin: f32) {
        self.note_change(id);
        self.states[id as usize] |= state::PRESENT;
        self.present.insert(id);
        self.put(id as usize, aabb, margin);
        self.set_filter(id, filter);
    }

    /// Stores a box fat; an invalid one as nowhere, so that nothing pairs it later.
    #[inline(always)]
    fn put(&mut self, i: usize, aabb: Aabb, margin: f32) {
        let is_valid = aabb.is_valid();
        let was_valid = !self.boxes[i].min[0].is_nan();
        self.boxes[i] = if is_valid { aabb.inflated(margin) } else { Aabb::NOWHERE };
        self.valid = self.valid + u32::from(is_valid) - u32::from(was_valid);
    }

    /// Removes a box that is present.
    pub(super) fn remove(&mut self, id: u32) {
        self.note_change(id);
        self.put(id as usize, Aabb::NOWHERE, 0.0);
        let state = &mut self.states[id as usize];
        if *state & state::REMOVED == 0 {
            self.removed.push(id);
        }
        *state = *state & state::CHANGED | state::REMOVED;
        self.present.remove(id);
    }

    /// Notes a change of a box.
    #[inline(always)]
    pub(super) fn note_change(&mut self, id: u32) {
        self.tree.expire();
        let state = &mut self.states[id as usize];
        if *state & state::CHANGED == 0 {
            *state |= state::CHANGED;
            self.changed.push(id);
        }
    }

    /// Forgets all changes, after an update. The tree has noted them.
    pub(super) fn forget_changes(&mut self) {
        for &id in &self.changed {
            self.states[id as usize] &= state::PRESENT;
        }
        self.changed.clear();
        self.removed.clear();
    }

    /// Drops known ids behind the last one that is present, and spare memory.
    pub(super) fn shrink(&mut self) {
        let used = self.states.iter().rposition(|&state| state != 0).map_or(0, |last| last + 1);
        if self.changed.is_empty() {
            self.reserve_ids(used);
        }
        self.boxes.shrink_to_fit();
        self.filters.shrink_to_fit();
        self.states.shrink_to_fit();
        self.changed.shrink_to_fit();
        self.removed.shrink_to_fit();
        self.present.shrink();
        self.tree = Tree::default();
    }
}

/// Returns the maximum gap between a stored box and a box that it still holds: twice the margin. A box that shrinks more is stored
/// anew, so that only boxes near each other pair. The gap is a little less, because gaps are rounded.
#[inline(always)]
fn slack(margin: f32) -> f32 {
    2.0 * margin * (1.0 - 2.0 * f32::EPSILON)
}

/// Returns true if a stored box still holds another one, where some coordinates are infinite or NaN.
#[cold]
fn holds_exactly(fat: &Aabb, aabb: Aabb, slack: f32) -> bool {
    if !aabb.is_valid() {
        return !fat.is_valid();
    }
    // Equal first: the difference of equal infinities is NaN.
    let near = |outer: f32, inner: f32, gap: f32| outer == inner || (gap >= 0.0 && gap <= slack);
    (0..3).all(|k| {
        let (below, above) = (aabb.min[k] - fat.min[k], fat.max[k] - aabb.max[k]);
        near(fat.min[k], aabb.min[k], below) && near(fat.max[k], aabb.max[k], above)
    })
}
