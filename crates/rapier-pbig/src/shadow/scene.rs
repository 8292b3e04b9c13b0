//! Computes what a broad phase should see of a world, through rapier's own functions.

use super::{Call, Side};
use crate::scene::{Bounds, groups_of, handle, kind_of, parent_of, to_handle};
use pbig_adapter::HandlePair;
use rapier3d::parry::bounding_volume::BoundingVolume;
use rapier3d::parry::query::{contact, distance};
use rapier3d::prelude::*;

impl Call<'_> {
    /// Returns the pose that soft CCD predicts for a listed collider, if it is within the prediction distance: beyond, rapier
    /// clamps the motion in a private function.
    fn predicted(&self, handle: ColliderHandle, collider: &Collider) -> Option<Isometry<Real>> {
        let body = parent_of(self.bodies, collider)?;
        let predicted = body.predict_position_using_velocity_and_forces(self.params.dt);
        let way = predicted * body.local_center_of_mass() - body.position() * body.local_center_of_mass();
        // A little less: the two are computed in different ways.
        let within = way.norm() > 0.0 && way.norm() < 0.999 * body.soft_ccd_prediction();
        (within && self.modified.contains(&handle)).then_some(predicted * collider.position_wrt_parent()?)
    }

    fn aabb_of_stock(&self, handle: ColliderHandle, collider: &Collider) -> Bounds {
        let mut aabb = collider.compute_aabb();
        if let Some(predicted) = self.predicted(handle, collider) {
            aabb.merge(&collider.shape().compute_aabb(&predicted));
        }
        // As `compute_collision_aabb`, which panics if the distance is negative or NaN.
        let reach = Vector::repeat(self.params.prediction_distance() / 2.0 + collider.contact_skin());
        Bounds::new((aabb.mins - reach).coords.into(), (aabb.maxs + reach).coords.into())
    }

    fn reaches_further_with(&self, _: &Collider, body: &RigidBody) -> bool {
        body.soft_ccd_prediction() > 0.0
    }
}

fn apart(a: &Collider, b: &Collider) -> Option<Real> {
    distance(a.position(), a.shape(), b.position(), b.shape()).ok()
}

pbig_adapter::define_view!(apart);
