//! The choice of an engine for an update.

use crate::Engine;

/// Boxes of a world in which changed boxes are tested against all, at most.
pub(crate) const SWEEP_UP_TO_BOXES: usize = 1024;

/// Tests (changed boxes times boxes) up to which a sweep takes less time than a grid.
pub(crate) const SWEEP_UP_TO_TESTS: usize = 1 << 16;

/// Share of the boxes, one in so many, up to which changed boxes are edited: measured, editing takes as long as a rebuild
/// at 7 to 10% of 100,000 boxes, at 4 to 5% of a million.
pub(crate) const EDIT_UP_TO_ONE_IN: usize = 20;

/// Share of the boxes, one in so many, that may be out of the grid's order: lists of them are slower than slots.
pub(crate) const SPILL_UP_TO_ONE_IN: usize = 2;

/// Changed boxes from which several threads look them up.
pub(crate) const PARALLEL_FROM_EDITS: usize = 1024;

/// Counts from which an engine is chosen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counts {
    /// Boxes that are present.
    pub(crate) boxes: usize,
    /// One more than the largest id.
    pub(crate) ids: usize,
    /// Boxes changed since the last update.
    pub(crate) changed: usize,
    /// True if the old state of all changed boxes is known.
    pub(crate) knows_old: bool,
    /// True if the grid holds the boxes of the last update.
    pub(crate) has_grid: bool,
    /// Boxes out of the grid's order.
    pub(crate) spilled: usize,
}

/// Chooses the engine of an update in which some boxes have changed.
///
/// | rule, the first that applies | engine |
/// | --- | --- |
/// | ids at most [`SWEEP_UP_TO_BOXES`], changed x ids at most [`SWEEP_UP_TO_TESTS`] | sweep |
/// | a grid of the last update, changed at most 1 in [`EDIT_UP_TO_ONE_IN`], spilled at most 1 in [`SPILL_UP_TO_ONE_IN`] | edit |
/// | else | rebuild |
pub(crate) fn choose_engine(counts: &Counts, forced: Option<Engine>) -> Engine {
    let may_edit = counts.knows_old && counts.has_grid;
    match forced {
        Some(Engine::Sweep) => return Engine::Sweep,
        Some(Engine::Edit) if may_edit => return Engine::Edit,
        Some(_) => return Engine::Rebuild,
        None => {}
    }
    let is_small = counts.ids <= SWEEP_UP_TO_BOXES && counts.changed * counts.ids <= SWEEP_UP_TO_TESTS;
    let is_few = counts.changed * EDIT_UP_TO_ONE_IN <= counts.boxes;
    let is_tidy = counts.spilled * SPILL_UP_TO_ONE_IN <= counts.boxes;
    if is_small {
        Engine::Sweep
    } else if is_few && is_tidy && may_edit {
        Engine::Edit
    } else {
        Engine::Rebuild
    }
}

/// Returns the number of old states that are worth keeping until the next update.
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
        Counts { boxes: 10_000, ids: 10_000, changed: 100, knows_old: true, has_grid: true, spilled: 0 };

    #[test]
    fn few_changes_are_edited_and_many_rebuild_the_grid() {
        assert_eq!(choose_engine(&WORLD, None), Engine::Edit);
        assert_eq!(choose_engine(&Counts { changed: 501, ..WORLD }, None), Engine::Rebuild);
        assert_eq!(choose_engine(&Counts { spilled: 5001, ..WORLD }, None), Engine::Rebuild);
        assert_eq!(choose_engine(&Counts { has_grid: false, ..WORLD }, None), Engine::Rebuild);
        assert_eq!(choose_engine(&Counts { knows_old: false, ..WORLD }, None), Engine::Rebuild);
    }

    #[test]
    fn small_worlds_are_swept_while_few_boxes_change() {
        let small = Counts { boxes: 1000, ids: 1000, changed: 65, has_grid: false, ..WORLD };
        assert_eq!(choose_engine(&small, None), Engine::Sweep);
        assert_eq!(choose_engine(&Counts { changed: 66, ..small }, None), Engine::Rebuild);
        assert_eq!(choose_engine(&Counts { ids: 1025, ..small }, None), Engine::Rebuild);
        assert_eq!(choose_engine(&Counts { knows_old: false, ..small }, None), Engine::Sweep);
    }

    #[test]
    fn an_engine_that_is_asked_for_is_used_where_it_can() {
        for engine in [Engine::Sweep, Engine::Edit, Engine::Rebuild] {
            assert_eq!(choose_engine(&WORLD, Some(engine)), engine);
            let lost = Counts { has_grid: false, knows_old: false, ..WORLD };
            let instead = if engine == Engine::Edit { Engine::Rebuild } else { engine };
            assert_eq!(choose_engine(&lost, Some(engine)), instead);
        }
    }
}
