//! The counting sort of boxes by cell (PBIG 4.2: count, scan, scatter), stable, in two passes.
//!
//! First into *buckets* of consecutive cells, then each bucket, which fits a cache. In one pass the scatter misses the
//! cache with every box: 112 to 126 ms for a million, against 43 to 51 (one thread, both passes moving
//! whole boxes). Boxes are written once, as *records*
//! in the order of the buckets; the second pass orders only their codes and places, which is what a search reads.
//! Both passes are shared between threads, and their result does not depend on how.

use super::cells::Cells;
use super::codes::BLOCK;
use super::levels::{Classes, LISTED, Level};
use super::record::{Item, Record};
use super::spill::Spill;
use crate::{Aabb, share};
use std::marker::PhantomData;
use std::ops::Range;

/// The boxes to sort.
#[derive(Clone, Copy)]
pub(super) struct Input<'a> {
    pub(super) boxes: &'a [Aabb],
    /// By id: what a box was before, for records that keep it.
    pub(super) before: &'a [Aabb],
    /// By id; empty without camps.
    pub(super) camp_of: &'a [u8],
}

/// The sorted boxes. By place: the order of the first pass; by slot: that of the cells.
#[derive(Clone, Debug)]
pub(crate) struct Sorted<R> {
    /// First slot of each key, and one more.
    pub(crate) starts: Vec<u32>,
    /// By place.
    pub(crate) records: Vec<R>,
    /// By slot; behind the last, enough that a block may be read anywhere.
    pub(crate) codes: Vec<u64>,
    /// By slot: the key of its cell.
    pub(crate) keys: Vec<u32>,
    /// By slot: where its record is.
    pub(crate) places: Vec<u32>,
    /// What came to cells since.
    pub(super) spill: Spill,
}

impl<R> Default for Sorted<R> {
    fn default() -> Self {
        let (starts, records, codes, spill) = (Vec::new(), Vec::new(), Vec::new(), Spill::default());
        Self { starts, records, codes, keys: Vec::new(), places: Vec::new(), spill }
    }
}

/// Boxes of a bucket: with its cells about 100 KB, a share of a second-level cache.
const BUCKET: usize = 2048;

/// Most buckets, but for one a level: each is a stream of writes, and the first-level cache has 512 lines.
const MOST: usize = 512;

/// Boxes of a piece of work.
const PIECE: usize = 8192;

/// No cell: an invalid box.
pub(super) const NOWHERE: u32 = u32::MAX;

/// Boxes that are in no cell.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Elsewhere {
    pub(super) listed: u32,
    pub(super) invalid: u32,
}

impl Elsewhere {
    fn note(&mut self, key: u32) {
        self.listed += u32::from(key == LISTED);
        self.invalid += u32::from(key == NOWHERE);
    }

    fn add(self, other: Self) -> Self {
        Self { listed: self.listed + other.listed, invalid: self.invalid + other.invalid }
    }
}

/// The buffers of the sort.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sort {
    /// By id: the key of its cell, [`LISTED`] or [`NOWHERE`].
    pub(super) keys: Vec<u32>,
    /// By piece and bucket: how many boxes, then where the next one goes.
    cursors: Vec<u32>,
    /// First place of each bucket, and one more.
    starts: Vec<u32>,
    /// By bucket: its level.
    levels: Vec<u32>,
    /// By bucket: the sum of the squares of the numbers of boxes in its cells.
    squares: Vec<u64>,
    /// Keys of a bucket, as a power of two.
    shift: u32,
}

/// How keys are divided into buckets, of which each level has at least one: the keys of one, as a power of two.
pub(super) fn shift_for(boxes: usize, cells: impl ExactSizeIterator<Item = u32>) -> u32 {
    let wanted = (boxes / BUCKET).clamp(1, MOST).max(cells.len()) as u64;
    let total: u64 = cells.map(u64::from).sum();
    total.div_ceil(wanted).next_power_of_two().trailing_zeros()
}

impl Sort {
    /// Where each box goes: into the levels, whose keys are aligned to buckets of `2^shift`, or elsewhere.
    pub(super) fn place(
        &mut self,
        input: &Input<'_>,
        classes: &Classes,
        levels: &[Level],
        shift: u32,
        threads: bool,
    ) -> Elsewhere {
        self.shift = shift;
        self.divide(levels);
        self.count(input, classes, levels, threads)
    }

