//! The filters that rapier's narrow phase applies before it computes contacts: parent body, body type against active collision
//! types, collision groups.

use crate::Handle;
use pbig_core::{ProxyFilter, TestMode};

/// The type of a body, numbered as in rapier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyKind {
    /// Moved by forces.
    Dynamic,
    /// Never moves; also that of a collider without a body.
    Fixed,
    /// Moved by the app, by its position.
    KinematicPositionBased,
    /// Moved by the app, by its velocity.
    KinematicVelocityBased,
}

impl BodyKind {
    /// All kinds, in the order of their numbers.
    pub const ALL: [Self; 4] =
        [Self::Dynamic, Self::Fixed, Self::KinematicPositionBased, Self::KinematicVelocityBased];

    /// Returns the kind with a number of rapier's.
    pub fn from_number(number: u32) -> Self {
        Self::ALL.get(number as usize).copied().unwrap_or(Self::Fixed)
    }

    fn bit(self) -> u8 {
        1 << self as u8
    }

    /// Returns the kind that [`filter_of`] has stored.
    pub(crate) fn of(filter: &ProxyFilter) -> Self {
        Self::from_number(filter.kind.trailing_zeros())
    }

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Dynamic => "dynamic",
            Self::Fixed => "fixed",
            Self::KinematicPositionBased => "position-based kinematic",
            Self::KinematicVelocityBased => "velocity-based kinematic",
        }
    }
}

/// Collision groups as rapier tests them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Groups {
    /// The groups that the collider belongs to.
    pub memberships: u32,
    /// The groups that it meets.
    pub mask: u32,
    /// Says if both colliders must accept each other, or if one is enough.
    pub mode: TestMode,
}

impl Groups {
    pub(crate) fn of(filter: &ProxyFilter) -> Self {
        let is_and = filter.test_mode == TestMode::And as u16;
        let mode = if is_and { TestMode::And } else { TestMode::Or };
        Self { memberships: filter.memberships, mask: filter.mask, mode }
    }
}

/// Returns the filter of a collider. `active_types` are the bits of its active collision types.
#[inline(always)]
pub fn filter_of(body: Option<Handle>, kind: BodyKind, active_types: u16, groups: Groups) -> ProxyFilter {
    ProxyFilter {
        body: body.map_or(ProxyFilter::NO_BODY, |body| body.index),
        kind: kind.bit(),
        accepted_kinds: accepted_kinds(kind, active_types),
        test_mode: groups.mode as u16,
        memberships: groups.memberships,
        mask: groups.mask,
    }
}

/// Returns the kinds that a collider on a body of this kind may pair with, a bit each. Rapier's table has four bits for each
/// kind and is tested both ways: one row and one column.
#[inline(always)]
pub fn accepted_kinds(kind: BodyKind, active_types: u16) -> u8 {
    let row = active_types >> (4 * kind as u32);
    let column = active_types >> kind as u32 & 0b0001_0001_0001_0001;
    let column = column | column >> 3 | column >> 6 | column >> 9;
    ((row | column) & 0b1111) as u8
}
