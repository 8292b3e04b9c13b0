//! Updates by near pairs against the oracle, and when there are any.

mod few;

use super::skin::Skin;
use super::worth::Worth;
use crate::broad_phase::measured::Spent;
use crate::broad_phase::{BroadPhase, Events};
use crate::plan::{Chosen, NoNear};
use crate::{Aabb, Config, Error, Limits, Pair, ProxyFilter, Strategy, oracle};
use std::collections::BTreeSet;

const BOXES: u32 = 1500;

/// Boxes that move, and the pairs that events have told of.
struct World {
    broad_phase: BroadPhase,
    boxes: Vec<Aabb>,
    pairs: BTreeSet<Pair>,
    seed: u64,
    /// Updates by near pairs.
    near: u32,
}

impl World {
    fn new(margin: f32) -> Self {
        Self::with(margin, BOXES, 7.0)
    }

    fn of(boxes: u32, reach: f32) -> Self {
        Self::with(0.0, boxes, reach)
    }

    fn with(margin: f32, boxes: u32, reach: f32) -> Self {
        let config = Config { strategy: Strategy::Grid, margin, ..Config::DEFAULT };
        let broad_phase = BroadPhase::new(config).expect("a margin");
        let mut world = Self { broad_phase, boxes: vec![], pairs: BTreeSet::new(), seed: 11, near: 0 };
        for id in 0..boxes {
            let center = world.vector().map(|x| reach * x);
            world.boxes.push(Aabb::from_center(center, [0.5; 3]));
            world.set(id);
        }
        world.update("all are new");
        world
    }

    fn random(&mut self) -> f32 {
        self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.seed >> 40) as f32 / 16_777_216.0
    }

    /// From -1 to 1.
    fn vector(&mut self) -> [f32; 3] {
        [self.random(), self.random(), self.random()].map(|x| 2.0 * x - 1.0)
    }

    fn set(&mut self, id: u32) {
        self.broad_phase.set(id, self.boxes[id as usize], ProxyFilter::ALL).expect("a small id");
    }

    fn shift(&mut self, id: u32, by: [f32; 3]) {
        let add = |corner: [f32; 3]| std::array::from_fn(|k| corner[k] + by[k]);
        let aabb = &mut self.boxes[id as usize];
        *aabb = Aabb::new(add(aabb.min), add(aabb.max));
        self.set(id);
    }

    fn tremble(&mut self, by: f32) {
        for id in 0..self.boxes.len() as u32 {
            let by = self.vector().map(|x| by * x);
            self.shift(id, by);
        }
    }

    /// The pairs that there should be: of the fat boxes, and as filters allow.
    fn wanted(&self) -> BTreeSet<Pair> {
        let of = &self.broad_phase;
        let boxes: Vec<Aabb> =
            (0..of.id_count()).map(|id| of.fat_aabb(id).unwrap_or(Aabb::NOWHERE)).collect();
        let allow = |a: u32, b: u32| of.filter(a).zip(of.filter(b)).is_some_and(|(a, b)| a.allows(b));
        oracle::pairs_where(&boxes, allow).into_iter().collect()
    }

    fn update(&mut self, what: &str) {
        // How long anything takes decides nothing here.
        self.broad_phase.near.worth.usual = Some(f32::MAX);
        let events = self.broad_phase.update().expect("within the limits").clone();
        for pair in &events.removed {
            assert!(self.pairs.remove(pair), "{what}: {pair:?} is removed and was not there");
        }
        for pair in &events.added {
            assert!(self.pairs.insert(*pair), "{what}: {pair:?} is added and was there");
        }
        let wanted = self.wanted();
        let wrong: Vec<&Pair> = wanted.symmetric_difference(&self.pairs).take(3).collect();
        assert!(wrong.is_empty(), "{what}: {wrong:?}, {}", self.broad_phase.report().plan);
        self.check_pairs();
        self.near += u32::from(self.broad_phase.report().plan.chosen == Chosen::Near);
    }

    fn remove(&mut self, id: u32) {
        assert!(self.broad_phase.remove(id));
        self.pairs.retain(|pair| pair.a != id && pair.b != id);
        self.check_pairs();
    }

    /// What can be asked about pairs, at any time.
    fn check_pairs(&self) {
        let of = &self.broad_phase;
        assert_eq!(of.pairs().collect::<BTreeSet<_>>(), self.pairs);
        assert_eq!(of.pair_count(), self.pairs.len());
        let mut degrees = vec![0; of.id_count() as usize];
        self.pairs.iter().flat_map(|pair| [pair.a, pair.b]).for_each(|id| degrees[id as usize] += 1);
        assert_eq!((0..of.id_count()).map(|id| of.degree(id)).collect::<Vec<_>>(), degrees);
        let first = self.pairs.first().into_iter().chain(self.pairs.last());
        for id in first.flat_map(|pair| [pair.a, pair.b]) {
            let own: Vec<Pair> = self.pairs.iter().copied().filter(|p| p.a == id || p.b == id).collect();
            let mut told: Vec<Pair> = of.pairs_of(id).collect();
            told.sort_unstable();
            assert_eq!(told, own, "those of {id}");
        }
    }
}

