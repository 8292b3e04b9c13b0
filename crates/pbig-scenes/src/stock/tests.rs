//! A world that changes its broad phase keeps every pair, has no other, and sleeps on.

use super::*;
use crate::scenes::Scene;
use std::collections::BTreeSet;

/// The distance by which stock's stored AABB at first exceeds its shape's on each side: 1 cm, and half the prediction
/// distance of 2 mm.
const MARGIN_METRES: f32 = 0.011;

type Pairs = BTreeSet<[(u32, u32); 2]>;

/// Returns the pairs of colliders, one of them movable, whose AABBs overlap.
fn overlapping(world: &World, aabb: fn(&Collider) -> Aabb) -> Pairs {
    let is_dynamic = |it: &Collider| it.parent().is_some_and(|body| world.bodies[body].is_dynamic());
    let all: Vec<_> = world.colliders.iter().map(|(at, it)| (at, it, is_dynamic(it), aabb(it))).collect();
    let mut pairs = Pairs::new();
    for (at, (one, a, a_moves, a_box)) in all.iter().enumerate() {
        for (other, b, b_moves, b_box) in &all[at + 1..] {
            if (*a_moves || *b_moves) && a.parent() != b.parent() && a_box.intersects(b_box) {
                pairs.insert(sorted(ColliderPair::new(*one, *other)));
            }
        }
    }
    pairs
}

/// Returns an AABB around every one that stock may have stored for a collider. Stock keeps a stored AABB as long as it contains
/// the collider's. The AABB of a body that turns may shrink; the larger one stays. No edge of a stored AABB is longer than the
/// bounding sphere's diameter and two margins, so the stored AABB exceeds the present one by at most that difference.
fn largest_stored(collider: &Collider) -> Aabb {
    let (now, radius) = (collider.compute_aabb(), collider.shape().compute_local_bounding_sphere().radius);
    let excess = now.extents().map(|edge| 2.0 * (radius + MARGIN_METRES) - edge);
    Aabb::new(now.mins - excess, now.maxs + excess)
}

/// Compares the narrow phase's pairs with brute force.
fn check(world: &World) -> Result<(), String> {
    let pairs: Pairs = world.pairs().map(sorted).collect();
    let missing: Vec<_> = overlapping(world, Collider::compute_aabb).difference(&pairs).copied().collect();
    let near = overlapping(world, largest_stored);
    let is_far = |pair: &&[(u32, u32); 2]| !near.contains(*pair) && !is_fixed(world, pair);
    let stale: Vec<_> = pairs.iter().filter(is_far).collect();
    if missing.is_empty() && stale.is_empty() { Ok(()) } else { Err(format!("{missing:?} {stale:?}")) }
}

/// Returns true for a pair of fixed colliders, which stock reports, too.
fn is_fixed(world: &World, pair: &[(u32, u32); 2]) -> bool {
    let handle = |(index, generation)| ColliderHandle::from_raw_parts(index, generation);
    pair.iter().all(|raw| world.colliders[handle(*raw)].parent().is_none())
}

/// Runs a scene whose broad phase is replaced every `period` steps, and checks each step.
fn run(scene: &str, period: u32) -> Result<(), String> {
    let mut world = Scene::named(scene)?.build(150, 1);
    let mut broad_phase = StockBroadPhase::default();
    for step in 1..=120 {
        world.step(&mut broad_phase);
        check(&world).map_err(|why| format!("{scene}, step {step}: {why}"))?;
        if step % period == 0 {
            broad_phase = StockBroadPhase::adopt(&world);
        }
    }
    Ok(())
}

#[test]
fn a_takeover_loses_no_pair_and_leaves_none_behind() {
    for scene in ["column", "pyramid", "sleeping", "ragdolls", "sensors"] {
        for period in [1, 7, 30] {
            run(scene, period).unwrap();
        }
    }
}
