//! What becomes of a scene with pbig's broad phase instead of rapier's own: contacts, energy, and where bodies go.
//! Events come in another order, so rapier solves contacts in another order; how far that leads is held against what
//! another order of insertion does.

mod figures;
mod sides;

use super::study::{Cell, Point, Study, Table, plain};
use crate::output::Failure;
use figures::{DISTANCE, Figures, Multiple, QUANTITIES, multiple};
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

/// Everything farther than so many times the yardstick is listed.
const FAR: f64 = 3.0;

/// Rows of the table of distances, for each scene.
const INSTANTS: usize = 10;

pub(super) fn run(quick: bool) -> Result<Study, Failure> {
    let cases: &[Case] = if quick { &QUICK } else { &FULL };
    let scenes = cases.iter().map(|case| scene(*case)).collect::<Result<Vec<_>, _>>()?;
    Ok(Study {
        name: "simulation",
        title: "Whole simulations",
        notes: notes(&scenes),
        tables: vec![table(&scenes), distances(&scenes), multiples(&scenes)],
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

fn table(scenes: &[Ways]) -> Table {
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
        "differs_from_step",
        "mean_distance",
        "largest_distance",
        "missed",
        "step_ms",
    ];
    let mut table = Table::new("runs", "The same scene in every way", &columns);
    for Ways { scene, runs, .. } in scenes {
        runs.iter().for_each(|run| table.row(cells(scene, run)));
    }
    table
}

fn cells(scene: &str, run: &Figures) -> [Cell; 15] {
    [
        scene.into(),
        run.way.into(),
        run.contacts.into(),
        run.points.into(),
        run.deepest.into(),
        run.penetration.into(),
        run.energy.into(),
        run.rise.into(),
        run.momentum.into(),
        run.rest.into(),
        run.differs.into(),
        run.apart.mean.into(),
        run.apart.max.into(),
        run.reported.missed.into(),
        run.ms.into(),
    ]
}

fn distances(scenes: &[Ways]) -> Table {
    let title = "Distance from stock's bodies, mean and largest (for the permuted ones the larger of all)";
    let columns = [
        "scene",
        "step",
        "permuted_mean",
        "permuted_largest",
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

/// The permuted ones together, then each of pbig's.
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
    let mut table = Table::new("multiples", title, &["scene", "broad_phase", "quantity", "times"]);
    for ways in scenes {
        for run in ways.pbig() {
            for (quantity, Multiple { times, .. }) in ways.multiples(run) {
                table.row([ways.scene.into(), run.way.into(), quantity.into(), times.into()]);
            }
        }
    }
    table
}

fn notes(scenes: &[Ways]) -> Vec<String> {
    let runs = || scenes.iter().flat_map(|ways| ways.pbig());
    let (compared, needed) =
        runs().fold((0, 0), |(steps, pairs), run| (steps + run.compared, pairs + run.reported.needed));
    let mut notes = vec![
        "Each scene with rapier's own broad phase (stock), with pbig's, with pbig's without a margin, and three \
         times with stock and the bodies inserted in another order: by that much, a run says nothing about who \
         found the pairs. All in turn, step by step. Contacts and points are means over the second half of the \
         run; penetration and momentum are of the whole run, energy is in % of that after the first step. At \
         rest: less than 1 mJ for each kg from there to the end. The cloud has no gravity, no ground and no \
         sleep: what it loses of momentum is error. In the chart stock at 0 is the run that all are held against; \
         the others of that colour are those again and permuted."
            .to_owned(),
        format!(
            "Pairs that overlap and that pbig does not report: none of {needed}, in {compared} steps (brute force)."
        ),
    ];
    notes.extend(WAYS.iter().filter_map(|way| again(scenes, way.name)));
    notes.extend(scenes.iter().map(first_difference));
    notes.push(typical(scenes));
    notes.push(how_far(scenes));
    notes
}

/// Mean distances at the end as multiples of the farthest permuted run's: geometric means over the scenes in which
/// bodies move apart.
fn typical(scenes: &[Ways]) -> String {
    let of = |name: &'static str| {
        let run = |ways: &Ways| {
            let run = ways.runs.iter().find(|run| run.way == name)?;
            multiple(run, ways.first(), &ways.yardsticks(), DISTANCE)?.times
        };
        let logs: Vec<f64> =
            scenes.iter().filter_map(run).map(f64::ln).filter(|log| log.is_finite()).collect();
        let mean = (logs.iter().sum::<f64>() / logs.len().max(1) as f64).exp();
        format!("{mean:.2} times with {name}")
    };
    let ways = WAYS.iter().filter(|way| way.is_held_against_stock());
    let all: Vec<String> = ways.map(|way| of(way.name)).collect();
    format!(
        "At the end bodies are as far from stock's as those of the farthest permuted run (geometric means over \
         scenes): {}.",
        all.join(", ")
    )
}

/// Whether the same run is the same, of a way that was run twice.
fn again(scenes: &[Ways], way: &str) -> Option<String> {
    let mut others = Vec::new();
    for Ways { scene, repeats, .. } in scenes {
        let (_, differs) = repeats.iter().find(|(name, _)| *name == way)?;
        others.extend(differs.map(|step| format!("{scene} from step {step}")));
    }
    if others.is_empty() {
        return Some(format!("Two runs with {way} are the same, to the bit of every pose, in every scene."));
    }
    Some(format!("Two runs with {way} differ ({}).", others.join(", ")))
}

fn first_difference(ways: &Ways) -> String {
    let yardsticks = ways.yardsticks();
    let permuted = yardsticks.iter().filter_map(|run| run.differs).min();
    let told = |name: &str, differs: Option<usize>| match differs {
        None => format!("{name} gives stock's positions to the bit, to the end"),
        Some(step) => format!("{name} differs from stock from step {step}"),
    };
    let pbig = ways.pbig().map(|run| told(run.way, run.differs));
    let all: Vec<String> = [told("a permuted stock", permuted)].into_iter().chain(pbig).collect();
    format!("{}: {}.", ways.scene, all.join("; "))
}

/// Every quantity in which pbig is farther from stock than permuted runs by more than [`FAR`], or the worst one.
fn how_far(scenes: &[Ways]) -> String {
    let mut all: Vec<(f64, String)> = Vec::new();
    for ways in scenes {
        for run in ways.pbig() {
            let told = |(quantity, found): (&str, Multiple)| {
                Some((found.times?, told(ways.scene, run.way, quantity, &found)))
            };
            all.extend(ways.multiples(run).filter_map(told));
        }
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (count, far) = (all.len(), all.iter().take_while(|one| one.0 > FAR));
    let far: Vec<&str> = far.map(|one| one.1.as_str()).collect();
    if far.is_empty() {
        let worst = all.first().map_or("nothing", |one| one.1.as_str());
        return format!(
            "In no quantity is pbig more than {FAR} times as far from stock as a stock with another order is: at \
             most {worst}."
        );
    }
    format!(
        "All in which pbig is more than {FAR} times as far from stock as the farthest of the stock runs with \
         another order, {} of {count} quantities: {}.",
        far.len(),
        far.join("; ")
    )
}

fn told(scene: &str, way: &str, quantity: &str, Multiple { times, values }: &Multiple) -> String {
    let [here, stock, permuted] = values.map(plain);
    let times = match times {
        Some(times) if times.is_finite() => format!("{times:.2} times"),
        _ => "no permuted run differs".into(),
    };
    format!(
        "{quantity} of {scene} with {way}, {here} where stock has {stock} and a permuted one {permuted} ({times})"
    )
}

#[cfg(test)]
mod tests {
    use super::figures::tests::nothing;
    use super::*;

    /// Stock and one permuted run with 100 and 110 contacts, pbig with these.
    fn made(pbig: f64) -> Vec<Ways> {
        let contacts = |way: &sides::Way| match (way.is_pbig(), way.is_permuted()) {
            (true, _) => pbig,
            (_, true) => 110.0,
            _ => 100.0,
        };
        let run = |way| Figures { contacts: contacts(way), way: way.name, ..nothing() };
        let repeats = vec![("stock", None), ("pbig", None)];
        vec![Ways { scene: "column", runs: WAYS.iter().map(run).collect(), instants: vec![], repeats }]
    }

    #[test]
    fn what_is_far_is_named_and_else_the_worst() {
        let near = how_far(&made(130.0));
        let worst = "with pbig, 130.0 where stock has 100.0 and a permuted one 110.0 (3.00 times)";
        assert!(near.contains("at most contacts of column") && near.contains(worst), "{near}");
        // Just beyond: pbig and pbig without a margin, in contacts and nothing else of eight quantities each.
        let far = how_far(&made(131.0));
        assert!(far.starts_with("All in which pbig is more than 3 times"), "{far}");
        assert!(far.contains(", 2 of 16 quantities") && far.matches("(3.10 times)").count() == 2, "{far}");
    }

    #[test]
    fn distances_at_the_end_are_told_as_multiples_of_the_farthest_permuted() {
        let with = |scene: &'static str, pbig: f64| {
            let mut ways = made(100.0).remove(0);
            ways.scene = scene;
            for (way, run) in WAYS.iter().zip(&mut ways.runs) {
                run.apart.mean = if way.is_pbig() { pbig } else { f64::from(u8::from(way.is_permuted())) };
            }
            ways
        };
        let told = typical(&[with("near", 0.5), with("far", 8.0), with("same", 0.0)]);
        assert!(told.ends_with(": 2.00 times with pbig, 2.00 times with pbig without margin."), "{told}");
    }

    #[test]
    fn runs_that_do_not_differ_are_said_to_be_the_same() {
        let mut scenes = made(100.0);
        let told = again(&scenes, "pbig").unwrap_or_default();
        assert!(told.contains("with pbig are the same, to the bit"), "{told}");
        assert_eq!(again(&scenes, "stock permuted 1"), None);
        let told = first_difference(&scenes[0]);
        assert_eq!(told.matches("to the bit, to the end").count(), 3, "{told}");
        scenes[0].repeats[0].1 = Some(7);
        scenes[0].runs[3].differs = Some(9);
        scenes[0].runs[2].differs = Some(8);
        let told = again(&scenes, "stock").unwrap_or_default();
        assert!(told.ends_with("differ (column from step 7)."), "{told}");
        let told = first_difference(&scenes[0]);
        assert!(told.starts_with("column: a permuted stock differs from stock from step 8;"), "{told}");
    }

    #[test]
    fn the_farthest_of_the_permuted_runs_is_the_yardstick() {
        let ways: Vec<[f64; 2]> = (0..WAYS.len()).map(|way| [way as f64, 10.0 - way as f64]).collect();
        assert_eq!(at_an_instant(&ways), [[4.0, 8.0], [5.0, 5.0], [7.0, 3.0]]);
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
        assert_eq!(drifts.len(), WAYS.len());
        assert!(drifts.iter().all(|drift| *drift < 1e-2), "{drifts:?}");
    }
}
