//! Many boxes set at once, on several threads.
//!
//! Each thread takes a range of ids, of all that is kept by id, so that what it writes is its own. In the order of ids
//! memory is read in order, too, whatever the order in which boxes are listed. (To compute boxes first, in the order of the
//! list, and set them one after the other took a fifth more of an update of 100,000 colliders, and 56 bytes for each.)

use super::{BroadPhase, flag, still_holds};
use crate::{Aabb, Error, ProxyFilter};
use rayon::prelude::*;

/// Boxes from which several threads set them: for fewer, waking a second one takes longer.
const PARALLEL_FROM: usize = 8192;

/// Ids that a thread takes at once.
const RANGE: usize = 4096;

/// Boxes whose memory is asked for together: one by one, a processor would wait for one or two at a time.
const BLOCK: usize = 64;

/// What is left to be done about a range of ids.
#[derive(Clone, Debug, Default)]
pub(super) struct Left {
    /// Boxes that have changed for the first time since the last update.
    changed: Vec<u32>,
    /// Boxes that are new, invalid, or were, or have another filter.
    odd: Vec<u32>,
}

/// What is kept about a range of ids.
struct Range<'a> {
    first: u32,
    boxes: &'a mut [Aabb],
    flags: &'a mut [u8],
    filters: &'a [ProxyFilter],
    margin: f32,
}

impl BroadPhase {
    /// As [`BroadPhase::set`] of each of `ids`, in any order, on several threads: `of` tells box and filter from what
    /// `fetch` has got for an id, and nothing of a box that is to be left alone. `fetch` is called for some ids before
    /// `of` is, so that their memory is waited for together; for a few ids both are called twice.
    ///
    /// ```
    /// use pbig_core::{Aabb, BroadPhase, Config, ProxyFilter};
    /// let centers = [[0.0; 3], [0.5, 0.0, 0.0], [9.0, 0.0, 0.0]];
    /// let mut broad_phase = BroadPhase::new(Config::default())?;
    /// let cube = |center: &[f32; 3]| Some((Aabb::from_center(*center, [0.5; 3]), ProxyFilter::ALL));
    /// broad_phase.set_many(&[0, 1, 2], |id| &centers[id as usize], cube)?;
    /// assert_eq!(broad_phase.update()?.added.len(), 1);
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
        if self.has_begun() || ids.len() < PARALLEL_FROM || rayon::current_num_threads() == 1 {
            return self.set_each(ids, &fetch, &of);
        }
        let mut left = std::mem::take(&mut self.left);
        let new = self.list(ids);
        left.resize_with(self.boxes.len().div_ceil(RANGE), Left::default);
        self.ranges().zip(&mut left).for_each(|(range, left)| range.set(&fetch, &of, left));
        for Left { changed, .. } in &mut left {
            self.changed.append(changed);
        }
        let mut result = self.set_each(&new, &fetch, &of);
        for Left { odd, .. } in &mut left {
            result = result.and(self.set_each(odd, &fetch, &of));
            odd.clear();
        }
        self.left = left;
        result
    }

    /// Marks listed ids; those that are not known yet.
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

    fn ranges(&mut self) -> impl IndexedParallelIterator<Item = Range<'_>> {
        let margin = self.config.margin;
        let filters = self.filters.par_chunks(RANGE);
        let parts = self.boxes.par_chunks_mut(RANGE).zip(self.flags.par_chunks_mut(RANGE)).zip(filters);
        parts.enumerate().map(move |(i, ((boxes, flags), filters))| Range {
            first: (i * RANGE) as u32,
            boxes,
            flags,
            filters,
            margin,
        })
    }

    /// One after the other; the first error, if there are any.
    fn set_each<T>(
        &mut self,
        ids: &[u32],
        fetch: &impl Fn(u32) -> T,
        of: &impl Fn(T) -> Option<(Aabb, ProxyFilter)>,
    ) -> Result<(), Error> {
        let set = |&id: &u32| of(fetch(id)).map_or(Ok(()), |(aabb, filter)| self.set(id, aabb, filter));
        ids.iter().map(set).fold(Ok(()), Result::and)
    }
}

