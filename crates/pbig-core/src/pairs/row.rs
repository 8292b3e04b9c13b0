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

/// Returns true if two rows, which lie in pools, are the same.
#[inline(always)]
pub(super) fn are_same<S: Simd>(one: &[u32], other: &[u32], pool: &[u32], other_pool: &[u32]) -> bool {
    let fits = |row: &[u32], pool: &[u32]| row.as_ptr().wrapping_add(SHORT) <= pool.as_ptr_range().end;
    if one.len() != other.len() {
        return false;
    }
    if one.len() <= SHORT && fits(one, pool) && fits(other, other_pool) {
        // SAFETY: there are that many elements in both pools; `S` is what the caller runs with.
        return unsafe { S::same_short(one.as_ptr(), other.as_ptr(), one.len()) };
    }
    one == other
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
