//! Sorting short rows of ids, and telling two rows apart.

use crate::Pair;
use crate::grid::Simd;
use std::ops::Range;

/// Ids of a row that one register holds.
pub(super) const SHORT: usize = 8;

/// Longest row that is sorted by insertion, where it is nearly sorted.
const INSERTION_UP_TO: usize = 64;

/// Copies the row at `range` of `from` to the same range of `to`, sorted; rows are copied in order, as a short one may
/// overwrite what comes behind it.
///
/// # Safety
/// `from` has [`SHORT`] elements more than the row, and the processor the instructions.
#[inline(always)]
pub(super) unsafe fn sort_into<S: Simd>(
    from: &[u32],
    range: Range<usize>,
    to: &mut [u32],
    is_nearly_sorted: bool,
) {
    let Range { start, end } = range;
    debug_assert!(end + SHORT <= from.len() && end <= to.len());
    if end - start > SHORT {
        let row = &mut to[start..end];
        row.copy_from_slice(&from[start..end]);
        return sort_long(row, is_nearly_sorted);
    }
    // SAFETY: the caller's promise; near the end of `to` only the row itself is copied.
    unsafe {
        let sorted = S::sorted_short(from.as_ptr().add(start), end - start);
        if start + SHORT <= to.len() {
            to.as_mut_ptr().add(start).cast::<[u32; SHORT]>().write_unaligned(sorted);
        } else {
            to[start..end].copy_from_slice(&sorted[..end - start]);
        }
    }
}

#[inline(never)]
fn sort_long(row: &mut [u32], is_nearly_sorted: bool) {
    if !is_nearly_sorted || row.len() > INSERTION_UP_TO {
        return row.sort_unstable();
    }
    for i in 1..row.len() {
        let (value, mut place) = (row[i], i);
        while place > 0 && row[place - 1] > value {
            row[place] = row[place - 1];
            place -= 1;
        }
        row[place] = value;
    }
}

/// Returns true if two rows are the same, each at a range of its pool.
///
/// # Safety
/// The processor has the instructions.
#[inline(always)]
pub(super) unsafe fn are_same<S: Simd>(
    (pool, one): (&[u32], Range<usize>),
    (other_pool, other): (&[u32], Range<usize>),
) -> bool {
    if one.len() != other.len() {
        return false;
    }
    let fits = one.start + SHORT <= pool.len() && other.start + SHORT <= other_pool.len();
    if one.len() <= SHORT && fits {
        let (row, other_row) = (&pool[one.start..], &other_pool[other.start..]);
        // SAFETY: both pools have that many elements there; the caller has the instructions.
        return unsafe { S::same_short(row.as_ptr(), other_row.as_ptr(), one.len()) };
    }
    pool[one] == other_pool[other]
}

/// Appends the pairs of `a` that are in one of two sorted rows only.
#[inline(always)]
pub(super) fn differences(a: u32, old: &[u32], new: &[u32], added: &mut Vec<Pair>, removed: &mut Vec<Pair>) {
    let (mut i, mut j) = (0, 0);
    while i < old.len() && j < new.len() {
        let (was, is) = (old[i], new[j]);
        if was < is {
            removed.push(Pair { a, b: was });
        } else if is < was {
            added.push(Pair { a, b: is });
        }
        i += usize::from(was <= is);
        j += usize::from(is <= was);
    }
    removed.extend(old[i..].iter().map(|&b| Pair { a, b }));
    added.extend(new[j..].iter().map(|&b| Pair { a, b }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_those_of_sets() {
        let (mut added, mut removed) = (vec![], vec![]);
        differences(1, &[2, 4, 6, 9], &[3, 4, 9, 12], &mut added, &mut removed);
        assert_eq!(added, [3, 12].map(|b| Pair { a: 1, b }));
        assert_eq!(removed, [2, 6].map(|b| Pair { a: 1, b }));
        differences(5, &[], &[7], &mut added, &mut removed);
        differences(6, &[8], &[], &mut added, &mut removed);
        assert_eq!((added[2], removed[2]), (Pair { a: 5, b: 7 }, Pair { a: 6, b: 8 }));
    }
}
