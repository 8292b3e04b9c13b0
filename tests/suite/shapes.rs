//! Shapes as colliders, far away and at rest, and a broad phase beside the rest of rapier: joints, CCD,
//! kinematic bodies, sleep, sensors, removal, parameters. Every call is checked beside stock and the oracle,
//! on every backend.

use crate::checked::{Checked, everywhere};
use crate::upstream::{add, held, sensed, touching};
use pbig_harness::world::World;
use rapier3d::prelude::*;

/// Drops a ball and a box onto a ground whose surface is at a height of 1 m, and waits until they lie there.
fn rest_on(mut scene: Checked, ground: ColliderBuilder) {
    scene.world.gravity = glam::Vec3::NEG_Y * 9.81;
    scene.world.colliders.insert(ground);
    let mut drop = |x: f32, shape: ColliderBuilder| {
        let body = RigidBodyBuilder::dynamic().translation(vector![x, 1.8, 0.3]);
        add(&mut scene, body.can_sleep(false), shape).0
    };
    let dropped = [drop(-1.7, ColliderBuilder::ball(0.5)), drop(0.6, ColliderBuilder::cuboid(0.5, 0.5, 0.5))];
    assert_eq!((scene.steps(60), touching(&scene)), (2, 2));
    for body in dropped {
        let height = scene.world.bodies[body].translation().y;
        assert!((height - 1.5).abs() < 0.02, "the middle lies at {height}");
    }
}

#[test]
fn things_rest_on_grounds_of_every_kind() {
    let corners = [(-8.0, -8.0), (8.0, -8.0), (8.0, 8.0), (-8.0, 8.0)].map(|(x, z)| point![x, 1.0, z]);
    let triangles = ColliderBuilder::trimesh(corners.to_vec(), vec![[0, 2, 1], [0, 3, 2]]);
    let slab = |x: f32| (Isometry::translation(x, 0.5, 0.0), SharedShape::cuboid(5.0, 0.5, 8.0));
    let keys: Vec<Point<i32>> = (-4..4).flat_map(|i| (-4..4).map(move |k| point![i, 0, k])).collect();
    for (name, ground) in [
        ("heights", ColliderBuilder::heightfield(DMatrix::from_element(9, 9, 0.5), vector![8.0, 2.0, 8.0])),
        ("triangles", triangles.expect("two triangles")),
        ("compound", ColliderBuilder::compound(vec![slab(-5.0), slab(5.0)])),
        ("voxels", ColliderBuilder::voxels(vector![1.0, 1.0, 1.0], &keys)),
        ("half-space", ColliderBuilder::halfspace(Vector::y_axis()).translation(vector![0.0, 1.0, 0.0])),
    ] {
        println!("{name}");
        everywhere(|scene| rest_on(scene, ground.clone()));
    }
}

#[test]
fn upstream_236_396_a_half_space_meets_bodies_everywhere() {
    everywhere(|mut scene| {
        let ground = ColliderBuilder::halfspace(Vector::y_axis()).translation(vector![0.0, -0.4, 0.0]);
        let ground = scene.world.colliders.insert(ground);
        let [(body, _), ..] = [-1e6, -100.0, 0.0, 100.0, 1e6].map(|x| scene.ball(x));
        for x in [-1e6, 3.0, 1e9, -1e12] {
            scene.move_to(body, x);
            assert_eq!((scene.step(), touching(&scene)), (5, 5), "at {x}");
        }
        scene.world.remove_collider(ground);
        assert_eq!((scene.step(), scene.contacts()), (0, 0));
    });
}

#[test]
fn upstream_332_a_sensor_above_a_large_heightfield() {
    everywhere(|mut scene| {
        // Flat but for a hill of 40 m in one corner.
        let heights = DMatrix::from_fn(65, 65, |i, j| if i + j == 0 { 40.0 } else { 0.0 });
        let field = ColliderBuilder::heightfield(heights, vector![256.0, 1.0, 256.0]);
        let field = scene.world.colliders.insert(field);
        let (body, sensor) = add(&mut scene, held([0.0; 3]), ColliderBuilder::ball(2.0).sensor(true));
        for (height, hit) in
            [(60.0, None), (20.0, Some(false)), (1.0, Some(true)), (20.0, Some(false)), (60.0, None)]
        {
            for x in [-90.0, 0.0, 90.0] {
                scene.world.bodies[body].set_translation(vector![x, height, x], true);
                assert_eq!(scene.step(), usize::from(hit.is_some()), "{height} m above {x}");
                assert_eq!(
                    scene.world.narrow_phase.intersection_pair(sensor, field),
                    hit,
                    "{height} m above {x}"
                );
            }
        }
    });
}

