//! f32 against f64: the same worlds from the origin to 10^7 from it, and the pairs that boxes in f32 miss or add.
//!
//! Two things are rounded. Poses: rapier holds another world than the one that was meant, and no broad phase can
//! tell. And boxes, which are computed in f32 from these poses: that is what a broad phase answers for. So there are
//! two truths, in f64 both, and what differs is counted against each.

use super::{percent, report};
use crate::UNLIMITED;
use crate::wide::{Differences, Layout, Pose, Truth, doubt, to_f32, to_f64};
use pbig_core::{Aabb, Finder};
use pbig_harness::prelude::*;
use pbig_harness::scenes::Scene;
use rapier_pbig::{PbigConfig, collision_aabb};
use rapier3d::prelude::{Collider, IntegrationParameters, RigidBodySet};
use std::time::Duration;

const OFFSETS: [f64; 7] = [0.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7];

/// Ways to make boxes in f32.
const WAYS: [&str; 3] = ["rapier's boxes", "f64, rounded outward", "rapier's boxes, with the margin"];
/// Places in [`WAYS`].
const OUTWARD: usize = 1;
const MARGIN: usize = 2;

/// The ways that are timed: a margin takes no time.
const TIMED: usize = 2;

pub(super) fn run(quick: bool) -> Result<BenchReport, Failure> {
    let worlds = worlds(if quick { 500 } else { 12_000 })?;
    let rows = rows(&worlds)?;
    rows.iter().try_for_each(promised)?;
    let times = times(&worlds[0].layout, quick)?;
    let axes = ["time, ns per box, computed and searched for", "pairs missed and added, % of those in f64"];
    let points = points(&rows, &times);
    let title = "f32 far from the origin: a crowd along the diagonal";
    Ok(report("wide", vec![ways_table(&rows), times], (title, axes), points))
}

/// A world near the origin.
struct NamedLayout {
    name: &'static str,
    /// True if the world is also moved along one axis.
    is_moved_along_x: bool,
    layout: Layout,
}

