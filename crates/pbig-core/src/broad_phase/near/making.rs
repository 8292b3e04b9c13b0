//! How a list of near pairs is made, and what becomes of the kept pairs meanwhile.

use super::{Before, FIRST, Served};
use crate::broad_phase::BroadPhase;
use crate::broad_phase::update::state;
use crate::cpu::codes::prefetch;
use crate::cpu::crowding::Set;
use crate::cpu::judge::Accept;
use crate::plan::LazySummary;
use crate::report::{lap, stage};
use crate::search::Rule;
use crate::{Aabb, Error, Pair, ProxyFilter};
use std::time::Instant;

impl BroadPhase {
    /// Builds the base anew, of reaches, and keeps what overlaps of the pairs that are near; no, when these are too many.
    pub(super) fn search_near(&mut self, skin: f32) -> Result<Served, Error> {
        let mut clock = Instant::now();
        self.drop_near();
        self.grow_reaches(skin);
        self.near.begin(skin, self.present_count as usize);
        self.report.stages.map += lap(&mut clock);
        if self.find_reaches().is_err() {
            self.near.list.clear();
            self.near.worth.failed = true;
            self.near.none = Some(self.too_many());
            return Ok(Served::No);
        }
        stage!("diff");
        let mut clock = Instant::now();
        self.end_kept();
        let (before, added) = (Before(state!(self)), &mut self.events.added);
        let (boxes, counts) = (&self.boxes, &mut self.pairs);
        // What is counted is what the list has, whatever pairs a restored snapshot said there were.
        counts.count_none();
        self.near.list.begin_all(boxes, &before, |overlapping| counts.count_added(overlapping), added);
        self.near.is_on = true;
        _ = self.near.list.take_tests();
        self.report.plan.near = Some(self.near.plan());
        self.report.stages.diff += lap(&mut clock);
        self.check_near_limit()
    }

    /// A list that begins with the pairs that exist: each box gets a reach, and what is near it, when it first moves. For a
    /// world in which few boxes do, and the same ones: the base is built anew, but most of a search of all would be for those
    /// that stay.
    pub(super) fn begin_near(&mut self, skin: f32) -> Result<Served, Error> {
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
        match served {
            Ok(Served::Yes) => self.index_near(),
            Ok(Served::No) => {
                self.near.worth.failed = true;
                self.near.none = Some(self.near.worth.told());
            }
            Err(_) => {}
        }
        served
    }

    /// An index from the first, if it will be of use: its time is part of what the list is to pay for.
    fn index_near(&mut self) {
        let mut clock = Instant::now();
        if self.looks_up() {
            self.near.list.make_index(self.boxes.len());
        }
        self.report.stages.check += lap(&mut clock);
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

    /// Kept pairs that have ended, before a new list has the others.
    fn end_kept(&mut self) {
        self.pairs.drop_removed();
        self.pairs.end_many(&state!(self), &mut self.events.removed);
        self.pairs.hand_over();
    }

    /// Does without the list, if there is one.
    pub(in crate::broad_phase) fn drop_near(&mut self) {
        if std::mem::take(&mut self.near.is_on) {
            self.pairs.take_over(self.near.list.iter(), self.near.list.overlapping());
            self.near.list.clear();
        }
    }

    /// Pairs of reaches, into the list.
    fn find_reaches(&mut self) -> Result<(), Error> {
        let accept = Allowed(&self.filters);
        let rule = Rule { accept: &accept, filters: Some(&self.filters), before: &[] };
        let mut config = self.config;
        config.limits.max_pairs = self.most_near();
        let summary = LazySummary::new(&self.near.reach, self.base.spare.take());
        let (invalid, report) = (self.report.invalid, &mut self.report);
        let found = self.base.find_into(
            Some(self.near.list.all()),
            &self.near.reach,
            &summary,
            &config,
            &rule,
            report,
        );
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
