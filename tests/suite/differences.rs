//! The rows of docs/DROP_IN.md that a short scene can show: rapier 0.27's own broad phase, then ours.

use glam::Vec3;
use pbig_harness::counting::held;
use pbig_harness::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::parry::query::DefaultQueryDispatcher;
use rapier3d::prelude::*;

/// Runs a test in a world without gravity, with stock and with ours.
fn on_both<T>(test: impl Fn(&mut World, &mut dyn BroadPhase) -> T) -> [T; 2] {
    let both: [Box<dyn BroadPhase>; 2] =
        [Box::new(DefaultBroadPhase::new()), Box::new(PbigBroadPhase::new())];
    both.map(|mut broad_phase| test(&mut World::with_gravity(Vec3::ZERO), &mut *broad_phase))
}

/// Adds a ball of radius 0.5 on a dynamic body that contacts do not push.
fn ball(world: &mut World, x: f32) -> ColliderHandle {
    let body = World::dynamic(Vec3::X * x).lock_translations().lock_rotations();
    let body = world.add(body, ColliderBuilder::ball(0.5));
    world.bodies[body].colliders()[0]
}

/// Adds a ball of radius 0.5 without a body: no step lists it.
fn still_ball(world: &mut World, x: f32) -> ColliderHandle {
    world.colliders.insert(ColliderBuilder::ball(0.5).translation(vector![x, 0.0, 0.0]))
}

/// Steps, and returns true if the narrow phase has a pair.
fn has_pair(world: &mut World, broad_phase: &mut dyn BroadPhase, [a, b]: [ColliderHandle; 2]) -> bool {
    world.step(broad_phase);
    world.narrow_phase.contact_pair(a, b).is_some()
}

fn touch(world: &mut World, collider: ColliderHandle) {
    let here = *world.colliders[collider].translation();
    world.colliders[collider].set_translation(here);
}

#[test]
fn an_excluded_pair_is_none() {
    let found = on_both(|world, broad_phase| {
        let [a, b, sensor] = [0.0, 0.9, 0.4].map(|x| ball(world, x));
        world.colliders[sensor].set_sensor(true);
        world.colliders[a].set_collision_groups(InteractionGroups::none());
        world.step(broad_phase);
        let contact = world.narrow_phase.contact_pair(a, b).map(|pair| pair.has_any_active_contact);
        (contact, world.narrow_phase.intersection_pair(a, sensor))
    });
    assert_eq!(found, [(Some(false), Some(false)), (None, None)]);
}

#[test]
fn new_collision_types_and_skins_take_effect_in_the_next_step() {
    let found = on_both(|world, broad_phase| {
        let [near, far] = [[0.0, 0.9], [5.0, 6.5]].map(|two| two.map(|x| still_ball(world, x)));
        let all = ActiveCollisionTypes::all();
        world.colliders[far[0]].set_active_collision_types(all);
        let mut pairs = |world: &mut World| {
            let near = has_pair(world, broad_phase, near);
            (near, world.narrow_phase.contact_pair(far[0], far[1]).is_some())
        };
        let before = pairs(world);
        world.colliders[near[0]].set_active_collision_types(all);
        far.iter().for_each(|&one| world.colliders[one].set_contact_skin(0.4));
        let after = pairs(world);
        near.iter().chain(&far).for_each(|&one| touch(world, one));
        [before, after, pairs(world)].map(|(types, skin)| [types, skin])
    });
    // Stock keeps a pair whose types do not meet, without contacts.
    let [stock, ours] = found;
    assert_eq!(stock, [[true, false], [true, false], [true, true]]);
    assert_eq!(ours, [[false, false], [true, true], [true, true]]);
}

/// The pair with the ground ends, and that wakes the sleeper.
#[test]
fn a_ground_that_shrinks_under_a_sleeper_wakes_it() {
    let found = on_both(|world, broad_phase| {
        world.gravity = -9.81 * Vec3::Y;
        let ground = world.colliders.insert(ColliderBuilder::cuboid(10.0, 0.5, 10.0));
        let sleeper =
            world.add(World::dynamic(Vec3::new(5.0, 1.0, 0.0)), ColliderBuilder::cuboid(0.5, 0.5, 0.5));
        (0..300).for_each(|_| world.step(broad_phase));
        assert!(world.bodies[sleeper].is_sleeping());
        world.colliders[ground].set_shape(SharedShape::cuboid(1.0, 0.5, 1.0));
        (0..60).for_each(|_| world.step(broad_phase));
        world.bodies[sleeper].translation().y > 0.9
    });
    assert_eq!(found, [true, false], "with stock it hangs in the air");
}

