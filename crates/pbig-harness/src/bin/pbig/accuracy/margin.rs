//! The study of the margin: with a wider one fewer boxes change and more pairs are extra.

mod boxes;
mod tally;
mod verdict;
mod worlds;

use super::study::{Cell, Point, Study, Table};
use crate::output::Failure;
use pbig_harness::reported::Reported;
use pbig_harness::runner::StepTime;
use rapier_pbig::PbigConfig;
use tally::{MARGINS, Passes};
use verdict::{against_default, criterion, over_all, without_each_scene};

pub(super) fn run(quick: bool) -> Result<Study, Failure> {
    let mut rows = worlds::measured(quick)?;
    rows.extend(boxes::measured(quick)?);
    Ok(Study {
        name: "margin",
        title: "Margin of stored boxes",
        notes: notes(&rows),
        tables: vec![table(&rows), best(&rows), means(&rows)],
        time: "broad phase, ms a step",
        error: "extra pairs, % of those that overlap",
        points: rows.iter().map(point).collect(),
        joined: true,
    })
}

/// One margin in one case: [`MARGINS`] in their order make a case.
#[derive(Clone)]
struct Row {
    case: String,
    boxes: usize,
    margin: f64,
    /// Of a box, in the middle.
    edge: f64,
    /// Of all boxes, those that the broad phase was told of in a step, %.
    moved: f64,
    /// Of those, the ones that had left their fat box, %.
    changed: f64,
    /// Milliseconds a step.
    broad_phase: f64,
    /// Of the whole step, where there is one.
    step: Option<f64>,
    /// Of the steps compared, all together.
    reported: Reported,
    compared: u64,
    /// A step of each pass, on average.
    passes: Vec<StepTime>,
}

/// The rows of a case.
fn rows(case: &str, boxes: usize, edge: f32, has_step: bool, passes: &Passes) -> Result<Vec<Row>, Failure> {
    let row = |((&margin, tally), means): ((&f64, &tally::Tally), &Vec<StepTime>)| {
        let percent = |part: u64, of: f64| part as f64 / of.max(1.0) * 100.0;
        Row {
            case: case.to_owned(),
            boxes,
            margin,
            edge: edge.into(),
            moved: percent(tally.listed, (boxes * tally.counted()) as f64),
            changed: percent(tally.changed, tally.listed as f64),
            broad_phase: tally.mean(|time| time.broad_phase),
            step: has_step.then(|| tally.mean(|time| time.step)),
            reported: tally.reported,
            compared: tally.compared,
            passes: means.clone(),
        }
    };
    MARGINS.iter().zip(&passes.tallies).zip(&passes.means).map(row).map(complete).collect()
}

fn complete(row: Row) -> Result<Row, Failure> {
    let Row { case, margin, reported: Reported { missed, needed, .. }, .. } = &row;
    if *missed > 0 {
        let what = format!("{case}, margin {margin}: {missed} of {needed} pairs that overlap are missing");
        return Err(Failure::Check(what));
    }
    Ok(row)
}

fn point(row: &Row) -> Point {
    Point { series: row.case.clone(), time: row.broad_phase, error: row.reported.extra_percent() }
}

fn table(rows: &[Row]) -> Table {
    let columns = [
        "case",
        "boxes",
        "margin",
        "percent_of_the_edge",
        "moved_percent",
        "changed_percent",
        "broad_phase_ms",
        "step_ms",
        "pairs",
        "extra_percent",
        "missed",
    ];
    let mut table = Table::new("margins", "A step with each margin", &columns);
    for row in rows {
        table.row([
            row.case.as_str().into(),
            row.boxes.into(),
            row.margin.into(),
            (row.margin / row.edge * 100.0).into(),
            row.moved.into(),
            row.changed.into(),
            row.broad_phase.into(),
            row.step.into(),
            (row.reported.needed / row.compared.max(1)).into(),
            row.reported.extra_percent().into(),
            row.reported.missed.into(),
        ]);
    }
    table
}

/// A compared time.
struct Time {
    what: &'static str,
    /// Of the shorter time of each step.
    of: fn(&Row) -> Option<f64>,
    /// Of one pass.
    in_pass: fn(&StepTime) -> f64,
}

const BROAD_PHASE: Time =
    Time { what: "the broad phase", of: |row| Some(row.broad_phase), in_pass: |time| time.broad_phase };
const STEP: Time = Time { what: "the whole step of rapier", of: |row| row.step, in_pass: |time| time.step };

/// Which of [`MARGINS`] is rapier-pbig's default.
fn default_margin() -> usize {
    MARGINS.iter().position(|margin| *margin as f32 == PbigConfig::DEFAULT.margin).unwrap_or_default()
}

/// The fastest margin of a case, and the default's time over its.
fn fastest(case: &[Row], Time { of: time, .. }: &Time) -> Option<(f64, f64)> {
    let timed = || case.iter().filter_map(|row| Some((row.margin, time(row)?)));
    let (margin, least) = timed().min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((margin, time(&case[default_margin()])? / least))
}

fn best(rows: &[Row]) -> Table {
    let title = "The fastest margin of each case, and how many times as long the default takes";
    let columns =
        ["case", "for_the_broad_phase", "default_times", "for_the_whole_step", "default_times_step"];
    let mut table = Table::new("fastest", title, &columns);
    for case in rows.chunks(MARGINS.len()) {
        let cells = [BROAD_PHASE, STEP].map(|time| fastest(case, &time).unzip());
        let name = case.iter().take(1).map(|row| row.case.as_str().into());
        let times = cells.into_iter().flat_map(|(margin, times)| [margin.into(), times.into()]);
        table.row(name.chain(times));
    }
    table
}

