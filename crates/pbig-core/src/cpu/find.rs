//! Find: the search over a whole map, in pieces that threads share. Every pair is met once.
//!
//! The search walks the sorted boxes, never the cells. Each box meets
//! 1. in its own level the half of its window that comes after it (`half`),
//! 2. in the levels of larger boxes the whole window (`window`),
//! 3. the boxes of the list (`check`);
//!
//! and the list meets itself.

use super::check::Checker;
use super::entries::Query;
use super::found::{Found, Room};
use super::half::{Half, Rests};
use super::judge::{Accept, Judge, Scratch};
use super::levels::Level;
use super::map::Map;
use super::record::Record;
use super::window::{Rows, Windows};
use crate::plan::OPEN;
use crate::report::stage;
use crate::share::{self, has_threads};
use crate::{Error, Pair, ProxyFilter, shared_from};
use std::cell::RefCell;
use std::sync::{Mutex, PoisonError};

/// Boxes in one piece of work: enough to hide the cost of handing it out (a few us against 50),
/// few enough to balance; fixed, so that the bytes that [`Map::find`] leaves do not depend on the threads.
const CHUNK: usize = 2048;

/// Pairs of a chunk that a thread keeps room for.
const MOST_KEPT: usize = 1 << 16;

/// Expected time of a search, in ns on one core, from which it is shared with other threads. In a
/// tight loop 150,000 pay off (4,096 unit cubes: 0.14 ms alone, 0.10 with a second thread), but in an
/// app the other threads sleep between steps and waking one costs about as much.
const PARALLEL_FROM: u64 = shared_from(300_000) as u64;

/// Boxes to be looked up in one piece of work.
const OTHERS: usize = 256;

/// Boxes to be looked up in a map from which the work is shared, with threads that are awake or asleep.
const OTHERS_SHARED_FROM: [usize; 2] = [shared_from(512), shared_from(2048)];

/// What a box costs, and a check, in ns; checks as many as in the call before.
const ENTRY: u64 = 15;
const CHECK: u64 = 1;

thread_local! {
    /// Buffers of a search, one for each thread that takes part.
    static SCRATCH: RefCell<(Scratch, Rests, Rows, Vec<u32>)> = RefCell::default();
    /// What a chunk has found, before it is put to the others.
    static OUT: RefCell<Vec<Pair>> = const { RefCell::new(Vec::new()) };
}

impl<R: Record> Map<R> {
    /// All pairs of overlapping boxes in the map that `accept` takes, into `found`; of a map that knows what boxes were
    /// before, only pairs that did not overlap then.
    pub(crate) fn find<A>(&self, accept: &A, max_pairs: u64, found: &mut Found) -> Result<(), Error>
    where
        A: Accept,
    {
        stage!("check");
        let room = Room::new(max_pairs);
        let is_shared = self.is_shared(found);
        let buffers = found.buffers(self.chunks());
        let work = |(chunk, out): (usize, &mut Vec<Pair>)| self.check_chunk(chunk, accept, out, &room);
        let counts = share::sum(is_shared, buffers.iter_mut().enumerate(), work, add);
        (found.checks, found.overlaps) = counts;
        room.settle(found.len())
    }

    /// The same into `all`, chunk by chunk in no particular order, and nothing but counts into `found`: for so many pairs
    /// that with chunks and a list of them, both kept, a world of a million boxes took 50 MB more.
    pub(crate) fn find_all<A>(
        &self,
        accept: &A,
        max_pairs: u64,
        found: &mut Found,
        all: &mut Vec<Pair>,
    ) -> Result<(), Error>
    where
        A: Accept,
    {
        stage!("check");
        let (room, is_shared) = (Room::new(max_pairs), self.is_shared(found));
        all.clear();
        found.clear();
        let chunks = 0..self.chunks();
        let counts = if is_shared {
            let gathered = Mutex::new(&mut *all);
            let work = |chunk: usize| self.check_for(&gathered, chunk, accept, &room);
            share::sum(true, chunks, work, add)
        } else {
            chunks.map(|chunk| self.check_chunk(chunk, accept, all, &room)).fold((0, 0), add)
        };
        (found.checks, found.overlaps) = counts;
        room.settle(all.len())
    }

