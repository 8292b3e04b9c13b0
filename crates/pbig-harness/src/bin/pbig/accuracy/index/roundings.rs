//! Whether any rounding of Newton's steps gives Avril's table 3.

use super::paper::TABLE_3;
use pbig_harness::index::{CARMACK, LOMONT, Newton, Rounded, SingleRoot, Step, WideNewton};
use rayon::prelude::*;

/// Rows of the table that are held against, and half of what the last digit counts there: with two steps, with three.
const ROWS: [[f64; 2]; 4] = [[0.05, 0.05], [0.005, 0.005], [0.005, 5e-4], [5e-5, 5e-5]];

/// Of ways to round, how many there are and how many give the table's figures of both constants in its first rows: those
/// up to 100,000 tests, and those up to 1,000,000.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Found {
    ways: usize,
    few: usize,
    all: usize,
}

impl Found {
    fn and(self, other: Self) -> Self {
        Self { ways: self.ways + other.ways, few: self.few + other.few, all: self.all + other.all }
    }

    fn told(&self, steps: u32) -> String {
        let Self { ways, few, all } = self;
        format!("with {steps} steps, of {ways} ways {few} up to 100000 tests and {all} up to 1000000")
    }
}

/// Every way to round so many steps. Two are rounded alike, and so are those beyond, in a way of their own.
fn found(steps: u32) -> Found {
    let all = Step::all();
    let of_early = |early: &Step| {
        let late = if steps > 2 { &all[..] } else { std::slice::from_ref(early) };
        let ways = late.iter().flat_map(|late| Rounded::all(*early, *late));
        ways.map(|way| judged(&way, steps)).fold(Found::default(), Found::and)
    };
    all.par_iter().map(of_early).reduce(Found::default, Found::and)
}

fn judged(way: &Rounded, steps: u32) -> Found {
    let rows = (0..ROWS.len()).take_while(|&row| is_printed(way, steps, row)).count();
    Found { ways: 1, few: usize::from(rows >= 3), all: usize::from(rows == ROWS.len()) }
}

/// Whether the errors of both constants are those of a row of the table, to its last digit.
fn is_printed(way: &Rounded, steps: u32, row: usize) -> bool {
    let ((tests, paper), late) = (TABLE_3[row], usize::from(steps > 2));
    [CARMACK, LOMONT].into_iter().enumerate().all(|(k, magic)| {
        let percent = way.errors(magic, steps, tests) as f64 / f64::from(tests) * 100.0;
        (percent - paper[2 * late + k]).abs() <= ROWS[row][late]
    })
}

/// What rounding can tell of the table.
pub(super) fn note() -> String {
    let [two, three, four] = [2, 3, 4].map(|steps| (steps, found(steps)));
    let verdict = match (two.1.all, three.1.all, four.1.all) {
        (0, ..) => "So no rounding of these explains any of it",
        (_, 0, 0) => {
            "So the figures for 2 steps are those of a known arithmetic, and those for 3 and 4 of none of these"
        }
        _ => "So one and the same machine may have given them",
    };
    let told = [two, three, four].map(|(steps, found)| found.told(steps));
    format!(
        "Table 3, every rounding. Of the four operations of a step, y (1.5 - h y y), each result can be rounded to the \
         nearest f32, cut to the next towards zero (as the multiply-add of the paper's device cuts its product), or stay \
         wide; and the product can begin with h y or y y. So there are {} ways for a step. The first two steps go one \
         way, a third and fourth another, and x y has three ways. Both constants' figures come out: {}. {verdict}. Both \
         halves of the table are held against the same root, so the difference is in the steps. The paper does not say on \
         what its test ran.",
        Step::all().len(),
        told.join("; ")
    )
}

/// What is wrong with three steps, and how many squares the paper's figures would be.
pub(super) fn squares_note() -> String {
    const TESTS: u32 = 1_000_000;
    let wrong = |root: fn(f32) -> f32| {
        let is_wrong = |x: &u32| root(*x as f32) as u32 != x.isqrt();
        let all = (1..TESTS).filter(is_wrong);
        all.fold((0, 0), |(all, squares), x| (all + 1, squares + u32::from(x.isqrt().pow(2) == x)))
    };
    let told = [
        ("in f64", WideNewton::<CARMACK, 3>::root as fn(f32) -> f32),
        ("in f32", Newton::<CARMACK, 3>::root),
    ];
    let told = told.map(|(name, root)| {
        let (all, squares) = wrong(root);
        format!("{squares} of the {all} wrong ones are squares with steps {name}")
    });
    let papers = TABLE_3[..4].iter().map(|&(tests, percent)| {
        let wrong = (percent[2] / 100.0 * f64::from(tests)).round();
        format!("{wrong} of {} below {tests}", (tests - 1).isqrt())
    });
    format!(
        "Table 3, what 3 steps get wrong: below {TESTS}, {}. A root is then off by its last bit at most, and only a square \
         loses its whole part by that. The paper's figures for Carmack are so many of all squares: {}. So they count how a \
         machine rounds a last bit, and tell little of the method.",
        told.join(", "),
        papers.collect::<Vec<_>>().join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_rounding_gives_the_figures_of_two_steps_and_none_those_of_three() {
        let [two, three] = [2, 3].map(found);
        assert_eq!((two.ways, three.ways), (3 * 162, 3 * 162 * 162));
        assert!(two.all > 0 && two.all < two.ways / 10, "{two:?}");
        assert!(three.few < 10 && three.all == 0, "{three:?}");
    }

    #[test]
    fn with_three_steps_only_squares_are_wrong() {
        let told = squares_note();
        assert!(told.contains("67 of the 67 wrong ones are squares with steps in f64"), "{told}");
        assert!(told.contains("214 of the 214 wrong ones are squares with steps in f32"), "{told}");
        assert!(
            told.contains("7 of 31 below 1000, 12 of 99 below 10000, 35 of 316 below 100000, 110 of 999"),
            "{told}"
        );
    }
}
