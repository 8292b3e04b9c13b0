//! Run time against error: a study for each thing that can be wrong by a little.

mod index;
mod simulation;
mod wide;

use pbig_harness::chart::{Chart, Line, MAX_LINES};
use pbig_harness::prelude::*;

/// Makes a study, of small sizes if it is to be quick.
pub type StudyRun = fn(bool) -> Result<BenchReport, Failure>;

/// Every study with its name.
pub const STUDIES: [(&str, StudyRun); 3] =
    [("index", index::run), ("wide", wide::run), ("simulation", simulation::run)];

/// Returns a study with its chart: names of lines, each with a time and an error.
fn report(
    name: &str,
    tables: Vec<Table>,
    (title, axes): (&str, [&str; 2]),
    points: impl IntoIterator<Item = (String, f64, f64)>,
) -> BenchReport {
    let name = format!("accuracy-{name}");
    let mut lines: Vec<Line> = vec![];
    for (name, time, error) in points {
        match lines.iter().position(|line| line.name == name) {
            Some(place) => lines[place].points.push((time, error)),
            None if lines.len() < MAX_LINES => lines.push(Line { name, points: vec![(time, error)] }),
            None => {}
        }
    }
    BenchReport { charts: vec![Chart::log(&name, title, axes, lines)], ..BenchReport::new(&name, tables) }
}

/// Returns the share of a part, in percent.
fn percent(part: u64, all: u64) -> f64 {
    part as f64 / all.max(1) as f64 * 100.0
}
