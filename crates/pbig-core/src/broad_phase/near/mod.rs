//! Updates by near pairs: most motion is small, and what was apart by more cannot have met.
//!
//! When many boxes move, they are grown by a skin, pairs of those are found once, and updates
//! only test them (`crate::near`). Boxes that leave their reach get a new one and are searched for, as edits of the grid of
//! reaches; when they become many, all is searched anew. The skin is as wide as some moves, which it lasts for: wider, there
//! are more near pairs to test; narrower, searches come more often. Where boxes jump so far that near pairs would be many,
//! there are none, and the next attempts come ever later. Where few boxes move, always the same ones, only they get a skin, as
//! they first move: a search of all would be for those that stay.

mod policy;
#[cfg(test)]
mod tests;

pub(super) use policy::{Cost, Near};

use super::update::{State, state};
use super::{BroadPhase, flag};
use crate::cpu::codes::prefetch;
use crate::cpu::crowding::Set;
use crate::cpu::edit::Changed;
use crate::cpu::find::Others;
use crate::cpu::judge::Accept;
use crate::diff::{Judgement, PairStore};
use crate::plan::{Chosen, LazySummary, Plan};
use crate::report::{Checks, lap, stage};
use crate::search::Rule;
use crate::{Aabb, Error, Pair, ProxyFilter, shared_from};
use rayon::prelude::*;
use std::time::Instant;

/// Near pairs that are walked in the time that it takes to look up the pairs of one box.
const LOOKUP: usize = 20;

/// One in so many boxes may leave its reach in an update.
const LEAVING: usize = 32;

/// The same in the first one of a list that begins without skins.
const FIRST: usize = 8;

/// Near pairs that may come on a box: to test them must cost less than to search.
const NEAR_OF_A_BOX: u64 = 16;

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

impl BroadPhase {
    /// Pairs that came and went, into `events`, and keeps them; if near pairs are there, and still good.
    pub(super) fn find_near(&mut self) -> Result<Served, Error> {
        if !self.near.is_on {
            return Ok(Served::No);
        }
        if !self.near.goes_on() {
            self.end_near();
            return Ok(Served::No);
        }
        self.serve_near(LEAVING)
    }

    /// Where few change, a search of all follows that would not have been without the list.
    fn end_near(&mut self) {
        if !self.many_changed() {
            self.near.own.ns += self.rebuild.search_of(self.present_count as usize);
        }
        self.near.end();
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
            self.near.learn(self.present_count);
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
            changed.par_chunks(PIECE).zip(&mut pieces[..]).for_each(look);
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
        let others = Others { records: &self.others, filters: &self.filters, update: Some(self.updates + 1) };
        let found = self.base.map.check_others(&others, &near, &mut self.found, most);
        self.report.stages.check += lap(&mut clock);
        found.is_ok() && self.base.map.out_of_order() * 8 < present
    }

    fn most_near(&self) -> u64 {
        let most = NEAR_OF_A_BOX * u64::from(self.present_count)
            + 2 * self.near.list.overlapping().max(self.pairs.listed()) as u64;
        most.min(u64::from(u32::MAX / 2))
    }

    fn edit_reaches(&mut self) {
        stage!("map");
        let Self { near, boxes, base, others, filters, .. } = self;
        for &id in &near.away {
            near.reach[id as usize] = boxes[id as usize].inflated(near.skin);
        }
        base.map.arrange(&mut near.away, boxes.len());
        let changed =
            Changed { ids: &near.away, boxes: &near.reach, before: &[], filters, update: self.updates + 1 };
        base.map.edit(&changed, others);
    }

