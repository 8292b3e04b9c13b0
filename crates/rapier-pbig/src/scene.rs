//! Shows rapier's colliders to the part of the broad phase that knows no rapier: the AABB and the filter of each, as rapier
//! 0.27's own broad phase and narrow phase compute them.

use crate::call::Call;
use pbig_adapter::policy::COLLIDERS_PER_BLOCK;
use pbig_adapter::{BodyKind, Groups, Handle, Proxy};
use pbig_core::{Aabb, ProxyFilter, TestMode};
use rapier3d::prelude::{
    BroadPhasePairEvent, Collider, ColliderHandle, ColliderPair, IntegrationParameters, InteractionGroups,
    Isometry, Point, Real, RigidBody, RigidBodySet, RigidBodyType, Shape, TypedShape,
};

/// A collider and its body, if they exist.
pub(crate) type Fetched<'a> = (Option<&'a Collider>, Option<&'a RigidBody>);

impl<'a> Call<'a> {
    #[inline(always)]
    pub(crate) fn fetch(&self, handle: ColliderHandle) -> Fetched<'a> {
        let collider = self.colliders.get(handle);
        (collider, collider.and_then(|collider| parent_of(self.bodies, collider)))
    }

    #[inline(always)]
    pub(crate) fn proxy(&self, (collider, body): Fetched<'_>) -> Proxy<Aabb> {
        match collider {
            None => Proxy::Gone,
            Some(collider) if !collider.is_enabled() => Proxy::Disabled,
            Some(collider) => {
                let is_asleep = body.is_some_and(RigidBody::is_sleeping);
                let (aabb, filter) = (aabb_of(self.params, body, collider), filter_with(body, collider));
                Proxy::Enabled { aabb, filter, is_asleep }
            }
        }
    }
}

/// Returns the AABB in which a collider may touch another one during this step: its shape, half the prediction distance and
/// its contact skin; with soft CCD, also the AABB at the predicted pose.
///
/// The margin is not included. A pose with a NaN gives an invalid AABB, which pairs with nothing.
pub fn collision_aabb(params: &IntegrationParameters, bodies: &RigidBodySet, collider: &Collider) -> Aabb {
    aabb_of(params, parent_of(bodies, collider), collider)
}

#[inline(always)]
fn aabb_of(params: &IntegrationParameters, parent: Option<&RigidBody>, collider: &Collider) -> Aabb {
    let mut aabb = shape_aabb(collider.shape(), collider.position());
    if let Some(body) = parent.filter(|body| body.soft_ccd_prediction() > 0.0)
        && let Some(then) = predicted_aabb(params.dt, body, collider)
    {
        aabb = union(&aabb, &then);
    }
    aabb.inflated(collider.contact_skin() + params.prediction_distance() / 2.0)
}

#[inline(always)]
fn shape_aabb(shape: &dyn Shape, pose: &Isometry<Real>) -> Aabb {
    // As `Shape::compute_aabb`, but inlined: a virtual call returns the box through memory, which costs a wait.
    let aabb = match shape.as_typed_shape() {
        TypedShape::Cuboid(cuboid) => cuboid.aabb(pose),
        TypedShape::Ball(ball) => ball.aabb(pose),
        _ => shape.compute_aabb(pose),
    };
    Aabb::new(aabb.mins.coords.into(), aabb.maxs.coords.into())
}

/// Returns the AABB where soft CCD expects the collider after `dt`, at most its prediction distance away.
///
/// Rapier's clamped prediction is private. Up to the distance, the public prediction is the same. Beyond it, the path of the
/// centre of mass is cut off at the distance, which is exact. The orientation there is not known, so the AABB encloses the
/// shape's bounding sphere in every orientation. (A union with the unclamped pose alone can miss a collider that spins.)
#[cold]
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
    // Covers the rounding of the norm, of rapier's own clamping, and of positions far from the origin.
    let rounding = 1e-5 * farthest + 4.0 * Real::EPSILON * center.coords.amax();
    Some(Aabb::from_center(end.coords.into(), [radius + rounding; 3]))
}

fn union(a: &Aabb, b: &Aabb) -> Aabb {
    Aabb::new(
        std::array::from_fn(|k| a.min[k].min(b.min[k])),
        std::array::from_fn(|k| a.max[k].max(b.max[k])),
    )
}

/// Returns the filters that rapier's narrow phase applies before it computes contacts: parent body, body type against active
/// collision types, collision groups.
pub fn filter_of(bodies: &RigidBodySet, collider: &Collider) -> ProxyFilter {
    filter_with(parent_of(bodies, collider), collider)
}

/// Returns the type of a collider's body. A collider without a body counts as fixed.
#[inline(always)]
pub(crate) fn kind_of(body: Option<&RigidBody>) -> BodyKind {
    BodyKind::from_number(body.map_or(RigidBodyType::Fixed, RigidBody::body_type) as u32)
}

pub(crate) fn groups_of(groups: InteractionGroups) -> Groups {
    Groups { memberships: groups.memberships.bits(), mask: groups.filter.bits(), mode: TestMode::And }
}

pbig_adapter::define_scene!(max);

impl Call<'_> {
    /// Calls `take` with each of these colliders and its proxy, in the order of the list.
    #[inline(always)]
    fn for_each_of(&self, listed: &[ColliderHandle], mut take: impl FnMut(Handle, Proxy<Aabb>)) {
        for block in listed.chunks(COLLIDERS_PER_BLOCK) {
            let mut fetched = [(None, None); COLLIDERS_PER_BLOCK];
            for (fetched, &handle) in fetched.iter_mut().zip(block) {
                *fetched = self.fetch(handle);
            }
            for (&listed, fetched) in block.iter().zip(fetched) {
                take(handle(listed), self.proxy(fetched));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rapier3d::prelude::ActiveCollisionTypes;

    #[test]
    fn accepted_kinds_are_those_that_rapier_tests() {
        const KINDS: [RigidBodyType; 4] = [
            RigidBodyType::Dynamic,
            RigidBodyType::Fixed,
            RigidBodyType::KinematicPositionBased,
            RigidBodyType::KinematicVelocityBased,
        ];
        let sets = (0..=u16::MAX).filter_map(ActiveCollisionTypes::from_bits);
        let mut tested = 0;
        for (types, kind) in sets.flat_map(|types| KINDS.map(|kind| (types, kind))) {
            let accepted = KINDS.into_iter().filter(|other| types.test(kind, *other));
            let wanted = accepted.fold(0, |bits, other| bits | 1 << other as u8);
            let kind = BodyKind::from_number(kind as u32);
            assert_eq!(pbig_adapter::accepted_kinds(kind, types.bits()), wanted, "{types:?} {kind:?}");
            tested += 1;
        }
        assert!(tested >= 4 * 64, "{tested}");
    }
}