#[test]
fn upstream_897_a_voxel_set_in_place_reaches_a_neighbour() {
    everywhere(|mut scene| {
        let voxel = ColliderBuilder::voxels(vector![1.0, 1.0, 1.0], &[point![0, 0, 0]]);
        let (_, growing) = add(&mut scene, held([0.0; 3]), voxel);
        scene.ball(3.0);
        scene.ball(50.0);
        assert_eq!(scene.step(), 0);
        let shape = scene.world.colliders[growing].shape_mut();
        shape.as_voxels_mut().expect("voxels").set_voxel(point![2, 0, 0], true);
        assert_eq!((scene.step(), scene.contacts()), (1, 1));
        let one = SharedShape::voxels(vector![1.0, 1.0, 1.0], &[point![0, 0, 0]]);
        scene.world.colliders[growing].set_shape(one);
        assert_eq!((scene.step(), scene.contacts()), (0, 0));
    });
}

#[test]
fn rows_far_from_the_origin_touch_as_they_do_near_it() {
    for far in [1e5_f32, -1e6] {
        everywhere(|mut scene| {
            // Multiples of a quarter, which f32 holds exactly up to four million.
            let place = |i: i32| held([far + 0.75 * i as f32, -far, far]);
            let row: Vec<_> =
                (0..40).map(|i| add(&mut scene, place(i), ColliderBuilder::ball(0.5)).0).collect();
            for (away, pairs) in [(0.0, 39), (10.0, 37), (0.0, 39), (-10.0, 37), (0.0, 39)] {
                let at = vector![far + 15.0, away - far, far];
                scene.world.bodies[row[20]].set_translation(at, true);
                assert_eq!((scene.step(), touching(&scene)), (pairs, pairs), "at {far}, {away} m away");
            }
        });
    }
}

#[test]
fn a_joint_that_forbids_contacts_keeps_the_pair_for_later() {
    everywhere(|mut scene| {
        let [(a, _), (b, _)] = [0.0, 0.9].map(|x| {
            let body = RigidBodyBuilder::dynamic().translation(vector![x, 0.0, 0.0]);
            add(&mut scene, body.can_sleep(false), ColliderBuilder::ball(0.5))
        });
        scene.ball(50.0);
        let joint = FixedJointBuilder::new().local_anchor1(point![0.9, 0.0, 0.0]).contacts_enabled(false);
        let joint = scene.world.impulse_joints.insert(a, b, joint, true);
        for _ in 0..10 {
            assert_eq!((scene.step(), scene.contacts(), touching(&scene)), (1, 1, 0));
        }
        scene.world.impulse_joints.remove(joint, true);
        assert_eq!((scene.step(), touching(&scene)), (1, 1));
    });
}

#[test]
fn links_of_a_multibody_pair_whether_they_may_touch_or_not() {
    for (contacts, touch) in [(false, 0), (true, 2)] {
        everywhere(|mut scene| {
            // Contacts, but no forces.
            let ball = || ColliderBuilder::ball(0.5).solver_groups(InteractionGroups::none());
            let links = [0.0, 0.9, 1.8].map(|x| {
                let body = RigidBodyBuilder::dynamic().translation(vector![x, 0.0, 0.0]);
                add(&mut scene, body.can_sleep(false), ball()).0
            });
            scene.ball(50.0);
            let joint = SphericalJointBuilder::new().contacts_enabled(contacts);
            let joint = joint.local_anchor1(point![0.45, 0.0, 0.0]).local_anchor2(point![-0.45, 0.0, 0.0]);
            let joints = &mut scene.world.multibody_joints;
            joints.insert(links[0], links[1], joint, true).expect("no loop");
            joints.insert(links[1], links[2], joint, true).expect("no loop");
            assert_eq!((scene.step(), scene.contacts(), touching(&scene)), (2, 2, touch));
            let joints = &mut scene.world.multibody_joints;
            let index = joints.rigid_body_link(links[0]).expect("a link").multibody;
            joints.get_multibody_mut(index).expect("a multibody").set_self_contacts_enabled(false);
            assert_eq!((scene.step(), scene.contacts(), touching(&scene)), (2, 2, 0));
        });
    }
}

