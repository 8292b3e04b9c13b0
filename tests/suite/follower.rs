//! A broad phase whose events are followed, and whose pairs are compared with the oracle's.

use pbig_core::{Aabb, Backend, BroadPhase, Pair, ProxyFilter, oracle};
use pbig_tests::Way;
use std::collections::{BTreeSet, HashSet};

/// A broad phase with the state of its caller: the boxes that were set, and the pairs by the events.
pub(crate) struct Follower {
    pub(crate) broad_phase: BroadPhase,
    pub(crate) boxes: Vec<Option<(Aabb, ProxyFilter)>>,
    pairs: BTreeSet<Pair>,
    /// Ids removed since the last update: their pairs end without an event.
    gone: HashSet<u32>,
}

impl Follower {
    pub(crate) fn new(way: impl Into<Way>, ids: usize) -> Self {
        let broad_phase = way.into().broad_phase();
        Self { broad_phase, boxes: vec![None; ids], pairs: BTreeSet::new(), gone: HashSet::new() }
    }

    pub(crate) fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) {
        self.boxes[id as usize] = Some((aabb, filter));
        self.broad_phase.set(id, aabb, filter).expect("a small id");
    }

    pub(crate) fn remove(&mut self, id: u32) {
        let was_there = self.boxes[id as usize].take().is_some();
        assert_eq!(self.broad_phase.remove(id), was_there);
        self.gone.insert(id);
    }

    fn forget_pairs_of_removed(&mut self) {
        if !self.gone.is_empty() {
            self.pairs.retain(|p| !self.gone.contains(&p.a) && !self.gone.contains(&p.b));
            self.gone.clear();
        }
    }

    pub(crate) fn has(&self, id: u32) -> bool {
        self.boxes[id as usize].is_some()
    }

    /// Updates, follows the events, and compares.
    pub(crate) fn update(&mut self, what: &str) {
        self.follow(what);
        let kept: BTreeSet<Pair> = self.broad_phase.pairs().collect();
        assert_eq!(self.pairs, kept, "{what}: events lead elsewhere");
        assert_eq!(self.pairs, self.wanted(), "{what}: {}", self.broad_phase.report().plan);
        self.fat_boxes_are_near(what);
    }

    /// Updates and follows the events, without a comparison: of a million updates only a sample is compared.
    pub(crate) fn update_unchecked(&mut self) {
        self.follow("not compared");
    }

    fn follow(&mut self, what: &str) {
        self.forget_pairs_of_removed();
        let events = self.broad_phase.update().expect("within the limits");
        assert!(events.added.is_sorted() && events.removed.is_sorted(), "{what}: events out of order");
        for pair in &events.removed {
            assert!(self.pairs.remove(pair), "{what}: {pair:?} ended but was not there");
        }
        for pair in &events.added {
            assert!(self.pairs.insert(*pair), "{what}: {pair:?} added twice");
        }
        self.assert_done_as_asked(what);
    }

    /// Asserts that the wanted backend did the work. The CPU finds the same pairs, so a fallback would hide a broken GPU.
    fn assert_done_as_asked(&self, what: &str) {
        let report = self.broad_phase.report();
        assert_eq!(report.fallback, None, "{what}");
        // With fewer boxes a device may still be asked for ended pairs.
        let searched = report.changed > 0 && report.boxes - report.invalid > 1;
        let on_gpu = report.device.is_some();
        match self.broad_phase.config().backend {
            Backend::Device => assert!(on_gpu || !searched, "{what}: no GPU; {}", report.plan),
            Backend::Cpu | Backend::Brute => assert!(!on_gpu, "{what}: a GPU; {}", report.plan),
            Backend::Auto => {}
            other => panic!("{what}: what is done by {other:?}?"),
        }
    }

    /// Returns the oracle's pairs of the fat boxes.
    fn wanted(&self) -> BTreeSet<Pair> {
        let fat: Vec<Aabb> = (0..self.boxes.len() as u32)
            .map(|id| self.broad_phase.fat_aabb(id).unwrap_or(Aabb::NOWHERE))
            .collect();
        let filter = |id: u32| self.boxes[id as usize].map_or(ProxyFilter::ALL, |b| b.1);
        oracle::pairs_where(&fat, |a, b| filter(a).allows(&filter(b))).into_iter().collect()
    }

    /// Asserts that each fat box contains its box and reaches at most two margins beyond.
    fn fat_boxes_are_near(&self, what: &str) {
        let slack = 2.0 * self.broad_phase.config().margin;
        for (id, given) in self.boxes.iter().enumerate() {
            let fat = self.broad_phase.fat_aabb(id as u32);
            let valid = given.is_some_and(|(aabb, _)| aabb.is_valid());
            assert_eq!(fat.is_some(), valid, "{what}: box {id}");
            if let (Some(fat), Some((aabb, _))) = (fat, given) {
                for k in 0..3 {
                    let (below, above) = (aabb.min[k] - fat.min[k], fat.max[k] - aabb.max[k]);
                    assert!(
                        fat.min[k] <= aabb.min[k] && fat.max[k] >= aabb.max[k],
                        "{what}: box {id} outside"
                    );
                    // The gap between equal infinities is NaN.
                    let near = |gap: f32| gap.is_nan() || gap <= slack;
                    assert!(near(below) && near(above), "{what}: box {id} too fat");
                }
            }
        }
    }
}
