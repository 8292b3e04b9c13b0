//! Part of `pbig bench stages`: where each way to search a set from nothing wins, as in table 7 of Avril et al.: by number of
//! boxes and density, one grid against levels by spread of sizes, and which rows the grid's kernel looks at by density.

use super::finders::Finders;
use super::measure::Effort;
use super::regret::{regret, winners};
use super::table::Row;
use crate::output::{Failure, progress};
use pbig_core::{Backend, Config, Grids, Limits, Look, Order, Plan, Strategy, Study};
use pbig_harness::boxes::{cubes, moved};
use pbig_harness::chart::{Line, LogLog};
use std::time::Duration;

const CONFIG: Config = Config { limits: Limits::UNLIMITED, order: Order::Unspecified, ..Config::DEFAULT };

/// The ways, and what the plan makes of it.
const WAYS: [(&str, Config); 4] = [
    ("brute force", Config { backend: Backend::Brute, ..CONFIG }),
    ("grid", Config { strategy: Strategy::Grid, ..CONFIG }),
    ("PBIG's grid", Config { strategy: Strategy::Pbig, ..CONFIG }),
    PLANNED,
];

const PLANNED: (&str, Config) = ("as planned", CONFIG);

const fn of_grids(grids: Grids) -> Config {
    Config { study: Study { grids, ..Study::DEFAULT }, ..CONFIG }
}

const GRIDS: [(&str, Config); 3] =
    [("one grid", of_grids(Grids::One)), ("levels", of_grids(Grids::Levels)), PLANNED];

/// All in one grid: the plan is the same but for the rows.
const fn looking(look: Look) -> Config {
    Config { study: Study { look, grids: Grids::One, ..Study::DEFAULT }, strategy: Strategy::Grid, ..CONFIG }
}

const LOOKS: [(&str, Config); 4] = [
    ("everywhere", looking(Look::Everywhere)),
    ("trimmed", looking(Look::Trimmed)),
    ("seldom", looking(Look::Seldom)),
    ("as planned", looking(Look::Auto)),
];

const BOXES: [usize; 9] = [10, 20, 30, 50, 100, 200, 500, 1000, 2000];

/// Pairs a box.
const DENSITIES: [f64; 3] = [0.1, 1.0, 10.0];

const MS: &str = "ms";
const NS: &str = "ns for each box and pair";

/// What is varied, and the ways, of which the last is ours.
struct Sweep {
    /// Of the chart.
    name: String,
    title: String,
    case: String,
    /// Along the x axis; also in the rows' case, if it is not the number of boxes.
    x: &'static str,
    /// Along the y axis: times of a call, or their parts for each box and pair, where ways differ by less than sets do.
    y: &'static str,
    ways: &'static [(&'static str, Config)],
    points: Vec<Point>,
}

/// A set.
#[derive(Clone, Copy)]
struct Point {
    x: f64,
    boxes: usize,
    spread: f64,
    pairs: f64,
}

fn by_boxes(pairs: f64) -> Sweep {
    let point = |boxes: usize| Point { x: boxes as f64, boxes, spread: 1.0, pairs };
    Sweep {
        name: format!("stages-ways-{pairs}"),
        title: format!("{pairs} pairs a box: where each way wins"),
        case: format!("ways, {pairs} pairs a box"),
        x: "boxes",
        y: MS,
        ways: &WAYS,
        points: BOXES.map(point).into(),
    }
}

/// At this density as at others: levels pay where many small boxes lie in a cell of the large ones.
fn by_spread(boxes: usize, pairs: f64) -> Sweep {
    let point = |spread: f64| Point { x: spread, boxes, spread, pairs };
    Sweep {
        name: format!("stages-grids-{pairs}"),
        title: format!("{boxes} boxes, {pairs} pairs each: one grid against levels"),
        case: format!("grids, {pairs} pairs a box"),
        x: "largest edge / smallest",
        y: MS,
        ways: &GRIDS,
        points: [1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0].map(point).into(),
    }
}

fn by_density(boxes: usize) -> Sweep {
    let point = |pairs: f64| Point { x: pairs, boxes, spread: 1.0, pairs };
    Sweep {
        name: "stages-rows".into(),
        title: format!("{boxes} boxes in one grid: which rows the kernel looks at"),
        case: "rows".into(),
        x: "pairs a box",
        y: NS,
        ways: &LOOKS,
        points: [0.01, 0.03, 0.1, 0.3, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0].map(point).into(),
    }
}

/// Rows and a chart for each sweep, and in words where ways cross.
pub(super) fn run(
    quick: bool,
    rows: &mut Vec<Row>,
    charts: &mut Vec<LogLog>,
) -> Result<Vec<String>, Failure> {
    let n = if quick { 5000 } else { 100_000 };
    let effort = Effort::new(quick);
    let large = Effort { budget: effort.budget.min(Duration::from_millis(2500)), ..effort };
    let sizes = DENSITIES.map(|pairs| (by_boxes(pairs), effort));
    let others = [by_spread(n, 1.0), by_spread(n, 10.0), by_density(n)].map(|sweep| (sweep, large));
    let sweeps: Vec<(Sweep, Effort)> = sizes.into_iter().chain(others).collect();
    let bar = progress(sweeps.iter().map(|(sweep, _)| sweep.points.len()).sum(), "sets");
    let mut notes = vec![];
    for (mut sweep, effort) in sweeps {
        if quick {
            // Every third, and the last.
            sweep.points = sweep.points.iter().rev().step_by(3).rev().copied().collect();
        }
        let mut lines: Vec<Line> =
            sweep.ways.iter().map(|(name, _)| Line { name: (*name).into(), points: vec![] }).collect();
        for point in &sweep.points {
            let (row, times) = measure(&sweep, point, effort)?;
            let unit = if sweep.y == NS { 1e6 / (point.boxes as u64 + row.pairs) as f64 } else { 1.0 };
            lines.iter_mut().zip(times).for_each(|(line, ms)| line.points.push((point.x, unit * ms)));
            rows.push(row);
            bar.inc(1);
        }
        notes.push(format!("{}: {}", sweep.case, in_words(&lines)));
        charts.push(chart(sweep, lines));
    }
    bar.finish_and_clear();
    Ok(notes)
}

