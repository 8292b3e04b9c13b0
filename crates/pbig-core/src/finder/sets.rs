//! The boxes of two sets that may have pairs: without those that miss all of the other set, if these are many.

use crate::parallel::{ensure_scratch, map, piece_range, run_parts, split_evenly, threads_for};
use crate::policy::{FEW_BOXES, PARALLEL_FROM_BOXES};
use crate::search::ById;
use crate::search::grid::bounds::{bounds_of, spread_evenly};
use crate::{Aabb, Boxes, CrossPair, Keys, NO_KEY, Pair, ProxyFilter};
use std::ops::Range;

/// Boxes that a thread looks at together: they stay in its second cache.
const PIECE: usize = 1 << 13;

/// Maximum number of boxes of a set that tell whether some miss the other set.
const SAMPLE: usize = 256;

/// Two sets, as they are, or copies of the boxes that overlap the bounds of the other set. Of a pair, the second box has a place behind
/// all places of the first set.
#[derive(Clone, Debug, Default)]
pub(super) struct Sets {
    copies: [Copies; 2],
    /// True if the copies are searched.
    are_copied: bool,
    /// Valid boxes that were dropped.
    pub(super) dropped: u64,
}

/// Copies of what is known about the boxes of a set that are left.
#[derive(Clone, Debug, Default)]
struct Copies {
    /// The number of places. Only so many boxes and ids are in use, and these only if the set is copied.
    len: usize,
    boxes: Vec<Aabb>,
    /// By place: the id in the set.
    ids: Vec<u32>,
    filters: Vec<ProxyFilter>,
    keys: Vec<Keys>,
}

