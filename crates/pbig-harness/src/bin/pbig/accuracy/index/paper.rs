//! Figures of Avril et al. 2012, and ours beside them.

use super::super::study::{Cell, Table};
use super::times::Times;
use crate::bench::measure::timed;
use pbig_harness::index::{CARMACK, LOMONT, Newton, Single, SingleRoot, WideNewton};
use pbig_harness::index::{root_differences, root_errors};

/// Table 2: objects, ms with a square root, ms without (the lazy way).
pub(super) const TABLE_2: [(u64, f64, f64); 3] =
    [(1000, 0.21, 0.25), (10_000, 2.25, 4.28), (100_000, 29.66, 58.24)];

/// Table 3: tests, % of errors with two steps (Carmack, Lomont) and with three; four are said to be as three.
pub(super) const TABLE_3: [(u32, [f64; 4]); 6] = [
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
        "ours_f64_sqrt_ns_per_pair",
        "ours_lazy_ns_per_pair",
        "lazy_times_f32_by_the_rules",
        "lazy_times_f64",
    ];
    let mut table = Table::new("table_2", title, &columns);
    for (objects, with, lazy) in TABLE_2 {
        let per_pair = |ms: f64| Cell::from(ms * 1e6 / pairs(objects) as f64);
        let ours = times.iter().find(|times| times.n as u64 == objects).map(ours_of_table_2);
        let ours = (0..6).map(|column| Cell::from(ours.map(|all| all[column])));
        let paper = [objects.into(), pairs(objects).into(), with.into(), lazy.into()];
        table.row(paper.into_iter().chain([per_pair(with), per_pair(lazy)]).chain(ours));
    }
    table
}

/// Nanoseconds for a pair: f32 root as it is and by the rules, f64 root, lazy way; and the latter over the two before it
/// that give every pair.
fn ours_of_table_2(times: &Times) -> [f64; 6] {
    let ([as_it_is, by_rules], wide, lazy) = (times.f32_root(), times.f64_root(), times.lazy());
    [as_it_is, by_rules, wide, lazy, lazy / by_rules, lazy / wide]
}

/// Table 3: how many of the whole numbers below N have another root, without fractions. The root that ours are held against
/// is exact, but for the last column.
pub(super) fn table_3(quick: bool) -> Table {
    let title = "Avril, table 3: whole numbers whose root without its fraction is wrong";
    let columns = [
        "tests",
        "constant",
        "steps",
        "paper_percent",
        "ours_all_in_f32_percent",
        "ours_steps_in_f64_percent",
        "ours_steps_in_f64_against_f32_sqrt_percent",
    ];
    let mut table = Table::new("table_3", title, &columns);
    let most = if quick { 1_000_000 } else { u32::MAX };
    for (tests, paper) in TABLE_3.into_iter().filter(|(tests, _)| *tests <= most) {
        let percent = |errors: fn(u32) -> u64| errors(tests) as f64 / f64::from(tests) * 100.0;
        for (k, (name, steps, errors)) in ERRORS.into_iter().enumerate() {
            let paper = paper[k.min(2 + k % 2)];
            let head = [u64::from(tests).into(), Cell::from(name), u64::from(steps).into(), paper.into()];
            table.row(head.into_iter().chain(errors.map(percent).map(Cell::from)));
        }
    }
    table
}

/// Counts the figures that equal the paper's, by the number of steps, for each way to compute and to judge a root.
pub(super) fn table_3_note(table: &Table) -> String {
    let told =
        |column: usize| (2..=4).map(|steps| agreement(table, steps, column)).collect::<Vec<_>>().join("; ");
    let right = |column: usize| table.rows.iter().filter(|row| is_papers(row, column)).count();
    let verdict = match right(6) > right(5) {
        true => " So what the paper calls \"the computed square root\" is one in f32.",
        false => "",
    };
    format!(
        "Table 3, figures that are the paper's to 0.0001%. Each step computed in f64 and rounded to f32, held against \
         the processor's f32 root of the number rounded to f32: {}. The same held against the exact root: {}; the two \
         differ from 2^24 on, where not every whole number is an f32. All in f32 against the exact root: {}.{verdict}",
        told(6),
        told(5),
        told(4)
    )
}

/// "2 of 4 with 3 steps, all up to 1000 tests".
fn agreement(table: &Table, steps: u64, column: usize) -> String {
    let agrees = |row: &Vec<Cell>| is_papers(row, column);
    let rows: Vec<_> = table.rows.iter().filter(|row| row[2] == Cell::Count(steps)).collect();
    let right = rows.iter().filter(|row| agrees(row)).count();
    // Rows are by tests, two of each: Carmack's and Lomont's.
    let all = rows.chunks(2).take_while(|two| two.iter().all(|row| agrees(row))).last();
    let most = all.map_or(String::new(), |two| format!(", all up to {} tests", two[0][0].text()));
    format!("{right} of {} with {steps} steps{most}", rows.len())
}

