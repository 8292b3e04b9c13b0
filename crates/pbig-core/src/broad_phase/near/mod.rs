//! Updates by near pairs: most motion is small, and what was apart by more cannot have met.
//!
//! When many boxes move, they are grown by a skin, pairs of those are found once, and updates
//! only test them (`crate::near`). Boxes that leave their reach get a new one and are searched for, as edits of the grid of
//! reaches; when they become many, all is searched anew. The skin is as wide as some moves, which it lasts for: wider, there
//! are more near pairs to test; narrower, searches come more often. Where boxes jump so far that near pairs would be many,
//! there are none, and the next attempts come ever later. Where few boxes move, always the same ones, only they get a skin, as
//! they first move: a search of all would be for those that stay.

mod making;
mod policy;
mod skin;
#[cfg(test)]
mod tests;
mod worth;

use policy::Movers;
use skin::Skin;
use worth::Worth;

use super::update::{State, state};
use super::{BroadPhase, flag};
use crate::cpu::codes::prefetch;
use crate::cpu::edit::Changed;
use crate::cpu::find::Others;
use crate::cpu::judge::Accept;
use crate::diff::Judgement;
use crate::near::NearPairs;
use crate::plan::{Chosen, Looks, NearPlan, NoNear, Plan};
use crate::report::{Checks, lap, stage};
use crate::share::{self, has_threads};
use crate::{Aabb, Error, Pair, shared_from};
use std::time::Instant;

/// Near pairs for each box that has changed, from which those of such boxes are looked up, and the others are not walked.
const LOOKED_UP: usize = 64;

/// The same where those of such boxes are rare. (A box has to be looked up even if it has none.)
const RARE_LOOKED_UP: usize = 4;

/// One in so many boxes may leave its reach in an update.
const LEAVING: usize = 32;

/// The same in the first one of a list that begins without skins.
const FIRST: usize = 8;

/// Near pairs that may come on a box: to test them must cost less than to search.
const NEAR_OF_A_BOX: u64 = 16;

/// The same where there is to be a list whatever it costs: 2 KB a box.
const NEAR_AT_MOST: u64 = 256;

/// Changed boxes from which they are looked at on several threads, and those of a piece.
const PARALLEL_FROM: usize = shared_from(16_384);
const PIECE: usize = shared_from(4096);

/// What an update by near pairs came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Served {
    Yes,
    /// Another search has to do it.
    No,
}

/// Near pairs, and whether they are any good here.
#[derive(Clone, Debug, Default)]
pub(super) struct Near {
    /// Whether the list has the pairs that exist.
    pub(super) is_on: bool,
    pub(super) list: NearPairs,
    /// By id: the reach; nowhere for a box that has none.
    reach: Vec<Aabb>,
    pub(super) skin: Skin,
    pub(super) worth: Worth,
    pub(super) movers: Movers,
    /// Updates since the list was made.
    pub(super) age: u32,
    /// Pairs that the last search of all has met, whether filters allow them or not.
    pub(super) met: u64,
    /// Why there is no list, where many boxes change.
    pub(super) none: Option<NoNear>,
    /// Boxes that have left their reach in this update.
    away: Vec<u32>,
    /// The same, of each piece of an update on several threads.
    pieces: Vec<Vec<u32>>,
    /// Pairs of those, which may go on.
    parted: Vec<Pair>,
    /// Their pairs now.
    came: Vec<Pair>,
}

impl Near {
    /// A list that is made now, where so many boxes move.
    fn begin(&mut self, width: f32, movers: usize) {
        self.age = 0;
        self.skin.begin(width, movers);
        self.worth.begin();
    }

    /// For the report.
    fn plan(&self) -> NearPlan {
        NearPlan { skin: self.skin.width, pairs: self.list.len() as u64, age: self.age }
    }

    /// What was learned is too old.
    pub(super) fn begin_anew(&mut self) {
        self.met = 0;
        self.worth = Worth::default();
    }
}

impl BroadPhase {
    /// Pairs that came and went, into `events`, and keeps them; if near pairs are there, and still good.
    pub(super) fn find_near(&mut self) -> Result<Served, Error> {
        if !self.near.is_on {
            return Ok(Served::No);
        }
        if !self.must_have_list() && !self.near.worth.goes_on(self.near.age) {
            self.end_near();
            return Ok(Served::No);
        }
        self.serve_near(LEAVING)
    }

