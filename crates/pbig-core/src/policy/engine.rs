//! The choice of an engine for an update.

use super::search::work_of_full_grid;
use crate::Engine;
use crate::holder::Holder;

/// Maximum number of boxes of a world that is swept although a grid is kept: a sweep of one changed box takes no longer than an edit.
pub(crate) const SWEEP_FIRST_UP_TO_BOXES: usize = 1024;

/// Maximum number of boxes of a world that is swept. Each sweep after a rebuild allocates the rows of `b`.
pub(crate) const SWEEP_UP_TO_BOXES: usize = 2048;

/// Maximum number of tests for each box of the world in a sweep: beyond, a grid finds the pairs sooner.
pub(crate) const SWEEP_UP_TO_TESTS_PER_BOX: usize = 200;

/// Tests that take as long as one pair that begins or ends: a sweep keeps each on its own, a rebuild whole rows.
const TESTS_OF_EVENT: usize = 256;

/// Number of events that count for nothing: they take less than 0.1 ms, and tiny worlds need no memory for a grid.
const FREE_EVENTS: usize = 1024;

/// Maximum share of changed boxes for an edit, as one in this number. Measured: an edit takes as long as a rebuild at 7 to 10% of
/// 100,000 boxes, and at 4 to 5% of a million.
pub(crate) const EDIT_UP_TO_ONE_IN: usize = 20;

/// Maximum share of present boxes among all ids, as one in this number, for a rebuild to list them: copying a box takes about as
/// long as reading an id without one.
const LIST_UP_TO_ONE_IN: usize = 2;

/// Work of an edit for each box of the world, in tests of codes of 0.35 ns; a rebuild sorts a box in about 40 ns.
const EDIT_UP_TO_WORK_PER_BOX: u64 = 60;

/// Maximum number of rebuilds in a row after updates that were given up.
const MAX_REBUILDS: u32 = 64;

/// Maximum number of nodes looked at and boxes met in an update in a tree, for each box of the world. A node counts as nine in the
/// work: an update that is given up takes at most 64 more for each box than a search.
const LOOK_UP_TO_NODES_PER_BOX: u64 = 7;

/// Maximum share of boxes out of the grid's order for an edit, as one in this number: lists are slower than slots.
pub(crate) const SPILL_UP_TO_ONE_IN: usize = 2;

/// Minimum number of changed boxes for look-ups on several threads.
pub(crate) const PARALLEL_FROM_EDITS: usize = 1024;

/// Counts from which an engine is chosen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counts {
    /// Boxes that are present.
    pub(crate) boxes: usize,
    /// Boxes changed since the last update.
    pub(crate) changed: usize,
    /// True if the old state of all changed boxes is known.
    pub(crate) knows_old: bool,
    /// The structure that holds the boxes of the last update.
    pub(crate) holder: Holder,
    /// Boxes out of the grid's order.
    pub(crate) spilled: usize,
    /// Pairs that began or ended in the last update.
    pub(crate) events: usize,
}

impl Counts {
    fn may_edit(&self) -> bool {
        self.knows_old && self.holder == Holder::Grid
    }

    /// Returns true if a sweep finds what has changed soonest, in a world of at most `most` boxes.
    fn may_sweep(&self, most: usize) -> bool {
        // Each changed box meets all, or each box half of the others.
        let events = self.events.saturating_sub(FREE_EVENTS);
        let tests = self.changed.min(self.boxes / 2) * self.boxes + TESTS_OF_EVENT * events;
        let tests_per_box = tests / self.boxes.max(1);
        self.boxes <= most && tests_per_box <= SWEEP_UP_TO_TESTS_PER_BOX
    }

    /// Returns true if few enough boxes have changed for an engine to look at these alone.
    fn are_few(&self) -> bool {
        self.changed * EDIT_UP_TO_ONE_IN <= self.boxes
    }
}

