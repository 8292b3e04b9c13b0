//! The comparison of the boxes that a box overlaps now with its kept pairs.

use crate::Pair;
use crate::broad_phase::world::World;
use crate::pairs::{Comparison, Kept, differences, equal};

/// The partners of the box at hand.
#[derive(Clone, Debug, Default)]
pub(super) struct Partners {
    /// Ids that it overlaps, sorted.
    pub(super) now: Vec<u32>,
    /// Its kept partners, sorted.
    was: Vec<u32>,
}

impl Partners {
    /// Compares what a changed box overlaps with its kept pairs. The changed box with the lower id reports a pair
    /// of two changed boxes.
    pub(super) fn compare_all(&mut self, world: &World, kept: &Kept, id: u32, events: &mut Comparison) {
        let is_own = |other: u32| other > id || other < id && world.change_of(other).is_none();
        self.now.retain(|&other| is_own(other));
        self.was.clear();
        self.was.extend(kept.partners(id).filter(|&other| is_own(other)));
        self.compare(world, id, events);
    }

    /// Compares the later boxes that a box overlaps with its kept pairs.
    #[inline(always)]
    pub(super) fn compare_later(&mut self, world: &World, kept: &Kept, id: u32, events: &mut Comparison) {
        let partners = kept.later_partners(id);
        if !equal(partners, &self.now) || world.is_filtered || world.has_removed() {
            self.was.clear();
            self.was.extend_from_slice(partners);
            self.compare(world, id, events);
        }
    }

    #[inline(never)]
    fn compare(&mut self, world: &World, id: u32, events: &mut Comparison) {
        let Self { now, was } = self;
        if world.is_filtered {
            let filter = &world.filters[id as usize];
            now.retain(|&other| filter.allows(&world.filters[other as usize]));
        }
        if world.has_removed() {
            let ended = |other: u32| world.was_removed(id) || world.was_removed(other);
            events
                .dropped
                .extend(was.iter().filter(|other| ended(**other)).map(|&other| Pair::new(id, other)));
            was.retain(|&other| !ended(other));
        }
        differences(id, was, now, &mut events.added, &mut events.removed);
    }
}