    /// A chunk, for what all threads have found together.
    fn check_for<A>(
        &self,
        gathered: &Mutex<&mut Vec<Pair>>,
        chunk: usize,
        accept: &A,
        room: &Room,
    ) -> (u64, u64)
    where
        A: Accept,
    {
        OUT.with_borrow_mut(|out| {
            let counts = self.check_chunk(chunk, accept, out, room);
            gathered.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(out);
            // One of a pile may have found very many, and the thread lives on.
            out.clear();
            out.shrink_to(MOST_KEPT);
            counts
        })
    }

    /// Whether a search is worth waking other threads, by the tests of the one before.
    fn is_shared(&self, before: &Found) -> bool {
        let in_list = (self.list.len() as u64).pow(2) / 2;
        let expected = ENTRY * self.len_in_grids() as u64 + CHECK * before.checks.max(in_list);
        expected >= PARALLEL_FROM && has_threads()
    }

    /// How many chunks there are: those of each level, then those of the list.
    fn chunks(&self) -> usize {
        let in_levels: usize = self.levels.iter().map(|level| level.slots.len().div_ceil(CHUNK)).sum();
        in_levels + self.list.len().div_ceil(CHUNK)
    }

    /// Chunk `i`.
    fn chunk(&self, mut i: usize) -> Chunk {
        for (level, of) in self.levels.iter().enumerate() {
            let count = of.slots.len().div_ceil(CHUNK);
            if i < count {
                let start = of.slots.start + i * CHUNK;
                return Chunk { level: Some(level), start, end: of.slots.end.min(start + CHUNK) };
            }
            i -= count;
        }
        Chunk { level: None, start: i * CHUNK, end: self.list.len().min((i + 1) * CHUNK) }
    }

    fn check_chunk<A>(&self, chunk: usize, accept: &A, out: &mut Vec<Pair>, room: &Room) -> (u64, u64)
    where
        A: Accept,
    {
        let chunk = self.chunk(chunk);
        let Some(level) = chunk.level else { return self.check_list(&chunk, accept, out, room) };
        SCRATCH.with_borrow_mut(|(scratch, rests, rows, _)| {
            let inner = self.check_half(&chunk, level, accept, out, room, (scratch, rests));
            let larger = self.check_larger(&chunk, level, accept, out, room, (scratch, rows));
            let listed = self.check_against_list(&chunk, accept, out, room);
            add(add(inner, larger), listed)
        })
    }

