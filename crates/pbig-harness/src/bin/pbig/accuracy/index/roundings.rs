//! A search for a rounding of Newton's steps that gives Avril's table 3.

use super::paper::TABLE_3;
use pbig_harness::index::{CARMACK, Form, LOMONT, Newton, Rounded, SingleRoot, Step, WideNewton};
use rayon::prelude::*;

/// Rows of the table that are held against, and half of what the last digit counts there: with two steps, with three.
const ROWS: [[f64; 2]; 4] = [[0.05, 0.05], [0.005, 0.005], [0.005, 5e-4], [5e-5, 5e-5]];

/// Of ways to round, how many there are and how many give the table's figures of both constants in its first rows: those
/// up to 100,000 tests, and those up to 1,000,000; and how many give all of Carmack's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Found {
    ways: usize,
    few: usize,
    all: usize,
    carmack: usize,
}

impl Found {
    fn and(self, other: Self) -> Self {
        self.by(other, |a, b| a + b)
    }

    fn by(self, other: Self, of: fn(usize, usize) -> usize) -> Self {
        Self {
            ways: of(self.ways, other.ways),
            few: of(self.few, other.few),
            all: of(self.all, other.all),
            carmack: of(self.carmack, other.carmack),
        }
    }

    fn told(&self, steps: &str) -> String {
        let Self { ways, few, all, carmack } = self;
        format!("{steps}, of {ways} ways {few}, {all} and {carmack}")
    }
}

/// With two steps, with three, with four, and with each of these in one and the same way.
type Counts = [Found; 4];

const STEPS: [&str; 4] = ["with 2 steps", "with 3", "with 4", "with each of these"];

fn sum(a: Counts, b: Counts) -> Counts {
    std::array::from_fn(|k| a[k].and(b[k]))
}

/// Every way to round that ends in a form. Two steps are rounded alike, and so are those beyond, in a way of their own.
fn found(form: Form) -> Counts {
    let all = Step::all();
    let of_early = |early: &Step| {
        let two = Rounded::all(*early, *early, form).map(|way| judged(&way, 2));
        let two =
            [two.fold(Found::default(), Found::and), Found::default(), Found::default(), Found::default()];
        let ways = all.iter().flat_map(|late| Rounded::all(*early, *late, form));
        ways.map(|way| beyond_two(&way)).fold(two, sum)
    };
    all.par_iter().map(of_early).reduce(Counts::default, sum)
}

/// Two steps are looked at only where three are the table's: few are.
fn beyond_two(way: &Rounded) -> Counts {
    let [three, four] = [3, 4].map(|steps| judged(way, steps));
    let two =
        if three.carmack + three.few > 0 { judged(way, 2) } else { Found { ways: 1, ..Found::default() } };
    [Found::default(), three, four, two.by(three, usize::min).by(four, usize::min)]
}

fn judged(way: &Rounded, steps: u32) -> Found {
    let carmack = rows(way, (CARMACK, 0), steps, ROWS.len());
    let both = rows(way, (LOMONT, 1), steps, carmack);
    let is = |rows: usize, least: usize| usize::from(rows >= least);
    Found { ways: 1, few: is(both, 3), all: is(both, ROWS.len()), carmack: is(carmack, ROWS.len()) }
}

/// In how many of the first rows, of so many, the errors of a constant are the table's to its last digit.
fn rows(way: &Rounded, (magic, column): (u32, usize), steps: u32, most: usize) -> usize {
    let late = usize::from(steps > 2);
    let is_printed = |row: &usize| {
        let (tests, paper) = TABLE_3[*row];
        let percent = way.errors(magic, steps, tests) as f64 / f64::from(tests) * 100.0;
        (percent - paper[2 * late + column]).abs() <= ROWS[*row][late]
    };
    (0..most).take_while(is_printed).count()
}

/// Says how far rounding explains the table.
pub(super) fn note() -> String {
    let forms = Form::ALL.map(|form| (form.name(), found(form)));
    let told = forms.map(|(name, counts)| {
        let each: Vec<_> = STEPS.iter().zip(counts).map(|(steps, found)| found.told(steps)).collect();
        format!("{name}: {}", each.join("; "))
    });
    format!(
        "Table 3, every rounding. Of the four operations of a step, y (1.5 - h y y), each result can be rounded to the \
         nearest f32, cut to the next towards zero (as the multiply-add of the paper's device cuts its product), or stay \
         wide; and the product can begin with h y or y y. So there are {} ways for a step. The first two steps go one \
         way, a third and fourth another. Of the result the whole number can be x y cut, x y rounded up (which is held \
         against the exact root rounded up), or 1 / y cut, and x y and 1 / y can be rounded in three ways. (Of these, cut and \
         wide differ by a fraction alone, which makes no difference to a number that is cut: both count.) How many of these \
         ways give both constants' figures up to 100000 tests, both up to 1000000, and Carmack's alone up to 1000000; rows \
         beyond are not looked at. {}. {}{}. The paper does not say on what its test ran.",
        Step::all().len(),
        told.join(". "),
        alike(&forms),
        verdict(&forms.map(|(_, counts)| counts).into_iter().fold(Counts::default(), sum))
    )
}

/// Says if two forms have the same counts.
fn alike(forms: &[(&str, Counts); 3]) -> String {
    match forms {
        [_, (up, one), (reciprocal, other)] if one == other => {
            format!("{up} and {reciprocal} have the same counts. ")
        }
        _ => String::new(),
    }
}