#[test]
fn a_new_parent_takes_effect_in_the_next_step() {
    let [_, ours] = on_both(|world, broad_phase| {
        let balls = [0.0, 0.9].map(|x| ball(world, x));
        let before = has_pair(world, broad_phase, balls);
        let parent = world.colliders[balls[0]].parent();
        world.colliders.set_parent(balls[1], parent, &mut world.bodies);
        let after = has_pair(world, broad_phase, balls);
        let alone = world.bodies.insert(RigidBodyBuilder::dynamic());
        world.colliders.set_parent(balls[1], Some(alone), &mut world.bodies);
        [before, after, has_pair(world, broad_phase, balls)]
    });
    assert_eq!(ours, [true, false, true]);
}

#[test]
fn solver_groups_joints_articulations_and_sleep_exclude_no_pair() {
    let found = on_both(|world, broad_phase| {
        let ball =
            |world: &mut World, x: f32| world.add(World::dynamic(Vec3::X * x), ColliderBuilder::ball(0.5));
        let two = [0.0, 5.0, 10.0, 15.0].map(|x| [x, x + 0.9].map(|x| ball(world, x)));
        let [_, joined, articulated, asleep] = two;
        let colliders = two.map(|two| two.map(|body| world.bodies[body].colliders()[0]));
        world.colliders[colliders[0][0]].set_solver_groups(InteractionGroups::none());
        let joint = SphericalJointBuilder::new().contacts_enabled(false);
        world.impulse_joints.insert(joined[0], joined[1], joint, true);
        world.multibody_joints.insert(articulated[0], articulated[1], joint, true);
        asleep.iter().for_each(|&body| world.bodies[body].sleep());
        world.step(broad_phase);
        colliders.map(|[a, b]| world.narrow_phase.contact_pair(a, b).is_some())
    });
    assert_eq!(found, [[true; 4]; 2]);
}

#[test]
fn a_new_prediction_distance_reaches_a_collider_when_it_is_listed_next() {
    let found = on_both(|world, broad_phase| {
        let balls = [0.0, 1.2].map(|x| still_ball(world, x));
        world.colliders[balls[0]].set_active_collision_types(ActiveCollisionTypes::all());
        let before = has_pair(world, broad_phase, balls);
        world.params.normalized_prediction_distance = 0.3;
        let unlisted = has_pair(world, broad_phase, balls);
        balls.iter().for_each(|&ball| touch(world, ball));
        [before, unlisted, has_pair(world, broad_phase, balls)]
    });
    assert_eq!(found, [[false, false, true]; 2]);
}

#[test]
fn a_collider_that_comes_and_goes_between_steps_leaves_no_trace() {
    let [_, ours] = on_both(|world, broad_phase| {
        let (first, brief) = (ball(world, 0.0), ball(world, 0.9));
        world.remove_collider(brief);
        world.step(broad_phase);
        let (pairs, last) = (world.pair_count(), ball(world, 0.9));
        world.colliders[last].set_enabled(false);
        world.step(broad_phase);
        let disabled = world.pair_count();
        world.colliders[last].set_enabled(true);
        (pairs, disabled, has_pair(world, broad_phase, [first, last]))
    });
    assert_eq!(ours, (0, 0, true));
}

/// Returns what the narrow phase has after a broad phase that knows nothing took over a world in which a pair has ended.
fn left_of_another(begin: impl Fn(&World) -> PbigBroadPhase) -> bool {
    let mut world = World::with_gravity(Vec3::ZERO);
    let balls = [0.0, 0.9].map(|x| ball(&mut world, x));
    assert!(has_pair(&mut world, &mut DefaultBroadPhase::new(), balls));
    let body = world.colliders[balls[1]].parent().expect("a body");
    world.bodies[body].set_translation(vector![50.0, 0.0, 0.0], true);
    let mut ours = begin(&world);
    has_pair(&mut world, &mut ours, balls)
}

