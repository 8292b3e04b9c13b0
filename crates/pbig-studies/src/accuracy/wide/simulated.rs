//! Worlds that move: simulated by rapier3d-f64, whose poses are the truth in each step, and by rapier in f32 beside it, with
//! our broad phase and, as controls, with rapier's and with the orders of either in the other. What is promised of boxes
//! must hold here, too; sums over worlds are without these, which are hundreds of frames of one.

use super::super::percent;
use super::place::{Along, IN_WORLD, Place, Row, Way, finder, rapiers};
use crate::sorted::{LowerFirst, Sorted};
use crate::wide::{Differences, Layout, Pose, WideWorld, moved, to_f64};
use pbig_core::Pair;
use pbig_harness::cells;
use pbig_harness::output::Failure;
use pbig_harness::scenes::Scene;
use pbig_harness::table::Table;
use pbig_harness::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::{BroadPhase, Collider, DefaultBroadPhase};

/// The moving things.
#[derive(Clone, Copy)]
struct Scenery {
    scene: &'static str,
    /// In tables.
    name: &'static str,
    bodies: usize,
    steps: usize,
}

/// Bodies fall and come to lie; and lie from the first.
const SCENES: [Scenery; 2] = [
    Scenery { scene: "column", name: "column, simulated in f64", bodies: 1000, steps: 180 },
    Scenery { scene: "pile", name: "pile, simulated in f64", bodies: 1000, steps: 120 },
];

