//! Margins in rapier worlds, from one state of a scene on; and without rapier: boxes that drift or tremble.

use super::{Case, MARGINS, Round, Row, rows};
use crate::reported::Reported;
use pbig_core::{Aabb, BroadPhase, Config, Error, Finder, Limits, Pair, ProxyFilter};
use pbig_harness::prelude::*;
use pbig_harness::runner::{Run, Timed};
use pbig_harness::scenes::Scene;
use pbig_harness::world::World;
use rapier_pbig::{PbigBroadPhase, PbigConfig};

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
pub(super) fn worlds(quick: bool) -> Result<Vec<Row>, Failure> {
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
            Ok(Run { world, broad_phase: Timed::new(broad_phase), times: vec![] })
        };
        MARGINS.iter().map(run).collect::<Result<_, _>>().map(Self)
    }
}

impl Case for Worlds {
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
pub(super) fn boxes(quick: bool) -> Result<Vec<Row>, Failure> {
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

const CONFIG: Config = Config { limits: Limits::UNLIMITED, ..Config::DEFAULT };

/// Boxes, with a broad phase for each margin.
struct Boxes {
    wander: Wander,
    finders: Vec<BroadPhase>,
    /// The pairs of the last compared round.
    needed: Vec<Pair>,
}

impl Boxes {
    fn new(wander: Wander) -> Result<Self, Failure> {
        let finder = |&margin: &f64| BroadPhase::new(Config { margin: margin as f32, ..CONFIG });
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

impl Case for Boxes {
    fn prepare(&mut self, round: usize, is_compared: bool) -> Result<(), Failure> {
        self.wander.step(round);
        if is_compared {
            // From nothing, by another search: brute force takes two seconds for 100,000 boxes.
            self.needed = Finder::new(CONFIG).find(&self.wander.boxes)?.to_vec();
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
