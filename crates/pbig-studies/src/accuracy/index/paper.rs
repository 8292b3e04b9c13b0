//! Figures of Avril et al. 2012, and ours beside them.

use super::times::Times;
use crate::index::{CARMACK, LOMONT, Newton, Single, SingleRoot, WideNewton};
use crate::index::{root_differences, root_errors};
use pbig_harness::bench::timed;
use pbig_harness::cells;
use pbig_harness::table::{Cell, Table};

/// Table 2: objects, ms with a square root, ms without (the lazy way).
const TABLE_2: [(u64, f64, f64); 3] = [(1000, 0.21, 0.25), (10_000, 2.25, 4.28), (100_000, 29.66, 58.24)];

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

fn pairs(objects: u64) -> u64 {
    objects * (objects - 1) / 2
}

/// Table 2. `times` has the times at each number of objects.
pub(super) fn table_2(times: &[Times]) -> Table {
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
    let mut table = Table::new("table_2", columns);
    for (objects, with, lazy) in TABLE_2 {
        let per_pair = |ms: f64| Cell::from(ms * 1e6 / pairs(objects) as f64);
        let ours = times.iter().find(|times| times.n as u64 == objects).map(ours_of_table_2);
        let ours = (0..6).map(|column| Cell::from(ours.map(|all| all[column])));
        let paper = cells![objects, pairs(objects), with, lazy];
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
    let columns = [
        "tests",
        "constant",
        "steps",
        "paper_percent",
        "ours_all_in_f32_percent",
        "ours_steps_in_f64_percent",
        "ours_steps_in_f64_against_f32_sqrt_percent",
    ];
    let mut table = Table::new("table_3", columns);
    let most = if quick { 1_000_000 } else { u32::MAX };
    for (tests, paper) in TABLE_3.into_iter().filter(|(tests, _)| *tests <= most) {
        let percent = |errors: fn(u32) -> u64| errors(tests) as f64 / f64::from(tests) * 100.0;
        for (k, (name, steps, errors)) in ERRORS.into_iter().enumerate() {
            let paper = paper[k.min(2 + k % 2)];
            let head = cells![tests, name, steps, paper];
            table.row(head.into_iter().chain(errors.map(percent).map(Cell::from)));
        }
    }
    table
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
    let mut table = Table::new("table_4", columns);
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
        table.row(cells![roots].into_iter().chain(all));
    }
    table
}

/// The best of three.
fn roots_ms<R: SingleRoot>(count: u32) -> f64 {
    let bits = |x: u32| R::root(x as i32 as f32).to_bits();
    let sum = || (1..=count).fold(0u32, |sum, x| sum ^ bits(x));
    (0..3).map(|_| timed(|| std::hint::black_box(sum())).1).fold(f64::MAX, f64::min)
}
