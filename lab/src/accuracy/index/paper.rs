//! Avril's tables 3 and 4 beside ours.

use crate::index::{CARMACK, LOMONT, newton};
use crate::papers::printed::AVRIL_4;
use pbig_harness::prelude::*;

/// Table 3: tests; errors in percent with two steps (Carmack, Lomont) and with three. The paper says that four are as three.
const TABLE_3: [(u32, [f64; 4]); 6] = [
    (1000, [2.9, 2.9, 0.7, 0.7]),
    (10_000, [0.89, 0.89, 0.12, 0.12]),
    (100_000, [0.27, 0.27, 0.035, 0.035]),
    (1_000_000, [0.1800, 0.1803, 0.0110, 0.0111]),
    (10_000_000, [0.3681, 0.3685, 0.0040, 0.0057]),
    (100_000_000, [0.9847, 0.9855, 0.0134, 0.0142]),
];

/// Counts of wrong roots below a number.
type Errors = fn(u32) -> [u64; 3];

/// Counts wrong roots below a number: in f32 and with steps in f64 against the exact root, and the latter against f32's.
fn errors<const MAGIC: u32, const STEPS: u32>(below: u32) -> [u64; 3] {
    let (narrow, wide) = (newton::<MAGIC, STEPS, false>, newton::<MAGIC, STEPS, true>);
    [wrong_roots(narrow, false, below), wrong_roots(wide, false, below), wrong_roots(wide, true, below)]
}

/// The columns of table 3, and those of four steps.
const ERRORS: [(&str, u32, Errors); 6] = [
    ("Carmack", 2, errors::<CARMACK, 2>),
    ("Lomont", 2, errors::<LOMONT, 2>),
    ("Carmack", 3, errors::<CARMACK, 3>),
    ("Lomont", 3, errors::<LOMONT, 3>),
    ("Carmack", 4, errors::<CARMACK, 4>),
    ("Lomont", 4, errors::<LOMONT, 4>),
];

/// Counts whole numbers `1 <= x < below` whose root without its fraction is wrong: is not that of `x`, or `by_f32` not that of the
/// processor's f32 root. From 2^24 on, `x` is not always an f32, and these two differ.
fn wrong_roots(root: impl Fn(f32) -> f32, by_f32: bool, below: u32) -> u64 {
    let (mut wrong, mut exact) = (0, 1);
    for x in 1..below {
        exact += i32::from((exact + 1) * (exact + 1) <= x as i32);
        let single = x as i32 as f32;
        let right = if by_f32 { single.sqrt() as i32 } else { exact };
        wrong += u64::from(root(single) as i32 != right);
    }
    wrong
}

pub(super) fn table_3(quick: bool) -> Table {
    let columns = "tests | constant | steps | paper_percent | ours_all_in_f32_percent | \
        ours_steps_in_f64_percent | ours_steps_in_f64_against_f32_sqrt_percent";
    let mut table = Table::new("table_3", columns);
    let most = if quick { 1_000_000 } else { u32::MAX };
    for (tests, paper) in TABLE_3.into_iter().filter(|(tests, _)| *tests <= most) {
        for (k, (name, steps, errors)) in ERRORS.into_iter().enumerate() {
            let [all, wide, by_f32] = errors(tests).map(|count| count as f64 / f64::from(tests) * 100.0);
            table.row(cells![tests, name, steps, paper[k.min(2 + k % 2)], all, wide, by_f32]);
        }
    }
    table
}

/// Measures roots of the first whole numbers on one thread.
pub(super) fn table_4(quick: bool) -> Table {
    let columns = "roots | paper_carmack_ms | paper_lomont_ms | paper_cuda_ms | ours_carmack_1_step_ms | \
        ours_carmack_2_steps_ms | ours_carmack_3_steps_ms | ours_carmack_4_steps_ms | ours_lomont_1_step_ms | \
        ours_lomont_2_steps_ms | ours_lomont_3_steps_ms | ours_lomont_4_steps_ms | ours_f32_sqrt_ms";
    let roots: [fn(u32) -> f64; 9] = [
        |count| roots_ms(newton::<CARMACK, 1, false>, count),
        |count| roots_ms(newton::<CARMACK, 2, false>, count),
        |count| roots_ms(newton::<CARMACK, 3, false>, count),
        |count| roots_ms(newton::<CARMACK, 4, false>, count),
        |count| roots_ms(newton::<LOMONT, 1, false>, count),
        |count| roots_ms(newton::<LOMONT, 2, false>, count),
        |count| roots_ms(newton::<LOMONT, 3, false>, count),
        |count| roots_ms(newton::<LOMONT, 4, false>, count),
        |count| roots_ms(f32::sqrt, count),
    ];
    let mut table = Table::new("table_4", columns);
    let most = if quick { 10_000_000 } else { u64::MAX };
    for row in AVRIL_4.iter().filter(|row| row.roots <= most) {
        let paper = [row.approximate, row.approximate, row.cuda];
        let ours = roots.map(|ms| ms(row.roots as u32));
        table.row(cells![row.roots].into_iter().chain(paper.into_iter().chain(ours).map(Into::into)));
    }
    table
}

/// Returns the milliseconds of the best of three.
fn roots_ms(root: impl Fn(f32) -> f32, count: u32) -> f64 {
    let sum = || (1..=count).fold(0u32, |sum, x| sum ^ root(x as i32 as f32).to_bits());
    (0..3).map(|_| timed(|| std::hint::black_box(sum())).1).fold(f64::MAX, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_processors_root_is_right_up_to_2_to_the_24th() {
        assert_eq!(wrong_roots(f32::sqrt, false, 1_000_000), 0);
        assert_eq!(wrong_roots(f32::sqrt, true, 30_000_000), 0);
        assert!(wrong_roots(f32::sqrt, false, 30_000_000) > 0);
        assert!(wrong_roots(newton::<LOMONT, 2, false>, false, 1_000_000) > 0);
    }
}
