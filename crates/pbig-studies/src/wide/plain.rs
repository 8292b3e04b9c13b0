//! The properties of a world in f32 that a world in f64 takes over. All else is refused, because the worlds would differ.

use pbig_harness::world::World;
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

    /// Returns why a ball on a plane is refused after a change.
    fn refused(change: impl FnOnce(&mut RigidBody, &mut Collider)) -> Option<String> {
        let mut world = World::default();
        world.colliders.insert(ColliderBuilder::halfspace(Vector::y_axis()));
        let ball = world.add(World::dynamic(glam::Vec3::Y * 0.5), ColliderBuilder::ball(0.5));
        let collider = world.bodies[ball].colliders()[0];
        change(&mut world.bodies[ball], &mut world.colliders[collider]);
        WideWorld::of(&world, [0.0; 3]).err()
    }

    #[test]
    fn a_world_that_is_not_plain_is_refused() {
        assert_eq!(refused(|_, _| ()), None, "a plain world is taken");
        let tells =
            |found: Option<String>, words: &str| assert!(found.is_some_and(|why| why.ends_with(words)));
        tells(refused(|body, _| body.enable_ccd(true)), "without CCD");
        tells(refused(|body, _| body.sleep()), "as rapier has it");
        tells(refused(|body, _| body.set_linear_damping(0.1)), "undamped bodies");
        tells(refused(|_, ball| ball.set_sensor(true)), "no sensors");
        tells(refused(|_, ball| ball.set_contact_skin(0.1)), "without skin");
        tells(refused(|_, ball| ball.set_shape(SharedShape::capsule_y(1.0, 0.5))), "no Capsule");
    }
}
