//! From a collider to what the finder needs: its box and its filter. Both as rapier 0.27's own
//! broad phase and narrow phase compute them.

use pbig_core::{Aabb, ProxyFilter, TestMode};
use rapier3d::prelude::{
    ActiveCollisionTypes, Collider, IntegrationParameters, Isometry, Point, Real, RigidBody, RigidBodySet,
    RigidBodyType, Shape,
};

/// The box of a collider in which it may touch another during this step: its shape, half the
/// prediction distance and its contact skin; with soft CCD, also where it is predicted to be.
///
/// Without the change margin, which is the finder's. A pose with a NaN gives an invalid box, which
/// pairs with nothing.
pub fn collision_aabb(params: &IntegrationParameters, bodies: &RigidBodySet, collider: &Collider) -> Aabb {
    let reach = collider.contact_skin() + params.prediction_distance() / 2.0;
    let now = shape_aabb(collider.shape(), collider.position());
    let parent = collider.parent().and_then(|handle| bodies.get(handle));
    let predicted = parent
        .filter(|body| body.soft_ccd_prediction() > 0.0)
        .and_then(|body| predicted_aabb(params.dt, body, collider));
    let both = predicted.map_or(now, |then| union(&now, &then));
    both.inflated(reach)
}

fn shape_aabb(shape: &dyn Shape, pose: &Isometry<Real>) -> Aabb {
    let aabb = shape.compute_aabb(pose);
    Aabb::new(aabb.mins.coords.into(), aabb.maxs.coords.into())
}

/// Where soft CCD expects the collider after `dt`, at most its prediction distance away.
///
/// Rapier's clamped prediction is private. Below the distance the public one is the same. Beyond,
/// the path of the centre of mass is cut off at the distance, which is exact, and the orientation
/// there, which is not known, is covered by a ball around it: conservative, and never larger than a
/// ball. (A union with the unclamped pose alone can miss a collider that spins.)
fn predicted_aabb(dt: Real, body: &RigidBody, collider: &Collider) -> Option<Aabb> {
    let pose_in_body = collider.position_wrt_parent()?;
    let predicted = body.predict_position_using_velocity_and_forces(dt);
    let center = body.position() * body.local_center_of_mass();
    let path = predicted * body.local_center_of_mass() - center;
    let (length, farthest) = (path.norm(), body.soft_ccd_prediction());
    if length <= farthest {
        return Some(shape_aabb(collider.shape(), &(predicted * pose_in_body)));
    }
    let sphere = collider.shape().compute_bounding_sphere(collider.position());
    let radius = sphere.radius + (sphere.center - center).norm();
    let end: Point<Real> = center + path * (farthest / length);
    // For the rounding of the norm and of rapier's own clamping, and of positions far from the origin.
    let rounding = 1e-5 * farthest + 4.0 * Real::EPSILON * center.coords.amax();
    Some(Aabb::from_center(end.coords.into(), [radius + rounding; 3]))
}

fn union(a: &Aabb, b: &Aabb) -> Aabb {
    Aabb::new(
        std::array::from_fn(|k| a.min[k].min(b.min[k])),
        std::array::from_fn(|k| a.max[k].max(b.max[k])),
    )
}

/// Rapier's early filters for a collider: parent body, body type against active collision types,
/// collision groups. What stock's narrow phase tests before it computes contacts, nothing else.
pub fn filter_of(bodies: &RigidBodySet, collider: &Collider) -> ProxyFilter {
    let parent = collider.parent();
    // A collider without a body counts as fixed.
    let body = parent.and_then(|handle| bodies.get(handle));
    let kind = body.map_or(RigidBodyType::Fixed, RigidBody::body_type);
    let groups = collider.collision_groups();
    ProxyFilter {
        body: parent.map_or(ProxyFilter::NO_BODY, |handle| handle.into_raw_parts().0),
        kind: kind_bit(kind),
        accepted_kinds: accepted_kinds(kind, collider.active_collision_types()),
        test_mode: TestMode::And as u16,
        memberships: groups.memberships.bits(),
        mask: groups.filter.bits(),
    }
}

fn kind_bit(kind: RigidBodyType) -> u8 {
    1 << kind as u8
}

/// The kinds that a collider on a body of this kind may meet: a row of rapier's table.
fn accepted_kinds(kind: RigidBodyType, types: ActiveCollisionTypes) -> u8 {
    const KINDS: [RigidBodyType; 4] = [
        RigidBodyType::Dynamic,
        RigidBodyType::Fixed,
        RigidBodyType::KinematicPositionBased,
        RigidBodyType::KinematicVelocityBased,
    ];
    KINDS.into_iter().filter(|other| types.test(kind, *other)).fold(0, |bits, other| bits | kind_bit(other))
}
