//! The ways, and counts of their wrong, missed and doubled pairs.

use crate::index::*;
use std::ops::AddAssign;
use std::sync::LazyLock;

/// A way to estimate the row.
pub(super) struct RootWay {
    pub(super) name: &'static str,
    /// True for ways that must be right by themselves. They are slower, so fewer pairs are looked at.
    pub(super) is_exact: bool,
    /// The largest relative error of the root.
    pub(super) error: f64,
    pub(super) row: Box<dyn Fn(i64, i64) -> i64 + Send + Sync>,
    /// Counts all pairs of `n` boxes.
    pub(super) all: Box<dyn Fn(i64) -> [Tally; 3] + Send + Sync>,
    /// Compute the pairs of ranges of indices, for the time of each correction.
    pub(super) passes: [Pass; 3],
}

impl RootWay {
    /// Returns true for a root with one Newton step: its error of 0.0018 makes most pairs of thousands of boxes wrong.
    pub(super) fn is_coarse(&self) -> bool {
        (1e-3..1.0).contains(&self.error)
    }
}

/// Computes a sum that depends on every pair, so that none is optimised away.
type Pass = Box<dyn Fn(i64, &[Block]) -> i64 + Send + Sync>;

/// A correction: the pair from a row, the index and the number of boxes.
type Correct = fn(i64, i64, i64) -> Given;

/// The corrections, in the order of [`CORRECTIONS`].
pub(super) const CORRECT: [Correct; 3] = [as_it_is, rules, integers];

/// Consecutive indices: the first, and their number.
pub(super) type Block = (i64, i64);

fn way(name: &'static str, error: f64, row: impl RowEstimate) -> RootWay {
    let passes = [pass(row, as_it_is), pass(row, rules), pass(row, integers)];
    let all = Box::new(move |n| all_pairs(row, n, error));
    RootWay { name, is_exact: false, error, row: Box::new(row), all, passes }
}

fn pass(row: impl RowEstimate, correct: impl Fn(i64, i64, i64) -> Given + Send + Sync + 'static) -> Pass {
    Box::new(move |n, blocks| sum(blocks, |k| correct(row(k, n), k, n)))
}

fn by_root(name: &'static str, root: impl Fn(f32) -> f32 + Copy + Send + Sync + 'static) -> RootWay {
    way(name, worst_relative(root), row_by(root))
}

fn exact(name: &'static str, row: impl RowEstimate) -> RootWay {
    RootWay { is_exact: true, ..way(name, f64::INFINITY, row) }
}

pub(super) static WAYS: LazyLock<[RootWay; 14]> = LazyLock::new(|| {
    [
        by_root("f32 sqrt", f32::sqrt),
        way("f64 sqrt", f64::EPSILON, row_in_f64),
        by_root("Carmack 1", newton::<CARMACK, 1, false>),
        by_root("Carmack 2", newton::<CARMACK, 2, false>),
        by_root("Carmack 3", newton::<CARMACK, 3, false>),
        by_root("Carmack 4", newton::<CARMACK, 4, false>),
        by_root("Lomont 1", newton::<LOMONT, 1, false>),
        by_root("Lomont 2", newton::<LOMONT, 2, false>),
        by_root("Lomont 3", newton::<LOMONT, 3, false>),
        by_root("Lomont 4", newton::<LOMONT, 4, false>),
        way("all in f32", f64::INFINITY, row_all_in_f32),
        way("as printed, in f32", f64::INFINITY, row_as_printed),
        exact("bisection over rows", row_by_bisection),
        exact("integer root", row_by_integer_root),
    ]
});

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

impl Tally {
    /// Counts the pair that correction `c` gives for an index whose estimate is wrong.
    fn add(&mut self, c: usize, given: Given, (row, k, n): (i64, i64, i64), marks: &mut [u8]) {
        if given == as_it_is(row, k, n) {
            return;
        }
        self.wrong += 1;
        self.worst_row = self.worst_row.max(given.0.abs_diff(row));
        marks[k as usize] |= 1 << c;
        match index_of(given, n) {
            Some(index) => marks[index] |= 16 << c,
            None => self.none += 1,
        }
    }
}