fn largest_extra(rows: &[Row], margin: usize) -> f64 {
    let of_margin = rows.chunks_exact(MARGINS.len()).map(|case| case[margin].reported.extra_percent());
    of_margin.fold(0.0, f64::max)
}

fn means(rows: &[Row]) -> Table {
    let title =
        "Over all cases, times those of the default (geometric means over cases and passes), and their noise";
    let columns = [
        "margin",
        "broad_phase",
        "broad_phase_noise_percent",
        "whole_step",
        "whole_step_noise_percent",
        "largest_extra_percent",
    ];
    let mut table = Table::new("means", title, &columns);
    for (k, margin) in MARGINS.iter().enumerate() {
        let times = [BROAD_PHASE, STEP].map(|time| against_default(rows, k, &time));
        let times = times.iter().flat_map(|against| [against.times, against.noise]);
        let all = [*margin].into_iter().chain(times).chain([largest_extra(rows, k)]);
        table.row(all.map(Cell::from));
    }
    table
}

fn notes(rows: &[Row]) -> Vec<String> {
    let compared: u64 = rows.iter().map(|row| row.compared).sum();
    vec![
        "Margins are in units of rapier's `length_unit`, as `Config::margin`. From one state of a scene a world \
         with each margin goes on, all in turn step by step; the steps are made twice. Of each the shorter time \
         counts for a case; means over cases and their noise are of both passes. Moved: boxes that the broad \
         phase was told of. Changed: those of them that were no longer in their stored box. Drifting and \
         trembling: unit cubes without rapier, all set in each step."
            .to_owned(),
        format!(
            "No margin misses a pair: the run fails if one does. Compared {compared} times: worlds with brute \
             force over the boxes of enabled colliders, the others with a search from nothing."
        ),
        criterion(rows),
        over_all(rows, &STEP),
        without_each_scene(rows),
        over_all(rows, &BROAD_PHASE),
    ]
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Cases in which a margin takes so many milliseconds; extra pairs are its place in the list. Between two passes
    /// all but the default differ by 2%.
    pub(super) fn made(cases: &[[f64; MARGINS.len()]], has_step: bool) -> Vec<Row> {
        let row = |k: usize, ms: f64| Row {
            case: "a case".into(),
            boxes: 10,
            margin: MARGINS[k],
            edge: 2.0,
            moved: 100.0,
            changed: 50.0,
            broad_phase: ms,
            step: has_step.then_some(10.0 * ms),
            reported: Reported { needed: 100, extra: k as u64, missed: 0 },
            compared: 1,
            passes: passes(if k == default_margin() { 0.0 } else { 0.01 }, ms),
        };
        cases.iter().flat_map(|case| case.iter().enumerate().map(move |(k, ms)| row(k, *ms))).collect()
    }

    fn passes(off: f64, ms: f64) -> Vec<StepTime> {
        [-off, off].map(|off| StepTime { broad_phase: ms * off.exp(), step: 10.0 * ms * off.exp() }).to_vec()
    }

    #[test]
    fn the_default_is_one_of_the_margins() {
        assert_eq!(MARGINS[default_margin()] as f32, PbigConfig::DEFAULT.margin);
    }

    #[test]
    fn the_fastest_margin_is_found_and_the_default_held_against_it() {
        let rows = made(&[[4.0, 3.0, 2.0, 1.0, 2.0, 3.0, 4.0, 5.0]], true);
        assert_eq!(fastest(&rows, &BROAD_PHASE), Some((MARGINS[3], 2.0)));
        assert_eq!(fastest(&made(&[[1.0; MARGINS.len()]], false), &STEP), None);
        let row = &best(&rows).rows[0];
        assert_eq!((&row[2], &row[4]), (&Cell::Number(2.0), &Cell::Number(2.0)));
    }

    #[test]
    fn a_missing_pair_is_a_failed_check() {
        let mut row = made(&[[1.0; MARGINS.len()]], true).remove(1);
        assert!(complete(made(&[[1.0; MARGINS.len()]], true).remove(0)).is_ok());
        row.reported.missed = 3;
        let failed = complete(row).map(|_| ());
        let told = failed.err().map(|failure| failure.to_string()).unwrap_or_default();
        assert!(told.contains("a case, margin 0.005: 3 of 100 pairs"), "{told}");
    }

    #[test]
    fn a_quick_study_has_every_margin_and_more_pairs_with_wider_ones() {
        let study = run(true).expect("no failure");
        assert_eq!(study.tables[0].rows.len() % MARGINS.len(), 0);
        let number = |row: &[Cell], column: usize| match row[column] {
            Cell::Number(number) => number,
            _ => f64::NAN,
        };
        for case in study.tables[0].rows.chunks(MARGINS.len()) {
            let (none, widest) = (&case[0], &case[MARGINS.len() - 1]);
            assert!(number(widest, 9) > number(none, 9), "extra pairs: {none:?}, {widest:?}");
            assert!(number(widest, 5) < number(none, 5), "changed boxes: {none:?}, {widest:?}");
            assert_eq!(number(none, 9), 0.0, "without a margin none is extra: {none:?}");
        }
    }
}
