//! Worlds that move: simulated by rapier3d-f64, whose poses are the truth in each step, and by rapier in f32 beside it, with
//! our broad phase and, as controls, with rapier's and with the orders of either in the other. What is promised of boxes
//! must hold here, too; sums over worlds are without these, which are hundreds of frames of one.

mod tables;

use super::super::study::plain;
use super::place::{Along, Place, Row, finder, rapiers};
use crate::output::Failure;
use pbig_core::Pair;
use pbig_harness::scenes::Scene;
use pbig_harness::sorted::{LowerFirst, Sorted};
use pbig_harness::wide::{Differences, Layout, Pose, WideWorld, moved, to_f64};
use pbig_harness::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::{BroadPhase, Collider, DefaultBroadPhase};
pub(super) use tables::tables;

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

impl Simulated {
    /// Pairs in f32 that are missed or too many, of those in f64, in percent, with a kind.
    fn wrong(&self, kind: usize) -> f64 {
        let own = &self.own[kind];
        self.percent(own.pairs.missed + own.pairs.added)
    }

    fn percent(&self, count: u64) -> f64 {
        count as f64 / self.row.pairs.max(1) as f64 * 100.0
    }
}

/// Returns the findings of the rows, in words.
pub(super) fn notes(all: &[Simulated]) -> Vec<String> {
    let mut names: Vec<&str> = all.iter().map(|one| one.row.world).collect();
    names.dedup();
    let about = "*Simulated in f64*: rapier3d-f64 steps the same bodies at the same place; in each step its poses, rounded \
                 as rapier holds them in f32, are a layout like the others: boxes widened by 3 ulps miss none of its \
                 pairs, or the run fails. Beside it rapier simulates the world in f32, with our broad phase: its pairs differ \
                 from those in f64, step by step, by all that rounding does to bodies on their way, too; at the origin, \
                 where rounding is least, by what two simulations differ anyway. A control is another world, in f32 with \
                 rapier's own broad phase (stock): what it differs from f64 is what f32 brings. But the world in f64 is told \
                 of its pairs by that broad phase, too, so that stock may stay nearer to it for the order alone. So there are \
                 two controls more: stock with its events sorted as ours are, and ours with the collider of the lower index \
                 first in each pair (lower first), as stock has it, where ours has the one with fewer pairs first. Order sets \
                 these two apart no longer, but what finds pairs does, and when they begin and end."
        .to_owned();
    [about].into_iter().chain(names.into_iter().map(|name| where_it_starts(name, all))).collect()
}

/// Percent of pairs that may differ at the origin for any offset to show.
const MOST_APART: f64 = 20.0;

/// Pairs of each kind at each offset that differ from those in f64, and from which offset on they are more.
fn where_it_starts(name: &str, all: &[Simulated]) -> String {
    let of_name = || all.iter().filter(|one| one.row.world == name);
    let each = |one: &Simulated| {
        let kinds =
            KINDS.iter().enumerate().map(|(kind, (name, _))| format!("{name} {}", plain(one.wrong(kind))));
        format!("at {} {}", one.row.offset, kinds.collect::<Vec<_>>().join(", "))
    };
    let told = of_name().map(each).collect::<Vec<_>>().join("; ");
    let near = (0..KINDS.len()).filter_map(|kind| Some(of_name().next()?.wrong(kind)));
    let near = near.fold(f64::MAX, f64::min);
    let but = if near > MOST_APART { ", so many that a smaller one may not show" } else { "" };
    let first =
        (0..KINDS.len()).map(|kind| format!("{} {}", KINDS[kind].0, beyond(of_name(), kind, 2.0 * near)));
    format!(
        "{name}: pairs of the simulation in f32 that are missed or too many, in percent of those in f64: {told}. More than \
         twice the least of these at the origin, {}{but}: {}. {} {}",
        plain(near),
        first.collect::<Vec<_>>().join(", "),
        over(of_name(), 0, 2),
        over(of_name(), 1, 3)
    )
}

/// The first offset at which a kind has more wrong pairs than that.
fn beyond<'a>(mut all: impl Iterator<Item = &'a Simulated>, kind: usize, most: f64) -> String {
    let first = all.find(|one| one.wrong(kind) > most);
    first.map_or("nowhere".into(), |one| format!("from {:e} on", one.row.offset))
}

/// Compares the distance of a world in f32 from f64 with that of a control.
fn over<'a>(all: impl Iterator<Item = &'a Simulated>, kind: usize, control: usize) -> String {
    let all: Vec<&Simulated> = all.collect();
    let ratios = |of: fn(&Simulated, usize) -> f64| {
        range(&all.iter().map(|one| (one.row.offset, of(one, kind) / of(one, control))).collect::<Vec<_>>())
    };
    format!(
        "{} has {} as many wrong pairs as {}, and its bodies end {} as far from those in f64.",
        KINDS[kind].0,
        ratios(Simulated::wrong),
        KINDS[control].0,
        ratios(|one, kind| one.own[kind].apart)
    )
}

