//! Part of `pbig bench stages`: where each way to search a set from nothing wins, as in table 7 of Avril et al.

use super::finders::Finders;
use super::measure::Effort;
use super::table::Row;
use crate::output::Failure;
use pbig_core::{Backend, Config, Limits, Order, Strategy};
use pbig_harness::boxes::{cubes, moved};
use pbig_harness::chart::{Line, LogLog};

const CONFIG: Config = Config { limits: Limits::UNLIMITED, order: Order::Unspecified, ..Config::DEFAULT };

/// The ways, and what the plan makes of it.
const WAYS: [(&str, Config); 4] = [
    ("brute force", Config { backend: Backend::Brute, ..CONFIG }),
    ("grid", Config { strategy: Strategy::Grid, ..CONFIG }),
    ("PBIG's grid", Config { strategy: Strategy::Pbig, ..CONFIG }),
    ("as planned", CONFIG),
];

const BOXES: [usize; 9] = [10, 20, 30, 50, 100, 200, 500, 1000, 2000];

/// Pairs a box.
const DENSITIES: [f32; 3] = [0.1, 1.0, 10.0];

/// Rows and a chart for each density, and in words where ways cross.
pub(super) fn run(
    effort: Effort,
    rows: &mut Vec<Row>,
    charts: &mut Vec<LogLog>,
) -> Result<Vec<String>, Failure> {
    let mut notes = vec![];
    for pairs in DENSITIES {
        let mut lines = WAYS.map(|(name, _)| Line { name: name.into(), points: vec![] });
        for n in BOXES {
            let start = cubes(n, 1.0, pairs, 1);
            let mut ways = Finders::new(WAYS.map(|(_, config)| config), None, [moved(&start, 0.1, 2), start]);
            let times = ways.times(effort)?;
            lines.iter_mut().zip(&times).for_each(|(line, &ms)| line.points.push((n as f64, ms)));
            let names = WAYS.iter().map(|(name, _)| *name);
            let (case, found) = (format!("ways, {pairs} pairs a box"), ways.pairs()?);
            rows.push(Row::new(case, n, found).ours(times[3]).stages(names.zip(times).take(3).collect()));
        }
        notes.push(format!("ways, {pairs} pairs a box: {}", crossings(&lines)));
        charts.push(LogLog {
            name: format!("stages-ways-{pairs}"),
            title: format!("{pairs} pairs a box: where each way wins"),
            x: "boxes",
            y: "ms",
            lines: lines.into(),
            exponents: true,
        });
    }
    Ok(notes)
}

/// At how many boxes one way takes less than another.
fn crossings(lines: &[Line]) -> String {
    let [brute, grid, pbig] = [0, 1, 2].map(|k| &lines[k]);
    let less = |one: &Line, other: &Line| {
        let pairs = one.points.iter().zip(&other.points);
        let sizes: Vec<String> = pairs.filter(|(a, b)| a.1 < b.1).map(|(a, _)| a.0.to_string()).collect();
        let at = if sizes.is_empty() { "nowhere".to_owned() } else { format!("at {}", sizes.join(", ")) };
        format!("{} takes less than {} {at}", one.name, other.name)
    };
    [less(brute, grid), less(pbig, brute), less(pbig, grid)].join("; ")
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
        let lines = [line("brute", [1.0, 9.0]), line("grid", [2.0, 3.0]), line("pbig", [4.0, 5.0])];
        let text = "brute takes less than grid at 10; pbig takes less than brute at 100; pbig takes less than grid \
                    nowhere";
        assert_eq!(crossings(&lines), text);
    }
}
