//! The paper's rules: what they mend, the smallest number of boxes for which they do not, and the sign of `8k`.

use super::percent;
use super::times::label;
use crate::index::{Correction, Rules, WAYS, Way};
use pbig_harness::cells;
use pbig_harness::pair_index::{pair_count, pair_of};
use pbig_harness::table::Table;
use rayon::prelude::*;

pub(super) fn tables(quick: bool) -> [Table; 3] {
    [counterexamples(quick), mended(60), signs()]
}

/// The smallest n for which the rules give a wrong pair at an end of a row, counted from 0; and the n below which the error of
/// the root leaves none, also within rows.
fn counterexamples(quick: bool) -> Table {
    let columns = ["root", "searched_up_to", "boxes", "index", "given", "right", "none_below"];
    let mut table = Table::new("counterexamples", columns);
    // For two steps it takes seconds.
    let most = if quick { 1 << 16 } else { 1 << 20 };
    let all: Vec<_> = WAYS.par_iter().map(|way| (way, (way.counterexample)(most))).collect();
    for (way, found) in all {
        let pair = |(a, b): (i64, i64)| format!("({a}, {b})");
        let given = found.map_or("none".into(), |it| pair(it.given));
        let place = cells![found.map(|it| it.n as u64), found.map(|it| it.k as u64), given];
        let below = found.filter(|_| way.steps.is_some()).map(|_| harmless_below(way) as u64);
        let rest = cells![found.map(|it| pair(it.right)), below];
        table.row([cells![label(way), most as u64], place, rest].concat());
    }
    table
}

/// The rules mend a row that is off by one. To be off by two, an estimate `(m - s) / 2` has to be off by more than one, with
/// `m` and the root below `2n`: by the relative error of the root, and a rounding each of what stands under it (half of that
/// is left of it in the root), of the root, and of the difference. (The error of a root has its own rounding already: slack.)
fn harmless_below(way: &Way) -> i64 {
    let roundings = 2.5 * f64::from(f32::EPSILON) / 2.0;
    (1.0 / ((way.worst_relative)() + roundings)) as i64
}

/// Shares of all pairs of up to so many boxes that the rules make right if their row is off by some rows.
fn mended(most: i64) -> Table {
    let is_mended = |off: i64, n: i64, k: u64| {
        let (a, b) = pair_of(k, n as u64);
        Rules::pair(a as i64 + off, k as i64, n) == (a as i64, b as i64)
    };
    let mut table = Table::new("mended", ["rows_off", "largest_n", "right_percent"]);
    for off in -3..=3 {
        let all = (2..=most).flat_map(|n| (0..pair_count(n as u64)).map(move |k| (n, k)));
        let [right, pairs] =
            all.fold([0, 0], |[right, pairs], (n, k)| [right + u64::from(is_mended(off, n, k)), pairs + 1]);
        table.row(cells![format!("{off:+}"), most as u64, percent(right, pairs)]);
    }
    table
}

/// Wrong rows with `+ 8k` under the root, as the text of 3.3 has it, and with `- 8k`, as equation 1 has it.
fn signs() -> Table {
    let (n, mut table) = (1000, Table::new("sign_of_8k", ["sign", "boxes", "wrong_percent"]));
    let (m, pairs) = (2 * n - 1, n * (n - 1) / 2);
    for (sign, eight) in [("+", 8), ("-", -8)] {
        let row = |k: i64| ((m as f64 - ((m * m + eight * k) as f64).sqrt()) / 2.0).floor() as i64;
        let wrong = (0..pairs).filter(|&k| row(k) != pair_of(k as u64, n as u64).0 as i64).count();
        table.row(cells![sign, n as u64, percent(wrong as u64, pairs as u64)]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_mend_rows_that_are_off_by_one_and_equation_1_has_the_right_sign() {
        let shares = |table: &Table, column: &str| -> Vec<f64> {
            table.column(column).filter_map(pbig_harness::table::Cell::number).collect()
        };
        assert_eq!(shares(&mended(20), "right_percent"), [0.0, 0.0, 100.0, 100.0, 100.0, 0.0, 0.0]);
        let wrong = shares(&signs(), "wrong_percent");
        assert!(wrong[0] > 90.0 && wrong[1] == 0.0, "{wrong:?}");
    }

    #[test]
    fn below_what_the_error_of_a_root_allows_there_is_no_counterexample() {
        for way in WAYS.iter().filter(|way| way.steps.is_some_and(|steps| steps < 3)) {
            let found = (way.counterexample)(1 << 18).expect("a counterexample").n;
            let least = harmless_below(way);
            assert!(least <= found && 10 * found < 12 * least, "{}: {least} and {found}", label(way));
        }
    }
}
