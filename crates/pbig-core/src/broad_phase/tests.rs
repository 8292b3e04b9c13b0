//! What is taken in: which boxes count, and when one has changed.

mod study;

use super::BroadPhase;
use crate::plan::Chosen;
use crate::{Aabb, Config, Events, Pair, ProxyFilter, Strategy, oracle};

const MARGIN: f32 = 0.1;

fn broad_phase() -> BroadPhase {
    BroadPhase::new(Config { margin: MARGIN, ..Config::DEFAULT }).expect("a margin")
}

fn cube() -> Aabb {
    Aabb::from_center([3.0, -2.0, 1.0], [0.5; 3])
}

/// The cube, one side of which has moved outward.
fn with_side(side: usize, by: f32) -> Aabb {
    let mut aabb = cube();
    if side < 3 {
        aabb.min[side] -= by;
    } else {
        aabb.max[side - 3] += by;
    }
    aabb
}

#[test]
fn a_box_has_changed_once_any_side_leaves_its_margin_or_has_shrunk_by_more() {
    for side in 0..6 {
        for (by, changes) in [(0.05, 0), (0.15, 1), (-0.05, 0), (-0.15, 1)] {
            let mut broad_phase = broad_phase();
            broad_phase.set(0, cube(), ProxyFilter::ALL).expect("a small id");
            broad_phase.update().expect("one box");
            broad_phase.set(0, with_side(side, by), ProxyFilter::ALL).expect("a small id");
            assert_eq!(broad_phase.changes().count(), changes, "side {side} by {by}");
        }
    }
}

#[test]
fn boxes_that_are_invalid_are_there_and_do_not_count_in_the_plan() {
    let mut broad_phase = broad_phase();
    for (id, aabb) in [cube(), Aabb::NOWHERE, cube()].into_iter().enumerate() {
        broad_phase.set(id as u32, aabb, ProxyFilter::ALL).expect("a small id");
    }
    broad_phase.update().expect("three boxes");
    let report = broad_phase.report();
    assert_eq!((report.boxes, report.invalid, report.plan.boxes), (3, 1, 2));
    let idle = |broad_phase: &mut BroadPhase| {
        broad_phase.update().expect("nothing new");
        broad_phase.report().plan.to_string()
    };
    assert_eq!(idle(&mut broad_phase), "nothing to do: no box has changed");
    broad_phase.remove(0);
    broad_phase.update().expect("two boxes");
    assert_eq!(idle(&mut broad_phase), "nothing to do: fewer than two valid boxes");
}

/// An update of a small world in which boxes swing against their neighbours, one goes, and now and then few move.
fn swing(broad_phase: &mut BroadPhase, frame: u32, ids: u32) -> (Chosen, Events) {
    let at = |id: u32| {
        let swing = 0.25 * (frame as f32 * 0.5 + id as f32).sin();
        let x = (id % 20 / 2 * 5) as f32 + (id % 2) as f32 * 1.2 + swing;
        Aabb::from_center([x, (id / 20 * 3) as f32, 0.0], [0.5; 3])
    };
    let step = if frame % 200 > 190 { 50 } else { 1 };
    for id in (0..ids).step_by(step) {
        broad_phase.set(id, at(id), ProxyFilter::ALL).expect("a small id");
    }
    broad_phase.remove(frame % ids);
    let events = broad_phase.update().expect("few pairs").clone();
    (broad_phase.report().plan.chosen, events)
}

#[test]
fn bitmap_grid_and_near_pairs_take_turns_in_a_small_world_and_tell_the_same() {
    let of =
        |strategy| BroadPhase::new(Config { strategy, margin: 0.01, ..Config::DEFAULT }).expect("a margin");
    let (mut auto, mut grid) = (of(Strategy::Auto), of(Strategy::Grid));
    let (mut ways, mut events, mut told) = (Vec::new(), 0, 0);
    for frame in 0..600 {
        let (way, found) = swing(&mut auto, frame, 400);
        assert_eq!(found, swing(&mut grid, frame, 400).1, "frame {frame}, by {way:?}");
        events += found.added.len() + found.removed.len();
        ways.push(way);
        let measured = auto.report().plan.measured.grid;
        assert_eq!(auto.report().plan.to_string().contains("; a grid takes "), measured.is_some());
        assert_eq!(grid.report().plan.measured.grid, None, "there are no turns");
        told += u32::from(measured > Some(0.0));
    }
    for way in [Chosen::Bitmap, Chosen::Grid, Chosen::Near] {
        assert!(ways.contains(&way), "never by {way:?}: {ways:?}");
    }
    assert!(ways[..24].iter().all(|way| *way == Chosen::Bitmap) && ways[24] == Chosen::Grid);
    assert!(events > 1000, "{events}");
    assert!(told > 100, "the report told {told} times");
}

