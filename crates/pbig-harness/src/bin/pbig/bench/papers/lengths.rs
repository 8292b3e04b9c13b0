//! PBIG's figure 9: size of cells.

use super::cells::{expected_checks, settings_for};
use super::device::Device;
use super::numbers::UNIFORM;
use super::printed::{CELLS, MOST_BOXES, SPACE, WARP};
use super::sheet::{Sheet, short, thousands};
use super::{Scale, UNSORTED, chart, once};
use crate::output::Failure;
use pbig_core::{Aabb, Backend, Checks, Config};
use pbig_harness::chart::Line;
use pbig_harness::study::{PbigSettings, SETTINGS, with_gpu_grid};
use serde_json::{Value, json};

/// Most checks of a row that is run: about three minutes on one thread, at 9 ns each.
const MOST_CHECKS: f64 = 2e10;

/// Calls of so many milliseconds are long. They are repeated, or nothing would tell how much calls differ that do the same;
/// but for the longest, which would make the run too long.
const LONG: f64 = 2000.0;
const LONGEST: f64 = 40_000.0;
const CALLS: usize = 3;
const LONG_CALLS: usize = 2;

/// Returns the number of calls of a row whose first call took `first_ms`.
fn calls(first_ms: f64) -> usize {
    match first_ms {
        ms if ms < LONG => CALLS,
        ms if ms < LONGEST => LONG_CALLS,
        _ => 1,
    }
}

const COLUMNS: [&str; 9] = [
    "boxes",
    "cell wanted",
    "cell",
    "checks",
    "unnecessary",
    "redundant",
    "ms, PBIG's grid, CPU, one thread",
    "calls",
    "longest call / shortest",
];

/// The rule for the length of cells.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wanted {
    Length(f64),
    /// Equation 6, with a `W`.
    Rule(f32),
}

impl Wanted {
    /// The lengths of the figure, and equation 6 as we use it and as the paper does.
    fn all() -> impl Iterator<Item = Self> {
        let rules = [SETTINGS.boxes_per_cell, WARP as f32].map(Self::Rule);
        CELLS.map(Self::Length).into_iter().chain(rules)
    }

    fn name(self) -> String {
        match self {
            Self::Length(cell) => short(cell),
            Self::Rule(boxes) => format!("equation 6, W = {boxes}"),
        }
    }

    fn settings(self, boxes: &[Aabb]) -> PbigSettings {
        match self {
            Self::Length(cell) => settings_for(boxes, cell),
            Self::Rule(boxes_per_cell) => PbigSettings { boxes_per_cell, ..SETTINGS },
        }
    }

    /// Checks to expect and why such cells are not tried: where they would hold less than a box, which the rule
    /// does not give, or take too long.
    fn why_not(self, n: usize) -> Option<(f64, String)> {
        let Self::Length(cell) = self else { return None };
        let checks = expected_checks(&UNIFORM, n, cell);
        let lonely = n as f64 * (cell / SPACE).powi(3) < 0.3;
        let why = match () {
            () if lonely => "not run: the plan gives no cells with less than a box each".to_owned(),
            () if checks > MOST_CHECKS => format!("not run: {} checks", short(checks)),
            () => return None,
        };
        Some((checks, why))
    }
}

/// The results of cells of one length.
struct Ran {
    wanted: Wanted,
    cell: f64,
    pairs: u64,
    checks: Checks,
    /// Milliseconds of each call, the shortest first.
    times: Vec<f64>,
}

impl Ran {
    fn new(boxes: &[Aabb], wanted: Wanted) -> Result<Self, Failure> {
        let settings = wanted.settings(boxes);
        let first = once(settings, boxes)?;
        let mut times = vec![first.ms];
        while times.len() < calls(first.ms) {
            times.push(once(settings, boxes)?.ms);
        }
        times.sort_by(f64::total_cmp);
        let cell = f64::from(first.cell.unwrap_or(0.0));
        Ok(Self { wanted, cell, pairs: first.pairs, checks: first.checks, times })
    }

    /// The median; the shorter of two.
    fn ms(&self) -> f64 {
        self.times[(self.times.len() - 1) / 2]
    }

    /// The longest call over the shortest. A single one tells nothing of that.
    fn spread(&self) -> Option<f64> {
        (self.times.len() > 1).then(|| self.times[self.times.len() - 1] / self.times[0])
    }

