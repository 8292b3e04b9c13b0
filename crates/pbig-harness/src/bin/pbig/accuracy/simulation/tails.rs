//! Which runs are farther from stock than all permuted ones, in which quantities: a run that differs by the order of
//! insertion alone is seldom the farthest of all.

use super::super::study::{Cell, Table};
use super::Ways;
use super::figures::{Figures, Multiple, QUANTITIES, Quantity, multiple};
use super::sides::{PERMUTED, WAYS, Way};

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

pub(super) fn note(scenes: &[Ways]) -> String {
    let (permuted, control) = (places(Way::is_permuted), of_permuted(scenes));
    let told = counted().into_iter().map(|place| {
        let [count, all] = farthest(scenes, place, &permuted);
        let as_many = control.iter().filter(|of_control| **of_control >= count).count();
        format!("{} {count} of {all} (as many or more: {as_many} permuted ones)", WAYS[place].name)
    });
    format!(
        "In how many quantities a run is farther from this run of stock than all {PERMUTED} permuted ones: {}. Of the permuted \
         ones each is so among the others in {} at the median, {} at most. Quantities of one scene depend on each other; \
         those in which all these runs are as far from stock do not count. The table of those that are farther has what each \
         run gives there: where stock sorted is as far out as pbig, and on the same side of stock, our order of events takes \
         rapier's own broad phase there, too; where pbig lower first is not, it is the order of colliders in pairs.",
        told.collect::<Vec<_>>().join("; "),
        control[PERMUTED / 2],
        control[PERMUTED - 1]
    )
}

/// Quantities in which a run of pbig is farther than all permuted ones, with what each run gives.
pub(super) fn table(scenes: &[Ways]) -> Table {
    let title = "Quantities in which a run with pbig is farther from stock than all permuted ones, and what each run gives";
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
    let mut table = Table::new("farthest", title, &columns);
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
    let head = [Cell::from(ways.scene), quantity.name.into(), value(0).into(), least.into(), most.into()];
    head.into_iter().chain(counted().into_iter().map(|place| value(place).into())).collect()
}

#[cfg(test)]
mod tests {
    use super::super::figures::tests::nothing;
    use super::*;

    /// Stock has 100 contacts, permuted runs from 101 to 119, each scene in another order, sorted and pbig these.
    fn made(scene: &'static str, sorted: f64, pbig: f64) -> Ways {
        let contacts = |place: usize| match &WAYS[place] {
            way if way.is_pbig() => pbig,
            way if way.is_permuted() => 101.0 + ((place + scene.len()) % PERMUTED) as f64,
            way if way.is_held_against_stock() => sorted,
            _ => 100.0,
        };
        let run = |place: usize| Figures { contacts: contacts(place), way: WAYS[place].name, ..nothing() };
        Ways { scene, runs: (0..WAYS.len()).map(run).collect(), instants: vec![], repeats: vec![] }
    }

    #[test]
    fn a_run_farther_than_all_permuted_ones_is_counted() {
        let permuted = places(Way::is_permuted);
        let place = places(Way::is_pbig)[0];
        let of = |pbig| farthest(&[made("column", 100.0, pbig)], place, &permuted);
        assert_eq!([of(200.0), of(0.0), of(119.0), of(105.0)], [[1, 1], [1, 1], [0, 1], [0, 1]]);
    }

    #[test]
    fn of_the_permuted_runs_one_is_the_farthest_in_each_quantity() {
        let all = of_permuted(&[made("column", 100.0, 100.0), made("pile", 100.0, 100.0)]);
        assert_eq!((all.len(), &all[PERMUTED - 3..]), (PERMUTED, &[0, 1, 1][..]), "each scene has another");
    }

    #[test]
    fn what_is_farther_is_counted_and_stands_in_the_table_with_the_runs_that_explain_it() {
        let scenes =
            [made("column", 300.0, 310.0), made("pile", 100.0, 300.0), made("pyramid", 300.0, 110.0)];
        let told = note(&scenes);
        assert!(told.contains("stock again 0 of 3 (as many or more: 19 permuted ones); "), "{told}");
        assert!(told.contains("stock sorted 2 of 3 (as many or more: 0 permuted ones); "), "{told}");
        assert!(told.contains("in 0 at the median, 1 at most."), "{told}");
        let rows = table(&scenes).rows;
        assert_eq!((rows.len(), rows[1][0].text()), (2, "pile".to_owned()));
        let values = [100.0, 101.0, 119.0, 100.0, 300.0, 310.0, 310.0, 310.0];
        assert_eq!(rows[0][2..], values.map(Cell::Number));
    }
}
