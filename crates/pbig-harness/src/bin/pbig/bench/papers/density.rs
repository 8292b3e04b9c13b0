//! PBIG's table III: which reading of "degree of coverage" (DoC) gives its numbers of pairs.
//!
//! Equation 11 is the sum of the volumes of all boxes over that of the space. By it `n` equal cubes, and
//! boxes whose lengths are independent on each axis, have `4 n DoC` pairs: `n^2 / 2` times the chance
//! `(2 e / L)^3`. The table has an eighth of that.

use super::Scale;
use super::model::{Edges, Model, Place, Space};
use super::printed::{LENGTHS, MOST_BOXES, SPACE, TABLE_III};
use super::sheet::{Sheet, short};
use crate::output::Failure;
use pbig_core::{Config, Finder, Limits, Order};
use serde_json::{Value, json};

/// One way to understand what the experiment draws.
struct Reading {
    name: &'static str,
    /// The law for `n` boxes at a DoC.
    model: fn(usize, f64) -> Model,
}

/// The edge of `n` equal cubes in the paper's space that have this DoC by equation 11.
fn equation_11(n: usize, doc: f64) -> f64 {
    SPACE * (doc / n as f64).cbrt()
}

const fn even(place: Place, edges: Edges) -> Model {
    Model { space: Space::Even(SPACE), place, edges }
}

const fn centred(edges: Edges) -> Model {
    even(Place::Centre, edges)
}

/// The reading that fits: lower corners uniform in the space, lengths uniform from 0 to the edge by equation
/// 11 rounded up to a whole number. So DoC counts each box as if it were as large as it may be.
pub(super) fn fitting(n: usize, doc: f64) -> Model {
    even(Place::LowerCorner, Edges::boxes(0.0, equation_11(n, doc).ceil()))
}

const READINGS: [Reading; 14] = [
    Reading {
        name: "equal cubes by equation 11",
        model: |n, doc| centred(Edges::equal(equation_11(n, doc))),
    },
    Reading {
        name: "lengths uniform from 0, mean by equation 11",
        model: |n, doc| centred(Edges::boxes(0.0, 2.0 * equation_11(n, doc))),
    },
    Reading {
        name: "lengths uniform from 1 (section 6.1), mean by equation 11",
        model: |n, doc| centred(Edges::boxes(1.0, 2.0 * equation_11(n, doc) - 1.0)),
    },
    Reading {
        name: "cubes of random size from 0, volumes by equation 11",
        // The mean of e^3 is a quarter of the largest.
        model: |n, doc| centred(Edges::cubes(0.0, 4f64.cbrt() * equation_11(n, doc))),
    },
    Reading {
        name: "lengths 1 to 100 (section 6.1), the space by equation 11",
        model: |n, doc| {
            let mean = 0.5 * (LENGTHS[0] + LENGTHS[1]);
            let space = Space::Even(mean * (n as f64 / doc).cbrt());
            Model { space, ..centred(Edges::boxes(LENGTHS[0], LENGTHS[1])) }
        },
    },
    Reading {
        name: "the edge by equation 11 is a half extent",
        model: |n, doc| centred(Edges::equal(2.0 * equation_11(n, doc))),
    },
    Reading {
        name: "equation 11 with half extents for lengths",
        model: |n, doc| centred(Edges::equal(0.5 * equation_11(n, doc))),
    },
    Reading {
        name: "equation 11 with half extents for lengths, rounded up",
        model: |n, doc| centred(Edges::equal(0.5 * equation_11(n, doc).ceil())),
    },
    Reading {
        name: "coordinates to both sides of 0: eight times the space",
        model: |n, doc| Model {
            space: Space::Even(2.0 * SPACE),
            ..centred(Edges::boxes(0.0, 2.0 * equation_11(n, doc)))
        },
    },
    Reading {
        name: "lengths uniform from 1, the largest by equation 11",
        model: |n, doc| centred(Edges::boxes(1.0, equation_11(n, doc))),
    },
    Reading {
        name: "lengths uniform from 1, the largest by equation 11 rounded up",
        model: |n, doc| centred(Edges::boxes(1.0, equation_11(n, doc).ceil())),
    },
    Reading {
        name: "lengths uniform from 0, the largest by equation 11",
        model: |n, doc| centred(Edges::boxes(0.0, equation_11(n, doc))),
    },
    Reading {
        name: "lengths uniform from 0, the largest by equation 11 rounded up",
        model: |n, doc| centred(Edges::boxes(0.0, equation_11(n, doc).ceil())),
    },
    Reading {
        name: "lower corners uniform instead of centres, lengths uniform from 0, the largest by equation 11 rounded up",
        model: fitting,
    },
];

