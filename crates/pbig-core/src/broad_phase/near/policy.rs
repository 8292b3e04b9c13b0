//! When there is a list of near pairs, and how wide its skin is.

use super::{FIRST, Served};
use crate::broad_phase::BroadPhase;
use crate::broad_phase::flag;
use crate::broad_phase::update::Way;
use crate::near::NearPairs;
use crate::{Aabb, Backend, Error, Pair, Strategy};
use std::time::Duration;

/// Moves that a skin is wide at first, at least and at most.
const MOVES: [f32; 3] = [4.0, 2.0, 64.0];

/// Tests of near pairs in the time that it takes to search for those of one box.
const SEARCH_OF_A_BOX: f32 = 24.0;

/// Boxes whose moves are looked at.
const SAMPLE: usize = 256;

/// Updates in which each box of a small world is looked at once, for how far it has come. Odd, for worlds in which
/// every other update is one of few.
const ROUND: usize = 5;

/// Lists after which an update goes without one, so that what that takes is known.
const LISTS: u32 = 8;

/// What a list may cost, of what updates cost without one.
const PAYS: f32 = 0.9;

/// Of how many boxes one has to change for a list: if it is always the same ones, and else.
const FEWEST: [usize; 2] = [128, 16];

/// Of how many boxes one has to have changed in updates without a list, for those to have cost about as much as one.
const PATIENCE: usize = 8;

/// Of how many boxes one may have changed for it to be remembered which.
const REMEMBERED: usize = 4;

/// Updates after which a list is first asked whether they cost less than without.
const ASKED: u32 = 32;

/// Updates that a list has to last, to be worth its price.
const LONG: u32 = 2;

/// Most updates without another attempt.
const LONGEST_PAUSE: u32 = 64;

/// Near pairs, and whether they are any good here.
#[derive(Clone, Debug)]
pub(crate) struct Near {
    /// Whether the list has the pairs that exist.
    pub(crate) is_on: bool,
    pub(crate) list: NearPairs,
    /// By id: the reach; nowhere for a box that has none.
    pub(crate) reach: Vec<Aabb>,
    pub(crate) skin: f32,
    /// In usual moves: how wide the next skin will be.
    pub(crate) moves: f32,
    /// Updates since the list was made.
    pub(crate) age: u32,
    /// How many boxes move, and how often each of them has since then.
    pub(crate) movers_count: f32,
    pub(crate) rounds: f32,
    /// How far boxes have been from where their reach was made, as far as samples show; and at half the age.
    pub(crate) farthest: f32,
    pub(crate) farthest_then: f32,
    /// Updates without another attempt.
    pub(crate) pause: u32,
    pub(crate) next_pause: u32,
    pub(crate) movers: Movers,
    /// What updates with it have cost, and of these the one that made it.
    pub(crate) own: Cost,
    pub(crate) price: Option<Cost>,
    /// For each changed box, what the last ones without any have: ns.
    pub(crate) usual: Option<f32>,
    /// Boxes that have changed in updates without a list, since the last one.
    pub(crate) without: usize,
    /// Lists so far.
    pub(crate) lists: u32,
    /// Whether an attempt has failed in this update, so that its time says nothing.
    pub(crate) failed: bool,
    /// Pairs that the last search of all has met, whether filters allow them or not.
    pub(crate) met: u64,
    /// Boxes that have left their reach in this update.
    pub(crate) away: Vec<u32>,
    /// The same, of each piece of an update on several threads.
    pub(crate) pieces: Vec<Vec<u32>>,
    /// Pairs of those, which may go on.
    pub(crate) parted: Vec<Pair>,
    /// Their pairs now.
    pub(crate) came: Vec<Pair>,
}

/// Which boxes have changed not long ago: those with [`flag::MOVED`].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Movers {
    /// How many have changed since all were forgotten.
    count: usize,
}

impl Movers {
    /// For an update in which so many have changed, which are to be marked.
    pub(crate) fn begin(&mut self, changed: usize, flags: &mut [u8]) {
        self.count += changed;
        if self.count * REMEMBERED > flags.len() {
            self.count = changed;
            flags.iter_mut().for_each(|flags| *flags &= !flag::MOVED);
        }
    }

    /// Whether most of some boxes are among them, as far as samples show.
    pub(crate) fn are_most_of(ids: &[u32], flags: &[u8]) -> bool {
        let step = ids.len().div_ceil(SAMPLE).max(1);
        let has_moved = |id: &&u32| flags[**id as usize] & flag::MOVED != 0;
        2 * ids.iter().step_by(step).filter(has_moved).count() > ids.len().div_ceil(step)
    }
}

/// What updates have cost.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cost {
    pub(crate) ns: f32,
    pub(crate) changed: f32,
}

