//! Where a paper contradicts itself, is wrong or is silent, each with evidence that is computed here.

use super::lockstep::{Rows, algorithm_1, algorithm_2, equation_7};
use super::printed::{
    AVRIL_2, AVRIL_4, AVRIL_5, AVRIL_6, AVRIL_7, AVRIL_EXAMPLES, GAUSSIAN_GB, SEGMENT, TABLE_VI,
};
use super::sheet::{Sheet, short, thousands};
use pbig_core::pair_index::{index_of, pair_count, pair_of, row_start};
use pbig_core::plan::density_cell;
use pbig_core::{Aabb, Pair, oracle};
use pbig_harness::boxes::cubes;
use serde_json::json;

const COLUMNS: [&str; 4] = ["where", "printed", "what is so", "evidence"];

pub(super) fn pbig() -> Sheet {
    let mut sheet = Sheet::new("PBIG: wrong, contradictory or silent", &COLUMNS);
    for claim in [
        rows_from_one(),
        other_segments(),
        unequal_segments(),
        totals(),
        speed_ups(),
        gigabytes(),
        count_of_partners(),
    ] {
        sheet.row(json!(claim));
    }
    sheet
}

pub(super) fn avril() -> Sheet {
    let mut sheet = Sheet::new("Avril: wrong, contradictory or silent", &COLUMNS);
    for claim in [
        sign_of_8k(),
        two_rows(),
        last_index(),
        rates(),
        without_grid(),
        milliseconds(),
        lost_bits(),
        met_twice(),
    ] {
        sheet.row(json!(claim));
    }
    sheet
}

fn rows_from_one() -> [String; 4] {
    let sum = |rows| (0..8).map(|i| equation_7(i, 8, 8, rows)).sum::<u64>();
    [
        "equation 7, algorithm 2, figure 3".into(),
        "row i has the longer length if i <= m / 2, rounded up; rows are counted from 0".into(),
        "only with rows counted from 1; from 0 it must be i < m / 2".into(),
        format!(
            "8 x 8 elements have {} on and above the diagonal; the rows of equation 7 sum to {} from 1 and {} from 0",
            8 * 9 / 2,
            sum(Rows::FromOne),
            sum(Rows::FromZero)
        ),
    ]
}

fn other_segments() -> [String; 4] {
    let (boxes, faults) = (2 * SEGMENT, algorithm_1(2 * SEGMENT, SEGMENT));
    let second = algorithm_2(boxes, SEGMENT, Rows::FromOne);
    [
        "algorithms 1 and 2, line 3".into(),
        "each segment is compared with each of its cell, from the diagonal on; b_i != b_j".into(),
        "between two segments thread i meets its box i from both sides: these pairs are compared twice and output twice".into(),
        format!(
            "a cell of {boxes} boxes: algorithm 1 repeats {} pairs, algorithm 2 {}; missed {} and {}",
            faults.doubled, second.doubled, faults.missed, second.missed
        ),
    ]
}

fn unequal_segments() -> [String; 4] {
    let boxes = SEGMENT + 44;
    let faults = algorithm_2(boxes, SEGMENT, Rows::FromOne);
    [
        "algorithm 2, lines 5 and 10".into(),
        "m is the smaller of the two segments' sizes; equation 7 for m x n".into(),
        "right for a segment with itself; between a full segment and a shorter one some pairs are never compared. Here the last \
         rows of a cell are balanced over the whole cell, and rows of segments are whole"
            .into(),
        format!(
            "a cell of {boxes} boxes, segments of {SEGMENT}: {} of {} pairs missed, {} repeated",
            faults.missed,
            thousands(pair_count(boxes)),
            faults.doubled
        ),
    ]
}

fn totals() -> [String; 4] {
    let gap = |row: &super::printed::Breakdown| {
        row.total as i64 - (row.before.iter().chain(row.after).sum::<u64>()) as i64
    };
    let gaps: Vec<String> = TABLE_VI.iter().map(|row| short(gap(row) as f64)).collect();
    let share = 100.0 * gap(&TABLE_VI[0]) as f64 / TABLE_VI[0].total as f64;
    [
        "table VI".into(),
        "Total beside seven tasks".into(),
        format!("the tasks do not add up to it: {} % of the baseline is in no task", short(share)),
        format!("Total less the tasks, row by row, in microseconds: {}", gaps.join("; ")),
    ]
}

