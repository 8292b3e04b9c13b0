//! The margin of stored boxes: with a wider one fewer boxes change, and more pairs are extra. From one state of a scene a world
//! with each margin goes on, all in turn step by step, and all of it twice: of each step the shorter time counts.

use super::{mean, percent, report};
use crate::UNLIMITED;
use crate::reported::Reported;
use pbig_core::{Aabb, BroadPhase, Error, Finder, Pair, ProxyFilter};
use pbig_harness::prelude::*;
use pbig_harness::runner::Run;
use pbig_harness::scenes::Scene;
use pbig_harness::world::World;
use rapier_pbig::{PbigBroadPhase, PbigConfig};

/// In units of rapier's length unit, as `Config::margin`.
const MARGINS: [f64; 8] = [0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5];
/// The place of rapier-pbig's default.
const DEFAULT: usize = 2;

/// Rounds that do not count: boxes are new in the first, and later ones learn how they move.
const WARM_UP: usize = 8;

/// Rounds from one comparison with brute force to the next.
const COMPARED: usize = 10;

/// All is done so often. The work is the same each time, so the shortest time of each round is the one least disturbed.
/// (A median over rounds would hide what a margin does: boxes of one speed leave their fat boxes in the same round.)
const PASSES: usize = 2;

pub(super) fn run(quick: bool) -> Result<BenchReport, Failure> {
    let mut rows = worlds(quick)?;
    rows.extend(boxes(quick)?);
    let tables = vec![table(&rows), means(&rows)];
    let axes = ["broad phase, ms a step", "extra pairs, % of overlapping pairs"];
    let scene = |row: &MarginRow| row.case.split(' ').next().unwrap_or_default().to_owned();
    let mut firsts: Vec<&[MarginRow]> = rows.chunks(MARGINS.len()).collect();
    firsts.sort_by_key(|case| scene(&case[0]));
    firsts.dedup_by_key(|case| scene(&case[0]));
    let point = |row: &MarginRow| (row.case.clone(), row.work.means()[0], row.work.extra_percent());
    Ok(report("margin", tables, ("Margin of stored boxes", axes), firsts.into_iter().flatten().map(point)))
}

/// The steps of one margin in one pass.
#[derive(Clone, Default)]
struct MarginWork {
    /// Milliseconds of each step: the broad phase, and the whole step.
    times: Vec<[f64; 2]>,
    /// Boxes that the broad phase was told of, and those of them that had left their fat box.
    counts: [u64; 2],
    /// Sums over the compared steps, and their number.
    reported: Reported,
    compared: u64,
}

/// One round of one margin: its times, listed and changed boxes, and the comparison in rounds that have one.
type Round = ([f64; 2], [u64; 2], Option<Reported>);

impl MarginWork {
    fn add(&mut self, (times, counts, reported): Round) {
        self.times.push(times);
        self.counts = [0, 1].map(|k| self.counts[k] + counts[k]);
        self.compared += u64::from(reported.is_some());
        self.reported += reported.unwrap_or_default();
    }

    fn extra_percent(&self) -> f64 {
        percent(self.reported.extra, self.reported.needed)
    }

    fn means(&self) -> [f64; 2] {
        [0, 1].map(|time| mean(&self.times.iter().map(|times| times[time]).collect::<Vec<_>>()))
    }
}

/// A world for each margin.
trait MarginCase {
    /// Prepares a round.
    fn prepare(&mut self, _round: usize, _is_compared: bool) -> Result<(), Failure> {
        Ok(())
    }

    /// Makes one margin's step.
    fn step(&mut self, margin: usize, is_compared: bool) -> Result<Round, Failure>;
}

/// One margin in one case; [`MARGINS`] in their order make a case.
#[derive(Clone)]
struct MarginRow {
    case: String,
    boxes: usize,
    margin: f64,
    has_step: bool,
    /// The shorter times of each step.
    work: MarginWork,
    /// Mean milliseconds of each pass.
    passes: [[f64; 2]; PASSES],
}