#[test]
fn a_bullet_is_stopped_by_a_thin_wall_with_ccd_and_not_without() {
    for (substeps, stopped) in [(0, false), (1, true), (4, true)] {
        everywhere(|mut scene| {
            scene.world.params.max_ccd_substeps = substeps;
            scene.world.colliders.insert(ColliderBuilder::cuboid(0.05, 5.0, 5.0));
            let bullet = RigidBodyBuilder::dynamic().translation(vector![-4.0, 0.0, 0.0]).ccd_enabled(true);
            let bullet = bullet.linvel(vector![600.0, 0.0, 0.0]).can_sleep(false);
            let (bullet, _) = add(&mut scene, bullet, ColliderBuilder::ball(0.2));
            // Without CCD it is 4 m before the wall, then 6 m behind it.
            let most = (0..10).map(|_| scene.step()).max();
            let x = scene.world.bodies[bullet].translation().x;
            assert_eq!((most, x < 0.0), (Some(usize::from(stopped)), stopped), "{substeps} substeps, at {x}");
        });
    }
}

#[test]
fn soft_ccd_has_its_pair_before_the_wall_is_reached() {
    for (prediction, stopped) in [(0.0, false), (5.0, true)] {
        everywhere(|mut scene| {
            scene.world.colliders.insert(ColliderBuilder::cuboid(0.05, 5.0, 5.0));
            let body = RigidBodyBuilder::dynamic().translation(vector![-1.5, 0.0, 0.0]);
            let body = body.linvel(vector![120.0, 0.0, 0.0]).soft_ccd_prediction(prediction).can_sleep(false);
            let (body, _) = add(&mut scene, body, ColliderBuilder::ball(0.2));
            assert_eq!(scene.step(), usize::from(stopped));
            scene.steps(20);
            let x = scene.world.bodies[body].translation().x;
            assert_eq!(x < 0.0, stopped, "at {x}");
        });
    }
}

#[test]
fn kinematic_bodies_push_dynamic_ones() {
    everywhere(|mut scene| {
        let pusher = || ColliderBuilder::cuboid(0.5, 0.5, 0.5);
        let (by_position, _) = add(&mut scene, RigidBodyBuilder::kinematic_position_based(), pusher());
        let by_velocity = RigidBodyBuilder::kinematic_velocity_based().translation(vector![0.0, 0.0, 10.0]);
        add(&mut scene, by_velocity.linvel(vector![1.2, 0.0, 0.0]), pusher());
        let pushed = [0.0, 10.0].map(|z| {
            let body = RigidBodyBuilder::dynamic().translation(vector![1.2, 0.0, z]);
            add(&mut scene, body, ColliderBuilder::ball(0.5)).0
        });
        let mut most = 0_usize;
        for step in 1..=60 {
            let next = vector![0.02 * step as f32, 0.0, 0.0];
            scene.world.bodies[by_position].set_next_kinematic_translation(next);
            most = most.max(scene.step());
        }
        assert_eq!(most, 2, "each pushes its own");
        for body in pushed {
            let x = scene.world.bodies[body].translation().x;
            assert!(x > 2.15, "pushed from 1.2 to {x}");
        }
    });
}

