//! Why two colliders are a pair, or are none.

use crate::PbigBroadPhase;
use pbig_core::{Pair, ProxyFilter};
use rapier3d::prelude::ColliderHandle;
use std::fmt;

/// Whether a pair of colliders is reported and, if not, the first test that ended it. Its `Display` says it in words.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Why {
    /// The narrow phase has been told of the pair. Whether the shapes touch is its business.
    Reported,
    /// Both handles are the same.
    SameCollider,
    /// The broad phase has never heard of this collider, or has been told that it is gone. One that was
    /// inserted since the last step is heard of in the next.
    Unknown(ColliderHandle),
    /// The collider or its body is disabled.
    Disabled(ColliderHandle),
    /// The box of this collider has a NaN, or a lower corner above the upper one.
    InvalidBox(ColliderHandle),
    /// The boxes, with the margins, are apart.
    Apart {
        /// The axis on which they are furthest apart: 0, 1 or 2.
        axis: usize,
        /// The gap between them there, in the world's length unit.
        gap: f32,
    },
    /// Both belong to one body.
    SameBody,
    /// Neither collider's `ActiveCollisionTypes` accept the other's type of body.
    Kinds([ProxyFilter; 2]),
    /// The collision groups exclude each other.
    Groups([ProxyFilter; 2]),
    /// Nothing speaks against the pair, but it has not been searched for since one of the two changed: the last
    /// update failed, or there was none.
    NotYet,
}

impl PbigBroadPhase {
    /// Whether the last update left these two as a pair, and if not, which test ended it.
    ///
    /// ```
    /// use rapier3d::prelude::*;
    /// use rapier_pbig::{PbigBroadPhase, Why};
    ///
    /// let (mut broad_phase, bodies, mut colliders) =
    ///     (PbigBroadPhase::new(), RigidBodySet::new(), ColliderSet::new());
    /// let ball = |x: f32| ColliderBuilder::ball(0.5).translation(vector![x, 0.0, 0.0]);
    /// let handles = [0.0, 0.9, 5.0].map(|x| colliders.insert(ball(x)));
    /// let params = IntegrationParameters::default();
    /// broad_phase.update(&params, &colliders, &bodies, &handles, &[], &mut Vec::new());
    /// assert!(matches!(broad_phase.why(handles[0], handles[1]), Why::Kinds(_)), "both are fixed");
    /// let why = broad_phase.why(handles[0], handles[2]);
    /// assert_eq!(why.to_string(), "not reported: the boxes are 3.978 apart on the x axis");
    /// ```
    pub fn why(&self, one: ColliderHandle, other: ColliderHandle) -> Why {
        if one == other {
            return Why::SameCollider;
        }
        let obstacle = [one, other].into_iter().find_map(|handle| self.obstacle(handle));
        obstacle.unwrap_or_else(|| self.why_not(one.into_raw_parts().0, other.into_raw_parts().0))
    }

    /// What keeps a collider from any pair.
    fn obstacle(&self, handle: ColliderHandle) -> Option<Why> {
        let id = handle.into_raw_parts().0;
        if !self.roll.has(handle) {
            Some(Why::Unknown(handle))
        } else if !self.finder.contains(id) {
            Some(Why::Disabled(handle))
        } else if self.finder.fat_aabb(id).is_none() {
            Some(Why::InvalidBox(handle))
        } else {
            None
        }
    }

    /// For two different colliders that may have pairs.
    fn why_not(&self, a: u32, b: u32) -> Why {
        if self.finder.has_pair(Pair::new(a, b)) {
            return Why::Reported;
        }
        if let Some((axis, gap)) = self.gap(a, b) {
            return Why::Apart { axis, gap };
        }
        match [a, b].map(|id| self.finder.filter(id).copied().unwrap_or_default()) {
            [x, y] if !x.bodies_allow(&y) => Why::SameBody,
            both @ [x, y] if !x.kinds_allow(&y) => Why::Kinds(both),
            both @ [x, y] if !x.groups_allow(&y) => Why::Groups(both),
            _ => Why::NotYet,
        }
    }

    /// The axis on which two boxes are furthest apart, if there is one, and by how much.
    fn gap(&self, a: u32, b: u32) -> Option<(usize, f32)> {
        let (a, b) = (self.finder.fat_aabb(a)?, self.finder.fat_aabb(b)?);
        let gaps = (0..3).map(|k| (k, (a.min[k] - b.max[k]).max(b.min[k] - a.max[k])));
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
        let both = |bits: fn(&ProxyFilter) -> u32, filters: &[ProxyFilter; 2]| filters.map(|one| bits(&one));
        match self {
            Self::Reported => Ok(()),
            Self::SameCollider => write!(f, "both handles are the same"),
            Self::Unknown(handle) => write!(f, "collider {:?} is unknown or gone", handle.into_raw_parts()),
            Self::Disabled(handle) => {
                write!(f, "collider {:?}, or its body, is disabled", handle.into_raw_parts())
            }
            Self::InvalidBox(handle) => {
                write!(f, "the box of collider {:?} is invalid: a NaN, perhaps", handle.into_raw_parts())
            }
            Self::Apart { axis, gap } => {
                write!(f, "the boxes are {gap:.3} apart on the {} axis", ["x", "y", "z"][axis % 3])
            }
            Self::SameBody => write!(f, "both belong to one body"),
            Self::Kinds(filters) => {
                let [a, b] = both(|one| one.kind.trailing_zeros(), filters).map(kind_name);
                write!(f, "a {a} and a {b} body do not collide with these ActiveCollisionTypes")
            }
            Self::Groups(filters) => {
                let [a, b] = both(|one| one.memberships, filters);
                let [c, d] = both(|one| one.mask, filters);
                write!(f, "groups exclude each other: {a:#x} that meets {c:#x}, {b:#x} that meets {d:#x}")
            }
            Self::NotYet => write!(f, "no update since one of them changed"),
        }
    }
}

/// In the order of rapier's `RigidBodyType`.
fn kind_name(kind: u32) -> &'static str {
    ["dynamic", "fixed", "position-based kinematic", "velocity-based kinematic"]
        .get(kind as usize)
        .copied()
        .unwrap_or("unknown")
}
