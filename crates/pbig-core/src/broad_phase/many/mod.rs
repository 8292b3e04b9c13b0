//! Many boxes set at once, on several threads.
//!
//! Each thread takes a range of ids, of all that is kept by id, so that what it writes is its own. In the order of ids
//! memory is read in order, too, whatever the order in which boxes are listed. (To compute boxes first, in the order of the
//! list, and set them one after the other took a fifth more of an update of 100,000 colliders, and 56 bytes for each.)

use super::fat::still_holds;
use super::{BroadPhase, flag};
use crate::cpu::codes::prefetch;
use crate::share::{self, has_threads};
use crate::{Aabb, Error, ProxyFilter, shared_from};
use rayon::prelude::*;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Boxes from which several threads set them: for fewer, waking a second one takes longer.
const PARALLEL_FROM: usize = shared_from(8192);

/// Ids from the lowest to the highest of which one is to be set, for them all to be looked through: eight at a time, as long as
/// it takes to set one that lies apart from others.
const LOOKED_THROUGH: usize = 512;

/// Ids that a thread takes at once.
pub(super) const RANGE: usize = shared_from(4096);

/// Boxes whose memory is asked for together: one by one, a processor would wait for one or two at a time.
const BLOCK: usize = 64;

/// What threads leave to be done about a range of ids.
#[derive(Clone, Debug, Default)]
pub(super) struct Rest {
    /// Boxes that have changed for the first time since the last update.
    changed: Vec<u32>,
    /// Boxes that are new, invalid, or were, or have another filter.
    odd: Vec<Found>,
}

/// A box to be set.
type Found = (u32, Aabb, ProxyFilter);

/// What is kept about a range of ids.
struct Part<'a> {
    first: u32,
    boxes: &'a mut [Aabb],
    flags: &'a mut [u8],
    filters: &'a [ProxyFilter],
    margin: f32,
}

impl BroadPhase {
    /// Sets many boxes, as [`BroadPhase::set`] does one: with the help of the present rayon pool and in no particular order
    /// where they are at least 8192, one in 512 from the lowest id to the highest, and no update has begun.
    ///
    /// `fetch` gets what `of` needs to know about an id, and is called for some ids before `of` is, so that
    /// their memory is waited for together. `of` tells box and filter, or none for a box that is to be left as it is. For an
    /// id that is listed twice both may be called once or twice, and have to say the same. A panic in them goes on to the
    /// caller; then some of the boxes are set.
    ///
    /// ```
    /// use pbig_core::{Aabb, BroadPhase, Config, ProxyFilter};
    /// let centers: Vec<[f32; 3]> = (0..10_000).map(|i| [0.9 * i as f32, 0.0, 0.0]).collect();
    /// let ids: Vec<u32> = (0..10_000).collect();
    /// let mut broad_phase = BroadPhase::new(Config::default())?;
    /// let cube = |center| Some((Aabb::from_center(center, [0.5; 3]), ProxyFilter::ALL));
    /// broad_phase.set_many(&ids, |id| centers[id as usize], cube)?;
    /// assert_eq!(broad_phase.update()?.added.len(), 9_999);
    /// # Ok::<(), pbig_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::TooManyBoxes`]; the other boxes are set.
    pub fn set_many<T: Copy>(
        &mut self,
        ids: &[u32],
        fetch: impl Fn(u32) -> T + Sync,
        of: impl Fn(T) -> Option<(Aabb, ProxyFilter)> + Sync,
    ) -> Result<(), Error> {
        if ids.len() < PARALLEL_FROM || !has_threads() {
            return self.set_each(ids, &fetch, &of);
        }
        let ranges = self.ranges_of(ids);
        if ids.len() * LOOKED_THROUGH < ranges.len() * RANGE {
            return self.set_each(ids, &fetch, &of);
        }
        let new = self.list(ids);
        let mut found = Vec::new();
        let set = catch_unwind(AssertUnwindSafe(|| {
            self.set_ranges(ranges, &fetch, &of);
            let find = |&id: &u32| of(fetch(id)).map(|(aabb, filter)| (id, aabb, filter));
            found.par_extend(new.par_iter().filter_map(find));
        }));
        self.rests.iter_mut().for_each(|rest| self.changed.append(&mut rest.changed));
        if let Err(panic) = set {
            self.flags.iter_mut().for_each(|flags| *flags &= !flag::LISTED);
            self.rests.clear();
            resume_unwind(panic);
        }
        self.set_odd(found)
    }

    /// Marks listed ids; those for which there is no room yet.
    fn list(&mut self, ids: &[u32]) -> Vec<u32> {
        let mut new = Vec::new();
        for &id in ids {
            match self.flags.get_mut(id as usize) {
                Some(flags) => *flags |= flag::LISTED,
                None => new.push(id),
            }
        }
        new
    }

    /// The ranges of ids that there is room for, from that of the lowest of some to that of the highest.
    fn ranges_of(&self, ids: &[u32]) -> Range<usize> {
        let (low, high) = ids.iter().fold((u32::MAX, 0), |(low, high), &id| (id.min(low), id.max(high)));
        let end = self.boxes.len().min((high as usize).saturating_add(1)).div_ceil(RANGE);
        (low as usize / RANGE).min(end)..end
    }