/// All ways in turn on one set.
fn measure(sweep: &Sweep, point: &Point, effort: Effort) -> Result<(Row, Vec<f64>), Failure> {
    let start = cubes(point.boxes, point.spread as f32, point.pairs as f32, 1);
    let configs = sweep.ways.iter().map(|(_, config)| *config);
    let mut ways = Finders::new(configs, None, [moved(&start, 0.1, 2), start]);
    let times = ways.times(effort)?;
    let planned = ways.all.last().map(|finder| &finder.report().plan);
    let note = planned.map_or(String::new(), as_planned);
    let is_size = sweep.x == "boxes";
    let case = if is_size { sweep.case.clone() } else { format!("{}, {} {}", sweep.case, sweep.x, point.x) };
    let others = sweep.ways.iter().map(|(name, _)| *name).zip(times.iter().copied());
    let stages = others.take(times.len() - 1).collect();
    let row =
        Row::new(case, point.boxes, ways.pairs()?).ours(times[times.len() - 1]).stages(stages).note(note);
    Ok((row, times))
}

/// What the plan makes of a set, in brief.
fn as_planned(plan: &Plan) -> String {
    let levels = match plan.levels.len() {
        0 => String::new(),
        1 => format!(" of one level, rows looked at: {}", plan.looks),
        levels => format!(" of {levels} levels, rows looked at: {}", plan.looks),
    };
    format!("as planned: {}{levels}", plan.chosen.name())
}

/// Where each of the others takes least, and how far what is planned is from that.
fn in_words(lines: &[Line]) -> String {
    let (others, planned) = lines.split_at(lines.len() - 1);
    let (others, at): (Vec<&Line>, fn(f64) -> String) = (others.iter().collect(), |x| x.to_string());
    let told = regret(&planned[0], &others, at).map_or(String::new(), |told| format!("; {told}"));
    format!("{}{told}", crossings(&others, at))
}

/// At how many boxes, or at what else, each way takes less than another.
fn crossings(lines: &[&Line], at: fn(f64) -> String) -> String {
    let less = |one: &Line, other: &Line| {
        let pairs = one.points.iter().zip(&other.points);
        let places: Vec<String> = pairs.filter(|(a, b)| a.1 < b.1).map(|(a, _)| at(a.0)).collect();
        let at = if places.is_empty() { "nowhere".to_owned() } else { format!("at {}", places.join(", ")) };
        format!("{} takes less than {} {at}", one.name, other.name)
    };
    match lines {
        [brute, grid, pbig] if pbig.name == WAYS[2].0 => {
            [less(brute, grid), less(pbig, brute), less(pbig, grid)].join("; ")
        }
        _ => format!("least: {}", winners(lines, at)),
    }
}

fn chart(sweep: Sweep, lines: Vec<Line>) -> LogLog {
    let Sweep { name, title, x, y, .. } = sweep;
    LogLog { name, title, x, y, lines, exponents: x == "boxes" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_are_where_times_say_so() {
        let line = |name: &str, ms: [f64; 2]| Line {
            name: name.into(),
            points: [10.0, 100.0].into_iter().zip(ms).collect(),
        };
        let lines = [
            line("brute", [1.0, 9.0]),
            line("grid", [2.0, 3.0]),
            line(WAYS[2].0, [4.0, 5.0]),
            line("plan", [2.0, 3.0]),
        ];
        let text = "brute takes less than grid at 10; PBIG's grid takes less than brute at 100; PBIG's grid takes less than \
                    grid nowhere; plan takes 2.00 times as long as the best of them at worst, at 10, and 1.41 times on \
                    average";
        assert_eq!(in_words(&lines), text);
        let text = "least: brute at 10; grid at 100; plan takes 2.00 times";
        assert!(in_words(&[&lines[..2], &lines[3..]].concat()).starts_with(text));
    }

    /// What is raced is what was asked for: the plan's choice would be another one.
    #[test]
    fn grids_and_rows_are_those_of_their_names() {
        let start = cubes(2000, 1000.0, 10.0, 1);
        let effort = Effort { warm_up: 0, rounds: 2, budget: Duration::ZERO };
        let plans = |ways: &[(&str, Config)]| {
            let frames = [start.clone(), start.clone()];
            let mut finders = Finders::new(ways.iter().map(|(_, config)| *config), None, frames);
            finders.times(effort).expect("measured");
            assert!(finders.pairs().expect("all agree") > 0);
            finders.all.iter().map(|finder| finder.report().plan.clone()).collect::<Vec<_>>()
        };
        let grids = plans(&GRIDS);
        assert_eq!((grids[0].levels.len(), grids[0].swept), (1, 0));
        assert!(grids[1].levels.len() > 1 || grids[1].swept > 0);
        let names: Vec<String> = plans(&LOOKS).iter().map(|plan| plan.looks.to_string()).collect();
        assert_eq!(names[..3], ["everywhere", "trimmed", "seldom"]);
    }
}
