//! Sorts short rows of ids, and compares two rows.

use super::compare::Differences;
use crate::Pair;
use crate::id_set::IdSet;
use crate::simd::{Simd, next};
use std::ops::Range;

/// Ids of a row that one register holds.
pub(super) const SHORT: usize = 8;

/// Maximum number of ids of a row that is sorted by counting the lesser ones of each. Longer ones take less time in a set of bits.
const MEDIUM: usize = 96;

/// Copies the row at `range` of `from` to the same range of `to`, sorted; rows are copied in order, as a short one may
/// overwrite what comes behind it. No two ids of a row are equal. A register of elements is behind all rows of `from`.
#[inline(always)]
pub(super) fn sort_into(
    simd: impl Simd,
    from: &[u32],
    range: Range<usize>,
    to: &mut [u32],
    long: &mut IdSet,
) {
    let (len, to) = (range.len(), &mut to[range.start..]);
    if len > MEDIUM {
        return long.sort(&from[range], &mut to[..len]);
    }
    if len > SHORT {
        return sort_by_counting(&from[range.start..], len, &mut to[..len]);
    }
    let sorted = sorted_short(simd, &from[range.start..], len);
    match to.first_chunk_mut() {
        Some(to) => *to = sorted,
        None => to[..len].copy_from_slice(&sorted[..len]),
    }
}

/// Returns the first `len` ids, sorted. What comes behind these is anything.
#[inline(always)]
pub(super) fn sorted_short(simd: impl Simd, from: &[u32], len: usize) -> [u32; SHORT] {
    simd.sorted_short(first_eight(from), len)
}

/// Sorts a list that mostly has few ids.
#[inline(always)]
pub(crate) fn sort_few(simd: impl Simd, ids: &mut [u32]) {
    let len = ids.len();
    if len > SHORT {
        return ids.sort_unstable();
    }
    let mut eight = [0; SHORT];
    eight[..len].copy_from_slice(ids);
    let sorted = simd.sorted_short(&eight, len);
    ids.copy_from_slice(&sorted[..len]);
}

/// Borrows the first elements of a row, and those behind it.
#[inline(always)]
fn first_eight(row: &[u32]) -> &[u32; SHORT] {
    row.first_chunk().expect("a register of elements is behind all rows")
}

/// Sorts the first `len` of some ids, eight at a time: the place of each is the number of lesser ones.
#[inline(always)]
fn sort_by_counting(from: &[u32], len: usize, to: &mut [u32]) {
    let row = &from[..len];
    // Without effect, unless two ids are equal: then a place is left out, and must not keep an id of another row.
    to.copy_from_slice(row);
    for first in (0..len).step_by(SHORT) {
        let (eight, mut lesser) = (first_eight(&from[first..]), [0u32; SHORT]);
        for id in row {
            for lane in 0..SHORT {
                lesser[lane] += u32::from(*id < eight[lane]);
            }
        }
        for (id, place) in eight.iter().zip(lesser).take(len - first) {
            to[place as usize] = *id;
        }
    }
}

type RowAt<'a> = (&'a [u32], Range<usize>);

/// Appends the pairs of `a` that are in one of two sorted rows only.
#[inline(always)]
pub(super) fn compare(
    simd: impl Simd,
    a: u32,
    (old, was): RowAt<'_>,
    (new, is): RowAt<'_>,
    to: &mut Differences,
) {
    let eight =
        |pool: &[u32], row: &Range<usize>| pool.get(row.start..).and_then(|rest| rest.first_chunk().copied());
    let is_short = was.len().max(is.len()) <= SHORT;
    let (Some(was8), Some(is8), true) = (eight(old, &was), eight(new, &is), is_short) else {
        // An old row that is empty may lie beyond the pool.
        let (was, is) = (old.get(was).unwrap_or(&[]), &new[is]);
        return if !equal(was, is) {
            differences(a, was, is, to)
        };
    };
    if was.len() == is.len() && simd.same_short(&was8, &is8, is.len()) {
        return;
    }
    push(a, &was8, simd.absent(&was8, &is8, is.len()) & ((1 << was.len()) - 1), &mut to.removed);
    push(a, &is8, simd.absent(&is8, &was8, was.len()) & ((1 << is.len()) - 1), &mut to.added);
}

