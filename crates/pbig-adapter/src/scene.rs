//! The trait by which an adapter shows rapier's colliders.

use crate::{Bounds, Handle};
use pbig_core::ProxyFilter;
use std::ops::Range;

/// The state of a listed collider.
#[derive(Clone, Copy, Debug)]
pub enum Proxy<A> {
    /// Not in rapier's set.
    Gone,
    /// It or its body is disabled.
    Disabled,
    /// Its AABB is not finite: it keeps its last box, and has this filter.
    Unplaced(ProxyFilter),
    /// Takes part in collisions.
    Enabled {
        /// Without margin.
        aabb: A,
        /// Which pairs it wants.
        filter: ProxyFilter,
        /// Its body is fixed or sleeps.
        is_asleep: bool,
    },
}

/// The arguments of an update.
pub trait Scene: Sync {
    /// The AABBs of the world.
    type Aabb: Bounds;

    /// Returns the number of colliders in rapier's set.
    fn collider_count(&self) -> usize;

    /// Returns the number of colliders that rapier lists as modified.
    fn listed_count(&self) -> usize;

    /// Calls `take` with each of these listed colliders and its proxy, in the order of the list.
    fn for_each_listed(&self, range: Range<usize>, take: impl FnMut(Handle, Proxy<Self::Aabb>));

    /// Calls `take` with each collider in rapier's set and its proxy.
    fn for_each_collider(&self, take: impl FnMut(Handle, Proxy<Self::Aabb>));

    /// Returns the colliders that rapier lists as removed or disabled, and whether rapier's set still has them.
    fn removed(&self) -> impl Iterator<Item = (Handle, bool)>;

    /// Returns the size class of a collider's shape, see [`crate::size_class`]. It decides which collider comes first in a pair.
    fn size(&self, handle: Handle) -> u8;
}