/// Chooses the engine of an update in which some boxes have changed.
///
/// | rule, the first that applies | engine |
/// | --- | --- |
/// | boxes at most [`SWEEP_FIRST_UP_TO_BOXES`], tests for each at most [`SWEEP_UP_TO_TESTS_PER_BOX`] | sweep |
/// | a grid of the last update, changed at most 1 in [`EDIT_UP_TO_ONE_IN`], spilled at most 1 in [`SPILL_UP_TO_ONE_IN`] | edit |
/// | as in the first row, boxes at most [`SWEEP_UP_TO_BOXES`] | sweep |
/// | a tree of the last update, changed at most 1 in [`EDIT_UP_TO_ONE_IN`] | tree |
/// | else | rebuild |
pub(crate) fn choose_engine(counts: &Counts, forced: Option<Engine>) -> Engine {
    match forced {
        Some(Engine::Edit) if !counts.may_edit() => return Engine::Rebuild,
        Some(engine) => return engine,
        None => {}
    }
    let is_tidy = counts.spilled * SPILL_UP_TO_ONE_IN <= counts.boxes;
    if counts.may_sweep(SWEEP_FIRST_UP_TO_BOXES) {
        Engine::Sweep
    } else if counts.may_edit() && is_tidy && counts.are_few() {
        Engine::Edit
    } else if counts.may_sweep(SWEEP_UP_TO_BOXES) {
        Engine::Sweep
    } else if counts.holder == Holder::Tree && counts.are_few() {
        Engine::Tree
    } else {
        Engine::Rebuild
    }
}

/// Updates that were given up because they took too much work. The next ones with as many changes are rebuilds at once: one
/// after the first, twice as many after each further one, until an update is not given up.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct GivenUp {
    /// Number of changed boxes of the last update that was given up.
    changed: usize,
    /// Rebuilds after it.
    rebuilds: u32,
    /// Rebuilds that are still to come.
    left: u32,
}

impl GivenUp {
    /// Returns the engine of an update: a rebuild, where the policy's choice would be given up again.
    pub(crate) fn instead_of(&mut self, engine: Engine, changed: usize) -> Engine {
        let is_like_it = self.left > 0 && changed >= self.changed;
        if !is_like_it || engine == Engine::Sweep {
            return engine;
        }
        self.left -= 1;
        Engine::Rebuild
    }

    /// Notes whether an edit or a look-up in a tree was given up.
    pub(crate) fn note(&mut self, is_given_up: bool, changed: usize) {
        if is_given_up {
            let rebuilds = (2 * self.rebuilds).clamp(1, MAX_REBUILDS);
            *self = Self { changed, rebuilds, left: rebuilds };
        } else {
            *self = Self::default();
        }
    }
}

/// Returns the maximum work of an edit, in tests of codes: about half the time of a rebuild. A rebuild sorts the boxes, and is
/// expected to do the work of the last rebuild, at most that of a full grid.
pub(crate) fn edit_up_to_work(boxes: usize, pairs: usize, rebuild_work: u64) -> u64 {
    EDIT_UP_TO_WORK_PER_BOX * boxes as u64 + rebuild_work.min(work_of_full_grid(boxes, pairs)) / 2
}

/// Returns the maximum number of nodes for look-ups in a tree: 5 ns each, while a search sorts and joins a box in about 150 ns.
pub(crate) fn look_up_to_nodes(boxes: usize) -> u64 {
    LOOK_UP_TO_NODES_PER_BOX * boxes as u64
}

/// Returns true if a rebuild lists the present boxes first: after a peak it does not look at all ids.
pub(crate) fn is_listed(boxes: usize, ids: usize) -> bool {
    boxes * LIST_UP_TO_ONE_IN <= ids
}