    fn row(&self, n: usize, on_device: [Value; 3]) -> Value {
        let (checks, calls) = (self.checks, self.times.len());
        let counts = [json!(checks.made), json!(checks.unnecessary), json!(checks.redundant)];
        let first = [json!(n), json!(self.wanted.name()), json!(self.cell)].into_iter().chain(counts);
        let times = [json!(self.ms()), json!(calls), json!(self.spread())];
        first.chain(times).chain(on_device).collect()
    }
}

/// By how much calls with the same boxes and the same cells differ.
fn noise(rows: &[Ran]) -> f64 {
    rows.iter().filter_map(Ran::spread).fold(1.0, f64::max)
}

pub(super) fn cells(scale: &Scale, device: &Device) -> Result<Sheet, Failure> {
    let columns = COLUMNS.into_iter().chain(["cell, GPU", "checks, GPU", device.column()]);
    let mut sheet = Sheet::new("PBIG figure 9: size of cells", &columns.collect::<Vec<_>>()).about(format!(
        "Section 6.1 as printed, PBIG's grid on one thread, from nothing: the median of {CALLS} calls where one \
         takes under {} s, elsewhere the shorter of {LONG_CALLS}, and one where it takes {} s or more. The figure's 64 to 1024 are taken as lengths (see table III). The figure \
         has no printed numbers: its text says that 256 is better than 64 and 1024 at 10^7 boxes, and that equation 6 \
         comes close to the best. On a device the settings are the same, but levels and the largest box have a say in \
         the length of its cells. {}",
        LONG / 1e3,
        LONGEST / 1e3,
        device.about()
    ));
    let mut lines = Vec::new();
    for &n in scale.numbers.iter().filter(|n| **n >= 10_000) {
        let rows = of_number(&mut sheet, n, device)?;
        sheet = sheet.about(about_cells(n, &rows, noise(&rows)));
        if n == MOST_BOXES {
            sheet = sheet.about(about_claim(&rows, noise(&rows)));
        }
        lines.push(line(n, &rows));
    }
    let mut chart = chart("cells", "PBIG figure 9: size of cells", "length of a cell", lines);
    chart.exponents = false;
    Ok(sheet.chart(chart))
}

/// All cells with so many boxes: rows of the sheet, and those that ran.
fn of_number(sheet: &mut Sheet, n: usize, device: &Device) -> Result<Vec<Ran>, Failure> {
    let boxes = UNIFORM.boxes(n, 1);
    let mut rows: Vec<Ran> = Vec::new();
    for wanted in Wanted::all() {
        if let Some((checks, why)) = wanted.why_not(n) {
            let (nothing, why) = (Value::Null, format!("{why}{}", would_take(checks, rows.last())));
            let first = json!([n, wanted.name(), nothing, checks.round() as u64, nothing, nothing, why]);
            sheet.row(first.as_array().into_iter().flatten().cloned().chain(vec![nothing; 5]).collect());
            continue;
        }
        let ran = Ran::new(&boxes, wanted)?;
        let known = rows.first().map_or(ran.pairs, |first| first.pairs);
        if ran.pairs != known {
            let cells = wanted.name();
            return Err(Failure::Check(format!(
                "{n} boxes, cells {cells}: {} pairs, not {known}",
                ran.pairs
            )));
        }
        sheet.row(ran.row(n, on_device(&boxes, &ran, device)?));
        rows.push(ran);
    }
    Ok(rows)
}

/// Says how long so many checks take at the pace of the row before, if that is long.
fn would_take(checks: f64, before: Option<&Ran>) -> String {
    let Some(before) = before.filter(|_| checks > MOST_CHECKS) else { return String::new() };
    let ns = before.ms() * 1e6 / before.checks.made.max(1) as f64;
    format!(", {} s at the {} ns a check of the row above", short(checks * ns / 1e9), short(ns))
}

/// Length of the finest cells, checks and milliseconds on a device, where there is one for so many boxes.
fn on_device(boxes: &[Aabb], ran: &Ran, device: &Device) -> Result<[Value; 3], Failure> {
    let config = Config { backend: Backend::Gpu, ..UNSORTED };
    let config = with_gpu_grid(config, &ran.wanted.settings(boxes), 0);
    let Some((ms, report)) = device.run_for(config, boxes, 1.0, ran.pairs)? else {
        return Ok([Value::Null, Value::Null, Value::Null]);
    };
    let cell = report.plan.gpu.as_ref().map(|plan| plan.cell);
    Ok([json!(cell), json!(report.checks.made), json!(ms)])
}

