//! The margin of stored boxes: with a wider one fewer boxes change, and more pairs are extra. From one state of a scene a world
//! with each margin goes on, all in turn step by step, and all of it twice: of each step the shorter time counts.

mod boxes;
mod tally;
mod worlds;

use super::{percent, report};
use crate::reported::Reported;
use pbig_harness::cells;
use pbig_harness::output::Failure;
use pbig_harness::report::Report;
use pbig_harness::runner::StepTime;
use pbig_harness::table::{Cell, Table};
use rapier_pbig::PbigConfig;
use tally::{MARGINS, Passes};

pub(super) fn run(quick: bool) -> Result<Report, Failure> {
    let mut rows = worlds::measured(quick)?;
    rows.extend(boxes::measured(quick)?);
    let tables = vec![table(&rows), means(&rows)];
    let axes = ["broad phase, ms a step", "extra pairs, % of those that overlap"];
    // The first case of each scene.
    let mut firsts: Vec<&[Row]> = rows.chunks(MARGINS.len()).collect();
    let of = |case: &[Row]| scene(&case[0]).to_owned();
    firsts.sort_by_key(|case| of(case));
    firsts.dedup_by_key(|case| of(case));
    let point = |row: &Row| (row.case.clone(), row.broad_phase, row.reported.extra_percent());
    Ok(report("margin", tables, ("Margin of stored boxes", axes), firsts.into_iter().flatten().map(point)))
}

/// One margin in one case: [`MARGINS`] in their order make a case.
#[derive(Clone)]
struct Row {
    case: String,
    boxes: usize,
    margin: f64,
    /// The median edge of a box.
    edge: f64,
    /// Share of the boxes that the broad phase was told of in a step, in percent.
    moved: f64,
    /// Share of these that had left their fat box, in percent.
    changed: f64,
    /// Milliseconds a step.
    broad_phase: f64,
    /// Milliseconds of the whole step, where there is one.
    step: Option<f64>,
    /// All compared steps together.
    reported: Reported,
    compared: u64,
    /// The mean step of each pass.
    passes: Vec<StepTime>,
}

/// Returns the rows of a case; a missed pair is a failed check.
fn rows(case: &str, boxes: usize, edge: f32, has_step: bool, passes: &Passes) -> Result<Vec<Row>, Failure> {
    let row = |((&margin, tally), means): ((&f64, &tally::Tally), &Vec<StepTime>)| {
        let Reported { missed, needed, .. } = tally.reported;
        if missed > 0 {
            let what =
                format!("{case}, margin {margin}: {missed} of {needed} pairs that overlap are missing");
            return Err(Failure::Check(what));
        }
        Ok(Row {
            case: case.to_owned(),
            boxes,
            margin,
            edge: edge.into(),
            moved: percent(tally.listed, (boxes * tally.counted()) as u64),
            changed: percent(tally.changed, tally.listed),
            broad_phase: tally.mean(|time| time.broad_phase),
            step: has_step.then(|| tally.mean(|time| time.step)),
            reported: tally.reported,
            compared: tally.compared,
            passes: means.clone(),
        })
    };
    MARGINS.iter().zip(&passes.tallies).zip(&passes.means).map(row).collect()
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
        "compared_steps",
    ];
    let mut table = Table::new("margins", columns);
    for row in rows {
        let case = cells![&row.case, row.boxes, row.margin, row.margin / row.edge * 100.0];
        let times = cells![row.moved, row.changed, row.broad_phase, row.step];
        let Reported { needed, missed, .. } = row.reported;
        let pairs = cells![needed / row.compared.max(1), row.reported.extra_percent(), missed, row.compared];
        table.row([case, times, pairs].concat());
    }
    table
}

/// A time that is compared: of the shorter time of each step, and of one pass.
type Time = (fn(&Row) -> Option<f64>, fn(&StepTime) -> f64);

const BROAD_PHASE: Time = (|row| Some(row.broad_phase), |time| time.broad_phase);
const STEP: Time = (|row| row.step, |time| time.step);

/// Returns the place of rapier-pbig's default in [`MARGINS`].
fn default_margin() -> usize {
    MARGINS.iter().position(|margin| *margin as f32 == PbigConfig::DEFAULT.margin).unwrap_or_default()
}