/// The least and the most of some ratios, each with its offset; and where there is none, as the control has 0.
fn range(ratios: &[(f64, f64)]) -> String {
    let each = || ratios.iter().filter(|one| one.1.is_finite());
    let [least, most] =
        [each().min_by(|a, b| a.1.total_cmp(&b.1)), each().max_by(|a, b| a.1.total_cmp(&b.1))];
    let told = match least.zip(most) {
        Some((least, most)) => {
            format!("{:.2} (at {}) to {:.2} times (at {})", least.1, least.0, most.1, most.0)
        }
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
    use super::super::place::{IN_WORLD, Way};
    use super::*;
    use rapier3d::prelude::BroadPhasePairEvent;

    #[test]
    fn far_away_f32_simulates_another_world_and_boxes_with_ulps_miss_nothing_of_f64() {
        let all = simulated(&[0.0, 1e6], true).expect("no failure");
        let [near, far] = &all[..] else { panic!("one scene at two places") };
        assert!(near.row.pairs > 1000 && near.row.pairs.abs_diff(far.row.pairs) < near.row.pairs / 5);
        for kind in 0..KINDS.len() {
            let own = [near.own[kind], far.own[kind]];
            assert!(
                near.wrong(kind) < 10.0 && far.wrong(kind) > 10.0 && own[1].apart > own[0].apart,
                "{own:?}"
            );
        }
        assert!(far.row.poses.missed > 0 && far.row.in_all(IN_WORLD).missed == 0);
        let told = where_it_starts(near.row.world, &all);
        assert!(
            told.contains(": pbig from 1e6 on, pbig lower first from 1e6 on, stock from 1e6 on"),
            "{told}"
        );
        assert_eq!(tables(&all).map(|table| table.rows.len()), [2, 2 * KINDS.len()]);
    }

    #[test]
    fn each_kind_is_held_against_its_control() {
        let mut all = simulated(&[0.0], true).expect("no failure");
        let one = &mut all[0];
        let with = |part: u64, apart| {
            let pairs = Differences { missed: one.row.pairs / part, added: 0, ..one.own[0].pairs };
            Own { pairs, apart, lost: 0 }
        };
        one.own = [with(1, 1.0), with(1, 3.0), with(2, 4.0), with(1, 0.5)];
        let told = where_it_starts("column, simulated in f64", &all);
        let first = "at the origin, 50.00, so many that a smaller one may not show: pbig nowhere, pbig lower first nowhere, ";
        assert!(told.contains(first), "{told}");
        assert!(told.contains("at 0 pbig 100.0, pbig lower first 100.0, stock 50.0"), "{told}");
        assert!(
            told.contains("as stock, and its bodies end 0.25 (at 0) to 0.25 times (at 0) as far"),
            "{told}"
        );
        assert!(
            told.contains("1.00 (at 0) to 1.00 times (at 0) as many wrong pairs as stock sorted, "),
            "{told}"
        );
        assert!(
            told.ends_with("bodies end 6.00 (at 0) to 6.00 times (at 0) as far from those in f64."),
            "{told}"
        );
        let mut none = all;
        none[0].own[2].pairs = Differences { missed: 0, added: 0, ..none[0].own[2].pairs };
        let told = where_it_starts("column, simulated in f64", &none);
        assert!(
            told.contains("the origin, 0: pbig from 0e0 on, pbig lower first from 0e0 on, stock nowhere, "),
            "{told}"
        );
    }

    /// Indices of the pairs that are added in the first step.
    fn told_by((_, make): Kind) -> Vec<[u32; 2]> {
        let (world, mut events) = (built(("pile", 200)).expect("a scene"), Vec::new());
        let handles: Vec<_> = world.colliders.iter().map(|(handle, _)| handle).collect();
        make().update(&world.params, &world.colliders, &world.bodies, &handles, &[], &mut events);
        let added = events.into_iter().filter_map(|event| match event {
            BroadPhasePairEvent::AddPair(pair) => Some(pair),
            BroadPhasePairEvent::DeletePair(_) => None,
        });
        added.map(|pair| [pair.collider1, pair.collider2].map(|handle| handle.into_raw_parts().0)).collect()
    }

    #[test]
    fn each_kind_has_the_order_that_it_is_to_have() {
        let [ours, lower_first, stock, sorted] = KINDS.map(told_by);
        let is_lower_first = |pairs: &[[u32; 2]]| pairs.iter().all(|[a, b]| a < b);
        assert!(
            !is_lower_first(&ours)
                && [&lower_first, &stock, &sorted].map(|all| is_lower_first(all)) == [true; 3]
        );
        assert!(lower_first.is_sorted() && sorted.is_sorted() && !stock.is_sorted());
        let mut in_order = stock;
        in_order.sort_unstable();
        assert!(in_order == sorted, "what stock tells, in another order");
    }

    #[test]
    fn where_the_control_has_none_the_offset_is_named() {
        let told = range(&[(0.0, f64::NAN), (1e3, 0.5), (1e4, f64::INFINITY), (1e6, 2.0)]);
        let times = "0.50 (at 1000) to 2.00 times (at 1000000)";
        assert_eq!(told, format!("{times} (the control has 0 and ours more at 10000; both have 0 at 0)"));
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