fn line(n: usize, rows: &[Ran]) -> Line {
    let mut points: Vec<(f64, f64)> = rows.iter().map(|row| (row.cell, row.ms())).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    Line { name: format!("{} boxes", thousands(n as u64)), points }
}

/// Which cells took least, by time and by checks, and how close equation 6 comes to that.
fn about_cells(n: usize, rows: &[Ran], noise: f64) -> String {
    let least = rows.iter().min_by(|a, b| a.ms().total_cmp(&b.ms()));
    let fewest = rows.iter().min_by_key(|row| row.checks.made);
    let Some((least, fewest)) = least.zip(fewest) else { return String::new() };
    let is_other = |row: &&Ran| row.cell != least.cell && row.ms() < noise * least.ms();
    let as_good: Vec<String> = rows.iter().filter(is_other).map(|row| short(row.cell)).collect();
    let as_good = match &as_good[..] {
        [] => "none of the others is as good".to_owned(),
        cells => format!("those of {} may be as good", cells.join(", ")),
    };
    let rule = rows.iter().filter(|row| matches!(row.wanted, Wanted::Rule(_)));
    let rule: Vec<String> =
        rule.map(|row| format!("{} times by {}", short(row.ms() / least.ms()), row.wanted.name())).collect();
    format!(
        "Here, {} boxes: the least of the {} that ran is {} ms, with cells of {} and {} checks; fewest checks are {}, \
         with cells of {}, in {} ms. Calls with the same cells differ by up to {} times, so \
         {as_good}. Of the least time it is {}.",
        thousands(n as u64),
        rows.len(),
        short(least.ms()),
        short(least.cell),
        thousands(least.checks.made),
        thousands(fewest.checks.made),
        short(fewest.cell),
        short(fewest.ms()),
        short(noise),
        rule.join("; ")
    )
}

/// Compares these rows with the claim that cells of 256 are better than 64 and 1024 at 10^7 boxes.
fn about_claim(rows: &[Ran], noise: f64) -> String {
    let ms = |cell: f64| of_length(rows, cell).map(Ran::ms);
    let against = |cell: f64| match ms(256.0).zip(ms(cell)) {
        Some((best, other)) => {
            let so = match best / other {
                ratio if ratio * noise < 1.0 => "so it holds here",
                ratio if ratio > noise => "so it does not hold here",
                _ => "which is too close to tell",
            };
            format!("against {} it takes {} times as long, {so}", short(cell), short(best / other))
        }
        None => by_checks(rows, [256.0, cell]),
    };
    format!("The claim for cells of 256: {}; {}.", against(64.0), against(1024.0))
}

fn of_length(rows: &[Ran], cell: f64) -> Option<&Ran> {
    rows.iter().find(|row| row.wanted == Wanted::Length(cell))
}

