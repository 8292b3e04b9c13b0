//! The list of pairs in a device's answer: checked while it is copied, or else in one pass of its own.

use crate::Pair;
use crate::parallel::{self, SharedSlice};
use std::mem::MaybeUninit;
use std::ops::{Deref, DerefMut};

/// Number of pairs that a thread takes at a time.
const PIECE: usize = 1 << 16;

/// Number of pairs that are copied before they are checked: they are then in the first-level cache.
const BLOCK: usize = 1 << 10;

/// The pairs of a device's answer: a `Vec` that remembers how much of it was checked.
///
/// [`PairList::append_checked`] checks pairs while it copies them, so that each is read once from the place where it lies. Every
/// other change makes the core check the whole list in a pass of its own.
#[derive(Clone, Debug, Default)]
pub struct PairList {
    pairs: Vec<Pair>,
    checked: Check,
}

/// The outcome of checks of the first pairs of a list.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Check {
    /// Number of checked pairs. Each has `a < b`.
    len: usize,
    /// An id above all others.
    end: u32,
    is_disordered: bool,
}

impl PairList {
    /// Appends pairs of this number of boxes, and checks them on the way. Each is read once: they may lie in memory of a device, which
    /// is slow to read. Threads share the work.
    ///
    /// # Errors
    /// The index of a pair `(a, b)` that is not `a < b`, or that names no box. Then nothing was appended.
    pub fn append_checked(&mut self, pairs: &[Pair], boxes: u32) -> Result<(), usize> {
        let (start, len) = (self.pairs.len(), pairs.len());
        self.pairs.reserve(len);
        let room = SharedSlice::new(&mut self.pairs.spare_capacity_mut()[..len]);
        let checks = parallel::map(len.div_ceil(PIECE), |piece| {
            let range = piece * PIECE..len.min((piece + 1) * PIECE);
            // SAFETY: the range is inside the room, and no other piece has it.
            let room = unsafe { room.part(range.clone()) };
            copy_checked(room, &pairs[range.clone()], boxes).map_err(|fault| range.start + fault)
        });
        let checks: Vec<Check> = checks.into_iter().collect::<Result<_, usize>>()?;
        // SAFETY: each piece was copied.
        unsafe { self.pairs.set_len(start + len) };
        if self.checked.len == start {
            let is_in_order = |at: usize| at == 0 || self.pairs[at - 1] < self.pairs[at];
            let add = |all: Check, next| all.before(next, is_in_order(all.len));
            self.checked = checks.into_iter().fold(self.checked, add);
        }
        Ok(())
    }

    /// Returns true if each pair is `a < b` and names one of this number of boxes.
    pub(crate) fn names_only(&mut self, boxes: usize) -> bool {
        self.check() && (self.pairs.is_empty() || self.checked.end as usize <= boxes)
    }

    /// Returns true if all pairs were checked, and are in order, each once.
    pub fn is_in_order(&self) -> bool {
        self.checked.len == self.pairs.len() && !self.checked.is_disordered
    }

    /// Checks all pairs, unless they were. Returns false if one is not `a < b`.
    fn check(&mut self) -> bool {
        if self.checked.len == self.pairs.len() {
            return true;
        }
        let (pairs, len) = (&self.pairs, self.pairs.len());
        let checks = parallel::map(len.div_ceil(PIECE), |piece| {
            let at = piece * PIECE;
            let check = check_of(&pairs[at..len.min(at + PIECE)]);
            check.map(|check| (check, at == 0 || pairs[at - 1] < pairs[at]))
        });
        let all = checks.into_iter().try_fold(Check::default(), |all, next| {
            next.map(|(check, is_in_order)| all.before(check, is_in_order))
        });
        self.checked = all.unwrap_or_default();
        all.is_some()
    }

    /// Returns the pairs.
    pub fn into_vec(self) -> Vec<Pair> {
        self.pairs
    }
}

impl From<Vec<Pair>> for PairList {
    fn from(pairs: Vec<Pair>) -> Self {
        Self { pairs, checked: Check::default() }
    }
}

impl Deref for PairList {
    type Target = Vec<Pair>;

    fn deref(&self) -> &Vec<Pair> {
        &self.pairs
    }
}

/// Forgets what was checked: the caller may change each pair.
impl DerefMut for PairList {
    fn deref_mut(&mut self) -> &mut Vec<Pair> {
        self.checked = Check::default();
        &mut self.pairs
    }
}

impl Check {
    /// Returns the check of these pairs and those after them. The border of the two may be out of order.
    fn before(self, next: Self, is_border_in_order: bool) -> Self {
        Self {
            len: self.len + next.len,
            end: self.end.max(next.end),
            is_disordered: self.is_disordered || next.is_disordered || !is_border_in_order,
        }
    }
}