/// Counts all pairs of `n >= 2` boxes, by a root whose relative error is at most `error`.
///
/// A right estimate is right by every correction, and its index marks its own pair. So only wrong ones mark pairs: bit `c` of a mark
/// says that the index is wrong by correction `c`, bit `4 + c` that a wrong index gives its pair.
fn all_pairs(estimate: impl RowEstimate, n: i64, error: f64) -> [Tally; 3] {
    let mut tallies = [Tally { looked: pairs_of(n) as u64, ..Tally::default() }; 3];
    let mut marks = vec![0u8; pairs_of(n) as usize];
    for row in 0..n - 1 {
        let [first, last] = ends(row, n);
        let near = indices_near_an_end(row, n, error);
        let indices = (first..first + near).chain((last + 1 - near).max(first + near)..=last);
        let estimates = indices.map(|k| (k, estimate(k, n)));
        for (k, wrong) in estimates.filter(|(_, estimate)| *estimate != row) {
            for (c, tally) in tallies.iter_mut().enumerate() {
                tally.add(c, CORRECT[c](wrong, k, n), (row, k, n), &mut marks);
            }
        }
    }
    for (c, tally) in tallies.iter_mut().enumerate().filter(|(_, tally)| tally.wrong > 0) {
        tally.missed = marks.iter().filter(|mark| **mark >> c & 17 == 1).count() as u64;
    }
    tallies
}

/// Returns how many indices at each end of a row may have a wrong estimate; those between have a right one. The exact root goes
/// from `2 w + 1` down to `2 w - 1` in a row of `w` pairs. Rounding the number under the root and the difference adds some 2^-24.
fn indices_near_an_end(row: i64, n: i64, error: f64) -> i64 {
    let (pairs, ulp) = (n - 1 - row, f64::from(f32::EPSILON));
    let half_root = pairs as f64 + 0.5;
    let rows = half_root * (error + ulp) + n as f64 * ulp;
    ((rows * half_root) as i64).saturating_add(2).min(pairs)
}

/// Returns the index of the pair that is tested: (1, 0) tests 0 and 1, as (0, 1) does.
fn index_of((a, b): Given, n: i64) -> Option<usize> {
    let (a, b) = (a.min(b), a.max(b));
    (0 <= a && a < b && b < n).then(|| (row_start(a, n) + b - a - 1) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_by_hand() {
        let planted = |by: i64| way("planted", f64::INFINITY, move |k, n| row_by_bisection(k, n) + by);
        // A row too far, the six indices of four boxes give (1, -1), (1, 0), (1, 1), (2, 1), (2, 2) and (3, 3).
        let right = Tally { looked: 6, ..Tally::default() };
        let wrong = Tally { wrong: 6, worst_row: 1, none: 4, missed: 4, ..right };
        assert_eq!((planted(1).all)(4), [wrong, right, right]);
        // By three, rules leave pairs that no index gives, and indices that give none.
        let [as_it_is, rules, integers] = (planted(3).all)(50);
        assert!(as_it_is.wrong == as_it_is.looked && as_it_is.worst_row == 3 && as_it_is.missed > 0);
        assert!(rules.missed > 0 && integers.wrong == 0);
    }

    #[test]
    fn no_wrong_estimate_is_far_from_the_ends_of_its_row() {
        for way in WAYS.iter().filter(|way| way.error < 1.0) {
            let looked_at_all = all_pairs(&way.row, 700, f64::INFINITY);
            assert_eq!((way.all)(700), looked_at_all, "{}", way.name);
        }
    }

    #[test]
    fn an_f32_root_is_first_wrong_by_one_row_which_the_rules_mend() {
        let [as_it_is, rules, _] = (WAYS[0].all)(4098);
        assert!(as_it_is.wrong > 0 && as_it_is.worst_row == 1 && rules.wrong == 0, "{as_it_is:?}");
        assert_eq!((WAYS[0].all)(4097)[0].wrong, 0);
    }
}
