//! The table of runs: a row for each way, and of the permuted ones three for all.

use super::Ways;
use super::figures::Figures;
use super::sides::{PERMUTED, WAYS, Way};
use pbig_harness::cells;
use pbig_harness::table::{Cell, Table};

/// The columns about permuted runs: the first, the middle and the last of their sorted values.
const OF_PERMUTED: [(&str, usize); 3] = [("least", 0), ("median", PERMUTED / 2), ("most", PERMUTED - 1)];

pub(super) fn table(scenes: &[Ways]) -> Table {
    let columns = [
        "scene",
        "broad_phase",
        "contacts",
        "points",
        "deepest_mm",
        "mean_penetration_mm",
        "energy_at_the_end_percent",
        "energy_rise_percent",
        "momentum_drift_percent",
        "rest_from_step",
        "asleep_from_step",
        "awake_percent",
        "parted_in_contact",
        "differs_from_step",
        "mean_distance",
        "largest_distance",
        "missed",
        "step_ms",
        "needed_pairs",
        "compared_steps",
        "moving_bodies_at_the_end",
        "of_these_round",
    ];
    let mut table = Table::new("runs", columns);
    for ways in scenes {
        rows(ways).into_iter().for_each(|row| table.row(row));
    }
    table
}

/// The permuted ones where the first of them is.
fn rows(ways: &Ways) -> Vec<Vec<Cell>> {
    let all = WAYS.iter().zip(&ways.runs);
    let (permuted, others): (Vec<_>, Vec<_>) = all.partition(|(way, _)| way.is_permuted());
    let cells = |runs: Vec<(&Way, &Figures)>| -> Vec<Vec<Cell>> {
        runs.into_iter().map(|(_, run)| cells(ways.scene, run)).collect()
    };
    let (permuted, mut rows) = (cells(permuted), cells(others));
    let of_permuted = OF_PERMUTED.map(|(name, place)| among(&permuted, name, place));
    let first = WAYS.iter().position(Way::is_permuted).unwrap_or(0);
    rows.splice(first..first, of_permuted);
    rows
}

/// The cells that have so many less than them, column by column.
fn among(permuted: &[Vec<Cell>], name: &str, place: usize) -> Vec<Cell> {
    let column = |k: usize| {
        let mut cells: Vec<&Cell> = permuted.iter().map(|row| &row[k]).collect();
        cells.sort_by(|a, b| size(a).total_cmp(&size(b)));
        cells[place].clone()
    };
    let mut row: Vec<Cell> = (0..permuted[0].len()).map(column).collect();
    row[1] = format!("stock permuted, {name}").into();
    row
}

/// A step that never came is later than all others.
fn size(cell: &Cell) -> f64 {
    match cell {
        Cell::Number(number) => *number,
        Cell::Count(count) => *count as f64,
        _ => f64::INFINITY,
    }
}

fn cells(scene: &str, run: &Figures) -> Vec<Cell> {
    let from =
        |step: Option<usize>| step.map_or_else(|| format!("not within {}", run.steps).into(), Cell::from);
    let contacts = cells![scene, run.way, run.contacts, run.points, run.deepest, run.penetration];
    let energy = cells![run.energy, run.rise, run.momentum];
    let sleep = [from(run.rest), from(run.asleep), run.awake.into(), run.parted.into(), run.differs.into()];
    let apart = cells![run.apart.mean, run.apart.max, run.reported.missed, run.ms];
    let end = cells![run.reported.needed, run.compared, run.moving.moving, run.moving.round];
    [contacts, energy, sleep.into(), apart, end].concat()
}
