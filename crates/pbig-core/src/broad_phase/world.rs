//! The world: what is kept of each box by id, and which boxes have changed since the last update.

use super::part::{Part, Room, state};
use super::tree::Tree;
use crate::id_set::IdSet;
use crate::memory::Scratch;
use crate::parallel::{run_parts, split_into, threads_for};
use crate::{Aabb, ProxyFilter};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Ids that a thread reads at a time.
const PIECE: usize = 4096;

/// Maximum share of changed ids, as one in this number, that are forgotten one by one.
const FORGET_ONE_BY_ONE_IN: usize = 16;

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
