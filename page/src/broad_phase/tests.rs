//! A world keeps every pair, and no other, when its broad phase changes.

use super::*;
use crate::Run;
use std::collections::BTreeSet;

/// Largest distance, in metres, of two AABBs whose fat AABBs overlap: a margin of 1 cm for each, on both broad phases, and
/// what a collider moves before its fat AABB is stored again.
const FAR: f32 = 0.1;

type Pairs = BTreeSet<[(u32, u32); 2]>;

fn aabb(collider: &Collider, loosened: f32) -> Aabb {
    collider.compute_aabb().loosened(loosened)
}

/// Returns the pairs of colliders, one of them movable, whose AABBs overlap after they grow by `loosened` on each side.
fn overlapping(world: &World, loosened: f32) -> Pairs {
    let is_dynamic = |it: &Collider| it.parent().is_some_and(|body| world.bodies[body].is_dynamic());
    let all: Vec<_> = world.colliders.iter().collect();
    let mut pairs = Pairs::new();
    for (at, (one, a)) in all.iter().enumerate() {
        for (other, b) in &all[at + 1..] {
            let can_touch = (is_dynamic(a) || is_dynamic(b)) && a.parent() != b.parent();
            if can_touch && aabb(a, loosened).intersects(&aabb(b, loosened)) {
                pairs.insert(sorted(ColliderPair::new(*one, *other)));
            }
        }
    }
    pairs
}

/// Compares the narrow phase's pairs with brute force.
fn check(world: &World) -> Result<(), String> {
    let pairs: Pairs = world.pairs().map(sorted).collect();
    let missing: Vec<_> = overlapping(world, 0.0).difference(&pairs).copied().collect();
    let near = overlapping(world, FAR);
    let is_far = |pair: &&[(u32, u32); 2]| !near.contains(*pair) && !has_fixed(world, pair);
    let stale: Vec<_> = pairs.iter().filter(is_far).collect();
    if missing.is_empty() && stale.is_empty() { Ok(()) } else { Err(format!("{missing:?} {stale:?}")) }
}

/// Stock also reports pairs of fixed colliders.
fn has_fixed(world: &World, pair: &[(u32, u32); 2]) -> bool {
    let handle = |(index, generation)| ColliderHandle::from_raw_parts(index, generation);
    pair.iter().all(|raw| world.colliders[handle(*raw)].parent().is_none())
}

/// Runs a scene that changes its broad phase every `period` steps, and checks each step.
fn run(scene: &str, period: u32, change: fn(&mut Run, Choice)) -> Result<(), String> {
    let mut run = Run::new(scene, 150, 1, Choice::Pbig)?;
    for step in 1..=120 {
        run.step()?;
        check(&run.world).map_err(|why| format!("{scene}, step {step}: {why}"))?;
        if step % period == 0 {
            let is_stock = (step / period) % 2 == 1;
            change(&mut run, if is_stock { Choice::Stock } else { Choice::Pbig });
        }
    }
    Ok(())
}

#[test]
fn a_change_loses_no_pair_and_leaves_none_behind() {
    for scene in ["column", "pyramid", "sleeping", "ragdolls", "sensors"] {
        for period in [1, 7, 30] {
            run(scene, period, Run::change_broad_phase).unwrap();
        }
    }
}

/// Returns two runs of the same world after ten steps.
fn twins(choice: Choice) -> [Run; 2] {
    [(); 2].map(|()| {
        let mut run = Run::new("sleeping", 150, 1, choice).unwrap();
        for _ in 0..10 {
            run.step().unwrap();
        }
        run
    })
}

fn sleepers(world: &World) -> HashSet<RigidBodyHandle> {
    world.bodies.iter().filter(|(_, body)| body.is_sleeping()).map(|(handle, _)| handle).collect()
}

/// Compares the sleeping bodies of two runs in ten further steps; the first run has been changed.
fn check_sleepers([mut changed, mut other]: [Run; 2]) -> Result<(), String> {
    for step in 1..=10 {
        changed.step()?;
        other.step()?;
        let [left, expected] = [&changed, &other].map(|run| sleepers(&run.world));
        assert!(expected.len() > 100, "too few sleep: {}", expected.len());
        let woken: Vec<_> = expected.difference(&left).collect();
        if left != expected {
            return Err(format!("step {step}: woken: {woken:?}"));
        }
    }
    Ok(())
}

#[test]
fn a_change_wakes_no_body() {
    for [before, after] in [[Choice::Stock, Choice::Pbig], [Choice::Pbig, Choice::Stock]] {
        let mut runs = twins(before);
        runs[0].change_broad_phase(after);
        check_sleepers(runs).unwrap();
    }
}

/// Rapier wakes the bodies of colliders that are marked as moved in the world itself.
#[test]
fn the_check_notices_bodies_that_a_change_wakes() {
    let mut runs = twins(Choice::Pbig);
    runs[0].change_broad_phase(Choice::Stock);
    runs[0].world.colliders = marked_colliders(&runs[0].world);
    assert!(check_sleepers(runs).is_err());
}

/// Returns the pairs without those of two fixed colliders.
fn movable_pairs(world: &World) -> Pairs {
    world.pairs().map(sorted).filter(|pair| !has_fixed(world, pair)).collect()
}

/// Stock has the pairs that it would have had from the start.
#[test]
fn a_change_leaves_the_pairs_of_resting_bodies_equal() {
    let [mut changed, _] = twins(Choice::Pbig);
    let [mut other, _] = twins(Choice::Stock);
    for choice in [Choice::Stock, Choice::Pbig, Choice::Stock] {
        changed.change_broad_phase(choice);
        for step in 1..=5 {
            changed.step().unwrap();
            other.step().unwrap();
            assert_eq!(movable_pairs(&changed.world), movable_pairs(&other.world), "{choice:?}, step {step}");
        }
    }
}

/// Sleeping and fixed colliders are lost to a stock broad phase to which nobody shows them.
#[test]
fn the_check_notices_a_broad_phase_that_starts_empty() {
    let lost = run("sleeping", 7, |run, choice| run.replace_broad_phase(ExchangeableBroadPhase::new(choice)));
    assert!(lost.is_err());
}

/// Pairs that pbig had and stock does not have stay in the narrow phase if nobody ends them.
#[test]
fn the_check_notices_pairs_that_are_left_behind() {
    let left = run("column", 7, |run, choice| {
        run.change_broad_phase(choice);
        if choice == Choice::Stock {
            run.replace_broad_phase(ExchangeableBroadPhase::new(choice));
        }
    });
    assert!(left.is_err());
}

#[test]
fn a_wrong_name_is_answered_with_the_right_ones() {
    assert_eq!("pbig".parse(), Ok(Choice::Pbig));
    let error = "grid".parse::<Choice>().unwrap_err();
    assert!(error.contains("'grid'") && error.contains("stock, pbig"), "{error}");
}