impl Default for Near {
    fn default() -> Self {
        Self {
            is_on: false,
            list: NearPairs::default(),
            reach: vec![],
            skin: 0.0,
            moves: MOVES[0],
            age: 0,
            movers_count: 0.0,
            rounds: 0.0,
            farthest: 0.0,
            farthest_then: 0.0,
            pause: 0,
            next_pause: 0,
            movers: Movers::default(),
            own: Cost::default(),
            price: None,
            usual: None,
            without: 0,
            lists: 0,
            failed: false,
            met: 0,
            away: vec![],
            pieces: vec![],
            parted: vec![],
            came: vec![],
        }
    }
}

impl Near {
    /// A list that is made now, where so many boxes move.
    pub(crate) fn begin(&mut self, skin: f32, movers: usize) {
        (self.skin, self.age) = (skin, 0);
        (self.movers_count, self.rounds) = (movers as f32, 0.0);
        (self.farthest, self.farthest_then) = (0.0, 0.0);
        (self.own, self.price) = (Cost::default(), None);
    }

    /// Whether the list is of use: asked ever more rarely.
    pub(crate) fn goes_on(&self) -> bool {
        let is_asked = self.age >= ASKED && self.age.is_power_of_two();
        let (Some(usual), Some(price), true) = (self.usual, self.price, is_asked) else { return true };
        self.own.ns - price.ns < PAYS * usual * (self.own.changed - price.changed)
    }

    /// What a list of so many boxes has cost decides how wide the next skin will be: searches, which come
    /// the more often the narrower it is, should cost as much as tests of pairs that are apart.
    pub(crate) fn learn(&mut self, boxes: u32) {
        let search = SEARCH_OF_A_BOX * boxes as f32 / self.age.max(1) as f32;
        let tests = self.list.len().saturating_sub(self.list.overlapping()) as f32;
        let factor = if search > 1.5 * tests {
            1.4
        } else if tests > 1.5 * search {
            1.0 / 1.4
        } else {
            1.0
        };
        self.moves = (factor * self.moves).clamp(MOVES[1], MOVES[2]);
    }

    /// What an update has taken, in which so many boxes of all have changed.
    pub(crate) fn note_time(&mut self, way: Way, changed: usize, present: usize, time: Duration) {
        let says_much = changed * FEWEST[0] >= present;
        self.without = if way == Way::Near { 0 } else { self.without + changed };
        let (ns, changed) = (time.as_nanos() as f32, changed as f32);
        if way == Way::Near {
            self.own = Cost { ns: self.own.ns + ns, changed: self.own.changed + changed };
            self.price.get_or_insert(self.own);
        } else if way != Way::Gpu && says_much {
            let usual = self.usual.unwrap_or(ns / changed);
            self.usual = Some((usual + ns / changed) / 2.0);
        }
    }

    /// A list is no longer any good; if it has not paid, the next one comes later.
    pub(crate) fn end(&mut self) {
        self.lists += 1;
        let pays = self.usual.is_none_or(|usual| self.own.ns < PAYS * usual * self.own.changed);
        if pays && self.age >= LONG {
            self.next_pause = 0;
            self.pause = u32::from(self.lists.is_multiple_of(LISTS));
        } else {
            self.wait();
        }
    }

    /// What was learned is too old.
    pub(crate) fn begin_anew(&mut self) {
        (self.pause, self.next_pause, self.met, self.usual) = (0, 0, 0, None);
    }

    /// Too many pairs are near.
    pub(crate) fn fail(&mut self) {
        self.failed = true;
        self.wait();
    }

    fn wait(&mut self) {
        self.next_pause = (2 * self.next_pause + 1).min(LONGEST_PAUSE);
        self.pause = self.next_pause;
    }
}

impl BroadPhase {
    /// Whether to look for near pairs now, and how far.
    fn skin(&mut self) -> Option<f32> {
        if !self.enough_changed()
            || self.config.backend == Backend::Brute
            || self.config.strategy == Strategy::Pbig
        {
            return None;
        }
        if self.near.pause > 0 || self.near.usual.is_none() {
            self.near.pause = self.near.pause.saturating_sub(1);
            return None;
        }
        let skin = self.near.moves * self.usual_move()?;
        if !(skin > 0.0 && skin.is_finite()) {
            return None;
        }
        // Filters may turn down most of what is near: a search would look at all that, and find little.
        if self.near_to_come(skin) > self.most_near() as f64 {
            self.near.wait();
            return None;
        }
        Some(skin)
    }

