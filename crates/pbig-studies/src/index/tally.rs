//! Counts of wrong, missed and doubled pairs.

use super::{AsItIs, Correction, Integers, Root, Rules, discriminant, pairs_of, row_start};
use std::ops::AddAssign;

/// The most boxes whose pairs are all looked at: as far as `(2n - 1)^2` is below 2^30.
pub const MOST_EXHAUSTIVE: i64 = 16_384;

/// Estimates looked at together; only blocks with a wrong one are looked at one by one. (Of 128, that was most of the
/// time.)
const BLOCK: i64 = 32;

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

/// An index whose row is estimated wrong.
struct Wrong {
    k: u32,
    estimate: i32,
    row: i32,
}

/// All pairs of `n` boxes, `2 <= n <= MOST_EXHAUSTIVE`: as it is, by the rules, by integers.
pub(super) fn all<R: Root>(n: i64) -> [Tally; 3] {
    debug_assert!((2..=MOST_EXHAUSTIVE).contains(&n));
    let wrong = wrong_rows::<R>(n);
    [judged::<AsItIs>(n, &wrong), judged::<Rules>(n, &wrong), judged::<Integers>(n, &wrong)]
}

fn wrong_rows<R: Root>(n: i64) -> Vec<Wrong> {
    let mut wrong = Vec::new();
    for row in 0..n - 1 {
        let (start, end) = (row_start(row, n), row_start(row + 1, n));
        let mut first = start;
        while first < end {
            let count = BLOCK.min(end - first);
            if wrong_in_block::<R>(n as i32, row as i32, first as i32, count as i32) > 0 {
                wrong.extend((first..first + count).filter_map(|k| wrong_at::<R>(n, row, k)));
            }
            first += count;
        }
    }
    wrong
}

/// Without branches, so that several are computed at once: all pairs of all n up to 5,000 are 2 * 10^10.
fn wrong_in_block<R: Root>(n: i32, row: i32, first: i32, count: i32) -> u32 {
    let m = 2 * n - 1;
    let x = m * m - 8 * first;
    (0..count).map(|i| u32::from(!R::lies_in(row, m, x - 8 * i))).sum()
}

fn wrong_at<R: Root>(n: i64, row: i64, k: i64) -> Option<Wrong> {
    let estimate = R::row(2 * n - 1, discriminant(k, n));
    (estimate != row).then_some(Wrong { k: k as u32, estimate: estimate as i32, row: row as i32 })
}

/// Counts the errors that a correction leaves.
fn judged<C: Correction>(n: i64, wrong: &[Wrong]) -> Tally {
    let mut left = Left::new(n);
    for w in wrong {
        let (k, row) = (i64::from(w.k), i64::from(w.row));
        left.note(k, AsItIs::pair(row, k, n), C::pair(w.estimate.into(), k, n));
    }
    left.tally()
}

/// Counts pairs given one by one, in the order of all pairs of `n >= 2` boxes.
pub fn of(n: i64, mut given: impl Iterator<Item = (i64, i64)>) -> Tally {
    let mut left = Left::new(n);
    let pairs = (0..n - 1).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    for (k, pair) in (0..).zip(pairs) {
        left.note(k, pair, given.next().unwrap_or((-1, -1)));
    }
    let tally = left.tally();
    let more = given.count() as u64;
    Tally { wrong: tally.wrong + more, doubled: tally.doubled + more, ..tally }
}

/// Wrong indices, each with the index of the pair that it gives, if it gives one.
struct Left {
    n: i64,
    worst_row: u64,
    wrong: Vec<(i64, Option<i64>)>,
}

impl Left {
    fn new(n: i64) -> Self {
        Self { n, worst_row: 0, wrong: Vec::new() }
    }

    fn note(&mut self, k: i64, right: (i64, i64), given: (i64, i64)) {
        if given != right {
            self.worst_row = self.worst_row.max(given.0.abs_diff(right.0));
            self.wrong.push((k, tested(given, self.n)));
        }
    }

    /// An index that is right tests its own pair, so a pair is missed when its index is wrong and no wrong index
    /// tests it.
    fn tally(&self) -> Tally {
        let (pairs, wrong) = (pairs_of(self.n) as u64, self.wrong.len() as u64);
        let missed = missed(&self.wrong, pairs);
        let none = self.wrong.iter().filter(|(_, given)| given.is_none()).count() as u64;
        // There are as many indices as pairs: those missed have theirs on no pair, or on one that another tests.
        Tally { pairs, wrong, worst_row: self.worst_row, missed, doubled: missed - none, none }
    }
}

/// The index of the pair that is tested: (1, 0) tests 0 and 1, as (0, 1) does.
pub(super) fn tested((a, b): (i64, i64), n: i64) -> Option<i64> {
    let (a, b) = (a.min(b), a.max(b));
    (0 <= a && a < b && b < n).then(|| row_start(a, n) + b - a - 1)
}

/// Returns the number of pairs of wrong indices that no wrong index gives.
fn missed(left: &[(i64, Option<i64>)], pairs: u64) -> u64 {
    if left.is_empty() {
        return 0;
    }
    let mut is_given = vec![0u64; pairs.div_ceil(64) as usize];
    for given in left.iter().filter_map(|(_, given)| *given) {
        is_given[(given / 64) as usize] |= 1 << (given % 64);
    }
    let is_missed = |k: i64| is_given[(k / 64) as usize] >> (k % 64) & 1 == 0;
    left.iter().filter(|(k, _)| is_missed(*k)).count() as u64
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
    use super::super::{CARMACK, Double, Newton, Single};
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
        fn lies_in(_: i32, _: i32, _: i32) -> bool {
            false
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
