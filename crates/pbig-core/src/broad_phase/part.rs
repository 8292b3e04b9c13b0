//! A part of the world's boxes, as one thread sets them: what is stored, and what is noted of it.

use super::world::Noted;
use crate::aabb::one_box;
use crate::{Aabb, ProxyFilter};

/// A byte for each id: flags.
pub(super) mod state {
    /// The box was set and not removed.
    pub(in crate::broad_phase) const PRESENT: u8 = 1;
    /// The box of the last update was removed since: its pairs end without an event.
    pub(in crate::broad_phase) const REMOVED: u8 = 2;
    /// The id is in the list of changed ids.
    pub(in crate::broad_phase) const CHANGED: u8 = 4;
}

/// A list of ids that have changed: one that grows, or the room that a thread was given, so that it asks for no memory.
pub(super) trait List {
    fn add(&mut self, id: u32);
}

impl List for &mut Vec<u32> {
    #[inline(always)]
    fn add(&mut self, id: u32) {
        self.push(id);
    }
}

/// Room for all ids of a piece, and how many of them are listed there.
pub(super) struct Room<'a> {
    pub(super) room: &'a mut [u32],
    pub(super) listed: &'a mut usize,
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
    pub(super) first: u32,
    pub(super) boxes: &'a mut [Aabb],
    pub(super) filters: &'a mut [ProxyFilter],
    pub(super) states: &'a mut [u8],
    pub(super) changed: L,
    pub(super) noted: &'a mut Noted,
    /// A box has changed.
    pub(super) is_noted: bool,
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
    pub(super) fn put(&mut self, i: usize, aabb: Aabb, margin: f32) {
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
#[inline(always)]
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
    use crate::BroadPhase;
    use crate::fixtures::{set, update};

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
            let mut one = BroadPhase::default();
            update(&mut one, [(0, stored)]);
            set(&mut one, [(0, now)]);
            assert_eq!(one.world.noted.arrived, u32::from(has_jumped), "{stored:?} {now:?}");
        }
    }
}
