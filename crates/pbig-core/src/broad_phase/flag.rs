//! What is known about an id, a bit each.

/// It was set and not removed.
pub(super) const PRESENT: u8 = 1;
/// Box or filter have changed since the last update.
pub(super) const CHANGED: u8 = 2;
/// The filter has.
pub(super) const REFILTERED: u8 = 4;
/// It has left its reach.
pub(super) const AWAY: u8 = 8;
/// The device has told that the box has lost pairs.
#[cfg(feature = "gpu")]
pub(super) const ENDING: u8 = 16;
/// It is among those that are set at once, and its turn has not come.
pub(super) const LISTED: u8 = 32;
/// It has changed before, not long ago: see `near::policy::Movers`.
pub(super) const MOVED: u8 = 64;