/// Compares two lengths, of which one did not run, by checks that were measured elsewhere.
fn by_checks(rows: &[Ran], cells: [f64; 2]) -> String {
    let calculated = |cell| expected_checks(&UNIFORM, MOST_BOXES, cell);
    let checks = |cell| of_length(rows, cell).map_or_else(|| calculated(cell), |row| row.checks.made as f64);
    let not_run = cells.into_iter().filter(|cell| of_length(rows, *cell).is_none()).map(short);
    format!(
        "against {} there is no time, but it has {} of its checks (those of {} by calculation, as they were not run)",
        short(cells[1]),
        short(checks(cells[0]) / checks(cells[1])),
        not_run.collect::<Vec<_>>().join(" and ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ran(wanted: Wanted, cell: f64, made: u64, times: &[f64]) -> Ran {
        let mut checks = Checks::default();
        checks.made = made;
        Ran { wanted, cell, pairs: 0, checks, times: times.to_vec() }
    }

    fn length(cell: f64, made: u64, times: &[f64]) -> Ran {
        ran(Wanted::Length(cell), cell, made, times)
    }

    #[test]
    fn the_least_of_the_cells_is_named_by_time_and_by_checks() {
        let rule = ran(Wanted::Rule(32.0), 200.0, 30, &[6.0]);
        let rows = [length(64.0, 10, &[9.0]), length(128.0, 20, &[2.0, 3.0, 4.0]), rule];
        let text = about_cells(10_000, &rows, noise(&rows));
        assert!(text.contains("is 3.000 ms, with cells of 128.0 and 20 checks"), "{text}");
        assert!(text.contains("fewest checks are 10, with cells of 64.00, in 9.000 ms"), "{text}");
        assert!(text.contains("up to 2.000 times, so none of the others is as good"), "{text}");
        assert!(about_cells(10_000, &rows, 2.5).contains("so those of 200.0 may be as good"), "{text}");
        assert!(text.ends_with("Of the least time it is 2.000 times by equation 6, W = 32."), "{text}");
    }

    #[test]
    fn only_calls_with_the_same_cells_tell_of_noise() {
        let rows = [length(64.0, 1, &[30.0, 33.0]), length(62.0, 1, &[20.0, 24.0])];
        assert_eq!((noise(&rows), noise(&rows[..1])), (1.2, 1.1));
        assert_eq!(rows[0].ms(), 30.0, "the shorter of two");
        let row = length(64.0, 1, &[30.0]).row(10, [Value::Null, Value::Null, Value::Null]);
        assert_eq!((&row[7], &row[8]), (&json!(1), &Value::Null), "one call does not tell how calls differ");
    }

    #[test]
    fn what_is_said_of_the_claim_is_what_the_rows_show() {
        let says = |ms: f64| about_claim(&[length(64.0, 1, &[10.0]), length(256.0, 1, &[ms])], 1.5);
        assert!(says(5.0).contains("64.00 it takes 0.5000 times as long, so it holds here"), "{}", says(5.0));
        assert!(says(8.0).contains("too close to tell") && says(20.0).contains("does not hold here"));
    }

    #[test]
    fn checks_of_cells_that_ran_are_measured_and_only_those_of_others_calculated() {
        let of_1024 = expected_checks(&UNIFORM, MOST_BOXES, 1024.0);
        let made = (of_1024 / 50.0).round() as u64;
        let told = about_claim(&[length(64.0, 1, &[10.0]), length(256.0, made, &[5.0])], 1.5);
        let measured = "it has 0.02000 of its checks (those of 1024 by calculation, as they were not run).";
        assert!(told.ends_with(measured) && told.matches("calculation").count() == 1, "{told}");
        let told = about_claim(&[length(64.0, 7, &[10.0])], 1.5);
        assert!(
            told.contains("against 64.00 there is no time") && told.contains("(those of 256.0 by"),
            "{told}"
        );
        let calculated =
            "it has 0.03641 of its checks (those of 256.0 and 1024 by calculation, as they were not run).";
        assert!(told.ends_with(calculated), "{told}");
    }

    #[test]
    fn what_is_not_run_says_how_long_it_would_take() {
        let before = length(512.0, 1_000_000, &[5.0]);
        assert_eq!(would_take(4e10, Some(&before)), ", 200.0 s at the 5.000 ns a check of the row above");
        assert_eq!(would_take(1e9, Some(&before)), "");
        assert_eq!([1.0, 3e3, 5e4].map(calls), [CALLS, LONG_CALLS, 1]);
    }

    /// All of the figure's lengths but the longest, which would take longer than all other experiments together.
    #[test]
    fn at_most_boxes_only_the_longest_cells_are_not_run() {
        let not_run = Wanted::all().filter(|wanted| wanted.why_not(MOST_BOXES).is_some());
        assert_eq!(not_run.map(Wanted::name).collect::<Vec<_>>(), ["1024"]);
    }

    #[test]
    fn short_calls_are_repeated_and_every_cell_finds_the_same() {
        let boxes = UNIFORM.boxes(2000, 1);
        let rows = [Wanted::Length(2000.0), Wanted::Rule(4.0)]
            .map(|wanted| Ran::new(&boxes, wanted).expect("found"));
        assert!(rows.iter().all(|row| row.times.len() == CALLS && row.spread() >= Some(1.0)));
        assert_eq!(rows[0].pairs, pbig_core::oracle::pairs(&boxes).len() as u64);
        assert_eq!(rows[0].pairs, rows[1].pairs);
    }
}
