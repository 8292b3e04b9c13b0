//! A world at a place: in f64, as rapier holds it, and its boxes in f32 by every way. And worlds that move: simulated by
//! rapier3d-f64, whose poses are the truth in each step, and by rapier in f32 beside it, with our broad phase and, as controls, with
//! rapier's and with the orders of either in the other. What is promised of boxes must hold there, too; sums over worlds are without
//! these, which are hundreds of frames of one.

use super::super::{mean, percent};
use crate::UNLIMITED;
use crate::reordered::KINDS;
use crate::wide::{
    Differences, Layout, Pose, Truth, WideWorld, doubt, moved, to_f32, to_f64, widened_by_ulps,
};
use pbig_core::{Aabb, Finder, Pair};
use pbig_harness::prelude::*;
use pbig_harness::scenes::Scene;
use pbig_harness::world::World;
use rapier_pbig::{PbigConfig, collision_aabb};
use rapier3d::prelude::{BroadPhase, Collider, IntegrationParameters, RigidBodySet};

/// A way to make boxes in f32: its name, the ulps by which rapier's boxes are widened, and true with the drop-in's margin.
/// Without ulps: boxes in f64 at poses in f64, rounded outward.
pub(super) type Widening = (&'static str, Option<u32>, bool);

/// The ways in the order of tables. The first six are timed: a margin on top of a way takes no time.
pub(super) const WAYS: [Widening; 8] = [
    ("rapier's boxes", Some(0), false),
    ("widened by 1 ulp", Some(1), false),
    ("widened by 2 ulps", Some(2), false),
    ("widened by 3 ulps", Some(3), false),
    ("widened by 4 ulps", Some(4), false),
    ("f64, rounded outward", None, false),
    ("rapier's boxes, with the margin", Some(0), true),
    ("widened by 2 ulps, with the margin", Some(2), true),
];

/// Places in [`WAYS`].
pub(super) const RAPIERS: usize = 0;
/// Misses nothing at the poses that rapier holds.
pub(super) const AT_POSES: usize = 2;
/// Misses nothing of the world, whose poses are in f64.
pub(super) const IN_WORLD: usize = 3;
pub(super) const OUTWARD: usize = 5;
pub(super) const MARGIN: usize = 6;

/// A world near the origin.
pub(super) struct NamedLayout {
    pub(super) name: &'static str,
    /// About how large its shapes are.
    pub(super) size: f64,
    pub(super) layout: Layout,
}

/// Returns the worlds; `count` shapes in each, or a fifth if all lie in one place far away.
pub(super) fn worlds(count: usize) -> Result<Vec<NamedLayout>, Failure> {
    let crowd = |name, size: f64, count| NamedLayout { name, size, layout: Layout::crowd(count, size, 1) };
    let scene = |name| -> Result<NamedLayout, Failure> {
        let built = Scene::named(name)?.build(count, 1);
        Ok(NamedLayout { name, size: 1.0, layout: Layout::of_world(&built) })
    };
    let crowds = [
        crowd("crowd", 1.0, count),
        crowd("crowd, a tenth as large", 0.1, count / 5),
        crowd("crowd, ten times as large", 10.0, count / 5),
    ];
    let scenes = [scene("column")?, scene("ragdolls")?, scene("pile")?];
    Ok(crowds.into_iter().chain(scenes).collect())
}

/// A world that has been moved.
pub(super) struct PlacedWorld<'a> {
    layout: &'a Layout,
    poses: Vec<Pose>,
    colliders: Vec<Collider>,
    params: IntegrationParameters,
    /// Boxes in f64 at poses in f64.
    pub(super) world: Truth,
    /// Boxes in f64 at the poses that rapier holds in f32.
    held: Truth,
}

impl<'a> PlacedWorld<'a> {
    /// Places shapes at poses.
    pub(super) fn new(layout: &'a Layout, poses: Vec<Pose>) -> Self {
        let params = IntegrationParameters::default();
        let narrow: Vec<_> = poses.iter().map(to_f32).collect();
        let held: Vec<_> = narrow.iter().map(to_f64).collect();
        let truth = |poses: &[Pose]| {
            let farthest = poses.iter().map(|pose| pose.translation.vector.amax()).fold(0.0, f64::max);
            let boxes = layout.boxes(poses, f64::from(params.prediction_distance() / 2.0));
            Truth::of(boxes, doubt(farthest))
        };
        let (world, held) = (truth(&poses), truth(&held));
        Self { layout, colliders: layout.colliders(&narrow), poses, params, world, held }
    }

    /// Returns twice what boxes reach beyond shapes: boxes that overlap by more are of shapes whose own do.
    pub(super) fn reach(&self) -> f64 {
        f64::from(self.params.prediction_distance())
    }

    pub(super) fn len(&self) -> usize {
        self.colliders.len()
    }

