//! Whether lists of near pairs are worth what they cost: by what updates with and without one have taken.

use crate::broad_phase::measured::Spent;
use crate::broad_phase::update::Route;
use crate::plan::NoNear;
use std::time::Duration;

/// What a list may cost, of what updates cost without one: for less than a tenth it is not worth its memory.
const PAYS: f32 = 0.9;

/// Of how many boxes one has to change for an update to say what one without a list costs.
const SAYS_MUCH: usize = 128;

/// Updates after which a list is first asked whether the latter half of them cost less than without. In the first eight, what
/// swings gets its narrower skin and an index.
const ASKED: u32 = 16;

/// Updates that a list has to last, to be worth its price.
const LONG: u32 = 2;

/// Lists after which an update goes without one, so that what that takes is known.
const LISTS: u32 = 8;

/// Most updates without another attempt: two seconds of a game.
const LONGEST_PAUSE: u32 = 128;

/// Why updates go without a list.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum Cause {
    /// So that what that takes is known.
    #[default]
    Compared,
    /// The last ones did not pay.
    Unpaid,
    /// Too many pairs would be near.
    Many,
}

/// What lists have cost, and what goes without.
#[derive(Clone, Debug, Default)]
pub(in crate::broad_phase) struct Worth {
    /// What updates with the list have cost; and those since it was last asked in which many boxes changed.
    pub(super) own: Spent,
    pub(super) unasked: Spent,
    /// For each changed box, what the last ones without any have: ns.
    pub(super) usual: Option<f32>,
    /// Boxes that have changed in updates without a list, since the last one.
    pub(super) without: usize,
    /// Lists so far.
    pub(super) lists: u32,
    /// Updates without another attempt: still to go, and as many as it was.
    pub(in crate::broad_phase) pause: u32,
    pub(super) next_pause: u32,
    pub(super) cause: Cause,
    /// Whether an attempt has failed in this update, so that its time says nothing.
    pub(in crate::broad_phase) failed: bool,
}

impl Worth {
    /// A list is made now.
    pub(super) fn begin(&mut self) {
        (self.own, self.unasked) = (Spent::default(), Spent::default());
    }

    /// Whether a list that so many updates have used is of use: asked ever more rarely, about the latter half of them, as far as
    /// many boxes changed. (When it was asked about all but the first, after 32: of a million boxes of which 3% drift, where
    /// lists are a loss, an update took 24 ms on average in the first 90 instead of 17.)
    pub(super) fn goes_on(&mut self, age: u32) -> bool {
        if !age.is_power_of_two() {
            return true;
        }
        let Spent { ns, changed } = std::mem::take(&mut self.unasked);
        age < ASKED || changed == 0.0 || self.usual.is_none_or(|usual| ns < PAYS * usual * changed)
    }

    /// What updates with this list have cost, of what those without do; nothing before both are known.
    pub(in crate::broad_phase) fn share(&self) -> Option<f32> {
        let usual = Spent { ns: self.usual?, changed: 1.0 };
        (self.own.ns > 0.0 && self.own.changed > 0.0).then(|| self.own.share_of(usual))
    }

    /// What an update has taken, in which so many boxes of all have changed.
    pub(in crate::broad_phase) fn note_time(
        &mut self,
        route: Route,
        changed: usize,
        present: usize,
        time: Duration,
    ) {
        let says_much = changed * SAYS_MUCH >= present;
        self.without = if route == Route::Near { 0 } else { self.without + changed };
        let (ns, changed) = (time.as_nanos() as f32, changed as f32);
        if route == Route::Near {
            self.own.add(ns, changed);
            if says_much {
                self.unasked.add(ns, changed);
            }
        } else if route != Route::Gpu && says_much {
            let usual = self.usual.unwrap_or(ns / changed);
            self.usual = Some((usual + ns / changed) / 2.0);
        }
    }

    /// A list is no longer any good; if it has not paid, the next one comes later.
    pub(super) fn end(&mut self, age: u32) {
        self.lists += 1;
        let pays = self.share().is_none_or(|share| share < PAYS);
        if pays && age >= LONG {
            self.next_pause = 0;
            (self.pause, self.cause) = (u32::from(self.lists.is_multiple_of(LISTS)), Cause::Compared);
        } else {
            self.wait(Cause::Unpaid, age);
        }
    }

    /// Twice as long as the last time, and as many updates at least.
    pub(super) fn wait(&mut self, cause: Cause, least: u32) {
        self.next_pause = (2 * self.next_pause + 1).max(least).min(LONGEST_PAUSE);
        (self.pause, self.cause) = (self.next_pause, cause);
    }

    /// Whether this update is one of those that go without a list, and why.
    pub(super) fn goes_without(&mut self) -> Option<NoNear> {
        if self.pause == 0 {
            return self.usual.is_none().then_some(NoNear::Unmeasured);
        }
        self.pause -= 1;
        Some(self.told())
    }

    /// Why the updates to come go without.
    pub(super) fn told(&self) -> NoNear {
        match self.cause {
            Cause::Compared => NoNear::Compared,
            Cause::Unpaid => NoNear::Unpaid(self.pause),
            Cause::Many => NoNear::Many(self.pause),
        }
    }
}
