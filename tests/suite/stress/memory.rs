//! The memory that a thread holds: requested less freed bytes.

use pbig_harness::counting::Counting;
pub(crate) use pbig_harness::counting::{held, largest};
use rapier3d::prelude::*;

#[global_allocator]
static COUNTING: Counting = Counting;

/// A broad phase, and the memory that its calls ask for.
pub(crate) struct Weighed<B> {
    pub(crate) inner: B,
    /// Bytes that it keeps.
    pub(crate) bytes: i64,
    /// The largest block that each call asks for.
    pub(crate) largest: Vec<usize>,
}

impl<B: BroadPhase> BroadPhase for Weighed<B> {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        // Events are the caller's.
        events.reserve(10_000);
        largest();
        let before = held();
        self.inner.update(params, colliders, bodies, modified, removed, events);
        self.bytes += held() - before;
        self.largest.push(largest());
    }
}
