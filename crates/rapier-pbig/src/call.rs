//! The arguments that rapier passes to a broad phase.

use rapier3d::prelude::{ColliderHandle, ColliderSet, IntegrationParameters, RigidBodySet};

/// The arguments of one call of rapier's `BroadPhase::update`.
#[derive(Clone, Copy)]
#[cfg_attr(not(feature = "shadow"), expect(unreachable_pub, reason = "public in `shadow`"))]
pub struct Call<'a> {
    /// Step length, length unit, prediction distance.
    pub params: &'a IntegrationParameters,
    /// The colliders.
    pub colliders: &'a ColliderSet,
    /// The bodies of the colliders.
    pub bodies: &'a RigidBodySet,
    /// Colliders that may have changed.
    pub modified: &'a [ColliderHandle],
    /// Colliders that were removed or disabled.
    pub removed: &'a [ColliderHandle],
}