/// Appends the pairs of `a` with the elements of a mask.
#[inline(always)]
fn push(a: u32, row: &[u32; SHORT], mut mask: u32, pairs: &mut Vec<Pair>) {
    while let Some(lane) = next(&mut mask) {
        pairs.push(Pair { a, b: row[lane % SHORT] });
    }
}

/// Returns true if two rows are equal. Empty ones are not handed to `memcmp`: it took 60 ns (glibc 2.36, AVX-512) where the address
/// cannot be read, as in a vector without memory.
#[inline(always)]
pub(crate) fn equal(old: &[u32], new: &[u32]) -> bool {
    old.len() == new.len() && (old.is_empty() || old == new)
}

/// Appends the pairs of an id that are in one of two sorted rows only.
#[inline(always)]
pub(crate) fn differences(id: u32, old: &[u32], new: &[u32], to: &mut Differences) {
    let Differences { added, removed } = to;
    let (mut i, mut j) = (0, 0);
    while i < old.len() && j < new.len() {
        let (was, is) = (old[i], new[j]);
        if was < is {
            removed.push(Pair::new(id, was));
        } else if is < was {
            added.push(Pair::new(id, is));
        }
        i += usize::from(was <= is);
        j += usize::from(is <= was);
    }
    removed.extend(old[i..].iter().map(|&other| Pair::new(id, other)));
    added.extend(new[j..].iter().map(|&other| Pair::new(id, other)));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn compared(simd: impl Simd, old: &[u32], new: &[u32]) -> Differences {
        let mut differences = Differences::default();
        compare(simd, 1, (old, 0..3), (new, 0..4), &mut differences);
        differences
    }

    #[test]
    fn rows_compare_alike_within_a_pool_and_at_its_end() {
        // Behind the rows, numbers of the other one.
        let old = [2, 4, 6, 5, 7, 5, 7, 5, 7];
        let new = [4, 5, 6, 7, 2, 2, 2, 2, 2];
        for (old, new) in [(&old[..], &new[..]), (&old[..3], &new[..4]), (&old[..], &new[..4])] {
            let Differences { added, removed } = crate::simd::dispatch!(compared, old, new);
            assert_eq!(*added, [5, 7].map(|b| Pair { a: 1, b }));
            assert_eq!(*removed, [Pair { a: 1, b: 2 }]);
        }
    }

    fn sorted(simd: impl Simd, pool: &[u32], len: usize) -> Vec<u32> {
        let (mut to, mut long) = (vec![0; 3 * len], IdSet::default());
        for row in 0..3 {
            sort_into(simd, pool, row * len..(row + 1) * len, &mut to, &mut long);
        }
        to
    }

    #[test]
    fn rows_of_every_length_are_sorted_at_the_end_of_their_list_too() {
        for len in 1..300 {
            let id = |i: usize| {
                u32::MAX - 500_000 + (i * 7919 % len) as u32 * 1021 + u32::from(i.is_multiple_of(3))
            };
            let rows: Vec<Vec<u32>> =
                (0..3).map(|row| (0..len).map(|i| id(i) + row * 50_000).collect()).collect();
            // Behind the rows, numbers of no row.
            let pool = [&rows.concat()[..], &[0, 1, u32::MAX, 3, 4, 5, 6, 7]].concat();
            let mut wanted = rows;
            wanted.iter_mut().for_each(|row| row.sort_unstable());
            assert_eq!(crate::simd::dispatch!(sorted, &pool, len), wanted.concat(), "{len}");
            assert_eq!(sorted(crate::simd::Portable, &pool, len), wanted.concat(), "{len}, portable");
        }
    }

    /// A device may name a pair twice.
    #[test]
    fn a_row_with_equal_ids_keeps_every_id_and_gets_no_other() {
        for len in [9, 50, 97, 200] {
            let ids: Vec<u32> = (0..len).map(|i| 1000 + (i * 7 % (len - 3)) as u32).collect();
            let pool = [&ids[..], &[0; SHORT]].concat();
            let mut to = vec![u32::MAX; len];
            sort_into(crate::simd::Portable, &pool, 0..len, &mut to, &mut IdSet::default());
            to.sort_unstable();
            to.dedup();
            assert!(to.into_iter().eq(1000..1000 + (len as u32 - 3)), "{len}");
        }
    }
}
