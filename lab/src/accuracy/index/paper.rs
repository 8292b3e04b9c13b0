//! Avril's tables 3 and 4 beside ours, and a search for the rounding that gives table 3.

use crate::index::{CARMACK, LOMONT, newton};
use crate::papers::printed::AVRIL_4;
use pbig_harness::prelude::*;
use rayon::prelude::*;

/// Table 3: tests; errors in percent with two steps (Carmack, Lomont) and with three; and half of what the last digit counts, with
/// two and with three. The paper says that four are as three.
const TABLE_3: [(u32, [f64; 4], [f64; 2]); 6] = [
    (1000, [2.9, 2.9, 0.7, 0.7], [0.05, 0.05]),
    (10_000, [0.89, 0.89, 0.12, 0.12], [0.005, 0.005]),
    (100_000, [0.27, 0.27, 0.035, 0.035], [0.005, 5e-4]),
    (1_000_000, [0.1800, 0.1803, 0.0110, 0.0111], [5e-5, 5e-5]),
    (10_000_000, [0.3681, 0.3685, 0.0040, 0.0057], [5e-5, 5e-5]),
    (100_000_000, [0.9847, 0.9855, 0.0134, 0.0142], [5e-5, 5e-5]),
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
    for (tests, paper, _) in TABLE_3.into_iter().filter(|(tests, ..)| *tests <= most) {
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

/// Returns the result of one operation: the nearest f32, the next f32 towards zero (as devices of 2008 cut the product of a
/// multiply-add), or a number that stays in a wider register.
type Rounding = fn(f64) -> f64;

const ROUNDINGS: [Rounding; 3] = [
    |x| (x as f32).into(),
    |x| {
        let nearest = x as f32;
        let is_above = f64::from(nearest).abs() > x.abs();
        if is_above { f32::from_bits(nearest.to_bits() - 1).into() } else { nearest.into() }
    },
    |x| x,
];

/// One step `y (1.5 - h y y)`: true if y is squared first; the roundings of both products, the difference and the new `y`.
type Step = (bool, [Rounding; 4]);

fn steps() -> Vec<Step> {
    let rounding = |code: usize, place: u32| ROUNDINGS[code / 3usize.pow(place) % 3];
    let one = |code: usize| (code.is_multiple_of(2), std::array::from_fn(|k| rounding(code / 2, k as u32)));
    (0..2 * 81).map(one).collect()
}

fn next((square_first, [first, second, difference, product]): Step, half: f64, y: f64) -> f64 {
    let scaled = if square_first { half * first(y * y) } else { first(half * y) * y };
    product(y * difference(1.5 - second(scaled)))
}

/// The names of what is made of the last `y`: the whole number below `x y`, the one above, or the one below `1 / y`.
const FORMS: [&str; 3] = ["x y cut", "x y rounded up", "1 / y cut"];

/// A way to round: the first two steps alike, later steps alike, the form, and the last operation.
type RoundedRoot = ([Step; 2], usize, Rounding);

/// Returns the root as a whole number.
fn rounded((steps, form, last): RoundedRoot, magic: u32, count: usize, x: u32) -> u32 {
    let half = f64::from(x as f32 * 0.5);
    let mut y = f64::from(f32::from_bits(magic - ((x as f32).to_bits() >> 1)));
    for step in 0..count {
        y = next(steps[step / 2], half, y);
    }
    match form {
        0 => last(f64::from(x) * y) as u32,
        1 => last(f64::from(x) * y).ceil() as u32,
        _ => last(1.0 / y) as u32,
    }
}

/// Counts wrong roots of `1 <= x < below <= 2^24` after two steps or more. These are off by less than one in 200,000, so only
/// numbers near a square can be wrong.
fn errors_of(way: RoundedRoot, magic: u32, steps: usize, below: u32) -> u64 {
    let near = |root: u32| {
        let (square, reach) = (root * root, 2 + root * root / 100_000);
        square - reach.min(root - 1)..=square + reach.min(root)
    };
    let exact = |x: u32| x.isqrt() + u32::from(way.1 == 1 && x.isqrt().pow(2) < x);
    let all = (1..=below.isqrt() + 1).flat_map(near).filter(|x| (1..below).contains(x));
    all.filter(|x| rounded(way, magic, steps, *x) != exact(*x)).count() as u64
}

/// Returns true if a way gives both constants' figures in the rows of table 3 up to 1,000,000 tests.
fn gives_the_figures(way: RoundedRoot, steps: usize) -> bool {
    let late = usize::from(steps > 2);
    let is_printed = |tests: u32, printed: f64, half: f64, magic| {
        let percent = errors_of(way, magic, steps, tests) as f64 / f64::from(tests) * 100.0;
        (percent - printed).abs() <= half
    };
    TABLE_3[..4].iter().all(|&(tests, paper, half)| {
        let [carmack, lomont] = [paper[2 * late], paper[2 * late + 1]];
        is_printed(tests, carmack, half[late], CARMACK) && is_printed(tests, lomont, half[late], LOMONT)
    })
}

/// Returns the number of ways to round, and the number of ways that give the figures.
fn ways(form: usize, count: usize) -> [usize; 2] {
    let all = steps();
    let late = if count > 2 { &all[..] } else { &all[..1] };
    let of_early = |early: &Step| {
        let ways = late.iter().flat_map(|late| ROUNDINGS.map(|last| ([*early, *late], form, last)));
        ways.filter(|way| gives_the_figures(*way, count)).count()
    };
    [all.len() * late.len() * ROUNDINGS.len(), all.par_iter().map(of_early).sum()]
}

/// Counts the roundings that give the figures of table 3. The paper says that four steps are as three.
pub(super) fn roundings() -> Table {
    let mut table = Table::new("roundings_of_table_3", "result | steps | ways | with_the_figures");
    for (form, steps) in (0..FORMS.len()).flat_map(|form| [2, 3, 4].map(|steps| (form, steps))) {
        let [all, with] = ways(form, steps);
        table.row(cells![FORMS[form], steps, all, with]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_roots_lie_near_squares_up_to_2_to_the_24th() {
        let [nearest, _, wide] = ROUNDINGS;
        let with = |roundings| ([(false, roundings); 2], 0, nearest);
        for below in [4, 1000, 99_856, 1_000_000] {
            let [narrow, of_wide, by_f32] = errors::<LOMONT, 2>(below);
            assert_eq!(errors_of(with([nearest; 4]), LOMONT, 2, below), narrow);
            assert_eq!(errors_of(with([wide, wide, wide, nearest]), LOMONT, 2, below), of_wide);
            assert_eq!((of_wide, wrong_roots(f32::sqrt, false, below)), (by_f32, 0));
        }
        assert_eq!(wrong_roots(f32::sqrt, true, 30_000_000), 0);
        assert!(wrong_roots(f32::sqrt, false, 30_000_000) > 0);
    }

    #[test]
    fn a_cut_product_gives_the_figures_of_two_steps() {
        assert_eq!([ways(0, 2), ways(0, 3)], [[3 * 162, 2], [3 * 162 * 162, 0]]);
    }
}
