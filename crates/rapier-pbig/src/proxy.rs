//! From a collider to what the finder needs: its box and its filter. Both as rapier 0.27's own
//! broad phase and narrow phase compute them.

use crate::call::Call;
use crate::news::News;
use crate::roll::Roll;
use pbig_core::{Aabb, ProxyFilter, TestMode, prefetch};
use rapier3d::prelude::{
    ActiveCollisionTypes, Collider, ColliderHandle, IntegrationParameters, Isometry, Point, Real, RigidBody,
    RigidBodySet, RigidBodyType, Shape, TypedShape,
};

/// What the finder is to be told about a collider.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Proxy {
    Gone,
    Disabled,
    Enabled(Aabb, ProxyFilter),
}

/// Colliders whose memory is asked for together. Most of the time goes into waiting for that of each collider and its
/// body; asked for one by one, a processor waits for one or two at a time.
pub(crate) const BLOCK: usize = 64;

/// Colliders for which no memory is asked for ahead: to make room for a block took longer than to look at one.
pub(crate) const FEW: usize = 8;

/// A collider and its body, as far as they are there.
pub(crate) type Fetched<'a> = (Option<&'a Collider>, Option<&'a RigidBody>);

impl<'a> Call<'a> {
    #[inline]
    pub(crate) fn fetch(&self, handle: ColliderHandle) -> Fetched<'a> {
        let collider = self.colliders.get(handle);
        (collider, self.body(collider))
    }

    /// The collider with an index; none if another one with it is on the roll. It is news if none is. What [`Call::proxy`]
    /// reads of it is asked for: a tenth of an update of 100,000 colliders.
    pub(crate) fn fetch_known(&self, index: u32, roll: &Roll, news: &News) -> Fetched<'a> {
        let Some((collider, handle)) = self.colliders.get_unknown_gen(index) else { return (None, None) };
        let known = roll.handle(index);
        if known.is_none() {
            news.note(index);
        }
        if known.is_some_and(|known| known != handle) {
            return (None, None);
        }
        prefetch(&collider.position().translation);
        let body = self.body(Some(collider));
        ask_for_what_it_refers_to(&(Some(collider), body));
        (Some(collider), body)
    }

    /// Of at most [`BLOCK`] colliders.
    pub(crate) fn fetch_all(&self, listed: &[ColliderHandle], found: &mut [Fetched<'a>; BLOCK]) {
        for (found, &handle) in found.iter_mut().zip(listed) {
            found.0 = self.colliders.get(handle);
        }
        for found in &mut found[..listed.len()] {
            found.1 = self.body(found.0);
        }
    }

    /// The same of [`are_scattered`] ones, and asks for most of what [`Call::proxy`] reads: the collider, its shape, and the
    /// beginning of its body.
    pub(crate) fn fetch_scattered(&self, listed: &[ColliderHandle], found: &mut [Fetched<'a>; BLOCK]) {
        for (found, &handle) in found.iter_mut().zip(listed) {
            found.0 = self.colliders.get(handle);
            if let Some(collider) = found.0 {
                prefetch(collider.shared_shape());
                prefetch(&collider.position().translation);
                prefetch(&collider.user_data);
            }
        }
        for found in &mut found[..listed.len()] {
            found.1 = self.body(found.0);
            ask_for_what_it_refers_to(found);
        }
    }

    fn body(&self, collider: Option<&Collider>) -> Option<&'a RigidBody> {
        collider.and_then(Collider::parent).and_then(|handle| self.bodies.get(handle))
    }

    #[inline(always)]
    pub(crate) fn proxy(&self, (collider, body): Fetched<'_>) -> Proxy {
        match collider {
            None => Proxy::Gone,
            Some(collider) if !collider.is_enabled() => Proxy::Disabled,
            Some(collider) => {
                Proxy::Enabled(aabb_of(self.params, body, collider), filter_with(body, collider))
            }
        }
    }
}