/// By how many standard deviations each printed count is off what a reading expects.
fn off(reading: &Reading) -> [f64; 5] {
    std::array::from_fn(|i| {
        let row = &TABLE_III[i];
        (reading.model)(MOST_BOXES, row.doc).off(MOST_BOXES, row.pairs)
    })
}

fn furthest(off: [f64; 5]) -> f64 {
    off.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0)
}

/// Expected pairs of every reading, and how far the printed ones are from them.
pub(super) fn readings() -> Sheet {
    let docs = TABLE_III.map(|row| format!("DoC {}", row.doc));
    let mut columns = vec!["reading", "pairs / (N DoC) at DoC 1"];
    columns.extend(docs.iter().map(String::as_str));
    columns.push("furthest off, standard deviations");
    let mut sheet = Sheet::new("PBIG table III: what DoC can mean", &columns).about(format!(
        "Expected pairs of N = {MOST_BOXES} boxes by calculation, border of the space included; in the last column how \
         far the worst of the five printed counts is from them."
    ));
    let printed = TABLE_III.iter().map(|row| json!(row.pairs));
    let at_one = TABLE_III[3].pairs as f64 / MOST_BOXES as f64;
    let first = [json!("printed"), json!(at_one)];
    sheet.row(first.into_iter().chain(printed).chain([Value::Null]).collect());
    for reading in &READINGS {
        let pairs = TABLE_III.map(|row| (reading.model)(MOST_BOXES, row.doc).pairs(MOST_BOXES));
        let first = [json!(reading.name), json!(pairs[3] / MOST_BOXES as f64)];
        let rest = pairs.iter().map(|&pairs| json!(pairs.round() as u64));
        sheet.row(first.into_iter().chain(rest).chain([json!(furthest(off(reading)))]).collect());
    }
    sheet.about(verdict())
}

/// The worst of five counts of a right reading is within this but once in seventy times.
const LIKELY: f64 = 3.0;

/// Which readings are possible, in words.
fn verdict() -> String {
    let worst = |reading: &&Reading| furthest(off(reading)).abs();
    let mut fits: Vec<&Reading> = READINGS.iter().filter(|reading| worst(reading) < LIKELY).collect();
    fits.sort_by(|a, b| worst(a).total_cmp(&worst(b)));
    let Some((best, others)) = fits.split_first() else {
        return format!("No reading has all five counts within {LIKELY} standard deviations.");
    };
    let name = |reading: &&Reading| format!("\"{}\" ({} off at worst)", reading.name, short(worst(reading)));
    let others: Vec<String> = others.iter().map(name).collect();
    let others = if others.is_empty() { "none".to_owned() } else { others.join(", ") };
    format!(
        "Of {} readings the best is {}; others within {LIKELY} standard deviations: {others}. {}",
        READINGS.len(),
        name(best),
        in_common(&fits)
    )
}

/// Says in what the fitting readings agree.
fn in_common(fits: &[&Reading]) -> String {
    let all = |holds: &dyn Fn(&Edges) -> bool| {
        fits.iter()
            .all(|reading| TABLE_III.iter().all(|row| holds(&(reading.model)(MOST_BOXES, row.doc).edges)))
    };
    let by_largest = |reading: &&Reading| {
        TABLE_III.iter().all(|row| {
            (reading.model)(MOST_BOXES, row.doc).edges.high == equation_11(MOST_BOXES, row.doc).ceil()
        })
    };
    let mut so = Vec::new();
    if all(&|edges| edges.low < LENGTHS[0]) {
        so.push("So the lengths are not those of section 6.1, which begin at 1.".to_owned());
    }
    if all(&|edges| edges.low == 0.0 && !edges.cubes) && fits.iter().all(by_largest) {
        let (densest, most) = (TABLE_III[4].doc, MOST_BOXES);
        let ratio = |of: fn(usize, f64) -> Model| of(most, densest).pairs(most);
        so.push(format!(
            "DoC is equation 11 with the largest box for every box: with lengths uniform from 0 a box's expected \
             volume is an eighth of that, and the pairs at DoC {densest} are {} of those of equal cubes by equation \
             11.",
            short(ratio(fits[0].model) / ratio(READINGS[0].model))
        ));
    }
    so.join(" ")
}

