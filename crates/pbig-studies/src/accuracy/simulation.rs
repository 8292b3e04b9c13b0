//! Scenes with pbig's broad phase instead of rapier's own: contacts, energy, and the paths of bodies.
//! Events come in another order, so rapier solves contacts in another order; how far that leads is held against what
//! another order of insertion does, and what our order of events does to rapier's own broad phase.

mod mechanics;
mod numbered;
mod sides;

use super::{mean, median, report};
use mechanics::Mechanics;
use pbig_harness::prelude::*;
use sides::{CLOUD, Case, PERMUTED, Side, Way, simulated};

/// Scenes, bodies and steps.
const FULL: [Case; 6] = [
    ("column", 1000, 500),
    ("pile", 500, 300),
    ("pyramid", 506, 300),
    ("ragdolls", 660, 400),
    ("compounds", 500, 400),
    (CLOUD, 500, 400),
];

const QUICK: [Case; 3] = [("column", 60, 120), ("ragdolls", 22, 60), (CLOUD, 60, 60)];

/// Rows of the table of distances, for each scene.
const INSTANTS: usize = 10;

/// Joules a kilogram below which a world counts as at rest: 4.5 cm/s on average, a tenth of the speed at which rapier
/// lets a body fall asleep.
const REST: f64 = 1e-3;

/// Named values of a row.
type Record = Vec<(String, Value)>;

pub(super) fn run(quick: bool) -> Result<Report, Failure> {
    let (mut runs, mut distances) = (vec![], vec![]);
    let mut repeated = Table::new("repeated", "scene | broad_phase | steps | differ_from_step");
    for case in if quick { &QUICK[..] } else { &FULL } {
        let sides = simulated(*case)?;
        runs.extend(rows(case.0, &sides)?);
        distances.extend((1..=INSTANTS).map(|k| distance_row(case.0, &sides, case.2 * k / INSTANTS)));
        for two in sides.windows(2).filter(|two| two[1].way.is_again) {
            repeated.row(cells![case.0, two[0].way.name, case.2, first_difference(two)]);
        }
    }
    let tables = vec![table("runs", runs), table("distances", distances), repeated];
    let axes = ["whole step, ms", "mean distance from stock's bodies at the end, m"];
    let points = points(&tables[0]);
    let mut report = report("simulation", tables, ("Whole simulations", axes), points);
    // Runs have no order.
    report.charts[0].plots[0].is_joined = false;
    Ok(report)
}

/// Returns a table with the names of the first record as columns.
fn table(name: &str, records: Vec<Record>) -> Table {
    let columns: Vec<&str> = records.iter().take(1).flatten().map(|(column, _)| column.as_str()).collect();
    let mut table = Table::new(name, &columns.join("|"));
    records.into_iter().for_each(|record| table.row(record.into_iter().map(|(_, value)| value)));
    table
}

/// Returns the first step after which the poses of two runs differ.
fn first_difference(two: &[Side]) -> Option<usize> {
    let mut both = two[0].samples.iter().zip(&two[1].samples);
    both.position(|(one, again)| one.poses != again.poses).map(|step| step + 1)
}

/// Returns points of three scenes in motion with rapier's own broad phase and with pbig's, whatever the order of bodies and
/// events. With more scenes no one could tell them apart.
fn points(runs: &Table) -> Vec<(String, f64, f64)> {
    let drawn =
        runs.rows.iter().filter(|row| ["column", "ragdolls", CLOUD].iter().any(|scene| row[0] == *scene));
    let point = |row: &Vec<Value>| {
        let kind = if row[1].as_str()?.starts_with("pbig") { "pbig" } else { "stock" };
        let name = format!("{}, {kind}", row[0].as_str()?);
        Some((name, runs.number(row, "step_ms")?, runs.number(row, "mean_distance")?))
    };
    drawn.filter_map(point).collect()
}

/// Returns a row for each way; of the permuted ones the first, the middle and the last value of each column.
fn rows(scene: &str, sides: &[Side]) -> Result<Vec<Record>, Failure> {
    let (permuted, others): (Vec<&Side>, Vec<&Side>) = sides.iter().partition(|side| side.way.is_permuted());
    let all =
        |sides: Vec<&Side>| sides.into_iter().map(|side| figures(scene, side)).collect::<Result<Vec<_>, _>>();
    let (permuted, mut rows) = (all(permuted)?, all(others)?);
    let ranks = [("least", 0), ("median", PERMUTED / 2), ("most", PERMUTED - 1)];
    let first = sides.iter().position(|side| side.way.is_permuted()).unwrap_or(0);
    rows.splice(first..first, ranks.map(|(name, rank)| ranked(&permuted, name, rank)));
    Ok(rows)
}

/// Returns the values that have so many smaller ones, column by column. A step that never came is later than all others.
fn ranked(permuted: &[Record], name: &str, rank: usize) -> Record {
    let column = |k: usize| {
        let mut values: Vec<&(String, Value)> = permuted.iter().map(|row| &row[k]).collect();
        let size = |value: &Value| value.as_f64().unwrap_or(f64::INFINITY);
        values.sort_by(|a, b| size(&a.1).total_cmp(&size(&b.1)));
        values[rank].clone()
    };
    let mut row: Record = (0..permuted[0].len()).map(column).collect();
    row[1].1 = format!("stock permuted, {name}").into();
    row
}

