//! Scene queries give what rapier's own give.

use pbig_harness::scenes::Scene;
use pbig_harness::world::World;
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};
use rapier_pbig::PbigBroadPhase;
use rapier3d::control::{CharacterCollision, KinematicCharacterController};
use rapier3d::parry::query::{DefaultQueryDispatcher, ShapeCastOptions};
use rapier3d::prelude::*;
use std::collections::BTreeSet;

/// Hands each call to ours and to stock, whose events are not used.
struct Both {
    ours: PbigBroadPhase,
    stock: DefaultBroadPhase,
}

impl BroadPhase for Both {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        self.stock.update(params, colliders, bodies, modified, removed, &mut Vec::new());
        self.ours.update(params, colliders, bodies, modified, removed, events);
    }
}

/// One answer to each kind of query. Which of several equally near colliders is named is the tree's choice,
/// so distances stand for them.
#[derive(Debug, PartialEq)]
struct Answers {
    ray: Option<f32>,
    all_on_ray: BTreeSet<u32>,
    projection: Option<f32>,
    within: BTreeSet<u32>,
    shapes: BTreeSet<u32>,
    cast: Option<f32>,
}

/// Asks all kinds of queries. A macro, because pbig's own type and rapier's have the methods without a trait.
macro_rules! ask {
    ($queries:expr, $at:expr, $along:expr) => {{
        let (queries, at, along) = ($queries, $at, $along);
        let (point, direction) = (Point::from(at), Vector::from(along));
        let (ray, ball) = (Ray::new(point, direction), Ball::new(0.7));
        let pose = Isometry::translation(at[0], at[1], at[2]);
        let index = |handle: ColliderHandle| handle.into_raw_parts().0;
        // Rapier 0.27's own `project_point` panics if its tree has no collider to project on.
        let everywhere = Aabb::new(Point::from([f32::MIN; 3]), Point::from([f32::MAX; 3]));
        let can_project = queries.intersect_aabb_conservative(everywhere).next().is_some();
        Answers {
            ray: queries.cast_ray(&ray, 30.0, true).map(|hit| hit.1),
            all_on_ray: queries.intersect_ray(ray, 30.0, true).map(|hit| index(hit.0)).collect(),
            projection: can_project
                .then(|| queries.project_point(&point, 5.0, true))
                .flatten()
                .map(|(_, found)| (found.point - point).norm()),
            within: queries.intersect_point(point).map(|(handle, _)| index(handle)).collect(),
            shapes: queries.intersect_shape(pose, &ball).map(|(handle, _)| index(handle)).collect(),
            cast: queries
                .cast_shape(&pose, &direction, &ball, ShapeCastOptions::with_max_time_of_impact(20.0))
                .map(|(_, hit)| hit.time_of_impact),
        }
    }};
}

fn random3(random: &mut SmallRng, reach: f32) -> [f32; 3] {
    std::array::from_fn(|_| random.random_range(-reach..reach))
}

/// Asks both the same; returns how many rays hit.
fn compare(world: &World, both: &Both, random: &mut SmallRng, questions: usize) -> usize {
    let filter = QueryFilter::default();
    let only_dynamic = QueryFilter::only_dynamic();
    let mut hits = 0;
    for i in 0..questions {
        let filter = if i % 2 == 0 { filter } else { only_dynamic };
        let (bodies, colliders) = (&world.bodies, &world.colliders);
        let ours = both.ours.as_query_pipeline(&DefaultQueryDispatcher, bodies, colliders, filter);
        let stock = both.stock.as_query_pipeline(&DefaultQueryDispatcher, bodies, colliders, filter);
        let (at, along) = (random3(random, 8.0), random3(random, 1.0));
        let wanted = ask!(&stock, at, along);
        assert_eq!(ask!(&ours, at, along), wanted, "at {at:?} along {along:?}");
        assert_eq!(ask!(&*ours, at, along), wanted, "rapier's own queries, at {at:?} along {along:?}");
        hits += usize::from(wanted.ray.is_some());
    }
    hits
}