fn speed_ups() -> [String; 4] {
    let by_table = |row: &super::printed::Breakdown| TABLE_VI[0].total as f64 / row.total as f64;
    let off =
        TABLE_VI.iter().filter_map(|row| Some((row.speed_up? - by_table(row)).abs())).fold(0.0, f64::max);
    let [first, last] = super::printed::SPEED_UPS;
    [
        "tables IV and VI; sections 1, 6.1 and 7".into(),
        format!(
            "speed-ups of the settings; \"up to {first} times\" and {last} times faster than CGAL at 10^7 boxes"
        ),
        format!(
            "tables IV and VI {}; the two numbers against CGAL {}",
            if off < 0.01 { "agree" } else { "do not agree" },
            if first == last { "agree" } else { "do not" }
        ),
        format!("largest difference between table IV and the quotients of table VI: {}", short(off)),
    ]
}

fn gigabytes() -> [String; 4] {
    let pairs = |unit: f64| short(GAUSSIAN_GB[0] * unit / 8.0);
    [
        "section 6.4".into(),
        format!("{} GB for 112 x 10^7 pairs", GAUSSIAN_GB[0]),
        "GB is 10^9 here, while MB is 2^20 in section 6.2".into(),
        format!("at 8 bytes a pair: {} pairs if GB is 10^9, {} if 2^30", pairs(1e9), pairs(1_073_741_824.0)),
    ]
}

fn count_of_partners() -> [String; 4] {
    [
        "section 5.2".into(),
        format!("the number of partners of a box in a segment of {SEGMENT} takes log2 {SEGMENT} bits"),
        "only if it is stored less one, which is not said; here it is".into(),
        format!(
            "a box may have 1 to {SEGMENT} partners in another segment; {} bits hold 0 to {}",
            SEGMENT.ilog2(),
            SEGMENT - 1
        ),
    ]
}

/// Avril's equation 1 as it stands, row counted from 1, with one of the two signs of `8k`.
fn equation_1(k: u64, n: u64, sign: f64) -> f64 {
    let (k, n) = (k as f64, n as f64);
    ((2.0 * n + 1.0 - (4.0 * n * n - 4.0 * n + sign * 8.0 * k + 1.0).sqrt()) / 2.0).floor()
}

fn sign_of_8k() -> [String; 4] {
    let (n, k, (row, _)) = AVRIL_EXAMPLES[0];
    let right = |sign: f64| {
        (0..pair_count(n)).filter(|&k| equation_1(k, n, sign) == (pair_of(k, n).0 + 1) as f64).count()
    };
    [
        "section 3.3".into(),
        "the square root of 4n^2 - 4n + 8k + 1".into(),
        "it is - 8k, as in section 3.2 and equation 1".into(),
        format!(
            "n = {n}: the row is right for {} of {} k with + and for {} with -; the paper's own example k = {k} is in row {row}, by + in row {}, by - in row {}",
            right(1.0),
            thousands(pair_count(n)),
            thousands(right(-1.0) as u64),
            equation_1(k, n, 1.0),
            equation_1(k, n, -1.0)
        ),
    ]
}

fn two_rows() -> [String; 4] {
    let n = 1000;
    let fits = |k: u64, a: u64| row_start(a, n) <= k && (a + 1 == n || k <= row_start(a + 1, n));
    // A row and the next both take the first index of the next.
    let twice = (1..n - 1).filter(|&a| fits(row_start(a, n), a) && fits(row_start(a, n), a - 1)).count();
    [
        "section 3.2.1".into(),
        "S_a <= k <= S_a+1".into(),
        "k < S_a+1: with <= the first index of a row belongs to two rows".into(),
        format!("n = {n}: {twice} indices have two rows"),
    ]
}

fn last_index() -> [String; 4] {
    let n = 1000;
    [
        "section 3.2, table 1".into(),
        "threads 0 to (n^2 - n) / 2; the last element of the matrix is (n^2 - n) / 2".into(),
        "one less: pairs are numbered from 0".into(),
        format!(
            "n = {n}: the last pair has the index {}, (n^2 - n) / 2 is {}",
            index_of(n - 2, n - 1, n),
            pair_count(n)
        ),
    ]
}