impl MarginRow {
    /// Fails if a pair is missing.
    fn new(case: &str, margin: usize, all: [&MarginWork; PASSES], has_step: bool) -> Result<Self, Failure> {
        let Reported { missed, needed, .. } = all[0].reported;
        let (margin, mut work) = (MARGINS[margin], all[0].clone());
        let what = || format!("{case}, margin {margin}: {missed} of {needed} pairs that overlap are missing");
        check(missed == 0, what)?;
        for (times, again) in work.times.iter_mut().zip(&all[1].times) {
            *times = [0, 1].map(|k| times[k].min(again[k]));
        }
        Ok(Self {
            case: case.to_owned(),
            boxes: 0,
            margin,
            has_step,
            work,
            passes: all.map(MarginWork::means),
        })
    }
}

/// Makes the case anew for each pass, and runs all margins in turn.
fn rows<C: MarginCase>(
    case: &str,
    steps: usize,
    (boxes, has_step): (usize, bool),
    make: impl Fn() -> Result<C, Failure>,
) -> Result<Vec<MarginRow>, Failure> {
    let mut all: [Vec<MarginWork>; PASSES] =
        std::array::from_fn(|_| vec![MarginWork::default(); MARGINS.len()]);
    for pass in &mut all {
        let mut case = make()?;
        for round in 0..WARM_UP + steps {
            let is_compared = round >= WARM_UP && (round + 1).is_multiple_of(COMPARED);
            case.prepare(round, is_compared)?;
            for margin in (0..MARGINS.len()).map(|place| (round + place) % MARGINS.len()) {
                let done = case.step(margin, is_compared)?;
                if round >= WARM_UP {
                    pass[margin].add(done);
                }
            }
        }
    }
    let row =
        |k: usize| Ok(MarginRow { boxes, ..MarginRow::new(case, k, [&all[0][k], &all[1][k]], has_step)? });
    (0..MARGINS.len()).map(row).collect()
}

fn table(rows: &[MarginRow]) -> Table {
    let columns = "case | boxes | margin | changed_percent | broad_phase_ms | step_ms | pairs | extra_percent | missed | \
        compared_steps";
    let mut table = Table::new("margins", columns);
    for MarginRow { case, boxes, margin, has_step, work, .. } in rows {
        let ([broad_phase, step], [listed, changed]) = (work.means(), work.counts);
        let head = cells![case.as_str(), *boxes, *margin, percent(changed, listed), broad_phase];
        let Reported { needed, missed, .. } = work.reported;
        let (step, pairs, extra) =
            (has_step.then_some(step), needed / work.compared.max(1), work.extra_percent());
        table.row(cells![..head, step, pairs, extra, missed, work.compared]);
    }
    table
}

/// Returns a margin's time over the default's: the geometric mean over cases and passes, and two standard errors of it in
/// percent. Within one pass both margins met the same disturbances.
fn against_default(rows: &[MarginRow], margin: usize, time: usize) -> [f64; 2] {
    let cases = rows.chunks(MARGINS.len()).filter(|case| time == 0 || case[0].has_step);
    let cases: Vec<[f64; PASSES]> = cases
        .map(|case| {
            let [one, default] = [margin, DEFAULT].map(|k| case[k].passes);
            std::array::from_fn(|pass| (one[pass][time] / default[pass][time]).ln())
        })
        .collect();
    let means: Vec<f64> = cases.iter().map(|passes| mean(passes)).collect();
    // Variances of independent cases add up; or cases differ by more than passes do.
    let of_passes: Vec<f64> = cases.iter().map(|passes| variance_of_mean(passes)).collect();
    let variance = (mean(&of_passes) / cases.len().max(1) as f64).max(variance_of_mean(&means));
    [mean(&means).exp(), ((2.0 * variance.sqrt()).exp() - 1.0) * 100.0]
}

fn variance_of_mean(values: &[f64]) -> f64 {
    let (mean, count) = (mean(values), values.len() as f64);
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    squares / (count - 1.0).max(1.0) / count.max(1.0)
}

fn means(rows: &[MarginRow]) -> Table {
    let columns = "margin | broad_phase | broad_phase_noise_percent | whole_step | whole_step_noise_percent | \
        largest_extra_percent";
    let mut table = Table::new("means", columns);
    for (k, margin) in MARGINS.into_iter().enumerate() {
        let [[broad_phase, noise], [step, step_noise]] = [0, 1].map(|time| against_default(rows, k, time));
        let extra = rows.chunks(MARGINS.len()).map(|case| case[k].work.extra_percent());
        table.row(cells![margin, broad_phase, noise, step, step_noise, extra.fold(0.0, f64::max)]);
    }
    table
}

