//! Avril's tables 3 and 4 beside ours.

use crate::index::newton;
use crate::papers::printed::{AVRIL_3, AVRIL_4};
use pbig_harness::prelude::*;

/// Counts of wrong roots below a number: all in f32, and with steps in f64.
type Errors = fn(u32) -> [u64; 2];

fn errors<const STEPS: u32>(below: u32) -> [u64; 2] {
    [wrong_roots(newton::<STEPS, false>, below), wrong_roots(newton::<STEPS, true>, below)]
}

/// Numbers of steps.
const ERRORS: [(u32, Errors); 3] = [(2, errors::<2>), (3, errors::<3>), (4, errors::<4>)];

/// Counts whole numbers `1 <= x < below` whose root without its fraction is not that of `x`. From 2^24 on, `x` is not always an f32.
fn wrong_roots(root: impl Fn(f32) -> f32, below: u32) -> u64 {
    let (mut wrong, mut exact) = (0, 1);
    for x in 1..below {
        exact += i32::from((exact + 1) * (exact + 1) <= x as i32);
        wrong += u64::from(root(x as i32 as f32) as i32 != exact);
    }
    wrong
}

pub(super) fn table_3(quick: bool) -> Table {
    let columns = "tests | steps | paper_percent | ours_all_in_f32_percent | ours_steps_in_f64_percent";
    let mut table = Table::new("table_3", columns);
    let most = if quick { 1_000_000 } else { u32::MAX };
    for (tests, [two, three]) in AVRIL_3.into_iter().filter(|(tests, _)| *tests <= most) {
        // The paper says that four steps are as three.
        for ((steps, errors), paper) in ERRORS.into_iter().zip([two, three, three]) {
            let percent = errors(tests).map(|count| count as f64 / f64::from(tests) * 100.0);
            table.row(cells![tests, steps, paper, ..percent]);
        }
    }
    table
}

/// Measures roots of the first whole numbers on one thread.
pub(super) fn table_4(quick: bool) -> Table {
    let columns = "roots | paper_carmack_ms | paper_cuda_ms | ours_carmack_1_step_ms | ours_carmack_2_steps_ms | \
        ours_carmack_3_steps_ms | ours_carmack_4_steps_ms | ours_f32_sqrt_ms";
    let roots: [fn(u32) -> f64; 5] = [
        |count| roots_ms(newton::<1, false>, count),
        |count| roots_ms(newton::<2, false>, count),
        |count| roots_ms(newton::<3, false>, count),
        |count| roots_ms(newton::<4, false>, count),
        |count| roots_ms(f32::sqrt, count),
    ];
    let mut table = Table::new("table_4", columns);
    let most = if quick { 10_000_000 } else { u32::MAX };
    for (count, paper) in AVRIL_4.into_iter().filter(|(count, _)| *count <= most) {
        table.row(cells![count, ..paper, ..roots.map(|ms| ms(count))]);
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
        assert_eq!(wrong_roots(f32::sqrt, 1 << 24), 0);
        assert!(wrong_roots(f32::sqrt, 30_000_000) > 0 && wrong_roots(newton::<2, false>, 1_000_000) > 0);
    }
}
