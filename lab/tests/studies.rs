//! Each study once, at small sizes: what must be right is, whatever the times.

use pbig_harness::motions::Motion;
use pbig_harness::prelude::*;
use pbig_studies::{accuracy, papers, peers, steady};

fn table<'a>(report: &'a BenchReport, name: &str) -> &'a Table {
    report
        .tables
        .iter()
        .find(|table| table.name.starts_with(name))
        .unwrap_or_else(|| panic!("no table {name}"))
}

/// Returns a number of each row that has a label.
fn numbers(table: &Table, label: &str, column: &str) -> Vec<f64> {
    let rows = table.rows.iter().filter(|row| row.contains(&label.into()));
    rows.filter_map(|row| table.number(row, column)).collect()
}

#[test]
fn accuracy_integers_are_right_and_every_error_is_counted() {
    let report = accuracy::run(true).expect("no failure");
    let points = report.charts[0].plots.iter().flat_map(|plot| &plot.lines).flat_map(|line| &line.points);
    assert!(
        points.clone().count() > 10 && points.into_iter().all(|(time, error)| *time > 0.0 && *error >= 0.0)
    );
    assert!(report.tables.iter().all(|table| !table.rows.is_empty()));
    let all = table(&report, "all_pairs");
    let [integers, lazy, coarse] =
        ["integers", "lazy way", "Carmack 1"].map(|label| numbers(all, label, "wrong"));
    assert!(integers.len() == 7 && integers.iter().chain(&lazy).all(|wrong| *wrong == 0.0));
    assert!(coarse[1] > 0.0, "one step is more than the rules mend");
    // Two steps in f64 give the paper's figures.
    let table = table(&report, "table_3");
    for row in table.rows.iter().filter(|row| table.number(row, "steps") == Some(2.0)) {
        let [paper, ours] = ["paper_percent", "ours_steps_in_f64_percent"].map(|c| table.number(row, c));
        assert!(paper.zip(ours).is_some_and(|(paper, ours)| (paper - ours).abs() < 1e-4), "{row:?}");
    }
}

#[test]
fn peers_agree_on_the_pairs() {
    let report = peers::run(true).expect("all agree");
    let has = |column: &str, word: &str| {
        report.tables[0].column(column).any(|name| name.as_str().is_some_and(|name| name.contains(word)))
    };
    for word in ["one thread", "all threads", "changed pairs", "rebuilt", "obvhs"] {
        assert!(has("other", word), "{word}");
    }
    assert!(report.tables[0].numbers("pairs").iter().all(|pairs| *pairs > 0.0));
}

#[test]
fn steady_has_every_motion() {
    let report = steady::run(true, &[60]).expect("all agree");
    let table = &report.tables[0];
    // Ours on all threads and on one, the finder and parry.
    assert_eq!(table.rows.len(), 4 * (2 * Motion::ALL.len() + 2));
    let [median, p99, worst] = ["median_ms", "p99_ms", "worst_ms"].map(|column| table.numbers(column));
    assert!((0..median.len()).all(|k| median[k] <= p99[k] && p99[k] <= worst[k]));
}

#[test]
fn papers_have_every_table_and_counts_fit_what_is_expected() {
    let report = papers::run(true).expect("all ways agree");
    assert_eq!(report.tables.len(), 11);
    // A device's tables are empty without one.
    assert!(report.tables.iter().all(|table| !table.rows.is_empty() || table.name.contains("GPU")));
    for name in ["PBIG figure 8", "PBIG figure 11"] {
        let off = table(&report, name).numbers("off, standard deviations");
        assert!(off.into_iter().map(f64::abs).fold(0.0, f64::max) < 5.0, "{name}");
    }
    // A pair is eight bytes.
    let switches = table(&report, "PBIG table IV: ");
    for row in &switches.rows {
        let of = |column: &str| switches.number(row, column);
        assert!(of("bytes fetched") >= of("pairs").map(|pairs| 8.0 * pairs), "{row:?}");
    }
}
