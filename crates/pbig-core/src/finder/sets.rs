//! The boxes of two sets in one list, without those that miss all of the other set.

use crate::grid::bounds::bounds_of;
use crate::parallel::{SharedSlice, ensure_scratch, map, piece_range};
use crate::policy::PARALLEL_FROM_BOXES;
use crate::{Aabb, Boxes, Keys, NO_KEY, ProxyFilter};
use std::ops::Range;

/// Boxes that a thread looks at together: they stay in its second cache.
const PIECE: usize = 1 << 13;

/// The boxes of two sets that may have pairs, in one list: those of the first set, then those of the second.
#[derive(Clone, Debug, Default)]
pub(super) struct Sets {
    /// Only the first `len` are in use, here and in `ids`.
    boxes: Vec<Aabb>,
    /// By place in the list: the id in the set.
    pub(super) ids: Vec<u32>,
    /// The number of boxes of both sets.
    len: usize,
    pub(super) filters: Option<Vec<ProxyFilter>>,
    pub(super) keys: Option<Vec<Keys>>,
    /// The number of boxes of the first set.
    pub(super) split: u32,
    /// Valid boxes of both sets, before any was dropped.
    pub(super) valid: u64,
}

impl Sets {
    /// Returns the list.
    pub(super) fn boxes(&self) -> &[Aabb] {
        &self.boxes[..self.len]
    }

    /// Takes two sets, without the boxes that miss all of the other one.
    pub(super) fn take(&mut self, a: &Boxes<'_>, b: &Boxes<'_>) {
        let len = a.boxes.len() + b.boxes.len();
        ensure_scratch(&mut self.boxes, len, Aabb::NOWHERE);
        ensure_scratch(&mut self.ids, len, 0);
        let (split, second) = self.list_near(a.boxes, b.boxes);
        let behind = a.boxes.len()..a.boxes.len() + second;
        self.boxes.copy_within(behind.clone(), split);
        self.ids.copy_within(behind, split);
        (self.split, self.len) = (split as u32, split + second);
        let (first, second) = self.ids[..self.len].split_at(split);
        self.filters = gather([(first, a.filters), (second, b.filters)], ProxyFilter::ALL);
        self.keys = gather([(first, a.keys), (second, b.keys)], [NO_KEY; 4]);
    }

    /// Lists the valid boxes of each set that overlap the bounds of the other set, and returns how many are left of each. Repeats it
    /// while more than a quarter of the boxes is dropped, because the bounds of the boxes that are left are smaller.
    fn list_near(&mut self, a: &[Aabb], b: &[Aabb]) -> (usize, usize) {
        let ((boxes, more_boxes), (ids, more_ids)) =
            (self.boxes.split_at_mut(a.len()), self.ids.split_at_mut(a.len()));
        let mut first = Side::new(boxes, ids);
        let mut second = Side::new(&mut more_boxes[..b.len()], &mut more_ids[..b.len()]);
        self.valid = first.take(a, &bounds_of_valid(b));
        self.valid += second.take(b, &first.bounds);
        let (mut before, mut left) = (a.len() + b.len(), first.len + second.len);
        while 4 * left < 3 * before {
            first.keep_near(&second.bounds);
            second.keep_near(&first.bounds);
            (before, left) = (left, first.len + second.len);
        }
        if first.len.min(second.len) == 0 { (0, 0) } else { (first.len, second.len) }
    }
}

/// The boxes of one set that are left, with their ids, and the bounds of these boxes.
struct Side<'a> {
    boxes: &'a mut [Aabb],
    ids: &'a mut [u32],
    len: usize,
    bounds: Aabb,
}

impl<'a> Side<'a> {
    fn new(boxes: &'a mut [Aabb], ids: &'a mut [u32]) -> Self {
        Self { len: boxes.len(), boxes, ids, bounds: Aabb::NOWHERE }
    }

