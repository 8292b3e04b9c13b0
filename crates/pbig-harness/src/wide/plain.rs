//! The properties of a world in f32 that a world in f64 takes over. All else is refused, because the worlds would differ.

use crate::world::World;
use rapier3d::prelude::*;

/// A requirement in words, and true if it is met.
type Check = (&'static str, bool);

fn first_refused(checks: &[Check]) -> Result<(), String> {
    match checks.iter().find(|(_, is_so)| !is_so) {
        Some((what, _)) => Err(format!("a world in f64 takes only {what}")),
        None => Ok(()),
    }
}

/// Checks that [`super::WideWorld`] loses nothing of a world besides its bodies and colliders.
pub(super) fn check_world(world: &World) -> Result<(), String> {
    let has_articulations = world.multibody_joints.multibodies().next().is_some();
    first_refused(&[
        ("bodies without joints", world.impulse_joints.is_empty() && !has_articulations),
        ("rapier's integration parameters", world.params == IntegrationParameters::default()),
        ("worlds before their first step", world.narrow_phase.contact_pairs().next().is_none()),
        ("bodies with one collider", world.bodies.iter().all(|(_, body)| body.colliders().len() == 1)),
    ])
}

/// Checks a body. Its pose and velocity are taken over; the rest must be rapier's defaults for a dynamic body.
pub(super) fn check_body(body: &RigidBody) -> Result<(), String> {
    let has_no_force = body.user_force() == Vector::zeros() && body.user_torque() == AngVector::zeros();
    first_refused(&[
        ("dynamic bodies", body.is_dynamic()),
        ("enabled bodies", body.is_enabled()),
        ("awake bodies that sleep as rapier has it", *body.activation() == RigidBodyActivation::active()),
        ("bodies without CCD", !body.is_ccd_enabled() && body.soft_ccd_prediction() == 0.0),
        ("bodies under all of gravity", body.gravity_scale() == 1.0),
        ("undamped bodies", body.linear_damping() == 0.0 && body.angular_damping() == 0.0),
        ("bodies with free axes", body.locked_axes().is_empty()),
        ("bodies of dominance 0", body.dominance_group() == 0),
        ("bodies without solver iterations of their own", body.additional_solver_iterations() == 0),
        ("bodies with the mass of their collider", body.mass_properties().additional_local_mprops.is_none()),
        ("bodies that no force acts on", has_no_force),
    ])
}

/// Checks a collider. Shape, place, density, friction and restitution are taken over; the rest must be rapier's defaults.
pub(super) fn check_collider(collider: &Collider) -> Result<(), String> {
    let all = InteractionGroups::all();
    let rules = [collider.friction_combine_rule(), collider.restitution_combine_rule()];
    let of_density = collider.shape().mass_properties(collider.density());
    let wrt_parent = collider.position_wrt_parent();
    first_refused(&[
        ("enabled colliders", collider.is_enabled()),
        ("colliders that are no sensors", !collider.is_sensor()),
        ("colliders of all groups", [collider.collision_groups(), collider.solver_groups()] == [all; 2]),
        ("colliders without skin", collider.contact_skin() == 0.0),
        ("rapier's combine rules", rules == [CoefficientCombineRule::default(); 2]),
        ("rapier's collision types", collider.active_collision_types() == ActiveCollisionTypes::default()),
        ("colliders without hooks", collider.active_hooks().is_empty()),
        ("colliders with a density", collider.mass_properties() == of_density),
        ("colliders in the middle of bodies", wrt_parent.is_none_or(|pose| *pose == Isometry::identity())),
    ])
}

#[cfg(test)]
mod tests {
    use super::super::WideWorld;
    use super::*;
    use rapier_pbig::PbigBroadPhase;

    /// A ball on a plane.
    fn world() -> World {
        let mut world = World::default();
        world.colliders.insert(ColliderBuilder::halfspace(Vector::y_axis()));
        world.add(World::dynamic(glam::Vec3::Y * 0.5), ColliderBuilder::ball(0.5));
        world
    }

    fn refused(change: impl FnOnce(&mut World)) -> Option<String> {
        let mut world = world();
        change(&mut world);
        WideWorld::of(&world, [0.0; 3]).err()
    }

    /// The end of what is told, and what is changed.
    type Change = (&'static str, fn(&mut World));

    /// Each of these changes must be refused, and for its own reason.
    fn all_refused(changes: &[Change]) {
        assert_eq!(refused(|_| ()), None, "a plain world is taken");
        for (told, change) in changes {
            let found = refused(change).unwrap_or_default();
            assert!(found.ends_with(told), "{told}: {found:?}");
        }
    }

    fn body(world: &mut World) -> &mut RigidBody {
        world.bodies.iter_mut().next().expect("the ball's").1
    }

    fn ball(world: &mut World) -> &mut Collider {
        world.colliders.iter_mut().last().expect("the ball").1
    }

    #[test]
    fn a_world_with_more_than_plain_bodies_is_refused() {
        all_refused(&[
            ("without joints", |world| {
                let other = world.add(World::dynamic(glam::Vec3::Y * 2.0), ColliderBuilder::ball(0.5));
                let ball = world.bodies.iter().next().expect("the ball's").0;
                world.impulse_joints.insert(ball, other, FixedJoint::default(), true);
            }),
            ("without joints", |world| {
                let other = world.add(World::dynamic(glam::Vec3::Y * 2.0), ColliderBuilder::ball(0.5));
                let ball = world.bodies.iter().next().expect("the ball's").0;
                world.multibody_joints.insert(ball, other, FixedJoint::default(), true);
            }),
            ("integration parameters", |world| world.params.dt /= 2.0),
            ("their first step", |world| world.step(&mut PbigBroadPhase::new())),
            ("one collider", |world| _ = world.bodies.insert(RigidBodyBuilder::dynamic())),
            ("no Capsule", |world| ball(world).set_shape(SharedShape::capsule_y(1.0, 0.5))),
        ]);
    }

    #[test]
    fn a_body_that_is_not_plain_is_refused() {
        all_refused(&[
            ("dynamic bodies", |world| body(world).set_body_type(RigidBodyType::Fixed, false)),
            ("enabled bodies", |world| body(world).set_enabled(false)),
            ("as rapier has it", |world| body(world).sleep()),
            ("as rapier has it", |world| *body(world).activation_mut() = RigidBodyActivation::cannot_sleep()),
            ("without CCD", |world| body(world).enable_ccd(true)),
            ("without CCD", |world| body(world).set_soft_ccd_prediction(0.1)),
            ("all of gravity", |world| body(world).set_gravity_scale(0.5, false)),
            ("undamped bodies", |world| body(world).set_linear_damping(0.1)),
            ("undamped bodies", |world| body(world).set_angular_damping(0.1)),
            ("free axes", |world| body(world).set_locked_axes(LockedAxes::ROTATION_LOCKED_X, false)),
            ("dominance 0", |world| body(world).set_dominance_group(1)),
            ("of their own", |world| body(world).set_additional_solver_iterations(2)),
            ("mass of their collider", |world| body(world).set_additional_mass(1.0, false)),
            ("no force acts on", |world| body(world).add_force(Vector::x(), false)),
            ("no force acts on", |world| body(world).add_torque(Vector::x(), false)),
        ]);
    }

    #[test]
    fn a_collider_that_is_not_plain_is_refused() {
        let other = InteractionGroups::new(Group::GROUP_1, Group::GROUP_2);
        assert!(
            refused(|world| ball(world).set_collision_groups(other))
                .is_some_and(|it| it.ends_with("all groups"))
        );
        assert!(
            refused(|world| ball(world).set_solver_groups(other))
                .is_some_and(|it| it.ends_with("all groups"))
        );
        all_refused(&[
            ("enabled colliders", |world| ball(world).set_enabled(false)),
            ("no sensors", |world| ball(world).set_sensor(true)),
            ("without skin", |world| ball(world).set_contact_skin(0.1)),
            ("combine rules", |world| ball(world).set_friction_combine_rule(CoefficientCombineRule::Max)),
            ("combine rules", |world| ball(world).set_restitution_combine_rule(CoefficientCombineRule::Min)),
            ("collision types", |world| ball(world).set_active_collision_types(ActiveCollisionTypes::all())),
            ("without hooks", |world| ball(world).set_active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS)),
            ("a density", |world| ball(world).set_mass_properties(MassProperties::from_ball(1.0, 2.0))),
            ("middle of bodies", |world| {
                ball(world).set_position_wrt_parent(Isometry::translation(1.0, 0.0, 0.0))
            }),
        ]);
    }
}