/// Compares the answers of a broad phase's index with those of rapier's own queries on its tree. Returns the number of rays that
/// hit.
pub(crate) fn compare_with_tree(world: &World, pbig: &PbigBroadPhase, seed: u64) -> Result<u64, String> {
    let mut random = SmallRng::seed_from_u64(seed);
    let (at, along) = (random3(&mut random, 4.0), random3(&mut random, 1.0));
    let filter = QueryFilter::default();
    let queries = pbig.as_query_pipeline(&DefaultQueryDispatcher, &world.bodies, &world.colliders, filter);
    let (ours, wanted) = (ask!(&queries, at, along), ask!(&*queries, at, along));
    if ours == wanted {
        return Ok(u64::from(ours.ray.is_some()));
    }
    Err(format!("at {at:?} along {along:?}: {ours:?}, rapier's own queries: {wanted:?}"))
}

#[test]
fn queries_agree_with_stock_in_each_frame_of_each_scene() {
    let mut hits = 0;
    for scene in Scene::ALL {
        let (mut world, ours) = (scene.build(80, 2), PbigBroadPhase::new());
        let mut both = Both { ours, stock: DefaultBroadPhase::new() };
        let mut random = SmallRng::seed_from_u64(4);
        for _ in 0..40 {
            world.step(&mut both);
            hits += compare(&world, &both, &mut random, 3);
        }
    }
    assert!(hits > 200, "{hits} hits");
}

#[test]
fn queries_work_before_the_first_step_and_on_mutable_sets() {
    for count in 0..5 {
        let mut world = World::default();
        for i in 0..count {
            world.colliders.insert(ColliderBuilder::ball(0.5).translation(vector![3.0 * i as f32, 0.0, 0.0]));
        }
        let mut ours = PbigBroadPhase::new();
        let ray = Ray::new(point![-5.0, 0.0, 0.0], Vector::x());
        let cast = |world: &mut World, ours: &PbigBroadPhase| {
            let World { bodies, colliders, .. } = world;
            let filter = QueryFilter::default();
            let queries = ours.as_query_pipeline_mut(&DefaultQueryDispatcher, bodies, colliders, filter);
            let hit = queries.as_ref().cast_ray(&ray, 100.0, true);
            if let Some((handle, _)) = hit {
                queries.colliders[handle].set_translation(vector![0.0, 90.0, 0.0]);
            }
            hit.map(|(_, distance)| distance)
        };
        assert_eq!(cast(&mut world, &ours), None, "as with stock, colliders are known after a step");
        world.step(&mut ours);
        assert_eq!(cast(&mut world, &ours), (count > 0).then_some(4.5));
        world.step(&mut ours);
        assert_eq!(cast(&mut world, &ours), (count > 1).then_some(7.5), "the first is out of the way");
    }
}

#[test]
fn queries_work_on_a_restored_and_on_a_cloned_broad_phase() {
    let mut world = Scene::named("column").expect("the scene exists").build(100, 2);
    let mut both = Both { ours: PbigBroadPhase::new(), stock: DefaultBroadPhase::new() };
    (0..40).for_each(|_| world.step(&mut both));
    let mut random = SmallRng::seed_from_u64(3);
    assert!(compare(&world, &both, &mut random, 10) > 0);
    let bytes = postcard::to_stdvec(&both.ours).expect("a snapshot");
    for ours in [both.ours.clone(), postcard::from_bytes(&bytes).expect("what was saved")] {
        both.ours = ours;
        compare(&world, &both, &mut random, 20);
    }
    world.step(&mut both);
    compare(&world, &both, &mut random, 20);
}

/// A collider that uses the index of one removed since the last step is named by its own handle, as by stock.
#[test]
fn a_collider_that_reuses_an_index_is_named_by_its_own_handle() {
    let mut world = World::default();
    let ball = || ColliderBuilder::ball(0.5).translation(vector![3.0, 0.0, 0.0]);
    let first = world.colliders.insert(ball());
    let mut both = Both { ours: PbigBroadPhase::new(), stock: DefaultBroadPhase::new() };
    world.step(&mut both);
    world.remove_collider(first);
    let second = world.colliders.insert(ball());
    assert_eq!(first.into_raw_parts().0, second.into_raw_parts().0);
    let filter = QueryFilter::default();
    let ours = both.ours.as_query_pipeline(&DefaultQueryDispatcher, &world.bodies, &world.colliders, filter);
    let stock =
        both.stock.as_query_pipeline(&DefaultQueryDispatcher, &world.bodies, &world.colliders, filter);
    let ray = Ray::new(Point::origin(), Vector::x());
    assert_eq!(ours.cast_ray(&ray, 9.0, true), stock.cast_ray(&ray, 9.0, true));
    assert_eq!(ours.cast_ray(&ray, 9.0, true), Some((second, 2.5)));
}

