//! Differences that docs/DROP_IN.md names, each shown beside rapier's own broad phase.

use glam::Vec3;
use pbig_harness_036::dimension::cuboid;
use pbig_harness_036::world::{dynamic, real, to_vector, with};
use rapier::prelude::*;
use rapier_pbig::{PbigConfig, finder};

/// Runs a test in a world without gravity, on rapier's own broad phase and on pbig.
fn on_both<T>(test: impl Fn(&mut PhysicsWorld) -> T) -> [T; 2] {
    [BroadPhaseBvh::new(), rapier_pbig::broad_phase()].map(|broad_phase| test(&mut weightless(broad_phase)))
}

fn weightless(broad_phase: BroadPhaseBvh) -> PhysicsWorld {
    PhysicsWorld { gravity: Vector::ZERO, ..with(broad_phase) }
}

/// Adds a ball of radius 0.5 on a kinematic body, which stays where it is.
fn still_ball(world: &mut PhysicsWorld, x: f32) -> ColliderHandle {
    let body = RigidBodyBuilder::kinematic_position_based().translation(to_vector(Vec3::X * x));
    world.insert(body, ColliderBuilder::ball(0.5)).1
}

/// Steps, and returns true if the narrow phase has the pair.
fn has_pair(world: &mut PhysicsWorld, [a, b]: [ColliderHandle; 2]) -> bool {
    world.step();
    world.narrow_phase.contact_pair(a, b).is_some()
}

#[test]
fn new_collision_types_take_effect_in_the_next_step() {
    let found = on_both(|world| {
        let balls = [0.0, 0.9].map(|x| still_ball(world, x));
        let before = has_pair(world, balls);
        world.colliders[balls[0]].set_active_collision_types(ActiveCollisionTypes::all());
        let after = has_pair(world, balls);
        // Out of the stored box: a smaller step does not do.
        let there = world.colliders[balls[0]].translation() - to_vector(0.1 * Vec3::Y);
        world.colliders[balls[0]].set_translation(there);
        [before, after, has_pair(world, balls)]
    });
    assert_eq!(found, [[false, false, true], [false, true, true]], "rapier's own waits until it moves");
}

#[test]
fn a_new_contact_skin_takes_effect_in_the_next_step() {
    let found = on_both(|world| {
        let balls = [0.0, 1.5].map(|x| still_ball(world, x));
        world.colliders[balls[0]].set_active_collision_types(ActiveCollisionTypes::all());
        let before = has_pair(world, balls);
        balls.iter().for_each(|ball| world.colliders[*ball].set_contact_skin(real(0.4)));
        let after = has_pair(world, balls);
        let here = world.colliders[balls[0]].translation();
        balls.iter().for_each(|ball| world.colliders[*ball].set_translation(here));
        [before, after, has_pair(world, balls)]
    });
    assert_eq!(found, [[false, false, true], [false, true, true]], "rapier's own waits for another change");
}

/// The pair with the ground ends, and that wakes the sleeper.
#[test]
fn a_ground_that_shrinks_under_a_sleeper_wakes_it() {
    let found = on_both(|world| {
        world.gravity = Vector::Y * -9.81;
        let ground = world.colliders.insert(ColliderBuilder::new(cuboid(Vec3::new(10.0, 0.5, 10.0))));
        let at = dynamic(Vec3::new(5.0, 1.0, 0.0));
        let (sleeper, _) = world.insert(at, ColliderBuilder::new(cuboid(Vec3::splat(0.5))));
        (0..300).for_each(|_| world.step());
        assert!(world.bodies[sleeper].is_sleeping());
        world.colliders[ground].set_shape(cuboid(Vec3::new(1.0, 0.5, 1.0)));
        (0..60).for_each(|_| world.step());
        (world.bodies[sleeper].is_sleeping(), world.bodies[sleeper].translation().y > 0.9)
    });
    assert_eq!(found, [(true, true), (false, false)], "on rapier's own it hangs in the air");
}

