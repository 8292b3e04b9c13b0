//! Scenes with pbig's broad phase instead of rapier's own: contacts, energy, and the paths of bodies.
//! Events come in another order, so rapier solves contacts in another order; how far that leads is held against what
//! another order of insertion does, and what our order of events does to rapier's own broad phase.

mod figures;
mod runs;
mod sides;
mod sleep;
mod tails;
mod told;

use super::study::{Cell, Point, Study, Table};
use crate::output::Failure;
use figures::{Figures, Multiple, QUANTITIES, multiple};
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

pub(super) fn run(quick: bool) -> Result<Study, Failure> {
    let cases: &[Case] = if quick { &QUICK } else { &FULL };
    let scenes = cases.iter().map(|case| scene(*case)).collect::<Result<Vec<_>, _>>()?;
    Ok(Study {
        name: "simulation",
        title: "Whole simulations",
        notes: told::notes(&scenes),
        tables: vec![runs::table(&scenes), distances(&scenes), tails::table(&scenes), multiples(&scenes)],
        time: "whole step, ms",
        error: "distance from stock's bodies at the end, mean",
        points: scenes.iter().flat_map(points).collect(),
        // Runs have no order.
        joined: false,
    })
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

impl Ways {
    fn first(&self) -> &Figures {
        &self.runs[0]
    }

    fn yardsticks(&self) -> Vec<&Figures> {
        self.of(sides::Way::is_permuted).collect()
    }

    fn pbig(&self) -> impl Iterator<Item = &Figures> {
        self.of(|way| way.is_pbig() && way.is_held_against_stock())
    }

    /// The runs that are held against the permuted ones.
    fn held(&self) -> impl Iterator<Item = &Figures> {
        self.of(sides::Way::is_held_against_stock)
    }

    fn of(&self, wanted: fn(&sides::Way) -> bool) -> impl Iterator<Item = &Figures> {
        WAYS.iter().zip(&self.runs).filter(move |(way, _)| wanted(way)).map(|(_, run)| run)
    }

    /// A run in each quantity that has a meaning here.
    fn multiples<'a>(&'a self, run: &'a Figures) -> impl Iterator<Item = (&'static str, Multiple)> + 'a {
        QUANTITIES.into_iter().filter_map(|quantity| {
            Some((quantity.name, multiple(run, self.first(), &self.yardsticks(), quantity)?))
        })
    }
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

/// A series for each scene and kind of broad phase: scenes differ more than broad phases do.
fn points(Ways { scene, runs, .. }: &Ways) -> Vec<Point> {
    let point = |(way, run): (&sides::Way, &Figures)| Point {
        series: format!("{scene}, {}", way.kind()),
        time: run.ms,
        error: run.apart.mean,
    };
    WAYS.iter().zip(runs).map(point).collect()
}

fn distances(scenes: &[Ways]) -> Table {
    let title = "Distance from stock's bodies, mean and largest (for the permuted ones the larger of all)";
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
    let mut table = Table::new("distances", title, &columns);
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

fn multiples(scenes: &[Ways]) -> Table {
    let title = "How far from stock, as a multiple of the farthest permuted run (-: it came about in neither; \
                 inf: no permuted run differs from stock)";
    let columns = ["scene", "broad_phase", "quantity", "times", "permuted_runs_nearer_percent"];
    let mut table = Table::new("multiples", title, &columns);
    for ways in scenes {
        for run in ways.held() {
            for (quantity, Multiple { times, nearer, .. }) in ways.multiples(run) {
                let percent = times.map(|_| 100.0 * nearer as f64 / ways.yardsticks().len().max(1) as f64);
                table.row([ways.scene.into(), run.way.into(), quantity.into(), times.into(), percent.into()]);
            }
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::sides::PERMUTED;
    use super::*;

    #[test]
    fn the_farthest_of_the_permuted_runs_is_the_yardstick() {
        let ways: Vec<[f64; 2]> = (0..WAYS.len()).map(|way| [way as f64, 10.0 - way as f64]).collect();
        let sorted = 2.0 + PERMUTED as f64;
        let held = [sorted, sorted + 2.0, sorted + 3.0, sorted + 5.0].map(|way| [way, 10.0 - way]);
        let right = [&[[sorted - 1.0, 8.0]], &held[..]].concat();
        assert_eq!(at_an_instant(&ways), right);
    }

    #[test]
    fn a_quick_study_has_all_ways_and_stock_lies_at_zero() {
        let study = run(true).expect("no failure");
        assert_eq!(study.points.len(), QUICK.len() * WAYS.len());
        assert_eq!(study.tables[1].rows.len(), QUICK.len() * INSTANTS);
        let stock: Vec<_> = study.points.iter().step_by(WAYS.len()).collect();
        assert!(stock.iter().all(|point| point.error == 0.0 && point.time > 0.0));
        assert!(stock.iter().all(|point| point.series.ends_with(", stock")), "{stock:?}");
        assert_eq!(study.chart().lines.len(), 3 * QUICK.len(), "scenes and kinds of broad phase");
        // A world that is shaken loses energy and rests; one that nothing acts on keeps its momentum.
        for row in &study.tables[0].rows {
            let Cell::Number(energy) = row[6] else { panic!("{row:?}") };
            assert!(energy < 101.0, "{row:?}");
        }
        let drift = |row: &Vec<Cell>| if let Cell::Number(drift) = row[8] { Some(drift) } else { None };
        let drifts: Vec<f64> = study.tables[0].rows.iter().filter_map(drift).collect();
        assert_eq!(drifts.len(), study.tables[0].rows.len() / QUICK.len(), "the cloud's alone");
        assert!(drifts.iter().all(|drift| *drift < 1e-2), "{drifts:?}");
    }
}
