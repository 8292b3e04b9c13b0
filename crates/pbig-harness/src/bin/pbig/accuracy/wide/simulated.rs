//! Worlds that move: simulated by rapier3d-f64, whose poses are the truth in each step, and by rapier in f32 beside it, once
//! with our broad phase and, as controls, with rapier's, in its own order of events and in ours. What is promised of boxes
//! must hold here, too; sums over worlds are without these, which are hundreds of frames of one.

use super::super::study::{Cell, Table, plain};
use super::place::{Along, IN_WORLD, Place, Row, Way, finder, rapiers};
use crate::output::Failure;
use pbig_core::Pair;
use pbig_harness::scenes::Scene;
use pbig_harness::sorted::Sorted;
use pbig_harness::wide::{Differences, Layout, Pose, WideWorld, moved, to_f64};
use pbig_harness::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::{BroadPhase, Collider, DefaultBroadPhase};

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
    /// The world in f32 with our broad phase, with rapier's, and with rapier's in our order of events.
    own: [Own; 3],
}

/// What has become of a world that rapier simulates in f32.
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
        let mut narrow = [
            Narrow::of((scene, bodies), offset, Box::new(PbigBroadPhase::new()))?,
            Narrow::of((scene, bodies), offset, Box::new(DefaultBroadPhase::new()))?,
            Narrow::of((scene, bodies), offset, Box::new(Sorted(DefaultBroadPhase::new())))?,
        ];
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
        Ok(Self { row, steps, own: narrow.map(|one| one.at_the_end(&ends)) })
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
        "missed_with_stock_in_f32_percent",
        "added_with_stock_in_f32_percent",
        "apart_with_stock",
        "lost_with_stock",
        "missed_with_stock_sorted_percent",
        "added_with_stock_sorted_percent",
        "apart_with_stock_sorted",
        "lost_with_stock_sorted",
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
        let of_own = |own: &Own| {
            let percents = [own.pairs.missed, own.pairs.added].map(|count| Cell::from(self.percent(count)));
            percents.into_iter().chain([own.apart.into(), (own.lost as u64).into()])
        };
        head.into_iter().chain(counts.map(Cell::from)).chain(own.iter().flat_map(of_own)).collect()
    }

    /// Pairs in f32 that are missed or too many, of those in f64, in percent, of each world in f32.
    fn wrong(&self) -> [f64; 3] {
        self.own.map(|own| self.percent(own.pairs.missed + own.pairs.added))
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
                 pairs, or the run fails. Beside it rapier simulates the world in f32, with our broad phase: its pairs differ \
                 from those in f64, step by step, by all that rounding does to bodies on their way, too; at the origin, \
                 where rounding is least, by what two simulations differ anyway. A control is a third world, in f32 with \
                 rapier's own broad phase (stock): what it differs from f64 is what f32 brings. Near the origin that is \
                 little: the world in f64 is told of its pairs in the same order, by the same broad phase. So there is a \
                 second control, stock with its events in our order (sorted): only what ours differs beyond both could be of \
                 our broad phase."
        .to_owned();
    [about].into_iter().chain(names.into_iter().map(|name| where_it_starts(name, all))).collect()
}

/// Percent of pairs that may differ at the origin for any offset to show.
const MOST_APART: f64 = 20.0;

/// From which offset on the simulation in f32 is further from f64 than at the origin.
fn where_it_starts(name: &str, all: &[Simulated]) -> String {
    let wrong = |one: &Simulated| one.wrong()[0];
    let of_name = || all.iter().filter(|one| one.row.world == name);
    let each = |one: &Simulated| {
        let [ours, stock, sorted] = one.wrong().map(plain);
        format!("{ours}% at {} (stock {stock}%, sorted {sorted}%)", one.row.offset)
    };
    let told = of_name().map(each).collect::<Vec<_>>().join(", ");
    let near = of_name().map(wrong).next().unwrap_or(0.0);
    let first = of_name().find(|one| wrong(one) > 2.0 * near).map(|one| one.row.offset);
    let first = first.map_or("nowhere".into(), |offset| format!("from {offset:e} on"));
    let but = if near > MOST_APART { ", so many that a smaller one may not show" } else { "" };
    format!(
        "{name}: pairs of the simulation in f32 that are missed or too many, of those in f64: {told}; more than twice \
         as many as at the origin {first}{but}. {}",
        against_stock(of_name())
    )
}

