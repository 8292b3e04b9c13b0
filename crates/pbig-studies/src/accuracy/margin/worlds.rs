//! Margins in rapier worlds: from one state of a scene on, a world for each.

use super::tally::{MARGINS, Passes, Tallied, Tally, passes};
use super::{Row, rows};
use crate::reported::Reported;
use pbig_harness::bench::Contest;
use pbig_harness::output::Failure;
use pbig_harness::runner::{Run, StepTime, Timed};
use pbig_harness::scenes::Scene;
use pbig_harness::world::World;
use rapier_pbig::{PbigBroadPhase, PbigConfig, collision_aabb};

/// A scene, and when it is looked at.
struct Windows {
    scene: &'static str,
    bodies: usize,
    /// Steps after which margins are compared, ascending.
    starts: &'static [usize],
    /// Steps that count.
    steps: usize,
}

const fn windows(scene: &'static str, bodies: usize, starts: &'static [usize], steps: usize) -> Windows {
    Windows { scene, bodies, starts, steps }
}

/// In free fall the lowest bodies of a column reach the ground after about 30 steps, the highest after 145 (1000
/// bodies) or 220 (10,000). So each scene is looked at in motion, and most once more while it comes to rest.
const FULL: [Windows; 7] = [
    windows("column", 1000, &[40, 320], 42),
    windows("pile", 1000, &[10, 90], 42),
    windows("ragdolls", 1000, &[40, 240], 42),
    windows("mixed", 1000, &[60], 42),
    windows("rain", 10_000, &[60], 12),
    windows("column", 10_000, &[60, 240], 6),
    windows("pile", 10_000, &[20], 6),
];

const QUICK: [Windows; 2] = [windows("column", 100, &[40], 12), windows("pile", 100, &[10], 12)];

/// All rows, those of a window together.
pub(super) fn measured(quick: bool) -> Result<Vec<Row>, Failure> {
    let cases: &[Windows] = if quick { &QUICK } else { &FULL };
    let mut rows = Vec::new();
    for case in cases {
        rows.extend(scene(case)?);
    }
    Ok(rows)
}

/// A scene, run with the default margin from window to window.
fn scene(case: &Windows) -> Result<Vec<Row>, Failure> {
    let mut run = Run::new(Scene::named(case.scene)?, case.bodies, 1, PbigBroadPhase::new());
    let mut all = Vec::new();
    for &start in case.starts {
        while run.times.len() < start {
            run.step();
        }
        let name = format!("{} {}, from step {start}", case.scene, case.bodies);
        all.extend(window(&name, &run.world, case.steps)?);
    }
    Ok(all)
}

fn window(case: &str, world: &World, steps: usize) -> Result<Vec<Row>, Failure> {
    let saved = world.to_bytes();
    let passes: Passes = passes(steps, || Worlds::restored(case, &saved))?;
    rows(case, world.colliders.len(), median_edge(world), true, &passes)
}

/// The edge of a collider's box, over all colliders and axes: half are longer.
fn median_edge(world: &World) -> f32 {
    let aabb = |collider| collision_aabb(&world.params, &world.bodies, collider);
    let mut edges: Vec<f32> = world.colliders.iter().flat_map(|(_, one)| aabb(one).extents()).collect();
    edges.sort_unstable_by(f32::total_cmp);
    edges.get(edges.len() / 2).copied().unwrap_or_default()
}

/// The same world for each margin.
struct Worlds {
    runs: Vec<Run<PbigBroadPhase>>,
    tallies: Vec<Tally>,
}

impl Worlds {
    fn restored(case: &str, saved: &[u8]) -> Result<Self, Failure> {
        let run = |&margin: &f64| -> Result<_, Failure> {
            let world = World::from_bytes(saved);
            let world = world.map_err(|error| Failure::Input(format!("{case}: its snapshot: {error}")))?;
            let mut broad_phase =
                PbigBroadPhase::with_config(PbigConfig { margin: margin as f32, ..PbigConfig::DEFAULT })
                    .expect("a length");
            broad_phase.adopt(&world.narrow_phase);
            Ok(Run { world, broad_phase: Timed::new(broad_phase), times: vec![] })
        };
        let runs = MARGINS.iter().map(run).collect::<Result<_, _>>()?;
        Ok(Self { runs, tallies: vec![Tally::default(); MARGINS.len()] })
    }
}

impl Contest for Worlds {
    fn sides(&self) -> usize {
        MARGINS.len()
    }

    fn prepare(&mut self, _: usize) {}

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let run = &mut self.runs[side];
        run.step();
        let time = run.times.last().copied().unwrap_or_default();
        let stats = run.broad_phase.inner.stats();
        let counts = [stats.modified as u64, stats.report.changed];
        self.tallies[side].note(time, counts, || Reported::of(&run.world));
        let StepTime { step, .. } = time;
        Ok(step)
    }
}

impl Tallied for Worlds {
    fn tallies(self) -> Vec<Tally> {
        self.tallies
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worlds_go_on_from_where_the_scene_was() {
        let scene = Scene::named("column").expect("a scene");
        let mut run = Run::new(scene, 30, 1, PbigBroadPhase::new());
        (0..20).for_each(|_| run.step());
        let worlds = Worlds::restored("some", &run.world.to_bytes()).expect("a snapshot");
        assert_eq!(worlds.runs.len(), MARGINS.len());
        assert!(worlds.runs.iter().all(|side| side.world.pose_bits() == run.world.pose_bits()));
        let wrong = Worlds::restored("some", b"no world").map(|_| ());
        assert!(wrong.is_err_and(|failure| failure.to_string().contains("some: its snapshot")));
    }
}
