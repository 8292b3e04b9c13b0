//! Each way that can be asked for is taken, and tells what the oracle does.

use crate::plan::{Chosen, NoGpu, NoNear, Plan};
use crate::{
    Aabb, Backend, BroadPhase, Config, Costs, Events, Finder, Grids, Look, Pair, ProxyFilter, Study, Updates,
    oracle,
};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::collections::BTreeSet;

const IDS: u32 = 300;

const UPDATES: [Updates; 4] = [Updates::Auto, Updates::Edits, Updates::Anew, Updates::Near];

/// Boxes at random places in a cube of an edge.
fn boxes(count: u32, edge: f32, half: f32) -> Vec<Aabb> {
    let mut rng = StdRng::seed_from_u64(1);
    let mut at = || std::array::from_fn(|_| rng.random_range(0.0..edge));
    (0..count).map(|_| Aabb::from_center(at(), [half; 3])).collect()
}

fn shifted(aabb: &Aabb, by: f32) -> Aabb {
    Aabb::new(aabb.min.map(|x| x + by), aabb.max.map(|x| x + by))
}

fn broad_phase(updates: Updates) -> BroadPhase {
    let study = Study { updates, ..Study::DEFAULT };
    BroadPhase::new(Config { study, ..Config::DEFAULT }).expect("a margin")
}

/// Plays frames in which one box in so many swings, by each way, and holds events against the oracle; for each way the plans
/// after the first update.
fn play(one_in: usize) -> [Vec<Plan>; 4] {
    let mut now = boxes(IDS, 6.0, 0.5);
    let home = now.clone();
    let mut all = UPDATES.map(broad_phase);
    let (mut plans, mut before) = ([const { vec![] }; 4], BTreeSet::new());
    for frame in 0..10_u32 {
        let moved: Vec<u32> = (0..IDS).step_by(if frame == 0 { 1 } else { one_in }).collect();
        moved.iter().for_each(|&id| {
            now[id as usize] = shifted(&home[id as usize], 0.05 * ((frame + id) as f32).sin())
        });
        let pairs: BTreeSet<Pair> = oracle::pairs(&now).into_iter().collect();
        let [added, removed] =
            [(&pairs, &before), (&before, &pairs)].map(|(a, b)| a.difference(b).copied().collect());
        let wanted = Events { added, removed };
        for ((of, plans), updates) in all.iter_mut().zip(&mut plans).zip(UPDATES) {
            moved.iter().for_each(|&id| of.set(id, now[id as usize], ProxyFilter::ALL).expect("a small id"));
            assert_eq!(of.update().expect("few pairs"), &wanted, "{updates:?}, frame {frame}");
            plans.push(of.report().plan.clone());
        }
        before = pairs;
    }
    plans.iter_mut().for_each(|plans| _ = plans.remove(0));
    plans
}

#[test]
fn events_are_the_same_by_every_way_and_the_report_says_which_was_taken() {
    for one_in in [1, 3, 30] {
        let [auto, edits, anew, near] = play(one_in);
        let chosen = |plans: &[Plan], way| plans.iter().filter(|plan| plan.chosen == way).count();
        assert_eq!(chosen(&auto, Chosen::Bitmap), 9, "so few boxes have a bitmap");
        // Where all move, those that have left their cells are too many in every other update.
        let least = if one_in == 1 { 3 } else { 7 };
        assert!(chosen(&edits, Chosen::Edit) >= least, "one in {one_in}: {}", chosen(&edits, Chosen::Edit));
        assert_eq!(chosen(&edits, Chosen::Edit) + chosen(&edits, Chosen::Grid), 9);
        assert_eq!(chosen(&anew, Chosen::Grid), 9);
        assert!(near.iter().all(|plan| plan.near.is_some()), "{near:?}");
        assert!(near.iter().any(|plan| plan.chosen == Chosen::Near), "one in {one_in}: {near:?}");
        for plan in edits.iter().chain(&anew) {
            assert!(plan.near.is_none() && plan.measured.near.is_none() && plan.measured.edit.is_none());
        }
        // Where few change there is not always a question of a list.
        let is_told = |plan: &Plan| plan.no_near == Some(NoNear::Unwanted);
        assert!(one_in == 30 || edits.iter().chain(&anew).all(is_told), "{anew:?}");
        let words = "; no near pairs: another way is asked for";
        assert_eq!(anew[8].to_string().contains(words), is_told(&anew[8]));
    }
}

/// A list of far more pairs than would ever pay is made where one is asked for, and none that would fill the memory.
#[test]
fn a_list_is_made_whatever_it_costs_but_memory() {
    for (distance, ids, has_list) in [(0.3, IDS, true), (40.0, IDS, true), (40.0, 1000, false)] {
        let (start, mut of) = (boxes(ids, 6.0, 0.5), broad_phase(Updates::Near));
        for frame in 0..3_u32 {
            for (id, aabb) in (0..).zip(&start) {
                let by = distance * ((id + frame) as f32).sin();
                of.set(id, shifted(aabb, by), ProxyFilter::ALL).expect("a small id");
            }
            of.update().expect("few pairs");
        }
        let plan = &of.report().plan;
        assert_eq!(plan.near.is_some(), has_list, "{plan}");
        assert!(has_list || plan.no_near == Some(NoNear::Many(0)), "{plan}");
    }
}

fn find(boxes: &[Aabb], study: Study) -> Plan {
    find_by(boxes, study, Costs::REFERENCE)
}