/// A scene, its bodies, the steps after which margins are compared, and the steps that count.
type Windows = (&'static str, usize, &'static [usize], usize);

/// In free fall the lowest bodies of a column reach the ground after about 30 steps, the highest after 145 (1000
/// bodies) or 220 (10,000). So each scene is looked at in motion, and most once more while it comes to rest.
const FULL: [Windows; 7] = [
    ("column", 1000, &[40, 320], 42),
    ("pile", 1000, &[10, 90], 42),
    ("ragdolls", 1000, &[40, 240], 42),
    ("mixed", 1000, &[60], 42),
    ("rain", 10_000, &[60], 12),
    ("column", 10_000, &[60, 240], 6),
    ("pile", 10_000, &[20], 6),
];

const QUICK: [Windows; 2] = [("column", 100, &[40], 12), ("pile", 100, &[10], 12)];

/// Runs scenes with the default margin from window to window, and compares margins there.
fn worlds(quick: bool) -> Result<Vec<MarginRow>, Failure> {
    let mut all = Vec::new();
    for &(scene, bodies, starts, steps) in if quick { &QUICK[..] } else { &FULL } {
        let mut run = Run::new(Scene::named(scene)?, bodies, 1, PbigBroadPhase::new());
        for &start in starts {
            while run.times.len() < start {
                run.step();
            }
            let case = format!("{scene} {bodies}, from step {start}");
            let saved = run.world.to_bytes();
            let about = (run.world.colliders.len(), true);
            all.extend(rows(&case, steps, about, || Worlds::restored(&case, &saved))?);
        }
    }
    Ok(all)
}

/// A world, run once with each margin.
struct Worlds(Vec<Run<PbigBroadPhase>>);

impl Worlds {
    fn restored(case: &str, saved: &[u8]) -> Result<Self, Failure> {
        let run = |&margin: &f64| {
            let world = World::from_bytes(saved);
            let world = world.map_err(|error| Failure::Input(format!("{case}: its snapshot: {error}")))?;
            let config = PbigConfig { margin: margin as f32, ..PbigConfig::DEFAULT };
            let mut broad_phase = PbigBroadPhase::with_config(config).expect("a length");
            broad_phase.adopt(&world.narrow_phase);
            Ok(Run::in_world(world, broad_phase))
        };
        MARGINS.iter().map(run).collect::<Result<_, _>>().map(Self)
    }
}

impl MarginCase for Worlds {
    fn step(&mut self, margin: usize, is_compared: bool) -> Result<Round, Failure> {
        let run = &mut self.0[margin];
        run.step();
        let (time, stats) = (run.times.last().copied().unwrap_or_default(), run.broad_phase.inner.stats());
        let counts = [stats.modified as u64, stats.report.changed];
        Ok(([time.broad_phase, time.step], counts, is_compared.then(|| Reported::of(&run.world))))
    }
}

/// Makes boxes move.
type Start = fn(Vec<Aabb>) -> Wander;

/// The motions: the largest distance along each axis, in edges. As fast as things that fall, or as little as a thing that
/// leans on something.
const MOTIONS: [(&str, Start); 2] = [
    ("drifting", |boxes| Wander::drifting(boxes, 0.02)),
    ("trembling", |boxes| Wander::new(boxes, 1.0, 0.004)),
];

/// Compares margins of boxes in motion.
fn boxes(quick: bool) -> Result<Vec<MarginRow>, Failure> {
    let sizes: &[(usize, usize)] = if quick { &[(1000, 22)] } else { &[(10_000, 62), (100_000, 32)] };
    let mut all = Vec::new();
    for (motion, start) in MOTIONS {
        for &(n, rounds) in sizes {
            let set = BoxSet::named("unit").expect("a set of the harness").boxes(n, 1);
            let make = || Boxes::new(start(set.clone()));
            all.extend(rows(&format!("{motion} {n}"), rounds, (n, false), make)?);
        }
    }
    Ok(all)
}

/// Boxes, with a broad phase for each margin.
struct Boxes {
    wander: Wander,
    finders: Vec<BroadPhase>,
    /// The pairs of the last compared round.
    needed: Vec<Pair>,
}

