//! When there is a list of near pairs.

use super::worth::Cause;
use super::{FIRST, Served};
use crate::broad_phase::{BroadPhase, flag};
use crate::plan::NoNear;
use crate::{Error, Updates};

/// Of how many boxes one has to change for a list: where it is always the same ones, and else. A list for fewer takes less in
/// most updates, and as much as a search of all in the one that makes it: with 1% of a million boxes, other ones each time, the
/// median fell from 13.3 ms to 5.7, and the mean rose from 12.9 ms to 22.6.
const FEWEST: [usize; 2] = [128, 16];

/// Of how many boxes one has to have changed in updates without a list, for those to have cost about as much as one.
const PATIENCE: usize = 8;

/// Of how many boxes one may have changed for it to be remembered which.
const REMEMBERED: usize = 4;

/// Movers that are asked whether they have moved before.
const SAMPLE: usize = 256;

/// Which boxes have changed not long ago: those with [`flag::MOVED`].
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::broad_phase) struct Movers {
    /// How many have changed since all were forgotten.
    count: usize,
}

impl Movers {
    /// For an update in which so many have changed, which are to be marked.
    pub(in crate::broad_phase) fn begin(&mut self, changed: usize, flags: &mut [u8]) {
        self.count += changed;
        if self.count * REMEMBERED > flags.len() {
            self.count = changed;
            flags.iter_mut().for_each(|flags| *flags &= !flag::MOVED);
        }
    }

    /// Whether most of some boxes are among them, as far as samples show.
    pub(super) fn are_most_of(ids: &[u32], flags: &[u8]) -> bool {
        let step = ids.len().div_ceil(SAMPLE).max(1);
        let has_moved = |id: &&u32| flags[**id as usize] & flag::MOVED != 0;
        2 * ids.iter().step_by(step).filter(has_moved).count() > ids.len().div_ceil(step)
    }
}

impl BroadPhase {
    /// A new list, if there should be one, and what it comes to.
    pub(in crate::broad_phase) fn try_near(&mut self) -> Result<Served, Error> {
        self.near.none = None;
        if !self.may_edit() || !(self.must_have_list() || self.enough_changed()) {
            return Ok(Served::No);
        }
        match self.skin() {
            Ok(width) if self.changed.len() * FIRST <= self.present_count as usize && self.are_the_same() => {
                self.begin_near(width)
            }
            Ok(width) => self.search_near(width),
            Err(why) => {
                self.near.none = Some(why);
                Ok(Served::No)
            }
        }
    }

    /// Whether there is to be a list whatever it costs.
    pub(super) fn must_have_list(&self) -> bool {
        self.config.study.updates == Updates::Near
    }

    /// Whether so many change that a list may pay: a quarter, or fewer for some time already. For a few of them an update
    /// costs next to nothing anyway; and if it is other boxes each time, a list has to have all that is near.
    fn enough_changed(&self) -> bool {
        let (changed, present) = (self.changed.len(), self.present_count as usize);
        let is_due = || changed * FEWEST[0] >= present && self.near.worth.without * PATIENCE >= present;
        self.many_changed() || (is_due() && (changed * FEWEST[1] >= present || self.are_the_same()))
    }

    /// Whether most of the boxes that change have done so not long ago.
    fn are_the_same(&self) -> bool {
        Movers::are_most_of(&self.changed, &self.flags)
    }

    /// How wide the skin of a list would be that is made now; or why there is to be none.
    fn skin(&mut self) -> Result<f32, NoNear> {
        if let Some(why) = self.why_without() {
            return Err(why);
        }
        let width = self.next_width().ok_or(NoNear::Unknown)?;
        // Filters may turn down most of what is near: a search would look at all that, and find little.
        if self.near_to_come(width) > self.most_near() as f64 { Err(self.too_many()) } else { Ok(width) }
    }

    /// Too many pairs are near: the next attempt comes later, but where a list is asked for.
    pub(super) fn too_many(&mut self) -> NoNear {
        if self.must_have_list() {
            return NoNear::Many(0);
        }
        self.near.worth.wait(Cause::Many, 0);
        self.near.worth.told()
    }

    /// Why this update goes without a list, whatever it would be like.
    fn why_without(&mut self) -> Option<NoNear> {
        match self.config.study.updates {
            Updates::Auto => self.near.worth.goes_without(),
            Updates::Near => None,
            Updates::Edits | Updates::Anew => Some(NoNear::Unwanted),
        }
    }
}