#[test]
fn pairs_that_only_the_narrow_phase_has_end_after_an_adoption() {
    assert!(left_of_another(|_| PbigBroadPhase::new()));
    let adopt = |world: &World| {
        let mut ours = PbigBroadPhase::new();
        ours.adopt(&world.narrow_phase);
        ours
    };
    assert!(!left_of_another(adopt));
}

#[test]
fn a_world_rolled_back_under_it_is_noticed_after_an_adoption_only() {
    let (mut world, mut ours) = (World::with_gravity(Vec3::ZERO), PbigBroadPhase::new());
    let balls = [0.0, 0.9].map(|x| still_ball(&mut world, x));
    world.colliders[balls[0]].set_active_collision_types(ActiveCollisionTypes::all());
    assert!(has_pair(&mut world, &mut ours, balls));
    let before = world.to_bytes();
    world.colliders[balls[1]].set_translation(vector![50.0, 0.0, 0.0]);
    world.step(&mut ours);
    assert_eq!(ours.pair_count(), 0);
    world = World::from_bytes(&before).expect("what was saved");
    world.step(&mut ours);
    assert_eq!(ours.pair_count(), 0, "as many colliders as before");
    ours.adopt(&world.narrow_phase);
    world.step(&mut ours);
    assert_eq!(ours.pair_count(), 1);
}

#[test]
fn queries_name_the_lowest_of_equally_near_colliders_and_list_by_index() {
    let (mut world, mut ours) = (World::default(), PbigBroadPhase::new());
    let all: Vec<_> = (0..40).map(|_| still_ball(&mut world, 3.0)).collect();
    world.step(&mut ours);
    let (bodies, colliders, filter) = (&world.bodies, &world.colliders, QueryFilter::default());
    let queries = ours.as_query_pipeline(&DefaultQueryDispatcher, bodies, colliders, filter);
    let hit = queries.cast_ray(&Ray::new(Point::origin(), Vector::x()), 9.0, true);
    assert_eq!(hit.map(|hit| hit.0), Some(all[0]));
    assert!(queries.intersect_point(point![3.0, 0.0, 0.0]).map(|found| found.0).eq(all));
}

/// Returns the bytes that two boxes take for each index below the second one's, in updates of which each moves the first box.
fn bytes_of_an_index(far: u32, mut update: impl FnMut(f32)) -> f64 {
    let before = held();
    [0.0, 0.5, 9.0].into_iter().for_each(&mut update);
    (held() - before) as f64 / f64::from(far)
}

#[test]
fn an_index_takes_77_bytes_and_an_id_of_the_core_65() {
    let (mut colliders, far) = (ColliderSet::new(), 1 << 20);
    let all: Vec<_> = (0..=far).map(|_| colliders.insert(ColliderBuilder::ball(0.5))).collect();
    // Brute force keeps less for an id.
    let left: Vec<_> = all[..450].iter().chain(all.last()).copied().collect();
    for &gone in &all[450..far as usize] {
        colliders.remove(gone, &mut IslandManager::new(), &mut RigidBodySet::new(), false);
    }
    for (i, &apart) in all[1..450].iter().enumerate() {
        colliders[apart].set_translation(vector![0.0, 5.0 + i as f32, 0.0]);
    }
    colliders[all[0]].set_active_collision_types(ActiveCollisionTypes::all());
    let (mut ours, params) = (PbigBroadPhase::new(), IntegrationParameters::default());
    let of_rapier = bytes_of_an_index(far, |x| {
        colliders[all[0]].set_translation(vector![x, 0.0, 0.0]);
        ours.update(&params, &colliders, &RigidBodySet::new(), &left, &[], &mut Vec::new());
        assert_eq!(ours.pair_count(), usize::from(x < 1.0));
    });
    let mut core = pbig_core::BroadPhase::default();
    let of_core = bytes_of_an_index(far, |x| {
        for (id, x) in (1..450).map(|id| (id, 9.0 + 2.0 * id as f32)).chain([(0, x), (far, 0.0)]) {
            let aabb = pbig_core::Aabb::from_center([x, 0.0, 0.0], [0.5; 3]);
            core.set(id, aabb, pbig_core::ProxyFilter::ALL).expect("a dense id");
        }
        core.update().expect("one pair");
    });
    let is = |bytes: f64, wanted: f64| (wanted..wanted + 0.5).contains(&bytes);
    assert!(is(of_rapier, 77.0) && is(of_core, 65.0), "{of_rapier}, {of_core}");
}