    /// Tests the near pairs, but those of boxes that were away.
    fn test_near(&mut self) {
        stage!("check");
        let mut clock = Instant::now();
        let Self { near, boxes, pairs, events, flags, changed, .. } = self;
        let Near { list, away, parted, .. } = near;
        parted.clear();
        if !away.is_empty() {
            list.remove_of(away, |id| flags[id as usize] & flag::AWAY != 0, parted);
            pairs.count_removed(parted);
        }
        let (added, removed) = (&mut events.added, &mut events.removed);
        if changed.len() * LOOKUP < list.len() {
            list.update_few(changed, boxes, added, removed);
        } else {
            list.update(boxes, added, removed);
        }
        pairs.count_added(added);
        pairs.count_removed(removed);
        self.report.stages.check += lap(&mut clock);
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
        self.report.plan = Plan { chosen: Chosen::Near, moved, boxes, ..self.base_plan.clone() };
        // A device that is compared with the CPU is compared with this.
        if self.many_changed() {
            let time = self.report.stages.total();
            self.base.note_time(false, self.boxes.len(), time);
        }
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

    /// Builds the base anew, of reaches, and keeps what overlaps of the pairs that are near; no, when these are too many.
    fn search_near(&mut self, skin: f32) -> Result<Served, Error> {
        let mut clock = Instant::now();
        self.grow_reaches(skin);
        self.near.begin(skin, self.present_count as usize);
        self.report.stages.map += lap(&mut clock);
        if self.find_reaches().is_err() {
            self.near.fail();
            return Ok(Served::No);
        }
        stage!("diff");
        let mut clock = Instant::now();
        self.end_before_list();
        let (before, added) = (Before(state!(self)), &mut self.events.added);
        let (found, boxes, counts) = (&mut self.base.found.chunks, &self.boxes, &mut self.pairs);
        // What is counted is what the list has, whatever pairs a restored snapshot said there were.
        counts.count_none();
        self.near.list.fill(found, boxes, &before, |overlapping| counts.count_added(overlapping), added);
        self.near.is_on = true;
        _ = self.near.list.take_tests();
        self.report.stages.diff += lap(&mut clock);
        self.check_near_limit()
    }

    /// A list that begins with the pairs that exist: each box gets a reach, and what is near it, when it first moves. For a
    /// world in which few boxes do, and the same ones: the base is built anew, but most of a search of all would be for those
    /// that stay.
    fn begin_near(&mut self, skin: f32) -> Result<Served, Error> {
        self.drop_near();
        self.build_reaches(skin);
        let mut clock = Instant::now();
        let Self { near, boxes, changed, pairs, .. } = self;
        // In the base those that stay have a skin, too, for whatever its cells hold; here it is for what has been searched.
        near.reach.clone_from(boxes);
        changed.iter().for_each(|&id| near.reach[id as usize] = Aabb::NOWHERE);
        near.begin(skin, changed.len());
        near.list.begin(|list| pairs.give_all(list));
        near.is_on = true;
        self.report.stages.plan += lap(&mut clock);
        let served = self.serve_near(FIRST);
        self.near.failed = served == Ok(Served::No);
        served
    }

    fn grow_reaches(&mut self, skin: f32) {
        let Self { near, boxes, .. } = self;
        near.reach.clear();
        near.reach.extend(boxes.iter().map(|aabb| aabb.inflated(skin)));
    }

    /// The base of all reaches, which are not searched.
    fn build_reaches(&mut self, skin: f32) {
        self.grow_reaches(skin);
        let summary = LazySummary::new(&self.near.reach, self.base.spare.take());
        let (boxes, filters) = (&self.near.reach[..], Some(&self.filters[..]));
        let set = Set { boxes, filters, summary: &summary, before: &[] };
        self.base_plan = self.base.map.plan_and_build(&set, &self.config, &mut self.report.stages);
        self.base.spare = summary.into_spare();
        self.has_base = false;
    }

    /// Pairs that have ended, wherever they are kept, before a new list has the others.
    fn end_before_list(&mut self) {
        let (state, removed) = (state!(self), &mut self.events.removed);
        if self.near.is_on {
            self.near.list.find_ended(&Staying(state, &self.pairs), removed);
            removed.retain(|pair| self.pairs.is_there(*pair));
            self.pairs.forget_removed();
        } else {
            self.pairs.drop_removed();
            self.pairs.end_many(&state, removed);
            self.pairs.hand_over();
        }
    }

    /// Does without the list, if there is one.
    pub(super) fn drop_near(&mut self) {
        if std::mem::take(&mut self.near.is_on) {
            self.pairs.take_over(self.near.list.iter(), self.near.list.overlapping());
            self.near.list.clear();
        }
    }

    /// Pairs of reaches, into the base.
    fn find_reaches(&mut self) -> Result<(), Error> {
        let accept = Allowed(&self.filters);
        let rule = Rule { accept: &accept, filters: Some(&self.filters), filters_suffice: true, before: &[] };
        let mut config = self.config;
        config.limits.max_pairs = self.most_near();
        let summary = LazySummary::new(&self.near.reach, self.base.spare.take());
        let (invalid, report) = (self.report.invalid, &mut self.report);
        let found = self.base.find_without_gpu(&self.near.reach, &summary, &config, &rule, report);
        self.base.spare = summary.into_spare();
        self.report.invalid = invalid;
        self.has_base = false;
        self.base_plan = self.report.plan.clone();
        found
    }
}

/// Whether filters let two boxes pair.
struct Allowed<'a>(&'a [ProxyFilter]);

impl Accept for Allowed<'_> {
    #[inline(always)]
    fn prepare(&self, ids: [u32; 2]) {
        ids.into_iter().for_each(|id| prefetch(&self.0[id as usize]));
    }

    #[inline]
    fn pair(&self, pair: Pair) -> bool {
        self.0[pair.a as usize].allows(&self.0[pair.b as usize])
    }
}

/// The same of two boxes of which the first is away. Of two that are, it is asked from both sides.
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

/// Pairs that hold, of boxes that were not removed: one set again since is another box.
struct Staying<'a>(State<'a>, &'a PairStore);

impl Judgement for Staying<'_> {
    #[inline(always)]
    fn prepare(&self, pair: Pair) {
        Judgement::prepare(&self.0, pair);
    }

    fn holds(&self, pair: Pair) -> bool {
        self.0.holds(pair) && self.1.is_there(pair)
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
