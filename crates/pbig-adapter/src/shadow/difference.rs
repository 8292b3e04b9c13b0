//! Describes what a checker found wrong.

use crate::{BodyKind, Groups, Handle, HandlePair};
use pbig_core::Aabb;
use std::fmt;
use std::path::PathBuf;

/// The fault of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The AABBs overlap and the filters allow the pair, but it was not reported.
    Missing,
    /// Only stock reports the pair, and parry finds a contact within the prediction distance.
    MissingContact,
    /// The pair was reported, although the AABBs are further apart than the margins, a filter excludes the pair, or a collider
    /// is removed or disabled.
    Spurious,
    /// An `AddPair` for a pair that the narrow phase has.
    AddedTwice,
    /// A `DeletePair` for a pair that the narrow phase does not have.
    DeletedUnknown,
    /// The pair was deleted and added in one call: the narrow phase would lose its contacts.
    Flickered,
    /// A pair of a collider with itself, at which rapier panics.
    WithItself,
}

impl Fault {
    /// Returns true if the pair should have been reported and was not.
    pub fn is_missing(self) -> bool {
        matches!(self, Self::Missing | Self::MissingContact)
    }

    /// Returns the reason in words.
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

/// A collider of a difference, at the time of the call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// Its AABB without margin, in f32; `None` if it is disabled.
    pub aabb: Option<Aabb>,
    /// Its body.
    pub parent: Option<Handle>,
    /// The type of its body; `Fixed` without a body.
    pub body_type: BodyKind,
    /// The bits of its `ActiveCollisionTypes`.
    pub active_collision_types: u16,
    /// Its collision groups.
    pub groups: Groups,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.aabb {
            Some(aabb) => write!(f, "box {:?} to {:?}", aabb.min, aabb.max)?,
            None => write!(f, "disabled")?,
        }
        match self.parent {
            Some(parent) => write!(f, ", {:?} body {parent:?}", self.body_type)?,
            None => write!(f, ", no body")?,
        }
        let Groups { memberships, mask, mode } = self.groups;
        let types = self.active_collision_types;
        write!(f, ", groups {memberships:#x} with {mask:#x} ({mode:?}), active types {types:#06x}")
    }
}

/// A pair that the broad phase got wrong.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Difference {
    /// The number of the call in which the fault was noticed, from 0.
    pub call: usize,
    /// The fault.
    pub fault: Fault,
    /// The pair.
    pub pair: HandlePair,
    /// Both colliders; `None` for a removed one.
    pub sides: [Option<Side>; 2],
    /// The file for `pbig replay` with the AABBs of the calls up to the difference, or why it could not be written. Only for
    /// the first difference, and only if a folder was given.
    pub replay: Option<Result<PathBuf, String>>,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let HandlePair(a, b) = self.pair;
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
