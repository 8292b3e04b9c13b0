//! Figures of Avril et al. 2012, and ours beside them.

use super::super::study::{Cell, Table};
use super::times::Times;
use crate::bench::measure::timed;
use pbig_harness::index::{CARMACK, LOMONT, Newton, Single, SingleRoot, WideNewton, root_errors};

/// Table 2: objects, ms with a square root, ms without (the lazy way).
pub(super) const TABLE_2: [(u64, f64, f64); 3] =
    [(1000, 0.21, 0.25), (10_000, 2.25, 4.28), (100_000, 29.66, 58.24)];

/// Table 3: tests, % of errors with two steps (Carmack, Lomont) and with three; four are said to be as three.
const TABLE_3: [(u32, [f64; 4]); 6] = [
    (1000, [2.9, 2.9, 0.7, 0.7]),
    (10_000, [0.89, 0.89, 0.12, 0.12]),
    (100_000, [0.27, 0.27, 0.035, 0.035]),
    (1_000_000, [0.1800, 0.1803, 0.0110, 0.0111]),
    (10_000_000, [0.3681, 0.3685, 0.0040, 0.0057]),
    (100_000_000, [0.9847, 0.9855, 0.0134, 0.0142]),
];

/// Table 4: roots, ms of Carmack's, Lomont's and CUDA's.
const TABLE_4: [(u32, [f64; 3]); 4] = [
    (1_000_000, [0.042, 0.042, 0.048]),
    (10_000_000, [0.409, 0.409, 0.478]),
    (100_000_000, [4.102, 4.102, 4.722]),
    (1_000_000_000, [41.01, 41.01, 48.01]),
];

pub(super) fn pairs(objects: u64) -> u64 {
    objects * (objects - 1) / 2
}

/// Table 2. `times` has the times at each number of objects.
pub(super) fn table_2(times: &[Times]) -> Table {
    let title = "Avril, table 2: the mapping with a square root, and the lazy way";
    let columns = [
        "objects",
        "pairs",
        "paper_with_root_ms",
        "paper_lazy_ms",
        "paper_with_root_ns_per_pair",
        "paper_lazy_ns_per_pair",
        "ours_f32_sqrt_as_it_is_ns_per_pair",
        "ours_f32_sqrt_by_the_rules_ns_per_pair",
        "ours_lazy_ns_per_pair",
    ];
    let mut table = Table::new("table_2", title, &columns);
    for (objects, with, lazy) in TABLE_2 {
        let per_pair = |ms: f64| Cell::from(ms * 1e6 / pairs(objects) as f64);
        let ours = times.iter().find(|times| times.n as u64 == objects);
        let [as_it_is, by_rules] = [0, 1].map(|fix| ours.map(|times| times.f32_root()[fix]));
        let ours = [as_it_is, by_rules, ours.map(Times::lazy)].map(Cell::from);
        let paper = [objects.into(), pairs(objects).into(), with.into(), lazy.into()];
        table.row(paper.into_iter().chain([per_pair(with), per_pair(lazy)]).chain(ours));
    }
    table
}

/// Table 3: how many of the whole numbers below N have another root, without fractions.
pub(super) fn table_3(quick: bool) -> Table {
    let title = "Avril, table 3: whole numbers whose root without its fraction is wrong";
    let columns = [
        "tests",
        "constant",
        "steps",
        "paper_percent",
        "ours_all_in_f32_percent",
        "ours_steps_in_f64_percent",
    ];
    let mut table = Table::new("table_3", title, &columns);
    let most = if quick { 1_000_000 } else { u32::MAX };
    for (tests, paper) in TABLE_3.into_iter().filter(|(tests, _)| *tests <= most) {
        let percent = |errors: fn(u32) -> u64| errors(tests) as f64 / f64::from(tests) * 100.0;
        for (k, (name, steps, narrow, wide)) in ERRORS.into_iter().enumerate() {
            let paper = paper[k.min(2 + k % 2)];
            let head = [u64::from(tests).into(), Cell::from(name), u64::from(steps).into(), paper.into()];
            table.row(head.into_iter().chain([percent(narrow).into(), percent(wide).into()]));
        }
    }
    table
}

/// How many figures of the table are the paper's, by the number of steps: each step computed in f64, and all in f32.
pub(super) fn table_3_note(table: &Table) -> String {
    let told =
        |column: usize| (2..=4).map(|steps| agreement(table, steps, column)).collect::<Vec<_>>().join("; ");
    format!(
        "Table 3, figures that are the paper's to 0.0001%. Each step computed in f64 and rounded to f32: {}. All \
         in f32: {}.",
        told(5),
        told(4)
    )
}

