//! Run time against error of the way from the index of a pair to the pair (Avril 3.2 and 3.3): every root, every correction.

mod paper;

use crate::index::*;
use pbig_harness::chart::{Chart, Line};
use pbig_harness::prelude::*;
use rayon::prelude::*;
use std::hint::black_box;
use std::sync::LazyLock;
use std::time::Duration;

/// Makes the study, of small sizes if it is to be quick. Fails if a pair that must be right is wrong.
pub fn run(quick: bool) -> Result<BenchReport, Failure> {
    let columns = "boxes | root | as_it_is_ns_per_pair | by_the_rules_ns_per_pair | by_integers_ns_per_pair";
    let (errors, mut times) = (errors(quick)?, Table::new("times", columns));
    let sizes = if quick { &[1000, 1 << 20][..] } else { &[1000, 5000, 10_000, 100_000, 1 << 20] };
    sizes.iter().try_for_each(|&n| add_times(n, quick, &mut times))?;
    let axes = ["time, ns per pair (one thread, 5,000 boxes)", "wrong pairs, % of all n looked at"];
    let lines = lines(&errors, &times);
    let chart = Chart::log("accuracy-index", "From the index of a pair to the pair", axes, lines);
    let tables = vec![errors, counterexamples(quick), times, paper::table_3(quick), paper::table_4(quick)];
    Ok(BenchReport { charts: vec![chart], ..BenchReport::new("accuracy-index", tables) })
}

/// A way to estimate the row. Loops are in its functions, so that they contain the root.
struct RootWay {
    name: &'static str,
    /// The largest relative error of the root.
    error: f64,
    row: Box<dyn Fn(i64, i64) -> i64 + Send + Sync>,
    /// Looks at all pairs of `n` boxes, by each correction.
    all: Box<dyn Fn(i64) -> [Wrong; 3] + Send + Sync>,
    /// Compute the pairs of ranges of indices, for the time of each correction.
    passes: [Pass; 3],
}

/// Computes a sum that depends on every pair, so that none is optimised away.
type Pass = Box<dyn Fn(i64, &[Block]) -> i64 + Send + Sync>;

/// Consecutive indices: the first, and their number.
type Block = (i64, i64);

fn way(name: &'static str, error: f64, row: impl RowEstimate) -> RootWay {
    let passes = [pass(row, as_it_is), pass(row, rules), pass(row, integers)];
    RootWay { name, error, row: Box::new(row), all: Box::new(move |n| all_pairs(row, n, error)), passes }
}

fn pass(row: impl RowEstimate, correct: impl Fn(i64, i64, i64) -> Given + Send + Sync + 'static) -> Pass {
    Box::new(move |n, blocks| sum(blocks, |k| correct(row(k, n), k, n)))
}

fn by_root(name: &'static str, root: impl Fn(f32) -> f32 + Copy + Send + Sync + 'static) -> RootWay {
    way(name, worst_relative(root), row_by(root))
}

static WAYS: LazyLock<[RootWay; 7]> = LazyLock::new(|| {
    [
        by_root("f32 sqrt", f32::sqrt),
        way("f64 sqrt", f64::EPSILON, row_in_f64),
        by_root("Carmack 1", newton::<1, false>),
        by_root("Carmack 2", newton::<2, false>),
        by_root("Carmack 3", newton::<3, false>),
        by_root("Carmack 4", newton::<4, false>),
        way("as printed, in f32", f64::INFINITY, row_as_printed),
    ]
});

/// The name of the way without a row.
const LAZY: &str = "lazy way";

#[inline(always)]
fn sum(blocks: &[Block], mut pair: impl FnMut(i64) -> Given) -> i64 {
    let all = blocks.iter().flat_map(|&(first, count)| first..first + count);
    all.fold(0, |sum, k| {
        let (a, b) = pair(k);
        sum.wrapping_add(a ^ (b << 20))
    })
}

