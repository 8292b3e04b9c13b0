//! Which runs are farther from stock than all permuted ones, in which quantities: a run that differs by the order of
//! insertion alone is seldom the farthest of all.

use super::Ways;
use super::figures::{Figures, Multiple, QUANTITIES, Quantity, multiple};
use super::sides::{PERMUTED, WAYS, Way};
use pbig_harness::cells;
use pbig_harness::table::{Cell, Table};

/// Returns the standing of a run among others of its scene; none if it has no meaning or all are equally far from stock.
fn standing(ways: &Ways, place: usize, others: &[usize], quantity: Quantity) -> Option<Multiple> {
    let others: Vec<&Figures> = others.iter().map(|&other| &ways.runs[other]).collect();
    let found = multiple(&ways.runs[place], ways.first(), &others, quantity)?;
    (found.times.is_some() && !found.is_tied).then_some(found)
}

/// In how many quantities of all scenes a run is farther than all of some others, and of how many.
fn farthest(scenes: &[Ways], place: usize, others: &[usize]) -> [usize; 2] {
    let all =
        scenes.iter().flat_map(|ways| QUANTITIES.map(|quantity| standing(ways, place, others, quantity)));
    let all = all.flatten().map(|found| [usize::from(found.nearer == others.len()), 1]);
    all.fold([0; 2], |sum, one| [sum[0] + one[0], sum[1] + one[1]])
}

fn places(wanted: impl Fn(&Way) -> bool) -> Vec<usize> {
    (0..WAYS.len()).filter(|&place| wanted(&WAYS[place])).collect()
}

/// Runs whose quantities are counted, and listed: those held against the permuted ones, and before them stock once more.
fn counted() -> Vec<usize> {
    places(|way| way.is_stock_again() || way.is_held_against_stock())
}

/// Each permuted run among the others, ascending.
fn of_permuted(scenes: &[Ways]) -> Vec<usize> {
    let permuted = places(Way::is_permuted);
    let one = |&place: &usize| {
        let others: Vec<usize> = permuted.iter().copied().filter(|&other| other != place).collect();
        farthest(scenes, place, &others)[0]
    };
    let mut all: Vec<usize> = permuted.iter().map(one).collect();
    all.sort_unstable();
    all
}
/// In how many quantities of all scenes a run is farther from stock than all permuted ones, and how many permuted runs are so
/// in as many or more among the others.
pub(super) fn counts(scenes: &[Ways]) -> Table {
    let columns =
        ["broad_phase", "farther_than_all_permuted", "of_quantities", "as_many_or_more_permuted_runs"];
    let mut table = Table::new("farther", columns);
    let (permuted, control) = (places(Way::is_permuted), of_permuted(scenes));
    for place in counted() {
        let [count, all] = farthest(scenes, place, &permuted);
        let as_many = control.iter().filter(|of_control| **of_control >= count).count();
        table.row(cells![WAYS[place].name, count, all, as_many]);
    }
    for (name, place) in [("stock permuted, median", PERMUTED / 2), ("stock permuted, most", PERMUTED - 1)] {
        table.row(cells![name, control[place], None::<u64>, None::<u64>]);
    }
    table
}

/// Quantities in which a run of pbig is farther than all permuted ones, with what each run gives.
pub(super) fn table(scenes: &[Ways]) -> Table {
    let columns = [
        "scene",
        "quantity",
        "stock",
        "least_permuted",
        "most_permuted",
        "stock_again",
        "stock_sorted",
        "pbig_lower_first",
        "pbig",
        "pbig_without_margin",
    ];
    let mut table = Table::new("farthest", columns);
    let permuted = places(Way::is_permuted);
    for (ways, quantity) in scenes.iter().flat_map(|ways| QUANTITIES.map(|quantity| (ways, quantity))) {
        let is_farthest = |place: &usize| {
            standing(ways, *place, &permuted, quantity).is_some_and(|found| found.nearer == PERMUTED)
        };
        if places(|way| way.is_pbig() && way.is_held_against_stock()).iter().any(is_farthest) {
            table.row(row(ways, quantity, &permuted));
        }
    }
    table
}

fn row(ways: &Ways, quantity: Quantity, permuted: &[usize]) -> Vec<Cell> {
    let value = |place: usize| (quantity.of)(&ways.runs[place]);
    let others: Vec<f64> = permuted.iter().filter_map(|&place| value(place)).collect();
    let (least, most) =
        (others.iter().copied().fold(f64::MAX, f64::min), others.iter().copied().fold(f64::MIN, f64::max));
    let head = cells![ways.scene, quantity.name, value(0), least, most];
    head.into_iter().chain(counted().into_iter().map(|place| value(place).into())).collect()
}