/// Returns the number of old states to keep until the next update.
pub(crate) fn old_states_to_keep(boxes: usize, forced: Option<Engine>) -> usize {
    match forced {
        Some(Engine::Edit) => usize::MAX,
        Some(_) => 0,
        None => boxes / EDIT_UP_TO_ONE_IN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORLD: Counts =
        Counts { boxes: 10_000, changed: 100, knows_old: true, holder: Holder::Grid, spilled: 0, events: 0 };

    #[test]
    fn few_changes_are_edited_and_many_rebuild_the_grid() {
        assert_eq!(choose_engine(&WORLD, None), Engine::Edit);
        assert_eq!(choose_engine(&Counts { changed: 501, ..WORLD }, None), Engine::Rebuild);
        assert_eq!(choose_engine(&Counts { spilled: 5001, ..WORLD }, None), Engine::Rebuild);
        assert_eq!(choose_engine(&Counts { holder: Holder::Nothing, ..WORLD }, None), Engine::Rebuild);
        assert_eq!(choose_engine(&Counts { knows_old: false, ..WORLD }, None), Engine::Rebuild);
        assert_eq!(edit_up_to_work(1000, 10, 6000), 63_000);
        assert_eq!(edit_up_to_work(1024, 10, u64::MAX), 61_440 + 155 * 1024 + 160);
    }

    #[test]
    fn few_changes_use_a_tree_if_it_is_kept() {
        let tree = Counts { holder: Holder::Tree, knows_old: false, ..WORLD };
        assert_eq!(choose_engine(&Counts { changed: 500, ..tree }, None), Engine::Tree);
        assert_eq!(choose_engine(&Counts { changed: 501, ..tree }, None), Engine::Rebuild);
        assert_eq!(choose_engine(&Counts { boxes: 2048, ..tree }, None), Engine::Sweep);
        assert_eq!(choose_engine(&Counts { boxes: 2049, ..tree }, None), Engine::Tree);
        assert_eq!(look_up_to_nodes(1000), 7000);
    }

    #[test]
    fn boxes_are_listed_if_half_of_the_ids_have_none() {
        assert!(is_listed(500, 1000) && !is_listed(501, 1000));
    }

    #[test]
    fn updates_that_would_be_given_up_are_rebuilds_at_once() {
        let mut given_up = GivenUp::default();
        let mut rebuilds = || {
            given_up.note(true, 100);
            assert_eq!(given_up.instead_of(Engine::Edit, 99), Engine::Edit);
            assert_eq!(given_up.instead_of(Engine::Sweep, 100), Engine::Sweep);
            (0..).find(|_| given_up.instead_of(Engine::Edit, 100) == Engine::Edit)
        };
        assert_eq!([(); 8].map(|()| rebuilds()), [1, 2, 4, 8, 16, 32, 64, 64].map(Some));
        given_up.note(false, 100);
        assert_eq!(given_up.instead_of(Engine::Tree, 100), Engine::Tree);
    }

    #[test]
    fn small_worlds_are_swept_while_few_boxes_change() {
        let small = Counts { boxes: 1000, changed: 200, holder: Holder::Nothing, ..WORLD };
        assert_eq!(choose_engine(&small, None), Engine::Sweep);
        assert_eq!(choose_engine(&Counts { changed: 201, ..small }, None), Engine::Rebuild);
        assert_eq!(choose_engine(&Counts { changed: 100, events: 1416, ..small }, None), Engine::Sweep);
        assert_eq!(choose_engine(&Counts { changed: 100, events: 1424, ..small }, None), Engine::Rebuild);
        assert_eq!(choose_engine(&Counts { boxes: 401, changed: 401, ..small }, None), Engine::Sweep);
        assert_eq!(choose_engine(&Counts { boxes: 402, changed: 402, ..small }, None), Engine::Rebuild);
        let more = Counts { boxes: 1025, changed: 51, holder: Holder::Grid, ..small };
        assert_eq!(choose_engine(&more, None), Engine::Edit);
        assert_eq!(choose_engine(&Counts { changed: 52, ..more }, None), Engine::Sweep);
        assert_eq!(choose_engine(&Counts { knows_old: false, ..small }, None), Engine::Sweep);
    }

    #[test]
    fn an_engine_that_is_asked_for_is_used_where_it_can() {
        for engine in Engine::ALL {
            assert_eq!(choose_engine(&WORLD, Some(engine)), engine);
            let lost = Counts { holder: Holder::Nothing, knows_old: false, ..WORLD };
            let instead = if engine == Engine::Edit { Engine::Rebuild } else { engine };
            assert_eq!(choose_engine(&lost, Some(engine)), instead);
        }
    }
}