/// Returns one run in figures. A pair that pbig should have reported and did not is a failed check.
fn figures(scene: &str, side: &Side) -> Result<Record, Failure> {
    let all: Vec<Mechanics> = side.samples.iter().map(|sample| sample.mechanics).collect();
    let (name, reported, steps) = (side.way.name, side.reported, all.len());
    let (missed, needed) = (reported.missed, reported.needed);
    let what = || format!("{scene}, {name}: {missed} of {needed} pairs that overlap are missing");
    check(missed == 0 || !side.way.is_pbig(), what)?;
    // In the second half of the run.
    let late =
        |of: fn(&Mechanics) -> u64| mean(&all[steps / 2..].iter().map(|m| of(m) as f64).collect::<Vec<_>>());
    let points: f64 = all.iter().map(|m| m.points as f64).sum();
    let inside: f64 = all.iter().map(|m| m.points as f64 * m.mean_penetration).sum();
    let from = |step: Option<usize>| step.map_or_else(|| format!("not within {steps}").into(), Value::from);
    let rest = lasts(&all, |m| m.kinetic <= REST * m.mass);
    let awake: Vec<f64> = side.samples.iter().map(|sample| sample.awake).collect();
    let differs = side.samples.iter().position(|sample| sample.apart[1] > 0.0).map(|step| step + 1);
    let apart = side.samples.last().map(|sample| sample.apart).unwrap_or_default();
    let record: Vec<(&str, Value)> = vec![
        ("scene", scene.into()),
        ("broad_phase", name.into()),
        ("contacts", late(|m| m.contacts).into()),
        ("points", late(|m| m.points).into()),
        ("deepest_mm", (all.iter().map(|m| m.deepest).fold(0.0, f64::max) * 1e3).into()),
        ("mean_penetration_mm", (inside / points.max(1.0) * 1e3).into()),
        ("energy_at_the_end_percent", energy_left(&all).into()),
        ("energy_rise_percent", energy_rise(&all).into()),
        // Where nothing acts from outside.
        ("momentum_drift_percent", (scene == CLOUD).then(|| momentum_drift(&all)).into()),
        ("rest_from_step", from(rest)),
        ("asleep_from_step", from(lasts(&awake, |awake| *awake == 0.0))),
        ("awake_percent", mean(&awake).into()),
        ("parted_in_contact", side.parted.into()),
        ("differs_from_step", differs.into()),
        ("mean_distance", apart[0].into()),
        ("largest_distance", apart[1].into()),
        ("missed", reported.missed.into()),
        ("step_ms", median(&side.ms).into()),
        ("needed_pairs", reported.needed.into()),
        ("compared_steps", side.compared.into()),
    ];
    Ok(record.into_iter().map(|(name, value)| (name.to_owned(), value)).collect())
}

/// Returns the energy to which all percentages refer.
fn first_energy(all: &[Mechanics]) -> f64 {
    all.first().map_or(1.0, |m| m.energy().abs()).max(f64::MIN_POSITIVE)
}

fn energy_left(all: &[Mechanics]) -> f64 {
    all.last().map_or(0.0, Mechanics::energy) / first_energy(all) * 100.0
}

/// Returns the most that energy has risen above what it had been.
fn energy_rise(all: &[Mechanics]) -> f64 {
    let (mut least, mut rise) = (f64::MAX, 0.0f64);
    for energy in all.iter().map(Mechanics::energy) {
        least = least.min(energy);
        rise = rise.max(energy - least);
    }
    rise / first_energy(all) * 100.0
}

/// Returns the most that the sum of momenta has moved, in percent of the sum of their sizes at first.
fn momentum_drift(all: &[Mechanics]) -> f64 {
    let Some(first) = all.first() else { return 0.0 };
    let drift = |m: &Mechanics| (m.momentum - first.momentum).length();
    all.iter().map(drift).fold(0.0, f64::max) / first.speed.max(f64::MIN_POSITIVE) * 100.0
}

/// Returns the step from which on something is so.
fn lasts<T>(all: &[T], is_so: impl Fn(&T) -> bool) -> Option<usize> {
    let last = all.iter().rposition(|one| !is_so(one)).map_or(0, |step| step + 1);
    (last < all.len()).then_some(last + 1)
}

/// Returns mean and largest distances from the bodies of stock after a step; of the permuted runs the largest of all.
fn distance_row(scene: &str, sides: &[Side], step: usize) -> Record {
    let apart =
        |side: &Side| side.samples.get(step.max(1) - 1).map(|sample| sample.apart).unwrap_or_default();
    let permuted = sides.iter().filter(|side| side.way.is_permuted()).map(apart);
    let permuted = permuted.fold([0.0; 2], |a: [f64; 2], b| [a[0].max(b[0]), a[1].max(b[1])]);
    let column = |way: &Way| way.name.trim_start_matches("stock ").replace(' ', "_");
    let held = sides.iter().filter(|side| side.way.is_held_against_stock());
    let all = [("permuted".to_owned(), permuted)]
        .into_iter()
        .chain(held.map(|side| (column(&side.way), apart(side))));
    let of = |(name, [mean, largest]): (String, [f64; 2])| {
        [(format!("{name}_mean"), mean.into()), (format!("{name}_largest"), largest.into())]
    };
    let head = [("scene".to_owned(), scene.into()), ("step".to_owned(), step.into())];
    head.into_iter().chain(all.flat_map(of)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn energy_momentum_and_rest_by_hand() {
        let of = |kinetic| Mechanics { kinetic, mass: 2.0, ..Mechanics::default() };
        let all = [10.0, 4.0, 7.0, 5.0].map(of);
        assert_eq!((energy_left(&all), energy_rise(&all)), (50.0, 30.0));
        let with = |x, y| Mechanics { momentum: DVec3::new(x, y, 0.0), speed: 50.0, ..Mechanics::default() };
        assert_eq!(momentum_drift(&[with(1.0, 0.0), with(4.0, 4.0)]), 10.0);
        let rests = |energies: &[f64]| lasts(energies, |energy| *energy <= REST);
        assert_eq!((rests(&[1.0, REST, 1.0, REST, REST]), rests(&[REST, 1.0])), (Some(4), None));
    }
}