    /// A new list, if there should be one, and what it comes to.
    pub(in crate::broad_phase) fn try_near(&mut self) -> Result<Served, Error> {
        let Some(skin) = self.skin() else { return Ok(Served::No) };
        let (changed, present) = (self.changed.len(), self.present_count as usize);
        if changed * FIRST <= present && self.are_the_same() {
            self.begin_near(skin)
        } else {
            self.search_near(skin)
        }
    }

    /// Whether so many change that a list may pay: a quarter, or fewer for some time already. For a few of them an update
    /// costs next to nothing anyway; and if it is other boxes each time, a list has to have all that is near.
    fn enough_changed(&self) -> bool {
        let (changed, present) = (self.changed.len(), self.present_count as usize);
        let is_due = || changed * FEWEST[0] >= present && self.near.without * PATIENCE >= present;
        self.many_changed() || (is_due() && (changed * FEWEST[1] >= present || self.are_the_same()))
    }

    /// Whether most of the boxes that change have done so not long ago.
    fn are_the_same(&self) -> bool {
        Movers::are_most_of(&self.changed, &self.flags)
    }

    /// How many pairs would be near: those that overlap, as often as there is more room around a box; filters left aside.
    fn near_to_come(&self, skin: f32) -> f64 {
        let edge = |id: u32| {
            let extents = self.boxes[id as usize].extents();
            (extents[0] + extents[1] + extents[2]) / 3.0
        };
        let Some(edge) = Sample::of(&self.changed, edge).at(0.5) else { return 0.0 };
        let grown = 1.0 + 2.0 * f64::from(skin) / f64::from(edge);
        self.near.met as f64 * grown.powi(3)
    }

    /// How far boxes move in an update: nine in ten of those that have changed no further.
    fn usual_move(&self) -> Option<f32> {
        let moved = |id: u32| {
            let (now, old) = (&self.boxes[id as usize], &self.before[id as usize]);
            let of = |k: usize| (now.min[k] - old.min[k]).abs().max((now.max[k] - old.max[k]).abs());
            // `max` would pass over a box that was not there.
            if now.min[0].is_nan() | old.min[0].is_nan() { f32::NAN } else { of(0).max(of(1)).max(of(2)) }
        };
        let sample = Sample::of(&self.changed, moved);
        if 2 * sample.count < sample.looked_at { None } else { sample.at(0.9) }
    }

    /// Boxes that tremble, or swing, need less of a skin than those that go on: once they have come no farther for as long
    /// again, near pairs are only those that such motion can bring together.
    pub(crate) fn shrink_skin(&mut self) {
        let Self { near, boxes, changed, .. } = self;
        let step = changed.len().div_ceil(SAMPLE).max(ROUND);
        for &id in changed.iter().skip(near.age as usize % step).step_by(step) {
            near.farthest =
                near.farthest.max(near.skin - slack(&near.reach[id as usize], &boxes[id as usize]));
        }
        let before = near.rounds as u32;
        near.rounds += changed.len() as f32 / near.movers_count.max(1.0);
        let rounds = near.rounds as u32;
        if rounds == before || !rounds.is_power_of_two() {
            return;
        }
        let then = std::mem::replace(&mut near.farthest_then, near.farthest);
        let enough = 1.25 * near.farthest;
        if near.farthest > 1.2 * then || enough > 0.75 * near.skin {
            return;
        }
        for (reach, aabb) in near.reach.iter_mut().zip(boxes) {
            let less = reach.inflated(enough - near.skin);
            if less.contains(aabb) {
                *reach = less;
            }
        }
        near.skin = enough;
        near.list.retain_near(&near.reach);
    }
}

/// Something of some boxes, from the least to the most; only what is finite.
struct Sample {
    values: [f32; SAMPLE],
    count: usize,
    looked_at: usize,
}

impl Sample {
    fn of(ids: &[u32], value: impl Fn(u32) -> f32) -> Self {
        let step = ids.len().div_ceil(SAMPLE).max(1);
        let mut sample = Self { values: [0.0; SAMPLE], count: 0, looked_at: ids.len().div_ceil(step) };
        for value in ids.iter().step_by(step).map(|&id| value(id)).filter(|value| value.is_finite()) {
            sample.values[sample.count] = value;
            sample.count += 1;
        }
        sample.values[..sample.count].sort_unstable_by(f32::total_cmp);
        sample
    }

    /// The value that this share of the others is below; nothing of nothing.
    fn at(&self, share: f32) -> Option<f32> {
        self.values[..self.count].get((self.count as f32 * share) as usize).copied()
    }
}

/// The narrowest gap between a box and the reach around it; NaN where that is infinite.
fn slack(reach: &Aabb, aabb: &Aabb) -> f32 {
    let gap = |k: usize| (aabb.min[k] - reach.min[k]).min(reach.max[k] - aabb.max[k]);
    gap(0).min(gap(1)).min(gap(2))
}
