//! A broad phase whose events are followed, whose pairs are compared with the oracle's, and whose work the wanted backend does.

use pbig_core::{Aabb, Backend, BroadPhase, ProxyFilter};
use pbig_harness::follower;
use pbig_tests::Way;
use std::ops::{Deref, DerefMut};

/// Follows a way to find pairs, and panics at the first difference.
pub(crate) struct Follower(follower::Follower);

impl Deref for Follower {
    type Target = follower::Follower;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for Follower {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl Follower {
    pub(crate) fn new(way: impl Into<Way>, ids: usize) -> Self {
        Self::of(way.into().broad_phase(), ids)
    }

    pub(crate) fn of(broad_phase: BroadPhase, ids: usize) -> Self {
        Self(follower::Follower::new(broad_phase, ids))
    }

    pub(crate) fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) {
        self.0.set(id, aabb, filter).expect("a small id");
    }

    pub(crate) fn remove(&mut self, id: u32) {
        self.0.remove(id).expect("a box that both know or neither");
    }

    /// Updates, follows the events, and compares.
    pub(crate) fn update(&mut self, what: &str) {
        self.0.update().unwrap_or_else(|why| panic!("{what}: {why}"));
        self.assert_done_as_asked(what);
    }

    /// Updates and follows the events, without a comparison: of a million updates only a sample is compared.
    pub(crate) fn update_unchecked(&mut self) {
        self.0.follow().expect("events that follow the last ones");
        self.assert_done_as_asked("not compared");
    }

    /// Asserts that the wanted backend did the work. The CPU finds the same pairs, so a fallback would hide a broken GPU.
    fn assert_done_as_asked(&self, what: &str) {
        let report = self.broad_phase.report();
        assert_eq!(report.fallback, None, "{what}");
        let searched = report.changed > 0 && report.boxes - report.invalid > 1;
        let on_gpu = report.device.is_some();
        match self.broad_phase.config().backend {
            Backend::Device => assert!(on_gpu || !searched, "{what}: no GPU; {}", report.plan),
            Backend::Cpu | Backend::Brute => assert!(!on_gpu, "{what}: a GPU; {}", report.plan),
            Backend::Auto => {}
            other => panic!("{what}: what is done by {other:?}?"),
        }
    }
}
