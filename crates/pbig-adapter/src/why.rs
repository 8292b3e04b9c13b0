//! Explains why two colliders are a pair or not.

use crate::{BodyKind, Bounds, BoxStore, Colliders, Groups, Handle, Tree};
use pbig_core::Pair;
use std::fmt;

/// The reason why two colliders are a pair, or the first test that they fail. `Display` puts it in words.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Why {
    /// The pair was reported to the narrow phase, which finds out whether the shapes touch.
    Reported,
    /// Both handles are the same.
    SameCollider,
    /// The broad phase does not know this collider, or rapier removed it. A collider that was inserted since the last step
    /// becomes known in the next one.
    Unknown(Handle),
    /// The collider or its body is disabled.
    Disabled(Handle),
    /// The AABB of this collider has a NaN, or a lower corner above the upper one.
    InvalidBox(Handle),
    /// The AABBs, with their margins, do not overlap.
    Apart {
        /// The axis with the largest gap: 0, 1 or 2.
        axis: usize,
        /// The gap on that axis, in the world's length unit.
        gap: f32,
    },
    /// Both belong to one body.
    SameBody,
    /// Neither collider's `ActiveCollisionTypes` accept the other's type of body.
    BodyTypes([BodyKind; 2]),
    /// The collision groups exclude each other.
    Groups([Groups; 2]),
    /// The two may be a pair, but no update succeeded since one of them changed.
    NotYet,
}

impl<T: Tree> Colliders<T> {
    /// Returns why these two colliders are a pair since the last update, or the first test that they fail.
    pub fn why(&self, one: Handle, other: Handle) -> Why {
        if one == other {
            return Why::SameCollider;
        }
        let obstacle = [one, other].into_iter().find_map(|handle| self.obstacle(handle));
        obstacle.unwrap_or_else(|| self.why_not(one.index, other.index))
    }

    /// Returns the reason why a collider has no pairs at all.
    fn obstacle(&self, handle: Handle) -> Option<Why> {
        let id = handle.index;
        if !self.registry.contains(handle) {
            Some(Why::Unknown(handle))
        } else if !self.core.contains(id) {
            Some(Why::Disabled(handle))
        } else if self.boxes.fat(&self.core, id).is_none() {
            Some(Why::InvalidBox(handle))
        } else {
            None
        }
    }

    /// Explains two different colliders that may be in pairs.
    fn why_not(&self, a: u32, b: u32) -> Why {
        let pair = Pair::new(a, b);
        if self.core.has_pair(pair) && self.boxes.admits(&pair) {
            return Why::Reported;
        }
        if let Some((axis, gap)) = self.gap(a, b) {
            return Why::Apart { axis, gap };
        }
        match [a, b].map(|id| self.core.filter(id).copied().unwrap_or_default()) {
            [x, y] if !x.bodies_allow(&y) => Why::SameBody,
            both @ [x, y] if !x.kinds_allow(&y) => Why::BodyTypes(both.map(|filter| BodyKind::of(&filter))),
            both @ [x, y] if !x.groups_allow(&y) => Why::Groups(both.map(|filter| Groups::of(&filter))),
            _ => Why::NotYet,
        }
    }

    /// Returns the axis with the largest gap between two AABBs, and the gap, unless they overlap.
    fn gap(&self, a: u32, b: u32) -> Option<(usize, f32)> {
        let (a, b) = (self.boxes.fat(&self.core, a)?, self.boxes.fat(&self.core, b)?);
        let gaps = (0..3).map(|k| (k, a.gap(&b, k)));
        // Between equal infinities a gap is NaN.
        let (axis, gap) = gaps.filter(|(_, gap)| !gap.is_nan()).max_by(|x, y| x.1.total_cmp(&y.1))?;
        (!a.overlaps(&b)).then_some((axis, gap))
    }
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::Reported {
            return write!(f, "reported: the boxes overlap and no filter excludes the pair");
        }
        write!(f, "not reported: ")?;
        match self {
            Self::Reported => Ok(()),
            Self::SameCollider => write!(f, "both handles are the same"),
            Self::Unknown(handle) => write!(f, "collider {:?} is unknown or gone", handle),
            Self::Disabled(handle) => {
                write!(
                    f,
                    "collider {:?}, or its body, is disabled, perhaps because it was not finite (rapier 0.36)",
                    handle
                )
            }
            Self::InvalidBox(handle) => {
                write!(f, "the box of collider {:?} is invalid: a NaN, perhaps", handle)
            }
            Self::Apart { axis, gap } => {
                write!(f, "the boxes are {gap:.3} apart on the {} axis", ["x", "y", "z"][axis % 3])
            }
            Self::SameBody => write!(f, "both belong to one body"),
            Self::BodyTypes(types) => {
                let [a, b] = types.map(BodyKind::name);
                write!(f, "a {a} and a {b} body do not collide with these ActiveCollisionTypes")
            }
            Self::Groups(groups) => {
                let [a, b] = groups.map(|one| one.memberships);
                let [c, d] = groups.map(|one| one.mask);
                write!(f, "groups exclude each other: {a:#x} that meets {c:#x}, {b:#x} that meets {d:#x}")
            }
            Self::NotYet => write!(f, "no update since one of them changed"),
        }
    }
}
