//! Shows rapier's colliders to the part of the broad phase that knows no rapier.

use crate::tree::from_tree;
use pbig_adapter::{BodyKind, Groups, Handle, Margins, Proxy, Scalar as _};
use pbig_core::TestMode;
use rapier::parry::bounding_volume::Aabb as TreeAabb;
use rapier::prelude::*;

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
        let body = parent_of(self.bodies, collider);
        let (filter, is_asleep) = (filter_with(body, collider), body.is_some_and(RigidBody::is_sleeping));
        match self.aabb_of(collider) {
            Some(aabb) => Proxy::Enabled { aabb: from_tree(&aabb), filter, is_asleep },
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

    /// Calls `take` with each of these colliders and its proxy, in the order of the list.
    fn for_each_of(&self, listed: &[ColliderHandle], mut take: impl FnMut(Handle, Proxy<Bounds>)) {
        listed.iter().for_each(|&listed| take(handle(listed), self.proxy(listed)));
    }
}

/// Returns the type of a collider's body. A collider without a body counts as fixed, the frame of a soft body as dynamic.
pub(crate) fn kind_of(body: Option<&RigidBody>) -> BodyKind {
    match body.map_or(RigidBodyType::Fixed, RigidBody::body_type) {
        RigidBodyType::Dynamic | RigidBodyType::SoftFrame => BodyKind::Dynamic,
        RigidBodyType::Fixed => BodyKind::Fixed,
        RigidBodyType::KinematicPositionBased => BodyKind::KinematicPositionBased,
        RigidBodyType::KinematicVelocityBased => BodyKind::KinematicVelocityBased,
    }
}

/// Returns the margins of an update. `relative` is the usual one in units of `length_unit`.
pub(crate) fn margins(relative: f32, params: &IntegrationParameters, is_adaptive: bool) -> Margins {
    let unit = params.length_unit.to_f32();
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

pbig_adapter::define_scene!(max_element);
