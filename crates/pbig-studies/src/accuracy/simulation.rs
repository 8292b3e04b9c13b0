//! Scenes with pbig's broad phase instead of rapier's own: contacts, energy, and the paths of bodies.
//! Events come in another order, so rapier solves contacts in another order; how far that leads is held against what
//! another order of insertion does, and what our order of events does to rapier's own broad phase.

mod figures;
mod runs;
mod sides;

use super::report;
use figures::Figures;
use pbig_harness::cells;
use pbig_harness::output::Failure;
use pbig_harness::report::Report;
use pbig_harness::table::{Cell, Table};
use sides::{CLOUD, Case, Side, WAYS, case, repeats, simulated};

const FULL: [Case; 6] = [
    case("column", 1000, 500),
    case("pile", 500, 300),
    case("pyramid", 506, 300),
    case("ragdolls", 660, 400),
    case("compounds", 500, 400),
    case(CLOUD, 500, 400),
];

const QUICK: [Case; 3] = [case("column", 60, 120), case("ragdolls", 22, 60), case(CLOUD, 60, 60)];

/// Rows of the table of distances, for each scene.
const INSTANTS: usize = 10;

pub(super) fn run(quick: bool) -> Result<Report, Failure> {
    let cases: &[Case] = if quick { &QUICK } else { &FULL };
    let scenes = cases.iter().map(|case| scene(*case)).collect::<Result<Vec<_>, _>>()?;
    let tables = vec![runs::table(&scenes), distances(&scenes), repeated(&scenes)];
    let axes = ["whole step, ms", "mean distance from stock's bodies at the end, m"];
    let mut report = report("simulation", tables, ("Whole simulations", axes), points(&scenes));
    // Runs have no order.
    report.charts[0].plots[0].is_joined = false;
    Ok(report)
}

/// A scene run in all ways.
struct Ways {
    scene: &'static str,
    /// In the order of [`WAYS`].
    runs: Vec<Figures>,
    /// Mean and largest distance by instant, then by way.
    instants: Vec<(usize, Vec<[f64; 2]>)>,
    /// Ways that were run twice, and the step from which on the two differ.
    repeats: Vec<(&'static str, Option<usize>)>,
}

fn scene(case: Case) -> Result<Ways, Failure> {
    let sides = simulated(case)?;
    let figures =
        |side: &Side| Figures::of(side, case.scene == CLOUD).complete(case.scene, side.way.is_pbig());
    let runs = sides.iter().map(figures).collect::<Result<_, _>>()?;
    let instant = |k: usize| case.steps * k / INSTANTS;
    let at = |step: usize| (step, sides.iter().map(|side| distance(side, step)).collect());
    let instants = (1..=INSTANTS).map(|k| at(instant(k))).collect();
    Ok(Ways { scene: case.scene, runs, instants, repeats: repeats(&sides) })
}

/// After so many steps, at least one.
fn distance(side: &Side, step: usize) -> [f64; 2] {
    let apart = side.samples.get(step.max(1) - 1).map(|sample| sample.apart).unwrap_or_default();
    [apart.mean, apart.max]
}

/// Returns points of each scene with rapier's own broad phase and with pbig's, whatever the order of bodies and events.
fn points(scenes: &[Ways]) -> impl Iterator<Item = (String, f64, f64)> {
    // Three scenes in motion: with more no one can tell them apart.
    let drawn = scenes.iter().filter(|ways| ["column", "ragdolls", CLOUD].contains(&ways.scene));
    let runs = drawn.flat_map(|ways| WAYS.iter().zip(&ways.runs).map(|(way, run)| (ways.scene, way, run)));
    runs.map(|(scene, way, run)| {
        let kind = if way.is_pbig() { "pbig" } else { "stock" };
        (format!("{scene}, {kind}"), run.ms, run.apart.mean)
    })
}

/// Runs with one broad phase that were made twice: the step from which on the two differ; empty if they are the same.
fn repeated(scenes: &[Ways]) -> Table {
    let mut table = Table::new("repeated", ["scene", "broad_phase", "steps", "differ_from_step"]);
    for Ways { scene, repeats, runs, .. } in scenes {
        repeats.iter().for_each(|(way, step)| table.row(cells![*scene, *way, runs[0].steps, *step]));
    }
    table
}

/// Distances from the bodies of stock; of the permuted runs the largest of all.
fn distances(scenes: &[Ways]) -> Table {
    let columns = [
        "scene",
        "step",
        "permuted_mean",
        "permuted_largest",
        "sorted_mean",
        "sorted_largest",
        "pbig_lower_first_mean",
        "pbig_lower_first_largest",
        "pbig_mean",
        "pbig_largest",
        "pbig_without_margin_mean",
        "pbig_without_margin_largest",
    ];
    let mut table = Table::new("distances", columns);
    for Ways { scene, instants, .. } in scenes {
        for (step, ways) in instants {
            let head = [Cell::from(*scene), (*step).into()];
            table.row(head.into_iter().chain(at_an_instant(ways).into_iter().flatten().map(Cell::from)));
        }
    }
    table
}

/// The permuted ones together, then each that is held against them.
fn at_an_instant(ways: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let of = |wanted: fn(&sides::Way) -> bool| {
        WAYS.iter().zip(ways).filter(move |(way, _)| wanted(way)).map(|(_, apart)| *apart)
    };
    let larger = |a: [f64; 2], b: [f64; 2]| [a[0].max(b[0]), a[1].max(b[1])];
    let permuted = of(sides::Way::is_permuted).fold([0.0; 2], larger);
    [permuted].into_iter().chain(of(sides::Way::is_held_against_stock)).collect()
}