    pub(super) fn boxes(&self, (_, ulps, has_margin): Widening) -> Vec<Aabb> {
        let Some(ulps) = ulps else {
            let boxes = self.layout.boxes(&self.poses, self.reach() / 2.0);
            return boxes.iter().map(|wide| Aabb::from_f64(wide.min, wide.max)).collect();
        };
        let boxes = rapiers(&self.params, self.colliders.iter(), ulps);
        let widened = |aabb: &Aabb| aabb.inflated(PbigConfig::DEFAULT.margin);
        if has_margin { boxes.iter().map(widened).collect() } else { boxes }
    }

    /// Compares the pairs of boxes in f32 with those in f64: at the poses that rapier holds, and in the world.
    fn differences(&self, way: Widening) -> Result<[Differences; 2], Failure> {
        let mut finder = finder();
        let found = finder.find(&self.boxes(way))?;
        Ok([&self.held, &self.world].map(|truth| truth.differences(found, self.reach())))
    }
}

/// Returns the boxes of colliders without bodies, or of bodies without soft CCD, widened by some ulps.
pub(super) fn rapiers<'c>(
    params: &IntegrationParameters,
    colliders: impl Iterator<Item = &'c Collider>,
    ulps: u32,
) -> Vec<Aabb> {
    let none = RigidBodySet::new();
    let stock = |collider: &Collider| collision_aabb(params, &none, collider);
    if ulps == 0 {
        return colliders.map(stock).collect();
    }
    colliders.map(|one| widened_by_ulps(&stock(one), one.position(), ulps)).collect()
}

pub(super) fn finder() -> Finder {
    Finder::new(UNLIMITED)
}

/// The results of a world at a distance.
pub(super) struct PlaceRow {
    pub(super) world: &'static str,
    pub(super) size: f64,
    pub(super) offset: f64,
    /// The direction in which the world is moved.
    pub(super) along: &'static str,
    /// Pairs in f64, and at the poses in f32.
    pub(super) pairs: u64,
    pub(super) held_pairs: u64,
    /// Boxes in f64 at the poses in f32, against the world.
    pub(super) poses: Differences,
    /// By way: against boxes in f64 at the same poses, and against the world.
    pub(super) ways: [[Differences; 2]; WAYS.len()],
}

impl PlaceRow {
    pub(super) fn new((world, size): (&'static str, f64), (offset, along): (f64, &'static str)) -> Self {
        let (poses, ways) = Default::default();
        Self { world, size, offset, along, pairs: 0, held_pairs: 0, poses, ways }
    }

    /// Adds the world as it is at a time.
    pub(super) fn add(&mut self, place: &PlacedWorld<'_>) -> Result<(), Failure> {
        let held: Vec<Pair> = place.held.pairs.iter().map(|(pair, _)| *pair).collect();
        self.pairs += place.world.pairs.len() as u64;
        self.held_pairs += held.len() as u64;
        self.poses += place.world.differences(&held, place.reach());
        for (sums, way) in self.ways.iter_mut().zip(WAYS) {
            sums.iter_mut().zip(place.differences(way)?).for_each(|(sum, one)| *sum += one);
        }
        Ok(())
    }
}

/// A scene, its name in tables, its bodies, and steps: bodies fall and come to lie; and lie from the first.
type Scenery = (&'static str, &'static str, usize, usize);

const SCENES: [Scenery; 2] =
    [("column", "column, simulated in f64", 1000, 180), ("pile", "pile, simulated in f64", 1000, 120)];

/// Returns what boxes in f32 make of the worlds in f64, summed over all steps; and both tables.
pub(super) fn simulated(offsets: &[f64], quick: bool) -> Result<(Vec<PlaceRow>, [Table; 2]), Failure> {
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
fn run(
    (scene, name, bodies, steps): Scenery,
    offset: f64,
    tables: &mut [Table; 2],
) -> Result<PlaceRow, Failure> {
    let world = Scene::named(scene)?.build(bodies, 1);
    let layout = Layout::of_world(&world);
    let mut wide = WideWorld::of(&world, [offset; 3])?;
    let narrow =
        KINDS.map(|(_, make)| Ok(Narrow::new(Scene::named(scene)?.build(bodies, 1), offset, make())));
    let mut narrow = narrow.into_iter().collect::<Result<Vec<_>, Failure>>()?;
    let mut row = PlaceRow::new((name, 1.0), (offset, "diagonal"));
    for _ in 0..steps {
        wide.step();
        let place = PlacedWorld::new(&layout, wide.poses());
        row.add(&place)?;
        narrow.iter_mut().try_for_each(|one| one.step(&place))?;
    }
    let ends = wide.poses();
    let is_there = ends.iter().all(|pose| pose.translation.vector.norm().is_finite());
    check(is_there, || format!("{name}, {offset} away: a body is nowhere in f64"))?;
    let [boxes, whole] = row.ways[RAPIERS];
    let head = cells![name, offset, steps, row.pairs, boxes.missed, boxes.missed_deep];
    tables[0].row(cells![..head, whole.missed, whole.added, row.ways[IN_WORLD][1].missed]);
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
    fn step(&mut self, truth: &PlacedWorld) -> Result<(), Failure> {
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
        (mean(&there), all.len() - there.len())
    }
}