    /// Where few change, a search of all follows that would not have been without the list.
    fn end_near(&mut self) {
        if !self.many_changed() {
            self.near.worth.own.ns += self.rebuild.search_of(self.present_count as usize);
        }
        self.near.worth.end(self.near.age);
    }

    /// As long as no more than one box in `leaving` has left its reach.
    fn serve_near(&mut self, leaving: usize) -> Result<Served, Error> {
        let mut clock = Instant::now();
        self.find_away();
        self.report.stages.plan += lap(&mut clock);
        let served = self.follow_away(leaving) && {
            self.test_near();
            self.welcome();
            true
        };
        self.forget_away();
        if !served {
            let apart = self.near.list.len().saturating_sub(self.near.list.overlapping());
            self.near.skin.learn(self.present_count, self.near.age, apart);
            self.end_near();
            return Ok(Served::No);
        }
        let mut clock = Instant::now();
        self.near.age += 1;
        self.shrink_skin();
        self.report.stages.plan += lap(&mut clock);
        self.report_near();
        self.check_near_limit()
    }

    /// Boxes that have left their reach, or have none: those that came, went, or got another filter.
    fn find_away(&mut self) {
        let Self { near, boxes, before, flags, changed, .. } = self;
        near.reach.resize(boxes.len(), Aabb::NOWHERE);
        let Near { reach, away, pieces, .. } = near;
        let is_away = |id: &u32| {
            let i = *id as usize;
            !reach[i].contains(&boxes[i]) | before[i].min[0].is_nan()
        };
        let look = |(ids, away): (&[u32], &mut Vec<u32>)| {
            // `extend` with a filter took half as long again.
            for id in ids {
                if is_away(id) {
                    away.push(*id);
                }
            }
        };
        away.clear();
        if changed.len() < PARALLEL_FROM {
            look((changed, away));
        } else {
            pieces.resize_with(changed.len().div_ceil(PIECE).max(pieces.len()), Vec::new);
            share::for_each(has_threads(), changed.chunks(PIECE).zip(&mut pieces[..]), look);
            pieces.iter_mut().for_each(|piece| away.append(piece));
        }
        away.iter().for_each(|&id| flags[id as usize] |= flag::AWAY);
    }

    fn forget_away(&mut self) {
        for id in self.near.away.drain(..) {
            self.flags[id as usize] &= !flag::AWAY;
        }
    }

    /// Gives boxes that are away another reach, and finds what is near them now; false when they are too many.
    fn follow_away(&mut self, leaving: usize) -> bool {
        let (away, present) = (self.near.away.len(), self.present_count as usize);
        if away * leaving > present || self.near.list.len() as u64 > self.most_near() {
            return false;
        }
        if away == 0 {
            self.found.clear();
            return true;
        }
        let mut clock = Instant::now();
        self.edit_reaches();
        self.report.stages.map += lap(&mut clock);
        let (near, most) = (NearAway(state!(self)), self.most_near());
        let (records, filters, update) = (&self.others, &self.filters, Some(self.updates + 1));
        let others = Others { records, filters, update, are_awake: false };
        let found = self.base.map.check_others(&others, &near, &mut self.found, most);
        self.report.stages.check += lap(&mut clock);
        found.is_ok() && self.base.map.out_of_order() * 8 < present
    }

    fn most_near(&self) -> u64 {
        let of_a_box = if self.must_have_list() { NEAR_AT_MOST } else { NEAR_OF_A_BOX };
        let most = of_a_box * u64::from(self.present_count)
            + 2 * self.near.list.overlapping().max(self.pairs.listed()) as u64;
        most.min(u64::from(u32::MAX / 2))
    }

    fn edit_reaches(&mut self) {
        stage!("map");
        let Self { near, boxes, base, others, filters, .. } = self;
        for &id in &near.away {
            near.reach[id as usize] = boxes[id as usize].inflated(near.skin.width);
        }
        base.map.arrange(&mut near.away, boxes.len());
        let changed =
            Changed { ids: &near.away, boxes: &near.reach, before: &[], filters, update: self.updates + 1 };
        base.map.edit(&changed, others);
    }

