//! Worlds that move: simulated by rapier3d-f64, whose poses are the truth in each step, and by rapier in f32 beside it. What is
//! promised of boxes must hold here, too; sums over worlds are without these, which are hundreds of frames of one.

use super::super::study::{Cell, Table, plain};
use super::place::{Along, IN_WORLD, Place, Row, Way, finder, rapiers};
use crate::output::Failure;
use pbig_core::Pair;
use pbig_harness::scenes::Scene;
use pbig_harness::wide::{Differences, Layout, Pose, WideWorld, moved, to_f64};
use pbig_harness::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::Collider;

/// What moves.
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

/// A simulation at a place.
pub(super) struct Simulated {
    /// All steps together: what boxes in f32 make of the world in f64, held in f32.
    pub(super) row: Row,
    steps: usize,
    /// All steps together: pairs of the world that rapier simulates in f32, against those of the one in f64.
    own: Differences,
    /// In the last step, between the places of a body in the two, on average.
    apart: f64,
    /// Colliders of the world in f32 that are nowhere in the end.
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
        let world = Scene::named(scene).map_err(Failure::Input)?.build(bodies, 1);
        let layout = Layout::of_world(&world);
        let mut wide = WideWorld::of(&world, [offset; 3]).map_err(Failure::Input)?;
        let mut narrow = Narrow::new(moved(world, [offset; 3]));
        let mut sum: Option<Row> = None;
        let mut own = Differences::default();
        for _ in 0..steps {
            wide.step();
            narrow.step();
            let place = Place::at(&layout, wide.poses());
            let now = Row::of(name, 1.0, (offset, Along::Diagonal), &place)?;
            own += place.world.differences(&narrow.pairs()?, place.reach());
            sum = Some(sum.map_or_else(|| now.clone(), |sum| sum.and(&now)));
        }
        let row = sum.ok_or_else(|| Failure::Input("no steps".into()))?;
        let ends = wide.poses();
        if ends.iter().any(|pose| !pose.translation.vector.norm().is_finite()) {
            return Err(Failure::Check(format!("{name}, {offset} away: a body is nowhere in f64")));
        }
        let distances = narrow.distances(&ends);
        let (there, lost) =
            (distances.iter().filter(|d| d.is_finite()), distances.iter().filter(|d| !d.is_finite()));
        let apart = there.clone().sum::<f64>() / there.count().max(1) as f64;
        Ok(Self { row, steps, own, apart, lost: lost.count() })
    }
}

/// The world as rapier simulates it in f32.
struct Narrow {
    world: World,
    broad_phase: PbigBroadPhase,
}

impl Narrow {
    fn new(world: World) -> Self {
        Self { world, broad_phase: PbigBroadPhase::new() }
    }

    fn step(&mut self) {
        self.world.step(&mut self.broad_phase);
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

pub(super) fn table(all: &[Simulated]) -> Table {
    let title = "Simulated by rapier3d-f64 and by rapier in f32, all steps together";
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
        "missed_by_the_simulation_in_f32_percent",
        "added_by_the_simulation_in_f32_percent",
        "apart_at_the_end",
        "lost_in_f32",
    ];
    let mut table = Table::new("simulated", title, &columns);
    all.iter().for_each(|one| table.row(one.cells()));
    table
}

impl Simulated {
    fn cells(&self) -> Vec<Cell> {
        let Self { row, own, .. } = self;
        let (boxes, all) = (row.by_boxes(Way::Ulps(0)), row.in_all(Way::Ulps(0)));
        let head = [row.world.into(), row.offset.into(), (self.steps as u64).into(), row.pairs.into()];
        let counts = [boxes.missed, boxes.missed_deep, all.missed, all.added, row.in_all(IN_WORLD).missed];
        let percents = [own.missed, own.added].map(|count| Cell::from(self.percent(count)));
        let end = [self.apart.into(), (self.lost as u64).into()];
        head.into_iter().chain(counts.map(Cell::from)).chain(percents).chain(end).collect()
    }

