//! The ways, and counts of their wrong, missed and doubled pairs.

use crate::index::*;
use std::ops::AddAssign;

/// A way to estimate the row.
#[derive(Clone, Copy)]
pub(super) struct Way {
    pub(super) name: &'static str,
    /// The kernels' number of the root (`GpuOptions::root`).
    pub(super) kernel: Option<u32>,
    /// True for ways that must be right by themselves. They are slower, so fewer pairs are looked at.
    pub(super) is_exact: bool,
    pub(super) row: fn(i64, i64) -> i64,
    pub(super) worst_relative: fn() -> f64,
    pub(super) all: fn(i64) -> [Tally; 3],
    /// Computes the pairs of ranges of indices, for the time of each correction.
    pub(super) passes: [fn(i64, &[Block]) -> i64; 3],
}

/// Consecutive indices: the first, and their number.
pub(super) type Block = (i64, i64);

const fn way<R: Root>(name: &'static str, kernel: Option<u32>) -> Way {
    let passes = [pass::<R, AsItIs>, pass::<R, Rules>, pass::<R, Integers>];
    let (row, worst_relative, all) = (R::row, R::worst_relative, all_pairs::<R>);
    Way { name, kernel, is_exact: false, row, worst_relative, all, passes }
}

const fn exact<R: Root>(name: &'static str, kernel: Option<u32>) -> Way {
    Way { is_exact: true, ..way::<R>(name, kernel) }
}

pub(super) const WAYS: [Way; 14] = [
    way::<Single>("f32 sqrt", Some(0)),
    way::<Double>("f64 sqrt", None),
    way::<Newton<CARMACK, 1>>("Carmack 1", Some(1)),
    way::<Newton<CARMACK, 2>>("Carmack 2", Some(2)),
    way::<Newton<CARMACK, 3>>("Carmack 3", Some(3)),
    way::<Newton<CARMACK, 4>>("Carmack 4", Some(4)),
    way::<Newton<LOMONT, 1>>("Lomont 1", Some(5)),
    way::<Newton<LOMONT, 2>>("Lomont 2", Some(6)),
    way::<Newton<LOMONT, 3>>("Lomont 3", Some(7)),
    way::<Newton<LOMONT, 4>>("Lomont 4", Some(8)),
    way::<AllSingle>("all in f32", None),
    way::<Printed>("as printed, in f32", None),
    exact::<Bisection>("bisection over rows", Some(9)),
    exact::<IntegerRoot>("integer root", None),
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

impl Tally {
    /// Notes the pair that an index gives; returns true if it is wrong.
    pub(super) fn note(&mut self, given: Given, right: Given) -> bool {
        if given != right {
            self.wrong += 1;
            self.worst_row = self.worst_row.max(given.0.abs_diff(right.0));
        }
        given != right
    }
}

pub(super) fn corrected(estimate: i64, k: i64, n: i64) -> [Given; 3] {
    [AsItIs::pair(estimate, k, n), Rules::pair(estimate, k, n), Integers::pair(estimate, k, n)]
}

/// Counts all pairs of `n >= 2` boxes.
///
/// A right index marks its own pair, and a right estimate is right by every correction. So only the pairs that wrong ones give
/// are marked: bit `c` of a mark says that the index is wrong by correction `c`, bit `4 + c` that a wrong index gives its pair.
fn all_pairs<R: Root>(n: i64) -> [Tally; 3] {
    let mut tallies = [Tally { looked: pairs_of(n) as u64, ..Tally::default() }; 3];
    let mut marks = vec![0u8; pairs_of(n) as usize];
    for row in 0..n - 1 {
        for k in row_start(row, n)..row_start(row + 1, n) {
            let estimate = R::row(2 * n - 1, discriminant(k, n));
            if estimate != row {
                let right = AsItIs::pair(row, k, n);
                for (c, given) in corrected(estimate, k, n).into_iter().enumerate() {
                    if tallies[c].note(given, right) {
                        marks[k as usize] |= 1 << c;
                        match index_of(given, n) {
                            Some(index) => marks[index] |= 16 << c,
                            None => tallies[c].none += 1,
                        }
                    }
                }
            }
        }
    }
    for (c, tally) in tallies.iter_mut().enumerate().filter(|(_, tally)| tally.wrong > 0) {
        tally.missed = marks.iter().filter(|mark| **mark >> c & 17 == 1).count() as u64;
    }
    tallies
}

/// Returns the index of the pair that is tested: (1, 0) tests 0 and 1, as (0, 1) does.
fn index_of((a, b): Given, n: i64) -> Option<usize> {
    let (a, b) = (a.min(b), a.max(b));
    (0 <= a && a < b && b < n).then(|| (row_start(a, n) + b - a - 1) as usize)
}

/// Counts both ends of all rows, where a monotone estimate is farthest from its row.
pub(super) fn at_ends(way: &Way, n: i64) -> [Tally; 3] {
    at(way, n, (0..n - 1).flat_map(|a| ends(a, n).map(|k| (k, a))))
}

/// Counts some indices, each given with its row.
pub(super) fn at(way: &Way, n: i64, indices: impl Iterator<Item = (i64, i64)>) -> [Tally; 3] {
    let mut tallies = [Tally::default(); 3];
    for (k, row) in indices {
        let given = corrected((way.row)(2 * n - 1, discriminant(k, n)), k, n);
        for (tally, given) in tallies.iter_mut().zip(given) {
            tally.looked += 1;
            tally.note(given, AsItIs::pair(row, k, n));
        }
    }
    tallies
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
            let pair = corrected((way.row)(2 * n - 1, discriminant(k, n)), k, n)[c];
            tally.note(pair, AsItIs::pair(row_by_bisection(k, n), k, n));
            *given.entry((pair.0.min(pair.1), pair.0.max(pair.1))).or_default() += 1;
        }
        given.retain(|&(a, b), _| 0 <= a && a < b && b < n);
        let pairs = pairs_of(n) as u64;
        let (missed, none) = (pairs - given.len() as u64, pairs - given.values().sum::<u64>());
        Tally { looked: pairs, missed, none, ..tally }
    }

    #[test]
    fn counts_are_those_of_a_list_of_all_pairs() {
        let planted = way::<OffByThree>("off by three", None);
        for way in WAYS.into_iter().chain([planted]) {
            for n in (2..50).chain([300]) {
                assert_eq!((way.all)(n), [0, 1, 2].map(|c| slowly(&way, c, n)), "{}, n {n}", way.name);
            }
        }
        let [as_it_is, rules, integers] = (planted.all)(50);
        assert!(as_it_is.wrong == as_it_is.looked && as_it_is.worst_row == 3 && as_it_is.missed > 0);
        assert!(rules.missed > 0 && integers.wrong == 0);
    }

    #[test]
    fn an_f32_root_is_first_wrong_by_one_row_which_the_rules_mend() {
        let first = (2..5000).find(|&n| at_ends(&WAYS[0], n)[0].wrong > 0);
        assert_eq!((first, (WAYS[0].all)(4097)[0].wrong), (Some(4098), 0));
        let [as_it_is, rules, _] = (WAYS[0].all)(4098);
        assert!(as_it_is.wrong > 0 && as_it_is.worst_row == 1 && rules.wrong == 0, "{as_it_is:?}");
    }
}
