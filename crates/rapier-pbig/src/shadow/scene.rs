//! Computes what a broad phase should see of a world, through rapier's own functions.

use super::{Call, HandlePair, Side, ordered};
use pbig_core::{Aabb, oracle};
use rapier3d::parry::bounding_volume::BoundingVolume;
use rapier3d::parry::query::{contact, distance};
use rapier3d::prelude::*;
use std::collections::HashSet;

pub(super) struct SceneView<'a> {
    pub(super) params: &'a IntegrationParameters,
    pub(super) colliders: &'a ColliderSet,
    pub(super) bodies: &'a RigidBodySet,
    listed: HashSet<ColliderHandle>,
}

impl<'a> SceneView<'a> {
    pub(super) fn new(call: &Call<'a>) -> Self {
        let Call { params, colliders, bodies, modified, .. } = *call;
        Self { params, colliders, bodies, listed: modified.iter().copied().collect() }
    }

    fn enabled(&self, handle: ColliderHandle) -> Option<&Collider> {
        self.colliders.get(handle).filter(|collider| collider.is_enabled())
    }

    fn aabb(&self, handle: ColliderHandle) -> Option<Aabb> {
        let collider = self.enabled(handle)?;
        let mut aabb = collider.compute_aabb();
        if let Some(predicted) = self.predicted(collider).filter(|_| self.listed.contains(&handle)) {
            aabb.merge(&collider.shape().compute_aabb(&predicted));
        }
        // As `compute_collision_aabb`, which panics if the distance is negative or NaN.
        let reach = Vector::repeat(self.params.prediction_distance() / 2.0 + collider.contact_skin());
        Some(Aabb::new((aabb.mins - reach).coords.into(), (aabb.maxs + reach).coords.into()))
    }

    /// Returns the pose that soft CCD predicts for a listed collider, if it is within the prediction distance: beyond, rapier
    /// clamps the motion in a private function.
    fn predicted(&self, collider: &Collider) -> Option<Isometry<Real>> {
        let body = self.bodies.get(collider.parent()?)?;
        let predicted = body.predict_position_using_velocity_and_forces(self.params.dt);
        let way = predicted * body.local_center_of_mass() - body.position() * body.local_center_of_mass();
        // A little less: the two are computed in different ways.
        let within = way.norm() > 0.0 && way.norm() < 0.999 * body.soft_ccd_prediction();
        within.then_some(predicted * collider.position_wrt_parent()?)
    }

    /// Returns a collider as a difference shows it.
    pub(super) fn side(&self, handle: ColliderHandle) -> Option<Side> {
        let collider = self.colliders.get(handle)?;
        Some(Side {
            aabb: self.aabb(handle),
            parent: collider.parent(),
            body_type: self.body_type(collider),
            active_collision_types: collider.active_collision_types(),
            groups: collider.collision_groups(),
        })
    }

    /// Returns the type of the collider's body. A collider without a body counts as fixed.
    fn body_type(&self, collider: &Collider) -> RigidBodyType {
        let body = collider.parent().and_then(|handle| self.bodies.get(handle));
        body.map_or(RigidBodyType::Fixed, |body| body.body_type())
    }

    /// Returns the AABBs by collider index, and [`Aabb::NOWHERE`] for an unused index.
    pub(super) fn boxes(&self) -> Vec<Aabb> {
        let mut boxes = Vec::new();
        for (handle, _) in self.colliders.iter_enabled() {
            let index = handle.into_raw_parts().0 as usize;
            boxes.resize(boxes.len().max(index + 1), Aabb::NOWHERE);
            boxes[index] = self.aabb(handle).unwrap_or(Aabb::NOWHERE);
        }
        boxes
    }

    pub(super) fn oracle(&self) -> HashSet<HandlePair> {
        let handles: Vec<ColliderHandle> = self.colliders.iter_enabled().map(|(handle, _)| handle).collect();
        let boxes: Vec<Aabb> = handles.iter().map(|&h| self.aabb(h).unwrap_or(Aabb::NOWHERE)).collect();
        let pair = |a: u32, b: u32| ordered(handles[a as usize], handles[b as usize]);
        let found = oracle::pairs_where(&boxes, |a, b| self.allowed(pair(a, b)));
        found.into_iter().map(|p| pair(p.a, p.b)).collect()
    }

