//! Whether the base is edited or built anew: what costs less by what both have taken here.
//!
//! Edits cost by the box that has changed, a search of all by the box that is there. Where boxes go a tenth of their size, one
//! edit costs as much as seven boxes of a search of all; where they jump, as much as twenty. (100,000 boxes of which 15%
//! change: 6.5 ms by edits and 6.2 anew, or 13 and 6.)

use super::update::Route;
use std::time::Duration;

/// Boxes of a search of all in the time of an edit: before both have been measured, at least and at most.
const RATIO: [f32; 3] = [7.0, 4.0, 32.0];

/// Of how many boxes one has to change for the time to tell what an edit costs, and not what comes with any update.
const SHARE: usize = 64;

/// Updates in a row that go one way before the other is tried again, where both are about as good.
const SAME: u32 = 64;

/// How much better the other has to be expected to be: the choice does not flap where they are as good.
const BETTER: f32 = 1.15;

/// How much better or worse the other may be for that.
const NEARLY: f32 = 2.0;

/// The same where one seems better: it may have become the worse one. Not where it is by far.
const SELDOM: u32 = 1024;
const FAR: f32 = 4.0;

/// How much one measurement counts: so many are about what is remembered.
const MEMORY: f32 = 4.0;

/// Of either way: ns.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rebuild {
    of_edit: Option<f32>,
    of_box: Option<f32>,
    /// The last way but for trials of the other, and updates in a row that went it.
    last: bool,
    same: u32,
    /// Whether the base has been built anew after edits in this update.
    after_edits: bool,
}

impl Rebuild {
    /// Whether to build the base anew, where so many boxes of those there are have changed.
    pub(super) fn pays(&mut self, changed: usize, present: usize) -> bool {
        let share = changed as f32 * self.ratio() / present.max(1) as f32;
        let is_close = (1.0 / NEARLY..NEARLY).contains(&share);
        let better = share >= if self.last { 1.0 / BETTER } else { BETTER };
        let is_far = !(1.0 / FAR..FAR).contains(&share);
        let patience = if is_close { SAME } else { SELDOM };
        if !is_far && self.same >= patience {
            self.same = 0;
            return !self.last;
        }
        self.same = if better == self.last { self.same + 1 } else { 0 };
        self.last = better;
        better
    }

    fn ratio(&self) -> f32 {
        self.measured().map_or(RATIO[0], |ratio| ratio.clamp(RATIO[1], RATIO[2]))
    }

    /// Boxes of a search of all in the time of an edit, once both have been.
    pub(super) fn measured(&self) -> Option<f32> {
        Some(self.of_edit? / self.of_box?)
    }

    /// Edits had left too little of the order: the search of all that followed is part of what they cost.
    pub(super) fn followed_edits(&mut self, present: usize, time: Duration) {
        self.after_edits = true;
        learn(&mut self.of_box, time.as_nanos() as f32 / present.max(1) as f32);
    }

    /// What a search of so many boxes takes: ns; nothing before one was measured.
    pub(super) fn search_of(&self, present: usize) -> f32 {
        self.of_box.unwrap_or(0.0) * present as f32
    }

    /// What an update has taken.
    pub(super) fn note(&mut self, route: Route, changed: usize, present: usize, time: Duration) {
        let ns = time.as_nanos() as f32;
        let route = if std::mem::take(&mut self.after_edits) { Route::Edits } else { route };
        match route {
            Route::All => learn(&mut self.of_box, ns / present.max(1) as f32),
            Route::Few | Route::Edits if changed * SHARE >= present => {
                learn(&mut self.of_edit, ns / changed as f32)
            }
            _ => {}
        }
    }
}

/// What takes longer than usual says less than what takes less: another process had the processor, or memory was made room
/// for.
fn learn(usual: &mut Option<f32>, ns: f32) {
    let ns = ns.max(f32::MIN_POSITIVE);
    let before = usual.unwrap_or(ns);
    let memory = if ns < before { 2.0 } else { MEMORY };
    *usual = Some(before + (ns.min(2.0 * before) - before) / memory);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn us(time: u64) -> Duration {
        Duration::from_micros(time)
    }

    #[test]
    fn what_takes_less_is_done_and_the_other_tried_now_and_then_where_they_are_close() {
        let mut rebuild = Rebuild::default();
        assert!(
            !rebuild.pays(140, 1000) && rebuild.pays(170, 1000),
            "before anything is known: a seventh, and 15% more to change over"
        );
        for _ in 0..50 {
            rebuild.note(Route::Edits, 100, 1000, us(200));
            rebuild.note(Route::All, 100, 1000, us(100));
        }
        assert!(rebuild.pays(60, 1000) && !rebuild.pays(40, 1000), "an edit costs as much as 20 boxes");
        let tried = (0..10 * SAME).filter(|_| rebuild.pays(60, 1000)).count() as u32;
        assert!((10 * SAME - 12..10 * SAME - 5).contains(&tried), "{tried}");
        assert!((0..10 * SAME).all(|_| rebuild.pays(200, 1000)), "not close");
    }

    #[test]
    fn about_where_both_are_as_good_the_choice_does_not_flap() {
        let mut rebuild = Rebuild::default();
        let mut goes = |changed: usize| rebuild.pays(changed, 1000);
        assert!((0..20).all(|update| !goes(135 + 20 * (update % 2))), "edits as before");
        assert!(goes(200) && (0..20).all(|update| goes(135 + 20 * (update % 2))), "anew as before");
        assert!(!goes(100));
        let tried = (0..4 * SAME).filter(|_| goes(143)).count();
        assert!((2..=4).contains(&tried), "as good: {tried} trials of one update each");
    }

    #[test]
    fn few_changes_and_outliers_say_little() {
        let mut rebuild = Rebuild::default();
        (0..50).for_each(|_| rebuild.note(Route::All, 100, 1000, us(100)));
        (0..50).for_each(|_| rebuild.note(Route::Edits, 100, 1000, us(70)));
        (0..50).for_each(|_| rebuild.note(Route::Edits, 10, 1000, us(70)));
        rebuild.note(Route::Edits, 100, 1000, us(7_000_000));
        assert!(rebuild.ratio() < 9.0, "{}", rebuild.ratio());
    }
}
