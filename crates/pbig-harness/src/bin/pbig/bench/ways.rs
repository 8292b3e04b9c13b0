//! Part of `pbig bench stages`: where each way to search a set from nothing wins, as table 7 of Avril et al. has it for theirs.

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

/// Rows and a chart for each density.
pub(super) fn run(effort: Effort, rows: &mut Vec<Row>, charts: &mut Vec<LogLog>) -> Result<(), Failure> {
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
        charts.push(LogLog {
            name: format!("stages-ways-{pairs}"),
            title: format!("{pairs} pairs a box: where each way wins"),
            x: "boxes",
            y: "ms",
            lines: lines.into(),
        });
    }
    Ok(())
}