fn verdict([two, three, four, same]: &Counts) -> &'static str {
    match () {
        () if two.all == 0 => "So none of these gives the figures for 2 steps",
        () if same.all > 0 => "So one and the same machine may have given all these figures",
        () if same.few > 0 => {
            "So one and the same machine may have given all these figures up to 100000 tests, but not beyond"
        }
        () if three.all.min(four.all) > 0 => {
            "So the figures for 2 steps are those of some of these ways, and those for 3 and 4 of others: no way gives all"
        }
        () if three.few.min(four.few) > 0 => {
            "So the figures for 2 steps are those of some of these ways, and those for 3 and 4 up to 100000 tests of \
             others: no way gives all, and beyond that not both of those for 3 and 4 come out"
        }
        () => {
            "So the figures for 2 steps are those of some of these ways, and those for 3 and 4 are not both explained"
        }
    }
}

const TESTS: u32 = 1_000_000;

/// Of the whole numbers below [`TESTS`]: those whose root without its fraction is wrong, the squares among them, and by how
/// many ulps the root of a square is off at most.
fn wrong(root: fn(f32) -> f32) -> [u32; 3] {
    let is_square = |x: u32| x.isqrt().pow(2) == x;
    let is_wrong = |x: &u32| root(*x as f32) as u32 != x.isqrt();
    let all = (1..TESTS).filter(is_wrong);
    let (all, squares) = all.fold((0, 0), |(all, squares), x| (all + 1, squares + u32::from(is_square(x))));
    let ulps = |x: u32| root((x * x) as f32).to_bits().abs_diff((x as f32).to_bits());
    [all, squares, (1..=(TESTS - 1).isqrt()).map(ulps).max().unwrap_or(0)]
}

/// Says which roots are wrong with three steps, and how many squares the paper's figures would be.
pub(super) fn squares_note() -> String {
    let told = [
        ("in f64", WideNewton::<CARMACK, 3>::root as fn(f32) -> f32),
        ("in f32", Newton::<CARMACK, 3>::root),
    ];
    let told = told.map(|(name, root)| {
        let [all, squares, ulps] = wrong(root);
        format!(
            "{squares} of the {all} wrong ones are squares with steps {name}, where the root of a square is off by up to \
             {ulps} ulps"
        )
    });
    let papers = TABLE_3.map(|(tests, percent)| {
        (tests, (percent[2] / 100.0 * f64::from(tests)).round() as u32, (tests - 1).isqrt())
    });
    let each =
        papers.map(|(tests, wrong, squares)| format!("{wrong} where {squares} are squares below {tests}"));
    format!(
        "Table 3, what 3 steps get wrong: below {TESTS}, {}. The paper's figures for Carmack are so many: {}. {}.",
        told.join(", "),
        each.join(", "),
        only_squares(&papers)
    )
}

/// Says if the wrong ones could be squares alone. Each entry: tests, wrong ones, squares.
fn only_squares(papers: &[(u32, u32, u32)]) -> String {
    let beyond: Vec<_> =
        papers.iter().filter(|(_, wrong, squares)| wrong > squares).map(|row| row.0.to_string()).collect();
    match &beyond[..] {
        [] => "So all of them could be squares".to_owned(),
        tests => format!("So they could all be squares, but for those below {}", tests.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_product_gives_the_figures_of_two_steps_and_other_ends_those_of_three() {
        let [cut, reciprocal] = [Form::Cut, Form::Reciprocal].map(found);
        assert_eq!((cut[0].ways, cut[1].ways, cut[3].ways), (3 * 162, 3 * 162 * 162, 3 * 162 * 162));
        assert!(cut[0].all > 0 && cut[0].all < cut[0].ways / 10, "{cut:?}");
        assert!(cut[1].few < 10 && cut[1].all == 0, "{cut:?}");
        assert!(
            reciprocal[1].few > 0 && reciprocal[2].few > 0 && reciprocal[1].carmack > 0,
            "{reciprocal:?}"
        );
    }

    #[test]
    fn the_verdict_is_what_was_found() {
        let of = |[two, three, four, same]: [[usize; 2]; 4]| {
            verdict(&[two, three, four, same].map(|[few, all]| Found { ways: 9, few, all, carmack: 0 }))
        };
        assert!(of([[1, 0], [1, 1], [1, 1], [1, 0]]).contains("none of these gives the figures for 2"));
        assert!(of([[1, 1]; 4]).ends_with("all these figures"));
        assert!(of([[1, 1], [1, 1], [1, 1], [1, 0]]).ends_with("but not beyond"));
        assert!(of([[1, 1], [1, 1], [1, 1], [0, 0]]).ends_with("of others: no way gives all"));
        assert!(of([[1, 1], [1, 0], [1, 0], [0, 0]]).contains("up to 100000 tests of others"));
        assert!(of([[1, 1], [1, 1], [0, 0], [0, 0]]).ends_with("not both explained"));
    }

    #[test]
    fn with_three_steps_only_squares_are_wrong() {
        let told = squares_note();
        assert!(told.contains("67 of the 67 wrong ones are squares with steps in f64"), "{told}");
        assert!(told.contains("214 of the 214 wrong ones are squares with steps in f32"), "{told}");
        assert_eq!(wrong(Newton::<CARMACK, 3>::root)[2], 2);
        assert!(told.contains("7 where 31 are squares below 1000, 12 where 99 are"), "{told}");
        assert!(told.contains("13400 where 9999 are squares below 100000000"), "{told}");
        assert!(told.ends_with("So they could all be squares, but for those below 100000000."), "{told}");
        assert_eq!(only_squares(&[(9, 1, 2)]), "So all of them could be squares");
    }
}