/// Indices that give anything but their pair, the lesser box first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Wrong {
    count: u64,
    /// The number of rows by which the worst is off.
    worst_row: u64,
    /// The smallest number of boxes with one.
    first: Option<i64>,
}

impl Wrong {
    fn add(&mut self, other: Self) {
        self.count += other.count;
        self.worst_row = self.worst_row.max(other.worst_row);
        self.first = self.first.or(other.first);
    }
}

/// Looks at all pairs of `n >= 2` boxes, by a root whose relative error is at most `error`. A right estimate is right by every
/// correction.
fn all_pairs(estimate: impl RowEstimate, n: i64, error: f64) -> [Wrong; 3] {
    let mut all = [Wrong::default(); 3];
    for row in 0..n - 1 {
        let [first, last] = ends(row, n);
        let near = indices_near_an_end(row, n, error);
        let indices = (first..first + near).chain((last + 1 - near).max(first + near)..=last);
        let estimates = indices.map(|k| (k, estimate(k, n))).filter(|(_, estimate)| *estimate != row);
        for (k, estimate) in estimates {
            for (wrong, (_, correct)) in all.iter_mut().zip(CORRECTIONS) {
                let given = correct(estimate, k, n);
                if given != as_it_is(row, k, n) {
                    wrong.add(Wrong { count: 1, worst_row: given.0.abs_diff(row), first: Some(n) });
                }
            }
        }
    }
    all
}

/// Returns how many indices at each end of a row may have a wrong estimate; those between have a right one. The exact root goes
/// from `2 w + 1` down to `2 w - 1` in a row of `w` pairs. Rounding the number under the root and the difference adds some 2^-24.
fn indices_near_an_end(row: i64, n: i64, error: f64) -> i64 {
    let (pairs, ulp) = (n - 1 - row, f64::from(f32::EPSILON));
    let half_root = pairs as f64 + 0.5;
    let rows = half_root * (error + ulp) + n as f64 * ulp;
    ((rows * half_root) as i64).saturating_add(2).min(pairs)
}

/// Returns the numbers of boxes all of whose pairs are looked at: fewer for ways that are slow or mostly wrong.
fn boxes(has_few: bool, quick: bool) -> Vec<i64> {
    match (quick, has_few) {
        (true, false) => (2..=250).chain([1000]).collect(),
        (true, true) => (2..=100).chain([1000]).collect(),
        (false, false) => (2..=5000).collect(),
        (false, true) => (2..=700).chain((725..=5000).step_by(25)).collect(),
    }
}

/// Counts wrong indices of all pairs, for many n. After the correction by integers, and by the lazy way, nothing may be wrong.
fn errors(quick: bool) -> Result<Table, Failure> {
    let columns = "root | correction | largest_n | values_of_n | pairs | wrong | wrong_percent | first_wrong_n | worst_row";
    let mut table = Table::new("all_pairs", columns);
    let mut row = |name: &str, correction: &str, boxes: &[i64], wrong: Wrong| {
        let pairs: i64 = boxes.iter().map(|n| pairs_of(*n)).sum();
        let counts =
            cells![wrong.count, wrong.count as f64 / pairs as f64 * 100.0, wrong.first, wrong.worst_row];
        table.row(cells![name, correction, boxes.last().copied(), boxes.len(), pairs, ..counts]);
    };
    for way in WAYS.iter() {
        let boxes = boxes((1e-3..1.0).contains(&way.error), quick);
        let found: Vec<_> = boxes.par_iter().map(|&n| (way.all)(n)).collect();
        for (c, (correction, _)) in CORRECTIONS.into_iter().enumerate() {
            let mut wrong = Wrong::default();
            found.iter().for_each(|found| wrong.add(found[c]));
            check(c != 2 || wrong.count == 0, || {
                format!("{}: a pair is wrong by integers: {wrong:?}", way.name)
            })?;
            row(way.name, correction, &boxes, wrong);
        }
    }
    let boxes = boxes(true, quick);
    let wrong = boxes.par_iter().find_any(|n| !lazy_way_is_right(**n));
    check(wrong.is_none(), || format!("{LAZY}: a pair is wrong with this number of boxes: {wrong:?}"))?;
    row(LAZY, CORRECTIONS[0].0, &boxes, Wrong::default());
    Ok(table)
}

