//! What DoC, "degree of coverage", can mean in PBIG's table III.
//!
//! Equation 11 is the sum of the volumes of all boxes over that of the space. By it `n` equal cubes, and boxes whose lengths are
//! independent on each axis, have `4 n DoC` pairs: `n^2 / 2` times the chance `(2 e / L)^3`. The table has an eighth of that.

use super::model::{Edges, Model, Place, Space};
use super::printed::{LENGTHS, MOST_BOXES, SPACE, TABLE_III};
use super::{Scale, UNSORTED};
use pbig_core::Finder;
use pbig_harness::cells;
use pbig_harness::output::Failure;
use pbig_harness::table::{Cell, Table};

/// One way to understand what the experiment draws: the law for `n` boxes at a DoC.
type Reading = (&'static str, fn(usize, f64) -> Model);

/// The edge of `n` equal cubes in the paper's space that have this DoC by equation 11.
fn edge(n: usize, doc: f64) -> f64 {
    SPACE * (doc / n as f64).cbrt()
}

pub(super) const fn even(place: Place, edges: Edges) -> Model {
    Model { space: Space::Even(SPACE), place, edges }
}

const fn centred(edges: Edges) -> Model {
    even(Place::Centre, edges)
}

/// The reading that fits: lower corners uniform in the space, lengths uniform from 0 to the edge by equation 11 rounded up to a
/// whole number. So DoC counts each box as if it were as large as it may be.
pub(super) fn fitting(n: usize, doc: f64) -> Model {
    even(Place::LowerCorner, Edges::boxes(0.0, edge(n, doc).ceil()))
}

const READINGS: [Reading; 14] = [
    ("equal cubes by equation 11", |n, doc| centred(Edges::equal(edge(n, doc)))),
    ("lengths uniform from 0, mean by equation 11", |n, doc| centred(Edges::boxes(0.0, 2.0 * edge(n, doc)))),
    ("lengths uniform from 1 (section 6.1), mean by equation 11", |n, doc| {
        centred(Edges::boxes(1.0, 2.0 * edge(n, doc) - 1.0))
    }),
    // The mean of e^3 is a quarter of the largest.
    ("cubes of random size from 0, volumes by equation 11", |n, doc| {
        centred(Edges::cubes(0.0, 4f64.cbrt() * edge(n, doc)))
    }),
    ("lengths 1 to 100 (section 6.1), the space by equation 11", |n, doc| {
        let mean = 0.5 * (LENGTHS[0] + LENGTHS[1]);
        let space = Space::Even(mean * (n as f64 / doc).cbrt());
        Model { space, ..centred(Edges::boxes(LENGTHS[0], LENGTHS[1])) }
    }),
    ("the edge by equation 11 is a half extent", |n, doc| centred(Edges::equal(2.0 * edge(n, doc)))),
    ("equation 11 with half extents for lengths", |n, doc| centred(Edges::equal(0.5 * edge(n, doc)))),
    ("equation 11 with half extents for lengths, rounded up", |n, doc| {
        centred(Edges::equal(0.5 * edge(n, doc).ceil()))
    }),
    ("coordinates to both sides of 0: eight times the space", |n, doc| Model {
        space: Space::Even(2.0 * SPACE),
        ..centred(Edges::boxes(0.0, 2.0 * edge(n, doc)))
    }),
    ("lengths uniform from 1, the largest by equation 11", |n, doc| centred(Edges::boxes(1.0, edge(n, doc)))),
    ("lengths uniform from 1, the largest by equation 11 rounded up", |n, doc| {
        centred(Edges::boxes(1.0, edge(n, doc).ceil()))
    }),
    ("lengths uniform from 0, the largest by equation 11", |n, doc| centred(Edges::boxes(0.0, edge(n, doc)))),
    ("lengths uniform from 0, the largest by equation 11 rounded up", |n, doc| {
        centred(Edges::boxes(0.0, edge(n, doc).ceil()))
    }),
    (
        "lower corners uniform instead of centres, lengths uniform from 0, the largest by equation 11 rounded up",
        fitting,
    ),
];

/// Returns by how many standard deviations the worst of the printed counts is off what a reading expects.
fn furthest_off(model: fn(usize, f64) -> Model) -> f64 {
    let off = TABLE_III.iter().map(|row| model(MOST_BOXES, row.doc).off(MOST_BOXES, row.pairs));
    off.max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0)
}

/// Expected pairs of every reading by calculation, the border of the space included.
pub(super) fn table() -> Table {
    let docs = TABLE_III.iter().map(|row| format!("DoC {}", row.doc));
    let head = ["reading", "pairs / (N DoC) at DoC 1"].map(str::to_owned).into_iter();
    let columns = head.chain(docs).chain(["furthest off, standard deviations".to_owned()]);
    let mut table = Table::new("PBIG table III: what DoC can mean", columns);
    let a_box = |pairs: f64| pairs / MOST_BOXES as f64;
    let printed = TABLE_III.iter().map(|row| row.pairs.into());
    let first = cells!["printed", a_box(TABLE_III[3].pairs as f64)];
    table.row(first.into_iter().chain(printed).chain([Cell::Nothing]));
    for (name, model) in READINGS {
        let pairs: Vec<f64> =
            TABLE_III.iter().map(|row| model(MOST_BOXES, row.doc).pairs(MOST_BOXES)).collect();
        let first = cells![name, a_box(pairs[3])].into_iter();
        let rest = pairs.into_iter().map(|pairs| (pairs.round() as u64).into());
        table.row(first.chain(rest).chain([furthest_off(model).into()]));
    }
    table
}

/// The calculation against counts: every reading at DoC 1 in the paper's space.
pub(super) fn experiment(scale: &Scale) -> Result<Table, Failure> {
    let columns = ["reading", "boxes", "expected pairs", "counted pairs", "off, standard deviations"];
    let mut table = Table::new("PBIG table III: the readings, counted", columns);
    let mut finder = Finder::new(UNSORTED);
    for ((name, reading), &n) in
        READINGS.iter().flat_map(|one| scale.experiment.iter().map(move |n| (one, n)))
    {
        let model = reading(n, 1.0);
        let count = finder.find(&model.boxes(n, 1))?.len() as u64;
        table.row(cells![*name, n, model.pairs(n).round() as u64, count, model.off(n, count)]);
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn readings_count_what_they_expect_and_the_printed_counts_fit_lower_corners_alone() {
        for (name, reading) in &READINGS {
            let model = reading(2000, 1.0);
            let count = oracle::pairs(&model.boxes(2000, 3)).len() as u64;
            assert!(model.off(2000, count).abs() < 5.0, "{name}: {count}, {}", model.pairs(2000));
        }
        let (others, fits) = READINGS.split_at(READINGS.len() - 2);
        assert!(others.iter().all(|(_, reading)| furthest_off(*reading).abs() > 10.0));
        assert!(furthest_off(fits[1].1).abs() < 1.0 && (1.0..3.0).contains(&furthest_off(fits[0].1).abs()));
    }
}