    fn set_ranges<T: Copy>(
        &mut self,
        ranges: Range<usize>,
        fetch: &(impl Fn(u32) -> T + Sync),
        of: &(impl Fn(T) -> Option<(Aabb, ProxyFilter)> + Sync),
    ) {
        let Self { boxes, flags, filters, rests, config, .. } = self;
        rests.resize_with(boxes.len().div_ceil(RANGE), Rest::default);
        let boxes = boxes.chunks_mut(RANGE).zip(flags.chunks_mut(RANGE));
        let by_range = boxes.zip(filters.chunks(RANGE)).enumerate().skip(ranges.start);
        share::for_each(true, by_range.zip(&mut rests[ranges]), |((i, ((boxes, flags), filters)), rest)| {
            let part = Part { first: (i * RANGE) as u32, boxes, flags, filters, margin: config.margin };
            part.set(fetch, of, rest);
        });
    }

    /// What threads have left, and boxes for which there is no room yet; the first error, if there are any.
    fn set_odd(&mut self, new: Vec<Found>) -> Result<(), Error> {
        let mut result = Ok(());
        let mut rests = std::mem::take(&mut self.rests);
        let odd = rests.iter_mut().flat_map(|rest| std::mem::take(&mut rest.odd));
        for (id, aabb, filter) in odd.chain(new) {
            result = result.and(self.set(id, aabb, filter));
        }
        self.rests = rests;
        result
    }

    /// One after the other; the first error, if there are any.
    fn set_each<T: Copy>(
        &mut self,
        ids: &[u32],
        fetch: &impl Fn(u32) -> T,
        of: &impl Fn(T) -> Option<(Aabb, ProxyFilter)>,
    ) -> Result<(), Error> {
        let mut result = Ok(());
        for ids in ids.chunks(BLOCK) {
            let mut block = [None; BLOCK];
            for (fetched, &id) in block.iter_mut().zip(ids) {
                self.ask_for(id);
                *fetched = Some(fetch(id));
            }
            for (fetched, &id) in block.into_iter().flatten().zip(ids) {
                if let Some((aabb, filter)) = of(fetched) {
                    result = result.and(self.set(id, aabb, filter));
                }
            }
        }
        result
    }

    /// Asks for the memory that [`BroadPhase::set`] will read of an id, so that it is not waited for then. Worth it for some
    /// dozens of ids, all asked for before the first is set, that lie apart from each other.
    #[inline(always)]
    pub fn ask_for(&self, id: u32) {
        let i = id as usize;
        if let (Some(aabb), Some(filter)) = (self.boxes.get(i), self.filters.get(i)) {
            prefetch(aabb);
            prefetch(filter);
            prefetch(&self.flags[i]);
        }
    }
}

impl Part<'_> {
    fn set<T: Copy>(
        mut self,
        fetch: &impl Fn(u32) -> T,
        of: &impl Fn(T) -> Option<(Aabb, ProxyFilter)>,
        rest: &mut Rest,
    ) {
        let mut next = next_listed(self.flags, 0);
        while next < self.flags.len() {
            let (mut block, mut count) = ([None; BLOCK], 0);
            while next < self.flags.len() && count < BLOCK {
                prefetch(&self.boxes[next]);
                prefetch(&self.filters[next]);
                block[count] = Some((next, fetch(self.first + next as u32)));
                count += 1;
                next = next_listed(self.flags, next + 1);
            }
            for (i, fetched) in block[..count].iter().flatten() {
                self.flags[*i] &= !flag::LISTED;
                if let Some((aabb, filter)) = of(*fetched) {
                    self.set_one(*i, &aabb, &filter, rest);
                }
            }
        }
    }

    #[inline(always)]
    fn set_one(&mut self, i: usize, aabb: &Aabb, filter: &ProxyFilter, rest: &mut Rest) {
        let id = self.first + i as u32;
        let (stored, flags) = (&mut self.boxes[i], &mut self.flags[i]);
        // Absent boxes are stored as invalid ones are.
        let is_there = !stored.min[0].is_nan();
        if !(is_there && aabb.is_valid() && self.filters[i].is(filter)) {
            return rest.odd.push((id, *aabb, *filter));
        }
        if still_holds(stored, aabb, true, self.margin) {
            return;
        }
        *stored = aabb.inflated(self.margin);
        if *flags & flag::CHANGED == 0 {
            *flags |= flag::CHANGED;
            rest.changed.push(id);
        }
    }
}

/// The first that is listed, from one on; as many as there are if none is. Eight at a time: where one in a hundred is
/// listed, to look at each took longer than to set those.
#[inline(always)]
fn next_listed(flags: &[u8], from: usize) -> usize {
    const ALL: u64 = u64::from_ne_bytes([flag::LISTED; 8]);
    let mut i = from;
    while i < flags.len() {
        if flags[i] & flag::LISTED != 0 {
            return i;
        }
        i += 1;
        while let Some(eight) = flags[i..].first_chunk::<8>()
            && u64::from_ne_bytes(*eight) & ALL == 0
        {
            i += 8;
        }
    }
    i
}

#[cfg(test)]
mod tests;
