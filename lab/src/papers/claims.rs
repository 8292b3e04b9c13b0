//! Places where a paper contradicts itself, is wrong or is silent, as numbers that are computed here; docs/PAPERS.md says what
//! follows from them.

use super::model::{GAUSSIAN, GAUSSIAN_READ};
use super::printed::*;
use pbig_core::{Pair, oracle};
use pbig_harness::pair_index::{index_of, pair_count, pair_of, row_start};
use pbig_harness::prelude::*;

/// The table, with the place in a paper to which facts are appended.
struct Facts(Table, [&'static str; 2]);

impl Facts {
    /// Appends a quantity with its value.
    fn add(&mut self, quantity: impl Into<Value>, value: impl Into<Value>) {
        let [paper, place] = self.1;
        self.0.row([paper.into(), place.into(), quantity.into(), value.into()]);
    }
}

/// A paper and a place in it, and the facts there.
type Passage = ([&'static str; 2], fn(&mut Facts));

const PASSAGES: [Passage; 6] = [
    (["PBIG", "equation 7, figure 3"], rows_of_figure_3),
    (["PBIG", "algorithms 1 and 2"], segments),
    (["PBIG", "section 6.4"], sizes),
    (["Avril", "section 3.3"], signs),
    (["Avril", "section 3.2"], indices),
    (["Avril", "section 3.4"], lost_bits),
];

pub(super) fn table() -> Table {
    let table = Table::new("what the papers print", "paper | place | quantity | value");
    let mut facts = Facts(table, ["", ""]);
    for (place, of_place) in PASSAGES {
        facts.1 = place;
        of_place(&mut facts);
    }
    facts.0
}

/// Equation 7: matrix elements of row `i` of `m x n`, `i` counted from 0 by the caller, and by the equation from `first`.
fn equation_7(i: u64, m: u64, n: u64, first: u64) -> u64 {
    // (m + 1) / 2 rounded down is m / 2 rounded up.
    let half = if i + first <= m.div_ceil(2) { (m + 1).div_ceil(2) } else { m.div_ceil(2) };
    n - m + half
}

fn rows_of_figure_3(facts: &mut Facts) {
    let sum = |first| (0..8).map(|i| equation_7(i, 8, 8, first)).sum::<u64>();
    facts.add("elements of 8 x 8 on and above the diagonal", 36);
    facts.add("elements, rows counted from 1", sum(1));
    facts.add("elements, rows counted from 0", sum(0));
}

/// Returns how many pairs of a cell PBIG's line 3, each segment against each, never compares, and how many comparisons are
/// beyond the first of each; thread `i` of `m` takes the columns of `n` that `columns` names.
fn by_segments(boxes: u64, length: u64, columns: impl Fn(u64, u64, u64) -> Vec<u64>) -> [u64; 2] {
    let mut seen = vec![0u64; pair_count(boxes) as usize];
    let size = |segment: u64| length.min(boxes - segment * length);
    let segments = boxes.div_ceil(length);
    for (v, h) in (0..segments).flat_map(|v| (0..segments).map(move |h| (v, h))) {
        for (i, j) in (0..size(v)).flat_map(|i| columns(i, size(v), size(h)).into_iter().map(move |j| (i, j)))
        {
            let (a, b) = (v * length + i, h * length + j);
            if a != b {
                seen[index_of(a.min(b), a.max(b), boxes) as usize] += 1;
            }
        }
    }
    let missed = seen.iter().filter(|times| **times == 0).count() as u64;
    [missed, seen.iter().map(|times| times.saturating_sub(1)).sum()]
}

/// Algorithm 2, line 11; line 5 takes the smaller of both segments for m. Rows count from 1.
fn algorithm_2(boxes: u64, length: u64) -> [u64; 2] {
    by_segments(boxes, length, |i, m, n| {
        let x = if i < n { equation_7(i, m.min(n), n, 1) } else { 0 };
        (0..x).map(|k| (i + k) % n).collect()
    })
}

fn segments(facts: &mut Facts) {
    let [two, unequal] = [2 * SEGMENT, SEGMENT + 44];
    for (name, boxes, [missed, repeated]) in [
        ("algorithm 1", two, by_segments(two, SEGMENT, |i, _, n| (i..n).collect())),
        ("algorithm 2", two, algorithm_2(two, SEGMENT)),
        ("algorithm 2", unequal, algorithm_2(unequal, SEGMENT)),
    ] {
        facts.add(format!("{name}, {boxes} boxes: pairs missed"), missed);
        facts.add(format!("{name}, {boxes} boxes: pairs repeated"), repeated);
    }
    facts.add(format!("pairs of {unequal} boxes"), pair_count(unequal));
}

fn sizes(facts: &mut Facts) {
    let bytes = GAUSSIAN_GB * 1e9;
    let off = |pairs: f64| 100.0 * (8.0 * pairs / bytes - 1.0);
    facts.add("these off the bytes, %", off(GAUSSIAN.pairs(MOST_BOXES)));
    facts.add("pairs expected, by the reading of table III", GAUSSIAN_READ.pairs(MOST_BOXES).round());
    facts.add("the pairs of that reading off the bytes, %", off(GAUSSIAN_READ.pairs(MOST_BOXES)));
}

/// Avril's equation 1, row counted from 1, with one of the two signs of `8k`.
fn equation_1(k: u64, n: u64, sign: f64) -> f64 {
    let (k, n) = (k as f64, n as f64);
    ((2.0 * n + 1.0 - (4.0 * n * n - 4.0 * n + sign * 8.0 * k + 1.0).sqrt()) / 2.0).floor()
}

fn signs(facts: &mut Facts) {
    let (n, k, (row, _)) = AVRIL_EXAMPLES[0];
    let right = |sign: f64| {
        (0..pair_count(n)).filter(|&k| equation_1(k, n, sign) == (pair_of(k, n).0 + 1) as f64).count()
    };
    facts.add("indices of 1000 objects", pair_count(n));
    facts.add("indices with the right row, + 8k", right(1.0));
    facts.add("indices with the right row, - 8k", right(-1.0));
    facts.add("row of k = 71452 in the paper's example", row);
    facts.add("row of k = 71452, + 8k", equation_1(k, n, 1.0));
    facts.add("row of k = 71452, - 8k", equation_1(k, n, -1.0));
}

fn indices(facts: &mut Facts) {
    let n = 1000;
    let fits = |k: u64, a: u64| row_start(a, n) <= k && (a + 1 == n || k <= row_start(a + 1, n));
    // A row and the next both take the first index of the next.
    let twice = (1..n - 1).filter(|&a| fits(row_start(a, n), a) && fits(row_start(a, n), a - 1)).count();
    facts.add("indices of 1000 objects with two rows by S_a <= k <= S_a+1", twice);
    facts.add("index of the last pair of 1000 objects", index_of(n - 2, n - 1, n));
    facts.add("(n^2 - n) / 2", pair_count(n));
}

/// Returns the hits that are lost when the eight threads of a byte read it before any of them writes: all but one of each byte.
fn lost(pairs: &[Pair], n: u64) -> usize {
    let byte = |pair: &Pair| index_of(u64::from(pair.a), u64::from(pair.b), n) / 8;
    let mut bytes: Vec<u64> = pairs.iter().map(byte).collect();
    bytes.sort_unstable();
    bytes.dedup();
    pairs.len() - bytes.len()
}

fn lost_bits(facts: &mut Facts) {
    for a_box in [1.0f32, 10.0] {
        let pairs = oracle::pairs(&cubes(1000, 1.0, a_box, 1));
        let name = |what: &str| format!("1000 cubes, {a_box} pairs a box: {what}");
        facts.add(name("pairs"), pairs.len());
        facts.add(name("lost if all eight threads of a byte read first"), lost(&pairs, 1000));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers on which the documents' statements rest.
    #[test]
    fn the_papers_contradict_themselves_as_the_documents_say() {
        let table = table();
        let value = |word: &str| {
            let row = table.rows.iter().find(|row| row[2].as_str().is_some_and(|name| name.contains(word)));
            row.and_then(|row| row[3].as_f64()).unwrap_or_else(|| panic!("no {word}"))
        };
        assert_eq!((value("rows counted from 1"), value("rows counted from 0")), (36.0, 37.0));
        assert_eq!(
            (value("algorithm 1, 512 boxes: pairs repeated"), value("algorithm 2, 512 boxes: pairs missed")),
            (256.0, 0.0)
        );
        assert!(value("algorithm 2, 300 boxes: pairs missed") > 0.0);
        assert_eq!(
            (value("right row, + 8k"), value("right row, - 8k"), value("with two rows")),
            (1.0, 499_500.0, 998.0)
        );
        assert!(value("pairs of that reading").abs() < 0.1 && value("these off the bytes") > 2.0);
    }

    #[test]
    fn lost_bits_by_hand() {
        // Of four boxes: (0, 1), (0, 2) and (2, 3) have the indices 0, 1 and 5, one byte.
        let pairs = [Pair::new(0, 1), Pair::new(0, 2), Pair::new(2, 3)];
        assert_eq!((lost(&pairs, 4), lost(&pairs[..1], 4)), (2, 0));
    }
}
