//! Camps: boxes no two of which may pair, so that nobody needs to look for pairs within one.
//!
//! Thousands of boxes in one place are the worst that can happen to a grid: all are tested against all. Where
//! pairs are wanted that is the price. Often none are: debris that ignores debris, many colliders on one
//! body, fixed bodies. Filters tell: a *class* of boxes, those with equal filters but for the body, or a *body*, that
//! excludes itself is a camp, and so is a set of classes that exclude each other. Each camp gets grids of its own, which
//! only others search.

use crate::ProxyFilter;
use std::collections::HashMap;

/// Fewer boxes than this are no camp: searching them costs less than another grid.
const FEWEST: u32 = 64;

/// Fewer filters of a sample than this are chance.
const FEWEST_SEEN: u32 = 8;

/// Most classes that are looked at, the largest ones.
const CLASSES: usize = 32;

/// Most bodies that are camps of their own, the largest ones.
const BODIES: usize = 6;

/// Which boxes never pair with each other.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Camps {
    /// Filters without a body: the first camp.
    classes: Vec<ProxyFilter>,
    /// One further camp each.
    bodies: Vec<u32>,
}

/// The camp of boxes that are in none.
pub(crate) const OPEN: u8 = 0;

fn class_of(filter: &ProxyFilter) -> ProxyFilter {
    ProxyFilter { body: ProxyFilter::NO_BODY, ..*filter }
}

impl Camps {
    /// The camps among boxes with these filters, each of which stands for `each` boxes.
    pub(crate) fn of<'a>(filters: impl Iterator<Item = &'a ProxyFilter>, each: u32) -> Self {
        let (mut classes, mut bodies) = (HashMap::new(), HashMap::new());
        for filter in filters {
            *classes.entry(class_of(filter)).or_insert(0u32) += each;
            *bodies.entry((filter.body, class_of(filter))).or_insert(0u32) += each;
        }
        let fewest = FEWEST.max(FEWEST_SEEN * each);
        let classes = first_camp(largest(classes, CLASSES), fewest);
        let mut by_body: HashMap<u32, u32> = HashMap::new();
        for ((body, class), count) in bodies {
            if body != ProxyFilter::NO_BODY && !classes.contains(&class) {
                *by_body.entry(body).or_insert(0) += count;
            }
        }
        let bodies = largest(by_body, BODIES).into_iter().filter(|(_, count)| *count >= fewest);
        Self { classes, bodies: bodies.map(|(body, _)| body).collect() }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.classes.is_empty() && self.bodies.is_empty()
    }

    /// How many there are, the open one included.
    pub(crate) fn count(&self) -> usize {
        2 + self.bodies.len()
    }

    /// The camp of a box, [`OPEN`] if it is in none. Two filters of another camp never allow each other.
    pub(crate) fn camp(&self, filter: &ProxyFilter) -> u8 {
        if self.classes.contains(&class_of(filter)) {
            return 1;
        }
        self.bodies.iter().position(|body| *body == filter.body).map_or(OPEN, |i| i as u8 + 2)
    }
}

/// The keys with the largest counts, largest first; among equals in a fixed order.
fn largest<K: Copy + Ord>(counts: HashMap<K, u32>, most: usize) -> Vec<(K, u32)> {
    let mut counts: Vec<(K, u32)> = counts.into_iter().collect();
    counts.sort_unstable_by_key(|&(key, count)| (std::cmp::Reverse(count), key));
    counts.truncate(most);
    counts
}

/// Classes that exclude themselves and each other, the largest first; none when they are few.
fn first_camp(classes: Vec<(ProxyFilter, u32)>, fewest: u32) -> Vec<ProxyFilter> {
    let (mut camp, mut boxes): (Vec<ProxyFilter>, u32) = (Vec::new(), 0);
    for (class, count) in classes {
        if !class.allows(&class) && camp.iter().all(|other| !class.allows(other)) {
            camp.push(class);
            boxes += count;
        }
    }
    if boxes < fewest { Vec::new() } else { camp }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: ProxyFilter = ProxyFilter::ALL;
    const FIXED: ProxyFilter = ProxyFilter { kind: 2, accepted_kinds: 1, ..ALL };
    const MOVING: ProxyFilter = ProxyFilter { kind: 1, accepted_kinds: 3, ..ALL };
    const DEBRIS: ProxyFilter = ProxyFilter { memberships: 2, mask: !2, ..MOVING };

    fn camps(parts: &[(ProxyFilter, usize)]) -> Camps {
        let filters: Vec<_> = parts.iter().flat_map(|(filter, count)| vec![*filter; *count]).collect();
        Camps::of(filters.iter(), 1)
    }

    #[test]
    fn classes_that_exclude_themselves_and_each_other_are_a_camp() {
        let found = camps(&[(MOVING, 500), (FIXED, 300), (DEBRIS, 400)]);
        assert_eq!([MOVING, FIXED, DEBRIS].map(|one| found.camp(&one)), [OPEN, OPEN, 1]);
        // Fixed bodies meet debris; they are a camp where they are more.
        let found = camps(&[(MOVING, 500), (FIXED, 500), (DEBRIS, 400)]);
        assert_eq!([MOVING, FIXED, DEBRIS].map(|one| found.camp(&one)), [OPEN, 1, OPEN]);
        let quiet = ProxyFilter { memberships: 0, ..FIXED };
        let found = camps(&[(FIXED, 50), (quiet, 50)]);
        assert_eq!([FIXED, quiet].map(|one| found.camp(&one)), [1, 1]);
    }

    #[test]
    fn bodies_with_many_boxes_are_camps_of_their_own() {
        let of = |body: u32| ProxyFilter { body, ..MOVING };
        let found = camps(&[(of(1), 70), (of(2), 63), (of(3), 100), (ALL, 1000)]);
        assert_eq!([of(1), of(2), of(3), ALL].map(|one| found.camp(&one)), [3, OPEN, 2, OPEN]);
        assert!(camps(&[(ALL, 1000), (FIXED, 60)]).is_empty());
    }

    #[test]
    fn two_filters_of_one_camp_never_allow_each_other() {
        let bits = |i: u32| ProxyFilter {
            body: if i.is_multiple_of(5) { ProxyFilter::NO_BODY } else { i % 7 },
            kind: 1 << (i % 3),
            accepted_kinds: (i / 3 % 8) as u8,
            test_mode: (i % 2) as u16,
            memberships: i / 5 % 16,
            mask: i / 11 % 16,
        };
        let filters: Vec<ProxyFilter> = (0..3000).map(bits).collect();
        let found = Camps::of(filters.iter(), 1);
        let mut tested = 0;
        for a in &filters {
            for b in filters.iter().filter(|b| found.camp(a) != OPEN && found.camp(a) == found.camp(b)) {
                assert!(!a.allows(b), "{a:?} {b:?}");
                tested += 1;
            }
        }
        assert!(tested > 10_000, "{tested}");
    }
}
