//! Boxes in motion: our updates beside a search from nothing and parry's tree, in turn in every frame.

use super::case::{Case, OURS, Side, Wanted};
use crate::bench::measure::timed;
use crate::bench::peers::trees::{Parry, Refit};
use crate::output::{Failure, progress};
use pbig_core::{Aabb, BroadPhase, Config, Error, Finder, Limits, Order, ProxyFilter};
use pbig_harness::motions::{Density, Motion, Scene};
use rayon::{ThreadPool, ThreadPoolBuilder};

const CONFIG: Config = Config { limits: Limits::UNLIMITED, ..Config::DEFAULT };

const FROM_NOTHING: &str = "search from nothing";
const PARRY: &str = "parry 0.31";

/// All sides; the second is ours on one thread.
const NAMES: [&str; 4] = [OURS, OURS, FROM_NOTHING, PARRY];

/// Motions in which all frames have as much work.
const EVEN: [Motion; 4] = [Motion::Drift, Motion::Jitter, Motion::Fall, Motion::Jump];

pub(super) fn run(sizes: &[usize], quick: bool) -> Result<Vec<Case>, Failure> {
    let bar = progress(sizes.len() * scenes().count(), "motions");
    let mut cases = vec![];
    for &n in sizes {
        for (motion, density) in scenes() {
            cases.push(measure(motion, density, n, frames(n, quick))?);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    Ok(cases)
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

fn measure(motion: Motion, density: Density, n: usize, frames: usize) -> Result<Case, Failure> {
    let name = format!("{}, {}, {n} boxes", motion.name(), density.name());
    let mut race = Race::new(Scene::new(motion, density, n, 1))?;
    race.frame(0, &name)?;
    for frame in 1..=frames {
        race.step();
        race.frame(frame, &name)?;
    }
    let threads = rayon::current_num_threads();
    let side =
        |(k, ms): (usize, Vec<f64>)| Side { what: NAMES[k], threads: if k == 1 { 1 } else { threads }, ms };
    let pairs = race.finder.pairs().len() as u64;
    let sides = race.ms.into_iter().enumerate().map(side).collect();
    Ok(Case {
        motion: motion.name(),
        density: density.name(),
        boxes: n,
        pairs,
        sides,
        wanted: wanted(motion, n),
    })
}

fn wanted(motion: Motion, n: usize) -> Wanted {
    let is_even = EVEN.contains(&motion);
    Wanted {
        faster: (motion == Motion::Drift && n >= 100_000).then_some((PARRY, 4.0)),
        within: (is_even && n >= 10_000).then_some((FROM_NOTHING, 1.6)),
        is_even,
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
        let empty = || BroadPhase::new(CONFIG).map_err(failure);
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
            done.map_err(failure)?;
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

fn failure(error: Error) -> Failure {
    Failure::Input(error.to_string())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_sides_have_the_same_pairs_in_every_frame_of_every_motion() {
        for (motion, density) in scenes() {
            let case = measure(motion, density, 300, 24).expect("all agree");
            assert!(case.pairs > 0 && case.sides.len() == NAMES.len(), "{motion:?}, {density:?}");
            assert!(case.sides.iter().all(|side| side.ms.len() == 25));
        }
    }
}