    /// Sorts the boxes as placed.
    pub(super) fn sort<R: Record>(
        &mut self,
        input: &Input<'_>,
        levels: &mut [Level],
        threads: bool,
        out: &mut Sorted<R>,
    ) {
        out.spill.clear();
        let sorted = self.scan();
        self.scatter(input, threads, sorted, out);
        self.order(levels, threads, out);
        self.measure(levels);
    }

    /// The buckets of each level.
    fn divide(&mut self, levels: &[Level]) {
        self.levels.clear();
        for (i, level) in levels.iter().enumerate() {
            let cells = u64::from(level.cells.mask) + 1;
            let buckets = cells.div_ceil(1 << self.shift) as usize;
            self.levels.resize(self.levels.len() + buckets, i as u32);
        }
        self.squares.clear();
        self.squares.resize(self.levels.len(), 0);
    }

    /// Where each box goes, and how many go into each bucket.
    fn count(&mut self, input: &Input<'_>, classes: &Classes, levels: &[Level], threads: bool) -> Elsewhere {
        // Without a level there is nothing to count, but listed boxes are to be told from invalid ones.
        let (n, buckets, shift) = (input.boxes.len(), self.levels.len().max(1), self.shift);
        self.keys.resize(n, NOWHERE);
        self.cursors.clear();
        self.cursors.resize(n.div_ceil(PIECE) * buckets, 0);
        let piece = |(piece, (keys, counts)): (usize, (&mut [u32], &mut [u32]))| {
            let mut elsewhere = Elsewhere::default();
            for (id, key) in (piece * PIECE..).zip(keys) {
                let aabb = &input.boxes[id];
                let camp = input.camp_of.get(id).copied().unwrap_or(0);
                *key = classes.key(aabb, camp, levels);
                if *key < LISTED {
                    counts[(*key >> shift) as usize] += 1;
                } else {
                    elsewhere.note(*key);
                }
            }
            elsewhere
        };
        let (keys, cursors) = (&mut self.keys, &mut self.cursors);
        let pieces = keys.chunks_mut(PIECE).zip(cursors.chunks_mut(buckets)).enumerate();
        share::sum(threads, pieces, piece, Elsewhere::add)
    }

    /// Counts to places: bucket by bucket, in each piece by piece, so that the sort is stable; returns how many boxes
    /// there are.
    fn scan(&mut self) -> usize {
        let buckets = self.levels.len();
        self.starts.clear();
        let mut sum = 0;
        for bucket in 0..buckets {
            self.starts.push(sum);
            for cursor in self.cursors.iter_mut().skip(bucket).step_by(buckets) {
                sum += std::mem::replace(cursor, sum);
            }
        }
        self.starts.push(sum);
        sum as usize
    }

    /// Boxes into buckets.
    fn scatter<R: Record>(&mut self, input: &Input<'_>, threads: bool, sorted: usize, out: &mut Sorted<R>) {
        resize(&mut out.records, sorted, R::EMPTY);
        let records = Shared::new(&mut out.records);
        let shift = self.shift;
        let piece = |(piece, (keys, cursors)): (usize, (&[u32], &mut [u32]))| {
            for (id, &key) in (piece * PIECE..).zip(keys).filter(|(_, key)| **key < LISTED) {
                let cursor = &mut cursors[(key >> shift) as usize];
                let place = *cursor as usize;
                *cursor += 1;
                let item = Item::new(input.boxes[id], id as u32, key);
                // SAFETY: each piece has places of its own in each bucket, as many as it counted.
                unsafe { records.write(place, R::new(item, input.before)) }
            }
        };
        let (keys, cursors, buckets) = (&self.keys, &mut self.cursors, self.levels.len().max(1));
        let pieces = keys.chunks(PIECE).zip(cursors.chunks_mut(buckets)).enumerate();
        share::for_each(threads, pieces, piece);
    }