/// The calculation against counts: every reading at two sizes.
pub(super) fn experiment(scale: &Scale) -> Result<Sheet, Failure> {
    const DOC: f64 = 1.0;
    let columns = ["reading", "boxes", "expected pairs", "counted pairs", "off, standard deviations"];
    let mut sheet = Sheet::new("PBIG table III: the readings, counted", &columns)
        .about("DoC 1, the paper's space, edges by N. The calculation above is right where counts are a few standard \
                deviations off at most.");
    let mut finder =
        Finder::new(Config { limits: Limits::UNLIMITED, order: Order::Unspecified, ..Config::DEFAULT });
    for reading in &READINGS {
        for &n in scale.experiment {
            let model = (reading.model)(n, DOC);
            let found = finder.find(&model.boxes(n, 1)).map(<[_]>::len);
            let count = found.map_err(|error| Failure::Input(error.to_string()))? as u64;
            let expected = model.pairs(n).round() as u64;
            sheet.row(json!([reading.name, n, expected, count, model.off(n, count)]));
        }
    }
    Ok(sheet)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn equation_11_is_the_coverage_of_equal_cubes() {
        let edge = equation_11(MOST_BOXES, 10.0);
        assert!((edge - 100.0).abs() < 1e-9);
        assert!((equation_11(1000, 0.001) - 100.0).abs() < 1e-9, "{}", equation_11(1000, 0.001));
    }

    #[test]
    fn readings_by_equation_11_have_four_pairs_a_box_and_those_by_the_largest_box_half_a_pair() {
        let law = |i: usize| {
            let n = 1_000_000_000;
            (READINGS[i].model)(n, 1.0).pairs(n) / n as f64
        };
        for (i, known) in
            [(0, 4.0), (1, 4.0), (2, 4.0), (3, 3.0), (4, 4.0), (5, 32.0), (6, 0.5), (8, 0.5), (11, 0.5)]
        {
            assert!((law(i) / known - 1.0).abs() < 0.02, "{}: {}", READINGS[i].name, law(i));
        }
    }

    #[test]
    fn the_printed_counts_fit_lower_corners_best_centres_barely_and_no_other_reading() {
        let worst = |reading: &Reading| furthest(off(reading)).abs();
        let (others, fits) = READINGS.split_at(READINGS.len() - 2);
        assert!(others.iter().all(|reading| worst(reading) > 10.0));
        assert!(worst(&fits[1]) < 1.0 && (1.0..LIKELY).contains(&worst(&fits[0])));
    }

    #[test]
    fn conclusions_are_drawn_only_from_readings_that_share_them() {
        let last = &READINGS[READINGS.len() - 1];
        assert!(
            in_common(&[last]).contains("not those of section 6.1")
                && in_common(&[last]).contains("an eighth")
        );
        assert_eq!(in_common(&[last, &READINGS[2]]), "", "lengths from 1 contradict both");
        assert!(!in_common(&[last, &READINGS[0]]).contains("an eighth"), "equal cubes contradict the second");
    }

    #[test]
    fn every_reading_counts_what_it_expects_by_brute_force() {
        for reading in &READINGS {
            let (n, doc) = (2000, 1.0);
            let model = (reading.model)(n, doc);
            let count = oracle::pairs(&model.boxes(n, 3)).len() as u64;
            assert!(model.off(n, count).abs() < 5.0, "{}: {count}, {}", reading.name, model.pairs(n));
        }
    }
}