impl Sets {
    /// Takes two sets. Copies them unless all boxes seem to overlap the bounds of the other set.
    pub(super) fn take(&mut self, sets: [&Boxes<'_>; 2]) {
        let [a, b] = sets.map(|set| set.boxes);
        // A few boxes are tested against the others sooner than these are looked at.
        self.are_copied = a.len().min(b.len()) > FEW_BOXES && !are_near(a, b);
        self.dropped = 0;
        let lens = if self.are_copied { self.copy_near(a, b) } else { [a.len(), b.len()] };
        self.copies.iter_mut().zip(lens).for_each(|(copies, len)| copies.len = len);
        self.fill(sets.map(|set| set.filters), |copy| &mut copy.filters, ProxyFilter::ALL);
        self.fill(sets.map(|set| set.keys), |copy| &mut copy.keys, [NO_KEY; 4]);
    }

    /// Returns the boxes that are left of both sets.
    pub(super) fn boxes<'a>(&'a self, sets: [&Boxes<'a>; 2]) -> [&'a [Aabb]; 2] {
        let [one, other] = &self.copies;
        if self.are_copied {
            [one, other].map(|copy| &copy.boxes[..copy.len])
        } else {
            sets.map(|set| set.boxes)
        }
    }

    /// Returns the filters by place; none if neither set has any.
    pub(super) fn filters<'a>(&'a self, sets: [&Boxes<'a>; 2]) -> Option<ById<'a, ProxyFilter>> {
        self.by_place(sets.map(|set| set.filters), |copy| &copy.filters)
    }

    /// Returns the keys by place; none if neither set has any.
    pub(super) fn keys<'a>(&'a self, sets: [&Boxes<'a>; 2]) -> Option<ById<'a, Keys>> {
        self.by_place(sets.map(|set| set.keys), |copy| &copy.keys)
    }

    /// Returns a pair of places as a pair of ids.
    #[inline(always)]
    pub(super) fn named(&self, pair: &Pair) -> CrossPair {
        let [first, second] = &self.copies;
        let (a, b) = (pair.a, pair.b - first.len as u32);
        if self.are_copied {
            CrossPair { a: first.ids[a as usize], b: second.ids[b as usize] }
        } else {
            CrossPair { a, b }
        }
    }

    fn by_place<'a, T>(
        &'a self,
        given: [Option<&'a [T]>; 2],
        copied: impl Fn(&'a Copies) -> &'a Vec<T>,
    ) -> Option<ById<'a, T>> {
        given.iter().any(Option::is_some).then(|| {
            let values = |side: usize| given[side].filter(|_| !self.are_copied);
            ById::of_two([0, 1].map(|side| values(side).unwrap_or_else(|| copied(&self.copies[side]))))
        })
    }

    /// Copies the values of the places of each set that cannot be read where they are given.
    fn fill<T: Copy>(
        &mut self,
        given: [Option<&[T]>; 2],
        copied: impl Fn(&mut Copies) -> &mut Vec<T>,
        default: T,
    ) {
        if given.iter().all(Option::is_none) {
            return;
        }
        for (copy, given) in self.copies.iter_mut().zip(given) {
            let mut values = std::mem::take(copied(copy));
            values.clear();
            match given {
                Some(given) if self.are_copied => {
                    values.extend(copy.ids[..copy.len].iter().map(|id| given[*id as usize]));
                }
                Some(_) => {}
                None => values.resize(copy.len, default),
            }
            *copied(copy) = values;
        }
    }

    /// Copies the valid boxes of each set that overlap the bounds of the other set. Drops more of them while more than a quarter of
    /// the boxes is dropped, because the bounds of the boxes that are left are smaller. Returns how many are left.
    fn copy_near(&mut self, a: &[Aabb], b: &[Aabb]) -> [usize; 2] {
        let [first, second] = &mut self.copies;
        let (mut first, mut second) = (Side::new(first, a.len()), Side::new(second, b.len()));
        let valid = first.take(a, &bounds_of_valid(b)) + second.take(b, &first.bounds);
        let (mut before, mut left) = (a.len() + b.len(), first.len + second.len);
        while 4 * left < 3 * before {
            first.keep_near(&second.bounds);
            second.keep_near(&first.bounds);
            (before, left) = (left, first.len + second.len);
        }
        let lens = if first.len.min(second.len) == 0 { [0, 0] } else { [first.len, second.len] };
        self.dropped = valid - (lens[0] + lens[1]) as u64;
        lens
    }
}

/// Returns true if the boxes of each set seem to overlap the bounds of the other one.
fn are_near(a: &[Aabb], b: &[Aabb]) -> bool {
    seem_near(a, &bounds_of_valid(b)) && seem_near(b, &bounds_of_valid(a))
}

/// Returns true if a sample of a set is valid, and overlaps a box.
fn seem_near(set: &[Aabb], near: &Aabb) -> bool {
    spread_evenly(set.len(), SAMPLE).all(|i| set[i].is_valid() && set[i].overlaps(near))
}

/// The boxes of one set that are left, with their ids, and the bounds of these boxes.
struct Side<'a> {
    boxes: &'a mut [Aabb],
    ids: &'a mut [u32],
    len: usize,
    bounds: Aabb,
}

impl<'a> Side<'a> {
    fn new(copy: &'a mut Copies, len: usize) -> Self {
        ensure_scratch(&mut copy.boxes, len, Aabb::NOWHERE);
        ensure_scratch(&mut copy.ids, len, 0);
        Self { boxes: &mut copy.boxes, ids: &mut copy.ids, len, bounds: Aabb::NOWHERE }
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
        let mut kept = vec![Kept::NONE; pieces];
        let boxes = split_evenly(&mut self.boxes[..len], pieces);
        let parts = boxes.zip(split_evenly(&mut self.ids[..len], pieces)).zip(&mut kept);
        run_parts(threads_for(pieces), parts, |piece, ((boxes, ids), kept)| {
            fill(boxes, ids, piece_range(len, piece, pieces));
            *kept = keep_in_piece(boxes, ids, near);
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
#[derive(Clone, Copy)]
struct Kept {
    len: usize,
    valid: u64,
    bounds: Aabb,
}

impl Kept {
    const NONE: Self = Self { len: 0, valid: 0, bounds: Aabb::NOWHERE };
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