    /// Each bucket by cell.
    fn order<R: Record>(&mut self, levels: &[Level], threads: bool, out: &mut Sorted<R>) {
        let (sorted, buckets) = (out.records.len(), self.levels.len());
        out.starts.resize((buckets << self.shift) + 1, 0);
        resize(&mut out.codes, sorted + BLOCK, 0);
        resize(&mut out.keys, sorted, 0);
        resize(&mut out.places, sorted, 0);
        out.starts[0] = 0;
        // From the second key on: the cursor of a cell ends where the next one begins.
        let starts = Shared::new(&mut out.starts[1..]);
        let (codes, keys) = (Shared::new(&mut out.codes), Shared::new(&mut out.keys));
        let (places, squares) = (Shared::new(&mut out.places), Shared::new(&mut self.squares));
        let order = |bucket: usize| {
            let range = self.starts[bucket] as usize..self.starts[bucket + 1] as usize;
            // SAFETY: each bucket has boxes and keys of its own.
            let part = unsafe {
                Bucket {
                    first_key: (bucket << self.shift) as u32,
                    first_place: range.start as u32,
                    cursors: starts.part(bucket << self.shift..(bucket + 1) << self.shift),
                    codes: codes.part(range.clone()),
                    keys: keys.part(range.clone()),
                    places: places.part(range.clone()),
                }
            };
            let crowd = part.fill(&levels[self.levels[bucket] as usize].cells, &out.records[range]);
            // SAFETY: as above.
            unsafe { squares.write(bucket, crowd) }
        };
        const TOGETHER: usize = PIECE / BUCKET;
        let pieces = (0..buckets).step_by(TOGETHER);
        share::for_each(threads, pieces, |first| {
            for bucket in first..buckets.min(first + TOGETHER) {
                order(bucket);
            }
        });
    }

    /// Where the boxes of each level are, and how crowded its cells.
    fn measure(&self, levels: &mut [Level]) {
        for (i, level) in levels.iter_mut().enumerate() {
            let first = self.levels.partition_point(|&of| (of as usize) < i);
            let end = self.levels.partition_point(|&of| of as usize <= i);
            level.slots = self.starts[first] as usize..self.starts[end] as usize;
            let squares: u64 = self.squares[first..end].iter().sum();
            level.crowd = (squares as f64 / level.slots.len().max(1) as f64) as f32 - 1.0;
        }
    }
}

/// With room for boxes that come later, a sixteenth to an eighth (`spill`): to move what there is takes as much memory again.
/// What there was is not needed.
fn resize<T: Copy>(of: &mut Vec<T>, len: usize, value: T) {
    if of.capacity() < len + len / 16 {
        *of = Vec::new();
        of.reserve_exact(len + len / 8);
    }
    of.resize(len, value);
}

/// A slice of which threads use different elements.
struct Shared<'a, T>(*mut T, usize, PhantomData<&'a mut [T]>);

// SAFETY: each element is used by one thread, as the methods ask; `share` hands each piece out once, and returns or panics after
// all have ended.
unsafe impl<T: Send> Sync for Shared<'_, T> {}

impl<'a, T: Copy> Shared<'a, T> {
    fn new(slice: &'a mut [T]) -> Self {
        Self(slice.as_mut_ptr(), slice.len(), PhantomData)
    }

    /// # Safety
    /// `place` is within the slice, and nobody else uses it.
    #[inline(always)]
    unsafe fn write(&self, place: usize, value: T) {
        debug_assert!(place < self.1);
        // SAFETY: the caller's promise.
        unsafe { self.0.add(place).write(value) }
    }

    /// # Safety
    /// Nobody else uses the range.
    #[expect(clippy::mut_from_ref, reason = "parts do not overlap, as asked")]
    unsafe fn part(&self, range: Range<usize>) -> &mut [T] {
        assert!(range.start <= range.end && range.end <= self.1);
        // SAFETY: within the slice; nobody else uses it, as the caller promises.
        unsafe { std::slice::from_raw_parts_mut(self.0.add(range.start), range.len()) }
    }
}

/// The result's part for one bucket.
struct Bucket<'a> {
    first_key: u32,
    first_place: u32,
    cursors: &'a mut [u32],
    codes: &'a mut [u64],
    keys: &'a mut [u32],
    places: &'a mut [u32],
}

impl Bucket<'_> {
    /// Sorts the records of the bucket into its cells; returns the sum of the squares of their counts.
    fn fill<R: Record>(self, cells: &Cells, records: &[R]) -> u64 {
        self.cursors.fill(0);
        for record in records {
            self.cursors[(record.item().key - self.first_key) as usize] += 1;
        }
        let (mut next, mut squares) = (self.first_place, 0);
        for cursor in self.cursors.iter_mut() {
            let count = u64::from(*cursor);
            squares += count * count;
            next += std::mem::replace(cursor, next);
        }
        for (place, record) in (self.first_place..).zip(records) {
            let item = record.item();
            let cursor = &mut self.cursors[(item.key - self.first_key) as usize];
            let slot = (*cursor - self.first_place) as usize;
            *cursor += 1;
            self.codes[slot] = cells.code(&item.aabb);
            self.keys[slot] = item.key;
            self.places[slot] = place;
        }
        squares
    }
}
