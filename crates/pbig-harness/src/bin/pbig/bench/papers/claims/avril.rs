//! Avril's paper, see the parent.

use super::COLUMNS;
use crate::bench::papers::printed::{
    AVRIL_2, AVRIL_4, AVRIL_4_MEAN, AVRIL_5, AVRIL_6, AVRIL_7, AVRIL_EXAMPLES, AVRIL_FEW, Roots,
};
use crate::bench::papers::sheet::{Sheet, short, thousands};
use pbig_core::{Aabb, Pair, oracle};
use pbig_harness::boxes::cubes;
use pbig_harness::pair_index::{index_of, pair_count, pair_of, row_start};
use pbig_harness::study::density_cell;
use serde_json::json;

pub(in crate::bench::papers) fn avril() -> Sheet {
    let mut sheet = Sheet::new("Avril: wrong, contradictory or silent", &COLUMNS);
    for claim in [
        sign_of_8k(),
        two_rows(),
        last_index(),
        rates(),
        gamma(),
        without_grid(),
        with_grid(),
        milliseconds(),
        lost_bits(),
        met_twice(),
    ] {
        sheet.row(json!(claim));
    }
    sheet
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
    let a_second = a_second_of(&AVRIL_4[3]);
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

/// Returns true if times that round to the printed ones can give the printed reduction, rounded to a tenth.
fn follows(row: &Roots) -> bool {
    row.reduction(-1.0) <= row.gamma + 0.05 && row.gamma - 0.05 <= row.reduction(1.0)
}

fn gamma() -> [String; 4] {
    let list =
        |of: &dyn Fn(&Roots) -> f64| AVRIL_4.iter().map(|row| short(of(row))).collect::<Vec<_>>().join(", ");
    let mean = |of: &dyn Fn(&Roots) -> f64| short(AVRIL_4.iter().map(of).sum::<f64>() / AVRIL_4.len() as f64);
    let wrong: Vec<String> =
        AVRIL_4.iter().filter(|row| !follows(row)).map(|row| thousands(row.roots)).collect();
    [
        "table 4".into(),
        format!("gamma, the time saved: {} %; {AVRIL_4_MEAN} % on average", list(&|row| row.gamma)),
        if wrong.is_empty() {
            "it is what the times of the table give, as far as they are printed".into()
        } else {
            format!("not what the times of the table give, at {} roots by no rounding", wrong.join(" and "))
        },
        format!(
            "by the times {} %, and if they were rounded most favourably {} %; the mean of gamma is {}, of what the \
             times give {}",
            list(&|row| row.reduction(0.0)),
            list(&|row| row.reduction(1.0)),
            mean(&|row| row.gamma),
            mean(&|row| row.reduction(0.0))
        ),
    ]
}

/// Table 6's total against table 7's with the grid, at the sizes that both have.
fn with_grid() -> [String; 4] {
    let both =
        AVRIL_6.iter().filter_map(|(n, ms)| Some((*n, ms[3], AVRIL_7.iter().find(|row| row.0 == *n)?.2)));
    let apart: Vec<f64> = both.clone().map(|(_, six, seven)| seven / six).collect();
    let times: Vec<String> = both
        .map(|(n, six, seven)| {
            format!("{} objects: {six} ms (table 6), {seven} ms (table 7)", thousands(n as u64))
        })
        .collect();
    let (few, few_ms) = AVRIL_FEW;
    let is_more = few < AVRIL_6[0].0 as u64 && few_ms > AVRIL_6[0].1[3];
    [
        "tables 6 and 7; section 6".into(),
        format!("a step with the grid, the same GPU; {few_ms} ms for {few} objects"),
        format!(
            "table 7 has {} times the whole of table 6, which has the update of boxes too; section 6 has {} for {few} \
             objects than table 6 for {}",
            apart.iter().map(|times| short(*times)).collect::<Vec<_>>().join(" and "),
            if is_more { "more" } else { "no more" },
            thousands(AVRIL_6[0].0 as u64)
        ),
        format!("{}; {few}: {few_ms} ms (section 6)", times.join("; ")),
    ]
}

/// Roots a second.
fn a_second_of(row: &Roots) -> f64 {
    row.roots as f64 / row.cuda * 1e3
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
        assert!(two_rows()[3].contains("998 indices"), "{}", two_rows()[3]);
        assert!(milliseconds()[3].contains("(its parts add up"));
        assert!(gamma()[2].ends_with("at 10,000,000 and 100,000,000 roots by no rounding"), "{}", gamma()[2]);
        assert!(
            gamma()[3].contains("the mean of gamma is 13.78, of what the times give 13.66"),
            "{}",
            gamma()[3]
        );
        assert!(with_grid()[2].starts_with("table 7 has 7.360 and 1.386 times"), "{}", with_grid()[2]);
        assert!(with_grid()[2].contains("section 6 has more for 304 objects"), "{}", with_grid()[2]);
    }

    #[test]
    fn a_reduction_follows_if_some_times_that_round_to_the_printed_ones_give_it() {
        let row = |gamma: f64| Roots { roots: 1, approximate: 0.042, cuda: 0.048, digit: 0.001, gamma };
        assert!(follows(&row(12.5)) && follows(&row(14.4)) && follows(&row(10.6)));
        assert!(!follows(&row(14.6)) && !follows(&row(10.4)));
    }

    /// The third column contradicts printed numbers.
    #[test]
    fn what_is_printed_contradicts_itself_as_is_said() {
        let roots_alone = |n: u64| pair_count(n) as f64 / a_second_of(&AVRIL_4[3]) * 1e3;
        let (n, ms, _) = AVRIL_2[2];
        assert!(roots_alone(n) > ms, "{}", roots_alone(n));
        let near = |k: usize| (AVRIL_2[k].1 / AVRIL_6[k].1[3] - 1.0).abs() < 0.2;
        assert!((0..3).all(near));
        let of_1000 = [AVRIL_2[0].1, AVRIL_5[1].2[0], AVRIL_7[1].1];
        assert!(of_1000[0] != of_1000[1] && of_1000[1] != of_1000[2] && of_1000[0] != of_1000[2]);
        assert!(AVRIL_2[1].1 != AVRIL_7[2].1 && AVRIL_6[2].1[3] > 25.0);
        assert_eq!(index_of(998, 999, 1000) + 1, pair_count(1000));
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