/// Returns true if the identifiers above the diagonal give every pair once, in order.
fn lazy_way_is_right(n: i64) -> bool {
    let all = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    (0..lazy_ids(n)).filter_map(|id| lazy_pair(id, n)).eq(all)
}

/// The smallest n for which the rules give a wrong pair at an end of a row.
fn counterexamples(quick: bool) -> Table {
    let mut table = Table::new("counterexamples", "root | searched_up_to | boxes | index | given | right");
    let most = if quick { 1 << 16 } else { 1 << 20 };
    let found: Vec<_> = WAYS.par_iter().map(|way| counterexample(way, most)).collect();
    for (way, found) in WAYS.iter().zip(found) {
        let at = found.map(|(n, row, k)| {
            cells![n, k, format!("{:?}", by_rules(way, n, k)), format!("{:?}", as_it_is(row, k, n))]
        });
        table.row(cells![way.name, most, ..at.unwrap_or_else(|| cells![(), (), "none"])]);
    }
    table
}

fn by_rules(way: &RootWay, n: i64, k: i64) -> Given {
    rules((way.row)(k, n), k, n)
}

/// Returns the smallest `n <= most <= 2^20` with its row and index. A root is wrong by more than one row only if it can be off by
/// more than 2; rounding to f32 adds an eighth at most. An index within a row could be wrong at an n a little smaller.
fn counterexample(way: &RootWay, most: i64) -> Option<(i64, i64, i64)> {
    let least = 1.875 / way.error;
    (((least / 2.0) as i64).max(2)..=most).find_map(|n| {
        // The root at the start of row `a` is `2n - 1 - 2a`.
        let rows = ((((2 * n - 1) as f64 - least) / 2.0).ceil() as i64 + 1).clamp(0, n - 1);
        let mut places = (0..rows).flat_map(|row| ends(row, n).map(|k| (n, row, k)));
        places.find(|&(n, row, k)| by_rules(way, n, k) != as_it_is(row, k, n))
    })
}

/// Returns 16 blocks of indices to time, evenly spread.
fn blocks(all: i64, count: i64) -> Vec<Block> {
    (0..16).map(|k| ((all - count) * k / 15, count)).collect()
}

/// Appends nanoseconds for a pair on one thread, by every way and correction in turn.
fn add_times(n: i64, quick: bool, table: &mut Table) -> Result<(), Failure> {
    let (pairs, ids) = (blocks(pairs_of(n), 2048), blocks(lazy_ids(n), 4096));
    let above_diagonal =
        |&(first, count): &Block| (first..first + count).filter(move |id| lazy_pair(*id, n).is_some());
    let counts = [pairs.len() * 2048, ids.iter().flat_map(above_diagonal).count()];
    let sides = 3 * WAYS.len() + 1;
    let rounds = if quick { 15 } else { 2 * sides };
    let effort = Effort { warm_up: 0, rounds, budget: Duration::from_secs(20) };
    let mut times = vec![vec![]; sides];
    measured(&mut times, sides, effort, unprepared, |times, side| {
        let (_, ms) = match WAYS.get(side / 3) {
            Some(way) => timed(|| black_box((way.passes[side % 3])(n, &pairs))),
            None => timed(|| black_box(sum(&ids, |id| lazy_pair(id, n).unwrap_or((0, 0))))),
        };
        times[side].push(ms * 1e6 / counts[usize::from(side + 1 == sides)] as f64);
        Ok(ms)
    })?;
    // Medians over all places in a round: there are too many places for a median of each.
    let ns: Vec<f64> = times.into_iter().map(|times| Spread::of(times).median).collect();
    for (way, ns) in WAYS.iter().zip(ns.chunks(3)) {
        table.row(cells![n, way.name, ns[0], ns[1], ns[2]]);
    }
    table.row(cells![n, LAZY, ns[sides - 1]]);
    Ok(())
}

