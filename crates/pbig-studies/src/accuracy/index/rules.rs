//! The smallest number of boxes for which the paper's rules leave a wrong pair.

use super::times::label;
use crate::index::{WAYS, Way};
use pbig_harness::cells;
use pbig_harness::table::Table;
use rayon::prelude::*;

/// The smallest n for which the rules give a wrong pair at an end of a row, counted from 0; and the n below which the error of
/// the root leaves none, also within rows.
pub(super) fn counterexamples(quick: bool) -> Table {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn below_what_the_error_of_a_root_allows_there_is_no_counterexample() {
        for way in WAYS.iter().filter(|way| way.steps.is_some_and(|steps| steps < 3)) {
            let found = (way.counterexample)(1 << 18).expect("a counterexample").n;
            let least = harmless_below(way);
            assert!(least <= found && 10 * found < 12 * least, "{}: {least} and {found}", label(way));
        }
    }
}