/// "2 of 4 with 3 steps, all up to 1000 tests".
fn agreement(table: &Table, steps: u64, column: usize) -> String {
    let agrees = |row: &Vec<Cell>| match (&row[3], &row[column]) {
        (Cell::Number(paper), Cell::Number(ours)) => (paper - ours).abs() < 1e-4,
        _ => false,
    };
    let rows: Vec<_> = table.rows.iter().filter(|row| row[2] == Cell::Count(steps)).collect();
    let right = rows.iter().filter(|row| agrees(row)).count();
    // Rows are by tests, two of each: Carmack's and Lomont's.
    let all = rows.chunks(2).take_while(|two| two.iter().all(|row| agrees(row))).last();
    let most = all.map_or(String::new(), |two| format!(", all up to {} tests", two[0][0].text()));
    format!("{right} of {} with {steps} steps{most}", rows.len())
}

pub(super) const TABLE_4_NOTE: &str = "Table 4 does not say how many steps were taken; roots of whole numbers \
    from 1 on, four or more at once where the compiler does that.";

type Errors = fn(u32) -> u64;

const fn errors<R: SingleRoot, Wide: SingleRoot>() -> (Errors, Errors) {
    (root_errors::<R>, root_errors::<Wide>)
}

const fn carmack<const STEPS: u32>() -> (&'static str, u32, Errors, Errors) {
    let (narrow, wide) = errors::<Newton<CARMACK, STEPS>, WideNewton<CARMACK, STEPS>>();
    ("Carmack", STEPS, narrow, wide)
}

const fn lomont<const STEPS: u32>() -> (&'static str, u32, Errors, Errors) {
    let (narrow, wide) = errors::<Newton<LOMONT, STEPS>, WideNewton<LOMONT, STEPS>>();
    ("Lomont", STEPS, narrow, wide)
}

/// In the order of table 3, and those of four steps.
const ERRORS: [(&str, u32, Errors, Errors); 6] =
    [carmack::<2>(), lomont::<2>(), carmack::<3>(), lomont::<3>(), carmack::<4>(), lomont::<4>()];

/// Table 4: roots of the first N whole numbers, on one thread here.
pub(super) fn table_4(quick: bool) -> Table {
    let title = "Avril, table 4: time for square roots alone, there on a GPU, here on one thread";
    let columns = [
        "roots",
        "paper_carmack_ms",
        "paper_lomont_ms",
        "paper_cuda_ms",
        "ours_carmack_1_step_ms",
        "ours_carmack_2_steps_ms",
        "ours_lomont_2_steps_ms",
        "ours_f32_sqrt_ms",
    ];
    let mut table = Table::new("table_4", title, &columns);
    let most = if quick { 10_000_000 } else { u32::MAX };
    for (roots, paper) in TABLE_4.into_iter().filter(|(roots, _)| *roots <= most) {
        let ours = [
            roots_ms::<Newton<CARMACK, 1>>(roots),
            roots_ms::<Newton<CARMACK, 2>>(roots),
            roots_ms::<Newton<LOMONT, 2>>(roots),
            roots_ms::<Single>(roots),
        ];
        let all = paper.into_iter().chain(ours).map(Cell::from);
        table.row([Cell::from(u64::from(roots))].into_iter().chain(all));
    }
    table
}

/// The best of three.
fn roots_ms<R: SingleRoot>(count: u32) -> f64 {
    let bits = |x: u32| R::root(x as i32 as f32).to_bits();
    let sum = || (1..=count).fold(0u32, |sum, x| sum ^ bits(x));
    (0..3).map(|_| timed(|| std::hint::black_box(sum())).1).fold(f64::MAX, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_steps_in_f64_give_the_papers_table_3() {
        let table = table_3(true);
        let two_steps = |row: &&Vec<Cell>| row[2] == Cell::Count(2);
        for row in table.rows.iter().filter(two_steps) {
            let (Cell::Number(paper), Cell::Number(wide)) = (&row[3], &row[5]) else { panic!("{row:?}") };
            assert!((paper - wide).abs() < 1e-4, "{row:?}");
        }
        assert_eq!(table.rows.len(), 4 * 6);
        let note = table_3_note(&table);
        assert!(
            note.contains("8 of 8 with 2 steps, all up to 1000000 tests; 0 of 8 with 3 steps;"),
            "{note}"
        );
        // Lomont's two steps are the paper's in f32, too, up to 10,000 tests; Carmack's are not.
        assert!(note.contains("All in f32: 2 of 8 with 2 steps; 0 of 8 with 3 steps;"), "{note}");
    }

    #[test]
    fn the_papers_times_do_not_grow_with_the_pairs() {
        let table = table_2(&[]);
        let per_pair = |row: usize| match table.rows[row][4] {
            Cell::Number(ns) => ns,
            _ => f64::NAN,
        };
        assert!(per_pair(0) > 50.0 * per_pair(2));
    }
}
