//! Counts of wrong, missed and doubled pairs. Runs of indices of one row whose estimates are the same are looked at together, and
//! the pairs that they test are marked in bits.

use super::{AsItIs, Correction, Integers, Root, Rules, discriminant, pairs_of, row_start};
use std::ops::AddAssign;

/// The most boxes whose pairs are all looked at: as far as `(2n - 1)^2` is below 2^30.
pub const MOST_EXHAUSTIVE: i64 = 16_384;

/// Counts of right and wrong indices of all pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Number of pairs.
    pub pairs: u64,
    /// Indices that give anything but their pair, the lesser box first.
    pub wrong: u64,
    /// By how many rows the worst of them is off.
    pub worst_row: u64,
    /// Pairs that no index gives, whichever box comes first: they are not tested.
    pub missed: u64,
    /// Tests too many: indices that give a pair, whichever box comes first, which another gives, too; one of them
    /// does not count.
    pub doubled: u64,
    /// Indices that give no pair: a box and itself, or a box that there is not.
    pub none: u64,
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.pairs += other.pairs;
        self.wrong += other.wrong;
        self.worst_row = self.worst_row.max(other.worst_row);
        self.missed += other.missed;
        self.doubled += other.doubled;
        self.none += other.none;
    }
}

/// Estimates computed together.
const BLOCK: i64 = 64;

/// All pairs of `n` boxes, `2 <= n <= MOST_EXHAUSTIVE`: as it is, by the rules, by integers.
pub(super) fn all<R: Root>(n: i64) -> [Tally; 3] {
    debug_assert!((2..=MOST_EXHAUSTIVE).contains(&n));
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

/// The index of the pair that is tested: (1, 0) tests 0 and 1, as (0, 1) does.
fn tested((a, b): (i64, i64), n: i64) -> Option<i64> {
    let (a, b) = (a.min(b), a.max(b));
    (0 <= a && a < b && b < n).then(|| row_start(a, n) + b - a - 1)
}

/// Counts pairs given one by one, in the order of all pairs of `n >= 2` boxes.
pub(super) fn of(n: i64, mut given: impl Iterator<Item = (i64, i64)>) -> Tally {
    let mut counts = Tested::new(n);
    for right in (0..n - 1).flat_map(|a| (a + 1..n).map(move |b| (a, b))) {
        let pair = given.next().unwrap_or((-1, -1));
        if pair != right {
            counts.wrong += 1;
            counts.worst_row = counts.worst_row.max(pair.0.abs_diff(right.0));
        }
        counts.mark_one(tested(pair, n));
    }
    let (tally, more) = (counts.tally(), given.count() as u64);
    Tally { wrong: tally.wrong + more, doubled: tally.doubled + more, ..tally }
}

/// Counts at the ends of all rows, and at indices in between.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sample {
    /// First and last indices of rows.
    pub ends: u64,
    /// Those that give another pair, or none.
    pub wrong_ends: u64,
    /// Indices in between.
    pub inner: u64,
    /// Those that give another pair, or none.
    pub wrong_inner: u64,
    /// By how many rows the worst is off.
    pub worst_row: u64,
}

/// The ends of all rows of `n` boxes, and these indices: as it is, by the rules, by integers.
pub(super) fn some<R: Root>(n: i64, indices: &[i64]) -> [Sample; 3] {
    [sampled::<R, AsItIs>(n, indices), sampled::<R, Rules>(n, indices), sampled::<R, Integers>(n, indices)]
}

fn sampled<R: Root, C: Correction>(n: i64, indices: &[i64]) -> Sample {
    let mut sample = Sample { ends: 2 * (n as u64 - 1), inner: indices.len() as u64, ..Sample::default() };
    let mut is_wrong = |k: i64, row: i64| {
        let (a, b) = C::pair(R::row(2 * n - 1, discriminant(k, n)), k, n);
        let wrong = (a, b) != AsItIs::pair(row, k, n);
        if wrong {
            sample.worst_row = sample.worst_row.max(a.abs_diff(row));
        }
        u64::from(wrong)
    };
    let ends = |row| [row_start(row, n), row_start(row + 1, n) - 1];
    let wrong_ends = (0..n - 1).flat_map(|row| ends(row).map(|k| (k, row)));
    let wrong_ends = wrong_ends.map(|(k, row)| is_wrong(k, row)).sum();
    let wrong_inner = indices.iter().map(|&k| is_wrong(k, super::correct::searched_row(k, n))).sum();
    Sample { wrong_ends, wrong_inner, ..sample }
}

#[cfg(test)]
mod tests {
    use super::super::{CARMACK, Double, Newton, Printed, Single};
    use super::*;
    use std::collections::BTreeMap;

    /// Returns the counts from a list of the pair of each index.
    fn slowly<R: Root, C: Correction>(n: i64) -> Tally {
        let mut given = BTreeMap::<_, u64>::new();
        let mut tally = Tally { pairs: pairs_of(n) as u64, ..Tally::default() };
        for k in 0..pairs_of(n) {
            let row = super::super::correct::searched_row(k, n);
            let pair = C::pair(R::row(2 * n - 1, discriminant(k, n)), k, n);
            let wrong = pair != AsItIs::pair(row, k, n);
            tally.wrong += u64::from(wrong);
            tally.worst_row = tally.worst_row.max(pair.0.abs_diff(row));
            *given.entry((pair.0.min(pair.1), pair.0.max(pair.1))).or_default() += 1;
        }
        given.retain(|&(a, b), _| 0 <= a && a < b && b < n);
        tally.missed = tally.pairs - given.len() as u64;
        tally.doubled = given.values().map(|times| times - 1).sum();
        tally.none = tally.pairs - given.values().sum::<u64>();
        tally
    }

    /// Rows off by three, and no others: rules leave pairs that nobody gives, and indices that give none.
    struct OffByThree;

    impl Root for OffByThree {
        fn row(m: i64, x: i64) -> i64 {
            Double::row(m, x) + 3
        }
        fn worst_relative() -> f64 {
            1.0
        }
    }

    #[test]
    fn counts_are_those_of_a_list_of_all_pairs() {
        fn check<R: Root>(n: i64) {
            let slow = [slowly::<R, AsItIs>(n), slowly::<R, Rules>(n), slowly::<R, Integers>(n)];
            assert_eq!(all::<R>(n), slow, "n {n}");
        }
        for n in (2..50).chain([300]) {
            check::<Newton<CARMACK, 1>>(n);
            check::<Newton<CARMACK, 2>>(n);
            check::<Single>(n);
            check::<OffByThree>(n);
            check::<Printed>(n);
        }
        let [as_it_is, rules, integers] = all::<OffByThree>(50);
        assert!(as_it_is.wrong == as_it_is.pairs && as_it_is.worst_row == 3 && as_it_is.missed > 0);
        assert!(rules.missed > 0 && integers.wrong == 0);
    }

    #[test]
    fn an_f32_root_is_first_wrong_by_one_row() {
        // An f32 root is monotone, so that the ends of rows tell of all indices.
        let first = (2..5000).find(|&n| some::<Single>(n, &[])[0].wrong_ends > 0).expect("a wrong pair");
        assert_eq!(first, 4098);
        assert_eq!(all::<Single>(first - 1)[0].wrong, 0);
        let [as_it_is, rules, _] = all::<Single>(first);
        assert!(as_it_is.wrong > 0 && as_it_is.worst_row == 1, "{as_it_is:?}");
        assert_eq!(rules.wrong, 0, "one row off is what the rules mend");
    }
}