impl Range<'_> {
    fn set<T: Copy>(
        mut self,
        fetch: &impl Fn(u32) -> T,
        of: &impl Fn(T) -> Option<(Aabb, ProxyFilter)>,
        left: &mut Left,
    ) {
        let mut next = next_listed(self.flags, 0);
        while next < self.flags.len() {
            let (mut block, mut count) = ([None; BLOCK], 0);
            while next < self.flags.len() && count < BLOCK {
                block[count] = Some((next, fetch(self.first + next as u32)));
                count += 1;
                next = next_listed(self.flags, next + 1);
            }
            for (i, fetched) in block[..count].iter().flatten() {
                self.flags[*i] &= !flag::LISTED;
                if let Some((aabb, filter)) = of(*fetched) {
                    self.set_one(*i, &aabb, &filter, left);
                }
            }
        }
    }

    #[inline(always)]
    fn set_one(&mut self, i: usize, aabb: &Aabb, filter: &ProxyFilter, left: &mut Left) {
        let id = self.first + i as u32;
        let (stored, flags) = (&mut self.boxes[i], &mut self.flags[i]);
        let is_there = *flags & flag::PRESENT != 0 && !stored.min[0].is_nan();
        if !(is_there && aabb.is_valid() && self.filters[i].is(filter)) {
            return left.odd.push(id);
        }
        if still_holds(stored, aabb, true, self.margin) {
            return;
        }
        *stored = aabb.inflated(self.margin);
        if *flags & flag::CHANGED == 0 {
            *flags |= flag::CHANGED;
            left.changed.push(id);
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
mod tests {
    use super::*;
    use crate::Config;
    use rand::rngs::StdRng;
    use rand::{Rng, RngExt, SeedableRng};

    const IDS: u32 = 20_000;

    /// A box somewhere in a cube that has room for them; some invalid, some of another filter, some not at all.
    fn anything(rng: &mut impl Rng) -> Option<(Aabb, ProxyFilter)> {
        let center = std::array::from_fn(|_| rng.random_range(0.0..20.0));
        let aabb = Aabb::from_center(center, [0.5; 3]);
        match rng.random_range(0..40) {
            0 => None,
            1 => Some((Aabb::NOWHERE, ProxyFilter::ALL)),
            2 => Some((aabb, ProxyFilter { mask: 1, ..ProxyFilter::ALL })),
            _ => Some((aabb, ProxyFilter::ALL)),
        }
    }

    fn sorted(ids: impl Iterator<Item = u32>) -> Vec<u32> {
        let mut ids: Vec<u32> = ids.collect();
        ids.sort_unstable();
        ids
    }

    #[test]
    fn many_at_once_are_set_as_one_after_the_other() {
        let mut rng = StdRng::seed_from_u64(5);
        let new = || BroadPhase::new(Config { margin: 0.1, ..Config::DEFAULT }).expect("a margin");
        let (mut many, mut each) = (new(), new());
        let mut boxes: Vec<_> = (0..IDS).map(|_| anything(&mut rng)).collect();
        for update in 0..12 {
            // The first time all are new; later some are, and some are listed twice.
            let ids: Vec<u32> = (0..IDS).map(|_| rng.random_range(0..IDS)).collect();
            let share = rng.random_range(0.0..1.0);
            for &id in &ids {
                if rng.random_bool(share) {
                    boxes[id as usize] = anything(&mut rng);
                }
            }
            if update == 7 {
                (many.begin(), each.begin());
            }
            many.set_many(&ids, |id| id, |id| boxes[id as usize]).expect("few ids");
            for &id in &ids {
                if let Some((aabb, filter)) = boxes[id as usize] {
                    each.set(id, aabb, filter).expect("a small id");
                }
            }
            for _ in 0..50 {
                let id = rng.random_range(0..IDS);
                assert_eq!(many.remove(id), each.remove(id));
            }
            assert_eq!(sorted(many.changes()), sorted(each.changes()), "update {update}");
            assert_eq!(
                many.update().expect("few pairs"),
                each.update().expect("few pairs"),
                "update {update}"
            );
            assert!(many.flags.iter().all(|flags| flags & flag::LISTED == 0));
            assert_eq!((many.present_count, many.invalid_count), (each.present_count, each.invalid_count));
        }
        assert!(many.pair_count() > 1000, "{}", many.pair_count());
    }

    #[test]
    fn ids_beyond_the_limit_are_an_error_and_the_others_are_set() {
        let limits = crate::Limits { max_boxes: 9000, ..crate::Limits::DEFAULT };
        let mut broad_phase = BroadPhase::new(Config { limits, ..Config::DEFAULT }).expect("a margin");
        let ids: Vec<u32> = (0..9100).rev().collect();
        let cube = |id: u32| Some((Aabb::from_center([id as f32, 0.0, 0.0], [0.4; 3]), ProxyFilter::ALL));
        assert!(matches!(broad_phase.set_many(&ids, |id| id, cube), Err(Error::TooManyBoxes { .. })));
        assert_eq!(broad_phase.id_count(), 9000);
        assert!((0..9000).all(|id| broad_phase.contains(id)));
    }

    #[test]
    fn the_next_listed_is_found_from_any_place() {
        for count in 0..40 {
            for listed in 0..=count {
                let mut flags = vec![!flag::LISTED; count];
                flags[listed..].iter_mut().step_by(9).for_each(|flags| *flags |= flag::LISTED);
                for from in 0..count {
                    let wanted = (from..count).find(|&i| flags[i] & flag::LISTED != 0).unwrap_or(count);
                    assert_eq!(next_listed(&flags, from), wanted, "{count} flags, {listed}, from {from}");
                }
            }
        }
    }
}