    /// Applies the filters that the narrow phase applies before it computes contacts.
    pub(super) fn allowed(&self, (a, b): HandlePair) -> bool {
        let (Some(a), Some(b)) = (self.enabled(a), self.enabled(b)) else { return false };
        let same_body = a.parent().is_some() && a.parent() == b.parent();
        let kinds = a.active_collision_types().test(self.body_type(a), self.body_type(b))
            || b.active_collision_types().test(self.body_type(a), self.body_type(b));
        !same_body && kinds && a.collision_groups().test(b.collision_groups())
    }

    /// Returns true if parry finds a contact within rapier's prediction distance. Parry 0.22's contact query between a cuboid and
    /// a compound can report a penetration for shapes 0.08 apart (in the scene `compounds`), so its distance query must agree.
    /// If parry cannot compare the shapes, their AABBs decide.
    pub(super) fn in_contact(&self, (a, b): HandlePair) -> bool {
        let (Some(x), Some(y)) = (self.enabled(a), self.enabled(b)) else { return false };
        let reach = self.params.prediction_distance() + x.contact_skin() + y.contact_skin();
        let apart = distance(x.position(), x.shape(), y.position(), y.shape());
        match contact(x.position(), x.shape(), y.position(), y.shape(), reach) {
            Ok(found) => found.is_some() && !apart.is_ok_and(|length| length > reach),
            Err(_) => matches!((self.aabb(a), self.aabb(b)), (Some(a), Some(b)) if a.overlaps(&b)),
        }
    }

    /// Returns true if a pair has a reason: both colliders exist, the filters allow it, and the AABBs are near enough. AABBs with
    /// soft CCD reach further, so such pairs always pass.
    pub(super) fn may_pair(&self, (a, b): HandlePair, relative_margin: f32) -> bool {
        let soft_ccd = |handle: ColliderHandle| {
            let body = self.enabled(handle).and_then(Collider::parent).and_then(|body| self.bodies.get(body));
            body.is_some_and(|body| body.soft_ccd_prediction() > 0.0)
        };
        let (Some(box_a), Some(box_b)) = (self.aabb(a), self.aabb(b)) else { return false };
        // A thousandth more than two margins for the rounding of each inflation.
        let reach = 2.001 * relative_margin * self.params.length_unit;
        let near = inflated_by_more(&box_a, reach).overlaps(&inflated_by_more(&box_b, reach));
        self.allowed((a, b)) && (near || soft_ccd(a) || soft_ccd(b))
    }
}

/// Inflates an AABB by at least one unit in the last place.
fn inflated_by_more(aabb: &Aabb, reach: f32) -> Aabb {
    let grown = aabb.inflated(reach);
    Aabb::new(grown.min.map(f32::next_down), grown.max.map(f32::next_up))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns two balls of radius 0.5 with this distance between their centres.
    pub(in crate::shadow) fn balls(apart: f32) -> (ColliderSet, HandlePair) {
        let mut colliders = ColliderSet::new();
        let mut ball = |x: f32| {
            let types = ActiveCollisionTypes::all();
            colliders.insert(
                ColliderBuilder::ball(0.5).translation(vector![x, 0.0, 0.0]).active_collision_types(types),
            )
        };
        let pair = ordered(ball(0.0), ball(apart));
        (colliders, pair)
    }

    fn with_scene<T>(apart: f32, look: impl Fn(&SceneView<'_>, HandlePair) -> T) -> T {
        let (colliders, pair) = balls(apart);
        let (params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
        let call =
            Call { params: &params, colliders: &colliders, bodies: &bodies, modified: &[], removed: &[] };
        look(&SceneView::new(&call), pair)
    }

    #[test]
    fn contact_is_touch_or_less_than_a_prediction_distance_apart() {
        for (apart, contact) in [(0.9, true), (1.0, true), (1.0015, true), (1.01, false), (5.0, false)] {
            assert_eq!(with_scene(apart, |scene, pair| scene.in_contact(pair)), contact, "{apart}");
        }
    }

    #[test]
    fn a_pair_may_be_two_margins_a_box_apart_and_no_more() {
        for (apart, may) in [(1.0, true), (1.04, true), (1.05, false)] {
            assert_eq!(with_scene(apart, |scene, pair| scene.may_pair(pair, 0.01)), may, "{apart}");
        }
    }
}
