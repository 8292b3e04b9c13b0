//! Many boxes set at once, on several threads.
//!
//! Each thread takes a range of ids, of all that is kept by id, so that what it writes is its own. In the order of ids
//! memory is read in order, too, whatever the order in which boxes are listed. (To compute boxes first, in the order of the
//! list, and set them one after the other took a fifth more of an update of 100,000 colliders, and 56 bytes for each.)

use super::fat::still_holds;
use super::{BroadPhase, flag};
use crate::cpu::codes::prefetch;
use crate::{Aabb, Error, ProxyFilter};
use rayon::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Boxes from which several threads set them: for fewer, waking a second one takes longer.
const PARALLEL_FROM: usize = 8192;

/// Ids of which one is to be set, for them all to be looked through: eight at a time, as long as it takes to set one.
const LOOKED_THROUGH: usize = 64;

/// Ids that a thread takes at once.
const RANGE: usize = 4096;

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
struct Range<'a> {
    first: u32,
    boxes: &'a mut [Aabb],
    flags: &'a mut [u8],
    filters: &'a [ProxyFilter],
    margin: f32,
}

impl BroadPhase {
    /// Sets many boxes, as [`BroadPhase::set`] does one: with the threads of the present rayon pool and in no particular order
    /// where they are at least 8192, one in 64 of all, and no update has begun.
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
        let few = ids.len() < PARALLEL_FROM || ids.len() * LOOKED_THROUGH < self.boxes.len();
        if few || self.has_begun() || rayon::current_num_threads() == 1 {
            return self.set_each(ids, &fetch, &of);
        }
        let new = self.list(ids);
        let mut found = Vec::new();
        let set = catch_unwind(AssertUnwindSafe(|| {
            self.set_ranges(&fetch, &of);
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

    fn set_ranges<T: Copy>(
        &mut self,
        fetch: &(impl Fn(u32) -> T + Sync),
        of: &(impl Fn(T) -> Option<(Aabb, ProxyFilter)> + Sync),
    ) {
        let Self { boxes, flags, filters, rests, config, .. } = self;
        rests.resize_with(boxes.len().div_ceil(RANGE), Rest::default);
        let boxes = boxes.par_chunks_mut(RANGE).zip(flags.par_chunks_mut(RANGE));
        let ranges = boxes.zip(filters.par_chunks(RANGE)).zip(rests).enumerate();
        ranges.for_each(|(i, (((boxes, flags), filters), rest))| {
            let range = Range { first: (i * RANGE) as u32, boxes, flags, filters, margin: config.margin };
            range.set(fetch, of, rest);
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
                self.ask_for(id as usize);
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

    /// Asks for what is kept about a box.
    #[inline(always)]
    fn ask_for(&self, i: usize) {
        if let (Some(aabb), Some(filter)) = (self.boxes.get(i), self.filters.get(i)) {
            prefetch(aabb);
            prefetch(filter);
            prefetch(&self.flags[i]);
        }
    }
}

impl Range<'_> {
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
        let is_there = *flags & flag::PRESENT != 0 && !stored.min[0].is_nan();
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
mod tests {
    use super::*;
    use crate::{Config, Limits};
    use rand::rngs::StdRng;
    use rand::{Rng, RngExt, SeedableRng};

    const IDS: u32 = 20_000;

    type Box = Option<(Aabb, ProxyFilter)>;

    /// On so many threads, however many there are.
    fn on<R: Send>(threads: usize, test: impl FnOnce() -> R + Send) -> R {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(test)
    }

    fn new() -> BroadPhase {
        BroadPhase::new(Config { margin: 0.1, ..Config::DEFAULT }).expect("a margin")
    }

    /// A box somewhere in a cube that has room for them; some invalid or infinite, some of another filter, some not at all.
    fn anything(rng: &mut impl Rng) -> Box {
        let center = std::array::from_fn(|_| rng.random_range(0.0..20.0));
        let aabb = Aabb::from_center(center, [0.5; 3]);
        match rng.random_range(0..4000) {
            0..100 => None,
            100..200 => Some((Aabb::NOWHERE, ProxyFilter::ALL)),
            200..300 => Some((aabb, ProxyFilter { mask: 1, ..ProxyFilter::ALL })),
            300 => Some((Aabb { min: [f32::NEG_INFINITY; 3], ..aabb }, ProxyFilter::ALL)),
            _ => Some((aabb, ProxyFilter::ALL)),
        }
    }

    fn sorted(ids: impl Iterator<Item = u32>) -> Vec<u32> {
        let mut ids: Vec<u32> = ids.collect();
        ids.sort_unstable();
        ids
    }

    /// Two that are told the same, one of them many boxes at once.
    struct Both {
        many: BroadPhase,
        each: BroadPhase,
        boxes: Vec<Box>,
        rng: StdRng,
    }

    impl Both {
        /// New places for some of the listed boxes. New ones are among them at first, and some are listed twice.
        fn set(&mut self) {
            let Self { many, each, boxes, rng } = self;
            let ids: Vec<u32> = (0..IDS).map(|_| rng.random_range(0..IDS)).collect();
            let share = rng.random_range(0.0..1.0);
            for &id in &ids {
                if rng.random_bool(share) {
                    boxes[id as usize] = anything(rng);
                }
            }
            many.set_many(&ids, |id| id, |id| boxes[id as usize]).expect("few ids");
            for &id in &ids {
                if let Some((aabb, filter)) = boxes[id as usize] {
                    each.set(id, aabb, filter).expect("a small id");
                }
            }
        }

        fn remove_some(&mut self) {
            for _ in 0..50 {
                let id = self.rng.random_range(0..IDS);
                assert_eq!(self.many.remove(id), self.each.remove(id));
            }
        }

        fn compare(&mut self, update: u32) {
            let Self { many, each, .. } = self;
            assert_eq!(sorted(many.changes()), sorted(each.changes()), "update {update}");
            assert_eq!(
                many.update().expect("few pairs"),
                each.update().expect("few pairs"),
                "update {update}"
            );
            assert!(many.flags.iter().all(|flags| flags & flag::LISTED == 0));
            assert_eq!((many.present_count, many.invalid_count), (each.present_count, each.invalid_count));
        }
    }

    #[test]
    fn many_at_once_are_set_as_one_after_the_other() {
        let (many, each, rng) = (new(), new(), StdRng::seed_from_u64(5));
        let mut both = Both { many, each, boxes: vec![None; IDS as usize], rng };
        on(2, || {
            for update in 0..14 {
                both.remove_some();
                // In one update twice, and with another margin; in another while one has begun.
                for _ in 0..=update % 3 {
                    both.set();
                    let margin = if update == 5 { 0.3 } else { 0.1 };
                    for of in [&mut both.many, &mut both.each] {
                        of.set_margin(margin).expect("a margin");
                    }
                }
                if update == 7 {
                    both.many.begin();
                    both.each.begin();
                    both.set();
                }
                both.remove_some();
                both.compare(update);
            }
        });
        assert!(both.many.pair_count() > 1000, "{}", both.many.pair_count());
    }

    #[test]
    fn ids_beyond_the_limit_are_an_error_and_the_others_are_set() {
        let limits = Limits { max_boxes: 9000, ..Limits::DEFAULT };
        let mut broad_phase = BroadPhase::new(Config { limits, ..Config::DEFAULT }).expect("a margin");
        let ids: Vec<u32> = (0..9100).rev().collect();
        let cube = |id: u32| Some((Aabb::from_center([id as f32, 0.0, 0.0], [0.4; 3]), ProxyFilter::ALL));
        for threads in [1, 2] {
            let set = on(threads, || broad_phase.set_many(&ids, |id| id, cube));
            assert_eq!(set, Err(Error::TooManyBoxes { boxes: 9100, limit: 9000 }), "{threads} threads");
        }
        assert_eq!(broad_phase.id_count(), 9000);
        assert!((0..9000).all(|id| broad_phase.contains(id)));
    }

    #[test]
    fn there_is_no_room_for_boxes_that_are_not_set() {
        let mut broad_phase = new();
        let ids: Vec<u32> = (0..IDS).chain([u32::MAX, u32::MAX - 1]).collect();
        let cube = |id: u32| Some((Aabb::from_center([id as f32, 0.0, 0.0], [0.4; 3]), ProxyFilter::ALL));
        let set =
            on(2, || broad_phase.set_many(&ids, |id| id, |id| if id < 15_000 { cube(id) } else { None }));
        assert_eq!((set, broad_phase.id_count()), (Ok(()), 15_000));
    }

    #[test]
    fn after_a_panic_of_the_caller_changes_are_seen_and_nothing_is_listed_any_more() {
        let (mut many, ids) = (new(), (0..IDS).collect::<Vec<u32>>());
        let row = |x: f32| {
            move |id: u32| Some((Aabb::from_center([x + id as f32, 0.0, 0.0], [0.4; 3]), ProxyFilter::ALL))
        };
        on(2, || {
            many.set_many(&ids, |id| id, row(0.0)).expect("few ids");
            many.update().expect("few pairs");
            let next = row(0.5);
            let fails = |id: u32| if id == 9000 { panic!("as planned") } else { next(id) };
            let set = catch_unwind(AssertUnwindSafe(|| many.set_many(&ids, |id| id, fails)));
            assert!(set.is_err());
        });
        assert!(many.flags.iter().all(|flags| flags & flag::LISTED == 0));
        let changed = (0..IDS).filter(|id| many.flags[*id as usize] & flag::CHANGED != 0);
        assert_eq!(sorted(changed), sorted(many.changes()));
        assert!(many.changes().count() > 1000);
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
