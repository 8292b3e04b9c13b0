//! Lists in worlds in which few boxes move.

use super::{BOXES, World};
use crate::broad_phase::measured::Spent;
use crate::broad_phase::near::policy::Movers;
use crate::broad_phase::near::worth::Worth;
use crate::broad_phase::update::Route;
use crate::broad_phase::{Events, flag};
use crate::{Aabb, Error, Limits, Pair, ProxyFilter};
use std::collections::BTreeSet;
use std::time::Duration;

/// Less than one in eight.
const MOVERS: u32 = BOXES / 9;

impl World {
    /// Always the same boxes; they are not near each other.
    fn tremble_few(&mut self, by: f32) {
        for id in (0..BOXES).step_by(9) {
            let by = self.vector().map(|x| by * x);
            self.shift(id, by);
        }
    }

    /// One of the six things that can happen to a box.
    fn change(&mut self, kind: u32, id: u32) {
        let aabb = self.boxes[id as usize];
        match kind {
            0 => self.remove(id),
            1 => self.shift(id, [2.0, 0.0, 0.0]),
            2 => {
                let filter = ProxyFilter { memberships: 2, mask: 1, ..ProxyFilter::ALL };
                self.broad_phase.set(id, aabb, filter).expect("a small id");
            }
            3 => self.broad_phase.set(id, Aabb::NOWHERE, ProxyFilter::ALL).expect("a small id"),
            4 => {
                self.remove(id);
                self.set(id);
            }
            _ => {
                self.boxes.push(aabb);
                self.set(self.boxes.len() as u32 - 1);
            }
        }
    }

    /// After updates of the same few: a list that has begun with the pairs that existed.
    fn with_few_movers(margin: f32) -> Self {
        let mut world = Self::new(margin);
        let mut round = 0;
        while !world.broad_phase.near.is_on {
            world.tremble_few(0.05);
            world.update(&format!("trembling {round}"));
            round += 1;
            assert!(round < 20, "no list");
        }
        let searched = world.broad_phase.report().checks.made;
        assert!(
            world.broad_phase.near.away.is_empty() && searched < 60 * u64::from(MOVERS),
            "{searched} tests"
        );
        world
    }
}

#[test]
fn where_the_same_few_move_only_they_get_reaches() {
    let mut world = World::with_few_movers(0.0);
    let near = &world.broad_phase.near;
    let grown = (0..BOXES as usize).filter(|&i| near.reach[i] != world.boxes[i]).count();
    assert_eq!(grown, MOVERS as usize + 1);
    for round in 0..60 {
        world.tremble_few(0.05);
        world.update(&format!("round {round}"));
    }
    assert!(world.near > 40, "{} updates by near pairs", world.near);
}

#[test]
fn a_list_for_few_has_an_index_from_the_first_unless_many_near_pairs_are_theirs() {
    assert!(!World::with_few_movers(0.0).broad_phase.near.list.has_index());
    let mut world = World::new(0.0);
    for round in 0..60 {
        if world.broad_phase.near.is_on {
            break;
        }
        // So many that it goes by their near pairs.
        (0..BOXES).step_by(20).for_each(|id| world.shift(id, [0.02, 0.0, 0.0]));
        world.update(&format!("round {round}"));
    }
    assert!(world.broad_phase.near.is_on && world.broad_phase.near.list.has_index());
}

#[test]
fn any_other_box_may_move_and_change_too() {
    for margin in [0.0, 0.02] {
        let mut world = World::with_few_movers(margin);
        for round in 0..90u32 {
            world.tremble_few(0.04);
            let id = round * 31 % BOXES;
            world.change(round % 6, id);
            world.update(&format!("margin {margin}, round {round}"));
        }
        assert!(world.near > 60, "{} updates by near pairs", world.near);
    }
}

/// What has happened in the very update in which the list begins.
#[test]
fn a_list_may_begin_while_boxes_come_go_and_change() {
    let few = World::with_few_movers(0.0).broad_phase.updates;
    for change in 0..6 {
        let mut world = World::new(0.0);
        for _ in 1..few - 1 {
            world.tremble_few(0.05);
            world.update("before");
        }
        assert!(!world.broad_phase.near.is_on);
        world.tremble_few(0.05);
        (4..BOXES).step_by(150).for_each(|id| world.change(change, id));
        world.update(&format!("change {change}"));
        assert!(world.broad_phase.near.is_on, "change {change}");
        world.tremble_few(0.05);
        world.update(&format!("after change {change}"));
    }
}