#[test]
fn threads_that_share_an_update_by_near_pairs_miss_none_of_those_who_leave() {
    const IDS: u32 = 20_000;
    let of =
        |strategy| BroadPhase::new(Config { strategy, margin: 0.01, ..Config::DEFAULT }).expect("a margin");
    let (mut auto, mut pbig) = (of(Strategy::Auto), of(Strategy::Pbig));
    let ids: Vec<u32> = (0..IDS).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
    let (mut by_near, mut events) = (0, 0);
    for frame in 0..12_u32 {
        let at = |id: u32| {
            // One in a thousand jumps into the place of another.
            let jumps = frame > 5 && (id + 100 * frame).is_multiple_of(1000);
            let place = if jumps { id.wrapping_mul(2_654_435_761) % IDS } else { id };
            let swing = 0.1 * (frame as f32 + id as f32).sin();
            let center = [place % 30, place / 30 % 30, place / 900].map(|i| i as f32 * 1.15 + swing);
            Some((Aabb::from_center(center, [0.5; 3]), ProxyFilter::ALL))
        };
        pool.install(|| auto.set_many(&ids, |id| id, at).and_then(|()| auto.update().map(|_| ())))
            .expect("few pairs");
        for &id in &ids {
            let (aabb, filter) = at(id).expect("a box");
            pbig.set(id, aabb, filter).expect("a small id");
        }
        assert_eq!(auto.events(), pbig.update().expect("few pairs"), "frame {frame}");
        let mut pairs: Vec<Pair> = auto.pairs().collect();
        pairs.sort_unstable();
        assert!(frame % 4 != 3 || pairs == oracle::pairs(&auto.boxes), "frame {frame}");
        by_near += u32::from(auto.report().plan.chosen == Chosen::Near);
        events += auto.events().added.len();
    }
    assert!(by_near > 5 && events > 10_000, "{by_near} by near pairs, {events} new pairs");
}

#[test]
fn few_that_jump_are_edited_and_many_searched_for_anew_and_the_report_says_what_an_edit_costs() {
    const IDS: u32 = 2000;
    let mut broad_phase =
        BroadPhase::new(Config { strategy: Strategy::Grid, ..Config::DEFAULT }).expect("a margin");
    assert_eq!(broad_phase.config().strategy, Strategy::Grid);
    assert_eq!(broad_phase.report().plan.measured.edit, None);
    let mut ways = vec![];
    for frame in 0..20_u32 {
        let one_in = [40, 2][frame as usize % 2].min(1 + 40 * frame as usize);
        for id in (0..IDS).step_by(one_in) {
            let place = (id + 1).wrapping_mul(2_654_435_761).wrapping_mul(frame + 1) >> 8;
            let center = [place % 13, place / 13 % 13, place / 169 % 13].map(|i| i as f32 * 1.1);
            broad_phase.set(id, Aabb::from_center(center, [0.5; 3]), ProxyFilter::ALL).expect("a small id");
        }
        broad_phase.update().expect("few pairs");
        ways.push(broad_phase.report().plan.chosen);
        let mut pairs: Vec<Pair> = broad_phase.pairs().collect();
        pairs.sort_unstable();
        assert_eq!(pairs, oracle::pairs(&broad_phase.boxes), "frame {frame}");
    }
    let wanted: Vec<Chosen> =
        (0..20).map(|frame| if frame % 2 == 0 { Chosen::Edit } else { Chosen::Grid }).collect();
    assert_eq!(ways[1..], wanted[1..]);
    let plan = &broad_phase.report().plan;
    assert!(plan.measured.edit > Some(0.0) && plan.to_string().contains("the edit of a box"), "{plan}");
}
