//! Each study once, at small sizes: what must be right is, whatever the times.

use pbig_harness::report::Report;
use pbig_harness::table::{Cell, Table};
use pbig_studies::accuracy::STUDIES;

fn made(name: &str) -> Report {
    let (_, study) = STUDIES.into_iter().find(|(study, _)| *study == name).expect("a study");
    let report = study(true).expect("no failure");
    assert_eq!((report.suite.as_str(), report.charts.len()), (format!("accuracy-{name}").as_str(), 1));
    let lines = report.charts[0].plots.iter().flat_map(|plot| &plot.lines);
    let points: Vec<_> = lines.flat_map(|line| &line.points).collect();
    assert!(
        !points.is_empty() && points.iter().all(|(time, error)| *time > 0.0 && *error >= 0.0),
        "{points:?}"
    );
    report
}

fn table<'a>(report: &'a Report, name: &str) -> &'a Table {
    report.tables.iter().find(|table| table.name == name).unwrap_or_else(|| panic!("no table {name}"))
}

/// Returns a number of each row that has a label.
fn numbers(table: &Table, label: &str, column: &str) -> Vec<f64> {
    let rows = table.rows.iter().zip(table.column(column)).filter(|(row, _)| row.contains(&label.into()));
    rows.filter_map(|(_, cell)| cell.number()).collect()
}

fn all_zero(cells: impl IntoIterator<Item = f64>) -> bool {
    cells.into_iter().all(|number| number == 0.0)
}

#[test]
fn index_integers_are_right_and_every_error_is_counted() {
    let report = made("index");
    let all = table(&report, "all_pairs");
    assert!(all_zero(numbers(all, "integers", "wrong")) && all_zero(numbers(all, "lazy way", "wrong")));
    assert!(numbers(all, "Carmack 1", "wrong")[1] > 0.0, "one step is more than the rules mend");
    let count = |column| all.column(column).filter_map(Cell::number).collect::<Vec<_>>();
    for ((missed, doubled), none) in count("missed").into_iter().zip(count("doubled")).zip(count("no_pair")) {
        assert_eq!(missed, doubled + none);
    }
    for constant in ["Carmack", "Lomont"] {
        let table = table(&report, "table_3");
        let [paper, ours] =
            ["paper_percent", "ours_steps_in_f64_percent"].map(|c| numbers(table, constant, c));
        assert!((paper[0] - ours[0]).abs() < 1e-4, "two steps in f64 give the paper's figures");
    }
    for name in ["sizes", "counterexamples", "times", "table_4", "roundings_of_table_3"] {
        assert!(!table(&report, name).rows.is_empty(), "{name}");
    }
}

#[test]
fn coordinates_margin_and_simulation_miss_nothing() {
    let missed = |report: &Report, name: &str| {
        table(report, name).column("missed").filter_map(Cell::number).sum::<f64>()
    };
    let coordinates = made("coordinates");
    assert_eq!(missed(&coordinates, "tests"), 0.0);
    assert!(all_zero(numbers(table(&coordinates, "tests"), "f32", "spurious_percent")));
    let margin = made("margin");
    assert_eq!(missed(&margin, "margins"), 0.0);
    let margins = table(&margin, "margins");
    let column = |name| margins.column(name).filter_map(Cell::number).collect::<Vec<_>>();
    let (extra, changed) = (column("extra_percent"), column("changed_percent"));
    for (extra, changed) in extra.chunks(8).zip(changed.chunks(8)) {
        assert!(extra[0] == 0.0 && extra[7] > 0.0 && changed[7] < changed[0], "{extra:?} {changed:?}");
    }
    let simulation = made("simulation");
    let runs = table(&simulation, "runs");
    assert!(all_zero(numbers(runs, "pbig", "missed")) && all_zero(numbers(runs, "stock", "mean_distance")));
    assert!(runs.column("energy_at_the_end_percent").filter_map(Cell::number).all(|percent| percent < 101.0));
    assert!(runs.column("momentum_drift_percent").filter_map(Cell::number).all(|drift| drift < 1e-2));
    for name in ["distances", "repeated"] {
        assert!(!table(&simulation, name).rows.is_empty(), "{name}");
    }
}

#[test]
fn wide_boxes_miss_pairs_without_ulps_and_none_with_two() {
    let report = made("wide");
    let missed = |boxes| numbers(table(&report, "ways"), boxes, "missed_at_the_poses").iter().sum::<f64>();
    assert!(missed("rapier's boxes") > 0.0 && missed("widened by 2 ulps") == 0.0);
    for name in ["pairs", "times", "simulated", "simulated_in_f32"] {
        assert!(!table(&report, name).rows.is_empty(), "{name}");
    }
}
