//! Crowds: what to do where many boxes share few cells. Smaller cells, where those part them; grids without a search of
//! their own for boxes that may not pair with each other ([`Camps`]), where those do not.

use super::calibrate;
use super::map::Map;
use super::record::Record;
use crate::plan::{Camps, Chosen, Costs, LazySummary, Plan, Summary, Way, spread_evenly};
use crate::report::{StageTimes, lap, stage};
use crate::{Aabb, Config, Grids, ProxyFilter};
use std::time::Instant;

/// The boxes to search, and all that is known about them.
#[derive(Clone, Copy)]
pub(crate) struct Set<'a> {
    pub(crate) boxes: &'a [Aabb],
    /// By id, where the caller has filters.
    pub(crate) filters: Option<&'a [ProxyFilter]>,
    pub(crate) summary: &'a LazySummary<'a>,
    /// By id: what a box was at the last update, where only changes count.
    pub(crate) before: &'a [Aabb],
}

impl<'a> Set<'a> {
    /// The camps among the boxes, as far as a sample shows them.
    fn camps(&self) -> Camps {
        let Some(filters) = self.filters else { return Camps::default() };
        let sample = spread_evenly(self.boxes.len(), SAMPLE);
        let valid = sample.filter(|&id| self.boxes[id].is_valid());
        Camps::of(valid.map(|id| &filters[id]), self.boxes.len().div_ceil(SAMPLE) as u32)
    }
}

/// Filters that are looked at for camps, 0.1 ms: a camp of which these have few is too small to matter.
const SAMPLE: usize = 2048;

/// Cells smaller than an even spread of boxes would ask for, where clusters make them too full.
/// Kept from one build to the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crowding {
    /// Factor on the cell size.
    factor: f32,
    /// How full cells are where smaller ones did not help: identical boxes, say.
    accepted: f32,
    /// Boxes of several sizes get levels: cells that hold the largest were too full.
    apart: bool,
}

/// A plan, kept from one build to the next.
#[derive(Clone, Debug)]
pub(super) struct Kept {
    plan: Plan,
    config: Config,
    /// How full the fullest level was.
    crowd: f32,
    /// How often it has been used again.
    builds: u32,
}

impl Kept {
    /// Builds after which another plan is made: boxes may have spread, or shrunk.
    const LONGEST: u32 = 64;

    fn suits(&self, set: &Set<'_>, config: &Config) -> bool {
        let (planned, boxes) = (u64::from(self.plan.boxes), set.boxes.len() as u64);
        self.builds < Self::LONGEST
            && matches!(self.plan.chosen, Chosen::Grid | Chosen::Brute)
            && self.config == *config
            && planned <= 2 * boxes
            && boxes <= 2 * planned
    }
}

/// Other entries in a box's cell, on average over boxes, at which smaller cells are tried. An even
/// spread has half a one. Doubling a cell gathers eight times as many boxes, so that cells grow
/// again only when they are certain to stay below: the choice does not flap.
const CROWDED: f32 = 12.0;

/// The same where no smaller cells can be had: one grid may have been planned although its cells get fuller. Then it is from
/// [`UNEVEN`] times as many on. (Edges that differ 1000 times, at 10 pairs a box: levels, which the plan had found dearer, took
/// 1.26 times as long.)
fn crowded(plan: &Plan) -> f32 {
    match &plan.levels[..] {
        [level] if !divisible(plan) => CROWDED.max(UNEVEN * level.crowd),
        _ => CROWDED,
    }
}

/// How much fuller than expected cells may be before a plan was wrong to count on no more. Expectations are of an even
/// spread over a range that is wider than the boxes' (`Summary::range`): 1.5 times as full where it is even, 1.9 in a Gaussian
/// cloud.
const UNEVEN: f32 = 2.5;

/// Other entries in a box's cell at which camps pay: testing half of 48 boxes that overlap takes as long as searching
/// another grid.
const MOBBED: f32 = 4.0 * CROWDED;

/// Where dividing the cells ends.
const FINEST: f32 = 1e-12;

