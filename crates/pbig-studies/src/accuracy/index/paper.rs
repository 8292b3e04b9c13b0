//! Figures of Avril et al. 2012, and ours beside them.

use crate::index::{CARMACK, LOMONT, Newton, Single, SingleRoot, WideNewton};
use crate::index::{root_differences, root_errors};
use pbig_harness::bench::timed;
use pbig_harness::cells;
use pbig_harness::table::{Cell, Table};

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