    /// Takes the valid boxes of a set that overlap a box. Returns how many are valid.
    fn take(&mut self, set: &[Aabb], near: &Aabb) -> u64 {
        self.keep(near, |boxes, ids, range| {
            boxes.copy_from_slice(&set[range.clone()]);
            ids.iter_mut().zip(range.start as u32..).for_each(|(id, i)| *id = i);
        })
    }

    /// Drops boxes that miss a box.
    fn keep_near(&mut self, near: &Aabb) {
        self.keep(near, |_, _, _| ());
    }

    /// Keeps the valid boxes that overlap a box, of what `fill` puts into each piece. Returns how many are valid.
    fn keep(&mut self, near: &Aabb, fill: impl Fn(&mut [Aabb], &mut [u32], Range<usize>) + Sync) -> u64 {
        let (len, pieces) = (self.len, pieces(self.len));
        let (boxes, ids) = (SharedSlice::new(self.boxes), SharedSlice::new(self.ids));
        let kept = map(pieces, |piece| {
            let range = piece_range(len, piece, pieces);
            // SAFETY: `len` is at most the length of both lists, and each piece has its own part of it.
            let (boxes, ids) = unsafe { (boxes.part(range.clone()), ids.part(range.clone())) };
            fill(boxes, ids, range);
            keep_in_piece(boxes, ids, near)
        });
        self.close_gaps(&kept);
        self.bounds = bounds_of(kept.iter().map(|kept| &kept.bounds));
        kept.iter().map(|kept| kept.valid).sum()
    }

    /// Moves what is left of each piece to the end of the one before.
    fn close_gaps(&mut self, pieces: &[Kept]) {
        let (len, mut end) = (self.len, 0);
        for (piece, kept) in pieces.iter().enumerate() {
            let first = piece_range(len, piece, pieces.len()).start;
            if first > end {
                self.boxes.copy_within(first..first + kept.len, end);
                self.ids.copy_within(first..first + kept.len, end);
            }
            end += kept.len;
        }
        self.len = end;
    }
}

/// A piece after its boxes have been dropped: the number and bounds of the others, and how many were valid before.
struct Kept {
    len: usize,
    valid: u64,
    bounds: Aabb,
}

/// Returns the number of pieces of some boxes.
fn pieces(boxes: usize) -> usize {
    if boxes < PARALLEL_FROM_BOXES { 1 } else { boxes.div_ceil(PIECE) }
}

/// Returns the bounds of the valid ones of some boxes.
fn bounds_of_valid(boxes: &[Aabb]) -> Aabb {
    let pieces = pieces(boxes.len());
    let bounds = map(pieces, |piece| {
        let boxes = &boxes[piece_range(boxes.len(), piece, pieces)];
        bounds_of(boxes.iter().filter(|aabb| aabb.is_valid()))
    });
    bounds_of(&bounds)
}

/// Moves valid boxes that overlap a box to the front.
fn keep_in_piece(boxes: &mut [Aabb], ids: &mut [u32], near: &Aabb) -> Kept {
    let (mut len, mut valid) = (0, 0);
    for i in 0..boxes.len() {
        // Tested where it lies: a copy that was just written would be slow to read.
        let (is_valid, is_near) = (boxes[i].is_valid(), boxes[i].overlaps(near));
        (boxes[len], ids[len]) = (boxes[i], ids[i]);
        valid += u64::from(is_valid);
        len += usize::from(is_valid & is_near);
    }
    Kept { len, valid, bounds: bounds_of(&boxes[..len]) }
}

/// Copies the values of listed boxes; none if neither set has any.
fn gather<T: Copy>(sets: [(&[u32], Option<&[T]>); 2], default: T) -> Option<Vec<T>> {
    if sets.iter().all(|(_, values)| values.is_none()) {
        return None;
    }
    let value = |values: Option<&[T]>, id: u32| values.map_or(default, |values| values[id as usize]);
    let all = sets.into_iter().flat_map(|(ids, values)| ids.iter().map(move |id| value(values, *id)));
    Some(all.collect())
}