/// Returns the places of a character that walks among blocks, and the number of its collisions with these.
fn walk(queries: &QueryPipeline<'_>) -> (Vec<[f32; 3]>, usize) {
    let (controller, capsule) = (KinematicCharacterController::default(), Capsule::new_y(0.5, 0.3));
    let (mut at, mut collisions) = (Isometry::translation(-9.0, 0.9, 0.1), 0);
    let steps = (0..400).map(|i| {
        let wanted = vector![0.05, -0.02, 0.05 * (i as f32 * 0.02).sin()];
        let note = |hit: CharacterCollision| collisions += usize::from(hit.handle.into_raw_parts().0 > 0);
        let moved = controller.move_shape(1.0 / 60.0, queries, &capsule, &at, wanted, note);
        at.translation.vector += moved.translation;
        at.translation.vector.into()
    });
    (steps.collect(), collisions)
}

/// Rapier's controller needs a tree, and each broad phase has its own. The blocks lie apart: which of two equally near ones is met first
/// is a tree's choice.
#[test]
fn a_character_walks_the_same_way_as_with_stock() {
    let (mut world, mut random) = (World::default(), SmallRng::seed_from_u64(6));
    world.colliders.insert(ColliderBuilder::cuboid(30.0, 0.5, 30.0).translation(vector![0.0, -0.5, 0.0]));
    for _ in 0..30 {
        let ([x, turn, z], [half, ..]) = (random3(&mut random, 8.0), random3(&mut random, 0.3));
        let block = ColliderBuilder::cuboid(0.4, 0.4 + half, 0.2).rotation(vector![0.0, turn, 0.0]);
        world.colliders.insert(block.translation(vector![x, 0.0, z]));
    }
    let mut both = Both { ours: PbigBroadPhase::new(), stock: DefaultBroadPhase::new() };
    world.step(&mut both);
    let (bodies, colliders, filter) = (&world.bodies, &world.colliders, QueryFilter::default());
    let ours = both.ours.as_query_pipeline(&DefaultQueryDispatcher, bodies, colliders, filter);
    let stock = both.stock.as_query_pipeline(&DefaultQueryDispatcher, bodies, colliders, filter);
    let ((ours, _), (stock, collisions)) = (walk(&ours), walk(&stock));
    assert_eq!(ours, stock);
    let end = stock.last().expect("a way");
    assert!(collisions > 50 && end[0] > 5.0, "{collisions} collisions, at {end:?}");
}

/// A filter may ask queries itself while other threads ask, too, and while the index is sorted.
#[test]
fn a_filter_may_ask_while_others_ask() {
    let mut world = Scene::named("column").expect("the scene exists").build(400, 2);
    let mut ours = PbigBroadPhase::new();
    (0..30).for_each(|_| world.step(&mut ours));
    let ask = |filter: QueryFilter<'_>| {
        let queries =
            ours.as_query_pipeline(&DefaultQueryDispatcher, &world.bodies, &world.colliders, filter);
        let down = |i: u32| Ray::new(point![0.01 * (i % 100) as f32, 50.0, 0.0], -Vector::y());
        (0..600).filter(|&i| queries.cast_ray(&down(i), 100.0, true).is_some()).count()
    };
    let ask_again = |_: ColliderHandle, _: &Collider| {
        let (bodies, colliders) = (&world.bodies, &world.colliders);
        let queries =
            ours.as_query_pipeline(&DefaultQueryDispatcher, bodies, colliders, QueryFilter::default());
        queries.intersect_point(Point::origin()).count() < usize::MAX
    };
    let counts: Vec<usize> = std::thread::scope(|scope| {
        let threads: Vec<_> =
            (0..4).map(|_| scope.spawn(|| ask(QueryFilter::new().predicate(&ask_again)))).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    assert!(counts[0] > 0 && counts.iter().all(|count| *count == ask(QueryFilter::default())), "{counts:?}");
}
