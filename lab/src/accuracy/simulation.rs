//! Scenes with pbig's broad phase instead of rapier's own: step times, and the paths of bodies.
//! Events come in another order, so rapier solves contacts in another order. The effect is compared with the effect of another
//! order of insertion, and with the effect of our order of events on rapier's own broad phase.

mod numbered;
mod reordered;
mod reported;

use super::report;
use numbered::Numbered;
use pbig_harness::prelude::*;
use rapier3d::prelude::BroadPhase;
use reordered::KINDS;
use reported::Reported;

/// A scene, its bodies, and its steps.
type SceneCase = (&'static str, usize, usize);

const FULL: [SceneCase; 6] = [
    ("column", 1000, 500),
    ("pile", 500, 300),
    ("pyramid", 506, 300),
    ("ragdolls", 660, 400),
    ("compounds", 500, 400),
    (numbered::CLOUD, 500, 400),
];

const QUICK: [SceneCase; 3] = [("column", 60, 120), ("ragdolls", 22, 60), (numbered::CLOUD, 60, 60)];

/// The number of orders of insertion beside the scene's: a run that is one more of them is farther than all these once in 20 times.
const PERMUTED: u64 = 19;

/// Steps from one comparison with brute force to the next.
const COMPARED: usize = 20;

const STOCK: &str = "stock";
const PERMUTED_NAME: &str = "stock permuted";

pub(super) fn run(quick: bool) -> Result<BenchReport, Failure> {
    let columns = "scene | broad_phase | mean_distance | largest_distance | differs_from_step | step_ms | missed | needed_pairs";
    let mut runs = Table::new("runs", columns);
    let mut repeated = Table::new("repeated", "scene | broad_phase | steps | differ_from_step");
    let cases = if quick { &QUICK[..] } else { &FULL };
    for case in cases {
        let sides = simulated(*case)?;
        for side in sides.iter().filter(|side| !side.is_again) {
            runs.row(figures(case.0, side)?);
        }
        for two in sides.windows(2).filter(|two| two[1].is_again) {
            repeated.row(cells![case.0, two[0].name, case.2, first_difference(two)]);
        }
    }
    let axes = ["whole step, ms", "mean distance from stock's bodies at the end, m"];
    let points = points(&runs);
    let tables = vec![drift(cases, &runs), runs, repeated];
    let mut report = report("simulation", tables, ("Whole simulations", axes), points);
    // Runs have no order.
    report.charts[0].plots[0].is_joined = false;
    Ok(report)
}

/// Returns the first step after which the poses of two runs differ.
fn first_difference(two: &[VariantRun]) -> Option<usize> {
    let mut both = two[0].poses.iter().zip(&two[1].poses);
    both.position(|(one, again)| one != again).map(|step| step + 1)
}

/// Returns the mean distance from stock's bodies at the end: the farthest permuted run, pbig, and stock with sorted events.
fn drift(cases: &[SceneCase], runs: &Table) -> Table {
    let mut table = Table::new("drift", "scene | steps | farthest_permuted | pbig | stock_sorted");
    for (scene, _, steps) in cases {
        let distance = |name: &str| {
            let rows = runs.rows.iter().filter(|row| row[0] == *scene && row[1] == name);
            rows.filter_map(|row| runs.number(row, "mean_distance")).reduce(f64::max)
        };
        table.row(cells![*scene, *steps, ..[PERMUTED_NAME, "pbig", "stock sorted"].map(distance)]);
    }
    table
}

/// Returns points of three scenes in motion with rapier's own broad phase and with pbig's, in every order of bodies and events.
/// More scenes could not be told apart.
fn points(runs: &Table) -> Vec<(String, f64, f64)> {
    let drawn = ["column", "ragdolls", numbered::CLOUD];
    let drawn = runs.rows.iter().filter(|row| drawn.iter().any(|scene| row[0] == *scene));
    let point = |row: &Vec<Value>| {
        let kind = if row[1] == "pbig" { "pbig" } else { STOCK };
        let name = format!("{}, {kind}", row[0].as_str()?);
        Some((name, runs.number(row, "step_ms")?, runs.number(row, "mean_distance")?))
    };
    drawn.filter_map(point).collect()
}

/// Returns one run in figures. A pair that pbig should have reported and did not is a failed check.
fn figures(scene: &str, side: &VariantRun) -> Result<Vec<Value>, Failure> {
    let (name, Reported { missed, needed }) = (side.name, side.reported);
    let what = || format!("{scene}, {name}: {missed} of {needed} pairs that overlap are missing");
    check(missed == 0 || name != "pbig", what)?;
    let differs = side.apart.iter().position(|[_, most]| *most > 0.0).map(|step| step + 1);
    let distances = side.apart.last().copied().unwrap_or_default();
    let step = Spread::of(side.ms.iter().copied()).median;
    Ok(cells![scene, name, ..distances, differs, step, missed, needed])
}

/// One run of a scene.
struct VariantRun {
    name: &'static str,
    /// True for the run before it once more.
    is_again: bool,
    numbered: Numbered,
    broad_phase: Box<dyn BroadPhase>,
    /// A hash of all poses after each step.
    poses: Vec<u64>,
    /// Mean and largest distance from the first run's bodies after each step.
    apart: Vec<[f64; 2]>,
    /// Milliseconds of each step.
    ms: Vec<f64>,
    /// Sums over the steps in which pairs were compared with brute force.
    reported: Reported,
}

impl VariantRun {
    fn step(&mut self) {
        let ((), ms) = timed(|| self.numbered.world.step(&mut *self.broad_phase));
        self.ms.push(ms);
        self.poses.push(self.numbered.hash());
        if self.ms.len().is_multiple_of(COMPARED) {
            self.reported += Reported::of(&self.numbered.world);
        }
    }
}

/// Returns all runs before their first step, the one that the others are held against first.
fn variants(scene: &Numbered) -> Vec<VariantRun> {
    let run = |name, is_again, seed: Option<u64>| {
        let wanted = if seed.is_some() { STOCK } else { name };
        let (_, broad_phase) =
            KINDS.into_iter().find(|(kind, _)| *kind == wanted).expect("a broad phase of this name");
        let (poses, apart, ms, reported) = Default::default();
        let (numbered, broad_phase) = (scene.inserted(seed), broad_phase());
        VariantRun { name, is_again, numbered, broad_phase, poses, apart, ms, reported }
    };
    let permuted = (1..=PERMUTED).map(|seed| run(PERMUTED_NAME, false, Some(seed)));
    let twice = |name| [false, true].map(|is_again| run(name, is_again, None));
    let runs = twice(STOCK).into_iter().chain(permuted);
    runs.chain(twice("stock sorted")).chain(twice("pbig")).collect()
}

/// Runs a scene in all ways, in turn step by step.
fn simulated(case: SceneCase) -> Result<Vec<VariantRun>, Failure> {
    let mut sides = variants(&Numbered::of_scene(case.0, case.1)?);
    let count = sides.len();
    for step in 0..case.2 {
        (0..count).for_each(|place| sides[(step + place) % count].step());
        let apart: Vec<_> = sides.iter().map(|side| sides[0].numbered.apart(&side.numbered)).collect();
        sides.iter_mut().zip(apart).for_each(|(side, apart)| side.apart.push(apart));
    }
    Ok(sides)
}