impl Default for Crowding {
    fn default() -> Self {
        Self { factor: 1.0, accepted: 0.0, apart: false }
    }
}

impl<R: Record> Map<R> {
    /// Plans and sorts; again with smaller cells where clusters make them too full, and by camps where that does not
    /// help.
    pub(crate) fn plan_and_build(&mut self, set: &Set<'_>, config: &Config, times: &mut StageTimes) -> Plan {
        self.look = config.study.look;
        if self.has_camps() {
            self.settle_camps(set, times);
        }
        if let Some(plan) = self.build_as_before(set, config, times) {
            return plan;
        }
        let plan = self.build_uncrowded(set, config, times);
        self.keep(&plan, config);
        if self.has_camps() || !self.settle_camps(set, times) {
            return plan;
        }
        self.build_uncrowded(set, config, times)
    }

    /// Sorts as planned for an earlier set, if that still suits: a plan costs a look at every box, as much as a tenth of
    /// an update, and worlds change little from step to step.
    fn build_as_before(&mut self, set: &Set<'_>, config: &Config, times: &mut StageTimes) -> Option<Plan> {
        let kept = self.kept.take().filter(|kept| kept.suits(set, config) && !self.has_camps())?;
        let mut clock = Instant::now();
        stage!("map");
        let fits = self.build(&kept.plan, set, kept.plan.swept);
        times.map += lap(&mut clock);
        let crowd = self.crowd();
        if !fits || crowd > crowded(&kept.plan).min(1.5 * kept.crowd + 1.0) {
            return None;
        }
        let boxes = set.boxes.len() as u32 - self.invalid;
        let plan = Plan { boxes, ..kept.plan.clone() };
        self.kept = Some(Kept { builds: kept.builds + 1, ..kept });
        Some(plan)
    }

    /// Not where cells are too full, or smaller than need be: another plan may do better then.
    fn keep(&mut self, plan: &Plan, config: &Config) {
        let crowd = self.crowd();
        let settled = self.crowding.factor == 1.0 || !self.crowding.may_grow(crowd);
        let good = crowd <= crowded(plan).min(MOBBED) && settled && !self.has_camps();
        self.kept = good.then(|| Kept { plan: plan.clone(), config: *config, crowd, builds: 0 });
    }

    /// Divides the boxes into camps where they crowd, and as long as they do; true when there are some.
    fn settle_camps(&mut self, set: &Set<'_>, times: &mut StageTimes) -> bool {
        let mut clock = Instant::now();
        let had = self.has_camps();
        // Of a crowd each camp has a part.
        let crowd: f32 = self.levels.iter().map(|level| level.crowd).sum();
        let crowded = crowd > if had { MOBBED / 2.0 } else { MOBBED };
        self.camps = if crowded { set.camps() } else { Camps::default() };
        if self.has_camps() != had {
            self.crowding = Crowding::default();
            // Made for other camps.
            self.kept = None;
            self.camp_of.clear();
        }
        times.plan += lap(&mut clock);
        self.has_camps()
    }

    /// Plans and sorts, again with smaller cells where they are too full.
    fn build_uncrowded(&mut self, set: &Set<'_>, config: &Config, times: &mut StageTimes) -> Plan {
        let mut tried = std::mem::take(&mut self.tried);
        tried.clear();
        let plan = self.build_trying(set, config, times, &mut tried);
        self.tried = tried;
        plan
    }