/// Names a broad phase, and makes it.
type Kind = (&'static str, fn() -> Box<dyn BroadPhase>);

/// With which rapier simulates in f32. The second of each two differs from the first in order alone: which collider of a
/// pair is the first is as stock has it; and events are sorted as ours are.
const KINDS: [Kind; 4] = [
    ("pbig", || Box::new(PbigBroadPhase::new())),
    ("pbig lower first", || Box::new(LowerFirst(PbigBroadPhase::new()))),
    ("stock", || Box::new(DefaultBroadPhase::new())),
    ("stock sorted", || Box::new(Sorted(DefaultBroadPhase::new()))),
];

/// A simulation at a place.
pub(super) struct Simulated {
    /// All steps together: what boxes in f32 make of the world in f64, held in f32.
    pub(super) row: Row,
    steps: usize,
    /// The world in f32, in the order of [`KINDS`].
    own: [Own; KINDS.len()],
}

/// The state of a world that rapier simulates in f32.
#[derive(Clone, Copy, Debug, Default)]
struct Own {
    /// All steps together: its pairs against those of the one in f64.
    pairs: Differences,
    /// In the last step, between the places of a body in the two, on average.
    apart: f64,
    /// Colliders that are nowhere in the end.
    lost: usize,
}

/// Every scene at every offset, along the diagonal.
pub(super) fn simulated(offsets: &[f64], quick: bool) -> Result<Vec<Simulated>, Failure> {
    let scenes: &[Scenery] = if quick { &SCENES[..1] } else { &SCENES };
    let scenes =
        scenes.iter().map(|&one| if quick { Scenery { bodies: 100, steps: 50, ..one } } else { one });
    let all = scenes.flat_map(|scene| offsets.iter().map(move |&offset| (scene, offset)));
    all.map(|(scene, offset)| Simulated::run(scene, offset)).collect()
}

impl Simulated {
    fn run(Scenery { scene, name, bodies, steps }: Scenery, offset: f64) -> Result<Self, Failure> {
        let world = built((scene, bodies))?;
        let layout = Layout::of_world(&world);
        let mut wide = WideWorld::of(&world, [offset; 3]).map_err(Failure::Input)?;
        let narrow = KINDS.map(|(_, make)| Narrow::of((scene, bodies), offset, make()));
        let mut narrow = narrow.into_iter().collect::<Result<Vec<_>, _>>()?;
        let mut sum: Option<Row> = None;
        for _ in 0..steps {
            wide.step();
            let place = Place::at(&layout, wide.poses());
            let now = Row::of(name, 1.0, (offset, Along::Diagonal), &place)?;
            narrow.iter_mut().try_for_each(|one| one.step(&place))?;
            sum = Some(sum.map_or_else(|| now.clone(), |sum| sum.and(&now)));
        }
        let row = sum.ok_or_else(|| Failure::Input("no steps".into()))?;
        let ends = wide.poses();
        if ends.iter().any(|pose| !pose.translation.vector.norm().is_finite()) {
            return Err(Failure::Check(format!("{name}, {offset} away: a body is nowhere in f64")));
        }
        Ok(Self { row, steps, own: std::array::from_fn(|kind| narrow[kind].at_the_end(&ends)) })
    }
}

/// The world as rapier simulates it in f32.
struct Narrow {
    world: World,
    broad_phase: Box<dyn BroadPhase>,
    own: Own,
}

fn built((scene, bodies): (&str, usize)) -> Result<World, Failure> {
    Ok(Scene::named(scene).map_err(Failure::Input)?.build(bodies, 1))
}

impl Narrow {
    fn of(scene: (&str, usize), offset: f64, broad_phase: Box<dyn BroadPhase>) -> Result<Self, Failure> {
        Ok(Self { world: moved(built(scene)?, [offset; 3]), broad_phase, own: Own::default() })
    }

    /// One step, after which the world in f64 is so.
    fn step(&mut self, truth: &Place) -> Result<(), Failure> {
        self.world.step(&mut *self.broad_phase);
        self.own.pairs += truth.world.differences(&self.pairs()?, truth.reach());
        Ok(())
    }

    fn at_the_end(&self, truth: &[Pose]) -> Own {
        let distances = self.distances(truth);
        let there = || distances.iter().filter(|distance| distance.is_finite());
        let apart = there().sum::<f64>() / there().count().max(1) as f64;
        Own { apart, lost: distances.len() - there().count(), ..self.own }
    }

    /// All but the ground.
    fn colliders(&self) -> impl Iterator<Item = &Collider> {
        let all = self.world.colliders.iter().map(|(_, one)| one);
        all.filter(|one| one.shape().as_halfspace().is_none())
    }

    /// Of rapier's boxes, in order.
    fn pairs(&self) -> Result<Vec<Pair>, Failure> {
        let boxes = rapiers(&self.world.params, self.colliders(), 0);
        let found = finder().find(&boxes).map(<[_]>::to_vec);
        found.map_err(|error| Failure::Input(format!("simulated in f32: {error}")))
    }

    fn distances(&self, poses: &[Pose]) -> Vec<f64> {
        let apart = |(one, pose): (&Collider, &Pose)| {
            (to_f64(one.position()).translation.vector - pose.translation.vector).norm()
        };
        self.colliders().zip(poses).map(apart).collect()
    }
}

/// Returns the table of the worlds in f64, whose poses are held in f32, and that of the worlds in f32; all steps together.
pub(super) fn tables(all: &[Simulated]) -> [Table; 2] {
    let columns = [
        "world",
        "offset",
        "steps",
        "pairs",
        "missed_by_boxes_in_f32",
        "of_touching_shapes",
        "missed",
        "added",
        "missed_with_3_ulps",
    ];
    let mut in_f64 = Table::new("simulated", columns);
    let columns = [
        "world",
        "offset",
        "broad_phase",
        "missed_percent",
        "added_percent",
        "apart_at_the_end",
        "lost_bodies",
    ];
    let mut in_f32 = Table::new("simulated_in_f32", columns);
    for Simulated { row, steps, own } in all {
        let (boxes, whole) = (row.by_boxes(Way::Ulps(0)), row.in_all(Way::Ulps(0)));
        let head = cells![row.world, row.offset, *steps, row.pairs, boxes.missed, boxes.missed_deep];
        let rest = cells![whole.missed, whole.added, row.in_all(IN_WORLD).missed];
        in_f64.row([head, rest].concat());
        for ((name, _), Own { pairs, apart, lost }) in KINDS.iter().zip(own) {
            let [missed, added] = [pairs.missed, pairs.added].map(|count| percent(count, row.pairs));
            in_f32.row(cells![row.world, row.offset, *name, missed, added, *apart, *lost]);
        }
    }
    [in_f64, in_f32]
}
