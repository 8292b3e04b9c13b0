//! Places where a paper contradicts itself, is wrong or is silent, each with evidence that is computed here.

mod avril;

pub(super) use avril::avril;

use super::lockstep::{Rows, algorithm_1, algorithm_2, equation_7};
use super::printed::{GAUSSIAN_GB, MOST_SPEED_UPS, OVER_PRI, SEGMENT, SPEED_UPS, TABLE_VI};
use super::sheet::{Sheet, short, thousands};
use pbig_harness::pair_index::pair_count;
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
        over_pri(),
        gigabytes(),
        count_of_partners(),
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
    let [first, last] = SPEED_UPS;
    [
        "tables IV and VI; sections 1, 6.1 and 7".into(),
        format!(
            "speed-ups of the settings; \"up to {first} times\" faster than CGAL (1, 7) and {last} times at 10^7 boxes (6.1)"
        ),
        format!(
            "tables IV and VI {}; the two numbers against CGAL {}",
            if off < 0.01 { "agree" } else { "do not agree" },
            if first == last { "agree" } else { "do not" }
        ),
        format!("largest difference between table IV and the quotients of table VI: {}", short(off)),
    ]
}

/// Two numbers may be one, rounded; then the other two of the same sentences should be, too.
fn over_pri() -> [String; 4] {
    let ([_, most], [most_over_cgal, over_cgal]) = (MOST_SPEED_UPS, SPEED_UPS);
    let more = |there: f64, most: f64| format!("{:.1}", 100.0 * (there / most - 1.0));
    [
        "sections 1, 6.1 and 7".into(),
        format!("\"up to {most} times\" faster than PRI (1, 7), and {OVER_PRI} times at 10^7 boxes (6.1)"),
        if OVER_PRI > most { "at 10^7 boxes it is more than the most" } else { "the two agree" }.into(),
        format!(
            "{OVER_PRI} is {} % more than {most}; rounded to a whole number it is {}. Over CGAL the two differ by {} %: \
             {over_cgal}, rounded to tens, is {}, and {most_over_cgal} is printed",
            more(OVER_PRI, most),
            OVER_PRI.round(),
            more(over_cgal, most_over_cgal),
            (over_cgal / 10.0).round() * 10.0
        ),
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

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(speed_ups()[2], "tables IV and VI agree; the two numbers against CGAL do not");
        assert_eq!(over_pri()[2], "at 10^7 boxes it is more than the most");
        assert!(
            over_pri()[3].starts_with("3.3 is 10.0 % more than 3; rounded to a whole number it is 3. Over")
        );
        assert!(
            over_pri()[3].ends_with("116, rounded to tens, is 120, and 110 is printed"),
            "{}",
            over_pri()[3]
        );
        assert!(!totals()[2].contains(" 0.000000 %"), "{}", totals()[2]);
        let pairs = |unit: f64| GAUSSIAN_GB[0] * unit / 8.0 / super::super::printed::GAUSSIAN_PAIRS as f64;
        assert!((pairs(1e9) - 1.0).abs() < 0.01 && (pairs(1_073_741_824.0) - 1.0).abs() > 0.05);
    }
}
