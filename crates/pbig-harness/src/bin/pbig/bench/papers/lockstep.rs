//! PBIG's algorithms 1 and 2 line by line, without boxes: which pairs of a cell they compare, and how often.

use pbig_harness::pair_index::{index_of, pair_count};

/// The number from which equation 7 counts rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Rows {
    /// As algorithm 2 and figure 3 do.
    FromZero,
    FromOne,
}

/// Equation 7: matrix elements of row `i` of `m x n`, `i` counted from 0 by the caller.
pub(super) fn equation_7(i: u64, m: u64, n: u64, rows: Rows) -> u64 {
    let i = if rows == Rows::FromOne { i + 1 } else { i };
    // (m + 1) / 2 rounded down is m / 2 rounded up.
    let half = if i <= m.div_ceil(2) { (m + 1).div_ceil(2) } else { m.div_ceil(2) };
    n - m + half
}

/// Pairs of different boxes of a cell that are never compared, and the comparisons beyond the first of each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Faults {
    pub(super) missed: u64,
    pub(super) doubled: u64,
}

/// Algorithm 1 on a cell of so many boxes in segments of `length`.
pub(super) fn algorithm_1(boxes: u64, length: u64) -> Faults {
    by_segments(boxes, length, |i, _, n| (i..n).collect())
}

/// Algorithm 2, the same.
pub(super) fn algorithm_2(boxes: u64, length: u64, rows: Rows) -> Faults {
    by_segments(boxes, length, |i, m, n| {
        // Line 11; line 5 takes the smaller of both segments for m.
        let x = if i < n { equation_7(i, m.min(n), n, rows) } else { 0 };
        (0..x).map(|k| (i + k) % n).collect()
    })
}

/// Each segment against each (line 3), thread `i` of `m` against the columns of `n` that `columns` names.
fn by_segments(boxes: u64, length: u64, columns: impl Fn(u64, u64, u64) -> Vec<u64>) -> Faults {
    let mut seen = vec![0u64; pair_count(boxes) as usize];
    let size = |segment: u64| length.min(boxes - segment * length);
    let segments = boxes.div_ceil(length);
    for (v, h) in (0..segments).flat_map(|v| (0..segments).map(move |h| (v, h))) {
        for i in 0..size(v) {
            for j in columns(i, size(v), size(h)) {
                let (a, b) = (v * length + i, h * length + j);
                if a != b {
                    seen[index_of(a.min(b), a.max(b), boxes) as usize] += 1;
                }
            }
        }
    }
    let missed = seen.iter().filter(|times| **times == 0).count() as u64;
    Faults { missed, doubled: seen.iter().map(|times| times.saturating_sub(1)).sum() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_segment_is_complete_when_equation_7_counts_rows_from_one() {
        for boxes in 2..=16 {
            assert_eq!(algorithm_1(boxes, 16), Faults::default(), "{boxes}");
            assert_eq!(algorithm_2(boxes, 16, Rows::FromOne), Faults::default(), "{boxes}");
        }
    }

    #[test]
    fn figure_3_by_hand() {
        let rows = |rows| (0..8).map(|i| equation_7(i, 8, 8, rows)).collect::<Vec<_>>();
        assert_eq!(rows(Rows::FromOne), [5, 5, 5, 5, 4, 4, 4, 4]);
        assert_eq!(rows(Rows::FromZero), [5, 5, 5, 5, 5, 4, 4, 4], "37 elements where there are 36");
    }

    #[test]
    fn two_full_segments_meet_twice_on_their_diagonal() {
        let faults = Faults { missed: 0, doubled: 8 };
        assert_eq!(algorithm_1(16, 8), faults);
        assert_eq!(algorithm_2(16, 8, Rows::FromOne), faults);
    }
}
