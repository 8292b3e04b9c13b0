//! Runs rapier's own broad phase beside the one that is checked.

use super::Call;
use rapier3d::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};

#[derive(Clone, Default)]
pub(super) struct Stock {
    broad_phase: DefaultBroadPhase,
    /// True once stock has panicked. It is not used afterwards.
    pub(super) panicked: bool,
    /// True after the first call, in which stock sees all colliders.
    started: bool,
}

impl Stock {
    /// Calls stock, returns its events, and catches its panics: rapier 0.27's broad phase can panic if several colliders are removed or disabled
    /// in one step.
    pub(super) fn update(&mut self, call: &Call<'_>) -> Option<Vec<BroadPhasePairEvent>> {
        if self.panicked {
            return None;
        }
        let mut events = Vec::new();
        let Call { params, colliders, bodies, modified, removed } = *call;
        // Where removals leave one collider, parry's tree keeps nodes that make a later update recurse without end (parry#409).
        if !removed.is_empty() && colliders.iter_enabled().nth(1).is_none() {
            *self = Self::default();
        }
        let broad_phase = &mut self.broad_phase;
        let first = !std::mem::replace(&mut self.started, true);
        let update = || {
            if first {
                show_all(broad_phase, call, &mut events);
            }
            broad_phase.update(params, colliders, bodies, modified, removed, &mut events);
        };
        if catch_unwind(AssertUnwindSafe(update)).is_err() {
            tracing::warn!("pbig: rapier's own broad phase has panicked and is no longer compared with");
            self.panicked = true;
            return None;
        }
        Some(events)
    }
}

/// Shows all colliders to stock, because the world may be older than the checker. Stock skips colliders that have not changed,
/// so a copy of them is marked as changed.
fn show_all(stock: &mut DefaultBroadPhase, call: &Call<'_>, events: &mut Vec<BroadPhasePairEvent>) {
    let mut colliders = call.colliders.clone();
    let all: Vec<ColliderHandle> = colliders.iter_enabled().map(|(handle, _)| handle).collect();
    for &handle in &all {
        let pose = *colliders[handle].position();
        colliders[handle].set_position(pose);
    }
    stock.update(call.params, &colliders, call.bodies, &all, &[], events);
}
