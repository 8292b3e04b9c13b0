//! Runs rapier's own broad phase beside the one that is checked.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Rapier's own broad phase. It is dropped when it panics.
#[derive(Clone)]
pub struct Stock<S> {
    broad_phase: Option<S>,
    has_started: bool,
}

impl<S: Default> Default for Stock<S> {
    fn default() -> Self {
        Self { broad_phase: Some(S::default()), has_started: false }
    }
}

impl<S> Stock<S> {
    /// Returns true once stock has panicked.
    pub fn has_panicked(&self) -> bool {
        self.broad_phase.is_none()
    }

    /// Returns true in the first call, before which stock must see all colliders.
    pub fn starts(&mut self) -> bool {
        !std::mem::replace(&mut self.has_started, true)
    }

    /// Calls a function of stock, and returns its result unless stock panics or has panicked.
    pub fn guard<R>(&mut self, work: impl FnOnce(&mut S) -> R) -> Option<R> {
        let stock = self.broad_phase.as_mut()?;
        let result = catch_unwind(AssertUnwindSafe(|| work(stock))).ok();
        if result.is_none() {
            tracing::warn!("pbig: rapier's own broad phase has panicked and is no longer compared with");
            self.broad_phase = None;
        }
        result
    }
}
