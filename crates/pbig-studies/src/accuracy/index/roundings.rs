//! A search for a rounding of Newton's steps that gives Avril's table 3.

use super::paper::TABLE_3;
use crate::index::{CARMACK, Form, LOMONT, Rounded, Step};
use pbig_harness::cells;
use pbig_harness::table::Table;
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
}

/// With two steps, with three, with four, and with each of these in one and the same way.
type Counts = [Found; 4];

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

/// Each result of the four operations of a step can be rounded to the nearest f32, cut to the next towards zero, or stay wide;
/// the first two steps go one way, others another. Rows of table 3 beyond 1,000,000 tests are not looked at.
pub(super) fn ways() -> Table {
    let columns = [
        "result",
        "steps",
        "ways",
        "both_constants_up_to_100000_tests",
        "both_constants_up_to_1000000_tests",
        "carmack_up_to_1000000_tests",
    ];
    let mut table = Table::new("roundings_of_table_3", columns);
    for form in Form::ALL {
        for (steps, Found { ways, few, all, carmack }) in
            ["2", "3", "4", "each of these"].iter().zip(found(form))
        {
            table.row(cells![form.name(), *steps, ways, few, all, carmack]);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_product_gives_the_figures_of_two_steps() {
        let cut = found(Form::Cut);
        assert_eq!((cut[0].ways, cut[1].ways, cut[3].ways), (3 * 162, 3 * 162 * 162, 3 * 162 * 162));
        assert!(cut[0].all > 0 && cut[0].all < cut[0].ways / 10 && cut[1].all == 0, "{cut:?}");
    }
}
