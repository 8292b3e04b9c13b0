//! Building a grid: boxes are sorted by the cell of their lower corner, by two counting sorts.
//!
//! The first sort brings records into a few hundred *buckets* of neighbouring cells, the second one sorts each bucket
//! while it is in the cache, and computes codes. Each pass is shared by threads piece by piece.

use super::Grid;
use super::cells::Cells;
use super::scan::Sorted;
use crate::Aabb;
use crate::parallel::{SharedSlice, ensure_scratch, piece_range, run_parts, split_evenly, split_into};
use crate::search::hits::Record;
use crate::simd::{BLOCK, Simd, TOMBSTONE, dispatch};

/// Maximum number of buckets of the first sort: their write positions stay in the nearest cache.
const MAX_BUCKETS: usize = 2047;

/// Approximate number of boxes in a bucket: they are sorted within the second cache.
const BOXES_PER_BUCKET: usize = 2048;

/// Keys of boxes that are in no cell.
const OVERSIZE: u32 = u32::MAX;
const INVALID: u32 = u32::MAX - 1;

/// By bucket: boxes of one piece, then their place. The last two are oversize and invalid boxes.
pub(super) type BucketCounts = [u32; MAX_BUCKETS + 3];

const OVERSIZE_BUCKET: usize = MAX_BUCKETS + 1;
const INVALID_BUCKET: usize = MAX_BUCKETS + 2;

/// Division of keys into buckets, and of boxes into pieces.
#[derive(Clone, Copy)]
struct Split {
    /// log2 of the cells in a bucket.
    shift: u32,
    buckets: usize,
    pieces: usize,
}

impl Split {
    fn new(boxes: usize, cells: usize, workers: usize) -> Self {
        let wanted = (boxes / BOXES_PER_BUCKET).clamp(1, MAX_BUCKETS);
        let shift = (0..u32::BITS).find(|shift| cells >> shift < wanted).unwrap_or(u32::BITS - 1);
        let pieces = if workers > 1 { 4 * workers } else { 1 };
        Self { shift, buckets: (cells >> shift) + 1, pieces }
    }
}

impl Grid {
    /// Sorts the valid boxes, `boxes[id]` with the id `id`, into cells.
    pub(crate) fn build(&mut self, cells: Cells, boxes: &[Aabb], workers: usize) -> Sorted<'_> {
        let split = self.bring_into_buckets(cells, boxes, 0, workers);
        self.sort_buckets(split, workers);
        Sorted { own: self, other: None }
    }

    /// Brings the valid boxes into buckets; the first box has this id.
    fn bring_into_buckets(&mut self, cells: Cells, boxes: &[Aabb], first_id: u32, workers: usize) -> Split {
        self.cells = cells;
        let split = Split::new(boxes.len(), self.cells.count(), workers);
        self.reserve(boxes.len());
        self.count(boxes, split, workers);
        self.place(split);
        self.list_oversize(boxes, first_id, split);
        self.scatter((boxes, first_id), split, workers);
        split
    }

    fn reserve(&mut self, boxes: usize) {
        self.room = boxes;
        ensure_scratch(&mut self.coarse, boxes, Record::EMPTY);
        ensure_scratch(&mut self.records, boxes, Record::EMPTY);
        ensure_scratch(&mut self.codes, boxes + 2 * BLOCK, TOMBSTONE);
        ensure_scratch(&mut self.starts, self.cells.count() + 4, 0);
    }

    /// Computes keys, and counts boxes by bucket.
    fn count(&mut self, boxes: &[Aabb], split: Split, workers: usize) {
        let pieces = split.pieces.max(self.counts.len());
        self.counts.resize(pieces, [0; MAX_BUCKETS + 3]);
        // In the memory of the codes, which are computed when the keys are no longer needed.
        let keys: &mut [u32] = bytemuck::cast_slice_mut(&mut self.codes);
        let (keys, cells) = (&mut keys[..boxes.len()], self.cells);
        let parts = split_evenly(keys, split.pieces).zip(&mut self.counts[..]);
        run_parts(workers, parts, |piece, (keys, counts)| {
            let range = piece_range(boxes.len(), piece, split.pieces);
            counts[..=split.buckets].fill(0);
            (counts[OVERSIZE_BUCKET], counts[INVALID_BUCKET]) = (0, 0);
            dispatch!(count_keys, cells, &boxes[range.clone()], keys, counts, split.shift);
        });
    }

    /// Turns counts into places, and notes the beginning of each bucket and the end of the last one.
    fn place(&mut self, split: Split) {
        let starts = &mut self.bucket_starts;
        starts.clear();
        let mut next = 0;
        let counts = &mut self.counts[..split.pieces];
        for bucket in 0..split.buckets {
            starts.push(next);
            for counts in counts.iter_mut() {
                next += std::mem::replace(&mut counts[bucket], next);
            }
        }
        starts.push(next);
        self.len = next as usize;
    }

    fn list_oversize(&mut self, boxes: &[Aabb], first_id: u32, split: Split) {
        self.oversize.clear();
        if self.counts[..split.pieces].iter().all(|counts| counts[OVERSIZE_BUCKET] == 0) {
            return;
        }
        let keys: &[u32] = bytemuck::cast_slice(&self.codes);
        for (i, aabb) in boxes.iter().enumerate().filter(|(i, _)| keys[*i] == OVERSIZE) {
            self.oversize.push(Record::new(*aabb, first_id + i as u32, OVERSIZE));
        }
    }

    fn scatter(&mut self, (boxes, first_id): (&[Aabb], u32), split: Split, workers: usize) {
        let coarse = SharedSlice::new(&mut self.coarse);
        let keys: &[u32] = bytemuck::cast_slice(&self.codes);
        run_parts(workers, &mut self.counts[..split.pieces], |piece, next| {
            let range = piece_range(boxes.len(), piece, split.pieces);
            let first_id = first_id + range.start as u32;
            let (boxes, keys) = (&boxes[range.clone()], &keys[range]);
            dispatch!(scatter_records, boxes, keys, first_id, next, coarse, split.shift);
        });
    }

    /// Sorts each bucket by cell, and computes codes.
    fn sort_buckets(&mut self, split: Split, workers: usize) {
        let (cells, count) = (self.cells, self.cells.count());
        let (coarse, bucket_starts) = (&self.coarse, &self.bucket_starts);
        let slots = |bucket: usize| bucket_starts[bucket] as usize..bucket_starts[bucket + 1] as usize;
        let keys = |bucket: usize| bucket << split.shift..((bucket + 1) << split.shift).min(count);
        let slot_counts = || (0..split.buckets).map(|bucket| slots(bucket).len());
        let records =
            split_into(&mut self.records, slot_counts()).zip(split_into(&mut self.codes, slot_counts()));
        let ends = split_into(&mut self.starts[1..], (0..split.buckets).map(|bucket| keys(bucket).len()));
        run_parts(workers, records.zip(ends), |bucket, ((records, codes), ends)| {
            let (slots, first_key) = (slots(bucket), keys(bucket).start);
            let (bucket, ends) = ((&coarse[slots.clone()], slots.start), (&mut *ends, first_key));
            dispatch!(sort_bucket, cells, bucket, ends, (&mut *records, &mut *codes));
        });
        self.starts[0] = 0;
        self.starts[count + 1..count + 4].fill(self.len as u32);
        self.codes[self.len..self.len + 2 * BLOCK].fill(TOMBSTONE);
    }
}