/// Lines of the chart: the name, the ways that it joins, and the corrections.
const LINES: [(&str, &str, &[usize]); 5] = [
    ("f32 sqrt, each correction", "f32 sqrt", &[0, 1, 2]),
    ("f64 sqrt, each correction", "f64 sqrt", &[0, 1, 2]),
    ("Carmack, as it is", "Carmack", &[0]),
    ("Carmack, the paper's rules", "Carmack", &[1]),
    ("without an estimate", LAZY, &[0]),
];

/// Returns time and error of roots as they are (of Newton's with one to four steps) and corrected.
fn lines(errors: &Table, times: &Table) -> Vec<Line> {
    let at = if times.rows.iter().any(|row| row[0] == 5000) { 5000 } else { 1000 };
    let line = |(name, way, corrections): (&str, &str, &[usize])| {
        let is_of = |row: &&Vec<Value>| row[0] == at && row[1].as_str().is_some_and(|it| it.starts_with(way));
        let rows = times.rows.iter().filter(is_of);
        let point = |(row, &c): (&Vec<Value>, &usize)| {
            let error = errors.rows.iter().find(|it| it[0] == row[1] && it[1] == CORRECTIONS[c].0)?;
            row[2 + c].as_f64().zip(error[6].as_f64())
        };
        let points =
            rows.flat_map(|row| corrections.iter().map(move |c| (row, c))).filter_map(point).collect();
        Line { name: name.into(), points }
    };
    LINES.map(line).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_indices_are_counted_as_by_hand() {
        let right = |k: i64, n: i64| (0..n).rfind(|row| ends(*row, n)[0] <= k).expect("a row");
        // A row too far, each of the six indices of four boxes is wrong, and the rules mend it.
        let wrong = Wrong { count: 6, worst_row: 1, first: Some(4) };
        let by_one = all_pairs(move |k, n| right(k, n) + 1, 4, f64::INFINITY);
        assert_eq!(by_one, [wrong, Wrong::default(), Wrong::default()]);
        let [as_it_is, rules, integers] = all_pairs(move |k, n| right(k, n) + 3, 50, f64::INFINITY);
        assert_eq!((as_it_is.count, as_it_is.worst_row, integers.count), (1225, 3, 0));
        assert!(rules.count > 0);
    }

    #[test]
    fn no_wrong_estimate_is_far_from_the_ends_of_its_row() {
        for way in WAYS.iter().filter(|way| way.error < 1.0) {
            // `row` has no loop, so it is looked at here.
            let wrong = |row: i64| {
                let [first, last] = ends(row, 700);
                (first..=last).filter(|k| (way.row)(*k, 700) != row).count() as u64
            };
            assert_eq!((way.all)(700)[0].count, (0..699).map(wrong).sum::<u64>(), "{}", way.name);
        }
    }

    #[test]
    fn an_f32_root_is_first_wrong_by_one_row_which_the_rules_mend() {
        let [as_it_is, rules, _] = (WAYS[0].all)(4098);
        assert!(as_it_is.count > 0 && as_it_is.worst_row == 1 && rules.count == 0, "{as_it_is:?}");
        assert_eq!((WAYS[0].all)(4097)[0], Wrong::default());
    }

    #[test]
    fn before_a_counterexample_the_rules_mend_everything() {
        for way in &WAYS[2..4] {
            let (n, row, k) = counterexample(way, 1 << 18).expect("a counterexample");
            assert_ne!(by_rules(way, n, k), as_it_is(row, k, n));
            assert!(n > 5000 || (2..n).step_by(31).all(|n| (way.all)(n)[1].count == 0));
        }
    }
}
