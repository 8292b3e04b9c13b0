//! How long updates take, and how evenly. Boxes in motion: our updates beside a search from nothing and parry's tree, in turn in
//! every frame; pairs agree in number in every frame. Scenes through rapier: ours beside stock in the same world.

use crate::trees::{Parry, Refit};
use pbig_core::{Aabb, BroadPhase, Config, Error, Finder, Limits, Order, ProxyFilter};
use pbig_harness::bench::{Effort, Figures, timed};
use pbig_harness::cells;
use pbig_harness::chart::{Chart, Panel, Plot, Series};
use pbig_harness::duel::Duel;
use pbig_harness::motions::{Density, Motion, Scene};
use pbig_harness::output::{Failure, progress};
use pbig_harness::report::Report;
use pbig_harness::scenes;
use pbig_harness::table::Table;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::time::Duration;

const CONFIG: Config = Config { limits: Limits::UNLIMITED, ..Config::DEFAULT };

/// All sides; the second is ours on one thread.
const NAMES: [&str; 4] = ["ours", "ours", "search from nothing", "parry 0.31"];
/// Columns of the table; all but the first frame's time leave out the first frame, in which everything is new.
const COLUMNS: [&str; 10] = [
    "motion",
    "density",
    "boxes",
    "threads",
    "side",
    "mean_ms",
    "median_ms",
    "p99_ms",
    "worst_ms",
    "first_ms",
];

/// Measures every motion and every scene; `given`: numbers of boxes, and of bodies, instead of its own.
///
/// # Errors
/// A failed check, if the sides have different numbers of pairs.
pub fn run(quick: bool, given: &[usize]) -> Result<Report, Failure> {
    let sizes = |full: &[usize], few: &[usize]| match given {
        [] => if quick { few } else { full }.to_vec(),
        given => given.to_vec(),
    };
    let boxes = sizes(&[1000, 10_000, 100_000, 1_000_000], &[1000, 10_000]);
    let bodies = sizes(&[10, 100, 1000, 10_000, 100_000], &[10, 100]);
    let mut table = Table::new("steady", COLUMNS);
    let plots = motions(&boxes, quick, &mut table)?;
    through_rapier(&bodies, quick, &mut table);
    let chart = Chart { name: "steady-frames".into(), plots };
    let charts = if chart.plots.is_empty() { vec![] } else { vec![chart] };
    Ok(Report { charts, ..Report::new("steady", vec![table]) })
}

/// The motions whose frames are drawn, of the largest of the sizes up to [`MOST_DRAWN`].
const DRAWN: [Motion; 4] = [Motion::Drift, Motion::Fall, Motion::Burst, Motion::Shares];

const MOST_DRAWN: usize = 100_000;