#[derive(Clone, Debug, Default)]
pub(crate) struct TwoGrids([Grid; 2]);

impl TwoGrids {
    /// Sorts the valid boxes of two sets, of which the second has the ids behind the first's, each into a grid. Boxes that are
    /// searched for stay in their buckets, near those that they meet, unless an oversize box of the other set meets them in cells.
    pub(crate) fn build(&mut self, cells: Cells, boxes: [&[Aabb]; 2], workers: usize) -> Sorted<'_> {
        let [first, second] = &mut self.0;
        let first_split = first.bring_into_buckets(cells, boxes[0], 0, workers);
        let second_split = second.bring_into_buckets(cells, boxes[1], boxes[0].len() as u32, workers);
        let is_first_smaller = first.len <= second.len;
        let (first, second) = ((first, first_split), (second, second_split));
        let ((own, own_split), (other, split)) =
            if is_first_smaller { (first, second) } else { (second, first) };
        other.sort_buckets(split, workers);
        if other.oversize.is_empty() {
            std::mem::swap(&mut own.records, &mut own.coarse);
        } else {
            own.sort_buckets(own_split, workers);
        }
        Sorted { own, other: Some(other) }
    }
}

/// Computes the keys of boxes, and counts the boxes by bucket.
#[inline(always)]
fn count_keys(
    simd: impl Simd,
    cells: Cells,
    boxes: &[Aabb],
    keys: &mut [u32],
    counts: &mut BucketCounts,
    shift: u32,
) {
    for (aabb, to) in boxes.iter().zip(keys) {
        let takes = simd.fits(&cells.max_extent, aabb);
        let mut key = simd.key(cells.dims, cells.shift, cells.wraps, cells.steps(simd, aabb).0);
        let mut bucket = 0;
        if takes {
            bucket += (key >> shift) as usize;
        } else {
            (key, bucket) =
                if aabb.is_valid() { (OVERSIZE, OVERSIZE_BUCKET) } else { (INVALID, INVALID_BUCKET) };
        }
        *to = key;
        counts[bucket] += 1;
    }
}

#[inline(always)]
fn scatter_records(
    _: impl Simd,
    boxes: &[Aabb],
    keys: &[u32],
    first_id: u32,
    next: &mut [u32],
    coarse: SharedSlice<'_, Record>,
    shift: u32,
) {
    for ((aabb, &key), id) in boxes.iter().zip(keys).zip(first_id..) {
        if key < INVALID {
            let place = &mut next[(key >> shift) as usize];
            // SAFETY: no two boxes of any pieces have the same place.
            unsafe { coarse.write(*place as usize, Record::new(*aabb, id, key)) };
            *place += 1;
        }
    }
}

/// Sorts a bucket by cell, and computes its codes. It comes with its first slot, and the ends of its cells with the key of the first one.
#[inline(always)]
fn sort_bucket(
    simd: impl Simd,
    cells: Cells,
    (bucket, first_slot): (&[Record], usize),
    (ends, first_key): (&mut [u32], usize),
    (records, codes): (&mut [Record], &mut [u64]),
) {
    ends.fill(0);
    for record in bucket {
        ends[record.key as usize - first_key] += 1;
    }
    let mut next = first_slot as u32;
    for end in ends.iter_mut() {
        next += std::mem::replace(end, next);
    }
    for record in bucket {
        let place = &mut ends[record.key as usize - first_key];
        let (low, high) = cells.steps(simd, &record.aabb);
        let (slot, code) = (*place as usize - first_slot, simd.code(low, high));
        (records[slot], codes[slot]) = (*record, code);
        *place += 1;
    }
}