/// Returns a margin's time over the default's: the geometric mean over cases and passes, and two standard errors of it in
/// percent.
fn against_default<'a>(
    cases: impl Iterator<Item = &'a [Row]>,
    margin: usize,
    (of, in_pass): Time,
) -> [f64; 2] {
    // Within one pass both margins met the same disturbances.
    let logs = |case: &[Row]| -> Option<Vec<f64>> {
        let (one, default) = (&case[margin], &case[default_margin()]);
        of(one)?;
        Some(one.passes.iter().zip(&default.passes).map(|(a, b)| (in_pass(a) / in_pass(b)).ln()).collect())
    };
    let cases: Vec<Vec<f64>> = cases.filter_map(logs).collect();
    let count = cases.len().max(1) as f64;
    let means: Vec<f64> = cases.iter().map(|passes| mean(passes)).collect();
    // Variances of independent cases add up; or cases differ by more than passes do.
    let of_passes = cases.iter().map(|passes| variance_of_mean(passes)).sum::<f64>() / (count * count);
    let variance = of_passes.max(variance_of_mean(&means));
    [mean(&means).exp(), ((2.0 * variance.sqrt()).exp() - 1.0) * 100.0]
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn variance_of_mean(values: &[f64]) -> f64 {
    let (mean, count) = (mean(values), values.len() as f64);
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    squares / (count - 1.0).max(1.0) / count.max(1.0)
}

fn means(rows: &[Row]) -> Table {
    let columns = [
        "margin",
        "broad_phase",
        "broad_phase_noise_percent",
        "whole_step",
        "whole_step_noise_percent",
        "largest_extra_percent",
    ];
    let mut table = Table::new("means", columns);
    let cases = || rows.chunks_exact(MARGINS.len());
    for (k, margin) in MARGINS.into_iter().enumerate() {
        let times = [BROAD_PHASE, STEP].map(|time| against_default(cases(), k, time));
        let extra = cases().map(|case| case[k].reported.extra_percent()).fold(0.0, f64::max);
        table.row([margin].into_iter().chain(times.concat()).chain([extra]).map(Cell::from));
    }
    table
}

fn scene(row: &Row) -> &str {
    row.case.split(' ').next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cases in which a margin takes so long; between two passes all but the default differ by 2%.
    fn made(cases: &[[f64; MARGINS.len()]]) -> Vec<Row> {
        let passes = |off: f64, ms: f64| {
            let time = |off: f64| StepTime { broad_phase: ms * off.exp(), step: 10.0 * ms * off.exp() };
            [-off, off].map(time).to_vec()
        };
        let row = |k: usize, ms: f64| Row {
            case: "a case".into(),
            boxes: 10,
            margin: MARGINS[k],
            edge: 2.0,
            moved: 100.0,
            changed: 50.0,
            broad_phase: ms,
            step: None,
            reported: Reported { needed: 100, extra: k as u64, missed: 0 },
            compared: 1,
            passes: passes(if k == default_margin() { 0.0 } else { 0.01 }, ms),
        };
        cases.iter().flat_map(|case| case.iter().enumerate().map(move |(k, ms)| row(k, *ms))).collect()
    }

    #[test]
    fn cases_count_alike_and_the_noise_of_a_mean_is_less_than_that_of_a_case() {
        assert_eq!(MARGINS[default_margin()] as f32, PbigConfig::DEFAULT.margin);
        let against = |rows: &[Row]| against_default(rows.chunks(MARGINS.len()), 4, BROAD_PHASE);
        let mut cases = [[1.0; MARGINS.len()], [100.0; MARGINS.len()]];
        (cases[0][4], cases[1][4]) = (0.4, 100.0 / 6.4);
        assert!((against(&made(&cases))[0] - 0.25).abs() < 1e-12);
        // Two passes 2% apart: an error of 1% for their mean, of a quarter of that for the mean of 16 cases.
        for (cases, noise) in [(1, 2.02), (16, 0.501)] {
            let found = against(&made(&vec![[1.0; MARGINS.len()]; cases]))[1];
            assert!((found - noise).abs() < 5e-3, "{cases} cases: {found}");
        }
    }
}