/// Returns a plot of each drawn motion.
fn motions(sizes: &[usize], quick: bool, table: &mut Table) -> Result<Vec<Plot>, Failure> {
    let largest = sizes.iter().copied().filter(|n| *n <= MOST_DRAWN).max();
    let mut plots = vec![];
    let bar = progress(sizes.len() * scenes().count(), "motions");
    for (&n, (motion, density)) in sizes.iter().flat_map(|n| scenes().map(move |scene| (n, scene))) {
        let name = format!("{}, {}, {n} boxes", motion.name(), density.name());
        let mut race = Race::new(Scene::new(motion, density, n, 1))?;
        race.frame(0, &name)?;
        for frame in 1..=frames(n, quick) {
            race.step();
            race.frame(frame, &name)?;
        }
        for (k, ms) in race.ms.iter().enumerate() {
            let threads = if k == 1 { 1 } else { rayon::current_num_threads() };
            row([motion.name(), density.name(), NAMES[k]], [n, threads], ms, table);
        }
        if Some(n) == largest && density == Density::Dense && DRAWN.contains(&motion) {
            plots.push(plot(&name, &race.ms));
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(plots)
}

/// The first frame is left out: it is longer than all others and would flatten their lines.
fn plot(title: &str, ms: &[Vec<f64>]) -> Plot {
    let names = ["pbig", "pbig, one thread", NAMES[2], NAMES[3]];
    let series = names.into_iter().zip(ms).map(|(name, ms)| Series { name, values: ms[1..].to_vec() });
    Plot::of(&Panel { title, series: series.collect() })
}

fn row([motion, density, side]: [&str; 3], [boxes, threads]: [usize; 2], ms: &[f64], table: &mut Table) {
    let Figures { mean, median, p99, worst, first } = Figures::of(ms);
    table.row(cells![motion, density, boxes, threads, side, mean, median, p99, worst, first]);
}

fn through_rapier(sizes: &[usize], quick: bool, table: &mut Table) {
    let (rounds, ms) = if quick { (40, 50) } else { (300, 10_000) };
    let effort = Effort { warm_up: 0, rounds, budget: Duration::from_millis(ms) };
    let bar = progress(scenes::Scene::ALL.len() * sizes.len(), "scenes");
    for (&bodies, scene) in sizes.iter().flat_map(|bodies| scenes::Scene::ALL.map(|scene| (bodies, scene))) {
        let duel = Duel::run(scene, bodies, effort);
        for (k, side) in ["ours", "stock"].into_iter().enumerate() {
            let ms: Vec<f64> = duel.times.iter().map(|ms| ms[k]).collect();
            row([scene.name, "scene", side], [bodies, rayon::current_num_threads()], &ms, table);
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
}

/// Every motion, dense and sparse; of mixed sizes one that moves all and one that moves few.
fn scenes() -> impl Iterator<Item = (Motion, Density)> {
    let equal = [Density::Dense, Density::Sparse].into_iter();
    let equal = equal.flat_map(|density| Motion::ALL.map(|motion| (motion, density)));
    equal.chain([Motion::Drift, Motion::Few].map(|motion| (motion, Density::Mixed)))
}

/// Frames after the first: enough for a p99 where they are short, and for two bursts at least.
fn frames(n: usize, quick: bool) -> usize {
    match n {
        _ if quick => 24,
        0..=10_000 => 300,
        10_001..=100_000 => 120,
        _ => 60,
    }
}
/// All sides on the same boxes.
struct Race {
    scene: Scene,
    /// Changed boxes that are present, and absent.
    changed: [Vec<u32>; 2],
    ours: BroadPhase,
    /// Ours again, on one thread.
    lone: BroadPhase,
    pool: ThreadPool,
    finder: Finder,
    /// Made in the first frame.
    parry: Option<Parry>,
    /// By side, then by frame.
    ms: Vec<Vec<f64>>,
}

impl Race {
    fn new(scene: Scene) -> Result<Self, Failure> {
        let empty = || BroadPhase::new(CONFIG);
        let pool = ThreadPoolBuilder::new().num_threads(1).build();
        let all: Vec<u32> = (0..scene.boxes().len() as u32).collect();
        Ok(Self {
            changed: split(&all, scene.boxes()),
            scene,
            ours: empty()?,
            lone: empty()?,
            pool: pool.map_err(|error| Failure::Input(error.to_string()))?,
            finder: Finder::new(Config { order: Order::Unspecified, ..CONFIG }),
            parry: None,
            ms: vec![vec![]; NAMES.len()],
        })
    }

    /// Makes the next frame of boxes; not measured.
    fn step(&mut self) {
        let changed = self.scene.step().to_vec();
        self.changed = split(&changed, self.scene.boxes());
        if let Some(parry) = &mut self.parry {
            parry.prepare(self.scene.boxes(), &changed);
        }
    }

    /// Measures every side once. Each warms the caches for the next one, so the first one changes from frame to frame, and
    /// every second frame runs the other way round.
    fn frame(&mut self, frame: usize, name: &str) -> Result<(), Failure> {
        for place in 0..NAMES.len() {
            let place = if frame.is_multiple_of(2) { place } else { NAMES.len() - 1 - place };
            let side = (frame / 2 + place) % NAMES.len();
            let (done, ms) = self.run(side);
            done?;
            self.ms[side].push(ms);
        }
        let counts =
            [self.ours.pair_count(), self.lone.pair_count(), self.parry.as_ref().map_or(0, Parry::pairs)];
        let pairs = self.finder.pairs().len();
        if counts == [pairs; 3] {
            return Ok(());
        }
        Err(Failure::Check(format!("{name}, frame {frame}: {pairs} pairs, the others have {counts:?}")))
    }

    /// Does one side's work; returns its milliseconds.
    fn run(&mut self, side: usize) -> (Result<(), Error>, f64) {
        let Self { scene, changed, ours, lone, pool, finder, parry, .. } = self;
        let boxes = scene.boxes();
        match side {
            0 => timed(|| update(ours, boxes, changed)),
            // The clock runs inside, as waking the thread takes longer than a small update.
            1 => pool.install(|| timed(|| update(lone, boxes, changed))),
            2 => timed(|| finder.find(boxes).map(|_| ())),
            _ => timed(|| {
                parry.get_or_insert_with(|| Parry::new(boxes, Refit::Parallel, false)).frame();
                Ok(())
            }),
        }
    }
}
fn split(changed: &[u32], boxes: &[Aabb]) -> [Vec<u32>; 2] {
    let (present, absent) = changed.iter().partition(|id| boxes[**id as usize].is_valid());
    [present, absent]
}

fn update(broad_phase: &mut BroadPhase, boxes: &[Aabb], changed: &[Vec<u32>; 2]) -> Result<(), Error> {
    let [present, absent] = changed;
    for &id in absent {
        broad_phase.remove(id);
    }
    broad_phase.set_many(present, |id| Some((boxes[id as usize], ProxyFilter::ALL)))?;
    broad_phase.update().map(|_| ())
}
