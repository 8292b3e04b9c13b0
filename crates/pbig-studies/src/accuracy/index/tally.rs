//! The ways, and counts of their wrong, missed and doubled pairs.

use crate::index::*;
use std::ops::{AddAssign, Range};

/// A way to estimate the row.
#[derive(Clone, Copy)]
pub(super) struct Way {
    pub(super) name: &'static str,
    /// True for ways that must be right by themselves. They are slower, so fewer pairs are looked at.
    pub(super) is_exact: bool,
    pub(super) row: fn(i64, i64) -> i64,
    pub(super) worst_relative: fn() -> f64,
    /// Counts all pairs of boxes; also gets the largest relative error.
    pub(super) all: fn(i64, f64) -> [Tally; 3],
    /// Computes the pairs of ranges of indices, for the time of each correction.
    pub(super) passes: [fn(i64, &[Block]) -> i64; 3],
}

/// The corrections, in the order of [`CORRECTIONS`].
pub(super) const CORRECT: [fn(i64, i64, i64) -> Given; 3] = [AsItIs::pair, Rules::pair, Integers::pair];

/// Consecutive indices: the first, and their number.
pub(super) type Block = (i64, i64);

const fn way<R: Root>(name: &'static str) -> Way {
    let passes = [pass::<R, AsItIs>, pass::<R, Rules>, pass::<R, Integers>];
    let (row, worst_relative, all) = (R::row, R::worst_relative, all_pairs::<R>);
    Way { name, is_exact: false, row, worst_relative, all, passes }
}

const fn exact<R: Root>(name: &'static str) -> Way {
    Way { is_exact: true, ..way::<R>(name) }
}

pub(super) const WAYS: [Way; 14] = [
    way::<Single>("f32 sqrt"),
    way::<Double>("f64 sqrt"),
    way::<Newton<CARMACK, 1>>("Carmack 1"),
    way::<Newton<CARMACK, 2>>("Carmack 2"),
    way::<Newton<CARMACK, 3>>("Carmack 3"),
    way::<Newton<CARMACK, 4>>("Carmack 4"),
    way::<Newton<LOMONT, 1>>("Lomont 1"),
    way::<Newton<LOMONT, 2>>("Lomont 2"),
    way::<Newton<LOMONT, 3>>("Lomont 3"),
    way::<Newton<LOMONT, 4>>("Lomont 4"),
    way::<AllSingle>("all in f32"),
    way::<Printed>("as printed, in f32"),
    exact::<Bisection>("bisection over rows"),
    exact::<IntegerRoot>("integer root"),
];

/// Returns a sum that depends on every pair, so that none is optimised away.
fn pass<R: Root, C: Correction>(n: i64, blocks: &[Block]) -> i64 {
    sum(blocks, |k| C::pair(R::row(2 * n - 1, discriminant(k, n)), k, n))
}

/// Returns the pairs that identifiers of the lazy way give, and such a sum.
pub(super) fn lazy_pass(n: i64, blocks: &[Block]) -> (i64, i64) {
    let mut pairs = 0;
    let sum = sum(blocks, |id| {
        let pair = lazy_pair(id, n);
        pairs += i64::from(pair.is_some());
        pair.unwrap_or((0, 0))
    });
    (pairs, sum)
}

#[inline(always)]
fn sum(blocks: &[Block], mut pair: impl FnMut(i64) -> Given) -> i64 {
    let all = blocks.iter().flat_map(|&(first, count)| first..first + count);
    all.fold(0, |sum, k| {
        let (a, b) = pair(k);
        sum.wrapping_add(a ^ (b << 20))
    })
}

/// Counts of right and wrong indices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tally {
    pub(super) looked: u64,
    /// Indices that give anything but their pair, the lesser box first.
    pub(super) wrong: u64,
    /// The number of rows by which the worst is off.
    pub(super) worst_row: u64,
    /// Indices that give no pair: a box and itself, or a box that does not exist.
    pub(super) none: u64,
    /// Pairs that no index gives, whichever box comes first. As many indices give no pair, or one that another index gives.
    pub(super) missed: u64,
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.looked += other.looked;
        self.wrong += other.wrong;
        self.worst_row = self.worst_row.max(other.worst_row);
        self.none += other.none;
        self.missed += other.missed;
    }
}

/// Counts all pairs of `n >= 2` boxes, by a root whose relative error is at most `error`.
fn all_pairs<R: Root>(n: i64, error: f64) -> [Tally; 3] {
    let tally = Tally { looked: pairs_of(n) as u64, ..Tally::default() };
    let mut all = All { n, tallies: [tally; 3], marks: vec![0; pairs_of(n) as usize] };
    for row in 0..n - 1 {
        let [first, last] = ends(row, n);
        let near = indices_near_an_end(row, n, error);
        for indices in [first..first + near, last + 1 - near.min(last + 1 - first - near)..last + 1] {
            all.add_row::<R>(row, indices);
        }
    }
    all.counted()
}

/// Returns how many indices at each end of a row may have a wrong estimate; those between have a right one. The exact root goes
/// from `2 w + 1` down to `2 w - 1` in a row of `w` pairs. Rounding the number under the root and the difference adds some 2^-24.
fn indices_near_an_end(row: i64, n: i64, error: f64) -> i64 {
    let (pairs, ulp) = (n - 1 - row, f64::from(f32::EPSILON));
    let half_root = pairs as f64 + 0.5;
    let rows = half_root * (error + ulp) + n as f64 * ulp;
    ((rows * half_root) as i64).saturating_add(2).min(pairs)
}

