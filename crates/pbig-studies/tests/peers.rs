//! Pbig beside the other trees, once, at small sizes.

use pbig_harness::motions::Motion;
use pbig_harness::scenes::Scene;
use pbig_harness::table::Cell;
use pbig_studies::{peers, stages, steady};

#[test]
fn peers_agree_on_the_pairs() {
    let report = peers::run(true).expect("all agree");
    let others: Vec<String> = report.tables[0].column("other").map(Cell::text).collect();
    for word in ["one thread", "all threads", "changed pairs", "refit_partial", "rebuilt", "obvhs"] {
        assert!(others.iter().any(|other| other.contains(word)), "{word}");
    }
    assert!(report.tables[0].column("case").any(|case| case.text().contains("per box and pair")));
    assert!(report.tables[0].column("pairs").all(|pairs| pairs.number() > Some(0.0)));
}

#[test]
fn steady_has_every_motion_and_every_scene() {
    let report = steady::run(true, &[60]).expect("all agree");
    let table = &report.tables[0];
    // Ours on all threads and on one, the finder and parry; ours and stock.
    assert_eq!(table.rows.len(), 4 * (2 * Motion::ALL.len() + 2) + 2 * Scene::ALL.len());
    let column = |name| table.column(name).filter_map(Cell::number).collect::<Vec<_>>();
    let (median, p99, worst) = (column("median_ms"), column("p99_ms"), column("worst_ms"));
    assert!((0..median.len()).all(|k| median[k] <= p99[k] && p99[k] <= worst[k]));
}

#[test]
fn stages_add_up_to_at_most_the_whole() {
    let report = stages::run(true).expect("no failure");
    for table in &report.tables {
        assert!(table.rows.len() > 10, "{}", table.name);
        for row in &table.rows {
            let number = |k: usize| row[k].number().unwrap_or(0.0);
            // Of events all are means; medians of parts need not add up to the median of the whole.
            let parts: f64 = (5..11).map(number).sum();
            assert!(parts > 0.0 && (table.name != "events" || parts <= number(4) * 1.001), "{row:?}");
        }
    }
}
