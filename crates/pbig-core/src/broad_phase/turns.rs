//! Bitmap or grid, where a quarter of a small world's boxes, and at least 64, change: which takes less depends on how far
//! they move and how close they are. Both take turns, and the one that took less goes on. (1000 boxes that drift: 55 us an
//! update by bitmap, 26 by near pairs; a pile of them that jump: 325 and 200. 100 boxes: 5 and 5.)

use super::measured::Spent;
use std::time::Duration;

/// Updates of a turn that decides: a list of near pairs lasts for about ten.
const TRIAL: u32 = 24;

/// Updates at the beginning of such a turn that do not count: they make room, and build what later ones keep.
const UNTIMED: u32 = 3;

/// Updates that the better one has, at first and at most.
const STAY: [u32; 2] = [512, 4096];

/// So many times what those before took on average, an update counts as at most: another process had the processor. (One
/// in which near pairs are found takes three to five times as long as others.)
const OUTLIER: f32 = 8.0;

/// Updates with few changes after which nothing that was measured holds.
const CALM: u32 = 4;

/// Whose turn it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    Bitmap,
    Grid,
}

/// The present turn, and what is known of the one before.
#[derive(Clone, Debug)]
pub(super) struct Turns {
    pub(super) turn: Turn,
    /// Updates of this turn: so far, and in all.
    age: u32,
    length: u32,
    /// Of its last updates.
    own: Spent,
    /// What the other took, if the two are to be compared.
    other: Option<Spent>,
    /// What the grid took of the bitmap's time, when both had had a turn.
    share_of_grid: Option<f32>,
    better: Option<Turn>,
    /// Updates that the better one had.
    stay: u32,
    /// Updates with few changes since the last one with many.
    calm: u32,
}

impl Default for Turns {
    fn default() -> Self {
        Self::of(Turn::Bitmap)
    }
}

impl Turns {
    fn of(turn: Turn) -> Self {
        Self {
            turn,
            age: 0,
            length: TRIAL,
            own: Spent::default(),
            other: None,
            share_of_grid: None,
            better: None,
            stay: STAY[0],
            calm: 0,
        }
    }

    /// The bitmap's as long as many change.
    #[cfg(test)]
    pub(super) fn none() -> Self {
        Self { length: u32::MAX, ..Self::default() }
    }

    /// After an update in which few boxes have changed, by the one whose turn it is. Those are the bitmap's; if the grid
    /// does some between others, they count as part of what it takes.
    pub(super) fn note_few(&mut self, time: Duration) {
        self.calm = (self.calm + 1).min(CALM);
        if self.turn == Turn::Bitmap {
            return;
        }
        if self.calm == CALM {
            *self = Self::default();
        } else if self.is_timed() {
            self.own.ns += time.as_nanos() as f32;
        }
    }

    /// After one in which many have.
    pub(super) fn note_many(&mut self, changed: usize, time: Duration) {
        if std::mem::take(&mut self.calm) == CALM {
            *self = Self::default();
        }
        self.age += 1;
        if self.is_timed() {
            let (ns, changed) = (time.as_nanos() as f32, changed as f32);
            let most =
                if self.own.ns > 0.0 { OUTLIER * self.own.ns * changed / self.own.changed } else { ns };
            self.own.ns += ns.min(most);
            self.own.changed += changed;
        }
        if self.age >= self.length {
            self.end();
        }
    }

    /// What the grid took of the bitmap's time, once both have had a turn.
    pub(super) fn share_of_grid(&self) -> Option<f32> {
        self.share_of_grid
    }

    fn is_timed(&self) -> bool {
        self.age > self.length - TRIAL + UNTIMED
    }

    fn end(&mut self) {
        let Some(other) = self.other else {
            *self = Self {
                other: Some(self.own),
                better: self.better,
                stay: self.stay,
                share_of_grid: self.share_of_grid,
                ..Self::of(self.turn.other())
            };
            return;
        };
        let share = self.own.share_of(other);
        let share_of_grid = Some(if self.turn == Turn::Grid { share } else { 1.0 / share });
        let better = if self.own.is_less(other) { self.turn } else { self.turn.other() };
        let stay = if self.better == Some(better) { (2 * self.stay).min(STAY[1]) } else { STAY[0] };
        *self = Self { better: Some(better), stay, length: stay, share_of_grid, ..Self::of(better) };
    }
}