fn rates() -> [String; 4] {
    let rate = |n: u64, ms: f64| short(pair_count(n) as f64 / ms * 1e3);
    let rates: Vec<String> = AVRIL_2.iter().map(|&(n, ms, _)| rate(n, ms)).collect();
    let totals: Vec<String> = AVRIL_6[..3].iter().map(|(_, ms)| ms[3].to_string()).collect();
    let a_second = AVRIL_4.0 as f64 / AVRIL_4.1 * 1e3;
    let (n, ms, _) = AVRIL_2[2];
    [
        "table 2 against table 4".into(),
        format!("{} objects take {ms} ms with a root for each pair", thousands(n)),
        "not for all pairs: the roots alone would take longer. The times are near the totals of table 6, which are with the grid of \
         section 4; that of table 2 does not say so"
            .into(),
        format!(
            "table 2 would be {} pairs a second; table 4 is {} roots a second, {} ms for {} pairs; totals of table 6: {} ms",
            rates.join(", "),
            short(a_second),
            short(pair_count(n) as f64 / a_second * 1e3),
            short(pair_count(n) as f64),
            totals.join(", ")
        ),
    ]
}

fn without_grid() -> [String; 4] {
    [
        "tables 2, 5 and 7".into(),
        "brute force on the same GPU".into(),
        "three different times for 1000 objects, two for 10,000".into(),
        format!(
            "1000 objects: {} ms (table 2), {} ms (table 5, kernel alone), {} ms (table 7, without grid); 10,000: {} and {} ms",
            AVRIL_2[0].1, AVRIL_5[1].2[0], AVRIL_7[1].1, AVRIL_2[1].1, AVRIL_7[2].1
        ),
    ]
}

fn milliseconds() -> [String; 4] {
    let sums = AVRIL_6.iter().all(|(_, ms)| (ms[0] + ms[1] + ms[2] - ms[3]).abs() < 0.005);
    let (n, ms) = AVRIL_6[2];
    [
        "abstract, sections 1 and 7, figure 5; table 6".into(),
        "less than 25 ms with more than 100,000 objects".into(),
        "not by table 6".into(),
        format!(
            "table 6, {} objects: {} ms (its parts {} to its totals)",
            thousands(n as u64),
            ms[3],
            if sums { "add up" } else { "do not add up" }
        ),
    ]
}

/// Hits that are lost when the eight threads of a byte read it before any of them writes: all but one of each byte.
fn lost(pairs: &[Pair], n: u64) -> usize {
    let mut bytes: Vec<u64> =
        pairs.iter().map(|pair| index_of(u64::from(pair.a), u64::from(pair.b), n) / 8).collect();
    bytes.sort_unstable();
    bytes.dedup();
    pairs.len() - bytes.len()
}

fn lost_bits() -> [String; 4] {
    let n = 1000;
    let boxes = [1.0, 10.0].map(|pairs| oracle::pairs(&cubes(n, 1.0, pairs, 1)));
    let lost =
        boxes.map(|pairs| format!("{} of {} pairs", lost(&pairs, n as u64), thousands(pairs.len() as u64)));
    [
        "section 3.4".into(),
        "eight threads each read a byte, set their bit and write it; \"these accesses are serialized\"".into(),
        "writes to one address are, reading before writing is not: bits are lost unless the operation is atomic, which is not said".into(),
        format!("all eight read first, 1000 cubes: {} lost with a pair each, {} with ten", lost[0], lost[1]),
    ]
}

/// Cells in which the pairs of boxes meet, in all.
fn meetings(boxes: &[Aabb], pairs: &[Pair], cell: f32) -> u64 {
    let index = |x: f32| (x / cell).floor() as i64;
    let cells = |pair: &Pair| -> i64 {
        let (a, b) = (&boxes[pair.a as usize], &boxes[pair.b as usize]);
        (0..3).map(|k| index(a.max[k].min(b.max[k])) - index(a.min[k].max(b.min[k])) + 1).product()
    };
    pairs.iter().map(|pair| cells(pair) as u64).sum()
}

