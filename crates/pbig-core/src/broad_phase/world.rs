//! The world: what is kept of each box by id, and which boxes have changed since the last update.

use super::tree::Tree;
use crate::aabb::one_box;
use crate::id_set::IdSet;
use crate::memory::Scratch;
use crate::parallel::{run_parts, split_into, threads_for};
use crate::{Aabb, ProxyFilter};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Ids that a thread reads at a time.
const PIECE: usize = 4096;

/// Maximum share of changed ids, as one in this number, that are forgotten one by one.
const FORGET_ONE_BY_ONE_IN: usize = 16;

/// A byte for each id: flags.
mod state {
    /// The box was set and not removed.
    pub(super) const PRESENT: u8 = 1;
    /// The box of the last update was removed since: its pairs end without an event.
    pub(super) const REMOVED: u8 = 2;
    /// The id is in the list of changed ids.
    pub(super) const CHANGED: u8 = 4;
}

#[derive(Clone, Debug, Default)]
pub(crate) struct World {
    /// Fat boxes; [`Aabb::NOWHERE`] for absent and invalid ones.
    pub(super) boxes: Vec<Aabb>,
    pub(super) filters: Vec<ProxyFilter>,
    states: Vec<u8>,
    /// Ids that have changed since the last update, each once.
    pub(super) changed: Vec<u32>,
    pub(super) noted: Noted,
    /// Ids whose box of the last update was removed.
    pub(super) removed: Vec<u32>,
    /// Ids whose box was set and not removed, valid or not.
    pub(super) present: IdSet,
    /// A clone makes its own when it needs one.
    pub(super) tree: Scratch<Tree>,
}

/// Counts that follow the boxes: of all, or what a thread adds to them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Noted {
    /// Valid boxes, modulo 2^32.
    pub(super) valid: u32,
    /// Boxes that came or jumped since the last update, or more: one that did so twice counts twice, and one that has left again counts, too.
    pub(super) arrived: u32,
    /// Boxes were ever given a filter other than [`ProxyFilter::ALL`].
    pub(super) is_filtered: bool,
}

impl Noted {
    fn add(&mut self, more: Self) {
        self.valid = self.valid.wrapping_add(more.valid);
        self.arrived = self.arrived.saturating_add(more.arrived);
        self.is_filtered |= more.is_filtered;
    }
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

    pub(super) fn has_removed(&self) -> bool {
        !self.removed.is_empty()
    }

    #[inline(always)]
    pub(super) fn has_changed(&self, id: u32) -> bool {
        self.states[id as usize] & state::CHANGED != 0
    }

    pub(super) fn reserve_ids(&mut self, ids: usize) {
        self.boxes.resize(ids, Aabb::NOWHERE);
        self.filters.resize(ids, ProxyFilter::ALL);
        self.states.resize(ids, 0);
        self.present.reserve(ids);
    }