    fn percent(&self, count: u64) -> f64 {
        count as f64 / self.row.pairs.max(1) as f64 * 100.0
    }
}

/// What the rows say, in words.
pub(super) fn notes(all: &[Simulated]) -> Vec<String> {
    let mut names: Vec<&str> = all.iter().map(|one| one.row.world).collect();
    names.dedup();
    let about = "*Simulated in f64*: rapier3d-f64 steps the same bodies at the same place; in each step its poses, rounded \
                 as rapier holds them in f32, are a layout like the others: boxes widened by 3 ulps miss none of its \
                 pairs, or the run fails. Beside it rapier simulates the world in f32, with our broad phase where the \
                 other has rapier's: its pairs differ from those in f64, step by step, by all that rounding does to \
                 bodies on their way, too; at the origin, where rounding is least, by what two simulations differ \
                 anyway."
        .to_owned();
    [about].into_iter().chain(names.into_iter().map(|name| where_it_starts(name, all))).collect()
}

/// Percent of pairs that may differ at the origin for any offset to show.
const MOST_APART: f64 = 20.0;

/// From which offset on the simulation in f32 is further from f64 than at the origin.
fn where_it_starts(name: &str, all: &[Simulated]) -> String {
    let wrong = |one: &Simulated| one.percent(one.own.missed + one.own.added);
    let of_name = || all.iter().filter(|one| one.row.world == name);
    let told = of_name().map(|one| format!("{}% at {}", plain(wrong(one)), one.row.offset));
    let told = told.collect::<Vec<_>>().join(", ");
    let near = of_name().map(wrong).next().unwrap_or(0.0);
    let first = of_name().find(|one| wrong(one) > 2.0 * near).map(|one| one.row.offset);
    let first = first.map_or("nowhere".into(), |offset| format!("from {offset:e} on"));
    let but = if near > MOST_APART { ", so many that a smaller one may not show" } else { "" };
    format!(
        "{name}: pairs of the simulation in f32 that are missed or too many, of those in f64: {told}; more than twice \
         as many as at the origin {first}{but}."
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_away_f32_simulates_another_world_and_boxes_with_ulps_miss_nothing_of_f64() {
        let all = simulated(&[0.0, 1e6], true).expect("no failure");
        let [near, far] = &all[..] else { panic!("one scene at two places") };
        assert!(near.row.pairs > 1000 && near.row.pairs.abs_diff(far.row.pairs) < near.row.pairs / 5);
        assert!(near.percent(near.own.missed + near.own.added) < 10.0, "{:?}", near.own);
        assert!(far.percent(far.own.missed) > 10.0 && far.apart > near.apart, "{:?}", far.own);
        assert!(far.row.poses.missed > 0 && far.row.in_all(IN_WORLD).missed == 0);
        let told = where_it_starts(near.row.world, &all);
        assert!(told.ends_with("from 1e6 on."), "{told}");
        assert_eq!(table(&all).rows.len(), 2);
        let mut all = all;
        all.iter_mut().for_each(|one| one.own.missed = one.row.pairs);
        let told = where_it_starts("column, simulated in f64", &all);
        assert!(told.ends_with("at the origin nowhere, so many that a smaller one may not show."), "{told}");
    }

    #[test]
    fn rows_of_steps_are_added() {
        let world = Scene::named("column").expect("a scene").build(50, 1);
        let layout = Layout::of_world(&world);
        let place = Place::at(&layout, layout.poses([1e6; 3]));
        let one = Row::of("column", 1.0, (1e6, Along::Diagonal), &place).expect("a row");
        let two = one.clone().and(&one);
        assert_eq!(
            (two.pairs, two.held_pairs, two.shortfall),
            (2 * one.pairs, 2 * one.held_pairs, one.shortfall)
        );
        let missed = |row: &Row| [row.poses, row.by_boxes(Way::Ulps(0)), row.in_all(Way::Ulps(0))];
        for (two, one) in missed(&two).into_iter().zip(missed(&one)) {
            let twice = [one.missed, one.missed_deep, one.added].map(|count| 2 * count);
            assert_eq!([two.missed, two.missed_deep, two.added], twice);
        }
        assert!(one.poses.added > 0);
    }
}
