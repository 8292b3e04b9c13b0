//! Worlds that move: simulated by rapier3d-f64, whose poses are the truth in each step, and by rapier in f32 beside it, with
//! our broad phase and, as controls, with rapier's and with the orders of either in the other. What is promised of boxes
//! must hold here, too; sums over worlds are without these, which are hundreds of frames of one.

use super::super::percent;
use super::place::{IN_WORLD, Place, RAPIERS, Row, finder, rapiers};
use crate::reordered::KINDS;
use crate::wide::{Differences, Layout, Pose, WideWorld, moved, to_f64};
use pbig_harness::prelude::*;
use pbig_harness::scenes::Scene;
use pbig_harness::world::World;
use rapier3d::prelude::{BroadPhase, Collider};

/// A scene, its name in tables, its bodies, and steps: bodies fall and come to lie; and lie from the first.
type Scenery = (&'static str, &'static str, usize, usize);

const SCENES: [Scenery; 2] =
    [("column", "column, simulated in f64", 1000, 180), ("pile", "pile, simulated in f64", 1000, 120)];

/// Returns what boxes in f32 make of the worlds in f64, summed over all steps; and both tables.
pub(super) fn simulated(offsets: &[f64], quick: bool) -> Result<(Vec<Row>, [Table; 2]), Failure> {
    let in_f64 = "world | offset | steps | pairs | missed_by_boxes_in_f32 | of_touching_shapes | missed | added | \
        missed_with_3_ulps";
    let in_f32 =
        "world | offset | broad_phase | missed_percent | added_percent | apart_at_the_end | lost_bodies";
    let mut tables = [Table::new("simulated", in_f64), Table::new("simulated_in_f32", in_f32)];
    let mut rows = vec![];
    for scene in if quick { &SCENES[..1] } else { &SCENES } {
        let (scene, name, bodies, steps) = if quick { (scene.0, scene.1, 100, 50) } else { *scene };
        for &offset in offsets {
            rows.push(run((scene, name, bodies, steps), offset, &mut tables)?);
        }
    }
    Ok((rows, tables))
}

/// Runs a scene along the diagonal, and appends its rows.
fn run((scene, name, bodies, steps): Scenery, offset: f64, tables: &mut [Table; 2]) -> Result<Row, Failure> {
    let world = Scene::named(scene)?.build(bodies, 1);
    let layout = Layout::of_world(&world);
    let mut wide = WideWorld::of(&world, [offset; 3])?;
    let narrow =
        KINDS.map(|(_, make)| Ok(Narrow::new(Scene::named(scene)?.build(bodies, 1), offset, make())));
    let mut narrow = narrow.into_iter().collect::<Result<Vec<_>, Failure>>()?;
    let mut row = Row::new((name, 1.0), (offset, "diagonal"));
    for _ in 0..steps {
        wide.step();
        let place = Place::new(&layout, wide.poses());
        row.add(&place)?;
        narrow.iter_mut().try_for_each(|one| one.step(&place))?;
    }
    let ends = wide.poses();
    let is_there = ends.iter().all(|pose| pose.translation.vector.norm().is_finite());
    check(is_there, || format!("{name}, {offset} away: a body is nowhere in f64"))?;
    let [boxes, whole] = row.ways[RAPIERS];
    let head = cells![name, offset, steps, row.pairs, boxes.missed, boxes.missed_deep];
    tables[0].row([head, cells![whole.missed, whole.added, row.ways[IN_WORLD][1].missed]].concat());
    for ((kind, _), narrow) in KINDS.iter().zip(narrow) {
        let [missed, added] = [narrow.sum.missed, narrow.sum.added].map(|count| percent(count, row.pairs));
        let (apart, lost) = narrow.apart(&ends);
        tables[1].row(cells![name, offset, *kind, missed, added, apart, lost]);
    }
    Ok(row)
}

/// The world as rapier simulates it in f32.
struct Narrow {
    world: World,
    broad_phase: Box<dyn BroadPhase>,
    /// Its pairs against those of the one in f64, summed over all steps.
    sum: Differences,
}

impl Narrow {
    fn new(world: World, offset: f64, broad_phase: Box<dyn BroadPhase>) -> Self {
        Self { world: moved(world, [offset; 3]), broad_phase, sum: Differences::default() }
    }

    /// Makes a step, and compares the pairs of rapier's boxes with the world in f64 after the same step.
    fn step(&mut self, truth: &Place) -> Result<(), Failure> {
        self.world.step(&mut *self.broad_phase);
        let boxes = rapiers(&self.world.params, self.colliders(), 0);
        self.sum += truth.world.differences(finder().find(&boxes)?, truth.reach());
        Ok(())
    }

    /// Returns all colliders but the ground.
    fn colliders(&self) -> impl Iterator<Item = &Collider> {
        let all = self.world.colliders.iter().map(|(_, one)| one);
        all.filter(|one| one.shape().as_halfspace().is_none())
    }

    /// Returns the mean distance between the places of a body in the two worlds, and the number of bodies that are nowhere.
    fn apart(&self, poses: &[Pose]) -> (f64, usize) {
        let apart = |(one, pose): (&Collider, &Pose)| {
            (to_f64(one.position()).translation.vector - pose.translation.vector).norm()
        };
        let all: Vec<f64> = self.colliders().zip(poses).map(apart).collect();
        let there: Vec<f64> = all.iter().copied().filter(|distance| distance.is_finite()).collect();
        (super::super::mean(&there), all.len() - there.len())
    }
}
