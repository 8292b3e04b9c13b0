//! The boxes of two sets that may have pairs: without those that miss all of the other set, if these are many.

use crate::parallel::{ensure_scratch, map, piece_range, run_parts, threads_for};
use crate::policy::{FEW_BOXES, PARALLEL_FROM_BOXES};
use crate::search::ById;
use crate::search::grid::bounds::{bounds_of, spread_evenly};
use crate::{Aabb, Boxes, CrossPair, Keys, NO_KEY, Pair, ProxyFilter};

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
    /// The number of places. Only so many boxes are in use, and these only if the set is copied.
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
        let are_few = a.len().min(b.len()) <= FEW_BOXES;
        let seem_near = |set, other| seem_near(set, &bounds_of_valid(other));
        self.are_copied = !(are_few || seem_near(a, b) && seem_near(b, a));
        self.dropped = 0;
        self.copies.iter_mut().zip(sets).for_each(|(copies, set)| copies.len = set.boxes.len());
        if self.are_copied {
            self.copy_near(a, b);
        }
        self.fill(sets.map(|set| set.filters), |copy| &mut copy.filters, ProxyFilter::ALL);
        self.fill(sets.map(|set| set.keys), |copy| &mut copy.keys, [NO_KEY; 4]);
    }

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
                    values.extend(copy.ids.iter().map(|id| given[*id as usize]));
                }
                Some(_) => {}
                None => values.resize(copy.len, default),
            }
            *copied(copy) = values;
        }
    }

    /// Copies the valid boxes of each set that overlap the bounds of the other set. Drops more of them while more than a quarter of
    /// the boxes is dropped, because the bounds of the boxes that are left are smaller.
    fn copy_near(&mut self, a: &[Aabb], b: &[Aabb]) {
        let mut first = Chosen::of(a, None, &bounds_of_valid(b));
        let mut second = Chosen::of(b, None, &first.bounds);
        let valid = first.valid + second.valid;
        let (mut before, mut left) = (a.len() + b.len(), first.ids.len() + second.ids.len());
        while 4 * left < 3 * before {
            first = Chosen::of(a, Some(&first.ids), &second.bounds);
            second = Chosen::of(b, Some(&second.ids), &first.bounds);
            (before, left) = (left, first.ids.len() + second.ids.len());
        }
        if first.ids.is_empty() || second.ids.is_empty() {
            first.ids.clear();
            second.ids.clear();
        }
        self.dropped = valid - (first.ids.len() + second.ids.len()) as u64;
        let [copies, other_copies] = &mut self.copies;
        copies.take(a, first.ids);
        other_copies.take(b, second.ids);
    }
}

impl Copies {
    /// Copies some boxes of a set.
    fn take(&mut self, set: &[Aabb], ids: Vec<u32>) {
        (self.len, self.ids) = (ids.len(), ids);
        ensure_scratch(&mut self.boxes, self.len, Aabb::NOWHERE);
        let parts = self.boxes[..self.len].chunks_mut(PIECE).zip(self.ids.chunks(PIECE));
        run_parts(threads_for(self.len.div_ceil(PIECE)), parts, |_, (boxes, ids)| {
            boxes.iter_mut().zip(ids).for_each(|(to, id)| *to = set[*id as usize]);
        });
    }
}

/// Returns true if a sample of a set is valid, and overlaps a box.
fn seem_near(set: &[Aabb], near: &Aabb) -> bool {
    spread_evenly(set.len(), SAMPLE).all(|i| set[i].is_valid() && set[i].overlaps(near))
}

/// The valid boxes of a set that overlap a box.
struct Chosen {
    ids: Vec<u32>,
    bounds: Aabb,
    /// The number of boxes that are valid, near or not.
    valid: u64,
}

impl Chosen {
    /// Finds those of all boxes of a set, or of the named ones, that overlap a box.
    fn of(set: &[Aabb], named: Option<&[u32]>, near: &Aabb) -> Self {
        let len = named.map_or(set.len(), <[u32]>::len);
        let pieces = pieces(len);
        let parts = map(pieces, |piece| {
            let places = piece_range(len, piece, pieces);
            match named {
                Some(ids) => Self::among(set, ids[places].iter().copied(), near),
                None => Self::among(set, places.start as u32..places.end as u32, near),
            }
        });
        let ids: Vec<&[u32]> = parts.iter().map(|part| &part.ids[..]).collect();
        let bounds = bounds_of(parts.iter().map(|part| &part.bounds));
        Self { ids: ids.concat(), bounds, valid: parts.iter().map(|part| part.valid).sum() }
    }

    fn among(set: &[Aabb], named: impl ExactSizeIterator<Item = u32>, near: &Aabb) -> Self {
        let (mut ids, mut len, mut valid) = (vec![0; named.len()], 0, 0);
        for id in named {
            // Without a branch: each id is written, and the next one overwrites it unless its box is near.
            let aabb = &set[id as usize];
            ids[len] = id;
            valid += u64::from(aabb.is_valid());
            len += usize::from(aabb.is_valid() & aabb.overlaps(near));
        }
        ids.truncate(len);
        Self { bounds: bounds_of(ids.iter().map(|id| &set[*id as usize])), ids, valid }
    }
}

fn pieces(boxes: usize) -> usize {
    if boxes < PARALLEL_FROM_BOXES { 1 } else { boxes.div_ceil(PIECE) }
}

fn bounds_of_valid(boxes: &[Aabb]) -> Aabb {
    let pieces = pieces(boxes.len());
    let bounds = map(pieces, |piece| {
        let boxes = &boxes[piece_range(boxes.len(), piece, pieces)];
        bounds_of(boxes.iter().filter(|aabb| aabb.is_valid()))
    });
    bounds_of(&bounds)
}