#[test]
fn all_that_can_happen_to_a_box_happens_while_the_others_tremble() {
    for margin in [0.0, 0.02] {
        let mut world = World::new(margin);
        for round in 0..90u32 {
            world.tremble(0.05);
            let id = round * 31 % BOXES;
            match round % 7 {
                0 => world.remove(id),
                1 => world.shift(id, [3.0, 0.0, 0.0]),
                2 => {
                    let filter = ProxyFilter { memberships: 2, mask: 1, ..ProxyFilter::ALL };
                    world.broad_phase.set(id, world.boxes[id as usize], filter).expect("a small id");
                }
                3 => world.broad_phase.set(id, Aabb::NOWHERE, ProxyFilter::ALL).expect("a small id"),
                4 => {
                    world.remove(id);
                    let filter = ProxyFilter { memberships: 4, mask: 2, ..ProxyFilter::ALL };
                    world.broad_phase.set(id, world.boxes[id as usize], filter).expect("a small id");
                }
                5 => {
                    // Another one at the same place, while so many leave their reach that all are searched for anew.
                    world.remove(id);
                    world.set(id);
                    (0..BOXES).step_by(16).for_each(|other| world.shift(other, [1.0, 0.0, 0.0]));
                }
                _ => {
                    world.boxes.push(world.boxes[id as usize]);
                    world.set(world.boxes.len() as u32 - 1);
                }
            }
            world.update(&format!("margin {margin}, round {round}"));
        }
        assert!(world.near > 50, "{} updates by near pairs", world.near);
    }
}

#[test]
fn few_that_move_under_a_list_are_looked_up() {
    let mut world = World::new(0.0);
    for round in 0..4 {
        world.tremble(0.05);
        world.update(&format!("trembling {round}"));
    }
    assert!(world.broad_phase.near.is_on);
    let mut events = 0;
    for round in 0..120u32 {
        // All that are near one box: of the pairs that come and go, many are of two that have moved.
        let center = world.boxes[(round % 60) as usize * 25].inflated(1.0);
        let around: Vec<u32> =
            (0..BOXES).filter(|id| center.overlaps(&world.boxes[*id as usize])).take(40).collect();
        for &id in &around {
            let by = if (id + round / 60).is_multiple_of(2) { 0.08 } else { -0.08 };
            world.shift(id, [by, 0.0, -by]);
        }
        world.update(&format!("round {round}"));
        events += world.broad_phase.events().added.len();
    }
    assert!(world.near > 100 && events > 100, "{} updates by near pairs, {events} pairs came", world.near);
}

/// More pairs than a piece of a walk has, so that threads share it.
#[test]
fn a_list_of_many_pieces_is_walked_whole() {
    let mut world = World::of(6000, 9.0);
    for round in 0..8 {
        world.tremble(0.03);
        (0..6).for_each(|k| world.shift(61 * k + round, [1.0, 1.0, 0.0]));
        world.update(&format!("round {round}"));
    }
    let made = world.broad_phase.report().checks.made;
    assert!(world.near > 4 && made > 40_000, "{} updates, {made} tests", world.near);
}

