//! Avril's table 2 on a CPU: every pair by its index with a root, and by the lazy way (3.2.2).

use super::Scale;
use super::printed::{AVRIL_2, AVRIL_LAZY_ON_CPU};
use super::sheet::{Sheet, short};
use crate::bench::measure::timed;
use crate::output::Failure;
use pbig_core::Aabb;
use pbig_harness::boxes::cubes;
use pbig_harness::index::{AsItIs, Correction, Double, LAZY, Root, Rules, Single, lazy_ids, lazy_pair};
use pbig_harness::pair_index::{pair_count, pair_of};
use serde_json::json;
use std::ops::Range;

/// Ids looked at in one measurement; where there are more, stretches of them, spread evenly.
const MOST_IDS: u64 = 100_000_000;

/// Stretches of `0..ids` of at most [`MOST_IDS`] in all, and how many times as many there are.
fn stretches(ids: u64, most: u64) -> (Vec<Range<u64>>, f64) {
    const STRETCHES: u64 = 1000;
    if ids <= most {
        return (std::iter::once(0..ids).collect(), 1.0);
    }
    let length = most / STRETCHES;
    let begin = |i: u64| i * (ids - length) / (STRETCHES - 1);
    let all = (0..STRETCHES).map(|i| begin(i)..begin(i) + length).collect();
    (all, ids as f64 / (STRETCHES * length) as f64)
}

/// Ids whose pairs are made before they are tested.
const BLOCK: u64 = 1024;

/// Overlapping pairs among the ids. In the caller, so that the way to a pair is no call.
#[inline(always)]
fn overlaps(boxes: &[Aabb], ids: &[Range<u64>], pair: impl Fn(i64, i64) -> Option<(i64, i64)>) -> u64 {
    let (n, mut block, mut found) = (boxes.len() as i64, Vec::new(), 0);
    for ids in ids {
        for first in ids.clone().step_by(BLOCK as usize) {
            let ids = first..ids.end.min(first + BLOCK);
            block.clear();
            block.extend(ids.filter_map(|id| pair(id as i64, n)));
            found += hits(boxes, &block);
        }
    }
    found
}

/// One code for all ways. In their loops it would be another in each, and differ by more than the ways do.
#[inline(never)]
fn hits(boxes: &[Aabb], pairs: &[(i64, i64)]) -> u64 {
    let hit = |(a, b): &&(i64, i64)| boxes[*a as usize].overlaps(&boxes[*b as usize]);
    pairs.iter().filter(hit).count() as u64
}

/// A root as in the study of `pbig accuracy`, where all are held against each other.
#[inline(always)]
fn by_root<R: Root, C: Correction>(k: i64, n: i64) -> Option<(i64, i64)> {
    let m = 2 * n - 1;
    Some(C::pair(R::row(m, m * m - 8 * k), k, n))
}

/// Pbig's own, for any number of boxes.
#[inline(always)]
fn by_pair_of(k: i64, n: i64) -> Option<(i64, i64)> {
    let (a, b) = pair_of(k as u64, n as u64);
    Some((a as i64, b as i64))
}

/// Finds the overlapping pairs of boxes among some ids.
type Search = fn(&[Aabb], &[Range<u64>]) -> u64;

/// Ways with a root that give every pair of table 2's objects, and the lazy way.
const WAYS: [(&str, Search); 4] = [
    ("f32 root, the paper's rules", |boxes, ids| overlaps(boxes, ids, by_root::<Single, Rules>)),
    ("f64 root, as it is", |boxes, ids| overlaps(boxes, ids, by_root::<Double, AsItIs>)),
    ("`pair_of`", |boxes, ids| overlaps(boxes, ids, by_pair_of)),
    ("lazy", |boxes, ids| overlaps(boxes, ids, lazy_pair)),
];

/// The last of [`WAYS`].
const IS_LAZY: usize = WAYS.len() - 1;

/// The results of one way.
struct Took {
    found: u64,
    /// The shortest of the calls, for all ids.
    ms: f64,
    /// The longest of them.
    longest: f64,
    /// All ids over those looked at.
    times: f64,
}

