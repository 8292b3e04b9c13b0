//! Filters that exclude pairs. They are tested where pairs are found, not afterwards (contract 6).

use bytemuck::{Pod, Zeroable};

/// The properties of a box, besides its AABB, that decide about its pairs: all of rapier's early filters.
///
/// 16 bytes, one `vec4<u32>` on a GPU. Two boxes may pair when
/// 1. they have different bodies (or no body), and
/// 2. either one accepts the other's kind (rapier's `ActiveCollisionTypes`), and
/// 3. their groups allow it: both ways, or either way when both filters say [`TestMode::Or`].
///
/// ```
/// use pbig_core::ProxyFilter;
/// let wheel = ProxyFilter { body: 7, ..ProxyFilter::ALL };
/// assert!(!wheel.allows(&wheel));
/// assert!(wheel.allows(&ProxyFilter::ALL));
/// ```
///
/// Groups can divide the boxes of a [`crate::BroadPhase`] into two sides whose boxes pair with the other side only. A pair within
/// a side still costs a test, so a side that is a crowd takes time. [`crate::Finder::find_between`] does not test such pairs.
///
/// ```
/// use pbig_core::ProxyFilter;
/// let one = ProxyFilter { memberships: 1, mask: 2, ..ProxyFilter::ALL };
/// let other = ProxyFilter { memberships: 2, mask: 1, ..ProxyFilter::ALL };
/// assert!(one.allows(&other) && !one.allows(&one) && !other.allows(&other));
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ProxyFilter {
    /// The body that the box belongs to; boxes of one body never pair. [`ProxyFilter::NO_BODY`]
    /// pairs with everything.
    pub body: u32,
    /// The kind of the box (dynamic, fixed, ...), one bit of eight.
    pub kind: u8,
    /// The kinds that the box accepts, a bit each.
    pub accepted_kinds: u8,
    /// The [`TestMode`] that combines the groups, as an integer of which the lowest bit counts.
    pub test_mode: u16,
    /// Groups that the box is a member of, a bit each.
    pub memberships: u32,
    /// Groups that the box may pair with, a bit each.
    pub mask: u32,
}

/// The rule that combines memberships and masks.
#[repr(u16)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TestMode {
    /// Each box's mask must contain a group of the other's (rapier's rule).
    And = 0,
    /// One direction is enough, provided that both boxes say `Or`.
    Or = 1,
}

impl ProxyFilter {
    /// The body of a box without one.
    pub const NO_BODY: u32 = u32::MAX;

    /// The filter without a restriction: two boxes that have it may pair.
    pub const ALL: Self = Self {
        body: Self::NO_BODY,
        kind: 1,
        accepted_kinds: u8::MAX,
        test_mode: TestMode::And as u16,
        memberships: u32::MAX,
        mask: u32::MAX,
    };

    /// Returns true if both filters are equal. One comparison rather than six.
    #[inline]
    pub(crate) fn is(&self, other: &Self) -> bool {
        bytemuck::cast::<_, [u64; 2]>(*self) == bytemuck::cast::<_, [u64; 2]>(*other)
    }

    /// Returns true if the two boxes may pair. Symmetric.
    #[inline]
    pub fn allows(&self, other: &Self) -> bool {
        self.bodies_allow(other) & self.kinds_allow(other) & self.groups_allow(other)
    }

    /// Returns true if the boxes pass the first of the three tests: different bodies, or no body.
    #[inline]
    pub fn bodies_allow(&self, other: &Self) -> bool {
        (self.body != other.body) | (self.body == Self::NO_BODY)
    }

    /// Returns true if the boxes pass the second test: either one accepts the other's kind.
    #[inline]
    pub fn kinds_allow(&self, other: &Self) -> bool {
        (self.accepted_kinds & other.kind) | (other.accepted_kinds & self.kind) != 0
    }

    /// Returns true if the boxes pass the third test: memberships and masks.
    #[inline]
    pub fn groups_allow(&self, other: &Self) -> bool {
        let forth = self.memberships & other.mask != 0;
        let back = other.memberships & self.mask != 0;
        let either = self.test_mode & other.test_mode & TestMode::Or as u16 != 0;
        (forth & back) | (either & (forth | back))
    }
}

impl Default for ProxyFilter {
    fn default() -> Self {
        Self::ALL
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: ProxyFilter = ProxyFilter::ALL;

    fn both_ways(a: ProxyFilter, b: ProxyFilter) -> bool {
        assert_eq!(a.allows(&b), b.allows(&a), "the filter must be symmetric");
        a.allows(&b)
    }

    #[test]
    fn sixteen_bytes_so_that_it_uploads_as_one_vector() {
        assert_eq!(size_of::<ProxyFilter>(), 16);
        assert_eq!(std::mem::offset_of!(ProxyFilter, memberships), 8);
    }

    #[test]
    fn boxes_of_one_body_never_pair_but_bodiless_boxes_do() {
        let (one, two) = (ProxyFilter { body: 1, ..ALL }, ProxyFilter { body: 2, ..ALL });
        assert!(!both_ways(one, one) && both_ways(one, two) && both_ways(ALL, ALL));
    }

    #[test]
    fn one_side_that_accepts_the_other_kind_is_enough() {
        let fixed = ProxyFilter { kind: 2, accepted_kinds: 0, ..ALL };
        let likes_fixed = ProxyFilter { kind: 1, accepted_kinds: 2, ..ALL };
        assert!(!both_ways(fixed, fixed) && both_ways(fixed, likes_fixed));
    }

    #[test]
    fn groups_must_allow_both_ways_unless_both_say_or() {
        let a = ProxyFilter { memberships: 1, mask: 2, ..ALL };
        let b = ProxyFilter { memberships: 2, mask: 4, ..ALL };
        let or = |f: ProxyFilter| ProxyFilter { test_mode: TestMode::Or as u16, ..f };
        assert!(!both_ways(a, b) && !both_ways(or(a), b) && both_ways(or(a), or(b)));
    }
}