#[test]
fn a_world_that_changes_between_bitmap_and_list_has_neither_stale() {
    let mut world = World::of(1000, 5.0);
    world.broad_phase.config.strategy = Strategy::Auto;
    let mut turns = 0;
    for round in 0..40u32 {
        world.tremble(0.03);
        let was_on = world.broad_phase.near.is_on;
        world.broad_phase.small.rest_for(if round % 10 < 5 { 2 } else { 0 });
        world.update(&format!("round {round}"));
        turns += u32::from(was_on != world.broad_phase.near.is_on);
    }
    assert!(turns > 4, "{turns} turns");
}

#[test]
fn no_list_is_tried_where_filters_turn_down_most_of_what_would_be_near() {
    let mut world = World::new(0.0);
    let filter =
        |id: u32| ProxyFilter { memberships: 1 << (id % 32), mask: 1 << (id % 32), ..ProxyFilter::ALL };
    for round in 0..40 {
        for id in 0..BOXES {
            let by = world.vector();
            world.shift(id, by);
            world.broad_phase.set(id, world.boxes[id as usize], filter(id)).expect("a small id");
        }
        world.update(&format!("round {round}"));
        let made = world.broad_phase.report().checks.made;
        assert!(made < u64::from(BOXES) * 200, "{made} tests in round {round}");
    }
}

#[test]
fn what_lists_cost_decides_about_pauses() {
    let spent = |ns| Spent { ns, changed: 1.0 };
    let mut worth = Worth { usual: Some(100.0), own: spent(50.0), ..Worth::default() };
    worth.end(10);
    assert_eq!((worth.pause, worth.share()), (0, Some(0.5)), "half as much");
    assert_eq!(worth.goes_without(), None);
    assert_eq!(Worth::default().goes_without(), Some(NoNear::Unmeasured));
    (1..8).for_each(|_| worth.end(10));
    assert_eq!(worth.goes_without(), Some(NoNear::Compared), "after eight of them");
    worth.own = spent(95.0);
    let pauses = [0; 9].map(|_| {
        worth.end(10);
        worth.pause
    });
    assert_eq!(pauses, [10, 21, 43, 87, 128, 128, 128, 128, 128]);
    worth.own = spent(1.0);
    worth.end(1);
    assert_eq!(worth.pause, 128, "cheap, but it has not lasted");
    assert_eq!(worth.goes_without(), Some(NoNear::Unpaid(127)));
}

#[test]
fn the_skin_of_what_swings_shrinks_to_what_it_needs() {
    let mut world = World::new(0.0);
    let mut checks = vec![];
    for round in 0..40u32 {
        let by = if round % 2 == 0 { 0.05 } else { -0.05 };
        (0..BOXES).for_each(|id| world.shift(id, [by, by, 0.0]));
        world.update(&format!("round {round}"));
        if world.broad_phase.report().plan.chosen == Chosen::Near {
            checks.push(world.broad_phase.report().checks.made);
        }
    }
    let (plan, near) = (&world.broad_phase.report().plan, &world.broad_phase.near);
    let told = plan.near.expect("a list");
    assert_eq!((told.skin, told.pairs, told.age), (near.skin.width, near.list.len() as u64, near.age));
    let text = plan.to_string();
    assert!(
        text.contains(&format!("with a skin of {}", told.skin)) && text.contains("near pairs take 0."),
        "{text}"
    );
    assert!(checks.len() > 30 && 4 * checks[checks.len() - 1] < 3 * checks[0], "{checks:?}");
}

#[test]
fn boxes_that_jump_far_are_seldom_tried_with_a_list() {
    let mut world = World::new(0.0);
    let (mut updates, mut whys) = (0, BTreeSet::new());
    for round in 0..100u32 {
        (0..BOXES).for_each(|id| {
            world.boxes[id as usize] = Aabb::from_center(world.vector().map(|x| 7.0 * x), [0.5; 3]);
            world.set(id);
        });
        world.update(&format!("round {round}"));
        updates += u32::from(world.broad_phase.near.is_on);
        let plan = &world.broad_phase.report().plan;
        let why = plan.no_near.map_or(String::new(), |why| format!("; no near pairs: {why}"));
        assert!(plan.near.is_some() || !why.is_empty() && plan.to_string().contains(&why), "{plan}");
        whys.insert(why);
    }
    assert!(updates <= 8, "{updates} lists");
    assert!(whys.len() > 10 && whys.iter().any(|why| why.contains("too many would be near")), "{whys:?}");
}