/// Calls of each way. Two ways that take as long have all calls of one before all of the other in 3% of cases.
const CALLS: usize = 4;

impl Took {
    fn new(boxes: &[Aabb], way: usize, most: u64) -> Self {
        let mut took = Self { found: 0, ms: f64::MAX, longest: 0.0, times: 1.0 };
        took.call(boxes, way, most);
        took
    }

    fn call(&mut self, boxes: &[Aabb], way: usize, most: u64) {
        let n = boxes.len() as u64;
        let all = if way == IS_LAZY { lazy_ids(n as i64) as u64 } else { pair_count(n) };
        let (ids, times) = stretches(all, most);
        let (found, ms) = timed(|| WAYS[way].1(boxes, &ids));
        (self.found, self.times) = (found, times);
        (self.ms, self.longest) = (self.ms.min(ms * times), self.longest.max(ms * times));
    }

    /// Returns true if this way is faster than another; none if the times of both overlap.
    fn is_faster(&self, other: &Self) -> Option<bool> {
        match () {
            () if self.longest < other.ms => Some(true),
            () if self.ms > other.longest => Some(false),
            () => None,
        }
    }
}

/// All ways with so many boxes. A failed check if those that looked at the same have not found the same.
fn all_ways(n: u64, most: u64) -> Result<Vec<Took>, Failure> {
    let boxes = cubes(n as usize, 1.0, 1.0, 1);
    let mut all: Vec<Took> = (0..WAYS.len()).map(|way| Took::new(&boxes, way, most)).collect();
    for _ in 1..CALLS {
        all.iter_mut().enumerate().for_each(|(way, took)| took.call(&boxes, way, most));
    }
    match odd_one(&all) {
        Some(way) => Err(Failure::Check(format!(
            "{n} objects: {} pairs with {}, {} with {}",
            all[way].found, WAYS[way].0, all[0].found, WAYS[0].0
        ))),
        None => Ok(all),
    }
}

/// A way that has not found what the first has. Roots look at the same ids; the lazy way has ids of its own, so that it can be
/// held against them only where it looks at all.
fn odd_one(all: &[Took]) -> Option<usize> {
    let is_compared = |way: &usize| *way != IS_LAZY || all[*way].times == 1.0;
    (0..all.len()).filter(is_compared).find(|way| all[*way].found != all[0].found)
}

/// Table 2 on one thread of the CPU.
pub(super) fn table(scale: &Scale) -> Result<Sheet, Failure> {
    let printed =
        ["objects", "ms printed, root", "ms printed, lazy", "lazy / root printed"].map(str::to_owned);
    let times = WAYS.iter().map(|(name, _)| format!("ms, {name}"));
    let ratios = WAYS[..IS_LAZY].iter().map(|(name, _)| format!("lazy / {name}"));
    let looked_at = ["pairs", "ids looked at, roots", "ids looked at, lazy"].map(str::to_owned);
    let columns: Vec<String> = printed.into_iter().chain(times).chain(ratios).chain(looked_at).collect();
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut sheet = Sheet::new("Avril table 2: the lazy way, CPU", &columns);
    let most = if scale.quick { MOST_IDS / 10 } else { MOST_IDS };
    let mut rows = Vec::new();
    for (n, root, lazy) in AVRIL_2 {
        let all = all_ways(n, most)?;
        sheet.row(row([n as f64, root, lazy, lazy / root], &all));
        rows.push(all);
    }
    Ok(abouts(&rows, most).into_iter().fold(sheet, Sheet::about))
}

fn row(printed: [f64; 4], all: &[Took]) -> serde_json::Value {
    let (first, lazy) = (&all[0], &all[IS_LAZY]);
    let share = |took: &Took| match took.times {
        1.0 => json!("all"),
        times => json!(format!("{} %", short(100.0 / times))),
    };
    let printed = [json!(printed[0] as u64)].into_iter().chain(printed[1..].iter().map(|ms| json!(ms)));
    let times = all.iter().map(|took| json!(took.ms));
    let ratios = all[..IS_LAZY].iter().map(|took| json!(lazy.ms / took.ms));
    let pairs = json!((lazy.times == 1.0).then_some(lazy.found));
    printed.chain(times).chain(ratios).chain([pairs, share(first), share(lazy)]).collect()
}

