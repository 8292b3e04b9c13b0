//! Counts where most rows are estimated wrong, and lists of them would take twenty times as long: runs of indices of
//! one row whose estimates are the same are looked at together, and what they test is marked in bits.

use super::tally::{self, Tally, tested};
use super::{AsItIs, Correction, Integers, Root, Rules, discriminant, pairs_of, row_start};

/// Estimates computed together.
const BLOCK: i64 = 64;

/// All pairs of `n` boxes, `2 <= n <= MOST_EXHAUSTIVE`: as it is, by the rules, by integers.
pub(super) fn all<R: Root>(n: i64) -> [Tally; 3] {
    debug_assert!((2..=tally::MOST_EXHAUSTIVE).contains(&n));
    let (mut as_it_is, mut rules, mut integers) = (Tested::new(n), Tested::new(n), Tested::new(n));
    for row in 0..n - 1 {
        each_run::<R>(n, row, |run| {
            as_it_is.note::<AsItIs>(&run);
            rules.note::<Rules>(&run);
            integers.note::<Integers>(&run);
        });
    }
    [as_it_is.tally(), rules.tally(), integers.tally()]
}

/// Consecutive indices of a row, all with the same estimate.
struct Run {
    row: i64,
    estimate: i64,
    first: i64,
    count: i64,
}

fn each_run<R: Root>(n: i64, row: i64, mut found: impl FnMut(Run)) {
    let (start, end) = (row_start(row, n), row_start(row + 1, n));
    let mut estimates = [0; BLOCK as usize];
    for from in (start..end).step_by(BLOCK as usize) {
        let block = &mut estimates[..BLOCK.min(end - from) as usize];
        for (k, estimate) in (from..).zip(&mut *block) {
            *estimate = R::row(2 * n - 1, discriminant(k, n));
        }
        let mut first = from;
        for same in block.chunk_by(|a, b| a == b) {
            let count = same.len() as i64;
            found(Run { row, estimate: same[0], first, count });
            first += count;
        }
    }
}

/// The pairs that indices give.
struct Tested {
    n: i64,
    wrong: u64,
    none: u64,
    worst_row: u64,
    /// A bit for each pair.
    is_tested: Vec<u64>,
}

impl Tested {
    fn new(n: i64) -> Self {
        let words = (pairs_of(n) as u64).div_ceil(64) as usize;
        Self { n, wrong: 0, none: 0, worst_row: 0, is_tested: vec![0; words] }
    }

    /// What a correction makes of a run. From the same estimate for the same row it takes the same way, so that the
    /// first and the last pair say all where they are of one row, and the pairs between those between: the rules ask
    /// whether `b > n`, which it is from the start of the row after the estimated one on, and whether `a >= b`, which it is
    /// below the start of the estimated one; both are borders of rows.
    #[inline(always)]
    fn note<C: Correction>(&mut self, run: &Run) {
        let Self { n, .. } = *self;
        let pair = |k| C::pair(run.estimate, k, n);
        let (first, last) = (pair(run.first), pair(run.first + run.count - 1));
        let right = AsItIs::pair(run.row, run.first, n);
        if first != right || last.0 != right.0 {
            self.wrong += run.count as u64;
            self.worst_row = self.worst_row.max(first.0.abs_diff(right.0));
        }
        let is_one_row = first.0 == last.0 && last.1 - first.1 == run.count - 1;
        if is_one_row && first.1 >= n {
            self.none += run.count as u64;
        } else if let (true, true, Some(index)) = (is_one_row, last.1 < n, in_order(first, n)) {
            self.mark(index as u64, run.count as u64);
        } else {
            (run.first..run.first + run.count).for_each(|k| self.mark_one(tested(pair(k), n)));
        }
    }

    fn mark_one(&mut self, index: Option<i64>) {
        match index {
            Some(index) => self.mark(index as u64, 1),
            None => self.none += 1,
        }
    }

    /// At most [`BLOCK`] bits.
    fn mark(&mut self, first: u64, count: u64) {
        let (word, bit) = ((first / 64) as usize, first % 64);
        let bits = u128::from(u64::MAX >> (64 - count)) << bit;
        self.is_tested[word] |= bits as u64;
        if bits >> 64 != 0 {
            self.is_tested[word + 1] |= (bits >> 64) as u64;
        }
    }

    fn tally(&self) -> Tally {
        let Self { n, wrong, none, worst_row, .. } = *self;
        let pairs = pairs_of(n) as u64;
        let tested: u64 = self.is_tested.iter().map(|word| u64::from(word.count_ones())).sum();
        let missed = pairs - tested;
        Tally { pairs, wrong, worst_row, missed, doubled: missed - none, none }
    }
}

/// The index of a pair whose lesser box comes first.
fn in_order(pair: (i64, i64), n: i64) -> Option<i64> {
    if pair.0 < pair.1 { tested(pair, n) } else { None }
}

#[cfg(test)]
mod tests {
    use super::super::{CARMACK, Double, LOMONT, Newton, Printed, SingleRoot};
    use super::*;

    /// Off by many rows, to and fro.
    struct Far;

    impl SingleRoot for Far {
        fn root(x: f32) -> f32 {
            x.sqrt() + (x * 0.01).sin() * 20.0
        }
    }

    #[test]
    fn counts_are_those_of_lists() {
        fn check<R: Root>(n: i64) {
            assert_eq!(all::<R>(n), tally::all::<R>(n), "n {n}");
        }
        for n in (2..70).chain([300, 1000]) {
            check::<Newton<CARMACK, 1>>(n);
            check::<Newton<LOMONT, 1>>(n);
            check::<Far>(n);
            check::<Printed>(n);
            check::<Double>(n);
        }
        assert!(all::<Newton<CARMACK, 1>>(300)[0].none > 0 && all::<Far>(300)[1].worst_row > 5);
    }
}