    /// `tried` gathers factors and the crowds that they led to.
    fn build_trying(
        &mut self,
        set: &Set<'_>,
        config: &Config,
        times: &mut StageTimes,
        tried: &mut Vec<(f32, f32)>,
    ) -> Plan {
        let mut build = |map: &mut Self| {
            let mut clock = Instant::now();
            let plan = {
                stage!("plan");
                map.plan(set, config)
            };
            times.plan += lap(&mut clock);
            stage!("map");
            map.build(&plan, set, u32::MAX);
            times.map += lap(&mut clock);
            plan
        };
        loop {
            let plan = build(self);
            let crowd = self.crowd();
            tried.push((self.crowding.factor, crowd));
            let limit = crowded(&plan).max(1.5 * self.crowding.accepted);
            let is_free = config.study.grids == Grids::Auto;
            if crowd > limit && !self.crowding.apart && is_free && plan.could_have_levels() {
                self.crowding.apart = true;
                continue;
            }
            if crowd > limit && divisible(&plan) && self.crowding.factor > FINEST {
                // The first halvings of two far clusters change nothing: take larger steps then.
                let helps = tried.len() < 2 || crowd < 0.8 * tried[tried.len() - 2].1;
                self.crowding.factor *= if helps { 0.5 } else { 0.125 };
                continue;
            }
            if self.crowding.settle(tried, crowded(&plan)) {
                return build(self);
            }
            return plan;
        }
    }

    /// One plan for all boxes, or one for each camp, put together.
    fn plan(&mut self, set: &Set<'_>, config: &Config) -> Plan {
        let factor = self.crowding.factor;
        self.camp_of.clear();
        let (Some(filters), true) = (set.filters, self.has_camps()) else {
            return self.plan_by_costs(set.summary.get(), config);
        };
        let camps = &self.camps;
        self.camp_of.extend(filters.iter().map(|filter| camps.camp(filter)));
        let members = |camp: u8| -> Vec<u32> {
            let of_camp = (0..).zip(&self.camp_of).filter(|(_, of)| **of == camp);
            of_camp.map(|(id, _)| id).collect()
        };
        let summary = |camp: usize| Summary::of(set.boxes, Some(&members(camp as u8)));
        let summaries: Vec<Summary> = (0..camps.count()).map(summary).collect();
        Plan::of_camps(&summaries, config, factor, &config.costs.unwrap_or(Costs::REFERENCE))
    }

    /// By given costs; else by those of the reference, or where that is too close to call by this machine's.
    fn plan_by_costs(&mut self, summary: &Summary, config: &Config) -> Plan {
        let Crowding { factor, apart, .. } = self.crowding;
        let only = apart.then_some(Way::Levels);
        let by = |costs: &Costs| Plan::by(summary, config, factor, only, costs, &self.experience);
        let plan = by(&config.costs.unwrap_or(Costs::REFERENCE));
        let measure = config.costs.is_none() && plan.forecast().is_close();
        let plan = if measure { by(calibrate::measured()) } else { plan };
        plan.plan_in(&mut self.kept_levels)
    }

    /// How full the fullest level is.
    fn crowd(&self) -> f32 {
        self.levels.iter().map(|level| level.crowd).fold(0.0, f32::max)
    }

    pub(super) fn has_camps(&self) -> bool {
        !self.camps.is_empty()
    }
}

/// Whether smaller cells would still hold the largest box of a level.
fn divisible(plan: &Plan) -> bool {
    plan.levels.iter().any(|level| (0..3).any(|k| level.cell[k] > 1.5 * level.max_extent[k]))
}

impl Crowding {
    /// Whether cells of twice the size would still not be too full.
    fn may_grow(&self, crowd: f32) -> bool {
        8.0 * (crowd + 1.0) <= CROWDED
    }

    /// Settles on one of the factors tried in a call, with the crowd that each led to, for the calls
    /// to come; true when it is not the last one, so that the map has to be built again.
    fn settle(&mut self, tried: &[(f32, f32)], crowded: f32) -> bool {
        let last = tried.len() - 1;
        let least = tried.iter().map(|t| t.1).fold(f32::INFINITY, f32::min);
        if tried[last].1 <= crowded {
            self.accepted = 0.0;
            if self.may_grow(least) {
                // First larger cells, then perhaps one grid again.
                self.apart &= self.factor < 1.0;
                self.factor = (self.factor * 2.0).min(1.0);
            }
            return false;
        }
        // Smaller cells that are as full are of no use: the largest that are no fuller.
        let best = tried.iter().position(|t| t.1 <= 1.1 * least).unwrap_or(last);
        (self.factor, self.accepted) = tried[best];
        best != last
    }
}

#[cfg(test)]
mod tests;