/// Describes the measurement, and the result for the paper's claim.
fn abouts(rows: &[Vec<Took>], most: u64) -> [String; 3] {
    let (seconds, times) = AVRIL_LAZY_ON_CPU;
    let against = |way: usize| {
        let ratios = rows.iter().map(|all| all[IS_LAZY].ms / all[way].ms);
        let (least, longest) = ratios.fold((f64::MAX, 0.0f64), |(a, b), ratio| (a.min(ratio), b.max(ratio)));
        format!("{} to {} times as long as {}", short(least), short(longest), WAYS[way].0)
    };
    let all: Vec<String> = (0..IS_LAZY).map(against).collect();
    let is_faster = |all: &Vec<Took>| std::array::from_fn(|root| all[IS_LAZY].is_faster(&all[root]));
    let verdict = verdict(&rows.iter().map(is_faster).collect::<Vec<_>>());
    [
        format!(
            "One thread; pairs are made from their ids, {BLOCK} ids at a time, and then their boxes are tested, by the same \
             code in every way. {LAZY} Ways with a root look at the index of \
             each pair. More than {} ids are extrapolated from stretches spread over all. The objects are cubes with a pair \
             each, as the paper says nothing of its own.",
            short(most as f64)
        ),
        format!(
            "Printed are times of the GPU. On their CPU the paper has the lazy way {times} times as fast as its root, \
             {seconds} s for 10,000 objects. Here it takes {}, by the shortest of {CALLS} calls in turn. \
             {verdict}. (All calls of one before all of the other: of two that take as long, in 3% of cases.)",
            all.join("; ")
        ),
        "`pair_of` is ours for up to 2^32 boxes: it multiplies in 128 bits and corrects \
         with integers; the other two do with 64 bits. At each number of objects all three find as many overlaps among the same \
         ids, and the lazy way does where it looks at all of its own, or the run fails. The same ways without the test of \
         boxes: table 2 in [accuracy](accuracy.md)."
            .to_owned(),
    ]
}

/// Says if the lazy way is faster, from the answer for each number of objects and each root.
fn verdict(rows: &[[Option<bool>; IS_LAZY]]) -> String {
    let count = |wanted: Option<bool>| rows.iter().flatten().filter(|is| **is == wanted).count();
    let [faster, slower, same] = [Some(true), Some(false), None].map(count);
    let cases = rows.len() * IS_LAZY;
    match (faster, slower) {
        (all, _) if all == cases => "So it is faster than each of these roots".to_owned(),
        (_, all) if all == cases => "So it is slower than each of these roots".to_owned(),
        _ => format!(
            "So of {cases} cases it is faster in {faster} and slower in {slower}; in {same} it cannot be told, as calls of \
             both overlap{}",
            if is_by_root(rows) { ". The root decides which" } else { "" }
        ),
    }
}