/// Returns true if a row of ours equals the paper's to 0.0001%.
fn is_papers(row: &[Cell], column: usize) -> bool {
    match (&row[3], &row[column]) {
        (Cell::Number(paper), Cell::Number(ours)) => (paper - ours).abs() < 1e-4,
        _ => false,
    }
}

/// Compares each number of steps with the processor's root: here, at most numbers, and as printed.
pub(super) fn table_4_note(table: &Table) -> String {
    let number = |column: usize| match table.rows.last().map(|row| &row[column]) {
        Some(Cell::Number(ms)) => *ms,
        _ => f64::NAN,
    };
    let ours = (1..=4).map(|steps| format!("{:.2} with {steps}", number(3 + steps) / number(12)));
    format!(
        "Table 4 does not say how many steps were taken. Ours are roots of whole numbers from 1 on, four or more at once \
         where the compiler does that. Time of Carmack's over that of the root without it, in the last row: printed {:.2}; \
         ours {}.",
        number(1) / number(3),
        ours.collect::<Vec<_>>().join(", ")
    )
}

/// Counts wrong roots below a number: all in f32 and each step in f64, against the exact root; and the latter against f32's.
type Errors = [fn(u32) -> u64; 3];

const fn errors<R: SingleRoot, Wide: SingleRoot>() -> Errors {
    [root_errors::<R>, root_errors::<Wide>, root_differences::<Wide>]
}

const fn carmack<const STEPS: u32>() -> (&'static str, u32, Errors) {
    ("Carmack", STEPS, errors::<Newton<CARMACK, STEPS>, WideNewton<CARMACK, STEPS>>())
}

const fn lomont<const STEPS: u32>() -> (&'static str, u32, Errors) {
    ("Lomont", STEPS, errors::<Newton<LOMONT, STEPS>, WideNewton<LOMONT, STEPS>>())
}

/// In the order of table 3, and those of four steps.
const ERRORS: [(&str, u32, Errors); 6] =
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
        "ours_carmack_3_steps_ms",
        "ours_carmack_4_steps_ms",
        "ours_lomont_1_step_ms",
        "ours_lomont_2_steps_ms",
        "ours_lomont_3_steps_ms",
        "ours_lomont_4_steps_ms",
        "ours_f32_sqrt_ms",
    ];
    let mut table = Table::new("table_4", title, &columns);
    let most = if quick { 10_000_000 } else { u32::MAX };
    for (roots, paper) in TABLE_4.into_iter().filter(|(roots, _)| *roots <= most) {
        let ours = [
            roots_ms::<Newton<CARMACK, 1>>(roots),
            roots_ms::<Newton<CARMACK, 2>>(roots),
            roots_ms::<Newton<CARMACK, 3>>(roots),
            roots_ms::<Newton<CARMACK, 4>>(roots),
            roots_ms::<Newton<LOMONT, 1>>(roots),
            roots_ms::<Newton<LOMONT, 2>>(roots),
            roots_ms::<Newton<LOMONT, 3>>(roots),
            roots_ms::<Newton<LOMONT, 4>>(roots),
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
        let wide = "8 of 8 with 2 steps, all up to 1000000 tests; 0 of 8 with 3 steps;";
        assert_eq!(note.matches(wide).count(), 2, "{note}");
        // Lomont's two steps are the paper's in f32, too, up to 10,000 tests; Carmack's are not.
        let narrow = "All in f32 against the exact root: 2 of 8 with 2 steps; 0 of 8 with 3 steps;";
        assert!(note.contains(narrow), "{note}");
    }

    /// 0.9847 and 0.9855, which the exact root does not give.
    #[test]
    fn against_a_root_in_f32_two_steps_are_the_papers_up_to_100_million_tests() {
        let (tests, paper) = TABLE_3[5];
        for (k, (_, _, [_, exact, single])) in ERRORS.into_iter().take(2).enumerate() {
            let off = |errors: u64| (errors as f64 / f64::from(tests) * 100.0 - paper[k]).abs();
            assert!(off(single(tests)) < 1e-4 && off(exact(tests)) > 0.01, "{}", off(single(tests)));
        }
    }

    #[test]
    fn times_of_table_4_are_told_by_the_number_of_steps() {
        let mut table = Table::new("table_4", "", &[]);
        table.row([1e9, 4.0, 4.0, 8.0, 1.0, 2.0, 3.0, 6.0, 0.0, 0.0, 0.0, 0.0, 2.0].map(Cell::from));
        let told = table_4_note(&table);
        assert!(
            told.ends_with("printed 0.50; ours 0.50 with 1, 1.00 with 2, 1.50 with 3, 3.00 with 4."),
            "{told}"
        );
    }

    #[test]
    fn the_lazy_way_stands_over_both_roots() {
        let times = Times {
            n: 1000,
            ways: std::array::from_fn(|way| [way as f64 + 1.0, 4.0, 9.0]),
            exact: [9.0, 9.0, 6.0],
        };
        let right = [1.0, 4.0, 2.0, 6.0, 1.5, 3.0].map(Cell::Number);
        assert_eq!(table_2(&[times]).rows[0][6..], right);
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