impl Turn {
    fn other(self) -> Self {
        match self {
            Self::Bitmap => Self::Grid,
            Self::Grid => Self::Bitmap,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Updates in which 100 boxes change; whose turn each was.
    fn play(turns: &mut Turns, updates: usize, nanos: impl Fn(Turn) -> u64) -> Vec<Turn> {
        let mut update = || {
            let turn = turns.turn;
            turns.note_many(100, Duration::from_nanos(nanos(turn)));
            turn
        };
        (0..updates).map(|_| update()).collect()
    }

    fn by_grid(turns: &[Turn]) -> usize {
        turns.iter().filter(|turn| **turn == Turn::Grid).count()
    }

    fn grid_takes(nanos: u64) -> impl Fn(Turn) -> u64 {
        move |turn| if turn == Turn::Grid { nanos } else { 1000 }
    }

    #[test]
    fn both_are_tried_and_the_better_one_stays_ever_longer() {
        for (nanos, grid) in [(900, true), (1100, false)] {
            let played = play(&mut Turns::default(), 10_000, grid_takes(nanos));
            let trial = TRIAL as usize;
            assert_eq!((by_grid(&played[..trial]), by_grid(&played[trial..2 * trial])), (0, trial));
            let changes = played.windows(2).filter(|turns| turns[0] != turns[1]).count();
            assert!((4..=10).contains(&changes), "{changes} changes");
            let share = by_grid(&played) as f32 / 10_000.0;
            assert!(if grid { share > 0.98 } else { share < 0.02 }, "{share}");
        }
    }

    #[test]
    fn first_updates_of_a_turn_do_not_count() {
        let mut turns = Turns::default();
        play(
            &mut turns,
            (TRIAL + UNTIMED) as usize,
            |turn| if turn == Turn::Grid { 1_000_000 } else { 1000 },
        );
        play(&mut turns, (TRIAL - UNTIMED) as usize, grid_takes(900));
        assert_eq!((turns.turn, turns.better), (Turn::Grid, Some(Turn::Grid)));
    }

    #[test]
    fn a_world_that_has_changed_gets_the_other_one() {
        let mut turns = Turns::default();
        play(&mut turns, 1000, grid_takes(500));
        assert_eq!(turns.better, Some(Turn::Grid));
        play(&mut turns, 1100, grid_takes(2000));
        assert_eq!((turns.better, turns.stay), (Some(Turn::Bitmap), STAY[0]));
    }

    #[test]
    fn few_changes_are_left_to_the_bitmap_unless_they_are_only_few_updates() {
        let mut turns = Turns::default();
        play(&mut turns, 100, grid_takes(500));
        (1..CALM).for_each(|_| turns.note_few(Duration::ZERO));
        assert_eq!(turns.turn, Turn::Grid);
        play(&mut turns, 1, grid_takes(500));
        (0..CALM).for_each(|_| turns.note_few(Duration::ZERO));
        assert_eq!(turns.turn, Turn::Bitmap);
        assert_eq!(by_grid(&play(&mut turns, TRIAL as usize, grid_takes(500))), 0);
    }

    #[test]
    fn updates_with_few_changes_between_others_count_for_the_grid() {
        let mut turns = Turns::default();
        for _ in 0..2 * TRIAL {
            play(&mut turns, 1, grid_takes(900));
            turns.note_few(Duration::from_nanos(200));
        }
        assert_eq!(turns.better, Some(Turn::Bitmap));
    }

    #[test]
    fn one_update_that_was_interrupted_does_not_decide() {
        let mut turns = Turns::default();
        let played = std::cell::Cell::new(0);
        play(&mut turns, 2 * TRIAL as usize, |turn| {
            played.set(played.get() + 1);
            if played.get() == 40 { 4_000_000 } else { grid_takes(500)(turn) }
        });
        assert_eq!(turns.better, Some(Turn::Grid));
    }
}