#[test]
fn too_many_new_pairs_in_the_update_that_begins_a_list_leave_all_as_it_was() {
    let few = World::with_few_movers(0.0).broad_phase.updates;
    let mut world = World::new(0.0);
    for _ in 1..few - 1 {
        world.tremble_few(0.05);
        world.update("before");
    }
    let (limits, before) =
        (world.broad_phase.config.limits, world.broad_phase.pairs().collect::<BTreeSet<Pair>>());
    world.tremble_few(0.3);
    world.broad_phase.config.limits = Limits { max_pairs: 1, ..limits };
    assert_eq!(world.broad_phase.update(), Err(Error::TooManyPairs { limit: 1 }));
    assert_eq!(world.broad_phase.events(), &Events::default());
    assert_eq!(world.broad_phase.pairs().collect::<BTreeSet<_>>(), before);
    world.broad_phase.config.limits = limits;
    world.update("as it should");
}

#[test]
fn a_list_that_costs_more_than_none_is_given_up() {
    let list = |age, ns| {
        let (own, unasked) = (Spent { ns: 1e6, changed: 12.0 }, Spent { ns, changed: 10.0 });
        Worth { usual: Some(100.0), own, unasked, ..Worth::default() }.goes_on(age)
    };
    assert!(list(16, 850.0), "85 a box");
    assert!(!list(16, 950.0) && !list(64, 950.0), "95");
    assert!(list(17, 1e9) && list(8, 1e9), "not asked");
    // The first eight updates may cost what they will, and those in which next to nothing changes.
    let mut worth = Worth { usual: Some(100.0), ..Worth::default() };
    let near = |worth: &mut Worth, changed, ns| {
        worth.note_time(Route::Near, changed, 1000, Duration::from_nanos(ns));
    };
    for (age, changed, ns) in [(8, 100, 1_000_000), (16, 100, 8000), (32, 1, 1_000_000)] {
        near(&mut worth, changed, ns);
        assert!(worth.goes_on(age), "after {age} updates");
    }
    near(&mut worth, 100, 1_000_000);
    assert!(!worth.goes_on(64));

    let mut world = World::with_few_movers(0.0);
    let mut lasted = 0;
    while world.broad_phase.near.is_on {
        world.tremble_few(0.01);
        world.broad_phase.near.worth.usual = Some(0.0);
        world.broad_phase.update().expect("within the limits");
        lasted += 1;
    }
    assert_eq!(lasted, 16);
}

#[test]
fn movers_are_the_same_where_most_have_moved_before_and_not_long_ago() {
    let (mut movers, mut flags) = (Movers::default(), vec![0; 100]);
    let mut are_the_same = |ids: std::ops::Range<u32>| {
        let ids: Vec<u32> = ids.collect();
        let are = Movers::are_most_of(&ids, &flags);
        movers.begin(ids.len(), &mut flags);
        ids.iter().for_each(|&id| flags[id as usize] |= flag::MOVED);
        are
    };
    assert_eq!([0..8, 0..8, 3..11, 20..22, 0..2].map(&mut are_the_same), [false, true, true, false, false]);
    assert_eq!([40..48, 44..52, 43..49].map(&mut are_the_same), [false, false, true]);
    assert!((0..200).all(|k| !are_the_same(k * 10 % 100..k * 10 % 100 + 10)), "each in its turn");
    assert!(!Movers::are_most_of(&[], &[]));
}

/// So few that they are looked up, from the first update on; some with filters, and one without an end.
#[test]
fn very_few_that_move_are_looked_up() {
    let mut world = World::new(0.0);
    let filter = ProxyFilter { memberships: 2, mask: 2, ..ProxyFilter::ALL };
    for id in (0..BOXES).step_by(80) {
        world.broad_phase.set(id, world.boxes[id as usize], filter).expect("a small id");
    }
    let long = Aabb { min: [-50.0, 0.0, 0.0], max: [f32::INFINITY, 0.1, 0.1] };
    world.broad_phase.set(77, long, ProxyFilter::ALL).expect("a small id");
    let mut made = vec![];
    for round in 0..60u32 {
        for id in (0..BOXES).step_by(40) {
            let (by, kept) = (world.vector(), *world.broad_phase.filter(id).expect("it is there"));
            let add = |corner: [f32; 3]| std::array::from_fn(|k| corner[k] + 0.1 * by[k]);
            let Aabb { min, max } = world.boxes[id as usize];
            world.boxes[id as usize] = Aabb::new(add(min), add(max));
            world.broad_phase.set(id, world.boxes[id as usize], kept).expect("a small id");
        }
        world.update(&format!("round {round}"));
        if world.broad_phase.near.is_on {
            made.push(world.broad_phase.report().checks.made);
        }
    }
    assert!(made.len() > 40, "{} updates by near pairs", made.len());
    assert!(made.iter().all(|made| *made < 2000), "never all pairs: {made:?}");
}