/// Returns the worlds; `count` shapes in each, or a fifth if they are far smaller or larger than 1.
fn worlds(count: usize) -> Result<Vec<NamedLayout>, Failure> {
    let crowd = |name, size: f64, count| NamedLayout {
        name,
        is_moved_along_x: size == 1.0,
        layout: Layout::crowd(count, size, 1),
    };
    let scene = |name| -> Result<NamedLayout, Failure> {
        let layout = Layout::of_world(&Scene::named(name)?.build(count, 1));
        Ok(NamedLayout { name, is_moved_along_x: true, layout })
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
struct PlacedWorld<'a> {
    layout: &'a Layout,
    poses: Vec<Pose>,
    colliders: Vec<Collider>,
    params: IntegrationParameters,
    /// Boxes in f64 at the poses that rapier holds in f32, and at poses in f64.
    truths: [Truth; 2],
}

impl<'a> PlacedWorld<'a> {
    /// Moves the layout.
    fn new(layout: &'a Layout, offset: [f64; 3]) -> Self {
        let (params, poses) = (IntegrationParameters::default(), layout.poses(offset));
        let narrow: Vec<_> = poses.iter().map(to_f32).collect();
        let held: Vec<_> = narrow.iter().map(to_f64).collect();
        let truth = |poses: &[Pose]| {
            let farthest = poses.iter().map(|pose| pose.translation.vector.amax()).fold(0.0, f64::max);
            let boxes = layout.boxes(poses, f64::from(params.prediction_distance() / 2.0));
            Truth::of(boxes, doubt(farthest))
        };
        let truths = [truth(&held), truth(&poses)];
        Self { layout, colliders: layout.colliders(&narrow), poses, params, truths }
    }

    /// Returns twice what boxes reach beyond shapes: boxes that overlap by more are of shapes whose own do.
    fn reach(&self) -> f64 {
        f64::from(self.params.prediction_distance())
    }

    fn boxes(&self, way: usize) -> Vec<Aabb> {
        if way == OUTWARD {
            let boxes = self.layout.boxes(&self.poses, self.reach() / 2.0);
            return boxes.iter().map(|wide| Aabb::from_f64(wide.min, wide.max)).collect();
        }
        let none = RigidBodySet::new();
        let margin = if way == MARGIN { PbigConfig::DEFAULT.margin } else { 0.0 };
        let aabb = |one: &Collider| collision_aabb(&self.params, &none, one).inflated(margin);
        self.colliders.iter().map(aabb).collect()
    }

    /// Compares the pairs of boxes in f32 with those in f64.
    fn differences(&self, way: usize) -> Result<[Differences; 2], Failure> {
        let mut finder = Finder::new(UNLIMITED);
        let found = finder.find(&self.boxes(way))?;
        Ok(self.truths.each_ref().map(|truth| truth.differences(found, self.reach())))
    }
}

/// The results of a world at a distance.
struct PlaceRow {
    world: &'static str,
    offset: f64,
    /// Pairs at the poses in f32, and in f64.
    pairs: [u64; 2],
    /// By way: against boxes in f64 at the same poses, and against the world.
    ways: [[Differences; 2]; WAYS.len()],
}

impl PlaceRow {
    fn new(world: &NamedLayout, offset: f64, axes: [f64; 3]) -> Result<Self, Failure> {
        let place = PlacedWorld::new(&world.layout, axes.map(|axis| axis * offset));
        let pairs = place.truths.each_ref().map(|truth| truth.pairs.len() as u64);
        let mut ways = [[Differences::default(); 2]; WAYS.len()];
        for (way, differences) in ways.iter_mut().enumerate() {
            *differences = place.differences(way)?;
        }
        Ok(Self { world: world.name, offset, pairs, ways })
    }
}

/// Puts every world everywhere along the diagonal; worlds of size 1 also along one axis. At the origin all directions are the same.
fn rows(worlds: &[NamedLayout]) -> Result<Vec<PlaceRow>, Failure> {
    let mut rows = vec![];
    for world in worlds {
        for offset in OFFSETS {
            rows.push(PlaceRow::new(world, offset, [1.0; 3])?);
        }
        for offset in OFFSETS.into_iter().filter(|offset| world.is_moved_along_x && *offset > 0.0) {
            rows.push(PlaceRow::new(world, offset, [1.0, 0.0, 0.0])?);
        }
    }
    Ok(rows)
}

/// Checks the proved statements: no pair is missed by boxes in f64 that are rounded outward; nor, at the poses that rapier holds, as
/// far out as the margin covers the loss by rounding: while 2 ulps, 2^-22 of the distance at most, are less.
fn promised(row: &PlaceRow) -> Result<(), Failure> {
    let is_near = row.offset < f64::from(PbigConfig::DEFAULT.margin) * 2f64.powi(22);
    [(true, OUTWARD, 1), (is_near, MARGIN, 0)].into_iter().try_for_each(|(holds, way, truth)| {
        let (PlaceRow { world, offset, ways, .. }, name) = (row, WAYS[way]);
        let missed = ways[way][truth].missed;
        check(!holds || missed == 0, || format!("{world}, {offset} away, {name}: {missed} pairs missed"))
    })
}

/// Sums over all worlds and directions.
fn ways_table(rows: &[PlaceRow]) -> Table {
    let columns = "offset | boxes | pairs_at_the_poses | missed_at_the_poses | of_touching_shapes | pairs | missed | added | \
        added_percent";
    let mut table = Table::new("ways", columns);
    for offset in OFFSETS {
        let there: Vec<&PlaceRow> = rows.iter().filter(|row| row.offset == offset).collect();
        let [held, pairs] = [0, 1].map(|truth| there.iter().map(|row| row.pairs[truth]).sum::<u64>());
        for (k, way) in WAYS.iter().enumerate() {
            let mut sums = [Differences::default(); 2];
            let all = there.iter().flat_map(|row| row.ways[k].into_iter().enumerate());
            all.for_each(|(truth, one)| sums[truth] += one);
            let [boxes, world] = sums;
            let at_poses = cells![offset, *way, held, boxes.missed, boxes.missed_deep];
            table.row(cells![..at_poses, pairs, world.missed, world.added, percent(world.added, pairs)]);
        }
    }
    table
}

/// Measures nanoseconds a box of a world at each offset: to compute it, and also to find its pairs.
fn times(layout: &Layout, quick: bool) -> Result<Table, Failure> {
    let mut table = Table::new("times", "offset | boxes | to_compute_ns | to_compute_and_search_for_ns");
    let (rounds, ms) = if quick { (6, 60) } else { (60, 2000) };
    let effort = Effort { warm_up: 2, rounds, budget: Duration::from_millis(ms) };
    for offset in OFFSETS {
        let place = PlacedWorld::new(layout, [offset; 3]);
        // Finders keep their buffers.
        let mut sides: Vec<_> = (0..TIMED).map(|_| (Finder::new(UNLIMITED), vec![])).collect();
        let both = medians(&mut sides, TIMED, effort, unprepared, |sides, side| {
            let (finder, kept) = &mut sides[side];
            let (boxes, computed) = timed(|| place.boxes(side));
            let (found, searched) = timed(|| finder.find(&boxes).map(<[_]>::len));
            kept.push(computed);
            Ok(found.map(|_| computed + searched)?)
        })?;
        let each = 1e6 / place.colliders.len().max(1) as f64;
        for ((way, (_, kept)), both) in WAYS.iter().zip(sides).zip(both) {
            table.row(cells![offset, *way, Spread::of(kept).median * each, both * each]);
        }
    }
    Ok(table)
}

/// Returns time and error of each way at each offset, of the first crowd along the diagonal.
fn points(rows: &[PlaceRow], times: &Table) -> Vec<(String, f64, f64)> {
    let point = |k: usize| {
        let row = &rows[k / TIMED];
        let [_, Differences { missed, added, .. }] = row.ways[k % TIMED];
        let time = times.rows[k][3].as_f64().unwrap_or_default();
        (WAYS[k % TIMED].to_owned(), time, percent(missed + added, row.pairs[1]))
    };
    (0..times.rows.len()).map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missed_pair_that_was_promised_is_a_failed_check() {
        let world = &worlds(50).expect("worlds")[0];
        let mut row = PlaceRow::new(world, 1e3, [1.0; 3]).expect("found");
        row.ways[0][0].missed = 5;
        assert!(promised(&row).is_ok(), "nobody promises that of one");
        row.ways[MARGIN][0].missed = 5;
        assert!(promised(&row).is_err_and(|failure| failure.to_string().contains("5 pairs missed")));
        row.offset = 1e6;
        assert!(promised(&row).is_ok(), "as far away the margin is lost");
        row.ways[OUTWARD][1].missed = 7;
        assert!(promised(&row).is_err_and(|failure| failure.to_string().contains("outward: 7 pairs")));
    }
}