    #[inline(always)]
    fn all(&mut self) -> Part<'_, &mut Vec<u32>> {
        let Self { boxes, filters, states, changed, noted, .. } = self;
        Part { first: 0, boxes, filters, states, changed, noted, is_noted: false }
    }

    /// The tree expires if a box has changed.
    #[inline(always)]
    fn expire_tree(&mut self, is_noted: bool) {
        if is_noted {
            self.tree.expire();
        }
    }

    /// Runs a change on all boxes.
    pub(super) fn change(&mut self, change: impl FnOnce(&mut Part<'_, &mut Vec<u32>>)) {
        let mut all = self.all();
        change(&mut all);
        let is_noted = all.is_noted;
        self.expire_tree(is_noted);
    }

    /// Moves a box that is present. Returns false, and does nothing, if it is not.
    // Without a closure, which may become a call.
    #[inline(always)]
    pub(super) fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter, margin: f32) -> bool {
        let mut all = self.all();
        let (is_present, is_noted) = (all.set(id, aabb, filter, margin), all.is_noted);
        self.expire_tree(is_noted);
        is_present
    }

    /// As [`World::set`], with the filter that the box has.
    #[inline(always)]
    pub(super) fn set_aabb(&mut self, id: u32, aabb: Aabb, margin: f32) -> bool {
        let mut all = self.all();
        let (is_present, is_noted) = (all.set_aabb(id, aabb, margin), all.is_noted);
        self.expire_tree(is_noted);
        is_present
    }

    /// Moves many boxes on threads. `of` returns box and filter of an id, or none to leave its box alone. Returns those that are not
    /// present; none, and moves no box, unless the ids ascend and are known. After a panic in `of` some boxes have moved.
    pub(super) fn set_many(
        &mut self,
        ids: &[u32],
        of: &(impl Fn(u32) -> Option<(Aabb, ProxyFilter)> + Sync),
        margin: f32,
    ) -> Option<Vec<(u32, Aabb, ProxyFilter)>> {
        let are_known = ids.last().is_none_or(|last| (*last as usize) < self.ids());
        // Without an end in between it is done by vectors, in a quarter of the time.
        let ascend = ids.windows(2).fold(true, |ascend, pair| ascend & (pair[0] < pair[1]));
        if !are_known || !ascend {
            return None;
        }
        let pieces = ids.len().div_ceil(PIECE);
        let noted = Noted { is_filtered: self.noted.is_filtered, ..Noted::default() };
        let mut moved = vec![Moved { noted, ..Moved::default() }; pieces];
        // A part reaches from the first id of a piece to that of the next one.
        let end = ids.last().map_or(0, |last| *last as usize + 1);
        let start = |piece: usize| ids.get(piece * PIECE).map_or(end, |id| *id as usize);
        let lens = || (0..pieces).map(|piece| start(piece + 1) - start(piece));
        let boxes = split_into(&mut self.boxes[start(0)..], lens());
        let (filters, states) = (
            split_into(&mut self.filters[start(0)..], lens()),
            split_into(&mut self.states[start(0)..], lens()),
        );
        // Each piece has room for its ids, so that no thread asks for memory.
        let listed = self.changed.len();
        self.changed.resize(listed + ids.len(), 0);
        let room = self.changed[listed..].chunks_mut(PIECE);
        let parts = ids.chunks(PIECE).zip(room).zip(&mut moved).zip(boxes.zip(filters.zip(states)));
        let done = catch_unwind(AssertUnwindSafe(|| {
            run_parts(threads_for(pieces), parts, |_, (((ids, room), moved), (boxes, (filters, states)))| {
                let Moved { listed, noted, is_noted, absent } = moved;
                let (first, changed) = (ids[0], Room { room, listed });
                let mut part = Part { first, boxes, filters, states, changed, noted, is_noted: false };
                for &id in ids {
                    if let Some((aabb, filter)) = of(id)
                        && !part.set(id, aabb, filter, margin)
                    {
                        absent.push((id, aabb, filter));
                    }
                    *is_noted |= part.is_noted;
                }
            });
        }));
        let absent = self.take_moved(moved, listed);
        done.unwrap_or_else(|panic| resume_unwind(panic));
        Some(absent)
    }

    /// Notes what threads have moved. The ids that each has listed lie at the beginning of its room, from `end` on.
    fn take_moved(&mut self, moved: Vec<Moved>, mut end: usize) -> Vec<(u32, Aabb, ProxyFilter)> {
        let mut all_absent = Vec::new();
        let rooms = (end..).step_by(PIECE);
        for (room, Moved { listed, noted, is_noted, absent }) in rooms.zip(moved) {
            self.changed.copy_within(room..room + listed, end);
            end += listed;
            // A box that has changed before is not listed again.
            self.expire_tree(is_noted);
            self.noted.add(noted);
            all_absent.extend(absent);
        }
        self.changed.truncate(end);
        all_absent
    }

    /// Inserts a box that is not present; its id is known.
    #[cold]
    pub(super) fn insert(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter, margin: f32) {
        self.states[id as usize] |= state::PRESENT;
        self.present.insert(id);
        self.change(|all| {
            all.note_change(id);
            all.put(id as usize, aabb, margin);
            all.set_filter(id, filter);
        });
    }

    pub(super) fn remove(&mut self, id: u32) {
        self.change(|all| {
            all.note_change(id);
            all.put(id as usize, Aabb::NOWHERE, 0.0);
        });
        let state = &mut self.states[id as usize];
        if *state & state::REMOVED == 0 {
            self.removed.push(id);
        }
        *state = *state & state::CHANGED | state::REMOVED;
        self.present.remove(id);
    }

    /// Forgets all changes, after an update. The tree has noted them.
    pub(super) fn forget_changes(&mut self) {
        if self.changed.len() * FORGET_ONE_BY_ONE_IN > self.ids() {
            self.states.iter_mut().for_each(|state| *state &= state::PRESENT);
        } else {
            self.changed.iter().for_each(|id| self.states[*id as usize] &= state::PRESENT);
        }
        self.changed.clear();
        self.removed.clear();
        self.noted.arrived = 0;
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
        self.tree = Scratch::default();
    }
}

/// A thread's changes, and the boxes that it could not move. Other threads write what would lie beside it.
#[derive(Clone, Debug, Default)]
#[repr(align(128))]
struct Moved {
    /// Number of changed ids that it has listed.
    listed: usize,
    noted: Noted,
    /// A box has changed.
    is_noted: bool,
    absent: Vec<(u32, Aabb, ProxyFilter)>,
}

/// A list of ids that have changed.
pub(super) trait List {
    fn add(&mut self, id: u32);
}

impl List for &mut Vec<u32> {
    #[inline(always)]
    fn add(&mut self, id: u32) {
        self.push(id);
    }
}