#[inline(always)]
fn ask_for_what_it_refers_to((collider, body): &Fetched<'_>) {
    collider.iter().for_each(|collider| prefetch(collider.shape()));
    body.iter().for_each(|body| prefetch(*body));
}

/// Whether the memory of these colliders lies so far apart that a processor does not fetch that of the next one by itself.
pub(crate) fn are_scattered(listed: &[ColliderHandle]) -> bool {
    let [first, .., last] = listed else { return false };
    let range = first.into_raw_parts().0.abs_diff(last.into_raw_parts().0);
    listed.len() > FEW && range as usize > 4 * listed.len()
}

/// The box of a collider in which it may touch another during this step: its shape, half the
/// prediction distance and its contact skin; with soft CCD, also where it is predicted to be.
///
/// Without the change margin, which is the finder's. A pose with a NaN gives an invalid
/// box, which pairs with nothing.
pub fn collision_aabb(params: &IntegrationParameters, bodies: &RigidBodySet, collider: &Collider) -> Aabb {
    aabb_of(params, parent_of(bodies, collider), collider)
}

fn parent_of<'a>(bodies: &'a RigidBodySet, collider: &Collider) -> Option<&'a RigidBody> {
    collider.parent().and_then(|handle| bodies.get(handle))
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
    // What the shape does itself, but inlined: a result that comes by memory is waited for.
    let aabb = match shape.as_typed_shape() {
        TypedShape::Cuboid(cuboid) => cuboid.aabb(pose),
        TypedShape::Ball(ball) => ball.aabb(pose),
        _ => shape.compute_aabb(pose),
    };
    Aabb::new(aabb.mins.coords.into(), aabb.maxs.coords.into())
}

/// Where soft CCD expects the collider after `dt`, at most its prediction distance away.
///
/// Rapier's clamped prediction is private. Below the distance the public one is the same. Beyond,
/// the path of the centre of mass is cut off at the distance, which is exact, and the orientation
/// there, which is not known, is covered by a ball around it: conservative, and never larger than a
/// ball. (A union with the unclamped pose alone can miss a collider that spins.)
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
    filter_with(parent_of(bodies, collider), collider)
}

#[inline(always)]
fn filter_with(body: Option<&RigidBody>, collider: &Collider) -> ProxyFilter {
    // A collider without a body counts as fixed.
    let kind = body.map_or(RigidBodyType::Fixed, RigidBody::body_type);
    let groups = collider.collision_groups();
    ProxyFilter {
        body: collider.parent().map_or(ProxyFilter::NO_BODY, |handle| handle.into_raw_parts().0),
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

/// The kinds that a collider on a body of this kind may meet. Rapier's table has four bits for each kind, and tests
/// both ways: a row of it and a column.
fn accepted_kinds(kind: RigidBodyType, types: ActiveCollisionTypes) -> u8 {
    let table = types.bits();
    let row = table >> (4 * kind as u32);
    let column = table >> kind as u32 & 0b0001_0001_0001_0001;
    let column = column | column >> 3 | column >> 6 | column >> 9;
    ((row | column) & 0b1111) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colliders_far_from_each_other_are_scattered_unless_they_are_few() {
        let listed = |count: u32, step: u32| -> Vec<ColliderHandle> {
            (0..count).map(|i| ColliderHandle::from_raw_parts(7 + i * step, 0)).collect()
        };
        let backwards: Vec<ColliderHandle> = listed(64, 5).into_iter().rev().collect();
        assert!(are_scattered(&listed(64, 5)) && are_scattered(&backwards));
        assert!(!are_scattered(&listed(64, 4)) && !are_scattered(&listed(FEW as u32, 1000)));
        assert!(!are_scattered(&[]) && !are_scattered(&listed(1, 1)));
    }

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
            let wanted = accepted.fold(0, |bits, other| bits | kind_bit(other));
            assert_eq!(accepted_kinds(kind, types), wanted, "{types:?} {kind:?}");
            tested += 1;
        }
        assert!(tested >= 4 * 64, "{tested}");
    }
}