/// How far our world in f32 is from f64, over how far each control's is.
fn against_stock<'a>(all: impl Iterator<Item = &'a Simulated>) -> String {
    let all: Vec<&Simulated> = all.collect();
    let over = |control: usize| {
        let ratio = |of: fn(&Simulated, usize) -> f64| {
            let ratio = |one: &&Simulated| (one.row.offset, of(one, 0) / of(one, control));
            range(&all.iter().map(ratio).collect::<Vec<_>>())
        };
        (ratio(|one, k| one.wrong()[k]), ratio(|one, k| one.own[k].apart))
    };
    let ((wrong, apart), (wrong_sorted, apart_sorted)) = (over(1), over(2));
    format!(
        "Ours has {wrong} as many wrong pairs as stock, and {wrong_sorted} as many as stock sorted; its bodies end {apart} as \
         far from those in f64 as stock's, and {apart_sorted} as far as those of stock sorted."
    )
}

/// The least and the most of some ratios, each with its offset; and where there is none, as the control has 0.
fn range(ratios: &[(f64, f64)]) -> String {
    let each = || ratios.iter().map(|one| one.1).filter(|ratio| ratio.is_finite());
    let told = match each().min_by(f64::total_cmp).zip(each().max_by(f64::total_cmp)) {
        Some((least, most)) => format!("{least:.2} to {most:.2} times"),
        None => "no number of times".to_owned(),
    };
    let named = |what: &str, is: fn(f64) -> bool| {
        let offsets = ratios.iter().filter(|one| is(one.1)).map(|one| one.0.to_string()).collect::<Vec<_>>();
        (!offsets.is_empty()).then(|| format!("{what} at {}", offsets.join(", ")))
    };
    let without =
        [named("the control has 0 and ours more", f64::is_infinite), named("both have 0", f64::is_nan)];
    let without: Vec<String> = without.into_iter().flatten().collect();
    if without.is_empty() { told } else { format!("{told} ({})", without.join("; ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_away_f32_simulates_another_world_and_boxes_with_ulps_miss_nothing_of_f64() {
        let all = simulated(&[0.0, 1e6], true).expect("no failure");
        let [near, far] = &all[..] else { panic!("one scene at two places") };
        assert!(near.row.pairs > 1000 && near.row.pairs.abs_diff(far.row.pairs) < near.row.pairs / 5);
        for (near, far, own) in (0..3).map(|k| (near.wrong()[k], far.wrong()[k], [near.own[k], far.own[k]])) {
            assert!(near < 10.0 && far > 10.0 && own[1].apart > own[0].apart, "{own:?}");
        }
        assert!(far.row.poses.missed > 0 && far.row.in_all(IN_WORLD).missed == 0);
        let told = where_it_starts(near.row.world, &all);
        assert!(told.contains("from 1e6 on. Ours has "), "{told}");
        assert_eq!(table(&all).rows.len(), 2);
        let mut all = all;
        for one in &mut all {
            one.own[0].pairs = Differences { missed: one.row.pairs, added: 0, ..one.own[0].pairs };
            one.own[1].pairs = Differences { missed: one.row.pairs / 2, added: 0, ..one.own[1].pairs };
            one.own[2].pairs = one.own[0].pairs;
            [one.own[0].apart, one.own[1].apart, one.own[2].apart] = [1.0, 4.0, 0.5];
        }
        let told = where_it_starts("column, simulated in f64", &all);
        assert!(told.contains("at the origin nowhere, so many that a smaller one may not show."), "{told}");
        assert!(told.contains("100.0% at 0 (stock 50.00%, sorted 100.0%)"), "{told}");
        assert!(
            told.contains("1.00 to 1.00 times as many as stock sorted; its bodies end 0.25 to 0.25"),
            "{told}"
        );
        assert!(told.ends_with("and 2.00 to 2.00 times as far as those of stock sorted."), "{told}");
    }

    #[test]
    fn where_the_control_has_none_the_offset_is_named() {
        let told = range(&[(0.0, f64::NAN), (1e3, 0.5), (1e4, f64::INFINITY), (1e6, 2.0)]);
        assert_eq!(told, "0.50 to 2.00 times (the control has 0 and ours more at 10000; both have 0 at 0)");
        assert_eq!(
            range(&[(7.0, f64::INFINITY)]),
            "no number of times (the control has 0 and ours more at 7)"
        );
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