impl Boxes {
    fn new(wander: Wander) -> Result<Self, Failure> {
        let finder =
            |&margin: &f64| BroadPhase::new(pbig_core::Config { margin: margin as f32, ..UNLIMITED });
        let finders = MARGINS.iter().map(finder).collect::<Result<_, _>>()?;
        Ok(Self { wander, finders, needed: vec![] })
    }
}

/// Sets all boxes, as an app does that does not know which have moved far.
fn update(finder: &mut BroadPhase, boxes: &[Aabb]) -> Result<(), Error> {
    for (id, aabb) in boxes.iter().enumerate() {
        finder.set(id as u32, *aabb, ProxyFilter::ALL)?;
    }
    finder.update().map(|_| ())
}

impl MarginCase for Boxes {
    fn prepare(&mut self, round: usize, is_compared: bool) -> Result<(), Failure> {
        self.wander.step(round);
        if is_compared {
            // From nothing, by another search: brute force takes two seconds for 100,000 boxes.
            self.needed = Finder::new(UNLIMITED).find(&self.wander.boxes)?.to_vec();
        }
        Ok(())
    }

    fn step(&mut self, margin: usize, is_compared: bool) -> Result<Round, Failure> {
        let finder = &mut self.finders[margin];
        let (done, ms) = timed(|| update(finder, &self.wander.boxes));
        done?;
        let reported = is_compared.then(|| Reported::compare(finder.pairs().collect(), &self.needed));
        let counts = [self.wander.boxes.len() as u64, finder.report().changed];
        Ok(([ms, ms], counts, reported))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a row whose margin takes so long; between its two passes all but the default differ by 2%.
    fn row(margin: usize, ms: f64) -> MarginRow {
        let off = if margin == DEFAULT { 0.0 } else { 0.01f64 };
        let work = |off: f64| MarginWork { times: vec![[ms * off.exp(), 0.0]], ..MarginWork::default() };
        MarginRow::new("a case", margin, [&work(-off), &work(off)], false).expect("no pair is missing")
    }

    #[test]
    fn cases_count_alike_and_a_mean_has_less_noise_than_a_case() {
        assert_eq!(MARGINS[DEFAULT] as f32, PbigConfig::DEFAULT.margin);
        let case =
            |ms: f64, fifth: f64| (0..MARGINS.len()).map(move |k| row(k, if k == 4 { fifth } else { ms }));
        let rows: Vec<MarginRow> = case(1.0, 0.4).chain(case(100.0, 100.0 / 6.4)).collect();
        assert!((against_default(&rows, 4, 0)[0] - 0.25).abs() < 1e-12);
        // Two passes 2% apart: an error of 1% for their mean, of a quarter of that for the mean of 16 cases.
        for (cases, noise) in [(1, 2.02), (16, 0.501)] {
            let rows: Vec<MarginRow> = (0..cases).flat_map(|_| case(1.0, 1.0)).collect();
            let found = against_default(&rows, 4, 0)[1];
            assert!((found - noise).abs() < 5e-3, "{cases} cases: {found}");
        }
    }

    #[test]
    fn a_missing_pair_is_a_failed_check() {
        let missing =
            MarginWork { reported: Reported { missed: 3, needed: 9, extra: 0 }, ..MarginWork::default() };
        let failed = MarginRow::new("a case", 0, [&missing; PASSES], false).map(|_| ());
        assert!(failed.is_err_and(|failure| failure.to_string().contains("3 of 9 pairs")));
    }

    #[test]
    fn worlds_go_on_from_where_the_scene_was() {
        let mut run = Run::new(Scene::named("column").expect("a scene"), 30, 1, PbigBroadPhase::new());
        (0..20).for_each(|_| run.step());
        let Worlds(runs) = Worlds::restored("some", &run.world.to_bytes()).expect("a snapshot");
        assert_eq!(runs.len(), MARGINS.len());
        assert!(runs.iter().all(|side| side.world.pose_bits() == run.world.pose_bits()));
        let wrong = Worlds::restored("some", b"no world").map(|_| ());
        assert!(wrong.is_err_and(|failure| failure.to_string().contains("some: its snapshot")));
    }
}