#[test]
fn a_body_that_sleeps_wakes_when_what_it_lies_on_is_removed() {
    everywhere(|mut scene| {
        scene.world.gravity = glam::Vec3::NEG_Y * 9.81;
        let [upper, _] = [-0.5, -3.5].map(|y| {
            let slab = ColliderBuilder::cuboid(5.0, 0.5, 5.0).translation(vector![0.0, y, 0.0]);
            scene.world.colliders.insert(slab)
        });
        let body = RigidBodyBuilder::dynamic().translation(vector![0.0, 0.5, 0.0]);
        let (body, _) = add(&mut scene, body, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
        let sleeps = |scene: &Checked| scene.world.bodies[body].is_sleeping();
        let slept = (0..400).any(|_| scene.step() == 1 && sleeps(&scene));
        assert!(slept, "it lies still");
        assert_eq!((scene.step(), touching(&scene)), (1, 1));
        assert_eq!(scene.broad_phase.inner.stats().report.changed, 0);
        scene.world.remove_collider(upper);
        assert_eq!((scene.step(), scene.contacts(), sleeps(&scene)), (0, 0, false));
        assert_eq!((scene.steps(90), touching(&scene)), (1, 1), "it has fallen onto the lower slab");
        let height = scene.world.bodies[body].translation().y;
        assert!((height + 2.5).abs() < 0.02, "the middle lies at {height}");
    });
}

#[test]
fn a_body_whose_type_changes_every_few_steps_keeps_its_contact() {
    use RigidBodyType::{Dynamic, Fixed, KinematicPositionBased, KinematicVelocityBased};
    everywhere(|mut scene| {
        let [(body, _), ..] = [0.0, 0.9, 50.0].map(|x| scene.ball(x));
        for kind in
            [Fixed, Dynamic, KinematicPositionBased, Dynamic, KinematicVelocityBased, Dynamic].repeat(2)
        {
            scene.world.bodies[body].set_body_type(kind, true);
            for step in 0..3 {
                assert_eq!((scene.step(), touching(&scene)), (1, 1), "step {step} as {kind:?}");
            }
        }
    });
}

#[test]
fn a_collider_removed_twice_and_then_with_its_body_is_gone() {
    everywhere(|mut scene| {
        let [(a, on_a), ..] = [0.0, 0.9, 1.8, 50.0].map(|x| scene.ball(x));
        scene.attach(a);
        assert_eq!(scene.step(), 3, "both of the first body with the second, and the second with the third");
        scene.world.remove_collider(on_a);
        scene.world.remove_collider(on_a);
        // Listed twice in one call, and once more in the step.
        let World { params, colliders, bodies, .. } = &scene.world;
        scene.broad_phase.update(params, colliders, bodies, &[], &[on_a, on_a], &mut Vec::new());
        assert_eq!(scene.broad_phase.inner.pair_count(), 2);
        scene.world.remove(a);
        scene.world.remove(a);
        assert_eq!((scene.step(), touching(&scene)), (1, 1));
        assert_eq!(scene.contacts(), 1);
    });
}

#[test]
fn a_collider_that_becomes_a_sensor_keeps_its_pair() {
    everywhere(|mut scene| {
        let [(_, changing), ..] = [0.0, 0.9, 50.0].map(|x| scene.ball(x));
        for _ in 0..3 {
            assert_eq!((scene.step(), touching(&scene), sensed(&scene)), (1, 1, 0));
            scene.world.colliders[changing].set_sensor(true);
            assert_eq!((scene.step(), scene.contacts(), sensed(&scene)), (1, 0, 1));
            scene.world.colliders[changing].set_sensor(false);
        }
    });
}

#[test]
fn prediction_skin_and_length_unit_act_from_the_next_step_on() {
    everywhere(|mut scene| {
        let [(_, a), ..] = [0.0, 1.3, 50.0].map(|x| scene.ball(x));
        let usual = scene.world.params;
        for _ in 0..2 {
            assert_eq!(scene.step(), 0);
            scene.world.params.normalized_prediction_distance = 0.5;
            assert_eq!(scene.step(), 1, "prediction");
            scene.world.params = usual;
            assert_eq!(scene.step(), 0);
            scene.world.params.length_unit = 100.0;
            assert_eq!(scene.step(), 1, "length unit");
            scene.world.params = usual;
            assert_eq!(scene.step(), 0);
            scene.world.colliders[a].set_contact_skin(0.4);
            assert_eq!(scene.step(), 1, "skin");
            scene.world.colliders[a].set_contact_skin(0.0);
        }
    });
}

#[test]
fn pairs_of_a_stack_at_rest_are_never_deleted() {
    everywhere(|mut scene| {
        scene.world.gravity = glam::Vec3::NEG_Y * 9.81;
        let floor = ColliderBuilder::cuboid(10.0, 1.0, 10.0).translation(vector![0.0, -1.0, 0.0]);
        scene.world.colliders.insert(floor);
        for k in 0..4 {
            let body = RigidBodyBuilder::dynamic().translation(vector![0.0, 0.5 + k as f32, 0.0]);
            add(&mut scene, body.can_sleep(false), ColliderBuilder::cuboid(0.5, 0.5, 0.5));
        }
        let Checked { mut world, broad_phase: mut counted, .. } = scene;
        for step in 0..100 {
            world.step(&mut counted);
            let touching =
                world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact).count();
            assert_eq!((counted.added, counted.removed, touching), (4, 0, 4), "step {step}");
        }
        if let Some(first) = counted.first_difference() {
            panic!("{first}");
        }
    });
}
