//! A tee around any broad phase: passes on what it says, and checks it beside rapier's own and the
//! oracle. (`PbigBroadPhase` has the same built in: `with_shadow`.)

pub use rapier_pbig::shadow::{Difference, Fault};

use rapier_pbig::shadow::{Call, Checker, Shadow, Watcher};
use rapier3d::prelude::*;

/// A broad phase with a checker around it.
pub struct Shadowed<B> {
    /// The broad phase under test.
    pub inner: B,
    watcher: Watcher,
}

impl<B> Shadowed<B> {
    /// The checker, with its counts and differences.
    pub fn checker(&self) -> &Checker {
        &self.watcher.checker
    }
}

impl<B: BroadPhase> Shadowed<B> {
    /// Checks every call. `relative_margin` as in [`Watcher::new`].
    pub fn new(inner: B, relative_margin: f32) -> Self {
        Self { inner, watcher: Watcher::new(relative_margin).with(Shadow::Stock).with(Shadow::Oracle) }
    }

    /// Goes on with a world whose narrow phase has these pairs.
    pub fn start_over(&mut self, pairs: impl IntoIterator<Item = ColliderPair>) {
        self.watcher.start_over_with(pairs);
    }

    /// Whether rapier's own broad phase is still compared with: it can panic.
    pub fn has_stock(&self) -> bool {
        self.watcher.has_stock()
    }

    /// Compares in one of `every` calls that modify something; events are followed in all of them.
    pub fn every(self, every: usize) -> Self {
        Self { watcher: self.watcher.every(every), ..self }
    }

    /// The first thing that was wrong.
    pub fn first_difference(&self) -> Option<&Difference> {
        self.checker().differences.first()
    }
}

impl<B: BroadPhase> BroadPhase for Shadowed<B> {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        let start = events.len();
        self.inner.update(params, colliders, bodies, modified, removed, events);
        let call = Call { params, colliders, bodies, modified, removed };
        self.watcher.watch(&call, &events[start..]);
    }
}