/// A pair that a filter excludes from the beginning is none on either side.
#[test]
fn a_pair_that_becomes_excluded_ends() {
    let found = on_both(|world| {
        let ball = |world: &mut PhysicsWorld, x: f32, is_sensor: bool| {
            let ball = ColliderBuilder::ball(0.5).sensor(is_sensor);
            world.insert(dynamic(Vec3::X * x).can_sleep(false), ball).1
        };
        let [a, b, c, sensor] =
            [(0.0, false), (0.9, false), (0.5, false), (0.4, true)].map(|(x, is)| ball(world, x, is));
        world.colliders[c].set_collision_groups(InteractionGroups::none());
        world.step();
        let narrow_phase = &world.narrow_phase;
        assert!(narrow_phase.contact_pair(a, b).is_some() && narrow_phase.contact_pair(a, c).is_none());
        assert_eq!(narrow_phase.intersection_pair(a, sensor), Some(true));
        world.colliders[a].set_collision_groups(InteractionGroups::none());
        world.step();
        let contact = world.narrow_phase.contact_pair(a, b).map(|pair| pair.has_any_active_contact());
        (contact, world.narrow_phase.intersection_pair(a, sensor))
    });
    assert_eq!(found, [(Some(false), Some(false)), (None, None)]);
}

/// The lowest index wins among equally near colliders.
#[test]
fn equally_near_colliders_are_told_apart_by_their_indices() {
    let [_, ours] = on_both(|world| {
        let mut first = None;
        for i in 0..40 {
            let ball = still_ball(world, 0.0);
            first = first.or((i == 0).then_some(ball));
        }
        world.step();
        let ray = Ray::new(to_vector(-5.0 * Vec3::X), to_vector(Vec3::X));
        (world.query_pipeline().cast_ray(&ray, 100.0, true).map(|hit| hit.0), first)
    });
    assert_eq!(ours.0, ours.1);
}

/// `install` leaves an installed pbig alone; `install_with` and `install_finder` replace it, and no contact is lost.
#[test]
fn another_finder_resumes_where_the_last_one_stopped() {
    let mut world = weightless(rapier_pbig::broad_phase());
    let balls = [0.0, 0.9].map(|x| still_ball(&mut world, x));
    world.colliders[balls[0]].set_active_collision_types(ActiveCollisionTypes::all());
    assert!(has_pair(&mut world, balls));
    rapier_pbig::install(&mut world.broad_phase);
    assert_eq!(finder(&world.broad_phase).map(|finder| finder.stats().totals.updates > 0), Some(true));
    let wide = PbigConfig { margin: 0.5, ..PbigConfig::DEFAULT };
    rapier_pbig::install_with(&mut world.broad_phase, wide).expect("a margin");
    assert_eq!(finder(&world.broad_phase).map(|finder| finder.stats().totals.updates), Some(0));
    assert!(has_pair(&mut world, balls));
}

/// Rapier feeds what a step moved to the finder without an update.
#[test]
fn a_step_is_one_update_and_one_more_for_each_further_substep() {
    let mut world = weightless(rapier_pbig::broad_phase());
    let wall = ColliderBuilder::new(cuboid(Vec3::new(0.05, 5.0, 5.0)));
    world.colliders.insert(wall.translation(to_vector(0.5 * Vec3::X)));
    let bullet = dynamic(-7.0 * Vec3::X).linvel(to_vector(300.0 * Vec3::X));
    world.insert(bullet.ccd_enabled(true).can_sleep(false), ColliderBuilder::ball(0.1));
    let updates =
        |world: &PhysicsWorld| finder(&world.broad_phase).map(|finder| finder.stats().totals.updates);
    world.step();
    assert_eq!(updates(&world), Some(1));
    world.integration_parameters.max_ccd_substeps = 4;
    (0..2).for_each(|_| world.step());
    assert!(updates(&world) > Some(3), "{:?}", updates(&world));
}

/// Most steps move no box out of its margin.
#[test]
fn counts_of_a_step_are_its_own() {
    let mut world = weightless(rapier_pbig::broad_phase());
    for (x, speed) in [(0.0, 0.3), (1.25, -0.3)] {
        let body = dynamic(x * Vec3::X).linvel(to_vector(speed * Vec3::X));
        world.insert(body, ColliderBuilder::new(cuboid(Vec3::splat(0.5))));
    }
    let (mut added, mut within) = (0, 0);
    for _ in 0..40 {
        world.step();
        let stats = finder(&world.broad_phase).expect("it is installed").stats();
        added += stats.added as u64;
        within += usize::from(stats.modified == 2 && stats.report.changed == 0);
    }
    let stats = finder(&world.broad_phase).expect("it is installed").stats();
    assert_eq!((added, stats.totals.added), (1, 1));
    assert!(within > 5, "{within} steps");
}
