//! Whether lists of near pairs are worth what they cost: by what updates with and without one have taken.

use crate::broad_phase::measured::Spent;
use crate::broad_phase::update::Route;
use crate::plan::NoNear;
use std::time::Duration;

/// What a list may cost, of what updates cost without one: for less than a tenth it is not worth its memory.
const PAYS: f32 = 0.9;

/// Of how many boxes one has to change for an update to say what one without a list costs.
const SAYS_MUCH: usize = 128;

/// Updates after which a list is first asked whether they cost less than without. Before, its price is most of what it has
/// cost.
const ASKED: u32 = 32;

/// Updates that a list has to last, to be worth its price.
const LONG: u32 = 2;

/// Lists after which an update goes without one, so that what that takes is known.
const LISTS: u32 = 8;

/// Most updates without another attempt.
const LONGEST_PAUSE: u32 = 64;

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
    /// What updates with the list have cost, and of these the one that made it.
    pub(super) own: Spent,
    pub(super) price: Option<Spent>,
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
        (self.own, self.price) = (Spent::default(), None);
    }

    /// Whether a list that so many updates have used is of use: asked ever more rarely.
    pub(super) fn goes_on(&self, age: u32) -> bool {
        let is_asked = age >= ASKED && age.is_power_of_two();
        let (Some(usual), Some(price), true) = (self.usual, self.price, is_asked) else { return true };
        self.own.ns - price.ns < PAYS * usual * (self.own.changed - price.changed)
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
            self.price.get_or_insert(self.own);
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
            self.wait(Cause::Unpaid);
        }
    }

    pub(super) fn wait(&mut self, cause: Cause) {
        self.next_pause = (2 * self.next_pause + 1).min(LONGEST_PAUSE);
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