fn find_by(boxes: &[Aabb], study: Study, costs: Costs) -> Plan {
    let config = Config { study, costs: Some(costs), brute_below: 0, ..Config::DEFAULT };
    let mut finder = Finder::new(config);
    assert_eq!(finder.find(boxes).expect("few pairs"), oracle::pairs(boxes), "{study:?}");
    finder.report().plan.clone()
}

#[test]
fn one_grid_or_levels_are_made_where_they_can_be() {
    let of = |boxes: &[Aabb], grids| find(boxes, Study { grids, ..Study::DEFAULT });
    let mut mixed = boxes(600, 12.0, 0.01);
    mixed.extend(boxes(60, 12.0, 1.5));
    // By costs by which the plan itself takes one grid, and others by which it takes levels.
    let dear = Costs { visit: 1e6, test: 1e6, ..Costs::REFERENCE };
    let cheap = Costs { visit: 1.0, visited: 0.1, candidate: 10.0, ..Costs::REFERENCE };
    for (costs, parted) in [(dear, false), (cheap, true)] {
        let by = |grids| find_by(&mixed, Study { grids, ..Study::DEFAULT }, costs);
        let are_parted = |plan: &Plan| plan.levels.len() > 1 || plan.swept > 0;
        for (grids, wanted) in [(Grids::Auto, parted), (Grids::One, false), (Grids::Levels, true)] {
            let plan = by(grids);
            assert!(plan.chosen == Chosen::Grid && are_parted(&plan) == wanted, "{grids:?}: {plan}");
        }
    }
    let alike = boxes(600, 12.0, 0.5);
    let (auto, levels) = (of(&alike, Grids::Auto), of(&alike, Grids::Levels));
    assert_eq!((levels.chosen, &levels.levels, levels.swept), (auto.chosen, &auto.levels, 0), "of one size");
    // A crowd of small boxes in one cell of the large ones, which would part them.
    let mut crowd = boxes(500, 60.0, 5.0);
    crowd.extend(boxes(400, 0.5, 0.0005));
    let (auto, one) = (of(&crowd, Grids::Auto), of(&crowd, Grids::One));
    assert!(auto.levels.len() > 1 && one.levels.len() == 1 && one.swept == 0, "{auto}\n{one}");
}

#[test]
fn the_rows_that_are_asked_for_are_looked_at_and_told() {
    let of = |boxes: &[Aabb], look| find(boxes, Study { look, grids: Grids::One, ..Study::DEFAULT });
    let names = [(Look::Everywhere, "everywhere"), (Look::Trimmed, "trimmed"), (Look::Seldom, "seldom")];
    for (edge, by_itself) in [(40.0, "seldom"), (9.0, "everywhere"), (3.0, "trimmed")] {
        let boxes = boxes(500, edge, 0.5);
        for (look, name) in names.into_iter().chain([(Look::Auto, by_itself)]) {
            let plan = of(&boxes, look);
            assert_eq!(plan.looks.to_string(), name, "in {edge}: {plan}");
            assert!(plan.to_string().contains(&format!("; rows looked at: {name}")), "{plan}");
        }
    }
}

#[test]
fn rows_are_told_by_level_and_not_where_none_is_searched() {
    let mut mixed = boxes(600, 12.0, 0.01);
    mixed.extend(boxes(60, 12.0, 1.5));
    let plan = find(&mixed, Study { grids: Grids::Levels, look: Look::Trimmed, ..Study::DEFAULT });
    assert_eq!(plan.looks.trimmed as usize, plan.levels.len(), "{plan}");
    assert_eq!((plan.looks.everywhere, plan.looks.seldom), (0, 0));
    let looks = |trimmed, seldom| crate::plan::Looks { everywhere: 0, trimmed, seldom }.to_string();
    assert_eq!(
        [looks(2, 1), looks(1, 2), looks(0, 0)],
        ["trimmed in 2 levels, seldom in 1", "trimmed in 1 level, seldom in 2", "none"]
    );
    let [auto, edits, _, near] = play(30);
    let searched = |plan: &&Plan| plan.chosen == Chosen::Grid;
    for plan in auto.iter().chain(&edits).chain(&near).filter(|plan| !searched(plan)) {
        assert!(!plan.to_string().contains("rows looked at"), "{plan}");
    }
}

#[test]
fn the_report_says_why_no_device_was_asked_where_that_was_left_open() {
    let why = if cfg!(feature = "gpu") { NoGpu::NotGiven } else { NoGpu::NotBuilt };
    let (some, few) = (boxes(100, 6.0, 0.5), boxes(2, 1.0, 0.5));
    for (backend, told) in [(Backend::Auto, Some(why)), (Backend::Cpu, None), (Backend::Brute, None)] {
        let config = Config { backend, ..Config::DEFAULT };
        let (mut finder, mut of) = (Finder::new(config), BroadPhase::new(config).expect("a margin"));
        for boxes in [&some, &few] {
            finder.find(boxes).expect("few pairs");
            (0..).zip(boxes).for_each(|(id, aabb)| of.set(id, *aabb, ProxyFilter::ALL).expect("a small id"));
            of.update().expect("few pairs");
            for plan in [&finder.report().plan, &of.report().plan] {
                assert_eq!(plan.no_gpu, told, "{backend:?}: {plan}");
                let says = told.is_some_and(|why| plan.to_string().contains(&format!("; no GPU: {why}")));
                assert_eq!(says, told == Some(NoGpu::NotGiven), "{plan}");
            }
        }
        of.update().expect("nothing new");
        assert_eq!(of.report().plan.no_gpu, None, "nobody could have been asked");
        let mut finder = Finder::new(config);
        finder.find(&few[..1]).expect("no pairs");
        assert!(!finder.report().plan.to_string().contains("GPU"), "there was nothing to do");
    }
}