fn met_twice() -> [String; 4] {
    const OBJECTS: usize = 5000;
    let boxes = cubes(OBJECTS, 1.0, 1.0, 1);
    let side = boxes.iter().flat_map(|b| b.max).fold(0.0, f32::max);
    let pairs = oracle::pairs(&boxes);
    let times = |wanted: f32| {
        let cell = density_cell(OBJECTS as u32, [side; 3], wanted);
        format!(
            "{} with {wanted} objects a cell",
            short(meetings(&boxes, &pairs, cell) as f64 / pairs.len() as f64)
        )
    };
    [
        "sections 4.1 and 4.2".into(),
        "an object is in every cell it touches, each cell is searched by brute force; X objects a cell"
            .into(),
        "a pair is found in each cell that both touch; how it is told once is not said, nor what X is".into(),
        format!("{OBJECTS} cubes with a pair each: a pair is found {}, {}", times(8.0), times(64.0)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_examples_need_the_minus_sign() {
        for (n, k, (row, _)) in AVRIL_EXAMPLES {
            assert_eq!(equation_1(k, n, -1.0), row as f64);
            assert_ne!(equation_1(k, n, 1.0), row as f64);
        }
        assert!(
            sign_of_8k()[3].contains("right for 1 of 499,500 k with + and for 499,500 with -"),
            "{}",
            sign_of_8k()[3]
        );
    }

    #[test]
    fn evidence_is_evidence() {
        assert!(rows_from_one()[3].contains(
            "have 36 on and above the diagonal; the rows of equation 7 sum to 36 from 1 and 37 from 0"
        ));
        assert!(
            other_segments()[3].contains("algorithm 1 repeats 256 pairs, algorithm 2 256; missed 0 and 0"),
            "{}",
            other_segments()[3]
        );
        assert!(!unequal_segments()[3].contains(": 0 of"), "{}", unequal_segments()[3]);
        assert!(two_rows()[3].contains("998 indices"), "{}", two_rows()[3]);
        assert_eq!(speed_ups()[2], "tables IV and VI agree; the two numbers against CGAL do not");
        assert!(!totals()[2].contains(" 0.000000 %"), "{}", totals()[2]);
        assert!(milliseconds()[3].contains("(its parts add up"));
    }

    /// What is said in the third column, of numbers that are printed.
    #[test]
    fn what_is_printed_contradicts_itself_as_is_said() {
        let roots_alone = |n: u64| pair_count(n) as f64 / AVRIL_4.0 as f64 * AVRIL_4.1;
        let (n, ms, _) = AVRIL_2[2];
        assert!(roots_alone(n) > ms, "{}", roots_alone(n));
        let near = |k: usize| (AVRIL_2[k].1 / AVRIL_6[k].1[3] - 1.0).abs() < 0.2;
        assert!((0..3).all(near));
        let of_1000 = [AVRIL_2[0].1, AVRIL_5[1].2[0], AVRIL_7[1].1];
        assert!(of_1000[0] != of_1000[1] && of_1000[1] != of_1000[2] && of_1000[0] != of_1000[2]);
        assert!(AVRIL_2[1].1 != AVRIL_7[2].1 && AVRIL_6[2].1[3] > 25.0);
        assert_eq!(index_of(998, 999, 1000) + 1, pair_count(1000));
        let pairs = |unit: f64| GAUSSIAN_GB[0] * unit / 8.0 / super::super::printed::GAUSSIAN_PAIRS as f64;
        assert!((pairs(1e9) - 1.0).abs() < 0.01 && (pairs(1_073_741_824.0) - 1.0).abs() > 0.05);
    }

    #[test]
    fn bits_of_one_byte_are_lost_but_one() {
        // Of four boxes: (0, 1), (0, 2) and (2, 3) have the indices 0, 1 and 5, one byte.
        let pairs = [Pair::new(0, 1), Pair::new(0, 2), Pair::new(2, 3)];
        assert_eq!((lost(&pairs, 4), lost(&pairs[..1], 4)), (2, 0));
    }

    #[test]
    fn a_pair_meets_in_each_cell_that_both_touch() {
        let boxes = [Aabb::new([0.0; 3], [1.5; 3]), Aabb::new([0.5; 3], [1.2, 0.9, 0.9])];
        assert_eq!(meetings(&boxes, &[Pair::new(0, 1)], 1.0), 2);
    }
}
