//! Shows rapier's colliders to the part of the broad phase that knows no rapier.

use crate::tree::from_tree;
use crate::{Bounds, to_f32};
use pbig_adapter::{BodyKind, Groups, Handle, Margins, Proxy, ProxyFilter, Scene, filter_of, size_class};
use pbig_core::TestMode;
use rapier::math::DIM;
use rapier::parry::bounding_volume::Aabb as TreeAabb;
use rapier::prelude::*;
use std::ops::Range;

/// The arguments of one update.
#[derive(Clone, Copy)]
pub(crate) struct Call<'a> {
    pub(crate) params: &'a IntegrationParameters,
    pub(crate) margins: Margins,
    pub(crate) colliders: &'a ColliderSet,
    pub(crate) bodies: &'a RigidBodySet,
    pub(crate) modified: &'a [ColliderHandle],
    pub(crate) removed: &'a [ColliderHandle],
}

impl Call<'_> {
    fn proxy(&self, handle: ColliderHandle) -> Proxy<Bounds> {
        let Some(collider) = self.colliders.get(handle) else { return Proxy::Gone };
        if !collider.is_enabled() {
            return Proxy::Disabled;
        }
        let filter = self.filter(collider);
        match self.aabb_of(collider) {
            Some(aabb) => Proxy::Enabled(from_tree(&aabb), filter),
            // Rapier's own broad phase also keeps the last box. Rapier disables such a collider at the end of the step.
            None => Proxy::Unplaced(filter),
        }
    }

    /// Returns the AABB of rapier's own broad phase, or, when soft CCD predicts nothing finite, the one without prediction.
    fn aabb_of(&self, collider: &Collider) -> Option<TreeAabb> {
        let is_finite = |aabb: &TreeAabb| aabb.mins.is_finite() && aabb.maxs.is_finite();
        let predicted = Some(collider.compute_broad_phase_aabb(self.params, self.bodies)).filter(is_finite);
        let now = || collider.compute_collision_aabb(self.params.prediction_distance() / 2.0);
        predicted.or_else(|| Some(now()).filter(is_finite))
    }

    pub(crate) fn filter(&self, collider: &Collider) -> ProxyFilter {
        let groups = groups_of(collider.collision_groups());
        let body = collider.parent().map(|body| body.into_raw_parts().into());
        filter_of(body, self.kind(collider), collider.active_collision_types().bits(), groups)
    }

    /// Returns the type of the collider's body. A collider without a body counts as fixed, the frame of a soft body as dynamic.
    pub(crate) fn kind(&self, collider: &Collider) -> BodyKind {
        let body = collider.parent().and_then(|handle| self.bodies.get(handle));
        match body.map_or(RigidBodyType::Fixed, RigidBody::body_type) {
            RigidBodyType::Dynamic | RigidBodyType::SoftFrame => BodyKind::Dynamic,
            RigidBodyType::Fixed => BodyKind::Fixed,
            RigidBodyType::KinematicPositionBased => BodyKind::KinematicPositionBased,
            RigidBodyType::KinematicVelocityBased => BodyKind::KinematicVelocityBased,
        }
    }
}

/// Returns the margins of an update. `relative` is the usual one in units of `length_unit`.
pub(crate) fn margins(relative: f32, params: &IntegrationParameters, is_adaptive: bool) -> Margins {
    let unit = to_f32(params.length_unit);
    let limits = [crate::MARGIN, crate::MAX_ADAPTIVE_MARGIN].map(|margin| margin * unit);
    Margins { usual: relative * unit, adaptive: is_adaptive.then_some(limits), axes: DIM }
}

pub(crate) fn groups_of(groups: InteractionGroups) -> Groups {
    let mode = match groups.test_mode {
        InteractionTestMode::And => TestMode::And,
        InteractionTestMode::Or => TestMode::Or,
    };
    Groups { memberships: groups.memberships.bits(), mask: groups.filter.bits(), mode }
}

pbig_adapter::define_conversions!();

impl Scene for Call<'_> {
    type Aabb = Bounds;

    fn collider_count(&self) -> usize {
        self.colliders.len()
    }

    fn listed_count(&self) -> usize {
        self.modified.len()
    }

    fn for_each_listed(&self, range: Range<usize>, mut take: impl FnMut(Handle, Proxy<Bounds>)) {
        for &listed in &self.modified[range] {
            take(handle(listed), self.proxy(listed));
        }
    }

    fn for_each_collider(&self, mut take: impl FnMut(Handle, Proxy<Bounds>)) {
        for (each, _) in self.colliders.iter() {
            take(handle(each), self.proxy(each));
        }
    }

    fn removed(&self) -> impl Iterator<Item = (Handle, bool)> {
        self.removed.iter().map(|&removed| (handle(removed), self.colliders.contains(removed)))
    }

    fn size(&self, handle: Handle) -> u8 {
        let shape = self.colliders.get(to_handle(handle)).map(Collider::shape);
        shape.map_or(0, |shape| size_class(to_f32(shape.compute_local_aabb().half_extents().max_element())))
    }
}
