//! The choice of how an update is made: changed boxes are looked up, or all boxes are searched. Budgets choose among searches, see
//! `policy/search.rs` and `search/all_pairs.rs`.

/// Maximum share of changed boxes for look-ups, as one in this number, up to some numbers of boxes and beyond. Measured: with more,
/// look-ups take longer than a search of dense boxes.
const LOOK_UP_TO_ONE_IN: [(usize, usize); 3] = [(512, 2), (16_384, 5), (usize::MAX, 8)];

/// Minimum number of boxes for look-ups: all pairs of fewer are tested sooner than a tree is up to date.
const LOOK_UP_FROM_BOXES: usize = 16;

/// Maximum number of nodes looked at and boxes met in look-ups, for each box of the world. A node counts as nine in the work: look-ups
/// that are given up take at most 54 for each box, besides the tree's upkeep.
const LOOK_UP_TO_NODES_PER_BOX: u64 = 6;

/// Maximum share of present boxes among all ids, as one in this number, for a search to list them: copying a box takes about as
/// long as reading an id without one.
const LIST_UP_TO_ONE_IN: usize = 2;

/// Maximum number of calls in a row without a way that was given up. If the world has become easy, the next ones may take tens of times
/// as long as they need to.
const MAX_WITHOUT: u32 = 16;

/// Maximum share of boxes that came or have jumped, as one in this number: a place takes as long as two look-ups.
const PLACE_ONE_IN: usize = 32;

/// Maximum number of boxes that came or have jumped that get places in any world.
const FEW_ARRIVALS: usize = 8;

/// Smaller worlds may take as much work as one of this size.
const SMALL_WORLD: usize = 4096;

/// Minimum number of changed boxes for look-ups on several threads.
pub(crate) const PARALLEL_FROM_CHANGES: usize = 256;

/// Returns true if so many changed boxes may be looked up.
pub(crate) fn may_look_up(boxes: usize, changed: usize) -> bool {
    let one_in = |&&(up_to, _): &&(usize, usize)| boxes <= up_to;
    let share = LOOK_UP_TO_ONE_IN.iter().find(one_in).map_or(boxes, |(_, share)| *share);
    boxes >= LOOK_UP_FROM_BOXES && changed * share <= boxes
}

/// Returns true if so many boxes that came or have jumped get places in the tree.
pub(crate) fn may_place(boxes: usize, arrivals: usize) -> bool {
    arrivals <= FEW_ARRIVALS.max(boxes / PLACE_ONE_IN)
}

/// A way that was given up because it took too much work. The next updates with as many changes go another way at once: one
/// after the first, twice as many after each further one, and half as many after each that was not given up.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct GivenUp {
    /// Number of changed boxes of the last update in which it was given up; 0 for a search of all boxes.
    changed: usize,
    /// Calls without it after that.
    pause: u32,
    /// Calls without it that are still to come.
    left: u32,
}

impl GivenUp {
    /// Returns true if the way would be given up again. Counts the call that goes another way instead.
    pub(crate) fn forbids(&mut self, changed: usize) -> bool {
        let is_like_it = self.left > 0 && changed >= self.changed;
        self.left -= u32::from(is_like_it);
        is_like_it
    }

    pub(crate) fn note(&mut self, is_given_up: bool, changed: usize) {
        if is_given_up {
            let pause = (2 * self.pause).clamp(1, MAX_WITHOUT);
            *self = Self { changed, pause, left: pause };
        } else {
            self.pause /= 2;
        }
    }
}

/// Returns the maximum number of nodes for look-ups, 5 ns each: about as long as a search of sparse boxes takes.
pub(crate) fn look_up_to_nodes(boxes: usize) -> u64 {
    LOOK_UP_TO_NODES_PER_BOX * boxes.max(SMALL_WORLD) as u64
}

/// Returns true if a search lists the present boxes first: after a peak it does not look at all ids.
pub(crate) fn is_listed(boxes: usize, ids: usize) -> bool {
    boxes * LIST_UP_TO_ONE_IN <= ids
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn updates_that_would_be_given_up_are_searches_at_once() {
        let mut given_up = GivenUp::default();
        let mut searches = || {
            given_up.note(true, 100);
            assert!(!given_up.forbids(99));
            (0..).find(|_| !given_up.forbids(100))
        };
        assert_eq!([(); 8].map(|()| searches()), [1, 2, 4, 8, 16, 16, 16, 16].map(Some));
        (0..5).for_each(|_| given_up.note(false, 100));
        given_up.note(true, 100);
        assert!(given_up.forbids(100) && !given_up.forbids(100));
    }
}