/// What was expected to be few is not, and the list before is gone already.
#[test]
fn a_search_that_finds_too_many_for_a_list_leaves_pairs_to_another_one() {
    let mut world = World::new(0.0);
    for round in 0..6u32 {
        world.tremble(0.02);
        world.update(&format!("round {round}"));
    }
    assert!(world.broad_phase.near.is_on);
    (0..BOXES).step_by(100).for_each(|id| world.remove(id));
    for id in (0..BOXES).filter(|id| id % 100 != 0) {
        let center = world.vector().map(|x| 1.5 * x);
        world.boxes[id as usize] = Aabb::from_center(center, [0.5; 3]);
        world.set(id);
    }
    world.broad_phase.near.met = 0;
    world.update("a heap");
    let plan = &world.broad_phase.report().plan;
    assert!(matches!(plan.no_near, Some(NoNear::Many(_))) && !world.broad_phase.near.is_on, "{plan}");
    world.broad_phase.near.worth.pause = 0;
    world.tremble(0.02);
    world.update("after");
}

#[test]
fn too_many_new_pairs_leave_all_as_it_was() {
    let mut world = World::new(0.0);
    for round in 0..6u32 {
        world.tremble(0.02);
        world.update(&format!("round {round}"));
    }
    assert!(world.broad_phase.near.is_on);
    let limits = world.broad_phase.config.limits;
    for after in ["a list", "no list"] {
        let before: BTreeSet<Pair> = world.broad_phase.pairs().collect();
        world.tremble(0.02);
        world.broad_phase.config.limits = Limits { max_pairs: 1, ..limits };
        assert_eq!(world.broad_phase.update(), Err(Error::TooManyPairs { limit: 1 }), "after {after}");
        assert_eq!(world.broad_phase.events(), &Events::default());
        assert_eq!(world.broad_phase.pairs().collect::<BTreeSet<_>>(), before, "after {after}");
        world.broad_phase.config.limits = limits;
        world.update(after);
    }
}

#[test]
fn a_list_that_has_not_paid_is_followed_by_ever_longer_pauses() {
    let mut world = World::new(0.0);
    let (mut lists, mut was_on) = (0, false);
    for round in 0..200u32 {
        world.tremble(0.05);
        world.broad_phase.near.worth.usual = Some(0.0);
        world.broad_phase.update().expect("within the limits");
        let is_on = world.broad_phase.near.is_on;
        lists += u32::from(is_on && !was_on);
        was_on = is_on;
        // All leave their reach.
        if is_on && round % 3 == 0 {
            (0..BOXES).for_each(|id| world.shift(id, [1.0, 0.0, 0.0]));
        }
    }
    assert!((3..9).contains(&lists), "{lists} lists");
}

#[test]
fn a_skin_stays_where_boxes_have_only_just_got_it() {
    let mut skin = Skin::default();
    skin.begin(0.4, 10);
    assert_eq!(skin.enough(10), None, "they have not been anywhere yet");
}

#[test]
fn a_skin_grows_while_few_pairs_are_near_and_no_wider_than_that() {
    let mut skin = Skin::default();
    let mut widths = vec![skin.moves];
    for _ in 0..20 {
        skin.learn(1000, 10, 0);
        widths.push(skin.moves);
    }
    assert!(widths.is_sorted() && widths[..8].windows(2).all(|two| two[0] < two[1]), "{widths:?}");
    assert_eq!(widths.last(), Some(&64.0));
    skin.learn(1000, 10, 2400);
    assert_eq!(skin.moves, 64.0, "tests cost as much as searches");
    skin.learn(1000, 10, 4000);
    assert!(skin.moves < 64.0, "tests cost more");
}
