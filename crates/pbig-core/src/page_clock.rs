//! The clock on wasm32-unknown-unknown. The platform has none, so the page gives one.

use std::sync::OnceLock;
use std::time::Duration;

static NOW: OnceLock<fn() -> Duration> = OnceLock::new();

/// Uses this clock from now on, which returns the time since a moment in the past. A second call changes nothing.
pub fn set_clock(now: fn() -> Duration) {
    let _ = NOW.set(now);
}

pub(crate) fn is_set() -> bool {
    NOW.get().is_some()
}

/// A moment. Without a clock all moments are equal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instant(Duration);

impl Instant {
    pub(crate) fn now() -> Self {
        Self(NOW.get().map_or(Duration::ZERO, |now| now()))
    }

    pub(crate) fn duration_since(self, earlier: Self) -> Duration {
        self.0.saturating_sub(earlier.0)
    }
}