/// Copies pairs, and checks each block of them while it is in the cache. Returns the index of a fault.
fn copy_checked(to: &mut [MaybeUninit<Pair>], pairs: &[Pair], boxes: u32) -> Result<Check, usize> {
    let (mut all, mut last) = (Check::default(), None);
    for (room, pairs) in to.chunks_mut(BLOCK).zip(pairs.chunks(BLOCK)) {
        let room = &mut room[..pairs.len()];
        room.iter_mut().zip(pairs).for_each(|(to, pair)| _ = to.write(*pair));
        // SAFETY: each was written; a `MaybeUninit` has the layout of what it holds.
        let block = unsafe { std::slice::from_raw_parts(room.as_ptr().cast::<Pair>(), room.len()) };
        let is_right = |pair: &Pair| pair.a < pair.b && pair.b < boxes;
        let check = check_of(block).filter(|check| check.end <= boxes);
        let check =
            check.ok_or_else(|| all.len + block.iter().position(|pair| !is_right(pair)).unwrap_or(0))?;
        all = all.before(check, last < block.first().copied());
        last = block.last().copied();
    }
    Ok(all)
}

/// Checks pairs. Returns none if one is not `a < b`.
fn check_of(pairs: &[Pair]) -> Option<Check> {
    // Without an early end, so that the compiler uses SIMD.
    let (are_pairs, last) =
        pairs.iter().fold((true, 0), |(all, last), pair| (all & (pair.a < pair.b), pair.b.max(last)));
    let end = last.checked_add(u32::from(!pairs.is_empty()))?;
    let is_disordered = !pairs.is_sorted_by(|one, next| one < next);
    are_pairs.then_some(Check { len: pairs.len(), end, is_disordered })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns pairs in order, for some pieces and blocks and a few more.
    fn many() -> Vec<Pair> {
        (0..2 * PIECE as u32 + 77).map(|i| Pair { a: i / 3, b: i / 3 + 1 + i % 3 }).collect()
    }

    fn end_of(pairs: &[Pair]) -> u32 {
        pairs.iter().map(|pair| pair.b + 1).max().unwrap_or(0)
    }

    #[test]
    fn a_fault_in_any_block_is_found_and_nothing_is_appended() {
        let pairs = many();
        let boxes = end_of(&pairs);
        for at in [0, 1, BLOCK - 1, BLOCK, PIECE - 1, PIECE, pairs.len() - 1] {
            for fault in [
                Pair { a: 9, b: 9 },
                Pair { a: 9, b: 8 },
                Pair { a: 9, b: boxes },
                Pair { a: 9, b: u32::MAX },
            ] {
                let mut faulty = pairs.clone();
                faulty[at] = fault;
                let mut list = PairList::from(vec![Pair { a: 0, b: 1 }]);
                assert_eq!(list.append_checked(&faulty, boxes), Err(at), "{fault:?}");
                assert_eq!(list.len(), 1);
                *list = faulty;
                assert!(!list.names_only(boxes as usize), "{fault:?} at {at}");
            }
        }
    }

    #[test]
    fn pairs_out_of_order_or_twice_are_noticed_in_every_piece_and_between_two() {
        let pairs = many();
        let boxes = end_of(&pairs);
        for at in [0, BLOCK - 1, BLOCK, PIECE - 1, PIECE, 2 * PIECE - 1, pairs.len() - 2] {
            let mut swapped = pairs.clone();
            swapped.swap(at, at + 1);
            let mut twice = pairs.clone();
            twice[at] = twice[at + 1];
            for disordered in [swapped, twice] {
                let mut list = PairList::default();
                list.append_checked(&disordered, boxes).expect("pairs");
                assert!(list.names_only(boxes as usize) && !list.is_in_order(), "copied, {at}");
                let mut list = PairList::from(disordered);
                assert!(list.names_only(boxes as usize) && !list.is_in_order(), "in place, {at}");
            }
        }
        let mut list = PairList::from(pairs);
        assert!(list.names_only(boxes as usize) && list.is_in_order());
    }

    #[test]
    fn a_changed_list_is_checked_again() {
        let mut list = PairList::default();
        list.append_checked(&many(), u32::MAX).expect("pairs");
        list[7].b = list[7].a;
        assert!(!list.names_only(usize::MAX));
        list[7].b += 1;
        assert!(list.names_only(usize::MAX));
        // An unchecked beginning is not forgotten.
        list[7].b = list[7].a;
        list.append_checked(&many(), u32::MAX).expect("pairs");
        assert!(!list.names_only(usize::MAX));
    }

    #[test]
    fn parts_are_in_order_together_if_their_border_is() {
        let pairs = many();
        let (first, second) = pairs.split_at(PIECE + 5);
        for (parts, is_in_order) in
            [([first, second], true), ([second, first], false), ([first, first], false)]
        {
            let mut list = PairList::default();
            parts.iter().for_each(|part| list.append_checked(part, end_of(&pairs)).expect("pairs"));
            assert_eq!(list.is_in_order(), is_in_order);
        }
    }
}
