//! Computes what a broad phase should see of a world, through rapier's own functions.

use super::{Call, Side, View};
use crate::scene::{groups_of, handle, kind_of, to_handle};
use pbig_adapter::{Handle, HandlePair};
use pbig_core::Aabb;
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

    fn find(&self, wanted: Handle) -> Option<&Collider> {
        self.colliders.get(to_handle(wanted)).filter(|collider| collider.is_enabled())
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

    /// Returns the type of the collider's body. A collider without a body counts as fixed.
    fn body_type(&self, collider: &Collider) -> RigidBodyType {
        let body = collider.parent().and_then(|handle| self.bodies.get(handle));
        body.map_or(RigidBodyType::Fixed, |body| body.body_type())
    }
}

impl View for SceneView<'_> {
    type Aabb = Aabb;

    fn enabled(&self) -> Vec<Handle> {
        self.colliders.iter_enabled().map(|(each, _)| handle(each)).collect()
    }

    fn side(&self, wanted: Handle) -> Option<Side> {
        let collider = self.colliders.get(to_handle(wanted))?;
        let body = collider.parent().and_then(|parent| self.bodies.get(parent));
        Some(Side {
            aabb: self.aabb(wanted),
            parent: collider.parent().map(|parent| parent.into_raw_parts().into()),
            body_type: kind_of(body),
            active_collision_types: collider.active_collision_types().bits(),
            groups: groups_of(collider.collision_groups()),
        })
    }

    fn aabb(&self, wanted: Handle) -> Option<Aabb> {
        let collider = self.find(wanted)?;
        let mut aabb = collider.compute_aabb();
        if let Some(predicted) = self.predicted(collider).filter(|_| self.listed.contains(&to_handle(wanted)))
        {
            aabb.merge(&collider.shape().compute_aabb(&predicted));
        }
        // As `compute_collision_aabb`, which panics if the distance is negative or NaN.
        let reach = Vector::repeat(self.params.prediction_distance() / 2.0 + collider.contact_skin());
        Some(Aabb::new((aabb.mins - reach).coords.into(), (aabb.maxs + reach).coords.into()))
    }

    fn allowed(&self, HandlePair(a, b): HandlePair) -> bool {
        let (Some(a), Some(b)) = (self.find(a), self.find(b)) else { return false };
        let same_body = a.parent().is_some() && a.parent() == b.parent();
        let kinds = a.active_collision_types().test(self.body_type(a), self.body_type(b))
            || b.active_collision_types().test(self.body_type(a), self.body_type(b));
        !same_body && kinds && a.collision_groups().test(b.collision_groups())
    }

    /// Parry 0.22's contact query between a cuboid and
    /// a compound can report a penetration for shapes 0.08 apart (in the scene `compounds`), so its distance query must agree.
    /// If parry cannot compare the shapes, their AABBs decide.
    fn in_contact(&self, HandlePair(a, b): HandlePair) -> bool {
        let (Some(x), Some(y)) = (self.find(a), self.find(b)) else { return false };
        let reach = self.params.prediction_distance() + x.contact_skin() + y.contact_skin();
        let apart = distance(x.position(), x.shape(), y.position(), y.shape());
        match contact(x.position(), x.shape(), y.position(), y.shape(), reach) {
            Ok(found) => found.is_some() && !apart.is_ok_and(|length| length > reach),
            Err(_) => matches!((self.aabb(a), self.aabb(b)), (Some(a), Some(b)) if a.overlaps(&b)),
        }
    }

    fn reaches_further(&self, wanted: Handle) -> bool {
        let body = self.find(wanted).and_then(Collider::parent).and_then(|body| self.bodies.get(body));
        body.is_some_and(|body| body.soft_ccd_prediction() > 0.0)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns two balls of radius 0.5 with this distance between their centres.
    pub(in crate::shadow) fn balls(apart: f32) -> (ColliderSet, [ColliderHandle; 2]) {
        let mut colliders = ColliderSet::new();
        let mut ball = |x: f32| {
            let types = ActiveCollisionTypes::all();
            colliders.insert(
                ColliderBuilder::ball(0.5).translation(vector![x, 0.0, 0.0]).active_collision_types(types),
            )
        };
        let pair = [ball(0.0), ball(apart)];
        (colliders, pair)
    }

    fn with_scene<T>(apart: f32, look: impl Fn(&SceneView<'_>, HandlePair) -> T) -> T {
        let (colliders, pair) = balls(apart);
        let (params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
        let call =
            Call { params: &params, colliders: &colliders, bodies: &bodies, modified: &[], removed: &[] };
        look(&SceneView::new(&call), HandlePair(handle(pair[0]), handle(pair[1])))
    }

    #[test]
    fn contact_is_touch_or_less_than_a_prediction_distance_apart() {
        for (apart, contact) in [(0.9, true), (1.0, true), (1.0015, true), (1.01, false), (5.0, false)] {
            assert_eq!(with_scene(apart, |scene, pair| scene.in_contact(pair)), contact, "{apart}");
        }
    }
}
