//! What a checker found wrong, in words.

use pbig_core::Aabb;
use rapier3d::prelude::*;
use std::fmt;
use std::path::PathBuf;

/// What is wrong with a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Boxes overlap and filters allow the pair, but it was not reported.
    Missing,
    /// Only stock reports it, and parry finds a contact within the prediction distance.
    MissingContact,
    /// Reported, although the boxes are further apart than the margins, or a filter excludes it, or
    /// a collider is gone or disabled.
    Spurious,
    /// `AddPair` for a pair that is there.
    AddedTwice,
    /// `DeletePair` for a pair that is not there.
    DeletedUnknown,
    /// Deleted and added in one call: the narrow phase would lose the pair's contacts.
    Flickered,
    /// A pair of a collider with itself, at which rapier panics.
    WithItself,
}

impl Fault {
    /// Whether a pair should have been there and was not.
    pub fn is_missing(self) -> bool {
        matches!(self, Self::Missing | Self::MissingContact)
    }

    /// The reason, in words.
    pub const fn reason(self) -> &'static str {
        match self {
            Self::Missing => "missing: the boxes overlap and no filter excludes the pair",
            Self::MissingContact => "missing: parry finds a contact within the prediction distance",
            Self::Spurious => "spurious: the pair has no reason to be there",
            Self::AddedTwice => "added twice",
            Self::DeletedUnknown => "deleted without having been added",
            Self::Flickered => "deleted and added again in one call",
            Self::WithItself => "a collider paired with itself",
        }
    }
}

/// A collider of a difference, as it was then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// Its box, without any margin; none when it is disabled.
    pub aabb: Option<Aabb>,
    /// The body that it belongs to.
    pub parent: Option<RigidBodyHandle>,
    /// That body's type; `Fixed` without one.
    pub body_type: RigidBodyType,
    /// Which types may meet.
    pub active_collision_types: ActiveCollisionTypes,
    /// Which groups may meet.
    pub groups: InteractionGroups,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.aabb {
            Some(aabb) => write!(f, "box {:?} to {:?}", aabb.min, aabb.max)?,
            None => write!(f, "disabled")?,
        }
        match self.parent {
            Some(parent) => write!(f, ", {:?} body {:?}", self.body_type, parent.into_raw_parts())?,
            None => write!(f, ", no body")?,
        }
        let (groups, types) = (self.groups, self.active_collision_types.bits());
        let (memberships, filter) = (groups.memberships.bits(), groups.filter.bits());
        write!(f, ", groups {memberships:#x} with {filter:#x}, active types {types:#06x}")
    }
}

/// A pair about which the broad phase is wrong.
#[derive(Clone, Debug)]
pub struct Difference {
    /// The call in which it was noticed, from 0.
    pub call: usize,
    /// What is wrong.
    pub fault: Fault,
    /// The pair.
    pub pair: (ColliderHandle, ColliderHandle),
    /// Both colliders; none for one that is gone.
    pub sides: [Option<Side>; 2],
    /// For the first difference, when a folder was given: the file for `pbig replay` with the boxes of
    /// the calls up to it, or why it could not be written.
    pub replay: Option<Result<PathBuf, String>>,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b] = [self.pair.0, self.pair.1].map(|handle| handle.into_raw_parts());
        write!(f, "call {}: colliders {a:?} and {b:?}: {}", self.call, self.fault.reason())?;
        for (handle, side) in [a, b].iter().zip(&self.sides) {
            match side {
                Some(side) => write!(f, "; {handle:?}: {side}")?,
                None => write!(f, "; {handle:?}: gone")?,
            }
        }
        match &self.replay {
            Some(Ok(file)) => write!(f, "; pbig replay {}", file.display()),
            Some(Err(error)) => write!(f, "; no replay: {error}"),
            None => Ok(()),
        }
    }
}