    /// Tests the near pairs, but those of boxes that were away. If those are all that have changed, no other pair has.
    fn test_near(&mut self) {
        stage!("check");
        let mut clock = Instant::now();
        self.part_away();
        if self.near.away.len() < self.changed.len() {
            self.test_changed();
        }
        self.report.stages.check += lap(&mut clock);
    }

    /// Boxes that were away have no near pairs any more.
    fn part_away(&mut self) {
        let Self { near: Near { list, away, parted, .. }, pairs, flags, .. } = self;
        parted.clear();
        if !away.is_empty() {
            list.remove_of(away, |id| flags[id as usize] & flag::AWAY != 0, parted);
            pairs.count_removed(parted);
        }
    }

    fn test_changed(&mut self) {
        let looks_up = self.looks_up();
        let Self { near, boxes, pairs, events, changed, .. } = self;
        let (list, added, removed) = (&mut near.list, &mut events.added, &mut events.removed);
        if looks_up {
            list.update_few(changed, boxes, added, removed);
        } else {
            list.update(boxes, added, removed);
        }
        pairs.count_added(added);
        pairs.count_removed(removed);
    }

    /// Whether the near pairs of boxes that have changed are looked up, instead of walking all.
    fn looks_up(&self) -> bool {
        let has_changed = |id: u32| self.flags[id as usize] & flag::CHANGED != 0;
        let (changed, list) = (self.changed.len(), &self.near.list);
        changed * LOOKED_UP < list.len()
            || (changed * RARE_LOOKED_UP < list.len() && list.is_rarely_of(has_changed))
    }

    /// Adds the near pairs of boxes that were away, and tells which of their pairs have ended.
    fn welcome(&mut self) {
        stage!("diff");
        let mut clock = Instant::now();
        let state = state!(self);
        let (added, removed) = (&mut self.events.added, &mut self.events.removed);
        let Near { list, parted, came, .. } = &mut self.near;
        came.clear();
        list.extend(&self.found.chunks, &self.boxes, came);
        self.pairs.count_added(came);
        added.extend(came.iter().filter(|pair| !state.paired_before(pair.a, pair.b)));
        let ended = |pair: &&Pair| state.paired_before(pair.a, pair.b) && !state.holds(**pair);
        removed.extend(parted.iter().filter(ended));
        self.pairs.forget_removed();
        self.report.stages.diff += lap(&mut clock);
    }

    fn report_near(&mut self) {
        let [made, needed] = self.near.list.take_tests();
        self.report.checks = Checks { made, unnecessary: made - needed, redundant: 0 };
        let (moved, boxes) = (self.base.map.out_of_order() as u32, self.valid_count());
        let near = Some(self.near.plan());
        let looks = Looks::default();
        self.report.plan = Plan { chosen: Chosen::Near, moved, boxes, near, looks, ..self.base_plan.clone() };
    }

    /// Too many new pairs: all is as it was, for the next attempt.
    fn check_near_limit(&mut self) -> Result<Served, Error> {
        let limit = self.config.limits.max_pairs;
        if self.events.added.len() as u64 <= limit {
            return Ok(Served::Yes);
        }
        self.drop_near();
        let state = state!(self);
        self.pairs.end_many(&Before(state), &mut vec![]);
        self.pairs.insert(&self.events.removed);
        self.events.removed.clear();
        Err(Error::TooManyPairs { limit })
    }
}

/// Whether filters let two boxes pair of which the first is away. Of two that are, it is asked from both sides.
struct NearAway<'a>(State<'a>);

impl Accept for NearAway<'_> {
    #[inline(always)]
    fn meets(&self, query: u32, candidate: u32) -> bool {
        (query < candidate) | (self.0.flags[candidate as usize] & flag::AWAY == 0)
    }

    fn pair(&self, pair: Pair) -> bool {
        self.0.filters_allow(pair.a, pair.b)
    }
}

/// Which pairs there were at the last update.
struct Before<'a>(State<'a>);

impl Judgement for Before<'_> {
    #[inline(always)]
    fn prepare(&self, pair: Pair) {
        [pair.a, pair.b].into_iter().for_each(|id| prefetch(&self.0.before[id as usize]));
    }

    fn holds(&self, pair: Pair) -> bool {
        self.0.paired_before(pair.a, pair.b)
    }
}