/// Counts of all pairs while they are made.
///
/// A right index marks its own pair, and a right estimate is right by every correction. So only the pairs that wrong ones give
/// are marked: bit `c` of a mark says that the index is wrong by correction `c`, bit `4 + c` that a wrong index gives its pair.
struct All {
    n: i64,
    tallies: [Tally; 3],
    marks: Vec<u8>,
}

impl All {
    /// Adds some indices of a row, by runs of equal estimates.
    fn add_row<R: Root>(&mut self, row: i64, indices: Range<i64>) {
        let mut first = indices.start;
        let estimates: Vec<i64> = indices.map(|k| R::row(2 * self.n - 1, discriminant(k, self.n))).collect();
        for run in estimates.chunk_by(PartialEq::eq) {
            let last = first + run.len() as i64 - 1;
            if run[0] != row {
                (0..3).for_each(|c| self.add_run(c, row, run[0], [first, last]));
            }
            first = last + 1;
        }
    }

    /// Adds indices of one wrong estimate. If a correction gives the first and the last in one row, it gives all between in it.
    fn add_run(&mut self, c: usize, row: i64, estimate: i64, [first, last]: [i64; 2]) {
        let [start, end] = [first, last].map(|k| CORRECT[c](estimate, k, self.n));
        if start.0 != end.0 {
            let middle = first.midpoint(last);
            self.add_run(c, row, estimate, [first, middle]);
            self.add_run(c, row, estimate, [middle + 1, last]);
        } else if start != AsItIs::pair(row, first, self.n) {
            let tally = &mut self.tallies[c];
            tally.wrong += (last - first + 1) as u64;
            tally.worst_row = tally.worst_row.max(start.0.abs_diff(row));
            self.marks[first as usize..=last as usize].iter_mut().for_each(|mark| *mark |= 1 << c);
            for column in start.1..=end.1 {
                match index_of((start.0, column), self.n) {
                    Some(index) => self.marks[index] |= 16 << c,
                    None => tally.none += 1,
                }
            }
        }
    }

    fn counted(mut self) -> [Tally; 3] {
        for (c, tally) in self.tallies.iter_mut().enumerate().filter(|(_, tally)| tally.wrong > 0) {
            tally.missed = self.marks.iter().filter(|mark| **mark >> c & 17 == 1).count() as u64;
        }
        self.tallies
    }
}

/// Returns the index of the pair that is tested: (1, 0) tests 0 and 1, as (0, 1) does.
fn index_of((a, b): Given, n: i64) -> Option<usize> {
    let (a, b) = (a.min(b), a.max(b));
    (0 <= a && a < b && b < n).then(|| (row_start(a, n) + b - a - 1) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Rows off by three: rules leave pairs that no index gives, and indices that give none.
    struct OffByThree;

    impl Root for OffByThree {
        fn row(m: i64, x: i64) -> i64 {
            Double::row(m, x) + 3
        }
    }

    /// Counts from a list of the pairs that all indices give.
    fn slowly(way: &Way, c: usize, n: i64) -> Tally {
        let (mut given, mut tally) = (BTreeMap::<_, u64>::new(), Tally::default());
        for k in 0..pairs_of(n) {
            let pair = CORRECT[c]((way.row)(2 * n - 1, discriminant(k, n)), k, n);
            let right = AsItIs::pair(row_by_bisection(k, n), k, n);
            tally.wrong += u64::from(pair != right);
            tally.worst_row = tally.worst_row.max(pair.0.abs_diff(right.0) * u64::from(pair != right));
            *given.entry((pair.0.min(pair.1), pair.0.max(pair.1))).or_default() += 1;
        }
        given.retain(|&(a, b), _| 0 <= a && a < b && b < n);
        let pairs = pairs_of(n) as u64;
        let (missed, none) = (pairs - given.len() as u64, pairs - given.values().sum::<u64>());
        Tally { looked: pairs, missed, none, ..tally }
    }

    #[test]
    fn counts_are_those_of_a_list_of_all_pairs() {
        let planted = way::<OffByThree>("off by three");
        for way in WAYS.into_iter().chain([planted]) {
            let error = (way.worst_relative)();
            for n in (2..50).chain([300]) {
                assert_eq!((way.all)(n, error), [0, 1, 2].map(|c| slowly(&way, c, n)), "{}, n {n}", way.name);
            }
        }
        let [as_it_is, rules, integers] = (planted.all)(50, f64::INFINITY);
        assert!(as_it_is.wrong == as_it_is.looked && as_it_is.worst_row == 3 && as_it_is.missed > 0);
        assert!(rules.missed > 0 && integers.wrong == 0);
    }

    #[test]
    fn an_f32_root_is_first_wrong_by_one_row_which_the_rules_mend() {
        let count = |n| (WAYS[0].all)(n, Single::worst_relative());
        let [as_it_is, rules, _] = count(4098);
        assert!(as_it_is.wrong > 0 && as_it_is.worst_row == 1 && rules.wrong == 0, "{as_it_is:?}");
        assert_eq!(count(4097)[0].wrong, 0);
        assert_eq!((WAYS[0].all)(4098, f64::INFINITY), count(4098), "none is wrong that is not near an end");
    }
}