/// Room for the ids of a piece.
struct Room<'a> {
    room: &'a mut [u32],
    listed: &'a mut usize,
}

impl List for Room<'_> {
    #[inline(always)]
    fn add(&mut self, id: u32) {
        self.room[*self.listed] = id;
        *self.listed += 1;
    }
}

/// The boxes of all ids, or those of some consecutive ones, and where their changes are noted.
pub(super) struct Part<'a, L> {
    first: u32,
    boxes: &'a mut [Aabb],
    filters: &'a mut [ProxyFilter],
    states: &'a mut [u8],
    changed: L,
    noted: &'a mut Noted,
    /// A box has changed.
    is_noted: bool,
}

impl<L: List> Part<'_, L> {
    /// Moves a box that is present. Returns false, and does nothing, if it is not.
    ///
    /// A valid stored box is present, so its state is not read if it holds the new box. Its filter is read only if any box was
    /// ever filtered.
    #[inline(always)]
    pub(super) fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter, margin: f32) -> bool {
        if !self.set_aabb(id, aabb, margin) {
            return false;
        }
        let is_unfiltered = !self.noted.is_filtered && filter.is(&ProxyFilter::ALL);
        if !is_unfiltered && !self.filters[self.at(id)].is(&filter) {
            self.set_filter(id, filter);
        }
        true
    }

    #[inline(always)]
    fn at(&self, id: u32) -> usize {
        (id - self.first) as usize
    }

    /// As [`Part::set`], with the filter that the box has.
    #[inline(always)]
    pub(super) fn set_aabb(&mut self, id: u32, aabb: Aabb, margin: f32) -> bool {
        let i = self.at(id);
        let Some(fat) = self.boxes.get(i) else { return false };
        let gaps = one_box::gaps_are_within(&aabb, fat, slack(margin));
        let is_held = gaps == Some(true) && aabb.is_valid();
        if !is_held && self.states[i] & state::PRESENT == 0 {
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
        let i = self.at(id);
        self.filters[i] = filter;
        self.noted.is_filtered |= !filter.is(&ProxyFilter::ALL);
    }

    /// Stores a box fat; an invalid one as nowhere, so that nothing pairs it later.
    #[inline(always)]
    fn put(&mut self, i: usize, aabb: Aabb, margin: f32) {
        let is_valid = aabb.is_valid();
        let stored = &self.boxes[i];
        let was_valid = !stored.min[0].is_nan();
        let noted = &mut *self.noted;
        // Most boxes still meet what is stored, which takes less to tell. Axis by axis: the box may have been computed just now.
        if is_valid && !(0..3).all(|k| (aabb.min[k] <= stored.max[k]) & (stored.min[k] <= aabb.max[k])) {
            noted.arrived = noted.arrived.saturating_add(u32::from(has_arrived(stored, &aabb)));
        }
        noted.valid = noted.valid.wrapping_add(u32::from(is_valid)).wrapping_sub(u32::from(was_valid));
        self.boxes[i] = if is_valid { aabb.inflated(margin) } else { Aabb::NOWHERE };
    }

    #[inline(always)]
    pub(super) fn note_change(&mut self, id: u32) {
        self.is_noted = true;
        let i = self.at(id);
        if self.states[i] & state::CHANGED == 0 {
            self.states[i] |= state::CHANGED;
            self.changed.add(id);
        }
    }
}

/// Returns true if a box is new, or has jumped: the gap to its stored box is more than four times the longest edge of the stored one. Others
/// hardly ever need a new place in a tree.
#[cold]
#[inline(never)]
fn has_arrived(stored: &Aabb, now: &Aabb) -> bool {
    let edge = |k: usize| stored.max[k] - stored.min[k];
    let reach = 4.0 * edge(0).max(edge(1)).max(edge(2));
    let is_near = |k: usize| (now.min[k] - stored.max[k] <= reach) & (stored.min[k] - now.max[k] <= reach);
    !(is_near(0) & is_near(1) & is_near(2))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_jumps_by_more_than_four_of_its_edges() {
        let cube = |x: f32| Aabb::from_center([x, 0.0, 0.0], [0.5; 3]);
        let plate = |z: f32| Aabb::from_center([0.0, 0.0, z], [1.0, 1.0, 0.0]);
        let all = Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);
        let half = Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY, 0.0, f32::INFINITY]);
        for (stored, now, has_jumped) in [
            (cube(0.0), cube(5.0), false),
            (cube(5.0), cube(0.0), false),
            (plate(0.0), plate(8.0), false),
            (all, cube(1e30), false),
            (half, all, false),
            (cube(0.0), cube(5.1), true),
            (cube(5.1), cube(0.0), true),
            (plate(0.0), plate(8.1), true),
            (Aabb::NOWHERE, cube(0.0), true),
        ] {
            assert_eq!(has_arrived(&stored, &now), has_jumped, "{stored:?} {now:?}");
        }
    }
}