    /// Pairs among the boxes of the map.
    fn judge<'a, A: Accept>(
        &'a self,
        accept: &'a A,
        out: &'a mut Vec<Pair>,
        room: &'a Room,
    ) -> Judge<'a, R, A> {
        let (records, places) = (&self.sorted.records, &self.sorted.places);
        let taken = out.len();
        Judge {
            queries: records,
            candidates: records,
            places,
            update: None,
            accept,
            out,
            room,
            taken,
            overlaps: 0,
        }
    }

    /// Pairs within a level.
    fn check_half<A>(
        &self,
        chunk: &Chunk,
        level: usize,
        accept: &A,
        out: &mut Vec<Pair>,
        room: &Room,
        (scratch, rests): (&mut Scratch, &mut Rests),
    ) -> (u64, u64)
    where
        A: Accept,
    {
        let level = &self.levels[level];
        if level.camp != OPEN {
            return (0, 0);
        }
        let (sorted, look) = (&self.sorted, self.look);
        let judge = self.judge(accept, out, room);
        let mut half = Half { sorted, level, look, judge, scratch, rests, checks: 0 };
        half.check(chunk.start..chunk.end, self.simd);
        (half.checks, half.judge.overlaps)
    }

    /// Boxes of a level against those of larger levels.
    fn check_larger<A>(
        &self,
        chunk: &Chunk,
        level: usize,
        accept: &A,
        out: &mut Vec<Pair>,
        room: &Room,
        scratch: (&mut Scratch, &mut Rows),
    ) -> (u64, u64)
    where
        A: Accept,
    {
        let own = self.levels[level].camp;
        let judge = self.judge(accept, out, room);
        let mut windows = Windows::new(&self.sorted, judge, scratch);
        let places = &self.sorted.places[chunk.start..chunk.end];
        let meets = |larger: &&Level| larger.camp == OPEN || larger.camp != own;
        let mut levels = self.levels[level + 1..].iter().filter(meets);
        levels.all(|larger| windows.check(larger, places, self.simd));
        (windows.checks, windows.judge.overlaps)
    }

    fn check_against_list<A>(&self, chunk: &Chunk, accept: &A, out: &mut Vec<Pair>, room: &Room) -> (u64, u64)
    where
        A: Accept,
    {
        if self.list.len() == 0 {
            return (0, 0);
        }
        let mut taken = out.len();
        let mut checker = Checker::new(accept, out);
        for slot in chunk.start..chunk.end {
            let item = self.item(slot);
            checker.test(&Query::new(&item.aabb), item.id, &self.list, 0..self.list.len());
            if !room.take(checker.out.len(), &mut taken) {
                break;
            }
        }
        (checker.checks, checker.overlaps)
    }

    /// The list against itself.
    fn check_list<A>(&self, chunk: &Chunk, accept: &A, out: &mut Vec<Pair>, room: &Room) -> (u64, u64)
    where
        A: Accept,
    {
        let mut taken = out.len();
        let mut checker = Checker::new(accept, out);
        for i in chunk.start..chunk.end {
            let (query, id) = (self.list.boxes[i].query(), self.list.ids[i]);
            checker.test(&query, id, &self.list, i + 1..self.list.len());
            if !room.take(checker.out.len(), &mut taken) {
                break;
            }
        }
        (checker.checks, checker.overlaps)
    }

    /// Every pair of a box of `others` with a box of the map that overlaps it, did not before if that is known, and
    /// that its filter may allow. Two boxes both of which are in both are met twice.
    pub(crate) fn check_others<A>(
        &self,
        others: &Others<'_, R>,
        accept: &A,
        found: &mut Found,
        max_pairs: u64,
    ) -> Result<(), Error>
    where
        A: Accept,
    {
        let (room, records) = (Room::new(max_pairs), others.records);
        let piece = |(records, out): (&[R], &mut Vec<Pair>)| {
            self.check_piece(&Others { records, ..*others }, accept, out, &room)
        };
        let is_shared = records.len() >= OTHERS_SHARED_FROM[usize::from(!others.are_awake)] && has_threads();
        let each = if is_shared { OTHERS } else { records.len().max(1) };
        let buffers = found.buffers(records.len().div_ceil(each)).iter_mut();
        let counts = share::sum(is_shared, records.chunks(each).zip(buffers), piece, add);
        (found.checks, found.overlaps) = counts;
        // A search that ran out of room has ended early.
        if room.used() > max_pairs {
            Err(Error::TooManyPairs { limit: max_pairs })
        } else {
            room.settle(found.len())
        }
    }

    fn check_piece<A>(
        &self,
        others: &Others<'_, R>,
        accept: &A,
        out: &mut Vec<Pair>,
        room: &Room,
    ) -> (u64, u64)
    where
        A: Accept,
    {
        let counts = SCRATCH.with_borrow_mut(|(scratch, _, rows, places)| {
            let own = self.judge(accept, out, room);
            let judge = Judge { queries: others.records, update: others.update, ..own };
            let mut windows = Windows::new(&self.sorted, judge, (scratch, rows));
            for level in &self.levels {
                others.meeting(self, level.camp, places);
                if !windows.check(level, places, self.simd) {
                    break;
                }
            }
            (windows.checks, windows.judge.overlaps)
        });
        if self.list.len() == 0 {
            return counts;
        }
        let mut checker = Checker::new(accept, out);
        for item in others.records.iter().map(R::item) {
            checker.test(&Query::new(&item.aabb), item.id, &self.list, 0..self.list.len());
        }
        add(counts, (checker.checks, checker.overlaps))
    }
}

/// Boxes to be looked up in a map.
pub(crate) struct Others<'a, R> {
    pub(crate) records: &'a [R],
    /// The present one, if boxes of the map need not have changed in it.
    pub(crate) update: Option<u64>,
    /// By id.
    pub(crate) filters: &'a [ProxyFilter],
    /// Whether other threads have just had work.
    pub(crate) are_awake: bool,
}

impl<R: Record> Others<'_, R> {
    /// The places of those that may pair with boxes of a camp.
    fn meeting(&self, map: &Map<R>, camp: u8, places: &mut Vec<u32>) {
        let meets =
            |record: &R| camp == OPEN || camp != map.camps.camp(&self.filters[record.item().id as usize]);
        let all = 0..self.records.len() as u32;
        places.clear();
        places.extend(all.filter(|&place| meets(&self.records[place as usize])));
    }
}

fn add(a: (u64, u64), b: (u64, u64)) -> (u64, u64) {
    (a.0 + b.0, a.1 + b.1)
}

/// Consecutive slots of one level, or places of the list.
struct Chunk {
    level: Option<usize>,
    start: usize,
    end: usize,
}