/// Returns true if the lazy way is faster than some roots and slower than others, the same ones at every number of objects.
fn is_by_root(rows: &[[Option<bool>; IS_LAZY]]) -> bool {
    let differs = |row: &[Option<bool>; IS_LAZY]| row.contains(&Some(true)) && row.contains(&Some(false));
    rows.len() > 1 && rows.iter().all(|row| *row == rows[0] && differs(row))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn all_ways_find_the_pairs_of_brute_force() {
        let n = 300;
        let boxes = cubes(n, 1.0, 3.0, 1);
        let pairs = oracle::pairs(&boxes).len() as u64;
        for (way, (name, _)) in WAYS.iter().enumerate() {
            let took = Took::new(&boxes, way, MOST_IDS);
            assert_eq!((took.found, took.times), (pairs, 1.0), "{name}");
        }
        // In stretches, which end within a block.
        let (some, _) = stretches(pair_count(n as u64), 30_000);
        let found = WAYS[..IS_LAZY].iter().map(|(_, search)| search(&boxes, &some));
        let listed = some.iter().flat_map(Range::clone).map(|k| pair_of(k, n as u64));
        let right = listed.filter(|&(a, b)| boxes[a as usize].overlaps(&boxes[b as usize])).count() as u64;
        assert!(right > 0 && found.into_iter().all(|found| found == right));
        assert!(all_ways(50, MOST_IDS).is_ok_and(|all| all.len() == WAYS.len()));
    }

    #[test]
    fn a_row_has_the_lazy_way_over_each_root() {
        let took = |ms: f64, times: f64| Took { found: 7, ms, longest: ms, times };
        let all = [took(2.0, 1.0), took(4.0, 1.0), took(8.0, 1.0), took(4.0, 2.0)];
        let row = row([1000.0, 0.5, 1.0, 2.0], &all);
        let right = json!([1000, 0.5, 1.0, 2.0, 2.0, 4.0, 8.0, 4.0, 2.0, 1.0, 0.5, null, "all", "50.00 %"]);
        assert_eq!(row, right);
        let told = abouts(&[all.into()], 10_000_000).join(" ");
        assert!(told.contains("More than 10,000,000 ids"), "{told}");
        assert!(told.contains("Here it takes 2.000 to 2.000 times as long as f32 root"), "{told}");
        assert!(told.contains("of 3 cases it is faster in 1 and slower in 1; in 1 it cannot"), "{told}");
        assert!(!told.contains("The root decides"), "by one row: {told}");
    }

    #[test]
    fn what_decides_which_is_faster_is_what_the_rows_show() {
        let [yes, no] = [[Some(true); IS_LAZY], [Some(false); IS_LAZY]];
        let some = [Some(true), Some(false), None];
        let cases = [
            ([yes, yes], "faster than each"),
            ([no, no], "slower than each"),
            (
                [some, some],
                "faster in 2 and slower in 2; in 2 it cannot be told, as calls of both overlap. The root",
            ),
            ([some, no], "of 6 cases it is faster in 1 and slower in 4; in 1 it cannot"),
            (
                [[None; IS_LAZY]; 2],
                "faster in 0 and slower in 0; in 6 it cannot be told, as calls of both overlap",
            ),
        ];
        for (rows, told) in cases {
            assert!(verdict(&rows).contains(told), "{}", verdict(&rows));
            assert_eq!(verdict(&rows).contains("The root"), rows == [some, some]);
        }
    }

    #[test]
    fn a_way_is_faster_if_its_longest_call_is() {
        let took = |ms: f64, longest: f64| Took { found: 7, ms, longest, times: 1.0 };
        let against = |ms, longer| took(2.0, 3.0).is_faster(&took(ms, longer));
        assert_eq!(
            [against(3.5, 4.0), against(3.0, 4.0), against(1.0, 1.5)],
            [Some(true), None, Some(false)]
        );
    }

    #[test]
    fn ways_that_looked_at_the_same_are_compared() {
        let took = |found, times| Took { found, ms: 1.0, longest: 1.0, times };
        let all = |second, (lazy, times)| [took(7, 2.0), took(second, 2.0), took(7, 2.0), took(lazy, times)];
        assert_eq!(odd_one(&all(7, (8, 4.0))), None);
        assert_eq!(odd_one(&all(7, (8, 1.0))), Some(IS_LAZY));
        assert_eq!(odd_one(&all(6, (7, 4.0))), Some(1));
    }

    #[test]
    fn stretches_are_spread_over_all_and_know_their_share() {
        let all = 0..10;
        assert_eq!(stretches(10, 100), (vec![all], 1.0));
        let (some, times) = stretches(1_000_000, 10_000);
        assert_eq!((some[0].clone(), some[999].clone(), times), (0..10, 999_990..1_000_000, 100.0));
    }
}
