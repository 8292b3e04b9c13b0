//! Part of `pbig bench stages`: where each way to search a set from nothing wins, as table 7 of Avril et al. has it for theirs.

use super::measure::{Contest, Effort, medians, timed};
use super::table::Row;
use crate::output::Failure;
use pbig_core::{Backend, Config, Finder, Limits, Order, Strategy};
use pbig_harness::boxes::{Wander, cubes};
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

struct Ways {
    finders: [Finder; WAYS.len()],
    wander: Wander,
}

impl Contest for Ways {
    fn sides(&self) -> usize {
        WAYS.len()
    }

    fn prepare(&mut self, round: usize) {
        self.wander.step(round);
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let boxes = &self.wander.boxes;
        let (found, time) = timed(|| self.finders[side].find(boxes).map(|_| ()));
        found.map(|()| time).map_err(|error| Failure::Input(error.to_string()))
    }
}

/// Rows and a chart for each density.
pub(super) fn run(effort: Effort, rows: &mut Vec<Row>, charts: &mut Vec<LogLog>) -> Result<(), Failure> {
    for pairs in DENSITIES {
        let mut lines = WAYS.map(|(name, _)| Line { name: name.into(), points: vec![] });
        for n in BOXES {
            let wander = Wander::new(cubes(n, 1.0, pairs, 1), 1.0, 0.1);
            let mut ways = Ways { finders: WAYS.map(|(_, config)| Finder::new(config)), wander };
            let times = medians(&mut ways, effort)?;
            lines.iter_mut().zip(&times).for_each(|(line, &ms)| line.points.push((n as f64, ms)));
            let names = WAYS.iter().map(|(name, _)| *name);
            let (case, found) = (format!("ways, {pairs} pairs a box"), ways.finders[0].pairs().len());
            rows.push(
                Row::new(case, n, found as u64).ours(times[3]).stages(names.zip(times).take(3).collect()),
            );
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
